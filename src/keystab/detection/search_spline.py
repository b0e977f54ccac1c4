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

from keystab.detection.search_rows import (
    AxisBlocks,
    axis_blocks,
    blocks_abreast,
    expansion,
    new_blocks,
    whole_rows,
)
from keystab.detection.search_scan import (
    LARGEST,
    ROOM,
    SINGLE_ROUNDING,
    difference,
    gathered,
    largest_size,
    scan,
    starts_of,
)
from keystab.scalespace.dog import ScaleSpace
from keystab.scalespace.spline_axis import SplineAxis

# Length of a block along either axis in standard deviations of 1.1 px.
_LENGTH = 2.8

# Blocks that one column of blocks is wide: its Gaussians, slices and samples stay in the cache.
_ABREAST = 6

# Fewer samples than this per block gain nothing against evaluating all of them.
_LEAST = 24

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
    if space.largest > LARGEST:
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
def _local_maxima(source, y_blocks, x_blocks):
    r"""Largest \|C\|, \|Delta^4 C\| along y and along x that each block of one column meets.

    Returns an array of shape (3, n_blurs, n_y_blocks). What a block meets at one blur it meets at
    the next, larger one as well.
    """
    n_blurs, n_y = y_blocks.first.shape[1], y_blocks.start.size
    maxima = np.zeros((3, n_blurs, n_y))
    across = np.zeros((3, source.shape[0]))
    left = right = x_blocks.first[:, 0].min()
    for blur in range(n_blurs):
        first = x_blocks.first[:, blur]
        last = (first + x_blocks.width[:, blur]).max()
        _widen(source, first.min(), left, across)
        _widen(source, right, last, across)
        left, right = min(left, first.min()), max(right, last)
        for i in range(n_y):
            top = y_blocks.first[i, blur]
            bottom = min(top + y_blocks.width[i, blur], source.shape[0])
            for kind in range(3):
                largest = 0.0
                for y in range(top, bottom):
                    largest = max(largest, across[kind, y])
                maxima[kind, blur, i] = largest
    return maxima


