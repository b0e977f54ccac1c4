r"""From seeds to extrema: Newton's method that never goes down, in a region of trust.

Each extremum of one sign s is a local maximum of s w. From every seed the iteration *climbs* s w:
no step is longer than a fraction of sigma, and what it ends at has a definite Hessian or is
dropped. Which seed led where does not matter: what is reported is a true extremum whatever the way
to it.
"""

from __future__ import annotations

import math
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from numpy.typing import NDArray

from keystab.scalespace.continuous_dog import BELOW_BLUR, ContinuousDog, Jets
from keystab.truth.seeds import Seeds
from keystab.utils.progress import progress_if_watched

__all__ = ["climb", "climbed", "folded", "newton_step", "range_of_climbs"]

#: Climbs may go beyond the range of scales by this factor.
_CLIMBS_BEYOND = 2**0.4

#: Radius of trust in units of (ln sigma, y/sigma, x/sigma): the first, the largest, and the least;
#: and the one at which a climb that the end of the range holds back is given up.
_FIRST_RADIUS, _LARGEST_RADIUS, _LEAST_RADIUS, _HELD_RADIUS = 0.2, 0.3, 1e-7, 0.01

_MOST_STEPS = 200

#: Climbs that are made in step with each other.
_AT_ONCE = 2048


def climb(
    series: ContinuousDog, seeds: Seeds, sigma_min: float, sigma_max: float, threads: int = 1
) -> tuple[NDArray[np.float64], Jets]:
    r"""Climb from each seed to an extremum of its sign; returns those that arrive.

    A trust-region Newton iteration that maximises s w in the scale-space's own units: with
    gradient g and Hessian H at a point, the step d maximises the model
    :math:`s (g^T d + \tfrac12 d^T H d)` under :math:`\|d\| \le r`, and is taken only where s w
    grows. r is at most 0.3, that is 0.3 sigma in space or a factor of 1.35 in scale, and shrinks
    where the model is wrong. Near a maximum this is Newton's method, which there doubles the
    number of correct digits with each step.

    Parameters
    ----------
    series, seeds, sigma_min, sigma_max
        See `keystab.truth.true_extrema.extrema_from`. Climbs that leave `range_of_climbs` are given
        up.
    threads : int
        Climbs at once. No climb depends on another.

    Returns
    -------
    points : ndarray, shape (n, 3)
        Scale and position of those that ended at a maximum of s w.
    jets : Jets
        Value, gradient and Hessian there.
    """
    bounds = range_of_climbs(series.blur, sigma_min, sigma_max)
    within = np.flatnonzero((seeds.sigma >= bounds[0]) & (seeds.sigma <= bounds[1]))
    points = np.stack([seeds.sigma, seeds.y, seeds.x], axis=1)

    def arrivals(rows: NDArray[np.intp]) -> tuple[NDArray[np.float64], Jets]:
        ends, jets, arrived = climbed(series, points[rows], seeds.sign[rows], bounds)
        return ends[arrived], jets[arrived]

    parts = [within[start : start + _AT_ONCE] for start in range(0, within.size, _AT_ONCE)]
    with ThreadPoolExecutor(threads) as pool:
        found = list(progress_if_watched(pool.map(arrivals, parts), len(parts), "climbs"))
    found.append((np.empty((0, 3)), Jets(np.empty(0), np.empty((0, 3)), np.empty((0, 3, 3)))))
    ends, jets = zip(*found, strict=True)
    return np.concatenate(ends), Jets.joined(jets)


def range_of_climbs(blur: float, sigma_min: float, sigma_max: float) -> tuple[float, float]:
    """Scales between which climbs go: a factor of 2**0.4 beyond what is reported, but not below
    `BELOW_BLUR` of the blur that the image has.
    """
    return max(sigma_min / _CLIMBS_BEYOND, BELOW_BLUR * blur), sigma_max * _CLIMBS_BEYOND


