r"""The true extrema of the continuous difference-of-Gaussians scale-space.

A detector sees the scale-space through samples and a quadratic model. The difference of Gaussians
of the image's cosine series is an analytic function of scale and position, whose value, gradient
and Hessian are finite sums (`keystab.scalespace.continuous_dog`): its extrema can be had to the
last digits, and what a detector finds can be called right or wrong.

Each extremum of one sign s is a local maximum of s w. From every seed (discrete extrema of several
samplings) a trust-region Newton iteration *climbs* s w: it never goes down, no step is longer than
a fraction of sigma, and what it ends at has a definite Hessian or is dropped. Which seed led where
does not matter: what is reported is a true extremum whatever the way to it. What seeds decide is
whether all of them are reported; `keystab.truth.curves` searches in another way.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from keystab.detection.extrema import discrete_extrema, extrema_of_array
from keystab.errors import InputError
from keystab.scalespace.continuous_dog import DogSeries, Jets
from keystab.scalespace.dog import ScaleSpace, checked_image, ranges, scale_space
from keystab.utils import validation

__all__ = ["climb", "extrema_from", "seeds_of", "true_extrema"]

SEED_SAMPLINGS = (5, 10, 15)
"""Scales per octave of the samplings whose discrete extrema are the seeds."""

SAME = 1e-6
"""Extrema that differ by less in y, in x and in sigma (pixels) are one."""

#: Gradient, relative to the contrast of the image, at which an extremum counts as found.
RESIDUAL = 1e-12

#: Least absolute eigenvalue of the Hessian relative to the contrast. Rounding moves gradients by
#: some 1e-16 of the contrast; below this it would move the extremum by some 1e-6 sigma.
_FLAT = 1e-10

#: Seeds are sought, and climbs may go, beyond the range of scales by these factors, so that what
#: lies at its ends is found. No image is sampled below its own blur, but sums may go there.
SEEDS_BEYOND = 2**0.25
_CLIMBS_BEYOND = 2**0.4
_BELOW_BLUR = 0.92

#: Radius of trust in units of (ln sigma, y/sigma, x/sigma): the first, the largest, and the least;
#: and the one at which a climb that the end of the range holds back is given up.
_FIRST_RADIUS, _LARGEST_RADIUS, _LEAST_RADIUS, _HELD_RADIUS = 0.2, 0.3, 1e-7, 0.01

_MOST_STEPS = 200


@dataclass(frozen=True)
class Seeds:
    """Where climbs start.

    Attributes
    ----------
    sigma, y, x : ndarray, shape (n,)
        Scale and position in pixels.
    sign : ndarray, shape (n,)
        +1 to look for a maximum, -1 for a minimum.
    """

    sigma: NDArray[np.float64]
    y: NDArray[np.float64]
    x: NDArray[np.float64]
    sign: NDArray[np.float64]


def true_extrema(
    image: np.ndarray,
    camera_blur: float,
    sigma_min: float = 1.1,
    sigma_max: float = 2.2,
    kappa: float = 2 ** (1 / 3),
    n_spo: Sequence[int] = SEED_SAMPLINGS,
    threads: int = 1,
) -> pd.DataFrame:
    r"""All extrema of the continuous difference-of-Gaussians scale-space of an image.

    The image, mirrored at half a pixel beyond its outer pixel centres, is a finite cosine series
    with coefficients :math:`a_{kl}`, of blur c, and

    .. math:: w(\sigma, y, x) = \sum_{kl} a_{kl} \cos(f_k (y + \tfrac12))
              \cos(g_l (x + \tfrac12)) \left( e^{-(\kappa^2\sigma^2 - c^2)(f_k^2 + g_l^2)/2}
              - e^{-(\sigma^2 - c^2)(f_k^2 + g_l^2)/2} \right)

    an analytic function. Its extrema in scale and position are found by Newton's method on the
    full sums, from the discrete extrema of several samplings.

    Parameters
    ----------
    image : array_like, shape (height, width)
        Grey image; pixel centres at whole numbers, (0, 0) top left.
    camera_blur : float
        Gaussian blur c that the image already has, in pixels, 0 <= c <= sigma_min.
    sigma_min, sigma_max : float
        Range of scales in pixels, both ends included.
    kappa : float
        Ratio of the two blurs of the difference of Gaussians, above 1.
    n_spo : sequence of int
        Scales per octave of the (balanced) samplings whose discrete extrema are the seeds. What
        is found at a given place does not depend on them, only whether it is found.
    threads : int
        Threads of the search for seeds. The result does not depend on it.

    Returns
    -------
    DataFrame
        One row per extremum, ordered by sigma, with

        ``y, x, sigma``
            Position and scale in pixels; 0 <= y <= height - 1, 0 <= x <= width - 1.
        ``value``
            w there, in the units of the image.
        ``sign``
            +1 maximum, -1 minimum: the Hessian is definite.
        ``conditioning``
            Smallest over largest absolute eigenvalue of the Hessian in the scale-space's own
            units :math:`(\ln\sigma, y/\sigma, x/\sigma)`, in (0, 1]. By the theorem of Eckart and
            Young it is the distance of the Hessian to the nearest singular matrix, relative to
            its own norm: a change of the image that changes the Hessian by this share can make
            the extremum vanish, and no smaller one can by that alone. It does not depend on
            contrast, zoom or rotation.
        ``curvature_min, curvature_mid, curvature_max``
            The absolute eigenvalues themselves, ascending, in the units of the image.
        ``residual``
            Norm of the gradient in the same units, relative to the image's standard deviation:
            at most 1e-12.
        ``error``
            Length of the Newton step that is left, in units of sigma: by how much rounding may
            have moved the extremum.

        A constant image gives no rows.

    Raises
    ------
    InputError
        For an image that is not a finite two-dimensional array, or a parameter out of its range.

    Notes
    -----
    At the mirror axes, half a pixel outside the outer pixel centres, the derivative across the
    axis vanishes by symmetry, and the mirrored image has extrema *on* them. These, and all in the
    half pixel between the axis and the outer pixel centres, are the continuation's and not the
    image's: they are left out. The extrema near the border are true extrema of the mirrored image.

    Degenerate extrema are left out: where the smallest curvature is below 1e-10 of the image's
    standard deviation, rounding decides where they are, or whether.

    Completeness is a matter of the seeds. On the study's picture seeds from samplings twice as
    dense find the same 883 extrema, and a second search that follows the extrema of each scale
    through the scales (`keystab.truth.curves.crossings`) finds nothing else.

    Every evaluation is a sum over all pixels' worth of coefficients, and the number of extrema
    grows with the picture too: time grows with the square of its area. A picture of 400 x 225
    pixels takes 20 s on one core.

    The noise and the aliasing of an image are part of it; `keystab.scene_extrema` gives the
    extrema that a view of a known scene should have.

    Examples
    --------
    A Gaussian blob of standard deviation s before the camera has its extremum at s / sqrt(kappa):

    >>> y, x = np.mgrid[:41, :41]
    >>> blob = np.exp(-((y - 20.2) ** 2 + (x - 20) ** 2) / (2 * (2.0**2 + 0.8**2)))
    >>> found = true_extrema(blob, camera_blur=0.8, n_spo=[5])
    >>> found.loc[found["value"].idxmin(), ["y", "x"]].round(9).tolist()
    [20.2, 20.0]
    >>> bool(abs(found.loc[found["value"].idxmin(), "sigma"] - 2 / 2 ** (1 / 6)) < 1e-9)
    True
    """
    array = checked_image(image)
    check_scales(camera_blur, sigma_min, sigma_max, kappa)
    samplings = listed(n_spo)
    series = DogSeries.of_image(array, float(camera_blur), float(kappa))
    low = max(sigma_min / SEEDS_BEYOND, camera_blur)
    high = sigma_max * SEEDS_BEYOND
    spaces = [octave_of(array, camera_blur, n, low, high, kappa, "cosine") for n in samplings]
    seeds = joined([seeds_of(space, threads) for space in spaces])
    first = seeds_of_first_slice(spaces[int(np.argmax(samplings))])
    seeds = joined([seeds, growing(series, first)])
    found = extrema_from(series, seeds, sigma_min, sigma_max)
    height, width = series.shape
    inside = found["y"].between(0, height - 1) & found["x"].between(0, width - 1)
    return found[inside].reset_index(drop=True)


def octave_of(
    image: NDArray[np.float64],
    camera_blur: float,
    n_spo: int,
    low: float,
    high: float,
    kappa: float,
    oversampling: str,
) -> ScaleSpace:
    """Balanced sampling whose inner slices cover the scales from `low` to `high`."""
    n_slices = math.ceil(n_spo * math.log2(high / low)) + 2
    return scale_space(
        image,
        camera_blur,
        n_spo,
        sigma_min=low,
        kappa=kappa,
        oversampling=oversampling,
        slices=(0, n_slices),
    )


def seeds_of(space: ScaleSpace, threads: int = 1) -> Seeds:
    """Discrete extrema of a sampled scale-space."""
    s, row, column, sign = discrete_extrema(space, threads=threads).T
    return Seeds(space.sigma[s], space.y[row], space.x[column], sign.astype(np.float64))


def seeds_of_first_slice(space: ScaleSpace) -> Seeds:
    """Seeds for the extrema between the first slice and the second.

    Below the first slice there may be none, where it is the image itself. A sample of it may be a
    seed when it is extremal among its neighbours in these two slices; `growing` says whether it
    is worth while.
    """
    parts = []
    for top, bottom in ranges(1, space.shape[1] - 1, 256):
        two = space.window(slice(0, 2), slice(top - 1, bottom + 1))
        parts.append(extrema_of_array(two[[1, 0, 1]], space.rounding, (top - 1, 0)))
    _, row, column, sign = np.concatenate([np.empty((0, 4), dtype=np.int64), *parts]).T
    sigma = np.full(sign.size, space.sigma[0])
    return Seeds(sigma, space.y[row], space.x[column], sign.astype(np.float64))


def growing(series: DogSeries, seeds: Seeds) -> Seeds:
    r"""Seeds near which s w grows with scale.

    By the second-order model at the seed, restricted to where the derivatives along y and x
    vanish: :math:`s \partial_\lambda w` is positive, or becomes so less than 5 % below its scale.
    """
    slope, curvature = along_curve(series.jets(seeds.sigma, seeds.y, seeds.x))
    grows = seeds.sign * slope > -0.05 * np.abs(curvature)
    return Seeds(seeds.sigma[grows], seeds.y[grows], seeds.x[grows], seeds.sign[grows])


def along_curve(jets: Jets) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    r"""Derivatives of w with respect to ln sigma along the curve of spatial critical points.

    From the second-order model at each point: with the Hessian in blocks for scale and space,
    the first is :math:`g_s - H_{sx} H_{xx}^{-1} g_x`, the value of :math:`\partial_\lambda w` at
    the model's spatial critical point of this scale, and the second
    :math:`H_{ss} - H_{sx} H_{xx}^{-1} H_{xs}`, its change along the curve of such points.

    Returns
    -------
    slope, curvature : ndarray, shape (n,)
        Infinite or NaN where the spatial Hessian is singular.
    """
    h = jets.hessian
    with np.errstate(divide="ignore", invalid="ignore"):
        determinant = h[:, 1, 1] * h[:, 2, 2] - h[:, 1, 2] ** 2
        direction = (
            np.stack(
                [
                    h[:, 1, 2] * h[:, 0, 2] - h[:, 2, 2] * h[:, 0, 1],
                    h[:, 1, 2] * h[:, 0, 1] - h[:, 1, 1] * h[:, 0, 2],
                ],
                axis=1,
            )
            / determinant[:, None]
        )
        slope = jets.gradient[:, 0] + (direction * jets.gradient[:, 1:]).sum(axis=1)
        curvature = h[:, 0, 0] + (direction * h[:, 0, 1:]).sum(axis=1)
    return slope, curvature


def joined(seeds: list[Seeds]) -> Seeds:
    """All seeds of several searches."""
    names = ("sigma", "y", "x", "sign")
    return Seeds(*(np.concatenate([getattr(part, name) for part in seeds]) for name in names))


def extrema_from(
    series: DogSeries, seeds: Seeds, sigma_min: float, sigma_max: float
) -> pd.DataFrame:
    """Extrema that climbs from the seeds lead to, each once.

    Parameters
    ----------
    series : DogSeries
        The scale-space.
    seeds : Seeds
        Where to start; in pixels of `series`.
    sigma_min, sigma_max : float
        Range of scales that is reported, in the same pixels.

    Returns
    -------
    DataFrame
        As `true_extrema` says, but wherever in the mirrored image a climb ended.
    """
    points, jets = climb(series, seeds, sigma_min, sigma_max)
    eigenvalues = np.linalg.eigvalsh(jets.hessian)
    curvature = np.sort(np.abs(eigenvalues), axis=1)
    sign = np.where(eigenvalues[:, 0] > 0, -1, 1)
    contrast = series.contrast or 1.0
    table = pd.DataFrame(
        {
            "y": points[:, 1],
            "x": points[:, 2],
            "sigma": points[:, 0],
            "value": jets.value,
            "sign": sign,
            "conditioning": curvature[:, 0] / curvature[:, 2],
            "curvature_min": curvature[:, 0],
            "curvature_mid": curvature[:, 1],
            "curvature_max": curvature[:, 2],
            "residual": np.linalg.norm(jets.gradient, axis=1) / contrast,
            "error": np.linalg.norm(_newton_step(jets), axis=1),
        }
    )
    definite = (eigenvalues[:, 0] > 0) | (eigenvalues[:, 2] < 0)
    good = definite & (table["residual"] <= RESIDUAL) & (curvature[:, 0] > _FLAT * contrast)
    good &= table["sigma"].between(sigma_min, sigma_max)
    return _merged(table[good])


def climb(
    series: DogSeries, seeds: Seeds, sigma_min: float, sigma_max: float
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
        See `extrema_from`. Climbs that leave the range of scales by more than a factor of 2**0.4,
        or go below 0.92 of the image's own blur, are given up.

    Returns
    -------
    points : ndarray, shape (n, 3)
        Scale and position of those that ended at a maximum of s w.
    jets : Jets
        Value, gradient and Hessian there.
    """
    low = max(sigma_min / _CLIMBS_BEYOND, _BELOW_BLUR * series.blur)
    bounds = (low, sigma_max * _CLIMBS_BEYOND)
    within = (seeds.sigma >= bounds[0]) & (seeds.sigma <= bounds[1])
    points = np.stack([seeds.sigma, seeds.y, seeds.x], axis=1)[within]
    points, jets, arrived = climbed(series, points, seeds.sign[within], bounds)
    return points[arrived], jets[arrived]


