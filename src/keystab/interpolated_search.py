r"""Search of a finely sampled scale-space from few of its samples.

A balanced scale-space at n_spo = 15 holds twelve samples per standard deviation of its narrowest
Gaussian, far more than its shape needs. Here a block of samples is evaluated at some *nodes* only,
rows and columns near those of Chebyshev, and expanded to all its samples by the polynomial through
the nodes, in single precision. How far that can be from the truth is bounded, so that what is
reported holds every extremum and a few samples more, which the caller decides exactly.

**Bound.** Rows L of an axis and their polynomial expansion E N (N: the rows at the nodes) differ by
R = L - E N. Of R the part that does not annihilate cubic polynomials is split off, R = R_0 + Q with
Q on four columns; summing R_0 four times gives R_0' with
:math:`|R_0 C| = |R_0' \Delta^4 C| \le \|R_0'\|_1 \max|\Delta^4 C|`, since splines and Gaussians map
cubics to cubics and Q is of the order of rounding away from the borders. With C the source,

.. math:: L_y C L_x^T - E_y N_y C N_x^T E_x^T = R_y C L_x^T + (L_y - R_y) C R_x^T

so that, with :math:`e = \|R_0'\|_1 \max|\Delta^4 C| + \|Q\|_1 \max|C|` along each axis over the
source that the block sees, a Gaussian is off by at most
:math:`\|L_x\|_1 e_y + (\|L_y\|_1 + \|R_y\|_1) e_x`, and a slice by the sum over its two Gaussians.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from keystab.block_rows import axis_blocks, expansion, whole_rows
from keystab.block_scan import ROOM, SINGLE_ROUNDING, difference, gathered, scan, starts_of
from keystab.dog_space import ScaleSpace
from keystab.operators import SplineAxis

# Length of a block along either axis in standard deviations of 1.1 px.
_LENGTH = 2.8

# Blocks that one column of blocks is wide: its Gaussians, slices and samples stay in the cache.
_ABREAST = 6

# Fewer samples than this per block gain nothing against evaluating all of them.
_LEAST = 24

# From this blur on, in pixels, the interpolation errs so little that its bound need not be local.
_SMOOTH = 1.3

# Slices whose lower Gaussian has a smaller blur, in pixels, show the kinks of the spline, which no
# polynomial follows: they are evaluated at all samples.
_KINKED = 0.6


def applies(space: ScaleSpace) -> bool:
    """Whether a scale-space is sampled finely enough, and its rows are local."""
    length = block_length(space)
    if space.oversampling != "spline" or length < _LEAST:
        return False
    if min(space.shape[1], space.shape[2]) < _ABREAST * length:
        return False
    axis = space.axes[0]
    assert isinstance(axis, SplineAxis)
    # Rows of ringing kernels have all columns.
    return not (axis.rows.table >= 0).any() and bool((axis.rows.reach < axis.rows.n_samples).all())


def block_length(space: ScaleSpace) -> int:
    """Samples of a block along either axis."""
    sampling = space.sampling
    return min(48, int(_LENGTH * sampling.sigma_min / sampling.delta_min))


@njit(cache=True, nogil=True)
def _local_maxima(values, y_blocks, x_blocks, column, n_blurs):
    """Largest value that each block of one column meets at the first blurs, 0 if none."""
    maxima = np.zeros((n_blurs, y_blocks.start.size))
    across = np.empty(values.shape[0])
    group = slice(column * _ABREAST, (column + 1) * _ABREAST)
    for blur in range(n_blurs):
        first = x_blocks.first[group, blur]
        left = first.min()
        right = min((first + x_blocks.width[group, blur]).max(), values.shape[1])
        for y in range(across.size):
            largest = 0.0
            for x in range(left, right):
                largest = max(largest, values[y, x])
            across[y] = largest
        for i in range(y_blocks.start.size):
            top = y_blocks.first[i, blur]
            for y in range(top, min(top + y_blocks.width[i, blur], across.size)):
                maxima[blur, i] = max(maxima[blur, i], across[y])
    return maxima


class InterpolatedSearch:
    """Candidates for extrema of a scale-space, one column of blocks at a time.

    Parameters
    ----------
    space : ScaleSpace
        The octave, for which `applies` is true.
    tolerance : float
        By how much an extremum differs from each of its 26 neighbours.
    rows, columns : slice
        Samples that are asked for; others may be among the candidates.
    """

    def __init__(self, space: ScaleSpace, tolerance: float, rows: slice, columns: slice) -> None:
        self.space, self.tolerance = space, tolerance
        length = self.length = block_length(space)
        y_axis, x_axis = space.axes
        assert isinstance(y_axis, SplineAxis) and isinstance(x_axis, SplineAxis)
        self.abreast = _ABREAST * length
        y_starts = starts_of(rows, space.shape[1], length)
        self.x_starts = starts_of(columns, space.shape[2], self.abreast)
        each = tuple(start + k * length for start in self.x_starts for k in range(_ABREAST))
        self.y_blocks = axis_blocks(y_axis, y_starts, length)
        self.x_blocks = axis_blocks(x_axis, each, length)
        source = space.source
        # What the bounds are made of: the source, and its fourth differences along each axis.
        self.parts = [np.abs(source), *(np.abs(np.diff(source, 4, axis=axis)) for axis in (0, 1))]
        self.largest = [float(part.max(initial=0.0)) for part in self.parts]
        blurs, lower, upper = space.blurs
        self.n_kinked = int((blurs[lower] < _KINKED).sum())  # the first slices
        kinked = np.unique([lower[: self.n_kinked], upper[: self.n_kinked]])
        self.kinked = tuple(int(blur) for blur in kinked)
        every = whole_rows(y_axis, y_starts, length, self.kinked)
        self.y_rows = every._replace(entries=every.entries.astype(np.float32))
        self.x_rows = whole_rows(x_axis, self.x_starts, self.abreast, self.kinked)

    @property
    def n_columns(self) -> int:
        """Columns of blocks."""
        return len(self.x_starts)

    def error_bounds(self, column: int) -> NDArray[np.float64]:
        """Bound of the interpolation error of every block of a column, and of every slice.

        Returns
        -------
        ndarray, shape (n_y_blocks, n_slices)
        """
        blurs, lower, upper = self.space.blurs
        y_blocks, x_blocks = self.y_blocks, self.x_blocks
        n_local = int(np.searchsorted(blurs, _SMOOTH))  # blurs ascend
        level, along_y, along_x = (
            np.repeat(largest, blurs.size * y_blocks.start.size).reshape(blurs.size, -1)
            for largest in self.largest
        )
        for part, maxima in zip(self.parts, (level, along_y, along_x), strict=True):
            maxima[:n_local] = _local_maxima(part, y_blocks, x_blocks, column, n_local)
        group = slice(column * _ABREAST, (column + 1) * _ABREAST)
        smooth, rough, norm = (
            of_blocks[group].max(axis=0)[:, None]
            for of_blocks in (x_blocks.smooth, x_blocks.rough, x_blocks.norm)
        )
        e_y = y_blocks.smooth.T * along_y + y_blocks.rough.T * level
        e_x = smooth * along_x + rough * level
        bound = norm * e_y + (y_blocks.norm + y_blocks.residual).T * e_x
        return np.ascontiguousarray((bound[lower] + bound[upper]).T)

    def candidates(self, column: int) -> tuple[NDArray[np.int64], list[tuple[int, int]]]:
        """Samples of one column of blocks that may be extrema; see `block_scan.gathered`."""
        space, blocks = self.space, self.x_blocks
        _, lower, upper = space.blurs
        nodes, expand = expansion(self.length)
        group = range(column * _ABREAST, (column + 1) * _ABREAST)
        n_blurs = blocks.first.shape[1]
        source = space.source
        strips = np.zeros((n_blurs, source.shape[0], _ABREAST * nodes.size))
        for blur in range(n_blurs):
            for k, block in enumerate(group):
                width, start = blocks.width[block, blur], blocks.offset[block, blur]
                rows = blocks.entries[start : start + nodes.size * width].reshape(-1, width)
                left = blocks.first[block, blur]
                part = strips[blur, :, k * nodes.size : (k + 1) * nodes.size]
                np.matmul(source[:, left : left + width], rows.T, out=part)
        whole = np.zeros((len(self.kinked), source.shape[0], self.abreast), dtype=np.float32)
        for k in range(len(self.kinked)):
            rows, left = self.x_rows.rows(column, k)
            whole[k] = source[:, left : left + rows.shape[1]] @ rows.T
        single = expand.astype(np.float32)
        found = np.empty((self.y_blocks.start.size, ROOM, 4), dtype=np.int64)
        counts = np.empty(self.y_blocks.start.size, dtype=np.int64)
        # Sums of n products in single precision err by n units of the sum of their sizes.
        rounding = 2 * (nodes.size + 3) * SINGLE_ROUNDING * np.abs(expand).sum(axis=1).max() ** 2
        _search(
            strips,
            self.y_blocks.first,
            self.y_blocks.width,
            self.y_blocks.offset,
            self.y_blocks.entries,
            self.y_blocks.start,
            lower,
            upper,
            whole,
            self.y_rows,
            self.n_kinked,
            np.searchsorted(self.kinked, lower[: self.n_kinked]),
            np.searchsorted(self.kinked, upper[: self.n_kinked]),
            single,
            np.ascontiguousarray(single.T),
            self.error_bounds(column),
            rounding,
            self.tolerance,
            self.x_starts[column],
            found,
            counts,
        )
        return gathered(found, counts, self.y_blocks.start, self.x_starts[column])


@njit(cache=True, nogil=True)
def _search(  # noqa: PLR0913
    strips,
    first,
    width,
    offset,
    entries,
    starts,
    lower,
    upper,
    whole,
    whole_rows,
    n_kinked,
    whole_lower,
    whole_upper,
    expand,
    expand_t,
    bounds,
    rounding,
    tolerance,
    left,
    found,
    counts,
):
    """Search one column of blocks from top to bottom."""
    length, n_nodes = expand.shape
    n_slices, n_blurs, across = lower.size, strips.shape[0], strips.shape[2]
    abreast = across // n_nodes
    gaussians = np.empty((n_blurs, n_nodes, across))
    nodes = np.empty((n_nodes, across), dtype=np.float32)
    half = np.empty((length, across), dtype=np.float32)
    dog = np.empty((n_slices, length, abreast * length), dtype=np.float32)
    error = np.empty(n_slices)
    every = np.empty((whole.shape[0], length, abreast * length), dtype=np.float32)
    whole_error = np.empty(whole.shape[0])
    for i in range(starts.size):
        for blur in range(n_blurs):
            n = width[i, blur]
            begin = offset[i, blur]
            rows = entries[begin : begin + n_nodes * n].reshape(n_nodes, n)
            top = first[i, blur]
            np.dot(rows, strips[blur, top : top + n], gaussians[blur])
        for k in range(whole.shape[0]):
            n = whole_rows.width[i, k]
            begin, top = whole_rows.offset[i, k], whole_rows.first[i, k]
            rows = whole_rows.entries[begin : begin + length * n].reshape(length, n)
            strip = whole[k, top : top + n]
            np.dot(rows, strip, every[k])
            # A sum of n products, of numbers that were rounded; absolute rows add up to below two.
            whole_error[k] = 2 * (n + 4) * SINGLE_ROUNDING * np.abs(strip).max()
        for s in range(n_kinked):
            error[s] = SINGLE_ROUNDING * difference(
                every[whole_upper[s]], every[whole_lower[s]], dog[s]
            )
            error[s] += whole_error[whole_upper[s]] + whole_error[whole_lower[s]]
        for s in range(n_kinked, n_slices):
            high, low = gaussians[upper[s]], gaussians[lower[s]]
            error[s] = bounds[i, s] + rounding * difference(high, low, nodes)
            np.dot(expand, nodes, half)
            np.dot(
                half.reshape(length * abreast, n_nodes),
                expand_t,
                dog[s].reshape(length * abreast, length),
            )
        counts[i] = scan(dog, error, tolerance, starts[i], left, found[i])
