"""Numbers of extrema, and their ratios, with the spread between pieces of the scene.

Extrema of one picture are drawn anew by drawing its pieces with replacement, squares that are
larger than a keypoint: what another scene of the same kind would give. All that is compared is
drawn with the same pieces, so that differences and ratios are paired.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from keystab.evaluation.intervals import bootstrap_counts, percentile_interval
from keystab.matching.unique_keypoints import gather

__all__ = ["SIDE", "Drawn", "count_ratios", "drawn_anew", "piece_numbers", "ratio_intervals"]

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


class Drawn(NamedTuple):
    """Unique keypoints in the data, in the first row, and in resamples of pieces and of views.

    Attributes
    ----------
    weight : ndarray of float, shape (n_resamples + 1, n_keypoints)
        How often each counts: as often as the piece in which it lies was drawn.
    number : ndarray of int, of the same shape
        In how many of the views that were drawn it is seen.
    n_views : int
        How many views were drawn: as many as there are.
    """

    weight: NDArray[np.float64]
    number: NDArray[np.int64]
    n_views: int

    def share(self, needed: int) -> NDArray[np.float64]:
        """Share of the keypoints seen at all that are seen in at least `needed` views."""
        total = (self.weight * (self.number > 0)).sum(axis=1)
        some = (self.weight * (self.number >= max(needed, 1))).sum(axis=1)
        shares: NDArray[np.float64] = some / np.where(total > 0, total, np.nan)
        return shares


def drawn_anew(
    matched: Sequence[tuple[pd.DataFrame, NDArray[np.intp]]], n_resamples: int
) -> list[Drawn]:
    """Draw the unique keypoints of several choices anew, with the same pieces and views for all.

    Parameters
    ----------
    matched : sequence of (DataFrame, ndarray of int, shape (n_keypoints, n_views))
        Detections with ``y, x`` in pixels of one frame, and for each unique keypoint its row there
        in every view, or -1.
    n_resamples : int

    Examples
    --------
    >>> table = pd.DataFrame({"y": [1.0, 1.0, 90.0], "x": [1.0, 1.0, 3.0]})
    >>> (drawn,) = drawn_anew([(table, np.array([[0, 1], [2, -1]]))], n_resamples=5)
    >>> drawn.number[0].tolist(), float(drawn.share(2)[0])
    ([2, 1], 0.5)
    """
    places = []
    for table, found in matched:
        seen = np.maximum((found >= 0).sum(axis=1), 1)
        places.append(
            pd.DataFrame(
                {axis: np.nansum(gather(table[axis], found), axis=1) / seen for axis in ("y", "x")}
            )
        )
    pieces = piece_numbers(places)
    n_pieces = 1 + max((int(each.max()) for each in pieces if len(each)), default=-1)
    of_pieces = _draws(n_pieces, n_resamples, "pieces")
    drawn = []
    for (_, found), own in zip(matched, pieces, strict=True):
        of_views = _draws(found.shape[1], n_resamples, "views")
        number = of_views @ (found >= 0).T.astype(np.int64)
        drawn.append(Drawn(of_pieces[:, own].astype(float), number, found.shape[1]))
    return drawn


@cache
def _draws(n: int, n_resamples: int, what: str) -> NDArray[np.int64]:
    """How often each of n counts: once in the data, which come first, else as it is drawn."""
    drawn = bootstrap_counts(n, n_resamples, "differences", what)
    return np.vstack([np.ones((1, n), np.int64), drawn])
