r"""What the continuous scale-space around a detection says about it.

A detector keeps 27 samples of each extremum. The image's series
(`keystab.scalespace.continuous_dog`) knows the difference of Gaussians w everywhere, so more can be
asked of a single detection at a single sampling: how far it is from losing its signature, and from
the saddle that would take it away; for how long it lasts when the scale changes; by how much it
stands out from a ring around it.

Distances are in the scale-space's own units, :math:`(\ln\sigma, y/\sigma, x/\sigma)` with sigma
that of the detection: they do not change when the picture is zoomed, turned, or scaled in contrast.
With s = +1 for a maximum and -1 for a minimum, an extremum is a point without gradient at which
:math:`-s H` is positive definite.
"""

from __future__ import annotations

import math

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from keystab.scalespace.continuous_dog import BELOW_BLUR, DogSeries, Jets

__all__ = ["annulus", "degeneracy", "persistence", "refined_places", "saddle_distance"]

REACH = 2.0
"""Distances above this are not sought: a shift by twice sigma. The saddles of a plain wave lie 2.5
from its extrema, so that what is nearer is closer than regular structure has it."""

RING = 1.0
"""Radius of the annulus over sigma."""

WINDOW = math.log(2) / 3
"""Persistence is sought this far up and down in ln sigma: the third of an octave that lies between
the blur of the view and the finest scales that are compared."""

_RING_POINTS, _WINDOW_STEPS = 16, 8

#: Step of the central differences of Hessians. Their error is of its square, a per cent or so.
_STEP = 0.05

#: Longest Newton step, and how many are taken at most on the way to a saddle.
_LONGEST, _MOST_STEPS = 0.3, 30

#: Newton steps within a slice after each step in scale, and the longest way to follow.
_SLICE_STEPS, _FOLLOWED = 8, 0.35


def refined_places(detections: pd.DataFrame) -> NDArray[np.float64]:
    """Scale and position of discrete extrema after one quadratic step, where it can be trusted.

    Parameters
    ----------
    detections : DataFrame
        Columns ``y, x, sigma, step_y, step_x, step_sigma, n_spo, delta_min``.

    Returns
    -------
    ndarray, shape (n, 3)
        ``(sigma, y, x)`` in pixels; that of the grid where the step is longer than one sample
        along any axis, or does not exist.

    Examples
    --------
    >>> one = pd.DataFrame({"y": [5.0, 5.0], "x": [5.0, 5.0], "sigma": [1.5, 1.5],
    ...     "step_y": [5.2, 9.0], "step_x": [5.1, 5.1], "step_sigma": [1.6, 1.6],
    ...     "n_spo": [3, 3], "delta_min": [0.5, 0.5]})
    >>> refined_places(one).tolist()
    [[1.6, 5.2, 5.1], [1.5, 5.0, 5.0]]
    """
    grid = detections[["sigma", "y", "x"]].to_numpy(dtype=float)
    step = detections[["step_sigma", "step_y", "step_x"]].to_numpy(dtype=float)
    n_spo, delta = (detections[name].to_numpy(dtype=float) for name in ("n_spo", "delta_min"))
    with np.errstate(invalid="ignore", divide="ignore"):
        samples = np.stack(
            [
                np.abs(np.log2(step[:, 0] / grid[:, 0])) * n_spo,
                np.abs(step[:, 1] - grid[:, 1]) / delta,
                np.abs(step[:, 2] - grid[:, 2]) / delta,
            ],
            axis=1,
        )
        near = np.all(samples <= 1.0, axis=1)
    return np.where(near[:, None], step, grid)


def degeneracy(
    series: DogSeries, places: NDArray[np.float64], sign: NDArray[np.float64]
) -> NDArray[np.float64]:
    r"""Signed distance to where the Hessian loses the signature of an extremum, to first order.

    With :math:`\lambda` the smallest eigenvalue of :math:`-s H` at the detection, the surface on
    which it vanishes lies at about :math:`\lambda / \|\nabla\lambda\|`.

    Parameters
    ----------
    series : DogSeries
        The view's scale-space.
    places : ndarray, shape (n, 3)
        Scale and position of the detections.
    sign : ndarray, shape (n,)
        +1 for maxima, -1 for minima.

    Returns
    -------
    ndarray, shape (n,)
        Clipped to -1 and 1; negative where the signature is another one already.
    """
    here = _least(_jets(series, places), sign)
    slope = np.empty((3, len(sign)))
    for axis in range(3):
        ends = [
            _least(_jets(series, _shifted(places, h * np.eye(3)[axis])), sign)
            for h in (_STEP, -_STEP)
        ]
        slope[axis] = (ends[0] - ends[1]) / (2 * _STEP)
    steepness = np.linalg.norm(slope, axis=0)
    far = np.full(len(sign), np.inf)
    np.divide(here, steepness, out=far, where=steepness > 0)
    return np.clip(np.where(np.isinf(far), np.sign(here), far), -1.0, 1.0)


