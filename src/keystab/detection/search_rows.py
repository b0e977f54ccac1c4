"""Rows of an axis for blocks of its samples: at the nodes of a block only, or all of them.

A block is evaluated at its nodes and expanded to its samples by the polynomial through them; for
what `keystab.detection.search_spline` says about the error, the rows of every block are compared
with their own expansion.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from keystab.scalespace.spline_axis import SplineAxis, columns_of, fill_rows

_NODES = 12

# Powers 0 to 3 of the places of four columns about their middle, inverted.
_FROM_MOMENTS = np.linalg.inv(np.arange(-1.5, 2.0) ** np.arange(4)[:, None])


@lru_cache(maxsize=8)
def expansion(length: int) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Nodes of a block, and the matrix from values there to values at all its samples.

    Parameters
    ----------
    length : int
        Samples of the block.

    Returns
    -------
    nodes : ndarray of int, shape (n_nodes,)
    expand : ndarray, shape (length, n_nodes)
        Lagrange's polynomials of the nodes at all samples.

    Examples
    --------
    >>> nodes, expand = expansion(32)
    >>> x = np.arange(32.0)
    >>> bool(np.abs(expand @ nodes**3.0 - x**3).max() < 1e-9)
    True
    """
    angle = np.pi * (2 * np.arange(_NODES) + 1) / (2 * _NODES)
    stretch = np.cos(np.pi / (2 * _NODES))  # the outermost nodes are the first and the last sample
    nodes = np.rint((1 - np.cos(angle) / stretch) / 2 * (length - 1)).astype(np.int64)
    place = np.arange(length)
    expand = np.ones((length, _NODES))
    for k, node in enumerate(nodes):
        others = np.delete(nodes, k)
        expand[:, k] = np.prod((place[:, None] - others) / (node - others), axis=1)
    return nodes, expand


class AxisBlocks(NamedTuple):
    r"""Node rows of all blocks of an axis, and what bounds their interpolation.

    Attributes
    ----------
    start : ndarray of int, shape (n_blocks,)
        First sample of every block; the last ones may overlap.
    first, width : ndarray of int, shape (n_blocks, n_blurs)
        First column of the source, and columns, of every block and blur.
    offset : ndarray of int, shape (n_blocks, n_blurs)
        Where the entries of a block's node rows begin, row by row.
    entries : ndarray
        Node rows of all blocks and blurs.
    smooth, rough, norm, residual : ndarray, shape (n_blocks, n_blurs)
        Largest :math:`\|R_0'\|_1`, :math:`\|Q\|_1`, :math:`\|L\|_1` and
        :math:`\|R\|_1` of a row.
    """

    start: NDArray[np.int64]
    first: NDArray[np.int64]
    width: NDArray[np.int64]
    offset: NDArray[np.int64]
    entries: NDArray[np.float64]
    smooth: NDArray[np.float64]
    rough: NDArray[np.float64]
    norm: NDArray[np.float64]
    residual: NDArray[np.float64]


@lru_cache(maxsize=8)
def axis_blocks(
    axis: SplineAxis, starts: tuple[int, ...], length: int, threads: int = 1
) -> AxisBlocks:
    """Rows of blocks of an axis at their nodes, and what bounds all others.

    Images of one size share them, as they share those of `blocks_abreast`.

    Parameters
    ----------
    axis : SplineAxis
        The axis.
    starts : tuple of int
        First sample of every block.
    length : int
        Samples of a block.
    threads : int
        Blocks that are filled at once.
    """
    return new_blocks(axis, starts, length, threads)


@lru_cache(maxsize=64)
def blocks_abreast(axis: SplineAxis, starts: tuple[int, ...], length: int) -> AxisBlocks:
    """As `axis_blocks`, for the few blocks of one column: 0.5 MB for six of them."""
    return new_blocks(axis, starts, length)


