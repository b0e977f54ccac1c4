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
from keystab.scalespace.grid_kernels import cosine_domain_kernel, off_in_kernel, two_sided
from keystab.scalespace.rounding import UNIT, RowRounding
from keystab.scalespace.spline_sums import blurred_spline_rows

# Where the band limit of the grid shows, rows of L ring: what they hold beyond the distance at
# which less than this is left of their sum (which is 1) is cut off, and the sum restored; but only
# where rows become so many times shorter, because on small images whole rows cost little.
_NEGLIGIBLE_RINGING = 1e-13
_WORTH_CUTTING = 4

# Kernels that reach further than this many standard deviations ring.
_LOCAL_REACH = 8.6

# Whole rows that are made at once: they stay in the cache of a core.
_TOGETHER = 32

SOURCE_ROUNDING = 60.0
"""How far coefficients are off, in units of rounding of the largest one.

Differences to the mean are rounded once. Elimination of three bands in which the middle outweighs
the others is off by 4 units of its matrix (norm 1, of its inverse 3) along either axis; the first
one's error is multiplied by the inverse of the second: 9 + 12 + 36 units, and some.
"""

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
        dense = SplineRows(n_samples, taps, reach, splines, *no_tables(blurs.size))
        self.rows, lacking = with_tables(dense, np.flatnonzero(rings), self.n_columns)
        self.rounding = rounding_of_rows(self.rows, lacking, delta_min, blurs, self.n_columns)

    def block(self, start: int, stop: int) -> Block:
        """See `keystab.scalespace.axis.AxisOperator.block`."""
        firsts, factors = [], []
        buffer = np.empty((stop - start, self.n_columns))
        for blur in range(self.rows.reach.size):
            first, width = fill_rows(self.rows, blur, start * self.stride, self.stride, buffer)
            firsts.append(first)
            factors.append(buffer[:, :width].copy())
        return Block.of(firsts, factors)


def spline_source(image: np.ndarray) -> np.ndarray:
    """Spline coefficients of an image less its mean, with two mirrored ones on every side.

    A difference of Gaussians does not see the mean; without it rounding errors shrink, and a
    constant image is zero.
    """
    coefficients = image - image.mean()
    for _ in range(2):  # along axis 0, then along axis 1
        if coefficients.shape[0] > 1:
            _filter_splines(coefficients)
        coefficients = coefficients.T.copy()
    return np.pad(coefficients, _PADDING, mode="symmetric")


@njit(cache=True, nogil=True)
def _filter_splines(values):
    """Turn values into coefficients of the cubic B-splines through them, along axis 0.

    A spline takes at a knot 4/6 of that knot's coefficient and 1/6 of each neighbour's; the
    neighbour of an end stands for its mirror image too. Compiled: the import of what scipy has for
    it takes half a second of every job.
    """
    n = values.shape[0]
    middle = np.full(n, 4 / 6)
    for i in range(1, n):
        factor = (1 / 6 if i < n - 1 else 2 / 6) / middle[i - 1]
        middle[i] -= factor * (2 / 6 if i == 1 else 1 / 6)
        for x in range(values.shape[1]):
            values[i, x] -= factor * values[i - 1, x]
    for x in range(values.shape[1]):
        values[n - 1, x] /= middle[n - 1]
    for i in range(n - 2, -1, -1):
        after = 2 / 6 if i == 0 else 1 / 6
        for x in range(values.shape[1]):
            values[i, x] = (values[i, x] - after * values[i + 1, x]) / middle[i]


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
    weight = cubic_weights(position - knot)
    return knot - 1 + _PADDING, weight


def cubic_weights(t: np.ndarray) -> np.ndarray:
    """Weights of the four B-splines around positions t in [0, 1] after a knot, shape (n, 4)."""
    return np.stack(
        [
            (1 - t) ** 3 / 6,
            (4 - 6 * t**2 + 3 * t**3) / 6,
            (1 + 3 * t + 3 * t**2 - 3 * t**3) / 6,
            t**3 / 6,
        ],
        axis=1,
    )


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


