r"""The extrema that a view of a known scene should have.

An image's own extrema (`keystab.truth.true_extrema.true_extrema`) say what sampling a scale-space
costs. What aliasing, a wrong blur and noise cost they cannot say: these are part of the image. The
scene can: its own scale-space, of the reference's cosine series, seen from where the camera stands.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from keystab.camera.simulation import Scene, simulate
from keystab.camera.views import ViewSpec, to_reference, to_view
from keystab.errors import InputError
from keystab.scalespace.continuous_dog import DogSeries
from keystab.scalespace.local_dog import LocalDog
from keystab.truth.newton import folded, range_of_climbs
from keystab.truth.seeds import (
    SEED_SAMPLINGS,
    SEEDS_BEYOND,
    Seeds,
    growing,
    joined,
    listed,
    octave_of,
    seeds_of,
    seeds_of_first_slice,
)
from keystab.truth.true_extrema import check_scales, extrema_from
from keystab.utils import validation

__all__ = ["scene_extrema"]

#: The view in which seeds are sought has this many pixels per pixel of the view itself, so that
#: it hardly aliases at the scales of the seeds; and a rim of so many of the largest blurs.
_FINER = 2
_RIM = 3.0


def scene_extrema(
    reference: Scene | ArrayLike,
    spec: ViewSpec,
    sigma_min: float = 1.1,
    sigma_max: float = 2.2,
    kappa: float = 2 ** (1 / 3),
    reference_blur: float = 0.0,
    n_spo: Sequence[int] = SEED_SAMPLINGS,
    threads: int = 1,
) -> pd.DataFrame:
    r"""All extrema of a scene's continuous scale-space, where and as large as a view sees them.

    With the reference's cosine series v of blur :math:`c_{ref}`, a view of step S should see

    .. math:: w(\sigma, p) = \left(G_{\sqrt{(\kappa\sigma S)^2 - c_{ref}^2}} v
              - G_{\sqrt{(\sigma S)^2 - c_{ref}^2}} v\right)(P(p)),

    where P maps positions p of the view to the reference (`keystab.camera.views.to_reference`).

    Parameters
    ----------
    reference : Scene or array_like, shape (H, W)
        The scene. A `keystab.camera.simulation.Scene` saves computing the series again.
    spec : ViewSpec
        The view: its step, shape, shift and rotation count. Its blur and noise do not: they are
        the camera's and not the scene's.
    sigma_min, sigma_max : float
        Range of scales in view pixels, both ends included.
    kappa : float
        Ratio of the two blurs of the difference of Gaussians, above 1.
    reference_blur : float
        Blur of the reference in its own pixels, at most sigma_min S.
    n_spo, threads
        See `keystab.true_extrema`.

    Returns
    -------
    DataFrame
        The columns of `keystab.true_extrema`, positions and scales in view pixels; those that the
        view shows, 0 <= y <= height - 1 and 0 <= x <= width - 1. Conditioning and curvatures do
        not depend on the view. `residual` is relative to the standard deviation of the reference.

    Raises
    ------
    InputError
        If `reference` is no image or a parameter is out of its range.

    Notes
    -----
    A noiseless view has the same extrema but for its aliasing. On the study's picture (S = 10, 15
    pixels from the border), those of a view with c = 1.1 lie 5e-4 pixels from the scene's in the
    median; all of the 288 with a conditioning above 0.1 are there, 95 % within 0.01 pixels and
    none farther than 0.04; of those between 0.03 and 0.1, 2 % have no counterpart within 0.3.

    Beyond its border the reference continues as its mirror image, as for `keystab.simulate_view`,
    and extrema of the continuation count where the view shows them.

    Seeds are the discrete extrema of a view twice as fine, blurred to the lowest scale: the limits
    of `keystab.true_extrema` apply.

    Examples
    --------
    A blob of 20 reference pixels, seen from ten times as far away: 2 / sqrt(kappa) view pixels.

    >>> y, x = np.mgrid[:300, :300]
    >>> scene = np.exp(-((y - 150) ** 2 + (x - 140) ** 2) / (2 * 20.0**2))
    >>> found = scene_extrema(scene, ViewSpec(1.1, 10.0, (20, 20), shift=(0.5, 0.0)), n_spo=[5])
    >>> found.loc[found["value"].idxmin(), ["y", "x", "sigma"]].round(6).tolist()
    [9.05, 8.55, 1.781797]
    """
    scene = reference if isinstance(reference, Scene) else Scene(reference)
    if spec.homography is not None:
        raise InputError(
            "the view sees the scene from the side, allowed are views that look straight at it: "
            "no scale of the scene is that of such a view"
        )
    own_blur = validation.number("reference_blur", reference_blur, least=0)
    check_scales(own_blur / spec.step, sigma_min, sigma_max, kappa)
    samplings = listed(n_spo)
    coefs = scene.coefficients.copy()
    coefs[0, 0] = 0.0  # no difference of Gaussians has a mean
    whole = DogSeries(coefs, scene.shape, own_blur, float(kappa))
    ends = (sigma_min * spec.step, sigma_max * spec.step)
    series = LocalDog.of_series(whole, *range_of_climbs(own_blur, *ends))
    seeds = _seeds(scene, spec, sigma_min, sigma_max, series, samplings, threads)
    found = extrema_from(series, seeds, *ends, threads)
    return _seen(found, spec, scene.shape)


def _seeds(
    scene: Scene,
    spec: ViewSpec,
    sigma_min: float,
    sigma_max: float,
    series: LocalDog,
    samplings: list[int],
    threads: int,
) -> Seeds:
    """Discrete extrema of a finer view, in reference pixels."""
    low = max(sigma_min / SEEDS_BEYOND, series.blur / spec.step)
    high = sigma_max * SEEDS_BEYOND
    rim = math.ceil(_RIM * _FINER * series.kappa * high)
    blur = _FINER * low
    finer = replace(
        spec,
        blur=math.sqrt(max(blur**2 - (_FINER * series.blur / spec.step) ** 2, 0.0)),
        step=spec.step / _FINER,
        shape=(_FINER * spec.shape[0] + 2 * rim, _FINER * spec.shape[1] + 2 * rim),
        shift=(_FINER * spec.shift[0], _FINER * spec.shift[1]),
        noise=0.0,
    )
    view = simulate(scene, finer)
    spaces = [
        octave_of(view, blur, n, blur, _FINER * high, series.kappa, "spline") for n in samplings
    ]
    seeds = _mapped(joined([seeds_of(space, threads) for space in spaces]), finer, scene.shape, rim)
    if low == sigma_min / SEEDS_BEYOND:
        return seeds
    first = seeds_of_first_slice(spaces[int(np.argmax(samplings))], threads)
    return joined([seeds, growing(series, _mapped(first, finer, scene.shape, rim))])


def _mapped(seeds: Seeds, finer: ViewSpec, shape: tuple[int, int], rim: int) -> Seeds:
    """Seeds in or next to the view, in reference pixels between the reference's mirrors."""
    near = np.ones(seeds.sign.size, dtype=bool)
    for p, n in zip((seeds.y, seeds.x), finer.shape, strict=True):
        near &= (p >= rim - seeds.sigma) & (p <= n - rim + seeds.sigma)
    y, x = to_reference(finer, shape, seeds.y[near], seeds.x[near])
    sigma, y, x = folded(np.stack([seeds.sigma[near] * finer.step, y, x], axis=1), shape).T
    return Seeds(sigma, y, x, seeds.sign[near])