def climbed(
    series: ContinuousDog,
    points: NDArray[np.float64],
    sign: NDArray[np.float64],
    bounds: tuple[float, float] | None,
) -> tuple[NDArray[np.float64], Jets, NDArray[np.bool_]]:
    """Climb from each point, see `climb`.

    Parameters
    ----------
    series : ContinuousDog
        The scale-space.
    points : ndarray, shape (n, 3)
        Scale and position where climbs start.
    sign : ndarray, shape (n,)
        +1 to climb w, -1 to climb -w.
    bounds : (float, float), optional
        Scales at which climbs are given up. None keeps each point at its scale: what is reached
        is an extremum of that slice.

    Returns
    -------
    points : ndarray, shape (n, 3)
        Where each climb ended.
    jets : Jets
        Value, gradient and Hessian there.
    arrived : ndarray of bool, shape (n,)
        Whether that is an extremum.
    """
    points = points.copy()
    within = bounds or (0.0, math.inf)
    jets = _jets(series, points, bounds is None)
    radius = np.full(sign.size, _FIRST_RADIUS)
    active = np.arange(sign.size)
    for _ in range(_MOST_STEPS):
        here = jets[active]
        model = here if bounds else _of_slice(here, sign[active], series.contrast)
        step, promised, at_end = _step(model, sign[active], radius[active])
        there = _moved(points[active], step, series.shape)
        inside = (there[:, 0] >= within[0]) & (there[:, 0] <= within[1])
        goes_on = ~at_end & (promised > 0)
        goes_on &= radius[active] > np.where(inside, _LEAST_RADIUS, _HELD_RADIUS)
        active, step, promised = active[goes_on], step[goes_on], promised[goes_on]
        here, there, inside = here[goes_on], there[goes_on], inside[goes_on]
        if not active.size:
            break
        # Where a step leaves the range, any point will do: it is not taken.
        where = np.where(inside[:, None], there, points[active])
        trial = _jets(series, where, bounds is None)
        gained = sign[active] * (trial.value - here.value)
        ratio = np.where(inside, gained / promised, -1.0)
        # Close to the maximum rounding hides what is gained, but not that the gradient shrinks.
        free = slice(None) if bounds else slice(1, None)
        slopes = [np.linalg.norm(j.gradient[:, free], axis=1) for j in (here, trial)]
        tiny = (promised < 1e-12 * series.contrast) & (slopes[1] < slopes[0])
        taken = inside & ((ratio > 0.05) | tiny)
        length = np.linalg.norm(step, axis=1)
        grown = np.where(ratio > 0.7, np.maximum(radius[active], 2 * length), radius[active])
        trusted = taken & ((ratio > 0.2) | tiny)
        radius[active] = np.where(trusted, np.minimum(grown, _LARGEST_RADIUS), length / 3)
        rows = active[taken]
        points[rows] = there[taken]
        jets.put(rows, trial[taken])
    arrived = _polish(series, points, jets, sign, bounds is None)
    return points, jets, arrived


def _step(
    jets: Jets, sign: NDArray[np.float64], radius: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.bool_]]:
    """Best step within the radius of trust, what the model promises, and whether to stop.

    The step is ``(M + mu)^-1 g`` for the model ``g d - d M d / 2``, with the least mu >= 0 that
    makes M + mu positive and the step no longer than the radius, found by bisection.
    """
    curvature, axes = np.linalg.eigh(-sign[:, None, None] * jets.hessian)
    slope = np.einsum("nij,ni->nj", axes, sign[:, None] * jets.gradient)
    norm = np.linalg.norm(slope, axis=1)
    least = np.maximum(0.0, -curvature[:, 0])
    most = norm / radius + least
    with np.errstate(divide="ignore", invalid="ignore"):
        newton = np.linalg.norm(slope / curvature, axis=1)
        inner = (curvature[:, 0] > 0) & (newton <= radius)
        for _ in range(40):
            middle = (least + most) / 2
            too_long = ~(np.linalg.norm(slope / (curvature + middle[:, None]), axis=1) <= radius)
            least, most = np.where(too_long, middle, least), np.where(too_long, most, middle)
        shift = np.where(inner, 0.0, most)
        step = np.nan_to_num(slope / (curvature + shift[:, None]), posinf=0.0, neginf=0.0)
    # On a saddle that is symmetric to the last digit no slope says which way to go: any will do.
    lost = (curvature[:, 0] < 0) & (np.linalg.norm(step, axis=1) < 0.5 * radius)
    step[lost, 0] = radius[lost]
    promised = (slope * step).sum(axis=1) - 0.5 * (curvature * step**2).sum(axis=1)
    return np.einsum("nij,nj->ni", axes, step), promised, inner & (newton < 1e-7)


