r"""The Taylor expansion of the difference of Gaussians at scattered points, to the fourth order.

The cubic spline through the pixels (`keystab.scalespace.spline_axis`) blurred by a continuous
Gaussian of variance b is a sum of pixels' worth of coefficients times

.. math:: (\beta^3 * G_b)(t) = \sum_{j=0}^{4} (-1)^j \binom 4j F(t + 2 - j),

where F is the fourth antiderivative of :math:`G_b`; derivatives of order four to eight (a fourth
derivative along scale is one) are differences of derivatives of :math:`G_b` itself. So a jet is a
sum over a window of some blurs, whatever the size of the picture, and is exact for the spline but
for where the window ends.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from keystab.prediction.noise_covariance import HEAT, ORDER, ORDERS
from keystab.scalespace.spline_axis import spline_source

__all__ = ["local_image", "local_jets"]

#: Orders of the derivatives in space: each one along scale is two of them.
_COUNT = 2 * ORDER + 1

#: Half of the window in blurs. Eighth derivatives, the highest, are cut at 1e-7 of their size.
_REACH = 7.0

#: Least added blur in pixels: with less, the eighth derivatives of a cubic spline, spikes at its
#: knots, are larger than those of white noise in the band of the pixel grid.
_LEAST_BLUR = 0.2

#: Mirrored coefficients that `spline_source` puts around those of the pixels.
_PADDING = 2


def local_jets(
    image: NDArray[np.float64],
    sigma: NDArray[np.float64],
    y: NDArray[np.float64],
    x: NDArray[np.float64],
    camera_blur: float,
    kappa: float,
) -> NDArray[np.float64]:
    """Jets of the difference of Gaussians of an image.

    Parameters
    ----------
    image : ndarray, shape (height, width)
        The image, continued by its half-sample mirror.
    sigma, y, x : ndarray, shape (n,)
        Scales, at least `camera_blur`, and positions, in pixels.
    camera_blur, kappa : float
        Blur that the image has, and ratio of the two Gaussians.

    Returns
    -------
    ndarray, shape (n, 35)
        Derivatives in the scale-space's own units, ordered as
        `keystab.prediction.noise_covariance.ORDERS`: value, gradient (scale, y, x), Hessian (ss,
        sy, sx, yy, yx, xx), third and fourth derivatives.

    Examples
    --------
    >>> rows, columns = np.mgrid[:41, :41] - 20.0
    >>> blob = np.exp(-(rows**2 + columns**2) / (2 * (2.0**2 + 0.8**2)))
    >>> top = np.array([2.0 / 2 ** (1 / 6)]), np.array([20.0]), np.array([20.0])
    >>> bool(np.abs(local_jets(blob, *top, 0.8, 2 ** (1 / 3))[0, 1:4]).max() < 2e-4)
    True
    """
    jets = np.zeros((sigma.size, len(ORDERS)))
    _jets(_coefficients(image), sigma, y, x, camera_blur, kappa, ORDERS, HEAT, jets)
    return jets


def local_image(
    image: NDArray[np.float64],
    sigma: NDArray[np.float64],
    y: NDArray[np.float64],
    x: NDArray[np.float64],
    camera_blur: float,
) -> NDArray[np.float64]:
    """Grey values of an image blurred to the scales of points, shape (n,).

    Parameters
    ----------
    image, sigma, y, x, camera_blur
        See `local_jets`.

    Examples
    --------
    >>> ramp = np.tile(np.arange(40.0), (40, 1))
    >>> local_image(ramp, *np.array([[2.0], [20.0], [20.5]]), 0.8).round(6).tolist()
    [20.5]
    """
    values = np.empty(sigma.size)
    _values(_coefficients(image), sigma, y, x, camera_blur, values)
    return values + image.mean()


def _coefficients(image: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.ascontiguousarray(spline_source(image)[_PADDING:-_PADDING, _PADDING:-_PADDING])


@njit(cache=True, nogil=True)
def _values(source, sigma, y, x, camera_blur, out):
    products = np.empty((_COUNT, _COUNT))
    for point in range(sigma.size):
        _derivatives(source, sigma[point] ** 2 - camera_blur**2, y[point], x[point], products)
        out[point] = products[0, 0]


@njit(cache=True, nogil=True)
def _jets(source, sigma, y, x, camera_blur, kappa, orders, heat, out):  # noqa: PLR0913
    products = np.empty((_COUNT, _COUNT))
    for point in range(sigma.size):
        for i in range(2):
            q = (kappa * sigma[point]) ** 2 if i == 0 else sigma[point] ** 2
            _derivatives(source, q - camera_blur**2, y[point], x[point], products)
            sign = 1.0 if i == 0 else -1.0
            for entry in range(orders.shape[0]):
                n, p, r = orders[entry]
                total = 0.0
                for power in range(n + 1):
                    if heat[n, power] != 0.0:
                        laplacian, binomial = 0.0, 1.0
                        for a in range(power + 1):
                            laplacian += binomial * products[p + 2 * a, r + 2 * (power - a)]
                            binomial = binomial * (power - a) / (a + 1)
                        total += heat[n, power] * q**power * laplacian
                out[point, entry] += sign * total * sigma[point] ** (p + r)


@njit(cache=True, nogil=True, fastmath={"contract"})
def _derivatives(source, variance, y, x, products):
    """Derivatives of order m along y and k along x, m + k <= 8, of a blurred spline."""
    height, width = source.shape
    blur = math.sqrt(max(variance, _LEAST_BLUR**2))
    top, rows = _axis(y, blur)
    left, columns = _axis(x, blur)
    products[:] = 0.0
    lines = np.empty(_COUNT)
    for a in range(rows.shape[0]):
        row = source[_mirrored(top + a, height)]
        lines[:] = 0.0
        for b in range(columns.shape[0]):
            value = row[_mirrored(left + b, width)]
            for k in range(_COUNT):
                lines[k] += value * columns[b, k]
        for m in range(_COUNT):
            for k in range(_COUNT - m):
                products[m, k] += rows[a, m] * lines[k]


@njit(cache=True, nogil=True)
def _mirrored(index, size):
    """Index within an axis of its half-sample mirror image."""
    index = index % (2 * size)
    return index if index < size else 2 * size - 1 - index


@njit(cache=True, nogil=True)
def _axis(position, blur):
    """First pixel of a window, and weights of its pixels for derivatives of order 0 to 8."""
    reach = _REACH * blur + 2.0
    first = math.ceil(position - reach)
    count = math.floor(position + reach) - first + 1
    knots = np.empty((count + 4, _COUNT))
    for a in range(count + 4):
        _antiderivatives(position - (first + a) + 2.0, blur, knots[a])
    # Derivatives of beta^3 * G are fourth differences of those of F.
    weights = np.empty((count, _COUNT))
    for a in range(count):
        for k in range(_COUNT):
            weights[a, k] = (
                knots[a, k]
                - 4.0 * knots[a + 1, k]
                + 6.0 * knots[a + 2, k]
                - 4.0 * knots[a + 3, k]
                + knots[a + 4, k]
            )
    return first, weights


@njit(cache=True, nogil=True)
def _antiderivatives(t, blur, out):
    """Derivatives of order 0 to 8 of the fourth antiderivative of a Gaussian."""
    b2 = blur * blur
    gauss = math.exp(-0.5 * t * t / b2) / (blur * math.sqrt(2.0 * math.pi))
    # The tail of the distribution keeps its digits on either side.
    step = 0.5 * math.erfc(abs(t) / (blur * math.sqrt(2.0)))
    side = 1.0 if t < 0 else -1.0
    out[0] = ((t * t + 3.0 * b2) * t * step * side + (t * t + 2.0 * b2) * b2 * gauss) / 6.0
    out[1] = ((t * t + b2) * step * side + t * b2 * gauss) / 2.0
    out[2] = t * step * side + b2 * gauss
    out[3] = step * side
    out[4] = gauss
    for k in range(4, _COUNT - 1):
        out[k + 1] = -(t * out[k] + (k - 4.0) * out[k - 1]) / b2
    if t >= 0:
        out[3] += 1.0
        out[2] += t
        out[1] += 0.5 * (t * t + b2)
        out[0] += (t * t + 3.0 * b2) * t / 6.0
