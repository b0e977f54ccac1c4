"""By how much two tables differ that should be the same."""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from keystab.provenance.foreign_tables import read_foreign_table
from keystab.study.column_tolerances import NOTHING, Allowed, allowed_in

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["Allowed", "AllowedIn", "Difference", "difference", "file_difference"]

AllowedIn = Mapping[str, Allowed] | Allowed
"""What floating-point numbers may differ by: by column, or in all columns."""

_NUMBERS_OF_SETTINGS = ("n_spo", "n_passes", "n_views", "n_samples", "n_blocks")

_MOST_MORE_ROWS = 3
"""Rows that one table may have more than another and still be compared with it row by row."""


@dataclasses.dataclass(frozen=True)
class Difference:
    """How far one table is from another.

    Parameters
    ----------
    words : str
        What differs and by how much, in one line; empty where nothing does.
    within : bool
        Whether the tables agree within what is allowed.
    """

    words: str = ""
    within: bool = True


def difference(
    expected: pd.DataFrame, found: pd.DataFrame, allowed: AllowedIn = NOTHING
) -> Difference:
    """Compare two tables, row by row in their order.

    Parameters
    ----------
    expected, found : pandas.DataFrame
    allowed : Allowed or mapping from str to Allowed, optional
        What floating-point numbers may differ by, in all columns or by column; other columns, whole
        numbers, texts and missing values agree with themselves alone.

    Returns
    -------
    Difference
        Of the column that differs most in relation to what is allowed. Where all comes down to one
        keypoint more or less, it says so, and where.

    Examples
    --------
    >>> import pandas as pd
    >>> one = pd.DataFrame({"auc": [0.5, 0.75]})
    >>> difference(one, one + 1e-13, {"auc": Allowed(relative=1e-12)}).within
    True
    >>> print(difference(one, pd.DataFrame({"auc": [0.5, 0.8]})).words)
    auc differs in 1 of 2 rows, most in row 2, by 0.05 (7%): 0.75 became 0.8
    >>> counts = pd.DataFrame({"n_spo": [3, 4], "n_new": [70, 900]})
    >>> less = counts.assign(n_new=[70, 899])
    >>> print(difference(counts, less).words)
    n_new differs in 1 of 2 rows, most in row 2 (n_spo 4), by 1: 900 became 899; one keypoint less
    """
    if list(expected.columns) != list(found.columns):
        lost = [str(name) for name in expected.columns if name not in found]
        new = [str(name) for name in found.columns if name not in expected]
        parts = [f"lacks {', '.join(lost)}"] if lost else []
        parts += [f"has also {', '.join(new)}"] if new else []
        return Difference(" and ".join(parts) or "has its columns in another order", False)
    if len(expected) != len(found):
        return Difference(_other_rows(expected, found, allowed), False)
    columns = [_column(str(name), expected, found, allowed) for name in expected.columns]
    worst = max(columns, key=lambda it: it.excess, default=None)
    if worst is None or worst.excess == 0:
        return Difference()
    if worst.excess <= 1:
        return Difference(_told(worst, expected, found, ""))
    return Difference(_one_keypoint(columns, expected, found), False)


def file_difference(
    expected: str | os.PathLike[str],
    found: str | os.PathLike[str],
    allowed: AllowedIn | None = None,
) -> Difference:
    """Compare two tables on disk; see `difference`.

    Parameters
    ----------
    expected, found : path
    allowed : Allowed or mapping from str to Allowed, optional
        What `keystab.study.column_tolerances` says of the table of this name by default.

    Raises
    ------
    InputError
        If one of them cannot be read, see `keystab.foreign_tables.read_foreign_table`.
    """
    before, after = (read_foreign_table(Path(path)) for path in (expected, found))
    if allowed is None:
        allowed = allowed_in(Path(expected).stem, map(str, before.columns))
    return difference(before, after, allowed)


class _Column(NamedTuple):
    """How one column differs: by row, and that in units of what is allowed."""

    name: str
    distance: np.ndarray
    by_row: np.ndarray
    is_float: bool

    @property
    def excess(self) -> float:
        return float(self.by_row.max(initial=0.0))


def _column(name: str, expected: pd.DataFrame, found: pd.DataFrame, known: AllowedIn) -> _Column:
    one, other = expected[name], found[name]
    kinds = {one.dtype.kind, other.dtype.kind}
    missing = one.isna().to_numpy(), other.isna().to_numpy()
    both = missing[0] & missing[1]
    if kinds <= set("iuf"):
        allowed = known if isinstance(known, Allowed) else known.get(name, NOTHING)
        allowed = allowed if "f" in kinds else NOTHING
        a, b = one.to_numpy(dtype=float), other.to_numpy(dtype=float)
        most = allowed.absolute + allowed.relative * np.abs(np.where(np.isfinite(a), a, 0.0))
        with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
            distance = np.where((a == b) | both, 0.0, np.abs(b - a))
            distance[np.isnan(distance)] = np.inf
            beyond = np.where(distance > 0, np.inf, 0.0)
            by_row = np.divide(distance, most, out=beyond, where=most > 0)
    else:
        same = (one.astype(str).to_numpy() == other.astype(str).to_numpy()) | both
        by_row = np.where(same & (missing[0] == missing[1]), 0.0, np.inf)
        distance = by_row
    return _Column(name, distance, by_row, "f" in kinds)


