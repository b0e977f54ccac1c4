"""Where a place of one view lies in another, and what all views of a set show."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from keystab.camera.views import ViewSpec, local_step, to_reference, to_view, within_line

RIM = 4.0
"""Pixels around what all views have in common in which extrema are sought too."""


def to_common_frame(
    spec: ViewSpec, first: ViewSpec, reference_shape: tuple[int, int], y: ArrayLike, x: ArrayLike
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Where positions of a view lie in the first view of its set.

    Parameters
    ----------
    spec, first : ViewSpec
        The view, and the first one.
    reference_shape : tuple of int
        Height and width of the reference in pixels.
    y, x : array_like
        Positions in pixels of the view.

    Returns
    -------
    y, x : ndarray of float64
        Positions in pixels of the first view. Scales there are longer by `zoom_to_common_frame`.

    Examples
    --------
    >>> first, second = (ViewSpec(1.1, step, (9, 9)) for step in (10.0, 20.0))
    >>> y, x = to_common_frame(second, first, (100, 100), 4, 5)
    >>> float(y), float(x)
    (4.0, 6.0)
    """
    return to_view(first, reference_shape, *to_reference(spec, reference_shape, y, x))


def zoom_to_common_frame(
    spec: ViewSpec, first: ViewSpec, reference_shape: tuple[int, int], y: ArrayLike, x: ArrayLike
) -> NDArray[np.float64] | float:
    """By how much lengths of a view are longer in the first view of its set.

    Parameters
    ----------
    spec, first, reference_shape, y, x
        See `to_common_frame`.

    Returns
    -------
    float, or ndarray of float64
        ``spec.step / first.step``; where planes are seen from the side, the root of the ratio of
        areas at each position.

    Examples
    --------
    >>> first, second = (ViewSpec(1.1, step, (9, 9)) for step in (10.0, 20.0))
    >>> zoom_to_common_frame(second, first, (100, 100), 4, 5)
    2.0
    """
    if spec.homography is None and first.homography is None:
        return spec.step / first.step
    there = to_common_frame(spec, first, reference_shape, y, x)
    return local_step(spec, y, x) / local_step(first, *there)


def zooms_in_common_field(
    specs: Sequence[ViewSpec], reference_shape: tuple[int, int], margin: float
) -> tuple[float, float]:
    """Smallest and largest zoom of any view against the first, where all views look.

    Parameters
    ----------
    specs, reference_shape, margin
        See `in_common_field`.

    Returns
    -------
    least, most : float
        Of planes seen from the side, over the upright rectangles that hold the common field.

    Examples
    --------
    >>> specs = [ViewSpec(1.1, step, (20, 20)) for step in (10.0, 15.0)]
    >>> zooms_in_common_field(specs, (200, 200), 3)
    (1.0, 1.5)
    """
    steps = [np.full(2, spec.step) for spec in specs]
    if any(spec.homography for spec in specs):
        windows = windows_of_common_field(specs, reference_shape, margin)
        steps = [
            local_step(spec, np.array([[top], [bottom]]), np.array([[left, right]]))
            for spec, (top, bottom, left, right) in zip(specs, windows, strict=True)
        ]  # depth is linear: its extremes lie at corners
    least = min(float(step.min()) for step in steps) / float(steps[0].max())
    return least, max(float(step.max()) for step in steps) / float(steps[0].min())


def in_common_field(
    specs: Sequence[ViewSpec],
    reference_shape: tuple[int, int],
    margin: float,
    y: ArrayLike,
    x: ArrayLike,
) -> NDArray[np.bool_]:
    """Whether positions lie inside the margin of every view, and on the reference.

    Parameters
    ----------
    specs : sequence of ViewSpec
        The views; positions are in the frame of the first one.
    reference_shape : tuple of int
        Height and width of the reference in pixels.
    margin : float
        Width of the margin around the centres of a view's outermost pixels, in its pixels.
    y, x : array_like
        Positions in pixels of the first view.

    Returns
    -------
    ndarray of bool

    Examples
    --------
    >>> specs = [ViewSpec(1.1, 10.0, (20, 20), (0.0, shift)) for shift in (0.0, 2.0)]
    >>> in_common_field(specs, (200, 200), 3, [10.0, 10.0], [4.0, 5.5]).tolist()
    [False, True]
    """
    there = to_reference(specs[0], reference_shape, y, x)
    inside = np.ones(np.broadcast(*there).shape, dtype=bool)
    for position, size in zip(there, reference_shape, strict=True):
        inside &= (position >= 0) & (position <= size - 1)
    for spec in specs:
        for position, size in zip(to_view(spec, reference_shape, *there), spec.shape, strict=True):
            inside &= (position >= margin) & (position <= size - 1 - margin)
    return inside


def common_field_is_empty(
    specs: Sequence[ViewSpec], reference_shape: tuple[int, int], margin: float
) -> bool:
    """Whether none of 65 x 65 positions of the first view lies in the field of all views."""
    y, x = (np.linspace(0, size - 1, 65) for size in specs[0].shape)
    return not in_common_field(specs, reference_shape, margin, y[:, None], x[None, :]).any()