def newton_step(jets: Jets) -> NDArray[np.float64]:
    """Plain Newton step of each point, shape (n, 3)."""
    values, axes = np.linalg.eigh(jets.hessian)
    slope = np.einsum("nij,ni->nj", axes, jets.gradient)
    with np.errstate(divide="ignore", invalid="ignore"):
        step = np.nan_to_num(-slope / values, nan=0.0, posinf=0.0, neginf=0.0)
    moved: NDArray[np.float64] = np.einsum("nij,nj->ni", axes, step)
    return moved


def _moved(
    points: NDArray[np.float64], step: NDArray[np.float64], shape: tuple[int, int]
) -> NDArray[np.float64]:
    """Points after a step in units of (ln sigma, y / sigma, x / sigma), mirrored into the image."""
    moved = np.empty_like(points)
    moved[:, 0] = points[:, 0] * np.exp(step[:, 0])
    moved[:, 1:] = points[:, 1:] + points[:, :1] * step[:, 1:]
    return folded(moved, shape)


def folded(points: NDArray[np.float64], shape: tuple[int, int]) -> NDArray[np.float64]:
    """Points of the mirrored image where the image itself shows the same: between its mirrors."""
    inside = points.copy()
    for axis, n in enumerate(shape, start=1):
        turned = np.mod(points[:, axis] + 0.5, 2.0 * n)
        inside[:, axis] = np.minimum(turned, 2.0 * n - turned) - 0.5
    return inside


def _jets(series: ContinuousDog, points: NDArray[np.float64], within_slices: bool = False) -> Jets:
    sigma, y, x = points.T
    return series.jets(sigma, y, x, within_slices)


def _of_slice(jets: Jets, sign: NDArray[np.float64], contrast: float) -> Jets:
    """Jets of which no climb leaves the slice: flat along scale, and curved the right way."""
    gradient, hessian = jets.gradient.copy(), jets.hessian.copy()
    gradient[:, 0] = 0.0
    hessian[:, 0, :] = hessian[:, :, 0] = 0.0
    hessian[:, 0, 0] = -sign * contrast
    return Jets(jets.value, gradient, hessian)


def _polish(
    series: ContinuousDog,
    points: NDArray[np.float64],
    jets: Jets,
    sign: NDArray[np.float64],
    slices: bool,
) -> NDArray[np.bool_]:
    """Take two plain Newton steps from points near an extremum, in place; say which are near.

    Their jets have all derivatives afterwards, also where climbs within slices did without.
    """

    def model(j: Jets, rows: NDArray[np.intp]) -> Jets:
        return _of_slice(j, sign[rows], series.contrast) if slices else j

    every = np.arange(sign.size)
    here = model(jets, every)
    values = np.linalg.eigvalsh(-sign[:, None, None] * here.hessian)
    is_near = np.linalg.norm(newton_step(here), axis=1) < 1e-4
    arrived: NDArray[np.bool_] = (values[:, 0] > 0) & is_near
    rows = every[arrived]
    # The first of them leaves at most 1e-8 of the way, the second what rounding does.
    if slices:
        jets.put(rows, _jets(series, points[rows]))
    for _ in range(2):
        here = model(jets[rows], rows)
        there = _moved(points[rows], newton_step(here), series.shape)
        trial = _jets(series, there)
        slopes = [np.linalg.norm(j.gradient, axis=1) for j in (here, model(trial, rows))]
        better = slopes[1] < slopes[0]
        points[rows[better]] = there[better]
        jets.put(rows[better], trial[better])
        rows = rows[better]
    return arrived
