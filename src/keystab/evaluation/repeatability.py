"""What two views of a scene, or a view and its truth, have in common: one to one, without copies.

Repeatability grows with the number of keypoints, since any two dense sets agree by chance, and
with keypoints that are reported twice. So copies are merged first, each keypoint has one partner at
most, chance is measured with the same keypoints in other places, and detectors are compared at the
same number of keypoints.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from keystab.evaluation.location_errors import NOTHING, Estimate, share
from keystab.evaluation.recall_precision import partners
from keystab.matching.correspondence import SCALE_RATIO, SPACE_TOLERANCE, pairs_within

__all__ = ["displaced", "distinct", "in_common", "one_to_one", "seam_deficit"]

COPY_DISTANCE, COPY_RATIO = 0.1, 1.05
"""Keypoints nearer than this many pixels in y and x, and this ratio of scales, are one: copies of
different orientation, and what is found twice where octaves meet."""


def distinct(keypoints: pd.DataFrame) -> NDArray[np.bool_]:
    """Which keypoints are no copies of one before.

    Parameters
    ----------
    keypoints : DataFrame
        Columns ``y, x, sigma`` in pixels.

    Returns
    -------
    ndarray of bool, shape (n,)

    Examples
    --------
    >>> found = pd.DataFrame({"y": [5.0, 5.0, 5.3], "x": 5.0, "sigma": [2.0, 2.0, 2.0]})
    >>> distinct(found).tolist()
    [True, False, True]
    """
    keep = np.ones(len(keypoints), dtype=bool)
    for first, second in np.sort(pairs_within(keypoints, COPY_DISTANCE, COPY_RATIO), axis=0):
        if keep[first]:
            keep[second] = False
    return keep


def one_to_one(
    detections: pd.DataFrame,
    truth: pd.DataFrame,
    space_tolerance: float = SPACE_TOLERANCE,
    scale_ratio: float = SCALE_RATIO,
) -> NDArray[np.intp]:
    """`keystab.evaluation.recall_precision.partners` for detectors that report no sign.

    Examples
    --------
    >>> truth = pd.DataFrame({"y": [5.0], "x": [5.0], "sigma": [1.5]})
    >>> one_to_one(truth.assign(y=5.3), truth).tolist()
    [0]
    """
    first, second = (each.assign(sign=1) for each in (detections, truth))
    return partners(first, second, space_tolerance, scale_ratio)


class Common(NamedTuple):
    """Keypoints that two views have in common, and how many there could be."""

    same: int
    possible: int

    def __add__(self, other: tuple[int, int]) -> Common:  # type: ignore[override]
        """Counts of several pairs of views together."""
        return Common(self.same + other[0], self.possible + other[1])

    @property
    def repeatability(self) -> Estimate:
        """Share of those that could be the same."""
        return share(*self)


def in_common(
    first: pd.DataFrame,
    second: pd.DataFrame,
    space_tolerance: float,
    scale_ratio: float = SCALE_RATIO,
    number: int | None = None,
) -> Common:
    """Count the keypoints that two views share, in one frame.

    Parameters
    ----------
    first, second : DataFrame
        Columns ``y, x, sigma`` in pixels of the common frame, of what both views can see, without
        copies; ``strength`` where a `number` is given.
    space_tolerance : float
        Largest distance in y and in x of the same keypoint, pixels.
    scale_ratio : float
        Largest ratio of its scales.
    number : int, optional
        Compare so many of each view, the strongest.

    Returns
    -------
    Common
        Keypoints with a partner, one to one, and the number in the view that has fewer. Both are 0
        where a view has fewer than `number`.

    Examples
    --------
    >>> one = pd.DataFrame({"y": [5.0, 9.0], "x": [5.0, 9.0], "sigma": 2.0})
    >>> in_common(one, one.iloc[:1].assign(y=5.4), 0.5)
    Common(same=1, possible=1)
    """
    if number is not None:
        if min(len(first), len(second)) < number or number == 0:
            return Common(0, 0)
        first, second = (
            each.sort_values("strength", ascending=False, kind="stable").head(number)
            for each in (first, second)
        )
    found = one_to_one(first, second, space_tolerance, scale_ratio)
    return Common(int((found >= 0).sum()), min(len(first), len(second)))


def displaced(
    keypoints: pd.DataFrame, field: tuple[float, float, float, float], turns: int = 4
) -> list[pd.DataFrame]:
    """The same keypoints in other places of a field: what leaves on one side enters on the other.

    What these have in common with anything is chance: numbers, scales and clusters are the same.

    Parameters
    ----------
    keypoints : DataFrame
        Columns ``y, x`` and others, which stay.
    field : (float, float, float, float)
        First and last row, first and last column, pixels.
    turns : int
        How many such sets; they are moved along the diagonal by equal parts of it.

    Returns
    -------
    list of DataFrame

    Examples
    --------
    >>> one = pd.DataFrame({"y": [1.0], "x": [7.0], "sigma": [2.0]})
    >>> displaced(one, (0.0, 8.0, 0.0, 8.0), turns=1)[0].to_numpy().tolist()
    [[5.0, 3.0, 2.0]]
    """
    top, bottom, left, right = field
    height, width = bottom - top, right - left
    moved = []
    for turn in range(1, turns + 1):
        part = turn / (turns + 1)
        moved.append(
            keypoints.assign(
                y=top + (keypoints["y"] - top + part * height) % height,
                x=left + (keypoints["x"] - left + part * width) % width,
            )
        )
    return moved


def seam_deficit(
    sigma: ArrayLike, found: ArrayLike, group: Sequence[int] | NDArray[np.intp], width: float = 0.25
) -> tuple[Estimate, float]:
    """How much less is found near the scale at which a detector's octaves meet, wherever that is.

    Parameters
    ----------
    sigma : array_like, shape (n,)
        Scales of true extrema, pixels.
    found : array_like of bool, shape (n,)
        Whether each was found.
    group : sequence of int, shape (n,)
        View of each: in the even ones the scale is sought at which least is found, in the odd ones
        the deficit is measured. Sought and measured in the same, it would be there by chance.
    width : float
        Width of the window in octaves; it repeats with every octave.

    Returns
    -------
    deficit : Estimate
        Recall outside of the window minus recall inside, with its 95 % interval (normal). Around 0
        for a detector without seams.
    at : float
        Scale of the middle of the window, within [1, 2) pixels times a power of 2.

    Examples
    --------
    >>> sigma = np.tile(2 ** np.linspace(0, 2, 200, endpoint=False), 2)
    >>> seen = (np.log2(sigma) % 1 < 0.4) | (np.log2(sigma) % 1 > 0.6)
    >>> deficit, at = seam_deficit(sigma, seen, np.repeat([0, 1], 200))
    >>> print(f"{deficit.value:.2f} {at:.1f}")
    0.80 1.4
    """
    octave = np.log2(np.asarray(sigma, dtype=np.float64))
    seen, odd = np.asarray(found, dtype=bool), np.asarray(group) % 2 == 1
    middles = np.arange(24) / 24

    def inside(middle: float) -> NDArray[np.bool_]:
        return np.abs((octave - middle + 0.5) % 1 - 0.5) < width / 2

    counts = [(inside(m) & ~odd, m) for m in middles]
    recalls = [(float(seen[rows].mean()), m) for rows, m in counts if rows.sum() >= 10]
    if not recalls:
        return NOTHING, float("nan")
    middle = min(recalls)[1]
    near, far = inside(middle) & odd, ~inside(middle) & odd
    if min(near.sum(), far.sum()) < 10:
        return NOTHING, 2**middle
    shares = [float(seen[rows].mean()) for rows in (near, far)]
    half = 1.96 * np.sqrt(
        sum(p * (1 - p) / rows.sum() for p, rows in zip(shares, (near, far), strict=True))
    )
    deficit = shares[1] - shares[0]
    return Estimate(deficit, deficit - half, deficit + half), 2**middle
