"""Kernels of the cosine-domain Gaussian of a grid."""

from __future__ import annotations

import numpy as np

from keystab.scalespace.rounding import UNIT

# Kernel values below this do not reach the last digit of a blurred image in [0, 1]; rounding of the
# transform that makes the kernel stays below it.
_NEGLIGIBLE = 3e-17

# From this blur on, in samples, the band limit of the grid lies below the last digit: the kernel is
# a sampled Gaussian and ends where that does, at 8.6 standard deviations at the latest.
_LOCAL_BLUR, _LOCAL_REACH = 2.9, 8.6


def cosine_domain_kernel(n_samples: int, blur: float) -> np.ndarray:
    r"""One side of the kernel by which the cosine-domain Gaussian of a grid convolves.

    Multiplying the cosine transform of m samples by :math:`e^{-b^2 (\pi k / m)^2 / 2}` is a
    circular convolution of the mirrored signal, of period 2m. Its kernel is *not* the sampled
    Gaussian: for blurs below about 2.7 samples the band limit of the grid shows, as a tail that
    hardly decays. The tail is cut where it no longer counts in double precision.

    Parameters
    ----------
    n_samples : int
        Samples m of the grid.
    blur : float
        Standard deviation b in samples; 0 is the identity.

    Returns
    -------
    ndarray, shape (reach + 1,)
        Kernel values at distances 0 .. reach, reach <= m.

    Examples
    --------
    >>> kernel = cosine_domain_kernel(400, 3.0)
    >>> abs(kernel[0] - 1 / (3 * (2 * np.pi) ** 0.5)) < 1e-15
    np.True_
    """
    if blur == 0:
        return np.ones(1)
    local = int(_LOCAL_REACH * blur) + 1
    if _in_closed_form(n_samples, blur):
        # In closed form, without the rounding and the time of the transform.
        distance = np.arange(local + 1) / blur
        kernel = np.exp(-0.5 * distance**2) / (blur * np.sqrt(2 * np.pi))
    else:
        frequency = np.pi * np.arange(n_samples + 1) / n_samples
        kernel = np.fft.irfft(np.exp(-0.5 * (blur * frequency) ** 2), 2 * n_samples)
        kernel = kernel[: n_samples + 1]
    reach = int(np.flatnonzero(np.abs(kernel) > _NEGLIGIBLE)[-1])
    return np.ascontiguousarray(kernel[: reach + 1])


def _in_closed_form(n_samples: int, blur: float) -> bool:
    """Whether a kernel is that of the continuous Gaussian."""
    return blur >= _LOCAL_BLUR and int(_LOCAL_REACH * blur) + 1 < n_samples


def off_in_kernel(n_samples: int, blur: float, reach: int, n_taps: int) -> float:
    r"""How far the values of a kernel are off in all, at most.

    In closed form, a value is off by three units of its exponent, by some of its own, and what lies
    beyond the reach is less than a unit. A transform of 2m numbers is off, in the root of the sum
    of squares, by :math:`5 \log_2(2m)` units of theirs; with :math:`G = e^{-(\pi b)^2 / 2}` left at
    the band limit, values at a distance d ring by up to :math:`2 b^2 G / d^2`.

    Parameters
    ----------
    n_samples, blur
        As for `cosine_domain_kernel`.
    reach : int
        Where the kernel is cut off.
    n_taps : int
        Values that are used.

    Examples
    --------
    >>> kernel = cosine_domain_kernel(400, 3.0)
    >>> place = np.arange(kernel.size, dtype=np.longdouble)
    >>> exact = np.exp(-((place / 3) ** 2) / 2) / (3 * np.sqrt(2 * np.longdouble(np.pi)))
    >>> off = 2 * np.abs(kernel - exact).sum()
    >>> bool(off < off_in_kernel(400, 3.0, kernel.size - 1, 2 * kernel.size - 1))
    True
    """
    if blur == 0:
        return 0.0
    if _in_closed_form(n_samples, blur):
        return 8 * UNIT
    norm = 1.0
    if blur > 0.25:
        norm = min(norm, np.sqrt(1 / (2 * np.sqrt(np.pi) * blur)) + 1 / np.sqrt(2 * n_samples))
    off = 5 * np.log2(2 * n_samples) * norm * np.sqrt(n_taps) * UNIT
    if reach == 0 or reach >= n_samples - 1:  # all of it, or nothing but the identity
        return float(off)
    return float(off + 8 * UNIT + 8 * blur**2 * np.exp(-0.5 * (np.pi * blur) ** 2) / reach)


def two_sided(kernels: list[np.ndarray], n_samples: int) -> np.ndarray:
    """Both sides of all kernels in one array, the distance 0 in its middle column."""
    reach = max(kernel.size for kernel in kernels) - 1
    taps = np.zeros((len(kernels), 2 * reach + 1))
    for row, kernel in zip(taps, kernels, strict=True):
        row[reach : reach + kernel.size] = kernel
        row[reach - kernel.size + 1 : reach + 1] = kernel[::-1]
        if kernel.size > n_samples:
            row[reach - n_samples] = 0.0  # the period 2m holds the distance m once, not twice
    return taps