def windows_of_common_field(
    specs: Sequence[ViewSpec], reference_shape: tuple[int, int], margin: float
) -> list[tuple[float, float, float, float]]:
    """Smallest upright rectangle of each view that holds what all views have in common.

    Parameters
    ----------
    specs, reference_shape, margin
        See `in_common_field`.

    Returns
    -------
    list of (float, float, float, float)
        First and last row, first and last column, in pixels of each view; empty ranges where
        nothing is common.

    Examples
    --------
    >>> specs = [ViewSpec(1.1, 10.0, (20, 20), (0.0, shift)) for shift in (0.0, 2.0)]
    >>> windows_of_common_field(specs, (200, 200), 3)
    [(3.0, 16.0, 5.0, 16.0), (3.0, 16.0, 3.0, 14.0)]
    """
    last_y, last_x = (size - 1.0 for size in reference_shape)
    field = np.array([[0.0, 0.0], [0.0, last_x], [last_y, last_x], [last_y, 0.0]])
    for spec in specs:
        for axis, size in enumerate(spec.shape):
            for sign, limit in ((1.0, margin), (-1.0, -(size - 1 - margin))):
                field = _cut(field, within_line(spec, reference_shape, axis, sign, limit, *field.T))
    if not len(field):
        return [(0.0, -1.0, 0.0, -1.0)] * len(specs)
    windows = []
    for spec in specs:
        y, x = (np.round(part, 9) for part in to_view(spec, reference_shape, *field.T))
        windows.append((float(y.min()), float(y.max()), float(x.min()), float(x.max())))
    return windows


def searched_windows(
    specs: Sequence[ViewSpec], reference_shape: tuple[int, int], guard: float
) -> list[tuple[float, float, float, float] | None]:
    """Part of each view in which extrema are sought: what all views have in common, and a rim.

    No keypoint beyond it is ever compared. The rim is for what the refinement moves and for
    neighbours that are the same; windows end at every fourth pixel, so that views that differ by a
    fraction of a pixel are searched alike.

    Parameters
    ----------
    specs, reference_shape
        See `in_common_field`.
    guard : float
        Width of the guard band of every view, in its pixels.

    Returns
    -------
    list of (float, float, float, float) or None
        See `windows_of_common_field`; None for the whole view, where there is no guard band.

    Examples
    --------
    >>> specs = [ViewSpec(1.1, 10.0, (40, 40), (0.0, shift)) for shift in (0.0, 2.0)]
    >>> searched_windows(specs, (400, 400), 9)
    [(4.0, 36.0, 4.0, 36.0), (4.0, 36.0, 4.0, 32.0)]
    """
    if guard == 0:
        return [None] * len(specs)
    windows = windows_of_common_field(specs, reference_shape, guard)
    return [
        (
            4.0 * math.floor((top - RIM) / 4),
            4.0 * math.ceil((bottom + RIM) / 4),
            4.0 * math.floor((left - RIM) / 4),
            4.0 * math.ceil((right + RIM) / 4),
        )
        for top, bottom, left, right in windows
    ]


def _cut(corners: NDArray[np.float64], height: NDArray[np.float64]) -> NDArray[np.float64]:
    """Cut a convex polygon where a linear function of its corners becomes negative."""
    kept = []
    for k in range(len(corners)):
        after = (k + 1) % len(corners)
        if height[k] >= 0:
            kept.append(corners[k])
        if height[k] * height[after] < 0:
            share = height[k] / (height[k] - height[after])
            kept.append(corners[k] + share * (corners[after] - corners[k]))
    return np.array(kept).reshape(-1, 2)


def common_scales(
    specs: Sequence[ViewSpec],
    sigma_min: float,
    n_oct: int,
    first_scale: float,
    last_scale: float | None,
    zooms: tuple[float, float] | None = None,
) -> tuple[float, float]:
    """Range of scales that all views of a set cover, in pixels of the first view.

    Parameters
    ----------
    specs : sequence of ViewSpec
        The views.
    sigma_min : float
        First scale of the scale-space of every view, in its pixels.
    n_oct : int
        Octaves of every scale-space.
    first_scale : float
        Lower end of the range of a single view, over `sigma_min`.
    last_scale : float or None
        Upper end of it, over `sigma_min`; none if None, unless the views have different zooms:
        then the end of the last octave.
    zooms : (float, float), optional
        Smallest and largest zoom against the first view; by default the ratios of steps. Needed
        where planes are seen from the side, see `zooms_in_common_field`.

    Returns
    -------
    low, high : float
        ``low > high`` where there is no common range; `high` is infinite where there is no end.

    Examples
    --------
    >>> specs = [ViewSpec(1.1, step, (9, 9)) for step in (10.0, 15.0)]
    >>> low, high = common_scales(specs, 1.0, 2, 1.25, None)
    >>> low, high
    (1.875, 4.0)
    """
    if zooms is None:
        ratios = [spec.step / specs[0].step for spec in specs]
        zooms = min(ratios), max(ratios)
    if last_scale is None:
        last_scale = 2.0**n_oct if max(zooms) > min(zooms) else float("inf")
    return sigma_min * first_scale * max(zooms), sigma_min * last_scale * min(zooms)
