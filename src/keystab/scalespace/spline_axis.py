"""Rows of L for a cubic B-spline through the pixels (section 2.3 of the paper).

The spline is sampled on the fine grid, then blurred by the discrete cosine transform of that grid.
The source is the array of spline coefficients. The spline is local and so is the Gaussian: a row
has some tens of columns, whatever the size of the image.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from keystab.scalespace.axis import Block

# Kernel values below this do not reach the last digit of a blurred image in [0, 1]; rounding of the
# transform that makes the kernel stays below it.
_NEGLIGIBLE = 3e-17

# Where the band limit of the grid shows, rows of L ring: what they hold beyond the distance at
# which less than this is left of their sum (which is 1) is cut off, and the sum restored; but only
# where rows become so many times shorter, because on small images whole rows cost little.
_NEGLIGIBLE_RINGING = 1e-13
_WORTH_CUTTING = 4

# From this blur on, in samples, the band limit of the grid lies below the last digit: the kernel is
# a sampled Gaussian and ends where that does, at 8.6 standard deviations at the latest.
_LOCAL_BLUR, _LOCAL_REACH = 2.9, 8.6

# Half-sample mirror of the spline coefficients on either side, so that the four columns of a row
# are always neighbours.
_PADDING = 2


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
        self.stride = stride
        self.n_columns = n_pixels + 2 * _PADDING
        kernels = [cosine_domain_kernel(n_samples, blur / delta_min) for blur in blurs]
        taps = two_sided(kernels, n_samples)
        splines = mirrored_splines(*spline_rows(n_samples, n_pixels, delta_min), taps.shape[1] // 2)
        reach = np.array([kernel.size - 1 for kernel in kernels])
        rings = reach > _LOCAL_REACH * blurs / delta_min + 1
        dense = SplineRows(n_samples, taps, reach, splines, *_no_tables(blurs.size))
        self.rows = with_tables(dense, np.flatnonzero(rings), self.n_columns)

    def block(self, start: int, stop: int) -> Block:
        """See `keystab.scalespace.axis.AxisOperator.block`."""
        firsts, factors = [], []
        buffer = np.empty((stop - start, self.n_columns))
        for blur in range(self.rows.reach.size):
            first, width = fill_rows(self.rows, blur, start * self.stride, self.stride, buffer)
            firsts.append(first)
            factors.append(buffer[:, :width].copy())
        return Block.of(None, firsts, factors)


def spline_source(image: np.ndarray) -> np.ndarray:
    """Spline coefficients of an image less its mean, with two mirrored ones on every side.

    A difference of Gaussians does not see the mean; without it rounding errors shrink, and a
    constant image is zero.
    """
    coefficients = image - image.mean()
    for axis in (0, 1):
        if image.shape[axis] > 1:
            _filter_splines(coefficients, axis)
    return np.pad(coefficients, _PADDING, mode="symmetric")


def _filter_splines(values: np.ndarray, axis: int) -> None:
    """Turn values into coefficients of the cubic B-splines through them, whole-sample mirrored.

    A spline takes at a knot 4/6 of that knot's coefficient and 1/6 of each neighbour's.
    `scipy.ndimage.spline_filter1d` does the same, and takes half a second of every job to import.
    """
    from scipy.linalg import solve_banded

    bands = np.repeat([[1 / 6], [4 / 6], [1 / 6]], values.shape[axis], axis=1)
    bands[0, 1] = bands[2, -2] = 2 / 6  # the neighbour of an end stands for its mirror image too
    along = np.moveaxis(values, axis, 0)
    for start in range(0, along.shape[1], 256):
        part = along[:, start : start + 256]
        part[:] = solve_banded((1, 1), bands, part)


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
    local = int(_LOCAL_REACH * blur) + 1
    if blur >= _LOCAL_BLUR and local < n_samples:
        # In closed form, without the rounding and the time of the transform.
        distance = np.arange(local + 1) / blur
        kernel = np.exp(-0.5 * distance**2) / (blur * np.sqrt(2 * np.pi))
    else:
        frequency = np.pi * np.arange(n_samples + 1) / n_samples
        kernel = np.fft.irfft(np.exp(-0.5 * (blur * frequency) ** 2), 2 * n_samples)
        kernel = kernel[: n_samples + 1]
    reach = int(np.flatnonzero(np.abs(kernel) > _NEGLIGIBLE)[-1])
    return np.ascontiguousarray(kernel[: reach + 1])


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


class SplineRows(NamedTuple):
    """What the rows of L of a spline axis are made of, for compiled code.

    Attributes
    ----------
    n_samples : int
        Samples of the first octave's grid.
    taps, reach : ndarray
        Kernel of every blur, both sides, and its largest distance.
    splines : MirroredSplines
        Weights of the samples.
    table : ndarray of int, shape (n_blurs,)
        Which table holds the rows of a blur; -1 where they are made when needed.
    first : ndarray of int, shape (n_tables, n_samples)
        First column of each row in a table.
    value : ndarray, shape (n_tables, n_samples, width)
        Entries of each row in a table.
    """

    n_samples: int
    taps: np.ndarray
    reach: np.ndarray
    splines: MirroredSplines
    table: np.ndarray
    first: np.ndarray
    value: np.ndarray


def _no_tables(n_blurs: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    empty = np.empty((0, 0), dtype=np.int64), np.empty((0, 0, 0))
    return (np.full(n_blurs, -1), *empty)


def with_tables(rows: SplineRows, ringing: np.ndarray, n_columns: int) -> SplineRows:
    """Tabulate the rows of blurs whose kernel rings, as far as the rows themselves ring.

    The kernel's tail alternates from sample to sample, and splines hardly hold that frequency: of
    a row, much less is left at a distance than of the kernel. Where some tens of columns are all
    that counts, they are computed once; where the whole row counts, it is made when needed. What is
    cut off changes samples by some 1e-13 of the image's range, and by up to some 1e-11 where the
    border is nearer than the cut.
    """
    reaches = {int(blur): _ringing_reach(rows, int(blur), n_columns) for blur in ringing}
    kept = [blur for blur, r in reaches.items() if _WORTH_CUTTING * (2 * r + 4) < n_columns]
    if not kept:
        return rows
    width = 2 * max(reaches[blur] for blur in kept) + 4
    margin = (rows.splines.column.size - rows.n_samples) // 2
    column = rows.splines.column[margin : margin + rows.n_samples]
    first = np.clip(column + 2 - width // 2, 0, n_columns - width)
    value = np.empty((len(kept), rows.n_samples, width))
    for number, blur in enumerate(kept):
        for start in range(0, rows.n_samples, 256):
            part = slice(start, min(start + 256, rows.n_samples))
            full = _full_rows(rows, blur, part.start, part.stop, n_columns)
            cut = np.take_along_axis(full, first[part, None] + np.arange(width), axis=1)
            value[number, part] = cut / cut.sum(axis=1, keepdims=True)
    table = rows.table.copy()
    table[kept] = np.arange(len(kept))
    return rows._replace(table=table, first=np.tile(first, (len(kept), 1)), value=value)


def _ringing_reach(rows: SplineRows, blur: int, n_columns: int) -> int:
    """Distance in columns beyond which less than `_NEGLIGIBLE_RINGING` of a row is left.

    Seen at the middle of the axis; columns at the ends, whose mirrored splines have a kink, are
    left out: what they add is of the order of the last digit.
    """
    middle = rows.n_samples // 2
    row = np.abs(_full_rows(rows, blur, middle, middle + 1, n_columns)[0])
    row[:8] = row[-8:] = 0.0
    distance = np.abs(np.arange(n_columns) - row.argmax())
    left = np.bincount(distance, weights=row)[::-1].cumsum()[::-1]
    return (
        int(np.argmax(left < _NEGLIGIBLE_RINGING)) if left[-1] < _NEGLIGIBLE_RINGING else n_columns
    )


def _full_rows(rows: SplineRows, blur: int, start: int, stop: int, n_columns: int) -> np.ndarray:
    """Rows `start` to `stop` with all columns."""
    buffer = np.empty((stop - start, n_columns))
    first, width = fill_rows(rows, blur, start, 1, buffer)
    full = np.zeros_like(buffer)
    full[:, first : first + width] = buffer[:, :width]
    return full


@njit(cache=True, nogil=True)
def fill_rows(rows, blur, start, stride, out):
    """Write rows ``start, start + stride, ...`` of L into the first columns of `out`.

    Returns
    -------
    first, width : int
        Column of the source that the first column of `out` stands for, and how many are written.
    """
    last_sample = start + (out.shape[0] - 1) * stride
    first, width = columns_of(rows, blur, start, last_sample)
    out[:, :width] = 0.0
    table = rows.table[blur]
    if table >= 0:
        wide = rows.value.shape[2]
        for row in range(out.shape[0]):
            sample = start + row * stride
            shift = rows.first[table, sample] - first
            out[row, shift : shift + wide] = rows.value[table, sample]
        return first, width
    taps, reach = rows.taps[blur], rows.reach[blur]
    blurred_spline_rows(start, stride, taps, reach, rows.splines, first, out[:, :width])
    return first, width


@njit(cache=True, nogil=True)
def columns_of(rows, blur, start, last):
    """First column of rows `start` to `last` of L, and how many they have."""
    table = rows.table[blur]
    if table >= 0:
        first = rows.first[table, start]
        return first, rows.first[table, last] + rows.value.shape[2] - first
    reach = rows.reach[blur]
    first, end = column_range(start - reach, last + reach, rows.n_samples, rows.splines)
    return first, end - first


@njit(cache=True, nogil=True, fastmath={"contract"})
def blurred_spline_rows(start, stride, taps, reach, splines, first, out):
    """Fill `out` (zeroed) with rows ``start, start + stride, ...`` of the blurred spline.

    The four weights of consecutive fine samples meet the same four columns until the next knot
    is passed, so that sums stay in registers until then; and four rows meet the same weights, so
    that the processor need not wait for one sum before it adds to the next.
    """
    column, weight, stops = splines
    middle = taps.size // 2  # also the number of samples mirrored on each side
    # Zeros around the taps: of four rows, the outer ones do not reach all samples.
    margin = 3 * stride
    tap = np.zeros(2 * (reach + margin) + 1)
    tap[margin : margin + 2 * reach + 1] = taps[middle - reach : middle + reach + 1]
    for row in range(0, out.shape[0], 4):
        n_rows = min(4, out.shape[0] - row)
        sample = start + row * stride - reach + middle
        last = sample + 2 * reach + (n_rows - 1) * stride
        shift = margin - sample
        while sample <= last:
            stop = min(stops[sample], last + 1)
            a0 = a1 = a2 = a3 = b0 = b1 = b2 = b3 = 0.0
            c0 = c1 = c2 = c3 = d0 = d1 = d2 = d3 = 0.0
            for i in range(sample, stop):
                w0, w1, w2, w3 = weight[i, 0], weight[i, 1], weight[i, 2], weight[i, 3]
                at = i + shift
                a, b, c, d = tap[at], tap[at - stride], tap[at - 2 * stride], tap[at - 3 * stride]
                a0, a1, a2, a3 = a0 + a * w0, a1 + a * w1, a2 + a * w2, a3 + a * w3
                b0, b1, b2, b3 = b0 + b * w0, b1 + b * w1, b2 + b * w2, b3 + b * w3
                c0, c1, c2, c3 = c0 + c * w0, c1 + c * w1, c2 + c * w2, c3 + c * w3
                d0, d1, d2, d3 = d0 + d * w0, d1 + d * w1, d2 + d * w2, d3 + d * w3
            here = column[sample] - first
            _add_four(out[row], here, a0, a1, a2, a3)
            if n_rows > 1:
                _add_four(out[row + 1], here, b0, b1, b2, b3)
            if n_rows > 2:
                _add_four(out[row + 2], here, c0, c1, c2, c3)
            if n_rows > 3:
                _add_four(out[row + 3], here, d0, d1, d2, d3)
            sample = stop


@njit(cache=True, nogil=True)
def _add_four(row, here, a, b, c, d):
    row[here] += a
    row[here + 1] += b
    row[here + 2] += c
    row[here + 3] += d
