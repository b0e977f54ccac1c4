"""Verdicts on claims: their numbers, taken from tables, and what their criteria say of these.

A criterion is decided where the intervals of its numbers keep off the line
(`keystab.study.decisions`); where they cross it, the claim is undecided.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from keystab.errors import InputError
from keystab.evaluation.intervals import normal_half_width, wilson_interval
from keystab.evaluation.location_errors import quantile
from keystab.study.claims import Claim, Quantity, deciding
from keystab.study.decisions import Decision, Known, decide, holm, interval_of
from keystab.study.expressions import evaluate, names_of

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["Outcome", "VERDICTS", "outcome_of", "outcomes_of", "measured", "tally"]

REPRODUCED, CONDITION, FAILED, UNDECIDED, UNTESTED = (
    "reproduced",
    "reproduced with a condition",
    "not reproduced",
    "undecided",
    "not testable",
)

#: All verdicts, from the best to none.
VERDICTS = (REPRODUCED, CONDITION, FAILED, UNDECIDED, UNTESTED)


class Measured(NamedTuple):
    """A number of a claim; `missing` says why it is not a number, where it is not.

    `low` and `high` are the ends of its 95 % interval. `extreme` is "max" or "min" where it is the
    largest or smallest of `chosen_from` numbers.
    """

    value: float
    low: float = math.nan
    high: float = math.nan
    missing: str = ""
    extreme: str = ""
    chosen_from: int = 1


class Outcome(NamedTuple):
    """A claim, its numbers, and the verdict.

    Attributes
    ----------
    claim : Claim
    measured : mapping of str to Measured
    verdict, note : str
    by_numbers : str
        The verdict that the numbers alone give, as if they were known exactly.
    p : float
        Level at which that is decided, see `keystab.study.decisions.Decision`; NaN where no number
        of the criterion has an interval.
    p_holm : float
        The same for all claims at once; see `outcomes_of`.
    """

    claim: Claim
    measured: Mapping[str, Measured]
    verdict: str
    note: str
    by_numbers: str = ""
    p: float = math.nan
    p_holm: float = math.nan


def measured(quantity: Quantity, tables: Mapping[str, pd.DataFrame]) -> Measured:
    """Take one number from tables.

    Parameters
    ----------
    quantity : Quantity
        Not one that is an expression over others. Its `take` is one of

        - ``one``: the only row,
        - ``mean``, ``median``, ``min``, ``max``, ``sum`` of the rows,
        - ``share``: share of rows for which a comparison holds, with its Wilson interval; rows of
          the same column `by` count as one drawing, and the interval is normal,
        - ``pooled``: sum over that of the column `by`, counts of which it is a part, with the
          Wilson interval,
        - ``sample_mean``, ``sample_median``: of rows that are a sample, with the interval that
          their number allows (1.96 standard errors; order statistics),
        - ``first C``, ``last C``: the row with the smallest or the largest value of column C,
        - ``argmax C``, ``argmin C``: C of the row where the column is largest or smallest,
        - ``largest_step C``, ``smallest_step C``: of the differences from one row to the next, in
          the order of C: negative largest steps mean a column that falls all the way.
    tables : mapping
        Table of each name.

    Returns
    -------
    Measured
        Not a number, with the reason, where no row is left. Rows without a number do not count.

    Examples
    --------
    >>> import pandas as pd
    >>> tables = {"t": pd.DataFrame({"n": [3, 5, 9], "rate": [0.3, 0.2, 0.1]})}
    >>> measured(Quantity("q", tables=("t",), column="rate", take="last n"), tables).value
    0.1
    >>> measured(Quantity("q", tables=("t",), column="rate", take="argmax n"), tables).value
    3.0
    >>> lost = Quantity("q", tables=("t",), rows="n == 4", column="rate", take="mean")
    >>> measured(lost, tables).missing
    't has no row with n == 4'
    """
    table = tables[quantity.tables[0]]
    for name in quantity.tables[1:]:
        table = table.merge(tables[name])
    columns: dict[str, Any] = {str(name): table[name] for name in table}
    if quantity.rows:
        chosen = np.asarray(evaluate(quantity.rows, columns), dtype=bool)
        table = table[np.broadcast_to(chosen, len(table))]
    columns = {str(name): table[name] for name in table}
    numbers = np.broadcast_to(
        np.asarray(evaluate(quantity.column, columns), dtype=np.float64), len(table)
    )
    table, numbers = table[~np.isnan(numbers)], numbers[~np.isnan(numbers)]
    how, *along = quantity.take.split()
    named = " and ".join(quantity.tables)
    rows = f" with {quantity.rows}" if quantity.rows else ""
    if how.endswith("_step") and len(table) == 1:
        return Measured(math.nan, missing=f"{named} has only one row{rows}")
    if not len(table):
        return Measured(math.nan, missing=f"{named} has no row{rows}")
    if how == "one" and len(table) > 1:
        raise InputError(f"{named} has {len(table)} rows{rows}, of which one is to be taken")
    missing = [name for name in (*along, quantity.by) if name and name not in table]
    if missing:
        raise InputError(f"{named} has no column {', '.join(missing)}")
    by = table[quantity.by].to_numpy() if quantity.by else np.arange(len(table))
    if how in _OF_SAMPLES:
        return Measured(*_OF_SAMPLES[how](numbers, by))
    if how in ("mean", "median", "sum"):
        return Measured(float(getattr(np, how)(numbers)))
    ends = _ends(quantity, {str(name): table[name] for name in table}, len(table))
    order = table[along[0]].to_numpy(dtype=np.float64) if along else numbers
    if how.endswith("_step"):
        return _step(how, *(part[np.argsort(order, kind="stable")] for part in (numbers, *ends)))
    if how in ("argmax", "argmin"):
        return Measured(float(order[int(getattr(np, how)(numbers))]))
    row = int(np.argmax(order) if how in ("last", "max") else np.argmin(order))
    extreme = how if how in ("max", "min") else ""
    low, high = (float(end[row]) for end in ends)
    return Measured(float(numbers[row]), low, high, "", extreme, len(numbers) if extreme else 1)


def _ends(quantity: Quantity, columns: Mapping[str, Any], n_rows: int) -> list[NDArray[np.float64]]:
    """Ends of the intervals of the rows; NaN where none are given."""
    if not quantity.low:
        return [np.full(n_rows, np.nan)] * 2
    ends = (evaluate(end, columns) for end in (quantity.low, quantity.high))
    return [np.broadcast_to(np.asarray(end, dtype=np.float64), n_rows) for end in ends]


def _step(
    how: str,
    numbers: NDArray[np.float64],
    low: NDArray[np.float64],
    high: NDArray[np.float64],
) -> Measured:
    """Largest or smallest difference from one row to the next, with the interval of that one."""
    steps = np.diff(numbers)
    row, extreme = (
        (int(steps.argmax()), "max") if how == "largest_step" else (int(steps.argmin()), "min")
    )
    pair = {"a": Known(numbers[row], low[row], high[row])}
    pair["b"] = Known(numbers[row + 1], low[row + 1], high[row + 1])
    below, above = interval_of("b - a", pair)
    return Measured(float(steps[row]), below, above, "", extreme, len(steps))


def _share(holds: NDArray[np.float64], by: NDArray[Any]) -> tuple[float, float, float]:
    """Share of rows, drawn one by one or in the groups `by`."""
    _, group = np.unique(by, return_inverse=True)
    n_rows = np.bincount(group)
    share = float(holds.sum() / len(holds))
    if len(n_rows) == len(holds):
        low, high = wilson_interval(int(holds.sum()), len(holds))
        return share, float(low), float(high)
    apart = np.bincount(group, holds) - share * n_rows  # a ratio of two sums over groups
    error = 1.96 * math.sqrt(float(apart @ apart) * len(n_rows) / max(len(n_rows) - 1, 1))
    error /= len(holds)
    return share, max(0.0, share - error), min(1.0, share + error)


def _pooled(parts: NDArray[np.float64], wholes: NDArray[Any]) -> tuple[float, float, float]:
    """Share of all that is counted in several rows."""
    part, whole = float(parts.sum()), float(np.asarray(wholes, dtype=np.float64).sum())
    low, high = wilson_interval(part, whole)
    return (part / whole if whole else math.nan), float(low), float(high)


def _sample_mean(numbers: NDArray[np.float64], _by: NDArray[Any]) -> tuple[float, float, float]:
    """Mean of a sample."""
    mean, error = float(numbers.mean()), normal_half_width(numbers)
    return mean, mean - error, mean + error


def _sample_median(numbers: NDArray[np.float64], _by: NDArray[Any]) -> tuple[float, float, float]:
    """Median of a sample."""
    found = quantile(numbers)
    return found.value, found.low, found.high


_OF_SAMPLES = {
    "share": _share,
    "pooled": _pooled,
    "sample_mean": _sample_mean,
    "sample_median": _sample_median,
}


def outcome_of(claim: Claim, tables: Mapping[str, pd.DataFrame]) -> Outcome:
    """Compute the numbers of a claim and give the verdict.

    A criterion over a number that does not exist, because settings left out its rows, makes the
    claim not testable; the note then says which rows are missing.

    Raises
    ------
    InputError
        In one line that names the claim, if a table lacks a column.

    Examples
    --------
    >>> import pandas as pd
    >>> taken = Quantity("rate", tables=("t",), column="rate", take="mean")
    >>> claim = Claim("ten", "section 1", "Ten.", "", "10 %", (taken,), "0.08 <= rate <= 0.12")
    >>> outcome_of(claim, {"t": pd.DataFrame({"rate": [0.09, 0.11]})}).verdict
    'reproduced'
    >>> outcome_of(claim, {"t": pd.DataFrame({"rate": [0.02]})}).verdict
    'not reproduced'
    >>> ends = {"low": "low", "high": "high"}
    >>> taken = Quantity("rate", tables=("t",), column="rate", take="one", **ends)
    >>> claim = claim._replace(quantities=(taken,))
    >>> table = pd.DataFrame({"rate": [0.1], "low": [0.07], "high": [0.14]})
    >>> outcome_of(claim, {"t": table}).verdict
    'undecided'
    """
    if not claim.criterion:
        return Outcome(claim, {}, UNTESTED, claim.note, UNTESTED)
    found: dict[str, Measured] = {}
    try:
        for part in claim.quantities:
            found[part.name] = (
                _computed(part, found, claim) if part.expression else measured(part, tables)
            )
        judged = _judged(claim, found)
    except InputError as error:
        raise InputError(f"claim {claim.id}: {error}") from None
    note = " ".join(filter(None, (judged.note, claim.note)))
    return Outcome(claim, found, judged.verdict, note, judged.by_numbers, judged.p)


def _known(claim: Claim, found: Mapping[str, Measured]) -> dict[str, Known]:
    """Numbers as decisions take them."""
    return {
        part.name: Known(
            found[part.name].value,
            low=math.nan if part.expression else found[part.name].low,
            high=math.nan if part.expression else found[part.name].high,
            extreme=found[part.name].extreme,
            chosen_from=found[part.name].chosen_from,
            expression=part.expression,
        )
        for part in claim.quantities
        if part.name in found
    }


def _computed(part: Quantity, found: Mapping[str, Measured], claim: Claim) -> Measured:
    """Compute a number from others; it misses what they miss."""
    used = names_of(part.expression)
    values = {name: np.float64(found[name].value) for name in used}
    value, missing = float(evaluate(part.expression, values)), _missing(used, found)
    ends = (math.nan, math.nan)
    if not missing and math.isfinite(value):
        ends = interval_of(part.expression, _known(claim, found))
    return Measured(value, *ends, missing=missing)


def _missing(names: Collection[str], found: Mapping[str, Measured]) -> str:
    """Say, once each, what is missing among some numbers."""
    reasons = (found[name].missing for name in found if name in names)
    return "; ".join(dict.fromkeys(filter(None, reasons)))


class _Judged(NamedTuple):
    """A verdict, what is to be said about it, and how sure it is."""

    verdict: str
    note: str
    by_numbers: str
    p: float


def _judged(claim: Claim, found: Mapping[str, Measured]) -> _Judged:
    """Give the verdict, and what is to be said about it."""
    numbers = _known(claim, found)

    def no_numbers(expression: str) -> str:
        names = names_of(expression)
        bad = [name for name in found if name in names and math.isnan(found[name].value)]
        return _missing(names, found) or ("no number: " + ", ".join(bad) if bad else "")

    def level(*decisions: Decision) -> float:
        sampled = any(not math.isnan(found[part.name].low) for part in deciding(claim))
        return max(each.p for each in decisions) if sampled else math.nan

    missing = no_numbers(claim.criterion)
    if missing:
        return _Judged(UNTESTED, f"Missing: {missing}.", UNTESTED, math.nan)
    asked = decide(claim.criterion, numbers)
    words = f"Condition: {claim.condition_words}."
    weaker, untested = None, ""
    if claim.condition:
        missing = no_numbers(claim.condition)
        untested = f"Its condition is not tested; missing: {missing}." if missing else ""
        weaker = None if missing else decide(claim.condition, numbers)
    by_numbers = REPRODUCED if asked.holds else FAILED
    if not asked.holds and weaker and weaker.holds:
        by_numbers = CONDITION
    if asked.decided and asked.holds:
        return _Judged(REPRODUCED, "", by_numbers, level(asked))
    if weaker and weaker.decided and weaker.holds:
        # The strongest that is decided: whether it would hold without the condition may stay open.
        told = "" if asked.decided else " Without it the claim is undecided."
        needed = (asked, weaker) if asked.decided else (weaker,)
        return _Judged(CONDITION, words + told, by_numbers, level(*needed))
    if not asked.decided:
        return _Judged(UNDECIDED, f"By the numbers alone: {by_numbers}.", by_numbers, level(asked))
    if weaker and not weaker.decided:
        untested = f"Whether it holds with its condition is undecided ({claim.condition_words})."
    return _Judged(FAILED, untested, by_numbers, level(asked))


def outcomes_of(claims: Iterable[Claim], tables: Mapping[str, pd.DataFrame]) -> list[Outcome]:
    """Evaluate claims, in their order.

    Each verdict is decided by itself, at a level of 5 %; ``p_holm`` is the level of all of them at
    once, after Holm: where it is above 5 %, a claim more or less could be chance.
    """
    found = [outcome_of(claim, tables) for claim in claims]
    sampled = [i for i, each in enumerate(found) if not math.isnan(each.p)]
    for i, p in zip(sampled, holm([found[i].p for i in sampled]), strict=True):
        found[i] = found[i]._replace(p_holm=p)
    return found


def tally(outcomes: Iterable[Outcome]) -> dict[str, int]:
    """Count verdicts.

    Examples
    --------
    >>> tally([Outcome(Claim("a", "", "", "", ""), {}, "not testable", "")])["not testable"]
    1
    """
    verdicts = [each.verdict for each in outcomes]
    return {verdict: verdicts.count(verdict) for verdict in VERDICTS}