def _seen(found: pd.DataFrame, spec: ViewSpec, shape: tuple[int, int]) -> pd.DataFrame:
    """Extrema, and their mirror images, that lie in the view; in its pixels."""
    height, width = spec.shape
    corners = np.array([[0, 0], [0, width - 1], [height - 1, 0], [height - 1, width - 1]])
    reach = to_reference(spec, shape, corners[:, 0], corners[:, 1])
    parts = []
    for mirror_y, mirror_x in itertools.product(
        *(_mirrors(p, n) for p, n in zip(reach, shape, strict=True))
    ):
        y, x = to_view(
            spec, shape, *(_at(found[c], m) for c, m in (("y", mirror_y), ("x", mirror_x)))
        )
        inside = (y >= 0) & (y <= height - 1) & (x >= 0) & (x <= width - 1)
        part = found.assign(y=y, x=x, sigma=found["sigma"] / spec.step)
        # Extrema on a mirror axis are their own mirror image.
        doubled = (mirror_y[0] < 0) & _on_axis(found["y"], shape[0])
        doubled |= (mirror_x[0] < 0) & _on_axis(found["x"], shape[1])
        parts.append(part[inside & ~doubled])
    table = pd.concat(parts, ignore_index=True)
    return table.sort_values(["sigma", "y", "x"], ignore_index=True)


def _mirrors(reach: NDArray[np.float64], n: int) -> list[tuple[float, float]]:
    """Mirror images, p at ``sign * p + offset``, that may be within reach along an axis."""
    first, last = (math.floor((p + 0.5) / (2 * n)) for p in (reach.min() - n, reach.max() + n))
    turns = [2.0 * n * k for k in range(first, last + 1)]
    return [(1.0, turn) for turn in turns] + [(-1.0, turn - 1) for turn in turns]


def _at(positions: pd.Series, mirror: tuple[float, float]) -> NDArray[np.float64]:
    return mirror[0] * positions.to_numpy() + mirror[1]


def _on_axis(positions: pd.Series, n: int) -> NDArray[np.bool_]:
    p = positions.to_numpy()
    return (np.abs(p + 0.5) < 1e-6) | (np.abs(p - n + 0.5) < 1e-6)
