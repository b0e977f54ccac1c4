"""Search of one band of cells: nodes are made, cells excluded, and the others expanded.

Columns of nodes are made from left to right and forgotten sixteen columns later. Cells that
`keystab.detection.search_hulls` cannot exclude are expanded to all their samples by the polynomial
through eight nodes along either axis, thirty-two cells side by side; of these samples, those remain
that exceed, or fall short of, all their neighbours by what the error of the expansion leaves open.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from keystab.detection.search_expansion import look_closely, look_into
from keystab.detection.search_hulls import (
    CELLS,
    COLUMN,
    FAST,
    MARGIN,
    NODES,
    advance,
    may_turn,
    range_of_difference,
)
from keystab.detection.search_records import (
    BLOCK,
    GROUP,
    HELD,
    LANES,
    SINGLE_ROUNDING,
    STENCIL,
    TILE,
)
from keystab.detection.search_sums import four_columns, largest_of, subtract

# How often single precision is met at most in a derivative and in a difference of slices, in units
# of the largest node nearby.
_DERIVATIVE, _DIFFERENCE = 96.0, 32.0

# Candidates, and share of cells to be expanded, from which all samples of a tile are evaluated.
_MOST_CANDIDATES, _MOST_EXPANDED = 1024, 0.5


@njit(cache=True, nogil=True)
def search_cells(  # noqa: PLR0913
    rows, blurred, lower, upper, band, weights, bounds, tolerance, kinked, found, dense
):
    """Search a band of cells from left to right.

    Parameters
    ----------
    rows : NodeRows
        Along x, from `MARGIN` nodes before the first cell on; columns are those of `blurred`.
    blurred : ndarray, shape (n_blurs, n_columns, NODES)
        From `rows_of_nodes`.
    lower, upper : ndarray of int, shape (n_slices,)
        Gaussians of each slice.
    band : Band
    weights : ndarray, shape (p + 3, STENCIL)
        Expansion to the samples of a cell, the node after its last, and one more on either side.
    bounds : Bounds
        For all slices: derivatives along y and along x, of the polynomial of Hermite per node, that
        prove the sign of a difference of samples; the same for the difference to the next slice;
        how far differences of expanded samples may be off, along y, along x, and to the next
        slice. Then the last three for the first slices, where the Gaussians `kinked` are known.
    tolerance : float
        By how much an extremum differs from each neighbour.
    kinked : Kinked
    found : ndarray of int, shape (room, 3)
        Written to: slice, row, column of samples that may be extrema, some more than once.
    dense : ndarray of bool, shape (n_tiles,)
        Written to: tiles of `TILE` columns of cells that are left to a dense evaluation.

    Returns
    -------
    count : int
        Samples found, more than there is room for perhaps.
    """
    n_slices, n_cells = lower.size, band.n_cells
    gaussians = np.empty((blurred.shape[0], GROUP, NODES), dtype=np.float32)
    nodes = np.zeros((n_slices, HELD * NODES), dtype=np.float32)
    uppers = np.zeros((kinked.n, HELD * NODES), dtype=np.float32)
    sizes, largest = np.zeros((n_slices, HELD // GROUP)), np.zeros(n_slices)
    room = np.zeros(NODES, dtype=np.float32)
    # Eight columns in their places, and the first of the next eight after them.
    pairs = np.zeros((n_slices, 9 * COLUMN), dtype=np.float32)
    span = np.zeros((n_slices, 2 * CELLS), dtype=np.float32)
    least = np.zeros((n_slices, 3 * CELLS), dtype=np.float32)
    column_bounds = np.zeros((2, bounds.off.size, CELLS // BLOCK), dtype=np.float32)
    alive = np.zeros(CELLS, dtype=np.bool_)
    words = alive.view(np.int64)
    cells, closer = np.ones((LANES, 5), dtype=np.int64), np.ones((2 * LANES, 5), dtype=np.int64)
    side = weights.shape[0]
    rooms = (
        weights.astype(np.float32),
        np.zeros((STENCIL, STENCIL, LANES), dtype=np.float32),
        np.zeros((STENCIL, side, LANES), dtype=np.float32),
        np.zeros((3, side, side, LANES), dtype=np.float32),
        np.zeros((4, LANES), dtype=np.float32),
        np.zeros((side, side, LANES), dtype=np.bool_),
        np.zeros((LANES, 8)),
    )
    nine = np.zeros((3, 3, 1))
    # Numbers of a type: a constant would make another version of every loop that is given it.
    count = begun = waiting = close = expanded = np.int64(0)
    lanes, none = np.int64(LANES), np.int64(0)
    n_groups = -(-(n_cells + 2 * MARGIN) // GROUP)
    for g in range(n_groups):
        for blur in range(blurred.shape[0]):
            entries = rows.entries[rows.offset[blur, g] :]
            four_columns(
                entries, rows.width[blur, g], blurred[blur], rows.first[blur, g], gaussians[blur]
            )
        begin = ((GROUP * g) & (HELD - 1)) * NODES
        for s in range(n_slices):
            high, low = gaussians[upper[s]].reshape(-1), gaussians[lower[s]].reshape(-1)
            sizes[s, g % sizes.shape[1]] = subtract(high, low, nodes[s, begin:], room)
            if s < kinked.n:
                _copy(high, uppers[s, begin:])
            largest[s] = largest_of(sizes[s])
        # Cells between the columns of nodes `left` and `left + 1` are cells number `left` - MARGIN.
        first = GROUP * (g - 1)
        if first < MARGIN:
            if first == 0:
                _advance(pairs, nodes, np.int64(MARGIN))
            continue
        tile = (first - MARGIN) // TILE
        if (first - MARGIN) % TILE == 0:
            begun, expanded = count, none
        own = g & 1
        _bounds_of_column(bounds, (first - MARGIN) // BLOCK, column_bounds[own])
        _set_least(least, column_bounds[own], bounds.flat[(first - MARGIN) // BLOCK], largest)
        for left in range(first, min(first + GROUP, n_cells + MARGIN)):
            _advance(pairs, nodes, left + 1)
            if dense[tile]:
                continue
            at = (left & 7) * COLUMN
            for s in range(n_slices - 1):
                range_of_difference(pairs[s, at:], pairs[s + 1, at:], span[s])
            for s in range(1, n_slices - 1):
                may_turn(pairs[s, at:], least[s], alive)
                _exclude(
                    span[s - 1], span[s], least[s - 1, 2 * CELLS :], least[s, 2 * CELLS :], alive
                )
                for word in range(CELLS // 8):
                    if words[word] == 0:
                        continue
                    for y in range(8 * word, 8 * word + 8):
                        if not alive[y]:
                            continue
                        cells[waiting, 0], cells[waiting, 1] = s, y
                        cells[waiting, 2], cells[waiting, 3] = left - MARGIN, left - 3
                        cells[waiting, 4] = own
                        waiting += 1
                        if waiting < LANES:
                            continue
                        expanded += waiting
                        kept = look_into(
                            cells, waiting, nodes, column_bounds, largest, tolerance, rooms
                        )
                        waiting = none
                        _copy(cells[:kept].reshape(-1), closer[close:].reshape(-1))
                        close += kept
                        if close >= LANES:
                            count = look_closely(
                                closer, lanes, nodes, uppers, weights, column_bounds, largest,
                                tolerance, band, kinked, rooms, nine, found, count,
                            )  # fmt: skip
                            close -= lanes
                            _copy(closer[lanes : lanes + close].reshape(-1), closer.reshape(-1))
        # Nodes of this group's cells are still held when the next group has been searched.
        last = g == n_groups - 1 or (GROUP * (g - 1)) % TILE == 0
        if waiting > 0 and (g % 2 == 0 or last):
            expanded += waiting
            kept = look_into(cells, waiting, nodes, column_bounds, largest, tolerance, rooms)
            waiting = none
            _copy(cells[:kept].reshape(-1), closer[close:].reshape(-1))
            close += kept
        while close > 0 and (g % 2 == 0 or last):
            count = look_closely(
                closer, min(close, lanes), nodes, uppers, weights, column_bounds, largest,
                tolerance, band, kinked, rooms, nine, found, count,
            )  # fmt: skip
            close = max(close - lanes, none)
            _copy(closer[lanes : lanes + close].reshape(-1), closer.reshape(-1))
        if count - begun > _MOST_CANDIDATES or expanded > _MOST_EXPANDED * CELLS * TILE * n_slices:
            dense[tile] = True
            count = begun
    return count


@njit(cache=True, nogil=True)
def _copy(values, out):
    """Copy a row to the beginning of another."""
    for i in range(values.size):
        out[i] = values[i]


@njit(cache=True, nogil=True)
def _advance(pairs, nodes, right):
    """Write the pairs of all slices whose right column is `right`."""
    at = ((right - 1) & 7) * COLUMN
    for s in range(pairs.shape[0]):
        values = nodes[s]
        advance(
            pairs[s, at:],
            values[((right - 2) & (HELD - 1)) * NODES :],
            values[((right - 1) & (HELD - 1)) * NODES :],
            values[(right & (HELD - 1)) * NODES :],
            values[((right + 1) & (HELD - 1)) * NODES :],
            values[((right + 2) & (HELD - 1)) * NODES :],
        )
        if (right & 7) == 0:
            _copy(pairs[s, 8 * COLUMN :], pairs[s])


@njit(cache=True, nogil=True)
def _bounds_of_column(bounds, u, out):
    """Write the bounds of a column of blocks, shape (n, CELLS / BLOCK)."""
    np.dot(bounds.weights, bounds.rings[u], out)
    x_one, x_three = bounds.along_x[0, u], bounds.along_x[1, u]
    a0, a1 = bounds.along_y[0], bounds.along_y[1]
    for q in range(out.shape[0]):
        y_one, y_three = bounds.ends_x[u, q, 0], bounds.ends_x[u, q, 1]
        _add_ends(
            out[q], bounds.off[q], x_one, bounds.ends_y[q, 0], x_three, bounds.ends_y[q, 1], y_one,
            a0, y_three, a1,
        )  # fmt: skip


@njit(cache=True, nogil=True, fastmath=FAST)
def _add_ends(out, off, x_one, e0, x_three, e1, y_one, a0, y_three, a1):  # noqa: PLR0913
    for v in range(CELLS // BLOCK):
        out[v] += (x_one * e0[v] + x_three * e1[v]) + (y_one * a0[v] + y_three * a1[v]) + off


@njit(cache=True, nogil=True)
def _set_least(least, column, flat, largest):
    """Write what proves a sign, for each slice: along y, along x, to the next slice, per cell.

    Where the source is flat, nothing is needed to prove that there is no extremum.
    """
    n_slices = least.shape[0]
    for s in range(n_slices):
        for kind in range(3):
            if kind == 2:
                off = _DIFFERENCE * max(largest[s], largest[min(s + 1, n_slices - 1)])
            else:
                off = _DERIVATIVE * largest[s]
            for v in range(CELLS // BLOCK):
                value = np.float32(
                    (column[kind * n_slices + s, v] + off * SINGLE_ROUNDING) * 1.000001
                )
                if flat[v]:
                    value = np.float32(-3e38)
                for y in range(BLOCK):
                    least[s, kind * CELLS + BLOCK * v + y] = value


@njit(cache=True, nogil=True, fastmath=FAST)
def _exclude(before, after, least_before, least_after, alive):
    """Keep cells in which samples may exceed, or fall short of, those of both other slices."""
    for y in range(CELLS):
        rises = (before[CELLS + y] >= -least_before[y]) & (after[y] <= least_after[y])
        falls = (before[y] <= least_before[y]) & (after[CELLS + y] >= -least_after[y])
        alive[y] &= rises | falls
