r"""Gaussian blobs in the scale-space: at which scale they are found, in closed form.

A blob of standard deviation s before the camera has the variance :math:`s^2 + c^2` in an image of
camera blur c (section 4). A detector that takes this blur for c' adds the variance
:math:`\sigma^2 - c'^2` to reach the scale :math:`\sigma`, which leaves :math:`v + \sigma^2` with

.. math:: v = s^2 + c^2 - c'^2,

and :math:`v = s^2` where c' is right. At the centre of a blob of height 1 before the camera, the
difference of Gaussians and the normalised Laplacian are

.. math::
    w(\sigma) = \frac{s^2}{v + \kappa^2 \sigma^2} - \frac{s^2}{v + \sigma^2}, \qquad
    \sigma^2 \Delta v_\sigma = - \frac{2 s^2 \sigma^2}{(v + \sigma^2)^2}.

Both have one minimum along the scale. For w, setting the derivative with respect to
:math:`\sigma^2` to 0 asks for :math:`\kappa (v + \sigma^2) = v + \kappa^2 \sigma^2`, that is

.. math:: \sigma = \sqrt{v / \kappa} = \sqrt{(s^2 + c^2 - c'^2) / \kappa},

and for the Laplacian the same with :math:`\kappa = 1`, its limit. With the right blur these are
the paper's :math:`s / \sqrt\kappa` and s (section 2.3). By symmetry these minima along the scale
are also minima in space, and so extrema of the scale-space.

With a wrong blur a blob is found where one of standard deviation :math:`\sqrt v` would be with the
right blur. This stops being so where the detector cannot reach: scales begin at c', or at the
first scale of the scale-space, so that v must be at least :math:`\kappa` times the square of
whichever is larger (`smallest_blob`); and where :math:`v \le 0`, w increases with every scale and
there is no extremum at all. All lengths are in pixels of the image.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from keystab.errors import InputError
from keystab.utils import validation

__all__ = [
    "blob_image",
    "dog_at_centre",
    "dog_extremum_scale",
    "dog_extremum_value",
    "laplacian_at_centre",
    "laplacian_extremum_scale",
    "smallest_blob",
    "variance_at_zero",
]

Array = NDArray[np.float64]


def blob_image(
    blob: float, camera_blur: float, shape: tuple[int, int], centre: tuple[float, float]
) -> Array:
    """Return what a camera without aliasing makes of a blob of height 1.

    The Gaussian is sampled at the pixel centres. Its spectrum is 2.5e-3 of its maximum at the
    Nyquist frequency where ``blob**2 + camera_blur**2`` is 1.1 px squared, and falls fast above.

    Parameters
    ----------
    blob : float
        Standard deviation s of the blob before the camera in pixels, > 0.
    camera_blur : float
        Blur c of the camera in pixels, >= 0.
    shape : (int, int)
        Height and width in pixels.
    centre : (float, float)
        Row and column of the blob's centre in pixels.

    Returns
    -------
    ndarray, shape `shape`
        The blob, of standard deviation ``sqrt(s**2 + c**2)`` and height ``s**2 / (s**2 + c**2)``.

    Raises
    ------
    InputError
        If a length is out of range.

    Examples
    --------
    >>> blob_image(3.0, 4.0, (1, 3), (0.0, 1.0)).round(4).tolist()
    [[0.3529, 0.36, 0.3529]]
    """
    validation.number("blob", blob, above=0)
    validation.number("camera_blur", camera_blur, least=0)
    for name, n in zip(("height", "width"), shape, strict=True):
        validation.integer(name, n, least=1)
    variance = blob**2 + camera_blur**2
    rows, columns = (
        np.exp(-0.5 * (np.arange(n) - middle) ** 2 / variance)
        for n, middle in zip(shape, centre, strict=True)
    )
    return blob**2 / variance * np.outer(rows, columns)


def variance_at_zero(
    blob: ArrayLike, camera_blur: ArrayLike = 0.0, assumed_blur: ArrayLike | None = None
) -> Array:
    """Return v, the variance of a blob that the scale-space takes for the one at scale 0.

    Parameters
    ----------
    blob : array_like
        Standard deviation s of the blob before the camera in pixels, > 0.
    camera_blur : array_like, default 0
        Blur c of the camera in pixels, >= 0. It does not matter where the assumed one is right.
    assumed_blur : array_like, optional
        Blur c' that the detector assumes in pixels, >= 0; the right one by default.

    Returns
    -------
    ndarray
        ``s**2 + c**2 - c'**2``; may be negative.

    Raises
    ------
    InputError
        If a blob is not above 0 or a blur below 0.

    Examples
    --------
    >>> float(variance_at_zero(2.0, camera_blur=0.8)), float(variance_at_zero(2.0, 1.0, 2.0))
    (4.0, 1.0)
    """
    s = _lengths("blob", blob)
    if (s <= 0).any():
        raise InputError("blob: 0 is no standard deviation of a blob; give numbers above 0")
    c = _lengths("camera_blur", camera_blur)
    if assumed_blur is None:
        return s**2 + 0.0 * c
    return s**2 + c**2 - _lengths("assumed_blur", assumed_blur) ** 2


def dog_at_centre(
    sigma: ArrayLike,
    blob: ArrayLike,
    kappa: ArrayLike = 2 ** (1 / 3),
    camera_blur: ArrayLike = 0.0,
    assumed_blur: ArrayLike | None = None,
) -> Array:
    """Return the difference of Gaussians at the centre of a blob of height 1 before the camera.

    Parameters
    ----------
    sigma : array_like
        Scale in pixels, at least the assumed blur.
    blob, camera_blur, assumed_blur
        See `variance_at_zero`.
    kappa : array_like, default 2 ** (1 / 3)
        Ratio of the two blurs, > 1.

    Returns
    -------
    ndarray
        The value, negative for a bright blob; NaN where `sigma` is below the assumed blur, which
        no blurring reaches.

    Examples
    --------
    >>> dog_at_centre([1.0, 2.0, 4.0], blob=2.0, kappa=2.0).round(3).tolist()
    [-0.3, -0.3, -0.141]
    """
    ratio = _ratio(kappa)
    v = variance_at_zero(blob, camera_blur, assumed_blur)
    s2, scale2 = np.square(_lengths("blob", blob)), _reached(sigma, camera_blur, assumed_blur)
    return np.asarray(s2 / (v + ratio**2 * scale2) - s2 / (v + scale2))


def laplacian_at_centre(
    sigma: ArrayLike,
    blob: ArrayLike,
    camera_blur: ArrayLike = 0.0,
    assumed_blur: ArrayLike | None = None,
) -> Array:
    """Return the normalised Laplacian at the centre of a blob of height 1 before the camera.

    The difference of Gaussians divided by ``(kappa**2 - 1) / 2`` tends to it for kappa towards 1.

    Parameters
    ----------
    sigma : array_like
        Scale in pixels, at least the assumed blur.
    blob, camera_blur, assumed_blur
        See `variance_at_zero`.

    Returns
    -------
    ndarray
        The value, negative for a bright blob; NaN where `sigma` is below the assumed blur.

    Examples
    --------
    >>> laplacian_at_centre([1.0, 2.0, 4.0], blob=2.0).tolist()
    [-0.32, -0.5, -0.32]
    """
    v = variance_at_zero(blob, camera_blur, assumed_blur)
    s2, scale2 = np.square(_lengths("blob", blob)), _reached(sigma, camera_blur, assumed_blur)
    return np.asarray(-2.0 * s2 * scale2 / (v + scale2) ** 2)


def dog_extremum_scale(
    blob: ArrayLike,
    kappa: ArrayLike = 2 ** (1 / 3),
    camera_blur: ArrayLike = 0.0,
    assumed_blur: ArrayLike | None = None,
) -> Array:
    """Return the scale at which the difference of Gaussians has its extremum for a blob.

    Parameters
    ----------
    blob, camera_blur, assumed_blur
        See `variance_at_zero`.
    kappa : array_like, default 2 ** (1 / 3)
        Ratio of the two blurs, > 1.

    Returns
    -------
    ndarray
        ``sqrt((s**2 + c**2 - c'**2) / kappa)`` in pixels; NaN where there is no extremum: where it
        would lie below the assumed blur, at which scales begin.

    Examples
    --------
    >>> float(dog_extremum_scale(2.0, kappa=1.44).round(4))
    1.6667
    >>> dog_extremum_scale([0.8, 2.0], 1.44, camera_blur=0.7, assumed_blur=[0.9, 0.3]).round(4)
    array([  nan, 1.748])
    """
    scale2 = variance_at_zero(blob, camera_blur, assumed_blur) / _ratio(kappa)
    return _scale(scale2, assumed_blur, camera_blur)


def dog_extremum_value(
    blob: ArrayLike,
    kappa: ArrayLike = 2 ** (1 / 3),
    camera_blur: ArrayLike = 0.0,
    assumed_blur: ArrayLike | None = None,
) -> Array:
    """Return the difference of Gaussians at its extremum for a blob of height 1.

    Parameters
    ----------
    blob, kappa, camera_blur, assumed_blur
        See `dog_extremum_scale`.

    Returns
    -------
    ndarray
        ``-(kappa - 1) / (kappa + 1) * s**2 / v``, the same for blobs of all sizes where the assumed
        blur is right; NaN where there is no extremum.

    Examples
    --------
    >>> dog_extremum_value([2.0, 5.0], kappa=1.5).round(12).tolist()
    [-0.2, -0.2]
    """
    sigma = dog_extremum_scale(blob, kappa, camera_blur, assumed_blur)
    v = np.where(np.isnan(sigma), np.nan, variance_at_zero(blob, camera_blur, assumed_blur))
    ratio = _ratio(kappa)
    return np.asarray(-(ratio - 1) / (ratio + 1) * np.square(_lengths("blob", blob)) / v)


def laplacian_extremum_scale(
    blob: ArrayLike, camera_blur: ArrayLike = 0.0, assumed_blur: ArrayLike | None = None
) -> Array:
    """Return the scale at which the normalised Laplacian has its extremum for a blob.

    Parameters
    ----------
    blob, camera_blur, assumed_blur
        See `variance_at_zero`.

    Returns
    -------
    ndarray
        ``sqrt(s**2 + c**2 - c'**2)`` in pixels; NaN where it would lie below the assumed blur.

    Examples
    --------
    >>> float(laplacian_extremum_scale(2.0)), float(laplacian_extremum_scale(2.0, 1.5, 0.0))
    (2.0, 2.5)
    """
    scale2 = variance_at_zero(blob, camera_blur, assumed_blur)
    return _scale(scale2, assumed_blur, camera_blur)


def smallest_blob(
    kappa: float = 2 ** (1 / 3),
    camera_blur: float = 0.0,
    assumed_blur: float | None = None,
    first_scale: float = 0.0,
) -> float:
    """Return the smallest blob that has an extremum within the scales of a scale-space.

    Parameters
    ----------
    kappa : float, default 2 ** (1 / 3)
        Ratio of the two blurs, >= 1; 1 stands for the normalised Laplacian.
    camera_blur : float, default 0
        Blur c of the camera in pixels.
    assumed_blur : float, optional
        Blur c' that the detector assumes in pixels; the right one by default.
    first_scale : float, default 0
        First scale of the scale-space in pixels, where that is above the assumed blur.

    Returns
    -------
    float
        Its standard deviation before the camera in pixels, ``sqrt(kappa * first**2 + c'**2 -
        c**2)`` with ``first`` the larger of `first_scale` and c'; 0 where every blob has one. A
        sampled scale-space needs a slice below the extremum, and so a blob a little larger.

    Examples
    --------
    >>> smallest_blob(kappa=1.44, camera_blur=1.0)
    1.2
    """
    validation.number("kappa", kappa, least=1)
    validation.number("first_scale", first_scale, least=0)
    c = validation.number("camera_blur", camera_blur, least=0)
    assumed = (
        c if assumed_blur is None else validation.number("assumed_blur", assumed_blur, least=0)
    )
    first = max(first_scale, assumed)
    return math.sqrt(max(kappa * first**2 + assumed**2 - c**2, 0.0))


def _scale(scale2: Array, assumed_blur: ArrayLike | None, camera_blur: ArrayLike) -> Array:
    """Return the scale whose square is given, NaN where no blurring reaches it."""
    first = _lengths("blur", camera_blur if assumed_blur is None else assumed_blur)
    reached = (scale2 > 0) & (scale2 >= first**2)
    return np.sqrt(np.where(reached, scale2, np.nan))


def _reached(sigma: ArrayLike, camera_blur: ArrayLike, assumed_blur: ArrayLike | None) -> Array:
    """Return the squares of scales, NaN below the assumed blur."""
    scale = _lengths("sigma", sigma)
    first = _lengths("blur", camera_blur if assumed_blur is None else assumed_blur)
    return np.square(np.where(scale >= first, scale, np.nan))


def _lengths(name: str, values: ArrayLike) -> Array:
    lengths = np.asarray(values, dtype=np.float64)
    if not (np.isfinite(lengths) & (lengths >= 0)).all():
        raise InputError(f"{name}: {values!r} must be finite numbers of at least 0, in pixels")
    return lengths


def _ratio(kappa: ArrayLike) -> Array:
    ratio = np.asarray(kappa, dtype=np.float64)
    if not (np.isfinite(ratio) & (ratio > 1)).all():
        raise InputError(f"kappa: {kappa!r} must be finite and above 1")
    return ratio
