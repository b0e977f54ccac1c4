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

import math
from functools import cache
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from keystab.prediction.noise_covariance import ORDERS, scene_jets

__all__ = ["RADIUS", "Outcome", "after_noise", "among_scenes"]

RADIUS = 0.5
"""How far a returning extremum is at most, in (ln sigma, y/sigma, x/sigma)."""

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
    least: NDArray[np.float64] = np.linalg.eigvalsh(-sign[:, None, None] * hessian)[:, 0]
    return least <= 0


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
    spread = np.array(np.broadcast_to(spread, mean.shape))  # of one layout: compiled once
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
    place, jet, coordinate = np.empty(3), np.empty(size), np.empty(size)
    work = np.empty((8, 10))  # of a climb, which would spend half its time on asking for memory
    moments[:] = 0.0
    for point in range(sign.size):
        count[point] = 0
        for draw in draws:
            k = 0
            while k < cumulative.shape[1] - 1 and cumulative[point, k] < draw[size]:
                k += 1
            coordinate[:] = 0.0
            for m in range(size):
                for i in range(size):
                    coordinate[i] += axes[point, m, i] * draw[m]
            for i in range(size):
                coordinate[i] = mean[point, k, i] + spread[point, k, i] * coordinate[i]
            jet[:] = offset[point]
            for m in range(size):
                for i in range(size):
                    jet[i] += columns[point, m, i] * coordinate[m]
            found = _climb(jet, sign[point], grid[point, :2], grid[point, 2:], place, work)
            if saddle[point] and not found:
                place[:] = 0.0
                found = _tops(jet, -sign[point], place, grid[point, :2], grid[point, 2:])
            if found:
                count[point] += 1
                for i in range(3):
                    for m in range(3):
                        moments[point, i, m] += place[i] * place[m]


@njit(cache=True, nogil=True)
def _climb(jet, sign, grid, lattice, place, work):
    """Climb to the extremum of a quartic nearest to the origin, and say whether it is near."""
    place[:] = 0.0
    along, third, pair = work[0], work[1], work[2, :6]  # by order: 3, 3 and 2
    h, g, step = work[3:6, :3], work[6, :3], work[7, :3]
    radius2 = RADIUS * RADIUS
    for _ in range(25):
        _slopes(jet, -sign, place, along, third, pair, g, h)  # of -s w, to be minimised
        shift = 0.0
        size = abs(h[0, 0]) + abs(h[1, 1]) + abs(h[2, 2]) + 1e-300
        settled, saddle = True, False
        if not _solved(h, shift, g, step):
            settled = _stands_out(h, grid) and _stationary(h, g, step)
            saddle = settled
            while not settled and not _solved(h, shift, g, step):
                shift = max(2.0 * shift, 0.05 * size)
        length = math.sqrt(step[0] ** 2 + step[1] ** 2 + step[2] ** 2)
        factor = min(1.0, 0.2 / length) if length > 0 else 1.0
        far = 0.0
        for i in range(3):
            place[i] -= factor * step[i]
            far += place[i] ** 2
        if far > 2.25 * radius2:
            return False
        if settled and length < 1e-3:
            if saddle and not _tops(jet, -sign, place, grid, lattice):
                return False
            return far < radius2
    return False


