"""Discrete Gaussian blurs, and how far they obey the semigroup property.

Blurring ``N`` times by ``sigma`` should equal blurring once by ``sqrt(N) * sigma`` (section 2.2 of
the paper). Three ways to blur are put to that test on a Gaussian blob:

``sampled``
    convolution with samples of the Gaussian, cut at ``truncation * sigma`` and normalised to
    sum 1, as implementations of SIFT do;
``dct``
    the cosine series of the samples, each frequency multiplied by the Gaussian's transfer
    function: the exact blur of the band-limited function through the samples;
``discrete_analogue``
    Lindeberg's discrete analogue of the Gaussian, ``exp(-t) I_n(t)`` with ``t = sigma**2``: the
    kernel that solves the diffusion equation on the grid, so that variances add exactly.

Everything here works on one axis. The blob and the three blurs are separable, so the picture is
the outer product of a profile with itself, and `fitted_blur` shows why its least-squares fit is
the fit of that profile.
"""

from __future__ import annotations

from math import ceil, sqrt

import numpy as np
from numpy.typing import NDArray

from keystab.errors import InputError
from keystab.scalespace.cosine_series import gaussian
from keystab.utils.roots import root_between

Profile = NDArray[np.float64]

METHODS = ("sampled", "dct", "discrete_analogue")
"""The ways to blur, in the order of the table and of the panels."""


def blob_profile(n: int, blur: float) -> Profile:
    """Sample a Gaussian blob of height 1, centred on the middle of `n` samples.

    Parameters
    ----------
    n : int
        Number of samples; odd, so that the blob is centred on a sample.
    blur : float
        Standard deviation in pixels, > 0.

    Returns
    -------
    ndarray, shape (n,)

    Examples
    --------
    >>> blob_profile(5, 1.0).round(3).tolist()
    [0.135, 0.607, 1.0, 0.607, 0.135]
    """
    offset = np.arange(n, dtype=np.float64) - (n - 1) / 2
    return np.exp(-0.5 * (offset / blur) ** 2)


def sampled_kernel(sigma: float, truncation: float = 4.0) -> Profile:
    """Return samples of the Gaussian within ``ceil(truncation * sigma)``, normalised to sum 1.

    Below a standard deviation of about 0.7 px the Gaussian's spectrum reaches far beyond the
    Nyquist frequency, so its samples alias: the variance of the kernel falls short of
    ``sigma**2``.

    Parameters
    ----------
    sigma : float
        Standard deviation in pixels, > 0.
    truncation : float, default 4.0
        Radius in units of `sigma`.

    Returns
    -------
    ndarray, shape (2 * ceil(truncation * sigma) + 1,)

    Examples
    --------
    >>> kernel = sampled_kernel(0.25)
    >>> variance = float((kernel * np.array([-1.0, 0.0, 1.0]) ** 2).sum())
    >>> round(variance, 6), 0.25**2
    (0.00067, 0.0625)
    """
    samples = blob_profile(2 * ceil(truncation * sigma) + 1, sigma)
    normed: NDArray[np.float64] = samples / samples.sum()
    return normed


def discrete_analogue_kernel(sigma: float, radius: int) -> Profile:
    """Return Lindeberg's discrete analogue ``exp(-t) I_n(t)``, ``t = sigma**2``, for |n| <= radius.

    Its variance is ``sigma**2`` and the convolution of two of them is the one whose variance is
    the sum: the semigroup property holds on the grid itself. Its transfer function
    ``exp(t (cos(w) - 1))`` is not a Gaussian, so that for a small `sigma` the shape of the blurred
    blob departs from a Gaussian's although its variance does not.

    Parameters
    ----------
    sigma : float
        Standard deviation in pixels, > 0.
    radius : int
        Largest |n|; the tails that it cuts off are dropped, not redistributed.

    Returns
    -------
    ndarray, shape (2 * radius + 1,)

    Examples
    --------
    >>> kernel = discrete_analogue_kernel(0.25, 20)
    >>> variance = float((kernel * np.arange(-20.0, 21.0) ** 2).sum())
    >>> round(variance, 12), 0.25**2
    (0.0625, 0.0625)
    """
    from scipy.special import ive

    return np.asarray(ive(np.abs(np.arange(-radius, radius + 1)), sigma**2), dtype=np.float64)


def blur_profile(profile: Profile, sigma: float, method: str, truncation: float = 4.0) -> Profile:
    """Blur a profile once.

    Parameters
    ----------
    profile : ndarray, shape (n,), n odd
        Samples that vanish towards both ends (the convolutions take zeros beyond them, ``dct``
        the mirror image).
    sigma : float
        Standard deviation in pixels, > 0.
    method : {"sampled", "dct", "discrete_analogue"}
        How to blur; the module's description says what each does.
    truncation : float, default 4.0
        Radius of the sampled kernel in units of `sigma`; the other methods ignore it.

    Returns
    -------
    ndarray, shape (n,)

    Raises
    ------
    InputError
        If `method` is none of the three.
    """
    n = len(profile)
    if method == "dct":
        from scipy.fft import dct, idct

        return np.asarray(idct(dct(profile) * gaussian(n, sigma)))
    if method == "sampled":
        kernel = sampled_kernel(sigma, truncation)
    elif method == "discrete_analogue":
        kernel = discrete_analogue_kernel(sigma, n // 2)
    else:
        raise InputError(f"method: {method!r} is not known; choose one of {', '.join(METHODS)}")
    return np.convolve(profile, kernel)[len(kernel) // 2 :][:n]


def fitted_blur(profile: Profile) -> float:
    """Return the standard deviation of the Gaussian that fits a profile best in least squares.

    Amplitude and standard deviation are free; the centre is the middle sample. The result is also
    that of the fit of a two-dimensional Gaussian to the picture ``outer(profile, profile)``: with
    ``g`` the Gaussian's profile, the best amplitude leaves ``|p|**2 - <p, g>**2 / |g|**2`` on one
    axis and ``|p|**4 - (<p, g>**2 / |g|**2)**2`` in the picture, and both are least where
    ``<p, g>**2 / |g|**2`` is greatest: where the mean square distance from the middle is the same
    under the weights ``p g`` and ``g g``.

    Parameters
    ----------
    profile : ndarray, shape (n,)
        Samples of a bump centred on the middle, at 1 px.

    Returns
    -------
    float
        Standard deviation in pixels.

    Examples
    --------
    >>> round(fitted_blur(3.0 * blob_profile(41, 1.7)), 12)
    1.7
    """
    squared = (np.arange(len(profile)) - (len(profile) - 1) / 2) ** 2
    start = sqrt(float((profile * squared).sum() / profile.sum()))

    def slope(sd: float) -> float:
        """Derivative of ``<p, g>**2 / |g|**2``, but for factors that are positive where p fits."""
        bump = np.exp(-0.5 * squared / sd**2)
        wider = bump * squared
        return float((profile @ wider) / (profile @ bump) - (bump @ wider) / (bump @ bump))

    low = high = start
    while slope(low) < 0:
        low /= 1.1
    while slope(high) > 0:
        high *= 1.1
    return root_between(slope, low, high)


def semigroup_residual(repeated: Profile, single: Profile) -> float:
    """Return the largest difference of two separable pictures, relative to the second's maximum.

    Parameters
    ----------
    repeated, single : ndarray, shape (n,)
        Profiles; the pictures are their outer products with themselves.

    Returns
    -------
    float
        ``max |R - S| / max |S|`` over all pixels: 0 where the semigroup property holds.
    """
    picture = np.outer(single, single)
    return float(np.abs(np.outer(repeated, repeated) - picture).max() / np.abs(picture).max())
