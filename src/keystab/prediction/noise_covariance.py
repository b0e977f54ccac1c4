r"""Covariances of the derivatives of a difference of Gaussians, of noise and of natural scenes.

A *jet* is a function's Taylor expansion at a point: here the 35 derivatives of w up to the order
`ORDER`, the fourth, with respect to :math:`(\ln\sigma, y/\sigma, x/\sigma)`, in the order of
`ORDERS`. Derivatives with respect to :math:`\lambda = \ln\sigma` are spatial ones by the heat
equation: with :math:`q = \kappa_i^2\sigma^2` of either Gaussian and v the image that it has
blurred,

.. math:: \partial_\lambda v = q \Delta v, \qquad
          \partial_\lambda^2 v = 2 q \Delta v + q^2 \Delta^2 v, \qquad
          \partial_\lambda^3 v = 4 q \Delta v + 6 q^2 \Delta^2 v + q^3 \Delta^3 v ,

and so on: :math:`\partial_\lambda q^k \Delta^k v = 2 k q^k \Delta^k v + q^{k+1} \Delta^{k+1} v`.
So the covariance of two derivatives is a sum of moments of a power spectrum. That of white noise
fills the band of the pixel grid, :math:`|\omega| \le \pi` on both axes; its moments separate into

.. math:: I_k(t) = \frac{1}{2\pi} \int_{-\pi}^{\pi} \omega^{2k} e^{-t\omega^2} d\omega

with t the mean variance of the two Gaussians. That of natural scenes falls like
:math:`|\omega|^{-2}` before the camera's blur, so that in the scale-space's own units their
covariance is the same at all scales.
"""

from __future__ import annotations

import math
from itertools import product

import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray
from scipy.special import erf

__all__ = ["HEAT", "ORDER", "ORDERS", "band_moments", "noise_jets", "scene_jets"]

ORDER = 4
"""Highest order of a derivative of a jet.

Within the distance at which an extremum counts as the same, the third is too low: see
`keystab.prediction.survival`.
"""

ORDERS = np.array(
    [
        (n, p, degree - n - p)
        for degree in range(ORDER + 1)
        for n in range(degree, -1, -1)
        for p in range(degree - n, -1, -1)
    ]
)
"""Orders of the derivatives of a jet along ln sigma, y and x, by total order, shape (35, 3)."""

HEAT = np.array(
    [[1, 0, 0, 0, 0], [0, 1, 0, 0, 0], [0, 2, 1, 0, 0], [0, 4, 6, 1, 0], [0, 8, 28, 12, 1]],
    dtype=np.float64,
)
"""Weight of (q Laplacian)^k, column k, in a derivative along ln sigma of the order of the row."""

#: Highest moment that two derivatives of the highest order along scale need.
_HIGHEST = 2 * ORDER

_NODES, _WEIGHTS = (
    np.asarray(part, dtype=np.float64) for part in np.polynomial.legendre.leggauss(32)
)

#: From this mean variance on, in square pixels, the recursion loses fewer digits than it needs.
_LARGE = 1.5


def band_moments(t: ArrayLike, highest: int = _HIGHEST) -> NDArray[np.float64]:
    r"""Moments :math:`I_0 \dots I_k` of a Gaussian in the band of the pixel grid.

    Parameters
    ----------
    t : array_like
        Mean variance of the two Gaussians in square pixels, at least 0.
    highest : int
        Order of the last moment.

    Returns
    -------
    ndarray, shape (highest + 1, ...)

    Notes
    -----
    For large t by :math:`I_k = ((2k - 1) I_{k-1} - \pi^{2k-2} e^{-\pi^2 t}) / 2t` from
    :math:`I_0 = \mathrm{erf}(\pi\sqrt t) / (2\sqrt{\pi t})`; for small t, where that cancels, by a
    Gaussian quadrature of 32 nodes, exact to rounding.

    Examples
    --------
    >>> band_moments(0.0, 1).round(4).tolist()  # the whole band: 1 and pi**2 / 3
    [1.0, 3.2899]
    """
    t = np.asarray(t, dtype=np.float64)
    large = np.maximum(t, _LARGE)
    moments = np.empty((highest + 1, *t.shape))
    moments[0] = erf(np.pi * np.sqrt(large)) / (2 * np.sqrt(np.pi * large))
    tail = np.exp(-(np.pi**2) * large)
    for k in range(1, highest + 1):
        moments[k] = ((2 * k - 1) * moments[k - 1] - np.pi ** (2 * k - 2) * tail) / (2 * large)
    omega2 = (np.pi * (_NODES + 1) / 2) ** 2
    gauss = np.exp(-np.minimum(t, _LARGE)[..., None] * omega2) * _WEIGHTS / 2
    small = np.moveaxis(gauss @ (omega2 ** np.arange(highest + 1)[:, None]).T, -1, 0)
    return np.where(t < _LARGE, small, moments)


