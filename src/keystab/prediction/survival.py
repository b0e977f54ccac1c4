r"""Whether an extremum comes back in a second shot of its scene, and how far off.

What is seen of an extremum is its jet J (`keystab.prediction.noise_covariance`): derivatives of the
scene's scale-space and of the noise. In a second shot the scene's part is the same and the noise is
another. How much of J is scene is not known; it is inferred, because noise alone makes extrema too,
and these do not come back.

The scene's jet is a Gaussian of covariance z P, with P that of a spectrum :math:`|\omega|^{-2}`
and an unknown local amplitude z, a *Gaussian scale mixture*; the noise's jet has the covariance C.
Given z, that of the second shot is Gaussian,

.. math:: J_2 \sim N(z P (z P + C)^{-1} J,\; z P (z P + C)^{-1} C + C),

and by the Kac-Rice formula z has at an extremum the density :math:`p(z)\, N(J; 0, z P + C)` up to
a factor, the gradient in J being 0. In coordinates in which P is the unit matrix and C diagonal all
of that is one number per coordinate.

From each of a fixed set of quasi-random draws of z and :math:`J_2`, the extremum of the polynomial
with these derivatives is climbed to. The share of draws whose extremum lies within `RADIUS` is the
survival, and their second moments are the covariance of the shift.

The polynomial is a quartic: up to `RADIUS` terms of the fourth order matter. Quartic and cubic miss
somewhat more extrema than they invent. ``docs/uncertainty.md`` says how often each agrees with the
detector, and has the numbers of what is left out below.

A detector looks at the 26 neighbours of a sample, so that it takes a saddle for an extremum where
a sample tops all of these, as along a ridge askew to the grid. A stationary point of an indefinite
Hessian therefore counts where a sample of the quartic near it is such an extremum, on the grid of
the detector as it lies about the keypoint. Of keypoints that are saddles the samples about them are
asked as well where the climb finds nothing. Seen from another place, on another grid, fewer return.

Left out, and seen: *what kind of scene it is*, the spectrum's exponent of 2 and its being the same
in all directions. Seen through noise an eighth of their amplitude, Gaussian fields of exponent 3
return more than a cubic said, made strokes less. With the right exponent half of the former is
gone; that under which the jets of ``street`` are likeliest, some 3, makes its error larger (0.077
for 0.068), because its edges have one direction: so none is inferred.
"""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from keystab.prediction.noise_covariance import ORDERS, scene_jets
from keystab.prediction.quartic_extrema import RADIUS, climb, tops

__all__ = ["RADIUS", "Outcome", "after_noise", "among_scenes"]

#: Draws for each extremum. Their share is uncertain by 0.02 in the middle and less at the ends.
_DRAWS = 256

#: Relative variance of derivatives that stays unknown: interpolation, and the scenes' spectrum.
#: It also keeps covariances regular: w nearly obeys a diffusion equation.
_UNKNOWN = 1e-4

#: Amplitudes z that a scene may have at a place, over the noise's variance: nothing at all, or all
#: orders of magnitude alike.
_AMPLITUDES = np.concatenate([[0.0], np.geomspace(1e-4, 1e8, 37)])

#: With fewer extrema than this among the draws the second moments of a ball stand in for the rest.
_FEW, _BALL = 16, RADIUS**2 / 5

_N = len(ORDERS)


class Outcome(NamedTuple):
    """What becomes of extrema in another shot.

    Attributes
    ----------
    survival : ndarray, shape (n,)
        Share of the draws in which the extremum is there.
    moments : ndarray, shape (n, 3, 3)
        Second moments of its shift among these, in (ln sigma, y/sigma, x/sigma).
    """

    survival: NDArray[np.float64]
    moments: NDArray[np.float64]


def after_noise(
    jets: NDArray[np.float64],
    sign: NDArray[np.float64],
    noise: NDArray[np.float64],
    grid: NDArray[np.float64],
) -> Outcome:
    """Outcome for the extrema of a view without noise, in a shot with noise.

    Parameters
    ----------
    jets : ndarray, shape (n, 35)
        Derivatives at the extrema; their gradient is taken to be 0.
    sign : ndarray, shape (n,)
        +1 for maxima, -1 for minima.
    noise : ndarray, shape (n, 35, 35)
        Covariance of the derivatives of the shot's noise.
    grid : ndarray, shape (n, 5)
        Steps of the detector's grid in ln sigma and in y/sigma, and how many of them a sample of it
        lies beyond the extremum in ln sigma, y and x.

    Returns
    -------
    Outcome
        Of a shift from the extremum of the view to that of the shot.
    """
    mean = _at_extremum(jets)
    root = np.asarray(np.linalg.cholesky(_regular(noise)), np.float64)
    certain = np.ones((len(jets), 1))
    turned = np.broadcast_to(np.eye(_N), root.shape)
    nothing = np.zeros((len(jets), 1, _N))
    saddle = _saddles(jets, sign)
    return _drawn(root, turned, nothing, certain[:, :, None], certain, mean, sign, grid, saddle)