def no_tables(n_blurs: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """`SplineRows.table`, `first` and `value` where all rows are made when needed."""
    empty = np.empty((0, 0), dtype=np.int64), np.empty((0, 0, 0))
    return (np.full(n_blurs, -1), *empty)


def with_tables(
    rows: SplineRows, ringing: np.ndarray, n_columns: int
) -> tuple[SplineRows, np.ndarray]:
    """Tabulate the rows of blurs whose kernel rings, as far as the rows themselves ring.

    The kernel's tail alternates from sample to sample, and splines hardly hold that frequency: of
    a row, much less is left at a distance than of the kernel. Where some tens of columns are all
    that counts, they are computed once; where the whole row counts, it is made when needed. What is
    cut off changes samples by some 1e-13 of the image's range, and by up to some 1e-11 where the
    border is nearer than the cut.

    Returns
    -------
    rows : SplineRows
    lacking : ndarray, shape (n_blurs,)
        Largest sum of what is cut off a row, and of what restoring its sum adds.
    """
    lacking = np.zeros(rows.reach.size)
    reaches = {int(blur): _ringing_reach(rows, int(blur), n_columns) for blur in ringing}
    kept = [blur for blur, r in reaches.items() if _WORTH_CUTTING * (2 * r + 4) < n_columns]
    if not kept:
        return rows, lacking
    width = 2 * max(reaches[blur] for blur in kept) + 4
    margin = (rows.splines.column.size - rows.n_samples) // 2
    column = rows.splines.column[margin : margin + rows.n_samples]
    first = np.clip(column + 2 - width // 2, 0, n_columns - width)
    value = np.empty((len(kept), rows.n_samples, width))
    for number, blur in enumerate(kept):
        for start in range(0, rows.n_samples, _TOGETHER):
            part = slice(start, min(start + _TOGETHER, rows.n_samples))
            full = _full_rows(rows, blur, part.start, part.stop, n_columns)
            cut = np.take_along_axis(full, first[part, None] + np.arange(width), axis=1)
            kept_rows = np.divide(cut, cut.sum(axis=1, keepdims=True), out=value[number, part])
            off = np.abs(full, out=full).sum(axis=1) - np.abs(cut).sum(axis=1)
            off += np.abs(kept_rows - cut).sum(axis=1)
            lacking[blur] = max(lacking[blur], float(off.max()))
    table = rows.table.copy()
    table[kept] = np.arange(len(kept))
    rows = rows._replace(table=table, first=np.tile(first, (len(kept), 1)), value=value)
    return rows, lacking


def rounding_of_rows(
    rows: SplineRows, lacking: np.ndarray, delta_min: float, blurs: np.ndarray, n_columns: int
) -> RowRounding:
    """Bound how far the rows of L are off, but for how positions of samples are rounded.

    Parameters
    ----------
    rows : SplineRows
    lacking : ndarray, shape (n_blurs,)
        What rows lack on purpose, see `with_tables`.
    delta_min : float
        Distance of samples in pixels.
    blurs : ndarray, shape (n_blurs,)
        Gaussian standard deviations in pixels.
    n_columns : int
        Columns of the source.
    """
    norm = np.abs(rows.taps).sum(axis=1)
    columns = np.minimum(2 * rows.reach * delta_min + 6, n_columns)
    # An entry is a sum over the samples between two knots, and over up to eight such, four of them
    # mirrored; the weights of a sample are off by 6 units in all.
    off = (np.ceil(1 / delta_min) + 15) * UNIT * norm
    for blur, sigma in enumerate(blurs / delta_min):
        number, reach = rows.table[blur], int(rows.reach[blur])
        if number < 0:
            off[blur] += off_in_kernel(rows.n_samples, sigma, reach, 2 * reach + 1)
            continue
        value = rows.value[number]
        n_taps = int(value.shape[1] / delta_min) + 1
        off[blur] += lacking[blur] + off_in_kernel(rows.n_samples, sigma, reach, n_taps)
        norm[blur], columns[blur] = np.abs(value).sum(axis=1).max(), value.shape[1]
    return RowRounding(norm, columns, off)


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
    full = np.empty((stop - start, n_columns))
    first, width = fill_rows(rows, blur, start, 1, full)
    if width < n_columns:
        full[:, first : first + width] = full[:, :width].copy()
        full[:, :first] = full[:, first + width :] = 0.0
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
            for k in range(wide):
                out[row, shift + k] = rows.value[table, sample, k]
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