def new_blocks(
    axis: SplineAxis, starts: tuple[int, ...], length: int, threads: int = 1
) -> AxisBlocks:
    """As `axis_blocks`, without keeping them."""
    nodes, expand = expansion(length)
    blurs = np.arange(axis.rows.reach.size)
    start = np.array(starts, dtype=np.int64)
    first, width, offset, size = _layout(axis, start, length, blurs, nodes.size)
    entries, bounds = np.empty(size), np.empty((start.size, 4, blurs.size))

    def fill(part: slice) -> None:
        _fill_nodes(
            axis.rows,
            start[part] * axis.stride,
            axis.stride,
            nodes,
            expand,
            _FROM_MOMENTS,
            np.empty((length, axis.n_columns)),
            width[part],
            offset[part],
            entries,
            bounds[part],
        )

    if threads == 1:
        fill(slice(None))
    else:
        at_once = -(-start.size // (4 * threads))  # blocks at the ends take less time
        parts = [slice(i, i + at_once) for i in range(0, start.size, at_once)]
        with ThreadPoolExecutor(threads) as pool:
            list(pool.map(fill, parts))
    each = np.ascontiguousarray(bounds.transpose(1, 0, 2))
    return AxisBlocks(start, first, width, offset, entries, *each)


class WholeRows(NamedTuple):
    """All rows of blocks for some blurs, for compiled code.

    Attributes
    ----------
    first, width, offset : ndarray of int, shape (n_blocks, n_blurs)
        First column of the source, columns, and where the entries begin.
    entries : ndarray
        Rows of all blocks and blurs, row by row.
    length : int
        Rows of a block.
    """

    first: NDArray[np.int64]
    width: NDArray[np.int64]
    offset: NDArray[np.int64]
    entries: NDArray[np.float64]
    length: int

    def rows(self, block: int, blur: int) -> tuple[NDArray[np.float64], int]:
        """Rows of one block and blur, and their first column."""
        width, start = self.width[block, blur], self.offset[block, blur]
        rows = self.entries[start : start + self.length * width].reshape(self.length, width)
        return rows, int(self.first[block, blur])


def whole_rows(
    axis: SplineAxis, starts: tuple[int, ...], length: int, blurs: tuple[int, ...]
) -> WholeRows:
    """All rows of blocks for some blurs; the parameters are those of `axis_blocks`."""
    start, chosen = np.array(starts, dtype=np.int64), np.array(blurs, dtype=np.int64)
    first, width, offset, size = _layout(axis, start, length, chosen, length)
    entries = np.empty(size)
    room = np.empty((length, axis.n_columns))
    _fill_all(axis.rows, start * axis.stride, axis.stride, chosen, room, width, offset, entries)
    return WholeRows(first, width, offset, entries, length)


def _layout(
    axis: SplineAxis,
    start: NDArray[np.int64],
    length: int,
    blurs: NDArray[np.int64],
    n_kept: int,
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64], int]:
    """First column, columns, and place of the entries of every block and blur; all entries."""
    first, width = (np.zeros((start.size, blurs.size), dtype=np.int64) for _ in range(2))
    _fill_columns(axis.rows, start * axis.stride, (length - 1) * axis.stride, blurs, first, width)
    end = n_kept * np.cumsum(width.ravel())
    return first, width, (end - n_kept * width.ravel()).reshape(width.shape), int(end[-1:].sum())


@njit(cache=True, nogil=True)
def _fill_columns(rows, starts, extent, blurs, first, width):
    for i in range(starts.size):
        for k in range(blurs.size):
            first[i, k], width[i, k] = columns_of(rows, blurs[k], starts[i], starts[i] + extent)


@njit(cache=True, nogil=True)
def _fill_all(rows, starts, stride, blurs, room, width, offset, entries):
    length = room.shape[0]
    for i in range(starts.size):
        for k in range(blurs.size):
            fill_rows(rows, blurs[k], starts[i], stride, room)
            n, begin = width[i, k], offset[i, k]
            entries[begin : begin + length * n].reshape(length, n)[:] = room[:, :n]


@njit(cache=True, nogil=True)
def _fill_nodes(
    rows, starts, stride, nodes, expand, from_moments, room, width, offset, entries, bounds
):
    """Write the rows at the nodes, and the four bounds of every block and blur."""
    for i in range(starts.size):
        for blur in range(width.shape[1]):
            fill_rows(rows, blur, starts[i], stride, room)
            n, begin = width[i, blur], offset[i, blur]
            kept = entries[begin : begin + nodes.size * n].reshape(nodes.size, n)
            for k in range(nodes.size):
                kept[k] = room[nodes[k], :n]
            residual = np.dot(expand, kept)
            for y in range(residual.shape[0]):
                for x in range(n):
                    residual[y, x] = room[y, x] - residual[y, x]
            bounds[i, :, blur] = _row_bounds(room[:, :n], residual, from_moments)


@njit(cache=True, nogil=True)
def _row_bounds(rows, residual, from_moments):
    """Largest norms of `AxisBlocks` over the rows of one block and blur; `residual` is spoiled."""
    n_rows, n_columns = residual.shape
    middle = n_columns // 2 - 2
    smooth = rough = norm = size = 0.0
    for y in range(n_rows):
        size, norm = max(size, _sum_of_sizes(residual[y])), max(norm, _sum_of_sizes(rows[y]))
    if n_columns < 8:
        return smooth, size, norm, size
    split = np.dot(_moments(residual, middle + 1.5), from_moments.T)
    for y in range(n_rows):
        r = residual[y]
        apart = 0.0
        for k in range(4):
            r[middle + k] -= split[y, k]
            apart += abs(split[y, k])
        # Four running sums at once.
        a = b = c = d = 0.0
        summed = left = 0.0
        for x in range(n_columns - 4):
            a += r[x]
            b += a
            c += b
            d += c
            summed += abs(d)
        for x in range(n_columns - 4, n_columns):
            a += r[x]
            b += a
            c += b
            d += c
            left += abs(d)
        smooth = max(smooth, summed)
        # What the sums do not bring to zero at the end is rounding, and counted as rough.
        rough = max(rough, apart + 16 * left)
    return smooth, rough, norm, size


@njit(cache=True, nogil=True, fastmath={"reassoc", "contract"})
def _sum_of_sizes(values):
    total = 0.0
    for x in range(values.size):
        total += abs(values[x])
    return total


@njit(cache=True, nogil=True, fastmath={"reassoc", "contract"})
def _moments(rows, middle):
    """Moments 0 to 3 of every row about a place among its columns, shape (n_rows, 4)."""
    moments = np.empty((rows.shape[0], 4))
    for y in range(rows.shape[0]):
        r = rows[y]
        m0 = m1 = m2 = m3 = 0.0
        for x in range(r.size):
            place = x - middle
            m0 += r[x]
            m1 += r[x] * place
            m2 += r[x] * place * place
            m3 += r[x] * place * place * place
        moments[y, 0], moments[y, 1], moments[y, 2], moments[y, 3] = m0, m1, m2, m3
    return moments