@njit(cache=True, nogil=True)
def _widen(source, left, right, across):
    """Take columns of the source into the maxima of its rows."""
    height, width = source.shape
    for y in range(height):
        for x in range(left, min(right, width)):
            across[0, y] = max(across[0, y], abs(source[y, x]))
            if y + 4 < height:
                along_y = source[y, x] - 4 * source[y + 1, x] + 6 * source[y + 2, x]
                along_y += source[y + 4, x] - 4 * source[y + 3, x]
                across[1, y] = max(across[1, y], abs(along_y))
            if x + 4 < width:
                along_x = source[y, x] - 4 * source[y, x + 1] + 6 * source[y, x + 2]
                along_x += source[y, x + 4] - 4 * source[y, x + 3]
                across[2, y] = max(across[2, y], abs(along_x))


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
    threads : int
        For the operators of the y axis, which all columns of blocks share.
    keep : bool
        Whether operators, some tens of MB, are kept for further images of this size: those of the y
        axis, and those of up to 64 columns of blocks.
    """

    def __init__(
        self,
        space: ScaleSpace,
        tolerance: float,
        rows: slice,
        columns: slice,
        threads: int = 1,
        keep: bool = True,
    ) -> None:
        self.space, self.tolerance, self.keep = space, tolerance, keep
        length = self.length = block_length(space)
        y_axis, x_axis = space.axes
        assert isinstance(y_axis, SplineAxis) and isinstance(x_axis, SplineAxis)
        self.abreast = _ABREAST * length
        self.x_axis, self.x_starts = x_axis, starts_of(columns, space.shape[2], self.abreast)
        y_starts = starts_of(rows, space.shape[1], length)
        make = axis_blocks if keep else new_blocks
        y_blocks = make(y_axis, y_starts, length, threads)
        # Only the rows of the source that the blocks see are held for a column.
        top, bottom = y_blocks.first.min(), (y_blocks.first + y_blocks.width).max()
        self.source = space.source[top:bottom]
        self.y_blocks = y_blocks._replace(first=y_blocks.first - top)
        blurs, lower, upper = space.blurs
        self.n_kinked = int((blurs[lower] < _KINKED).sum())  # the first slices
        kinked = np.unique([lower[: self.n_kinked], upper[: self.n_kinked]])
        self.kinked = tuple(int(blur) for blur in kinked)
        every = whole_rows(y_axis, y_starts, length, self.kinked)
        self.y_rows = every._replace(
            first=every.first - top, entries=every.entries.astype(np.float32)
        )

    @property
    def n_columns(self) -> int:
        """Columns of blocks."""
        return len(self.x_starts)

    def x_blocks(self, column: int) -> AxisBlocks:
        """Rows of the blocks that lie abreast in one column of blocks."""
        first = self.x_starts[column]
        starts = tuple(first + block * self.length for block in range(_ABREAST))
        make = blocks_abreast if self.keep else new_blocks
        return make(self.x_axis, starts, self.length)

    def error_bounds(self, x_blocks: AxisBlocks) -> NDArray[np.float64]:
        """Bound of the interpolation error of every block of a column, and of every slice.

        Returns
        -------
        ndarray, shape (n_y_blocks, n_slices, n_x_blocks)
        """
        _, lower, upper = self.space.blurs
        y_blocks = self.y_blocks
        # Axes (blur, y block, x block).
        level, along_y, along_x = _local_maxima(self.source, y_blocks, x_blocks)[..., None]
        smooth, rough, norm = (
            of_blocks.T[:, None] for of_blocks in (x_blocks.smooth, x_blocks.rough, x_blocks.norm)
        )
        e_y = y_blocks.smooth.T[..., None] * along_y + y_blocks.rough.T[..., None] * level
        e_x = smooth * along_x + rough * level
        bound = norm * e_y + (y_blocks.norm + y_blocks.residual).T[..., None] * e_x
        return np.ascontiguousarray((bound[lower] + bound[upper]).transpose(1, 0, 2))

    def candidates(self, column: int) -> tuple[NDArray[np.int64], list[tuple[int, int]]]:
        """Samples of one column of blocks that may be extrema; see `gathered`."""
        source, blocks = self.source, self.x_blocks(column)
        _, lower, upper = self.space.blurs
        nodes, expand = expansion(self.length)
        strips = np.empty((blocks.first.shape[1], source.shape[0], _ABREAST * nodes.size))
        left, right = blocks.first.min(), (blocks.first + blocks.width).max()
        _strips(
            np.ascontiguousarray(source[:, left:right].T),
            blocks.first - left,
            blocks.width,
            blocks.offset,
            blocks.entries,
            strips,
        )
        whole = np.zeros((len(self.kinked), source.shape[0], self.abreast), dtype=np.float32)
        every = whole_rows(
            self.x_axis, self.x_starts[column : column + 1], self.abreast, self.kinked
        )
        for k in range(len(self.kinked)):
            rows, left = every.rows(0, k)
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
            self.error_bounds(blocks),
            rounding,
            self.tolerance,
            self.x_starts[column],
            found,
            counts,
        )
        return gathered(found, counts, self.y_blocks.start, self.x_starts[column])


@njit(cache=True, nogil=True)
def _strips(source, first, width, offset, entries, strips):
    """Products along x of every source row with the node rows of blocks that lie abreast.

    Compiled, so that threads need not take turns between one small product and the next.

    Parameters
    ----------
    source : ndarray, shape (n_columns, n_rows)
        The columns that the blocks meet, transposed.
    first, width, offset, entries
        See `keystab.detection.search_rows.AxisBlocks`.
    strips : ndarray, shape (n_blurs, n_rows, n_blocks * n_nodes)
        Written to.
    """
    n_blurs, n_rows, across = strips.shape
    n_blocks = first.shape[0]
    n_nodes = across // n_blocks
    product = np.empty((n_nodes, n_rows))
    for blur in range(n_blurs):
        for block in range(n_blocks):
            n, begin, left = width[block, blur], offset[block, blur], first[block, blur]
            rows = entries[begin : begin + n_nodes * n].reshape(n_nodes, n)
            np.dot(rows, source[left : left + n], product)
            for y in range(n_rows):
                for k in range(n_nodes):
                    strips[blur, y, block * n_nodes + k] = product[k, y]


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
    every_row,
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
    error = np.empty((n_slices, abreast))
    every = np.empty((whole.shape[0], length, abreast * length), dtype=np.float32)
    whole_error = np.empty(whole.shape[0])
    largest = np.zeros(whole.shape[:2], dtype=np.float32)  # size of every row of `whole`
    for k in range(whole.shape[0]):
        for y in range(whole.shape[1]):
            largest[k, y] = largest_size(whole[k, y])
    for i in range(starts.size):
        for blur in range(n_blurs):
            n = width[i, blur]
            begin = offset[i, blur]
            rows = entries[begin : begin + n_nodes * n].reshape(n_nodes, n)
            top = first[i, blur]
            np.dot(rows, strips[blur, top : top + n], gaussians[blur])
        for k in range(whole.shape[0]):
            n = every_row.width[i, k]
            begin, top = every_row.offset[i, k], every_row.first[i, k]
            rows = every_row.entries[begin : begin + length * n].reshape(length, n)
            np.dot(rows, whole[k, top : top + n], every[k])
            # A sum of n products, of numbers that were rounded; absolute rows add up to below two.
            whole_error[k] = 2 * (n + 4) * SINGLE_ROUNDING * largest[k, top : top + n].max()
        for s in range(n_kinked):
            off = SINGLE_ROUNDING * difference(every[whole_upper[s]], every[whole_lower[s]], dog[s])
            error[s] = off + whole_error[whole_upper[s]] + whole_error[whole_lower[s]]
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
