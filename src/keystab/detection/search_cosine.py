r"""A spline that stands for a cosine series where extrema are sought.

A cosine series has no frequency above half a cycle per pixel. Let a cubic spline have knots every
half pixel, and let the series be divided by what B-splines leave of each of its frequencies
:math:`\omega`. The spline then has all of them as they are, and images of them at
:math:`v_m = 4 \pi m \pm \omega` per pixel, :math:`(\omega / v_m)^4` times as strong, of which a
Gaussian leaves next to nothing. Gaussians of half a pixel and less leave more; their kernels are
convolved with one that passes what the series has and stops the images. The spline is searched like
that through the pixels (`keystab.detection.search_lattice`); how far it can be from the series is
part of all bounds, and what may be an extremum is decided from the series.

**Bound.** Let a kernel leave H of a frequency, and the Gaussian g. A row is off in a frequency by

.. math:: r = |H(\omega) - g| + \sum_m (\omega / v_m)^4 \, |H(v_m)|,

and with C the coefficients of the series, a sample is by at most
:math:`r_y^T |C| \, g_x + (g_y + r_y)^T |C| \, r_x`.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from keystab.detection.search_nodes import LocalAxis
from keystab.scalespace.spline_axis import (
    SplineRows,
    cubic_weights,
    mirrored_splines,
    no_tables,
)

Array = NDArray[np.float64]

KNOTS = 2
"""Knots per pixel."""

# Kernels are sums over samples so close, in pixels, that images of the images are weak.
_FINE = 0.1

# A Gaussian ends at this many standard deviations, where 6e-10 is left of it.
_LOCAL = 6.2

# Gaussians of more knots than this stop the images by themselves. A low-pass of so many knots on
# either side, with this parameter of its Kaiser window, changes what it passes by 8e-9, and leaves
# as much of what it stops.
_BLURRED, _PASS, _KAISER = 1.2, 11.3, 17.8

# Images of frequencies that are looked at one by one, on either side.
_IMAGES = 24

# Rounding of the transforms, far below what else is left to the bound.
_TRANSFORMS = 1e-13


def finer(delta: float) -> int:
    """By how much samples of the grid are divided so that Gaussians are sums over them."""
    return math.ceil(delta / _FINE)


def _kernel(blur: float, delta: float) -> Array:
    """Both sides of the kernel of a Gaussian, in knots."""
    kernel = np.ones(1)
    if blur > 0:
        reach = math.ceil(_LOCAL * blur / delta)
        kernel = np.exp(-0.5 * (np.arange(-reach, reach + 1) * delta / blur) ** 2)
    if blur < _BLURRED:
        reach = math.ceil(_PASS / delta)
        low_pass = np.sinc(np.arange(-reach, reach + 1) * delta) * np.kaiser(2 * reach + 1, _KAISER)
        kernel = np.convolve(kernel, low_pass)
    return np.asarray(kernel / kernel.sum())


@lru_cache(maxsize=8)
def continued_axis(
    last: int, delta: float, stride: int, beyond: int, blurs: tuple[float, ...]
) -> LocalAxis:
    """Rows of a spline that goes on beyond its ends.

    Parameters
    ----------
    last : int
        Number of the last sample, the first being 0.
    delta : float
        Distance of samples, in knots.
    stride : int
        See `keystab.detection.search_nodes.LocalAxis`.
    beyond : int
        Samples that have rows before the first and after the last one.
    blurs : tuple of float
        Standard deviations, in knots.
    """
    kernels = [_kernel(blur, delta) for blur in blurs]
    reach = np.array([kernel.size // 2 for kernel in kernels])
    widest = int(reach.max())
    taps = np.stack([np.pad(kernel, widest - kernel.size // 2) for kernel in kernels])
    # Kernels end before the first sample that has a row; so many are mirrored, but never met.
    first = beyond + widest
    n_samples = last + 1 + 2 * first
    place = delta * np.arange(-first - widest, n_samples - first + widest)
    knot = np.floor(place).astype(np.int64)
    before = 2 - int(knot[0]) + 1
    splines = mirrored_splines(knot - 1 + before, cubic_weights(place - knot), 0)
    n_columns = int(splines.column[-1]) + 6
    rows = SplineRows(n_samples, taps, reach, splines, *no_tables(reach.size))
    return LocalAxis(rows, n_columns, stride, np.zeros(reach.size), first, before, None)


def knots_of(coefficients: Array, axes: tuple[LocalAxis, LocalAxis]) -> Array:
    """Coefficients of the spline that stands for a cosine series, as far as its axes need them.

    Parameters
    ----------
    coefficients : ndarray, shape (height, width)
        Of the cosine series.
    axes : (LocalAxis, LocalAxis)
        Of the y axis and of the x axis.
    """
    from scipy import fft

    values = coefficients
    for axis in axes:
        # Knots at both mirrors, half a pixel beyond the last ones.
        n = values.shape[0]
        waves = np.zeros((KNOTS * n + 1, values.shape[1]))
        waves[:n] = values / _left_by_splines(_frequencies(n))[:, None]
        waves[1:] /= 2  # the transform adds up all others twice
        number = (np.arange(axis.n_columns) - axis.before + KNOTS // 2) % (2 * KNOTS * n)
        values = fft.dct(waves, type=1, axis=0)[np.minimum(number, 2 * KNOTS * n - number)].T
    return np.array(values, dtype=np.float64, order="C")


def _frequencies(n: int) -> Array:
    """Frequencies of an axis of n pixels, per pixel."""
    return np.pi / n * np.arange(n, dtype=np.float64)


def _left_by_splines(frequency: Array) -> Array:
    """What a cubic B-spline leaves of a frequency."""
    left: Array = np.sinc(frequency / (2 * np.pi * KNOTS)) ** 4
    return left


def missed_by_splines(
    coefficients: Array, blurs: Array, axes: tuple[LocalAxis, LocalAxis], delta: float
) -> Array:
    """How far samples of the spline may be from those of the cosine series, for each Gaussian.

    Parameters
    ----------
    coefficients : ndarray, shape (height, width)
        Of the cosine series.
    blurs : ndarray, shape (n_blurs,)
        Standard deviations in pixels.
    axes : (LocalAxis, LocalAxis)
    delta : float
        Distance of the samples that Gaussians are sums over, in pixels.
    """
    size = np.abs(coefficients)
    frequency = [_frequencies(n) for n in size.shape]
    added_y, added_x = (
        _added(axis.rows.taps, blurs, delta, each)
        for axis, each in zip(axes, frequency, strict=True)
    )
    off = np.zeros(blurs.size)
    for k, blur in enumerate(blurs):
        g_y, g_x = (np.exp(-0.5 * (blur * each) ** 2) for each in frequency)
        off[k] = added_y[k] @ size @ g_x + (g_y + added_y[k]) @ size @ added_x[k]
    return off


def _added(taps: Array, blurs: Array, delta: float, frequency: Array) -> Array:
    """How far rows of the spline are off in each frequency, shape (n_blurs, n_frequencies)."""
    middle = taps.shape[1] // 2
    half = 2 * taps[:, middle:]
    half[:, 0] /= 2
    place = delta * np.arange(half.shape[1])
    cosines, sines = (wave(np.outer(place, frequency)) for wave in (np.cos, np.sin))
    off = np.abs(half @ cosines - np.exp(-0.5 * np.outer(blurs, frequency) ** 2))
    images = 2 * np.pi * KNOTS * np.arange(1, _IMAGES + 1)
    for image in images:
        one, other = ((half * wave(image * place)) for wave in (np.cos, np.sin))
        one, other = one @ cosines, other @ sines
        off += (frequency / (image - frequency)) ** 4 * np.abs(one + other)
        off += (frequency / (image + frequency)) ** 4 * np.abs(one - other)
    # Those beyond: the sum over m > M of 1 / (m - 1 / (2 KNOTS))^4, on both sides.
    rest = 2 / (3 * (_IMAGES - 0.5 / KNOTS) ** 3) * (frequency / (2 * np.pi * KNOTS)) ** 4
    return np.asarray(off + np.abs(taps).sum(axis=1)[:, None] * rest + _TRANSFORMS)