@njit(cache=True, nogil=True)
def _stands_out(h, grid):
    """Whether the curvature is that of an extremum along the 13 directions of the grid."""
    for code in range(14, 27):  # one of each pair of opposite neighbours
        a = (code // 9 - 1) * grid[0]
        b = (code // 3 % 3 - 1) * grid[1]
        c = (code % 3 - 1) * grid[1]
        along = h[0, 0] * a * a + h[1, 1] * b * b + h[2, 2] * c * c
        along += 2.0 * (h[0, 1] * a * b + h[0, 2] * a * c + h[1, 2] * b * c)
        if not along > 0:
            return False
    return True


@njit(cache=True, nogil=True)
def _tops(jet, factor, place, grid, lattice):
    """Whether a sample within two steps of a place is the least of its neighbours on the grid."""
    value, at, steps = np.empty((7, 7, 7)), np.empty(3), (grid[0], grid[1], grid[1])
    first = np.empty(3)
    for i in range(3):
        first[i] = (np.rint(place[i] / steps[i] - lattice[i]) + lattice[i] - 3) * steps[i]
    along, third, pair = np.empty(10), np.empty(10), np.empty(6)
    for i in range(7):
        at[0] = first[0] + i * steps[0]
        for j in range(7):
            at[1] = first[1] + j * steps[1]
            for k in range(7):
                at[2] = first[2] + k * steps[2]
                value[i, j, k] = factor * _value(jet, at, along, third, pair)
    for i in range(1, 6):
        for j in range(1, 6):
            for k in range(1, 6):
                if _is_least(value, i, j, k):
                    return True
    return False


@njit(cache=True, nogil=True)
def _is_least(value, i, j, k):
    here = value[i, j, k]
    for a in range(i - 1, i + 2):
        for b in range(j - 1, j + 2):
            for c in range(k - 1, k + 2):
                if value[a, b, c] <= here and not (a == i and b == j and c == k):
                    return False
    return True


@njit(cache=True, nogil=True)
def _value(jet, d, along, third, pair):
    """Value of a quartic at a displacement, less that at none."""
    _contracted(jet[20:], 3, d, along)
    for k in range(10):
        third[k] = jet[10 + k] / 6.0 + along[k] / 24.0
    _contracted(third, 2, d, pair)
    for k in range(6):
        pair[k] += jet[4 + k] / 2.0
    _contracted(pair, 1, d, third)
    return (jet[1] + third[0]) * d[0] + (jet[2] + third[1]) * d[1] + (jet[3] + third[2]) * d[2]


@njit(cache=True, nogil=True)
def _stationary(h, g, step):
    """Solve H step = g by cofactors; False where H is singular."""
    c0 = h[1, 1] * h[2, 2] - h[1, 2] * h[1, 2]
    c1 = h[0, 2] * h[1, 2] - h[0, 1] * h[2, 2]
    c2 = h[0, 1] * h[1, 2] - h[0, 2] * h[1, 1]
    determinant = h[0, 0] * c0 + h[0, 1] * c1 + h[0, 2] * c2
    if determinant == 0:
        return False
    c11 = h[0, 0] * h[2, 2] - h[0, 2] * h[0, 2]
    c12 = h[0, 1] * h[0, 2] - h[0, 0] * h[1, 2]
    c22 = h[0, 0] * h[1, 1] - h[0, 1] * h[0, 1]
    step[0] = (c0 * g[0] + c1 * g[1] + c2 * g[2]) / determinant
    step[1] = (c1 * g[0] + c11 * g[1] + c12 * g[2]) / determinant
    step[2] = (c2 * g[0] + c12 * g[1] + c22 * g[2]) / determinant
    return True


@njit(cache=True, nogil=True)
def _solved(h, shift, g, step):
    """Solve (H + shift) step = g by Cholesky's decomposition; False where H is not definite."""
    a = h[0, 0] + shift
    if not a > 0:
        return False
    l00 = math.sqrt(a)
    l10, l20 = h[1, 0] / l00, h[2, 0] / l00
    b = h[1, 1] + shift - l10 * l10
    if not b > 0:
        return False
    l11 = math.sqrt(b)
    l21 = (h[2, 1] - l20 * l10) / l11
    c = h[2, 2] + shift - l20 * l20 - l21 * l21
    if not c > 0:
        return False
    l22 = math.sqrt(c)
    u = g[0] / l00
    v = (g[1] - l10 * u) / l11
    w = (g[2] - l20 * u - l21 * v) / l22
    step[2] = w / l22
    step[1] = (v - l21 * step[2]) / l11
    step[0] = (u - l10 * step[1] - l20 * step[2]) / l00
    return True


@njit(cache=True, nogil=True)
def _slopes(jet, factor, d, along, third, pair, g, h):  # noqa: PLR0913
    """Gradient and Hessian of a quartic at a displacement, times a factor."""
    _contracted(jet[20:], 3, d, along)
    # H + (T + Q d / 2) d
    for k in range(10):
        third[k] = jet[10 + k] + along[k] / 2.0
    _contracted(third, 2, d, pair)
    k = 0
    for i in range(3):
        for j in range(i, 3):
            h[i, j] = h[j, i] = factor * (jet[4 + k] + pair[k])
            k += 1
    # g + (H + (T / 2 + Q d / 6) d) d
    for k in range(10):
        third[k] = jet[10 + k] / 2.0 + along[k] / 6.0
    _contracted(third, 2, d, pair)
    for k in range(6):
        pair[k] += jet[4 + k]
    _contracted(pair, 1, d, g)
    for i in range(3):
        g[i] = factor * (jet[1 + i] + g[i])


@njit(cache=True, nogil=True)
def _contracted(tensor, order, d, out):
    """Symmetric tensor times a vector: a tensor of the order that is left, ordered as `ORDERS`.

    With j of its indices not the scale, those with one more index of scale, y and x lie 0, j + 1
    and j + 2 places on.
    """
    k = 0
    for j in range(order + 1):
        for _ in range(j + 1):
            out[k] = d[0] * tensor[k] + d[1] * tensor[k + j + 1] + d[2] * tensor[k + j + 2]
            k += 1
