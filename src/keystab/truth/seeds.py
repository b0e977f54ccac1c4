"""Where the search for true extrema starts: discrete extrema of several samplings."""

from __future__ import annotations

import math
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from keystab.detection.extrema import discrete_extrema, extrema_of_array
from keystab.errors import InputError
from keystab.scalespace.continuous_dog import BELOW_BLUR, MOST_AMPLIFIED, ContinuousDog, Jets
from keystab.scalespace.dog import ScaleSpace, ranges, scale_space
from keystab.utils import validation
from keystab.utils.one_thread import one_thread

__all__ = [
    "NO_SEEDS",
    "Seeds",
    "along_curve",
    "coarser",
    "growing",
    "joined",
    "listed",
    "octave_of",
    "range_of_seeds",
    "seeds_of",
    "seeds_of_first_slice",
]

SEED_SAMPLINGS = (5, 10, 15)
"""Scales per octave of the samplings whose discrete extrema are the seeds."""

#: Seeds are sought beyond the range of scales by this factor, so that what lies at its ends is
#: found.
SEEDS_BEYOND = 2**0.25


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


NO_SEEDS = Seeds(*np.zeros((4, 0)))


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


def range_of_seeds(blur: float, sigma_min: float, sigma_max: float) -> tuple[float, float]:
    """Scales between which seeds are sought, in pixels of an image that has some blur."""
    sharpest = math.sqrt(max(blur**2 - MOST_AMPLIFIED / math.pi**2, 0.0))
    return max(sigma_min / SEEDS_BEYOND, BELOW_BLUR * blur, sharpest), sigma_max * SEEDS_BEYOND


def seeds_of(space: ScaleSpace, threads: int = 1) -> Seeds:
    """Discrete extrema of a sampled scale-space."""
    s, row, column, sign = discrete_extrema(space, threads=threads).T
    return Seeds(space.sigma[s], space.y[row], space.x[column], sign.astype(np.float64))


def seeds_of_first_slice(space: ScaleSpace, threads: int = 1) -> Seeds:
    """Seeds for the extrema between the first slice and the second.

    Below the first slice there may be none, where it is the image itself. A sample of it may be a
    seed when it is extremal among its neighbours in these two slices; `growing` says whether it
    is worth while.
    """

    def extremal(rows: tuple[int, int]) -> NDArray[np.int64]:
        top, bottom = rows
        two = space.window(slice(0, 2), slice(top - 1, bottom + 1))
        return extrema_of_array(two[[1, 0, 1]], space.rounding, (top - 1, 0))

    space.source, space.axes  # noqa: B018  made once, before threads share them
    bands = list(ranges(1, space.shape[1] - 1, 256))
    with one_thread(), ThreadPoolExecutor(threads) as pool:
        parts = list(pool.map(extremal, bands))
    _, row, column, sign = np.concatenate([np.empty((0, 4), dtype=np.int64), *parts]).T
    sigma = np.full(sign.size, space.sigma[0])
    return Seeds(sigma, space.y[row], space.x[column], sign.astype(np.float64))


def growing(series: ContinuousDog, seeds: Seeds) -> Seeds:
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


def coarser(seeds: Seeds, factor: int, rim: int, shape: tuple[int, int]) -> Seeds:
    """Seeds of a picture that is sampled more finely, in pixels of the picture itself.

    Parameters
    ----------
    seeds : Seeds
        In pixels of the finer picture.
    factor : int
        How much finer.
    rim : int
        Pixels of the picture itself that the finer one has around it.
    shape : (int, int)
        Height and width of the picture itself; seeds beyond its mirrors are left out.
    """
    y, x = ((p + 0.5) / factor - 0.5 - rim for p in (seeds.y, seeds.x))
    inside = (np.abs(y - (shape[0] - 1) / 2) <= shape[0] / 2) & (
        np.abs(x - (shape[1] - 1) / 2) <= shape[1] / 2
    )
    return Seeds(seeds.sigma[inside] / factor, y[inside], x[inside], seeds.sign[inside])


def joined(seeds: list[Seeds]) -> Seeds:
    """All seeds of several searches."""
    names = ("sigma", "y", "x", "sign")
    return Seeds(*(np.concatenate([getattr(part, name) for part in seeds]) for name in names))


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
