"""Numbers of extrema, and their ratios, with the spread between pieces of the scene.

Extrema of one picture are drawn anew by drawing its pieces with replacement, squares that are
larger than a keypoint: what another scene of the same kind would give. All that is compared is
drawn with the same pieces, so that differences and ratios are paired.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from keystab.evaluation.intervals import bootstrap_counts, percentile_interval

__all__ = ["SIDE", "count_ratios", "piece_numbers", "ratio_intervals"]

SIDE = 32.0
"""Side of a piece in pixels."""


def piece_numbers(tables: Sequence[pd.DataFrame]) -> list[NDArray[np.intp]]:
    """Number the pieces in which the rows of some tables lie, from 0 without gaps.

    Parameters
    ----------
    tables : sequence of DataFrame
        With ``y, x`` in pixels of one frame.

    Examples
    --------
    >>> places = pd.DataFrame({"y": [1.0, 40.0, 2.0], "x": [1.0, 1.0, 3.0]})
    >>> [numbers.tolist() for numbers in piece_numbers([places, places[1:2]])]
    [[0, 1, 0], [1]]
    """
    squares = [
        np.floor(table[["y", "x"]].to_numpy(dtype=float).reshape(-1, 2) / SIDE) for table in tables
    ]
    every = np.concatenate(squares) if squares else np.empty((0, 2))
    _, numbers = np.unique(every, axis=0, return_inverse=True)
    ends = np.cumsum([len(each) for each in squares])[:-1]
    return [np.asarray(part, dtype=np.intp) for part in np.split(numbers.ravel(), ends)]


def count_ratios(
    tables: Sequence[pd.DataFrame],
    reference: int | None = None,
    n_resamples: int = 1000,
    purpose: tuple[int | str, ...] = (),
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Numbers of rows over those of one table, or over their mean.

    Parameters
    ----------
    tables : sequence of DataFrame
        With ``y, x`` in pixels of one frame.
    reference : int, optional
        Position of the table whose number is 1; the mean of all by default.
    n_resamples : int
        Resamples of the pieces.
    purpose : tuple of int and str
        What the draws are for.

    Returns
    -------
    ratios : ndarray, shape (n_tables,)
    samples : ndarray, shape (n_resamples, n_tables)
        The same of each resample; NaN where there is nothing to divide by.

    Examples
    --------
    >>> places = pd.DataFrame({"y": [1.0, 40.0, 2.0], "x": [1.0, 1.0, 3.0]})
    >>> count_ratios([places, places[:2]], reference=1)[0].tolist()
    [1.5, 1.0]
    """
    numbers = piece_numbers(tables)
    n_pieces = 1 + max((int(each.max()) for each in numbers if len(each)), default=-1)
    held = np.array([np.bincount(each, minlength=n_pieces) for each in numbers], dtype=float)
    drawn = bootstrap_counts(n_pieces, n_resamples, "pieces", *purpose)
    counts = np.vstack([held.sum(axis=1), drawn @ held.T])
    whole = counts.mean(axis=1) if reference is None else counts[:, reference]
    ratios = counts / np.where(whole > 0, whole, np.nan)[:, None]
    return ratios[0], ratios[1:]


def ratio_intervals(
    tables: Sequence[pd.DataFrame], reference: int | None, name: str, ends: str, purpose: str
) -> pd.DataFrame:
    """Lay out `count_ratios` as columns: `name`, ``low_ends`` and ``high_ends``, 95 %."""
    ratios, samples = count_ratios(tables, reference, purpose=(purpose,))
    low, high = percentile_interval(samples)
    return pd.DataFrame({name: ratios, f"low_{ends}": low, f"high_{ends}": high})
