"""Which detections of different samplings are compared (section 5.1, "Boundary effect").

Extrema are sought in the slices 1 to n_spo. They stand for scales from half a step above the first
scale to half a step above the end of the octave, so that a coarse sampling starts higher than a
fine one and also ends higher, by up to a factor of 2**(1/6) at n_spo = 3. And the mirror at the
border of the image moves with the sampling. Comparisons therefore keep to a common range of scales
and away from the border. The paper cuts the range at its lower end only; an upper end is optional
here.

A keypoint near an end of the range may lie within it in one sampling and beyond in the next. With
hard ends, as in the paper, it is then lost; with soft ends counterparts may lie beyond as well, and
a column ``beyond`` of the detections says which are there as counterparts only.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from keystab.camera.common_field import (
    in_common_field,
    to_common_frame,
    zoom_to_common_frame,
)
from keystab.camera.views import ViewSpec

BEYOND = "beyond"
"""Column of detections that are counterparts and not themselves compared; absent with hard ends."""


def compared(detections: pd.DataFrame) -> NDArray[np.bool_]:
    """Which detections are compared, and not only counterparts of others.

    Examples
    --------
    >>> compared(pd.DataFrame({"y": [1.0, 2.0], "beyond": [False, True]})).tolist()
    [True, False]
    >>> compared(pd.DataFrame({"y": [1.0, 2.0]})).tolist()
    [True, True]
    """
    if BEYOND not in detections:
        return np.ones(len(detections), dtype=bool)
    return ~detections[BEYOND].to_numpy(dtype=bool)


def comparable(
    detections: pd.DataFrame,
    shape: tuple[int, int],
    sigma_min: float,
    first_scale: float = 2 ** (1 / 3),
    border: float = 3.0,
    scale_column: str = "step_sigma",
    last_scale: float | None = None,
) -> NDArray[np.bool_]:
    """Whether each detection lies in the common range of scales and inside the margin.

    Parameters
    ----------
    detections : DataFrame
        Columns ``y`` and ``x`` in input pixels, and `scale_column`.
    shape : tuple of int
        Height and width of the input image.
    sigma_min : float
        First scale of the scale-space, in input pixels.
    first_scale : float
        Lower end of the range of scales, over `sigma_min`.
    border : float
        Width of the margin around the centres of the outermost pixels, in input pixels.
    scale_column : str
        Column of the scale that is compared with the range. For discrete extrema this is the scale
        after one unbounded quadratic step: their grid scale would admit a whole slice or none of
        it, depending on the sampling.
    last_scale : float, optional
        Upper end of the range of scales, over `sigma_min`; none if not given.

    Returns
    -------
    ndarray of bool
        The range includes its ends. False also where the scale is NaN.

    Examples
    --------
    >>> found = pd.DataFrame({"y": [5.0, 5.0, 2.0], "x": [5.0, 5.0, 5.0],
    ...                       "step_sigma": [1.4, 1.38, 1.4]})
    >>> comparable(found, (11, 11), sigma_min=1.1).tolist()
    [True, False, False]
    """
    scale = detections[scale_column].to_numpy()
    inside = scale >= sigma_min * first_scale
    if last_scale is not None:
        inside &= scale <= sigma_min * last_scale
    for axis, size in zip(("y", "x"), shape, strict=True):
        position = detections[axis].to_numpy()
        inside &= (position >= border) & (position <= size - 1 - border)
    return inside


def in_range(
    detections: pd.DataFrame,
    scale_column: str,
    shape: tuple[int, int],
    sigma_min: float,
    soft_ends: bool = False,
    first_scale: float = 2 ** (1 / 3),
    border: float = 3.0,
    last_scale: float | None = None,
) -> pd.DataFrame:
    """Detections that are compared; where ends are soft, also those beyond as counterparts.

    Parameters
    ----------
    detections, scale_column, shape, sigma_min, first_scale, border, last_scale
        See `comparable`.
    soft_ends : bool
        Whether counterparts may lie beyond the range of scales.

    Returns
    -------
    DataFrame
        Some rows of `detections`, with the column ``beyond`` where ends are soft.
    """
    kept = comparable(detections, shape, sigma_min, first_scale, border, scale_column, last_scale)
    if not soft_ends:
        return detections[kept]
    near = comparable(detections, shape, 0.0, 1.0, border, scale_column)
    return detections.assign(**{BEYOND: ~kept})[near]


@dataclass(frozen=True)
class CommonRange:
    """What all views of a set could have seen.

    Attributes
    ----------
    specs : sequence of ViewSpec
        The views; the first one gives the common frame.
    reference_shape : tuple of int
        Height and width of the reference in pixels.
    margin : float
        Width of the margin of every view, in its pixels.
    low, high : float
        Scales, in pixels of the first view.
    soft : bool
        Whether detections beyond these ends are kept as counterparts.
    """

    specs: Sequence[ViewSpec]
    reference_shape: tuple[int, int]
    margin: float
    low: float
    high: float = np.inf
    soft: bool = False

    def common(self, detections: pd.DataFrame, scale_column: str = "sigma") -> pd.DataFrame:
        """Detections of the common field and range of scales, in the frame of the first view.

        Parameters
        ----------
        detections : DataFrame
            Columns ``view, y, x, sigma`` and `scale_column`.
        scale_column : str
            The scale that decides. For discrete extrema it is ``step_sigma``, the scale after one
            unbounded quadratic step; see `keystab.matching.common_range.comparable`.

        Returns
        -------
        DataFrame
            Some rows of `detections`, with ``y, x, sigma`` and `scale_column` in the common frame;
            where the ends are soft, with those beyond and the column ``beyond``.
        """
        table = detections.reset_index(drop=True)
        view = table["view"].to_numpy()
        y, x = table["y"].to_numpy(float, copy=True), table["x"].to_numpy(float, copy=True)
        zoom = np.ones(len(table))
        for number, spec in enumerate(self.specs):
            here = view == number
            where = (spec, self.specs[0], self.reference_shape, y[here], x[here])
            zoom[here] = zoom_to_common_frame(*where)
            y[here], x[here] = to_common_frame(*where)
        table = table.assign(y=y, x=x, sigma=table["sigma"] * zoom)
        if scale_column != "sigma":
            table[scale_column] = table[scale_column] * zoom
        scale = table[scale_column]
        keep = (scale >= self.low) & (scale <= self.high)
        if self.soft:
            table[BEYOND] = ~keep
            keep = scale > 0  # not where the scale is unknown
        keep &= in_common_field(self.specs, self.reference_shape, self.margin, y, x)
        return table[keep].reset_index(drop=True)