def saddle_distance(
    series: DogSeries,
    places: NDArray[np.float64],
    sign: NDArray[np.float64],
    reach: float = REACH,
) -> NDArray[np.float64]:
    r"""Distance to the nearest critical point of another signature that Newton's method finds.

    An extremum is born or dies together with a saddle. If along an eigenvector v of H, of
    eigenvalue :math:`\lambda`, w is a cubic with third derivative t, its other critical point lies
    at :math:`-2\lambda/t`. Newton's method for :math:`\nabla w = 0` starts there, on all three axes
    and at as far on their other sides, with steps of at most 0.3. What it finds in reach and is no
    extremum of this sign counts. To find *all* critical points around each detection would take a
    search like that of `keystab.truth.true_extrema`, a minute for a picture; this one takes
    seconds.

    Parameters
    ----------
    series, places, sign
        See `degeneracy`.
    reach : float
        Largest distance that is sought.

    Returns
    -------
    ndarray, shape (n,)
        0 where the detection itself has not the signature of an extremum, `reach` where nothing is
        found within it.
    """
    jets = _jets(series, places)
    starts = _fold_starts(series, places, jets, 0.8 * reach)
    owner = np.tile(np.arange(len(sign)), len(starts))
    origin = places[owner]
    points = _shifted(origin, starts.reshape(-1, 3))
    found = np.full(len(sign), float(reach))
    low = BELOW_BLUR * series.blur
    for _ in range(_MOST_STEPS):
        inside = (_distance(origin, points) <= 1.5 * reach) & (points[:, 0] >= low)
        owner, origin, points = owner[inside], origin[inside], points[inside]
        if not owner.size:
            break
        here = _jets(series, points)
        step = _newton(here)
        length = np.linalg.norm(step, axis=1)
        at_end = length < 1e-6
        saddle = at_end & (_least(here, sign[owner]) <= 0)
        np.minimum.at(found, owner[saddle], _distance(origin, points)[saddle])
        step *= np.minimum(1.0, _LONGEST / np.maximum(length, 1e-300))[:, None]
        points = _shifted(points, step)[~at_end]
        owner, origin = owner[~at_end], origin[~at_end]
    return np.where(_least(jets, sign) > 0, found, 0.0)


def persistence(
    series: DogSeries, places: NDArray[np.float64], sign: NDArray[np.float64]
) -> NDArray[np.float64]:
    r"""For how long the extremum of its slice lasts when the scale changes.

    From the detection, the extremum of w at fixed scale (in y and x alone) is followed up and down
    in 8 steps of :math:`\ln\sigma` each, by Newton's method, until it disappears or a third of an
    octave is reached (`WINDOW`).

    Parameters
    ----------
    series, places, sign
        See `degeneracy`.

    Returns
    -------
    ndarray, shape (n,)
        Part of the window, 0 to 1, in steps of 1/17; 0 where its own slice has no extremum there.
    """
    start, alive = _followed(series, places, sign)
    lasts = alive.astype(float)
    for direction in (1.0, -1.0):
        rows = np.flatnonzero(alive)
        points = start[rows]
        for _ in range(_WINDOW_STEPS):
            points = points.copy()
            points[:, 0] *= math.exp(direction * WINDOW / _WINDOW_STEPS)
            points, still = _followed(series, points, sign[rows])
            rows, points = rows[still], points[still]
            lasts[rows] += 1
    return lasts / (2 * _WINDOW_STEPS + 1)


def annulus(
    series: DogSeries, places: NDArray[np.float64], sign: NDArray[np.float64]
) -> NDArray[np.float64]:
    r"""By how much the detection exceeds all of a ring around it, relative to its own value.

    Parameters
    ----------
    series, places, sign
        See `degeneracy`.

    Returns
    -------
    ndarray, shape (n,)
        :math:`\min_\varphi s (w - w_\varphi) / |w|` over 16 points at the same scale and a distance
        of sigma (`RING`): near 0 on edges, negative where the ring holds more. Clipped to -1 and 1.
    """
    value = _jets(series, places, slices=True).value
    least = np.full(len(sign), np.inf)
    for angle in 2 * np.pi * np.arange(_RING_POINTS) / _RING_POINTS:
        way = RING * np.array([0.0, math.sin(angle), math.cos(angle)])
        around = _jets(series, _shifted(places, way), slices=True).value
        least = np.minimum(least, sign * (value - around))
    size = np.abs(value)
    ratio: NDArray[np.float64] = np.zeros(len(sign))
    np.divide(least, size, out=ratio, where=size > 0)
    return np.clip(ratio, -1.0, 1.0)


