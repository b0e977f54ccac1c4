"""The cosine series of an image.

An image sampled at pixel centres 0 .. n-1 and extended by half-sample symmetry (mirrors at -1/2
and n-1/2) is a finite cosine series,

    u(y, x) = sum_{k < H} sum_{l < W} a[k, l] cos(pi k (y + 1/2) / H) cos(pi l (x + 1/2) / W),

which passes through every pixel. Gaussian blur multiplies its coefficients, derivatives multiply
them by frequencies, and a separable set of positions needs two matrix products: nothing is
approximated.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from keystab.errors import InputError
from keystab.utils.masks import unmasked

__all__ = ["basis", "coefficients", "evaluate", "evaluate_at", "gaussian", "sampled", "significant"]

#: Frequencies that a blur multiplies by less than this are left out. A picture in [0, 1] has
#: coefficients of at most 4, so that what is left out stays below the rounding of the sum.
NEGLIGIBLE = 1e-20

#: Scattered points are evaluated in blocks of this many, which bounds the memory.
_BLOCK = 1024


def coefficients(u: ArrayLike) -> NDArray[np.float64]:
    """Coefficients of the cosine series of an image.

    Parameters
    ----------
    u : array_like, shape (H, W)
        Image at pixel centres.

    Returns
    -------
    ndarray of float64, shape (H, W)
        a[k, l] of the module's formula; a[0, 0] is the mean of the image.

    Raises
    ------
    InputError
        If `u` is not a two-dimensional array of finite values with at least one pixel, none of
        them masked.

    Examples
    --------
    >>> coefficients([[1.0, 1.0], [3.0, 3.0]]).round(6)
    array([[ 2.      ,  0.      ],
           [-1.414214,  0.      ]])
    """
    from scipy import fft

    image = np.asarray(unmasked("the image", u), dtype=np.float64)
    if image.ndim != 2 or image.size == 0:
        raise InputError(f"an image of shape {image.shape} was given; expected (height, width)")
    a: NDArray[np.float64] = fft.dctn(image, type=2)
    if not np.isfinite(a[0, 0]):  # the sum of all pixels: one bad pixel is enough
        raise InputError("the image holds NaN or infinite values; replace them by finite ones")
    # scipy's transform is 2 sum_n u_n cos(...) per axis; its inverse weighs frequency 0 by 1/2.
    a /= float(image.size)
    a[0, :] *= 0.5
    a[:, 0] *= 0.5
    return a


def sampled(
    coefs: NDArray[np.float64],
    image: tuple[int, int],
    shape: tuple[int, int],
    variance: float = 0.0,
) -> NDArray[np.float64]:
    """Values of a blurred series on a grid of other samples between the same mirrors.

    Parameters
    ----------
    coefs : ndarray, shape (K, L)
        Leading coefficients of the series.
    image : (int, int)
        Height H and width W of the image of the series.
    shape : (int, int)
        Samples m and n along y and along x: sample i lies at ``(i + 1/2) H / m - 1/2``. Of more
        frequencies than samples, the highest are left out.
    variance : float
        Square of a Gaussian blur in pixels of the image; below 0, blur is undone.

    Returns
    -------
    ndarray, shape (m, n)
        Exact but for rounding where all frequencies are held; by fast transforms.

    Examples
    --------
    >>> a = coefficients([[0.0, 1.0], [2.0, 5.0]])
    >>> sampled(a, (2, 2), (2, 2)).round(12)
    array([[0., 1.],
           [2., 5.]])
    >>> finer = evaluate(a, [-0.25, 0.25, 0.75, 1.25], [0, 1])
    >>> bool(np.allclose(sampled(a, (2, 2), (4, 2)), finer))
    True
    """
    from scipy import fft

    values: NDArray[np.float64] = np.zeros(shape)
    part = values[: coefs.shape[0], : coefs.shape[1]]
    part[:] = coefs[: shape[0], : shape[1]]
    for axis, n in enumerate(image):
        gain = np.exp(-0.5 * variance * (np.pi / n * np.arange(part.shape[axis])) ** 2)
        part *= np.expand_dims(gain, 1 - axis)
    # The transform adds up every cosine twice but for frequency 0.
    part[1:, :] /= 2
    part[:, 1:] /= 2
    for axis in (0, 1):
        values = fft.dct(values, type=3, axis=axis, overwrite_x=True)
    return values


def gaussian(n: int, blur: float) -> NDArray[np.float64]:
    """Factors by which a Gaussian blur multiplies the coefficients of one axis.

    Parameters
    ----------
    n : int
        Number of samples along the axis.
    blur : float
        Standard deviation of the Gaussian in samples, >= 0.

    Returns
    -------
    ndarray of float64, shape (n,)
        exp(-(pi k blur / n)^2 / 2) for k = 0 .. n-1.

    Examples
    --------
    >>> gaussian(3, 0.0)
    array([1., 1., 1.])
    """
    response: NDArray[np.float64] = np.exp(-0.5 * (np.pi * blur / n * np.arange(n)) ** 2)
    return response


def significant(n: int, blur: float) -> int:
    """Count the leading frequencies of an axis that a blur leaves above `NEGLIGIBLE`.

    Parameters
    ----------
    n : int
        Number of samples along the axis.
    blur : float
        Standard deviation of the Gaussian in samples, >= 0.

    Returns
    -------
    int
        Between 1 and `n`.

    Examples
    --------
    >>> significant(4000, 0.0), significant(4000, 11.0)
    (4000, 1111)
    """
    return max(1, int(np.count_nonzero(gaussian(n, blur) >= NEGLIGIBLE)))


def basis(
    positions: ArrayLike, n: int, count: int | None = None, derivative: int = 0
) -> NDArray[np.float64]:
    """Cosines of one axis, or their derivatives, at given positions.

    Parameters
    ----------
    positions : array_like, shape (m,)
        Positions in samples, anywhere: outside [-1/2, n-1/2] the series is its mirror image.
    n : int
        Number of samples along the axis.
    count : int, optional
        Number of frequencies, at most `n`; all by default.
    derivative : int
        Order of the derivative with respect to the position, per sample.

    Returns
    -------
    ndarray of float64, shape (m, count)
        The derivative of cos(pi k (p + 1/2) / n) at positions p, for k = 0 .. count-1.

    Examples
    --------
    >>> basis([0.0, 1.0], n=2).round(6)
    array([[ 1.      ,  0.707107],
           [ 1.      , -0.707107]])
    """
    k = np.arange(n if count is None else count, dtype=np.float64)
    # The angle is reduced to one period before it is multiplied by pi. The reduction is exact, so
    # that at whole and half samples even the highest frequency keeps all its digits.
    angles = np.multiply.outer(np.asarray(positions, dtype=np.float64) + 0.5, k)
    periods = angles * (0.5 / n)
    angles -= 2.0 * n * np.trunc(periods, out=periods)
    angles *= np.pi / n
    if derivative == 0:
        return np.cos(angles)
    wave = (np.cos, np.sin)[derivative % 2](angles)
    sign = (1.0, -1.0, -1.0, 1.0)[derivative % 4]
    return sign * (np.pi * k / n) ** derivative * wave


def evaluate(
    coefs: NDArray[np.float64],
    y: ArrayLike,
    x: ArrayLike,
    blur: float = 0.0,
    derivative: tuple[int, int] = (0, 0),
) -> NDArray[np.float64]:
    """Evaluate a blurred series, or a derivative of it, on a grid of rows and columns.

    Exact but for rounding: two matrix products, without interpolation. Frequencies that the blur
    multiplies by less than `NEGLIGIBLE` are left out.

    Parameters
    ----------
    coefs : ndarray, shape (H, W)
        Coefficients from `coefficients`.
    y, x : array_like, shapes (h,) and (w,)
        Rows and columns in samples.
    blur : float
        Standard deviation of the Gaussian blur in samples, >= 0.
    derivative : (int, int)
        Orders of the derivative along y and x.

    Returns
    -------
    ndarray of float64, shape (h, w)

    Examples
    --------
    >>> a = coefficients([[0.0, 1.0], [2.0, 5.0]])
    >>> evaluate(a, [0, 1], [1, 0]).round(12)
    array([[1., 0.],
           [5., 2.]])
    """
    rows, columns = _bases(coefs, np.asarray(y), np.asarray(x), blur, derivative)
    a = coefs[: rows.shape[1], : columns.shape[1]]
    # The cheaper order of the two products.
    if rows.shape[0] * columns.shape[1] <= columns.shape[0] * rows.shape[1]:
        return (rows @ a) @ columns.T
    return rows @ (a @ columns.T)


def evaluate_at(
    coefs: NDArray[np.float64],
    y: ArrayLike,
    x: ArrayLike,
    blur: float = 0.0,
    derivative: tuple[int, int] = (0, 0),
) -> NDArray[np.float64]:
    """Evaluate a blurred series, or a derivative of it, at scattered points.

    The same sum as `evaluate`, point by point: the number of operations is the number of points
    times the number of coefficients that the blur leaves.

    Parameters
    ----------
    coefs : ndarray, shape (H, W)
        Coefficients from `coefficients`.
    y, x : array_like of one shape
        Positions in samples.
    blur : float
        Standard deviation of the Gaussian blur in samples, >= 0.
    derivative : (int, int)
        Orders of the derivative along y and x.

    Returns
    -------
    ndarray of float64, shape of `y` and `x`

    Examples
    --------
    >>> a = coefficients([[0.0, 1.0], [2.0, 5.0]])
    >>> evaluate_at(a, [0, 1, 0.5], [1, 1, 0.5]).round(12)
    array([1., 5., 2.])
    """
    ys, xs = np.broadcast_arrays(np.asarray(y, dtype=np.float64), np.asarray(x, dtype=np.float64))
    flat_y, flat_x = ys.ravel(), xs.ravel()
    values = np.empty(flat_y.size)
    for start in range(0, flat_y.size, _BLOCK):
        block = slice(start, start + _BLOCK)
        rows, columns = _bases(coefs, flat_y[block], flat_x[block], blur, derivative)
        a = coefs[: rows.shape[1], : columns.shape[1]]
        values[block] = np.einsum("pl,pl->p", rows @ a, columns)
    return values.reshape(ys.shape)


def _bases(
    coefs: NDArray[np.float64],
    y: NDArray[Any],
    x: NDArray[Any],
    blur: float,
    derivative: tuple[int, int],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Blurred bases of both axes, for the frequencies that the blur leaves."""
    bases = []
    for positions, n, order in zip((y, x), coefs.shape, derivative, strict=True):
        count = significant(n, blur)
        bases.append(basis(positions, n, count, order) * gaussian(n, blur)[:count])
    return bases[0], bases[1]
