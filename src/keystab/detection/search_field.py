"""What is searched: a spline, and how far it may be from the samples of a scale-space.

Lengths are in distances of its knots. The spline of a spline scale-space is that of its pixels;
`keystab.detection.search_cosine` has the one that stands for a cosine series.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from keystab.detection.search_cosine import (
    KNOTS,
    continued_axis,
    finer,
    knots_of,
    missed_by_splines,
)
from keystab.detection.search_hulls import MARGIN
from keystab.detection.search_nodes import LocalAxis, local_axis
from keystab.detection.search_records import GROUP
from keystab.scalespace.dog import ScaleSpace
from keystab.scalespace.spline_axis import SplineAxis

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Field:
    """A blurred spline on a grid of samples.

    Attributes
    ----------
    source : ndarray
        Coefficients, some beyond the ends.
    axes : (LocalAxis, LocalAxis)
    blurs : ndarray, shape (n_blurs,)
        Standard deviations of the Gaussians.
    lower, upper : ndarray of int, shape (n_slices,)
        Gaussians of each slice.
    shape : (int, int, int)
        Slices, rows and columns.
    delta, step : float
        Distance of samples in the grid of the axes, and of those that are searched.
    missed : ndarray, shape (n_slices,)
        How far samples may be from those of the scale-space.
    rounding : float
        How much of that is rounding in double precision, at least.
    """

    source: Array
    axes: tuple[LocalAxis, LocalAxis]
    blurs: Array
    lower: NDArray[np.int64]
    upper: NDArray[np.int64]
    shape: tuple[int, int, int]
    delta: float
    step: float
    missed: Array
    rounding: float


def field_of(space: ScaleSpace, p: int) -> Field:
    """What is searched for the extrema of a scale-space, with nodes up to p samples apart."""
    return _of_splines(space) if space.oversampling == "spline" else _of_cosines(space, p)


def _of_splines(space: ScaleSpace) -> Field:
    blurs, lower, upper = space.blurs
    each, sampling = tuple(blurs.tolist()), space.sampling
    whole_y, whole_x = space.axes
    assert isinstance(whole_y, SplineAxis) and isinstance(whole_x, SplineAxis)
    y_axis, x_axis = (local_axis(axis, each, sampling.delta_min) for axis in (whole_y, whole_x))
    rounding = space.rounding_bounds.value
    return Field(
        space.source,
        (y_axis, x_axis),
        blurs,
        lower,
        upper,
        space.shape,
        sampling.delta_min,
        sampling.step,
        np.full(lower.size, rounding),
        rounding,
    )


def _of_cosines(space: ScaleSpace, p: int) -> Field:
    blurs, lower, upper = space.blurs
    sampling = space.sampling
    parts = finer(sampling.delta_min)
    delta, stride = sampling.delta_min / parts, sampling.stride * parts
    each = tuple((KNOTS * blurs).tolist())
    y_axis, x_axis = (
        continued_axis(
            (m - 1) * stride, KNOTS * delta, stride, (2 * MARGIN + GROUP) * p * stride, each
        )
        for m in space.shape[1:]
    )
    rounding = space.rounding_bounds.value
    off = missed_by_splines(space.source, blurs, (y_axis, x_axis), delta)
    return Field(
        knots_of(space.source, (y_axis, x_axis)),
        (y_axis, x_axis),
        KNOTS * blurs,
        lower,
        upper,
        space.shape,
        KNOTS * delta,
        KNOTS * sampling.step,
        rounding + off[lower] + off[upper],
        rounding + float(off.min()),
    )