def _jets(series: DogSeries, places: NDArray[np.float64], slices: bool = False) -> Jets:
    sigma, y, x = places.T
    return series.jets(sigma, y, x, slices)


def _least(jets: Jets, sign: NDArray[np.float64]) -> NDArray[np.float64]:
    """Smallest eigenvalue of -s H: positive at an extremum of this sign."""
    return np.asarray(np.linalg.eigvalsh(-sign[:, None, None] * jets.hessian)[:, 0], np.float64)


def _shifted(places: NDArray[np.float64], way: NDArray[np.float64]) -> NDArray[np.float64]:
    """Places after a displacement in the scale-space's own units, in which they are the origin."""
    way = np.broadcast_to(way, places.shape)
    moved = places.copy()
    moved[:, 0] *= np.exp(way[:, 0])
    moved[:, 1:] += places[:, :1] * way[:, 1:]
    return moved


def _distance(origin: NDArray[np.float64], points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Distance in units of the first of two places."""
    scale = np.log(points[:, 0] / origin[:, 0])
    space = (points[:, 1:] - origin[:, 1:]) / origin[:, :1]
    distance: NDArray[np.float64] = np.sqrt(scale**2 + (space**2).sum(axis=1))
    return distance


def _newton(jets: Jets) -> NDArray[np.float64]:
    """Newton step to the critical point of the quadratic model; along flat axes none."""
    values, axes = np.linalg.eigh(jets.hessian)
    slope = np.einsum("nij,ni->nj", axes, jets.gradient)
    step = np.divide(-slope, values, out=np.zeros_like(slope), where=np.abs(values) > 1e-14)
    moved: NDArray[np.float64] = np.einsum("nij,nj->ni", axes, step)
    return moved


def _fold_starts(
    series: DogSeries, places: NDArray[np.float64], jets: Jets, longest: float
) -> NDArray[np.float64]:
    """Where cubics along the axes of the Hessian put saddles, and the opposite, shape (6, n, 3)."""
    values, axes = np.linalg.eigh(jets.hessian)
    starts = []
    for k in range(3):
        axis = axes[:, :, k]
        curvature = [
            np.einsum("ni,nij,nj->n", axis, _jets(series, _shifted(places, h * axis)).hessian, axis)
            for h in (_STEP, -_STEP)
        ]
        third = (curvature[0] - curvature[1]) / (2 * _STEP)
        far = np.full(len(third), np.inf)
        np.divide(-2 * values[:, k], third, out=far, where=np.abs(third) > 1e-14)
        far = np.clip(far, -longest, longest)
        starts += [far[:, None] * axis, -far[:, None] * axis]
    return np.array(starts)


def _followed(
    series: DogSeries, points: NDArray[np.float64], sign: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Extrema of the slices nearest to given points, and whether they are there."""
    at, rows = points.copy(), np.arange(len(points))
    alive = np.zeros(len(points), dtype=bool)
    for _ in range(_SLICE_STEPS):
        if not rows.size:
            break
        jets = _jets(series, at[rows], slices=True)
        curvature = -sign[rows, None, None] * jets.hessian[:, 1:, 1:]
        values, axes = np.linalg.eigh(curvature)
        slope = np.einsum("nij,ni->nj", axes, sign[rows, None] * jets.gradient[:, 1:])
        definite = values[:, 0] > 0
        step = np.divide(slope, values, out=np.zeros_like(slope), where=values > 0)
        way = np.zeros((len(rows), 3))
        way[:, 1:] = np.einsum("nij,nj->ni", axes, step)
        length = np.linalg.norm(way, axis=1)
        alive[rows[definite & (length < 1e-4)]] = True
        way *= np.minimum(1.0, _LONGEST / np.maximum(length, 1e-300))[:, None]
        goes_on = definite & (length >= 1e-4)
        at[rows[goes_on]] = _shifted(at[rows], way)[goes_on]
        rows = rows[goes_on]
        rows = rows[_distance(points[rows], at[rows]) <= _FOLLOWED]
    return at, alive