def _told(it: _Column, expected: pd.DataFrame, found: pd.DataFrame, where: str) -> str:
    """What differs in one column."""
    # Of rows that differ without bound, that which differs most.
    most = np.flatnonzero(it.by_row == it.by_row.max())
    row = int(most[it.distance[most].argmax()])
    size = it.distance[row]
    amount = ""
    before, after = (table[it.name].iloc[row] for table in (expected, found))
    if np.isfinite(size):
        own = abs(float(before))
        share = f" ({size / own:.0%})" if own and 0.01 * own <= size < 100 * own else ""
        amount = f", by {size:.3g}{share}"
    return (
        f"{it.name} differs in {int((it.by_row > 0).sum())} of {len(expected)} rows, most in row "
        f"{row + 1}{where}{amount}: {before} became {after}"
    )


def _one_keypoint(columns: list[_Column], expected: pd.DataFrame, found: pd.DataFrame) -> str:
    """What differs most; of counts that differ by one keypoint, that it is one and in which row.

    What follows from counts, shares and medians, differs with them.
    """
    beyond = [it for it in columns if it.excess > 1]
    counts = [it for it in beyond if not _is_key(it.name)]
    if not counts or any(it.distance.max() != 1 for it in counts):
        whole = [it for it in beyond if not it.is_float]
        return _told(max(whole or beyond, key=lambda it: it.excess), expected, found, "")
    first = counts[0]
    rows = np.flatnonzero(np.max([it.by_row for it in counts], axis=0) > 1)
    row = int(first.distance.argmax())
    keys = [it.name for it in columns if it.excess == 0 and _is_key(it.name)][:2]
    where = ", ".join(f"{name} {_short(expected[name].iloc[row])}" for name in keys)
    more = found[first.name].iloc[row] > expected[first.name].iloc[row]
    one = "one keypoint more" if more else "one keypoint less"
    told = _told(first, expected, found, f" ({where})" if where else "")
    return f"{told}; " + (one if len(rows) == 1 else f"one keypoint in each of {len(rows)} rows")


def _is_key(name: str) -> bool:
    """Whether a column says what a row is about, and not how much was found."""
    return not name.startswith("n_") or name in _NUMBERS_OF_SETTINGS


def _short(value: object) -> str:
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def _other_rows(expected: pd.DataFrame, found: pd.DataFrame, known: AllowedIn) -> str:
    """What a table has more or less rows than another; which, where these are few keypoints."""
    told = f"has {len(found)} rows instead of {len(expected)}"
    if "keypoint" not in expected:
        return told
    n_before, n_after = (table["keypoint"].nunique() for table in (expected, found))
    n = abs(n_after - n_before)
    number = "one keypoint" if n == 1 else f"{n} keypoints"
    told += f": {number} {'more' if n_after > n_before else 'less'}" if n else ""
    short, long = (found, expected) if len(found) < len(expected) else (expected, found)
    rows = _rows_of_one(long, short, known) if {"y", "x"} <= set(expected.columns) else []
    if not rows:
        return told
    names = [name for name in ("y", "x", "sigma") if name in long]
    places = [
        f"row {row + 1} ({', '.join(f'{name} {long[name].iloc[row]:.6g}' for name in names)})"
        for row in rows
    ]
    return f"{told}, {' and '.join(places)}; the others agree"


def _rows_of_one(long: pd.DataFrame, short: pd.DataFrame, known: AllowedIn) -> list[int]:
    """Rows that one table has and another has not, where that is all by which they differ."""
    more = len(long) - len(short)
    if more > _MOST_MORE_ROWS:
        return []
    left, rows = long.drop(columns="keypoint"), []
    other = short.drop(columns="keypoint").reset_index(drop=True)
    kept = np.arange(len(long))
    for _ in range(more):
        # The first row that is another one is one too many, or nothing fits.
        head = left.iloc[kept[: len(other)]].reset_index(drop=True)
        columns = [_column(str(name), other, head, known) for name in other.columns]
        unlike = np.flatnonzero(np.max([it.by_row for it in columns], axis=0) > 1)
        first = int(unlike[0]) if unlike.size else len(other)
        rows.append(int(kept[first]))
        kept = np.delete(kept, first)
    rest = left.iloc[kept].reset_index(drop=True)
    same = all(_column(str(name), other, rest, known).excess <= 1 for name in other.columns)
    return rows if same else []
