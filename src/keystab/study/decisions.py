r"""Whether criteria hold of numbers that are known up to intervals.

Each comparison of a criterion is turned into a margin, positive where it holds. Its interval comes
from those of the numbers in it, moved to their ends one at a time. With :math:`d_i` the change of
the margin m by the i-th of them, at its worse and at its better end, it runs from

.. math:: m - \sqrt{\textstyle\sum_i \min(d_i, 0)^2}
          \quad\text{to}\quad m + \sqrt{\textstyle\sum_i \max(d_i, 0)^2}

For a difference of two shares with Wilson intervals that is Newcombe's interval, in general the
method of variance estimates recovery (Zou and Donner 2008). It takes the numbers as independent:
numbers of the same views or keypoints are better given as one number, their paired difference.
"""

from __future__ import annotations

import ast
import math
from collections.abc import Callable, Mapping, Sequence
from statistics import NormalDist
from typing import Any, NamedTuple

import numpy as np

from keystab.study.expressions import evaluate, names_of
from keystab.utils.roots import root_between

__all__ = ["LEVEL", "Decision", "Known", "decide", "holm", "interval_of"]

LEVEL = 0.05
"""A criterion is decided where its margin's interval of 1 - LEVEL does not hold zero."""

_NORMAL = NormalDist()
_Z = _NORMAL.inv_cdf(1 - LEVEL / 2)

_LEAST = 1e-100
"""Levels below are not told apart."""

_SIGNS: dict[type[ast.cmpop], int] = {ast.Lt: 1, ast.LtE: 1, ast.Gt: -1, ast.GtE: -1}
"""Comparisons with a margin: right side minus left side, times this."""


class Known(NamedTuple):
    """A number and what is known about it.

    Parameters
    ----------
    value, low, high : float
        Number and ends of its 95 % interval; NaN where there are none.
    extreme : {"", "max", "min"}
        Whether it is the largest or smallest of several numbers.
    chosen_from : int
        How many these are.
    expression : str
        What computes it from other numbers; empty for one that was measured.
    """

    value: float
    low: float = math.nan
    high: float = math.nan
    extreme: str = ""
    chosen_from: int = 1
    expression: str = ""


class Decision(NamedTuple):
    """What a criterion says of some numbers.

    Attributes
    ----------
    holds : bool
        Of the numbers as they are.
    p : float
        Two-sided level at which that is decided: the interval of 1 - p just touches the line. 0
        where no number has an interval.
    """

    holds: bool
    p: float

    @property
    def decided(self) -> bool:
        """Whether the interval of 1 - `LEVEL` keeps off the line."""
        return self.p <= LEVEL


class _Change(NamedTuple):
    """By how much a number at the ends of its interval lowers and raises something."""

    below: float
    above: float
    rises: bool
    """Whether that something rises with the number."""


def decide(criterion: str, numbers: Mapping[str, Known]) -> Decision:
    """Say whether a criterion holds, and at which level that is decided.

    Parameters
    ----------
    criterion : str
        Comparisons of `numbers`, with ``and``, ``or``, ``not``.
    numbers : mapping of str to Known
        All of them, in an order in which each expression is over numbers before it.

    Returns
    -------
    Decision
        All of several comparisons hold at the level of the weakest. That one of k fails is decided
        at k times the level of the strongest (Bonferroni), since any of them could have. Likewise
        the interval of the largest or smallest of k numbers is one of 1 - p / k where any of these
        would have done.

    Raises
    ------
    InputError
        As `keystab.study.expressions.evaluate`.

    Examples
    --------
    >>> numbers = {"a": Known(0.30, 0.25, 0.35), "b": Known(0.40, 0.35, 0.45)}
    >>> decide("a < b", numbers).decided, decide("a < b - 0.05", numbers).decided
    (True, False)
    >>> decide("a > b", numbers).holds
    False
    """
    tree = ast.parse(criterion.strip(), mode="eval").body
    names_of(criterion)  # refuses what expressions may not say
    return _decision(tree, numbers)


def interval_of(expression: str, numbers: Mapping[str, Known]) -> tuple[float, float]:
    """Interval of an expression over numbers with intervals; NaN where none of them has one.

    Examples
    --------
    >>> numbers = {"a": Known(3.0, 2.0, 4.0), "b": Known(5.0)}
    >>> [float(end) for end in interval_of("b - a / 2", numbers)]
    [3.0, 4.0]
    """
    names = names_of(expression)
    changes = _moved(lambda values: evaluate(expression, values), numbers, names).values()
    if not changes:
        return math.nan, math.nan
    middle = float(evaluate(expression, _values(numbers, {})))
    below, above = (
        math.hypot(*(getattr(change, side) for change in changes)) for side in ("below", "above")
    )
    return middle - below, middle + above


def holm(levels: Sequence[float]) -> list[float]:
    """Levels of many decisions at once, after Holm (1979): never below the single ones.

    Examples
    --------
    >>> holm([0.01, 0.04, 0.03])
    [0.03, 0.06, 0.06]
    """
    adjusted = [0.0] * len(levels)
    so_far = 0.0
    for rank, index in enumerate(sorted(range(len(levels)), key=lambda i: levels[i])):
        so_far = max(so_far, min(1.0, (len(levels) - rank) * levels[index]))
        adjusted[index] = so_far
    return adjusted


