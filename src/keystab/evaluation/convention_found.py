"""What a detector means by its positions and scales, found from what it says of known blobs."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

__all__ = ["FoundConvention", "found_convention"]

ORIGINS = (0.0, 0.25, 0.5, 1.0)
"""Coordinates of the centre of the first pixel that have a name: 0.25 is no convention of anyone's
but what an interpolation that doubles a picture adds when it forgets where its samples lie."""

FACTORS = {"sigma": 1.0, "radius": math.sqrt(2.0), "diameter": 2.0, "blob diameter": math.sqrt(8.0)}
"""What a scale can be, over sigma."""

NEAR, ORIGIN_TOLERANCE, FACTOR_TOLERANCE = 3.0, 0.06, 0.15
"""Pixels within which a detection may stand for a blob; how far a position may be from a named
origin in pixels, and the logarithm of a scale from a named meaning."""

FEWEST = 0.2
"""Share of the blobs that has to be found to say anything."""


class FoundConvention(NamedTuple):
    """What positions and scales seem to mean.

    Attributes
    ----------
    origin_y, origin_x : float
        What is added to the positions, pixels: the median.
    order : str
        Order of the coordinates; empty where too few blobs were found to say.
    factor : float
        Scales over sigma: the median.
    """

    origin_y: float
    origin_x: float
    order: str
    factor: float

    def __str__(self) -> str:
        """In words, as a `keystab.io.keypoint_conventions.Convention` is; numbers where none fit.

        Examples
        --------
        >>> print(FoundConvention(0.249, 0.251, "yx", 1.98))
        0.25 yx diameter
        >>> print(FoundConvention(0.1, -0.3, "yx", 1.2))
        (0.10, -0.30) yx 1.2 sigma
        """
        if not self.order:
            return ""
        both = np.array([self.origin_y, self.origin_x])
        origin = f"({both[0]:.2f}, {both[1]:.2f})"
        for named in ORIGINS:
            if (np.abs(both - named) <= ORIGIN_TOLERANCE).all():
                origin = f"{named:g}"
        scale = f"{float(f'{self.factor:.3g}'):g} sigma"
        for name, factor in FACTORS.items():
            if abs(math.log(self.factor / factor)) <= FACTOR_TOLERANCE:
                scale = name
        return f"{origin} {self.order} {scale}"


def found_convention(
    detections: Sequence[pd.DataFrame], blobs: Sequence[pd.DataFrame], order: str = "yx"
) -> FoundConvention:
    """Find out what positions and scales mean, from isolated blobs.

    Parameters
    ----------
    detections : sequence of DataFrame
        ``y, x, scale`` as the detector has them, for each picture.
    blobs : sequence of DataFrame
        ``y, x, sigma`` of the blobs in each, pixels from the centre of the first.
    order : {"yx", "xy"}
        Order in which the detector says that it has coordinates; the columns were named by it.

    Returns
    -------
    FoundConvention
        Each blob takes the nearest detection within `NEAR` pixels whose scale is between half and
        eight times its sigma. Of the two orders that counts in which more blobs are found.

    Examples
    --------
    >>> y, x = (9.0 * each.ravel() for each in np.mgrid[1:6, 2:9])
    >>> blobs = pd.DataFrame({"y": y, "x": x, "sigma": 2.0})
    >>> said = pd.DataFrame({"y": x + 0.5, "x": y + 0.5, "scale": 4.0})
    >>> print(found_convention([said], [blobs]))
    0.5 xy diameter
    """
    best: tuple[int, FoundConvention] = (0, FoundConvention(math.nan, math.nan, "", math.nan))
    most = sum(map(len, blobs))
    for found_order in (order, order[::-1]):
        names = {"y": "y", "x": "x"} if found_order == order else {"y": "x", "x": "y"}
        rows = [
            _offsets(found.rename(columns=names), true)
            for found, true in zip(detections, blobs, strict=True)
        ]
        offsets = np.concatenate([*rows, np.zeros((0, 3))])
        if len(offsets) > max(best[0], FEWEST * most):
            y, x, factor = (float(each) for each in np.median(offsets, axis=0))
            best = len(offsets), FoundConvention(y, x, found_order, math.exp(factor))
    return best[1]


def _offsets(detections: pd.DataFrame, blobs: pd.DataFrame) -> NDArray[np.float64]:
    """Differences in y, x and the logarithm of the scale between blobs and what stands for them."""
    from scipy.spatial import cKDTree

    found = detections[["y", "x"]].to_numpy(dtype=float)
    scale = detections["scale"].to_numpy(dtype=float)
    rows = []
    if len(found):
        near = cKDTree(found).query_ball_point(blobs[["y", "x"]].to_numpy(), NEAR)
        for (y, x, sigma), candidates in zip(
            blobs[["y", "x", "sigma"]].to_numpy(), near, strict=True
        ):
            own = [k for k in candidates if 0.5 * sigma <= scale[k] <= 8 * sigma]
            if own:
                place = found[own] - [y, x]
                k = int(np.argmin((place**2).sum(axis=1)))
                rows.append((*place[k], math.log(scale[own[k]] / sigma)))
    return np.array(rows, dtype=np.float64).reshape(-1, 3)
