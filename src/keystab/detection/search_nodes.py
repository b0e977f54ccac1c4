"""Rows of an axis at the nodes of a search, for compiled code."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numba import njit
from numpy.typing import NDArray

from keystab.detection.search_records import GROUP, Kinked, NodeRows
from keystab.scalespace.spline_axis import (
    MirroredSplines,
    SplineAxis,
    SplineRows,
    columns_of,
    fill_rows,
    no_tables,
)

# A Gaussian ends at this many standard deviations, where 2e-8 is left of it; kernels are kept so
# many pixels further.
_LOCAL, _BESIDE = 5.6, 0.3


@dataclass(frozen=True, eq=False)
class LocalAxis:
    """A spline axis whose kernels end where their Gaussians do.

    Where the band limit of the grid shows, kernels ring beyond their Gaussians, and rows hardly do:
    splines hold next to nothing of that frequency. Lengths are in distances of knots.

    Attributes
    ----------
    rows : SplineRows
        Kernels without what lies beyond.
    n_columns : int
        Columns of the source.
    stride : int
        Samples of the first octave's grid from one sample to the next.
    lacking : ndarray, shape (n_blurs,)
        Largest sum of absolute differences of a row from that of the axis.
    first : int
        Number of the first sample that counts; those before it are there for its neighbours.
    before : int
        Columns of the source before the knot at that sample.
    mirrors : (float, float) or None
        Where samples are mirrored, from the first one on; None where the source goes on instead.
    """

    rows: SplineRows
    n_columns: int
    stride: int
    lacking: NDArray[np.float64]
    first: int
    before: int
    mirrors: tuple[float, float] | None

    @property
    def ends(self) -> tuple[int, int]:
        """First and last sample that have rows."""
        margin = 0 if self.mirrors else self.rows.taps.shape[1] // 2
        return margin, self.rows.n_samples - 1 - margin


@lru_cache(maxsize=8)
def local_axis(axis: SplineAxis, blurs: tuple[float, ...], delta: float) -> LocalAxis:
    """Cut the kernels of an axis off; `blurs` are in pixels, as the distance `delta` of samples."""
    rows = axis.rows
    local = np.ceil(_LOCAL * np.array(blurs) / delta + _BESIDE / delta).astype(np.int64)
    reach = np.minimum(rows.reach, local)
    middle, widest = rows.taps.shape[1] // 2, int(reach.max())
    taps = rows.taps[:, middle - widest : middle + widest + 1].copy()  # cut below
    taps[np.abs(np.arange(-widest, widest + 1)) > reach[:, None]] = 0.0
    margin = (rows.splines.column.size - rows.n_samples) // 2
    column, weight, stop = rows.splines
    part = slice(margin - widest, column.size - margin + widest)
    splines = MirroredSplines(column[part], weight[part], stop[part] - part.start)
    table, first, value = no_tables(reach.size)
    cut = SplineRows(rows.n_samples, taps, reach, splines, table, first, value)
    ring = (rows.reach > 9 * np.array(blurs) / delta + 1) | (rows.table >= 0)
    # Of a Gaussian that is cut, all rows lack at most what is cut.
    outside = np.abs(np.arange(-middle, middle + 1)) > reach[:, None]
    lacking = (np.abs(rows.taps) * outside).sum(axis=1)
    for blur in np.flatnonzero(ring):
        lacking[blur] = _largest_difference(rows, cut, blur, axis.stride, axis.n_columns)
    mirrors = (-delta / 2, (rows.n_samples - 0.5) * delta)
    return LocalAxis(cut, axis.n_columns, axis.stride, lacking, 0, 2, mirrors)


@njit(cache=True, nogil=True)
def _largest_difference(rows, cut, blur, stride, n_columns):
    """Largest sum of absolute differences of a row of two axes."""
    one, other = np.zeros((4, n_columns)), np.zeros((4, n_columns))
    largest = 0.0
    n_rows = (rows.n_samples - 1) // stride + 1
    for begin in range(0, n_rows, 4):
        n = min(4, n_rows - begin)
        one_first, one_width = fill_rows(rows, blur, begin * stride, stride, one[:n])
        first, width = fill_rows(cut, blur, begin * stride, stride, other[:n])
        for r in range(n):
            total = 0.0
            for k in range(one_width):
                value = one[r, k]
                at = k + one_first - first
                if 0 <= at < width:
                    value -= other[r, at]
                total += abs(value)
            for k in range(width):
                at = k + first - one_first
                if at < 0 or at >= one_width:
                    total += abs(other[r, k])
            largest = max(largest, total)
    return largest


def spline_nodes(axis: LocalAxis, p: int, begin: int, n_groups: int, dtype: type) -> NodeRows:
    """Rows of every p-th sample of an axis, from node `begin` on.

    Nodes beyond mirrors stand for their images. Entries are of the type given.
    """
    rows, m = axis.rows, axis.rows.n_samples
    node = axis.first + p * axis.stride * np.arange(begin, begin + GROUP * n_groups)
    if axis.mirrors:
        node = np.where(node < 0, -1 - node, node)
        node = np.where(node >= m, 2 * m - 1 - node, node)
    low, high = axis.ends
    node = np.clip(node, low, high)
    n_blurs = rows.reach.size
    first, width, offset = (np.zeros((n_blurs, n_groups), dtype=np.int64) for _ in range(3))
    _layout(rows, node, first, width)
    # Sums are taken over four columns at a time.
    width = np.minimum(-(-width // GROUP) * GROUP, axis.n_columns)
    np.minimum(first, axis.n_columns - width, out=first)
    end = GROUP * np.cumsum(width.ravel())
    offset[:] = (end - GROUP * width.ravel()).reshape(width.shape)
    entries = np.zeros(int(end[-1]))
    _fill(rows, node, np.empty((GROUP, axis.n_columns)), first, width, offset, entries)
    return NodeRows(first, width, offset, entries.astype(dtype))


@njit(cache=True, nogil=True)
def _layout(rows, node, first, width):
    for blur in range(first.shape[0]):
        for g in range(first.shape[1]):
            low = high = node[4 * g]
            for k in range(4 * g, 4 * g + 4):
                low, high = min(low, node[k]), max(high, node[k])
            first[blur, g], width[blur, g] = columns_of(rows, blur, low, high)


@njit(cache=True, nogil=True)
def _fill(rows, node, room, first, width, offset, entries):
    one = np.int64(1)  # a constant would make another version of `fill_rows`
    for blur in range(first.shape[0]):
        for g in range(first.shape[1]):
            begin, left = offset[blur, g], first[blur, g]
            at = node[4 * g : 4 * g + 4]
            step = at[1] - at[0]
            if step > 0 and at[2] - at[1] == step and at[3] - at[2] == step:
                start, n = fill_rows(rows, blur, at[0], step, room)
                for k in range(n):
                    for r in range(4):
                        entries[begin + 4 * (start - left + k) + r] = room[r, k]
                continue
            for r in range(4):
                start, n = fill_rows(rows, blur, at[r], one, room[:1])
                for k in range(n):
                    entries[begin + 4 * (start - left + k) + r] = room[0, k]


def kinked_rows(
    axes: tuple[LocalAxis, LocalAxis],
    source: np.ndarray,
    blurs: np.ndarray,
    n_samples: tuple[int, int],
) -> Kinked:
    """Rows of some blurs of the axes of a spline scale-space, for all their samples."""
    (first_y, width_y, rows_y), (first_x, width_x, rows_x) = (
        _rows_of_all(axis, blurs, m) for axis, m in zip(axes, n_samples, strict=True)
    )
    return Kinked(blurs.size, first_y, width_y, rows_y, first_x, width_x, rows_x, source, 0.0)


def _rows_of_all(
    axis: LocalAxis, blurs: NDArray[np.int64], m: int
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float64]]:
    """First column and row of m samples, and columns, for some blurs."""
    first = np.zeros((blurs.size, -(-m // GROUP)), dtype=np.int64)
    begin = axis.first + axis.stride * GROUP * np.arange(first.shape[1])
    wide = np.zeros_like(first)
    _spans(axis.rows, blurs, begin, (GROUP - 1) * axis.stride, first, wide)
    width = wide.max(axis=1, initial=0)
    np.minimum(first, axis.n_columns - width[:, None], out=first)
    rows = np.zeros((blurs.size, first.shape[1] * GROUP, int(width.max(initial=0))))
    room = np.empty((GROUP, axis.n_columns))
    _fill_all(axis.rows, blurs, begin, axis.stride, room, first, rows)
    return np.repeat(first, GROUP, axis=1), width, rows


@njit(cache=True, nogil=True)
def _spans(rows, blurs, begin, extent, first, width):
    last = rows.n_samples - 1
    for k in range(blurs.size):
        for g in range(begin.size):
            end = min(begin[g] + extent, last)
            first[k, g], width[k, g] = columns_of(rows, blurs[k], begin[g], end)


@njit(cache=True, nogil=True)
def _fill_all(rows, blurs, begin, stride, room, first, out):
    for k in range(blurs.size):
        for g in range(begin.size):
            n = min(room.shape[0], (rows.n_samples - 1 - begin[g]) // stride + 1)
            left, width = fill_rows(rows, blurs[k], begin[g], stride, room[:n])
            for r in range(n):
                for c in range(width):
                    out[k, room.shape[0] * g + r, left - first[k, g] + c] = room[r, c]