def _decision(node: ast.expr, numbers: Mapping[str, Known]) -> Decision:
    """Decide a node of a criterion."""
    match node:
        case ast.UnaryOp(op=ast.Not(), operand=operand):
            inner = _decision(operand, numbers)
            return Decision(not inner.holds, inner.p)
        case ast.BoolOp(op=kind, values=parts):
            found = [_decision(part, numbers) for part in parts]
            all_needed = isinstance(kind, ast.And)
            return _joined(found, all_needed)
        case ast.Compare(left=left, ops=kinds, comparators=rest):
            sides = [left, *rest]
            found = [
                _compared(one, kind, other, numbers)
                for one, kind, other in zip(sides[:-1], kinds, sides[1:], strict=True)
            ]
            # a <= x <= b: x cannot miss both ends, so that one miss is not chosen from several.
            return _joined(found, all_needed=True, chosen=len(found) > 2)
    return Decision(bool(evaluate(ast.unparse(node), _values(numbers, {}))), 0.0)


def _joined(found: Sequence[Decision], all_needed: bool, chosen: bool = True) -> Decision:
    """Join decisions of which all, or one, are needed."""
    against = [each.p for each in found if each.holds is not all_needed]
    if not against:
        return Decision(all_needed, max(each.p for each in found))
    return Decision(not all_needed, min(1.0, min(against) * (len(found) if chosen else 1)))


def _compared(
    left: ast.expr, kind: ast.cmpop, right: ast.expr, numbers: Mapping[str, Known]
) -> Decision:
    """Decide one comparison."""
    holds = bool(evaluate(ast.unparse(ast.Compare(left, [kind], [right])), _values(numbers, {})))
    sign = _SIGNS.get(type(kind), 0)
    sides = [ast.unparse(side) for side in (left, right)]
    if not sign:
        return Decision(holds, 0.0)

    def margin(values: Mapping[str, Any]) -> Any:
        return sign * (evaluate(sides[1], values) - evaluate(sides[0], values))

    names = names_of(sides[0]) | names_of(sides[1])
    middle = abs(float(margin(_values(numbers, {}))))
    towards_line, families = [], []
    for name, change in _moved(margin, numbers, names).items():
        towards_line.append(change.below if holds else change.above)
        # The largest of k numbers: that it lies above the line could be so of any of them.
        extreme = numbers[name].extreme
        one_would_do = extreme and (extreme == "max") == (change.rises == holds)
        families.append(numbers[name].chosen_from if one_would_do else 1)
    return Decision(holds, _level(middle, towards_line, families))


def _level(margin: float, changes: Sequence[float], families: Sequence[int]) -> float:
    """Level at which the interval of a margin touches zero.

    `changes` are those by numbers at the ends of their intervals of 1 - LEVEL, `families` from how
    many each was chosen.
    """
    if not any(changes) or not math.isfinite(margin):
        return 0.0
    if max(families) == 1:
        return 2 * _NORMAL.cdf(-_Z * margin / math.hypot(*changes))

    def too_wide(logarithm: float) -> float:
        """How much wider the interval of this level is than the margin."""
        level = math.exp(logarithm)
        widths = (
            change * _NORMAL.inv_cdf(level / (2 * family)) / _Z
            for change, family in zip(changes, families, strict=True)
        )
        return math.hypot(*widths) - margin

    return math.exp(root_between(too_wide, math.log(_LEAST), 0.0))


def _moved(
    function: Callable[[Mapping[str, Any]], Any], numbers: Mapping[str, Known], names: set[str]
) -> dict[str, _Change]:
    """Move measured numbers to the ends of their intervals, one at a time."""
    middle = float(function(_values(numbers, {})))
    changes: dict[str, _Change] = {}
    for name in sorted(_measured_in(names, numbers)):
        known = numbers[name]
        if math.isnan(known.low) or math.isnan(known.high):
            continue
        at_low, at_high = (
            float(function(_values(numbers, {name: end}))) - middle
            for end in (known.low, known.high)
        )
        changes[name] = _Change(
            -min(at_low, at_high, 0.0), max(at_low, at_high, 0.0), at_high > at_low
        )
    return changes


def _measured_in(names: set[str], numbers: Mapping[str, Known]) -> set[str]:
    """Measured numbers that expressions of these names go back to."""
    found: set[str] = set()
    for name in names:
        expression = numbers[name].expression
        found |= _measured_in(names_of(expression), numbers) if expression else {name}
    return found


def _values(numbers: Mapping[str, Known], moved: Mapping[str, float]) -> dict[str, np.float64]:
    """All numbers, those that follow from others computed again from where these are moved to."""
    values: dict[str, np.float64] = {}
    for name, known in numbers.items():
        if name in moved:
            values[name] = np.float64(moved[name])
        elif known.expression and moved:
            values[name] = np.float64(evaluate(known.expression, values))
        else:
            values[name] = np.float64(known.value)
    return values
