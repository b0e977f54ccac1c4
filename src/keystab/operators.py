"""Oversampling and Gaussian blur of one image axis as one matrix.

Oversampling and blur are linear and separable, so that along one axis "interpolate on the fine
grid, then blur by a Gaussian" is a matrix L(blur) with one row per fine sample. A blurred fine
image is ``L_y C L_x^T`` with C the source of the interpolant. Only the rows of a tile are ever
built, and of these only the columns that matter.

Two interpolants of the input image are offered (section 2.3 of the paper uses the first):

``spline``
    A cubic B-spline, sampled on the fine grid, then blurred by the discrete cosine transform of
    that grid. The source is the array of spline coefficients. The spline is local and so is the
    Gaussian: a row has some tens of columns, whatever the size of the image.
``cosine``
    The finite cosine series that the half-sample symmetric image is. The source is the array of
    its coefficients; blur is a multiplication, exact for the continuous Gaussian. Rows are not
    local: a column is a frequency.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple, Protocol

import numpy as np
import numpy.typing as npt
import scipy.fft
import scipy.ndimage
from numba import njit

from keystab import cosine

# Kernel values below this do not reach the last digit of a blurred image in [0, 1]; rounding of the
# transform that makes the kernel stays below it.
_NEGLIGIBLE = 3e-17

# From this blur on, in samples, the band limit of the grid lies below the last digit: the kernel is
# a sampled Gaussian and ends where that does, at 8.6 standard deviations.
_LOCAL_BLUR, _LOCAL_REACH = 2.9, 8.6

# Half-sample mirror of the spline coefficients on either side, so that the four columns of a row
# are always neighbours.
_PADDING = 2


class AxisOperator(Protocol):
    """Rows of L(blur) for one axis and several blurs."""

    def block(self, start: int, stop: int) -> Block:
        """Rows `start` to `stop` for every blur."""


class Block(NamedTuple):
    """Rows of L for a range of fine samples, ``L(blur) = expand @ factors[blur]``.

    Attributes
    ----------
    expand : ndarray, shape (n_rows, rank), or None
        What all blurs have in common; None stands for the identity.
    factors : list of (int, ndarray)
        For every blur the first column of the source that counts and the matrix of those
        columns, shape (rank, n_columns).
    """

    expand: np.ndarray | None
    factors: list[tuple[int, np.ndarray]]

    def as_type(self, precision: npt.DTypeLike) -> Block:
        """Return the same block in another floating-point precision."""
        common, factors = self
        return Block(
            None if common is None else common.astype(precision, copy=False),
            [(first, matrix.astype(precision, copy=False)) for first, matrix in factors],
        )


class SplineAxis:
    """Cubic B-spline oversampling followed by the cosine-domain Gaussian of the fine grid.

    The coefficients are those of a whole-sample mirror (the usual prefilter); evaluation beyond
    the image uses the half-sample mirror, which is also the symmetry of the cosine transform on
    the fine grid.

    Parameters
    ----------
    n_samples : int
        Samples m of the first octave's fine grid; sample i lies at ``i * delta_min``.
    n_pixels : int
        Pixels n of the input image along this axis.
    delta_min : float
        Distance of adjacent fine samples in input pixels.
    stride : int
        Fine samples from one row to the next (1 for the first octave).
    blurs : ndarray, shape (n_blurs,)
        Gaussian standard deviations in input pixels.
    """

    def __init__(
        self, n_samples: int, n_pixels: int, delta_min: float, stride: int, blurs: np.ndarray
    ) -> None:
        self.n_samples = n_samples
        self.delta_min = delta_min
        self.stride = stride
        kernels = [cosine_domain_kernel(n_samples, blur / delta_min) for blur in blurs]
        self.reach = np.array([kernel.size - 1 for kernel in kernels])
        self.taps = two_sided(kernels, n_samples)
        self.splines = mirrored_splines(
            *spline_rows(n_samples, n_pixels, delta_min), self.taps.shape[1] // 2
        )

    @property
    def n_terms(self) -> int:
        """Most columns of a row that are not zero."""
        n_pixels = self.splines.column.max() + 4
        return int(min(n_pixels, 2 * self.reach.max() * self.delta_min + 6))

    @property
    def gain(self) -> float:
        """Largest sum of absolute values of a row: weights of a B-spline add up to one."""
        return float(np.abs(self.taps).sum(axis=1).max())

    def block(self, start: int, stop: int) -> Block:
        """See `AxisOperator.block`."""
        factors = []
        first_sample, last_sample = start * self.stride, (stop - 1) * self.stride
        for taps, reach in zip(self.taps, self.reach, strict=True):
            first, last = column_range(
                first_sample - reach, last_sample + reach, self.n_samples, self.splines
            )
            rows = np.zeros((stop - start, last - first))
            blurred_spline_rows(
                first_sample, self.stride, taps, int(reach), self.splines, first, rows
            )
            factors.append((first, rows))
        return Block(None, factors)


class CosineAxis:
    """Evaluation of the input's own cosine series after a continuous Gaussian blur.

    Parameters
    ----------
    n_samples, n_pixels, delta_min, stride, blurs
        As for `SplineAxis`.
    """

    def __init__(
        self, n_samples: int, n_pixels: int, delta_min: float, stride: int, blurs: np.ndarray
    ) -> None:
        self.n_pixels = n_pixels
        self.spacing = delta_min * stride
        self.gains = np.array([cosine.gaussian(n_pixels, blur) for blur in blurs])
        self.n_frequencies = np.array([cosine.significant(n_pixels, blur) for blur in blurs])

    def block(self, start: int, stop: int) -> Block:
        """See `AxisOperator.block`; the columns are the lowest frequencies.

        On a short interval, functions with a band limit of half a cycle per pixel span a space
        of few dimensions, about one per pixel and a dozen more. Its basis is the same for all
        blocks of one length.
        """
        expand = band_limited_basis(stop - start, self.spacing)
        rows = self.basis(np.arange(start, stop))
        common = rows if expand is None else expand.T @ rows
        factors = [
            (0, common[:, :count] * gain[:count])
            for count, gain in zip(self.n_frequencies, self.gains, strict=True)
        ]
        return Block(expand, factors)

    def basis(self, rows: np.ndarray, count: int | None = None) -> np.ndarray:
        """Cosines of the lowest frequencies at fine samples, shape rows.shape + (count,)."""
        return cosine.basis(np.asarray(rows) * self.spacing, self.n_pixels, count)


def spline_source(image: np.ndarray) -> np.ndarray:
    """Spline coefficients of an image less its mean, with two mirrored ones on every side.

    A difference of Gaussians does not see the mean; without it rounding errors shrink, and a
    constant image is zero.
    """
    coefficients = image - image.mean()
    for axis in (0, 1):
        if image.shape[axis] > 1:
            coefficients = scipy.ndimage.spline_filter1d(
                coefficients, order=3, axis=axis, mode="mirror", output=np.float64
            )
    return np.pad(coefficients, _PADDING, mode="symmetric")


def cosine_source(image: np.ndarray) -> np.ndarray:
    """Cosine series coefficients of an image, without the constant term."""
    a = cosine.coefficients(image)
    a[0, 0] = 0.0
    return a


def spline_rows(n_samples: int, n_pixels: int, delta_min: float) -> tuple[np.ndarray, np.ndarray]:
    """Cubic B-spline weights of every fine sample.

    Returns
    -------
    column : ndarray of int, shape (n_samples,)
        First of four adjacent columns of the padded coefficients.
    weight : ndarray, shape (n_samples, 4)
        Weights of those four coefficients.
    """
    position = np.arange(n_samples) * delta_min
    # delta_min may round position to just beyond the last pixel's cell.
    knot = np.minimum(np.floor(position), n_pixels - 1).astype(np.int64)
    t = position - knot
    weight = np.stack(
        [
            (1 - t) ** 3 / 6,
            (4 - 6 * t**2 + 3 * t**3) / 6,
            (1 + 3 * t + 3 * t**2 - 3 * t**3) / 6,
            t**3 / 6,
        ],
        axis=1,
    )
    return knot - 1 + _PADDING, weight


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
    frequency = np.pi * np.arange(n_samples + 1) / n_samples
    kernel = scipy.fft.irfft(np.exp(-0.5 * (blur * frequency) ** 2), 2 * n_samples)
    kernel = kernel[: n_samples + 1]
    reach = int(np.flatnonzero(np.abs(kernel) > _NEGLIGIBLE)[-1])
    if blur >= _LOCAL_BLUR:
        reach = min(reach, int(_LOCAL_REACH * blur) + 1)
    return np.ascontiguousarray(kernel[: reach + 1])


@lru_cache(maxsize=16)
def band_limited_basis(n_samples: int, spacing: float) -> np.ndarray | None:
    """Orthonormal basis of band-limited functions on an interval.

    Parameters
    ----------
    n_samples : int
        Samples of the interval.
    spacing : float
        Their distance in pixels; the band limit is half a cycle per pixel.

    Returns
    -------
    ndarray, shape (n_samples, rank), or None
        Columns that span every such function to the last digit; None where that takes about as
        many as there are samples.
    """
    span = (n_samples - 1) * spacing
    # Frequencies dense enough that the waves between them add nothing new to the interval.
    frequency = np.linspace(0.0, np.pi, int(4 * span) + 64)
    phase = np.multiply.outer((np.arange(n_samples) - (n_samples - 1) / 2) * spacing, frequency)
    waves = np.hstack([np.cos(phase), np.sin(phase)])
    left, singular, _ = np.linalg.svd(waves, full_matrices=False)
    rank = int((singular > 1e-16 * singular[0] * np.sqrt(n_samples)).sum())
    return np.ascontiguousarray(left[:, :rank]) if rank < 0.7 * n_samples else None


class MirroredSplines(NamedTuple):
    """Cubic B-splines of the fine samples and of their mirror images on both sides.

    Attributes
    ----------
    column : ndarray of int, shape (n,)
        First of the four columns of each sample.
    weight : ndarray, shape (n, 4)
        Weights of its four columns.
    stop : ndarray of int, shape (n,)
        Index of the next sample that has other columns.
    """

    column: np.ndarray
    weight: np.ndarray
    stop: np.ndarray


def mirrored_splines(column: np.ndarray, weight: np.ndarray, margin: int) -> MirroredSplines:
    """Continue the rows of `spline_rows` by their half-sample mirror, `margin` <= m each side."""
    column = np.pad(column, margin, mode="symmetric")
    weight = np.pad(weight, ((margin, margin), (0, 0)), mode="symmetric")
    changes = np.flatnonzero(np.diff(column)) + 1
    stop = np.append(changes, column.size)
    return MirroredSplines(
        column, weight, stop[np.searchsorted(changes, np.arange(column.size), side="right")]
    )


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


@njit(cache=True, nogil=True)
def column_range(low, high, n_samples, splines):
    """First column, and one past the last, that samples `low` .. `high` meet once mirrored."""
    margin = (splines.column.size - n_samples) // 2
    first, last = max(low, 0), min(high, n_samples - 1)
    if low < 0:
        last = max(last, min(-1 - low, n_samples - 1))
    if high >= n_samples:
        first = min(first, max(2 * n_samples - 1 - high, 0))
    return splines.column[first + margin], splines.column[last + margin] + 4


@njit(cache=True, nogil=True, fastmath={"contract"})
def blurred_spline_rows(start, stride, taps, reach, splines, first, out):
    """Fill `out` (zeroed) with rows ``start, start + stride, ...`` of the blurred spline.

    The four weights of consecutive fine samples meet the same four columns until the next knot
    is passed, so that sums stay in registers until then.
    """
    column, weight, stops = splines
    middle = taps.size // 2  # also the number of samples mirrored on each side
    for row in range(out.shape[0]):
        centre = start + row * stride
        sample = centre - reach + middle
        last = centre + reach + middle
        while sample <= last:
            stop = min(stops[sample], last + 1)
            here = column[sample] - first
            a0 = a1 = a2 = a3 = 0.0
            for i in range(sample, stop):
                tap = taps[i - centre]
                a0 += tap * weight[i, 0]
                a1 += tap * weight[i, 1]
                a2 += tap * weight[i, 2]
                a3 += tap * weight[i, 3]
            out[row, here] += a0
            out[row, here + 1] += a1
            out[row, here + 2] += a2
            out[row, here + 3] += a3
            sample = stop