def among_scenes(
    jets: NDArray[np.float64],
    sign: NDArray[np.float64],
    noise: NDArray[np.float64],
    grid: NDArray[np.float64],
    level: NDArray[np.float64],
    kappa: float,
) -> Outcome:
    """Outcome for extrema that were seen through noise, in another shot with as much noise.

    Parameters
    ----------
    jets, sign, noise, grid
        See `after_noise`; the derivatives are those seen, noise included.
    level : ndarray, shape (n,)
        Standard deviation of the noise of a pixel, above 0.
    kappa : float
        Ratio of the two Gaussians.

    Returns
    -------
    Outcome
        Of a shift from the extremum of the one shot to that of the other.
    """
    root, whitening = _scene_axes(kappa)
    power, axes = np.linalg.eigh(whitening @ _regular(noise) @ whitening.T)
    power = np.maximum(power, 0.0)[:, None, :]  # of the noise, where the scene's is z
    seen = np.einsum("nij,ni->nj", axes, _at_extremum(jets) @ whitening.T)[:, None, :]
    z = (level[:, None] ** 2 * _AMPLITUDES)[:, :, None]
    total = np.maximum(z + power, np.finfo(float).tiny)
    likelihood = -0.5 * (np.log(total) + seen**2 / total).sum(axis=2)
    weight = np.exp(likelihood - likelihood.max(axis=1, keepdims=True))
    cumulative = np.cumsum(weight / weight.sum(axis=1, keepdims=True), axis=1)
    share = z / total
    spread = np.sqrt(power * (1 + share))
    offset = np.zeros_like(jets)
    saddle = _saddles(jets, sign)
    return _drawn(root @ axes, axes, share * seen, spread, cumulative, offset, sign, grid, saddle)


def _at_extremum(jets: NDArray[np.float64]) -> NDArray[np.float64]:
    """Jets without what the detector's own error leaves of a gradient."""
    jets = jets.copy()
    jets[:, 1:4] = 0.0
    return jets


def _saddles(jets: NDArray[np.float64], sign: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Which keypoints are extrema of the samples only, the Hessian being indefinite."""
    hessian = jets[:, [[4, 5, 6], [5, 7, 8], [6, 8, 9]]]
    least: NDArray[np.bool_] = np.linalg.eigvalsh(-sign[:, None, None] * hessian)[:, 0] <= 0
    return least


def _regular(covariance: NDArray[np.float64]) -> NDArray[np.float64]:
    """Covariance with some more variance everywhere."""
    variance = np.einsum("...ii->...i", covariance)
    more = _UNKNOWN * variance + np.finfo(float).tiny
    regular: NDArray[np.float64] = covariance + more[..., None] * np.eye(covariance.shape[-1])
    return regular


@cache
def _scene_axes(kappa: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Root of the covariance of scenes, and its inverse: the same for all pictures."""
    root = np.asarray(np.linalg.cholesky(_regular(scene_jets(kappa))), np.float64)
    return root, np.asarray(np.linalg.inv(root), np.float64)


@cache
def _draws() -> NDArray[np.float64]:
    """Points of a scrambled Sobol sequence: normal numbers, and one that is uniform."""
    from scipy.special import ndtri
    from scipy.stats import qmc

    points = qmc.Sobol(_N + 1, scramble=True, rng=np.random.default_rng(18)).random(_DRAWS)
    points[:, :_N] = ndtri(np.clip(points[:, :_N], 1e-9, 1 - 1e-9))
    return points


def _drawn(
    basis: NDArray[np.float64],
    axes: NDArray[np.float64],
    mean: NDArray[np.float64],
    spread: NDArray[np.float64],
    cumulative: NDArray[np.float64],
    offset: NDArray[np.float64],
    sign: NDArray[np.float64],
    grid: NDArray[np.float64],
    saddle: NDArray[np.bool_],
) -> Outcome:
    """Outcome when jets are offset + basis (mean + spread times normal numbers).

    Which mean and spread, `cumulative` says: their probabilities, added up. The normal numbers are
    the components of the same vectors along `axes`: eigenvectors have no sign, and those of equal
    eigenvalues no direction, of their own, so that processors would give each keypoint other draws.
    """
    # Of one layout: compiled once, and fast.
    spread = np.array(np.broadcast_to(spread, mean.shape))
    axes = np.ascontiguousarray(axes)
    count = np.empty(len(sign))
    moments = np.empty((len(sign), 3, 3))
    columns = np.ascontiguousarray(basis.swapaxes(1, 2))
    _climb_all(
        columns,
        axes,
        mean,
        spread,
        cumulative,
        offset,
        sign,
        grid,
        saddle,
        _draws(),
        count,
        moments,
    )
    missing = np.maximum(_FEW - count, 0)[:, None, None]
    moments += missing * _BALL * np.eye(3)
    moments /= np.maximum(count, _FEW)[:, None, None]
    return Outcome(count / _DRAWS, moments)


@njit(cache=True, nogil=True)
def _climb_all(  # noqa: PLR0913
    columns, axes, mean, spread, cumulative, offset, sign, grid, saddle, draws, count, moments
):
    size = mean.shape[2]
    normal = np.ascontiguousarray(draws[:, :size])
    coordinates, jets = np.empty(normal.shape), np.empty(normal.shape)
    place, work = np.empty(3), np.empty((8, 10))  # asking for memory would take half of a climb
    samples = np.empty((7, 7, 7))
    moments[:] = 0.0
    for point in range(sign.size):
        count[point] = 0
        np.dot(normal, axes[point], coordinates)
        for draw in range(draws.shape[0]):
            k = 0
            while k < cumulative.shape[1] - 1 and cumulative[point, k] < draws[draw, size]:
                k += 1
            for i in range(size):
                coordinates[draw, i] *= spread[point, k, i]
                coordinates[draw, i] += mean[point, k, i]
        np.dot(coordinates, columns[point], jets)
        jets += offset[point]
        steps, lattice = grid[point, :2], grid[point, 2:]
        for jet in jets:
            found = climb(jet, sign[point], steps, lattice, place, work, samples)
            if saddle[point] and not found:
                place[:] = 0.0
                found = tops(jet, -sign[point], place, steps, lattice, samples)
            if found:
                count[point] += 1
                for i in range(3):
                    for m in range(3):
                        moments[point, i, m] += place[i] * place[m]