def noise_jets(sigma: NDArray[np.float64], camera_blur: float, kappa: float) -> NDArray[np.float64]:
    r"""Covariances of the jets of unit white noise.

    Parameters
    ----------
    sigma : ndarray, shape (n,)
        Scales in pixels, at least `camera_blur`.
    camera_blur : float
        Blur c of the view, in pixels, which the noise has not seen.
    kappa : float
        Ratio of the two Gaussians.

    Returns
    -------
    ndarray, shape (n, 35, 35)
        In the scale-space's own units at each scale, rows and columns as in `ORDERS`.

    Examples
    --------
    >>> far = noise_jets(np.array([8.0]), 0.0, 2 ** (1 / 3))[0]
    >>> a, b = 2 ** (2 / 3) * 64, 64.0
    >>> closed = (1 / a**2 + 1 / b**2 - 8 / (a + b) ** 2) / (8 * np.pi) * 64
    >>> bool(abs(far[2, 2] / closed - 1) < 1e-9)  # y with y
    True
    """
    upper, lower = (kappa * sigma) ** 2, sigma**2
    means = np.stack([upper, (upper + lower) / 2, lower]) - camera_blur**2
    moments = band_moments(np.maximum(means, 0.0))
    covariance = np.empty((sigma.size, len(ORDERS), len(ORDERS)))
    _noise_jets(sigma, kappa, np.ascontiguousarray(moments.T), ORDERS, HEAT, _BINOMIAL, covariance)
    return covariance


_BINOMIAL = np.array(
    [[math.comb(n, k) for k in range(_HIGHEST + 1)] for n in range(_HIGHEST + 1)], dtype=np.float64
)


@njit(cache=True, nogil=True)
def _noise_jets(sigma, kappa, moments, orders, heat, binomial, out):
    for point in range(sigma.size):
        scale = sigma[point]
        for row in range(orders.shape[0]):
            for column in range(row + 1):
                p = orders[row, 1] + orders[column, 1]
                q = orders[row, 2] + orders[column, 2]
                total = 0.0
                if p % 2 == 0 and q % 2 == 0:
                    turns = orders[row, 1] - orders[column, 1] + orders[row, 2] - orders[column, 2]
                    for i in range(2):
                        for j in range(2):
                            total += (1.0 if i == j else -1.0) * _pair(
                                (kappa * scale) ** 2 if i == 0 else scale**2,
                                (kappa * scale) ** 2 if j == 0 else scale**2,
                                heat[orders[row, 0]],
                                heat[orders[column, 0]],
                                p // 2,
                                q // 2,
                                moments[point, i + j],
                                binomial,
                            )
                    if turns % 4:
                        total = -total
                total *= scale ** (p + q)
                out[point, row, column] = out[point, column, row] = total


@njit(cache=True, nogil=True)
def _pair(first, second, heat_first, heat_second, p, q, moments, binomial):
    """Covariance of derivatives of two blurred images, of even orders 2p and 2q in total."""
    total = 0.0
    for k in range(heat_first.size):
        for m in range(heat_second.size):
            weight = heat_first[k] * heat_second[m]
            if weight != 0.0:
                laplacian = 0.0
                for a in range(k + m + 1):
                    laplacian += binomial[k + m, a] * moments[p + a] * moments[q + k + m - a]
                total += weight * (-first) ** k * (-second) ** m * laplacian
    return total


def scene_jets(kappa: float) -> NDArray[np.float64]:
    r"""Covariance of the jets of scenes with the spectrum :math:`|\omega|^{-2}`.

    Parameters
    ----------
    kappa : float
        Ratio of the two Gaussians.

    Returns
    -------
    ndarray, shape (35, 35)
        The same at all scales and blurs of the camera, because neither enters in the scale-space's
        own units.

    Notes
    -----
    Over all frequencies :math:`\int \omega_y^{2a} \omega_x^{2b} |\omega|^{-2} e^{-t|\omega|^2}
    d\omega = \Gamma(a + \tfrac12) \Gamma(b + \tfrac12) t^{-(a+b)} / (a + b)`; the variance of w
    itself is a difference of logarithms.
    """
    covariance = np.zeros((len(ORDERS), len(ORDERS)))
    for row, column in np.ndindex(covariance.shape):
        (n, p, q), (m, r, s) = ORDERS[row].tolist(), ORDERS[column].tolist()
        if (p + r) % 2 or (q + s) % 2:
            continue
        total = 0.0
        for first, second in product((kappa**2, 1.0), repeat=2):
            sign = 1.0 if first == second else -1.0
            for i, j in np.ndindex(ORDER + 1, ORDER + 1):
                weight = sign * HEAT[n, i] * HEAT[m, j] * (-first) ** i * (-second) ** j
                for a in range(i + j + 1):
                    moment = _scale_free(
                        (p + r) // 2 + a, (q + s) // 2 + i + j - a, (first + second) / 2
                    )
                    total += weight * math.comb(i + j, a) * moment
        covariance[row, column] = -total if (p - r + q - s) % 4 else total
    return covariance / (4 * np.pi**2)


def _scale_free(a: int, b: int, t: float) -> float:
    """Moment of the scenes' spectrum; of order zero without a part that cancels in differences."""
    if a + b == 0:
        return -math.pi * math.log(t)
    return math.gamma(a + 0.5) * math.gamma(b + 0.5) * t ** -(a + b) / (a + b)
