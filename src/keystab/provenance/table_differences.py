"""By how much two tables differ that should be the same."""

from __future__ import annotations

import dataclasses
import os
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from keystab.provenance.foreign_tables import read_foreign_table

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["ATOL", "RTOL", "Difference", "difference", "file_difference"]

RTOL = 1e-6
"""Relative tolerance for numbers of two machines. Rounding differs by some 1e-15 and the least
well-conditioned refinements magnify it a million times."""

ATOL = 1e-9
"""Absolute tolerance, for numbers that are zero but for rounding; positions are in pixels."""


@dataclasses.dataclass(frozen=True)
class Difference:
    """How far one table is from another.

    Parameters
    ----------
    words : str
        What differs and by how much, in one line; empty where nothing does.
    within : bool
        Whether the tables agree within the tolerances.
    """

    words: str = ""
    within: bool = True


def difference(
    expected: pd.DataFrame, found: pd.DataFrame, rtol: float = RTOL, atol: float = ATOL
) -> Difference:
    """Compare two tables, row by row in their order.

    Parameters
    ----------
    expected, found : pandas.DataFrame
    rtol, atol : float, optional
        Numbers agree where they differ by at most ``atol + rtol * abs(expected)``; missing values
        agree with missing values, and everything else only with itself.

    Returns
    -------
    Difference
        Of the column that differs most in relation to what is allowed.

    Examples
    --------
    >>> import pandas as pd
    >>> one = pd.DataFrame({"auc": [0.5, 0.75]})
    >>> difference(one, one + 1e-12).within
    True
    >>> print(difference(one, pd.DataFrame({"auc": [0.5, 0.8]})).words)
    auc differs in 1 of 2 rows, most in row 2, by 0.05 (7%): 0.75 became 0.8
    """
    if list(expected.columns) != list(found.columns):
        lost = [str(name) for name in expected.columns if name not in found]
        new = [str(name) for name in found.columns if name not in expected]
        parts = [f"lacks {', '.join(lost)}"] if lost else []
        parts += [f"has also {', '.join(new)}"] if new else []
        return Difference(" and ".join(parts) or "has its columns in another order", False)
    if len(expected) != len(found):
        return Difference(f"has {len(found)} rows instead of {len(expected)}", False)
    worst, most = Difference(), 0.0
    for name in expected.columns:
        told, excess = _column(str(name), expected[name], found[name], rtol, atol)
        if excess > most:
            worst, most = Difference(told, excess <= 1.0), excess
    return worst


def file_difference(
    expected: str | os.PathLike[str],
    found: str | os.PathLike[str],
    rtol: float = RTOL,
    atol: float = ATOL,
) -> Difference:
    """Compare two tables on disk; see `difference`.

    Raises
    ------
    InputError
        If one of them cannot be read, see `keystab.foreign_tables.read_foreign_table`.
    """
    before, after = (read_foreign_table(Path(path)) for path in (expected, found))
    return difference(before, after, rtol, atol)


def _column(
    name: str, expected: pd.Series, found: pd.Series, rtol: float, atol: float
) -> tuple[str, float]:
    """What differs in one column, and the greatest difference in units of what is allowed."""
    numeric = all(column.dtype.kind in "iuf" for column in (expected, found))
    missing = expected.isna().to_numpy(), found.isna().to_numpy()
    both = missing[0] & missing[1]
    if numeric:
        a, b = expected.to_numpy(dtype=float), found.to_numpy(dtype=float)
        allowed = atol + rtol * np.abs(np.where(np.isfinite(a), a, 0.0))
        with np.errstate(invalid="ignore", over="ignore"):
            distance = np.where(a == b, 0.0, np.abs(b - a))
            distance[both] = 0.0
            distance[np.isnan(distance)] = np.inf
            beyond = np.where(distance > 0, np.inf, 0.0)
            excess = np.divide(distance, allowed, out=beyond, where=allowed > 0)
    else:
        same = (expected.astype(str).to_numpy() == found.astype(str).to_numpy()) | both
        excess = np.where(same & (missing[0] == missing[1]), 0.0, np.inf)
        distance = excess
    differing = int((excess > 0).sum())
    if not differing:
        return "", 0.0
    row = int(excess.argmax())
    amount = ""
    if numeric and np.isfinite(distance[row]):
        size = abs(float(expected.iloc[row]))
        share = (
            f" ({distance[row] / size:.0%})" if 0.01 * size <= distance[row] < 100 * size else ""
        )
        amount = f", by {distance[row]:.3g}{share}"
    told = (
        f"{name} differs in {differing} of {len(expected)} rows, most in row {row + 1}{amount}: "
        f"{expected.iloc[row]} became {found.iloc[row]}"
    )
    return told, float(excess[row])