def climbed(
    series: DogSeries,
    points: NDArray[np.float64],
    sign: NDArray[np.float64],
    bounds: tuple[float, float] | None,
) -> tuple[NDArray[np.float64], Jets, NDArray[np.bool_]]:
    """Climb from each point, see `climb`.

    Parameters
    ----------
    series : DogSeries
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


def check_scales(camera_blur: float, sigma_min: float, sigma_max: float, kappa: float) -> None:
    """Refuse scales that do not fit together."""
    validation.number("camera_blur", camera_blur, least=0)
    validation.number("sigma_min", sigma_min, above=0)
    validation.number("sigma_max", sigma_max, above=0)
    validation.number("kappa", kappa, above=1)
    if not sigma_min < sigma_max:
        raise InputError(
            f"sigma_max is {sigma_max:g}, allowed are scales above sigma_min, {sigma_min:g}: "
            "raise sigma_max"
        )
    if sigma_min < camera_blur:
        raise InputError(
            f"sigma_min is {sigma_min:g} but the image already has a blur of {camera_blur:g} px: "
            f"give a sigma_min of at least {camera_blur:g}"
        )


def listed(n_spo: Sequence[int]) -> list[int]:
    """Numbers of scales per octave, checked."""
    try:
        samplings = list(n_spo)
    except TypeError:  # one number
        samplings = []
    if not samplings:
        raise InputError(
            f"n_spo is {n_spo!r}, allowed are lists of one or more numbers of scales per octave: "
            "give some"
        )
    return [validation.integer("n_spo", n, least=1) for n in samplings]


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


def _newton_step(jets: Jets) -> NDArray[np.float64]:
    """Plain Newton step of each point, shape (n, 3)."""
    values, axes = np.linalg.eigh(jets.hessian)
    slope = np.einsum("nij,ni->nj", axes, jets.gradient)
    with np.errstate(divide="ignore", invalid="ignore"):
        step = np.nan_to_num(-slope / values, nan=0.0, posinf=0.0, neginf=0.0)
    return np.einsum("nij,nj->ni", axes, step)


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


def _jets(series: DogSeries, points: NDArray[np.float64], within_slices: bool = False) -> Jets:
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
    series: DogSeries,
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
    arrived = (values[:, 0] > 0) & (np.linalg.norm(_newton_step(here), axis=1) < 1e-4)
    rows = every[arrived]
    # The first of them leaves at most 1e-8 of the way, the second what rounding does.
    if slices:
        jets.put(rows, _jets(series, points[rows]))
    for _ in range(2):
        here = model(jets[rows], rows)
        there = _moved(points[rows], _newton_step(here), series.shape)
        trial = _jets(series, there)
        slopes = [np.linalg.norm(j.gradient, axis=1) for j in (here, model(trial, rows))]
        better = slopes[1] < slopes[0]
        points[rows[better]] = there[better]
        jets.put(rows[better], trial[better])
        rows = rows[better]
    return arrived


def _merged(table: pd.DataFrame) -> pd.DataFrame:
    """Each extremum once, the copy with the least residual, ordered by sigma, y, x."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import cKDTree

    where = table[["y", "x", "sigma"]].to_numpy()
    pairs = np.zeros((0, 2), dtype=np.intp)
    if len(where):
        pairs = cKDTree(where).query_pairs(SAME, p=math.inf, output_type="ndarray")
    links = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(len(where),) * 2)
    group = connected_components(links, directed=False)[1] if len(where) else np.zeros(0)
    best = table.assign(group=group).sort_values("residual", kind="stable")
    best = best.drop_duplicates("group").drop(columns="group")
    return best.sort_values(["sigma", "y", "x"], ignore_index=True)
