"""Verdicts on claims: their numbers, taken from tables, and what their criteria say of these."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from keystab.errors import InputError
from keystab.evaluation.intervals import wilson_interval
from keystab.study.claims import Claim, Quantity
from keystab.study.expressions import evaluate, names_of

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["Outcome", "VERDICTS", "outcome_of", "outcomes_of", "measured", "tally"]

REPRODUCED, CONDITION, FAILED, UNTESTED = (
    "reproduced",
    "reproduced with a condition",
    "not reproduced",
    "not testable",
)

#: All verdicts, from the best to none.
VERDICTS = (REPRODUCED, CONDITION, FAILED, UNTESTED)


class Measured(NamedTuple):
    """A number of a claim; `missing` says why it is not a number, where it is not."""

    value: float
    low: float = math.nan
    high: float = math.nan
    missing: str = ""


class Outcome(NamedTuple):
    """A claim, its numbers, and the verdict."""

    claim: Claim
    measured: Mapping[str, Measured]
    verdict: str
    note: str


def measured(quantity: Quantity, tables: Mapping[str, pd.DataFrame]) -> Measured:
    """Take one number from tables.

    Parameters
    ----------
    quantity : Quantity
        Not one that is an expression over others. Its `take` is one of

        - ``one``: the only row,
        - ``mean``, ``median``, ``min``, ``max``, ``sum`` of the rows,
        - ``share``: share of rows for which a comparison holds, with its Wilson interval,
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
    if how == "share":
        n_true = int(numbers.sum())
        lowest, highest = wilson_interval(n_true, len(numbers))
        return Measured(n_true / len(numbers), float(lowest), float(highest))
    if how in ("mean", "median", "sum"):
        return Measured(float(getattr(np, how)(numbers)))
    missing = [name for name in (*along, quantity.low, quantity.high) if name and name not in table]
    if missing:
        raise InputError(f"{named} has no column {', '.join(missing)}")
    order = table[along[0]].to_numpy(dtype=np.float64) if along else numbers
    if how.endswith("_step"):
        steps = np.diff(numbers[np.argsort(order, kind="stable")])
        return Measured(float(steps.max() if how == "largest_step" else steps.min()))
    if how in ("argmax", "argmin"):
        return Measured(float(order[int(getattr(np, how)(numbers))]))
    row = int(np.argmax(order) if how in ("last", "max") else np.argmin(order))
    if not quantity.low:
        return Measured(float(numbers[row]))
    low, high = (float(table[end].iloc[row]) for end in (quantity.low, quantity.high))
    return Measured(float(numbers[row]), low, high)


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
    """
    if not claim.criterion:
        return Outcome(claim, {}, UNTESTED, claim.note)
    found: dict[str, Measured] = {}
    try:
        for part in claim.quantities:
            found[part.name] = (
                _computed(part.expression, found) if part.expression else measured(part, tables)
            )
        verdict, reason = _verdict(claim, found)
    except InputError as error:
        raise InputError(f"claim {claim.id}: {error}") from None
    return Outcome(claim, found, verdict, " ".join(filter(None, (reason, claim.note))))


def _computed(expression: str, found: Mapping[str, Measured]) -> Measured:
    """Compute a number from others; it misses what they miss."""
    used = names_of(expression)
    values = {name: np.float64(found[name].value) for name in used}
    return Measured(float(evaluate(expression, values)), missing=_missing(used, found))


def _missing(names: Collection[str], found: Mapping[str, Measured]) -> str:
    """Say, once each, what is missing among some numbers."""
    reasons = (found[name].missing for name in found if name in names)
    return "; ".join(dict.fromkeys(filter(None, reasons)))


def _verdict(claim: Claim, found: Mapping[str, Measured]) -> tuple[str, str]:
    """Give the verdict, and what is to be said about it."""
    values = {name: np.float64(part.value) for name, part in found.items()}

    def no_numbers(expression: str) -> str:
        names = names_of(expression)
        bad = [name for name in values if name in names and math.isnan(values[name])]
        return _missing(names, found) or ("no number: " + ", ".join(bad) if bad else "")

    missing = no_numbers(claim.criterion)
    if missing:
        return UNTESTED, f"Missing: {missing}."
    if evaluate(claim.criterion, values):
        return REPRODUCED, ""
    if not claim.condition:
        return FAILED, ""
    missing = no_numbers(claim.condition)
    if missing:
        return FAILED, f"Its condition is not tested; missing: {missing}."
    if evaluate(claim.condition, values):
        return CONDITION, f"Condition: {claim.condition_words}."
    return FAILED, ""


def outcomes_of(claims: Iterable[Claim], tables: Mapping[str, pd.DataFrame]) -> list[Outcome]:
    """Evaluate claims, in their order."""
    return [outcome_of(claim, tables) for claim in claims]


def tally(outcomes: Iterable[Outcome]) -> dict[str, int]:
    """Count verdicts.

    Examples
    --------
    >>> tally([Outcome(Claim("a", "", "", "", ""), {}, "not testable", "")])["not testable"]
    1
    """
    verdicts = [each.verdict for each in outcomes]
    return {verdict: verdicts.count(verdict) for verdict in VERDICTS}
