"""Cells that hulls do not exclude, expanded to all their samples and compared.

By the polynomial through eight nodes along either axis, thirty-two cells side by side, first in
their own slice; of those with a sample that may exceed, or fall short of, its neighbours there,
also in both others.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from keystab.detection.search_hulls import FAST, MARGIN, NODES
from keystab.detection.search_records import BLOCK, HELD, LANES, SINGLE_ROUNDING, STENCIL

# How often single precision is met in an expanded sample, in units of the largest node nearby.
_EXPANSION = 32.0


@njit(cache=True, nogil=True, fastmath=FAST)
def _expand(nodes, weights, half, out):
    """Expand cells to all their samples.

    Parameters
    ----------
    nodes : ndarray, shape (STENCIL, STENCIL, LANES)
        Values at the nodes of cells side by side, axes (x, y, cell).
    weights : ndarray, shape (n, STENCIL)
        From the nodes of an axis to n samples.
    half, out : ndarray, shapes (STENCIL, n, LANES) and (n, n, LANES)
        Written to; axes (y, x, cell).
    """
    n = weights.shape[0]
    for c in range(n):
        w0, w1, w2, w3 = weights[c, 0], weights[c, 1], weights[c, 2], weights[c, 3]
        w4, w5, w6, w7 = weights[c, 4], weights[c, 5], weights[c, 6], weights[c, 7]
        for m in range(STENCIL):
            for x in range(LANES):
                one = w0 * nodes[0, m, x] + w1 * nodes[1, m, x]
                two = w2 * nodes[2, m, x] + w3 * nodes[3, m, x]
                one += w4 * nodes[4, m, x] + w5 * nodes[5, m, x]
                two += w6 * nodes[6, m, x] + w7 * nodes[7, m, x]
                half[m, c, x] = one + two
    for r in range(n):
        w0, w1, w2, w3 = weights[r, 0], weights[r, 1], weights[r, 2], weights[r, 3]
        w4, w5, w6, w7 = weights[r, 4], weights[r, 5], weights[r, 6], weights[r, 7]
        for c in range(n):
            for x in range(LANES):
                one = w0 * half[0, c, x] + w1 * half[1, c, x]
                two = w2 * half[2, c, x] + w3 * half[3, c, x]
                one += w4 * half[4, c, x] + w5 * half[5, c, x]
                two += w6 * half[6, c, x] + w7 * half[7, c, x]
                out[r, c, x] = one + two


@njit(cache=True, nogil=True, fastmath=FAST)
def _compare(here, slack, hit):
    """Mark lanes with a sample that may exceed, or fall short of, four neighbours.

    `slack` holds, for each lane, by how much it differs at least from those along y, and from
    those along x.
    """
    n = here.shape[0]
    for x in range(LANES):
        hit[x] = False
    for r in range(1, n - 1):
        for c in range(1, n - 1):
            for x in range(LANES):
                value = here[r, c, x]
                y, z = slack[0, x], slack[1, x]
                maximum = (here[r, c - 1, x] < value - z) & (here[r, c + 1, x] < value - z)
                minimum = (here[r, c - 1, x] > value + z) & (here[r, c + 1, x] > value + z)
                maximum &= (here[r - 1, c, x] < value - y) & (here[r + 1, c, x] < value - y)
                minimum &= (here[r - 1, c, x] > value + y) & (here[r + 1, c, x] > value + y)
                hit[x] |= maximum | minimum


@njit(cache=True, nogil=True, fastmath=FAST)
def _compare_slices(finer, here, coarser, slack, hit):
    """As `_compare`, for each sample, and with the same one of the finer and the coarser slice."""
    n = here.shape[0]
    for r in range(1, n - 1):
        for c in range(1, n - 1):
            for x in range(LANES):
                value = here[r, c, x]
                y, z = slack[0, x], slack[1, x]
                maximum = (here[r, c - 1, x] < value - z) & (here[r, c + 1, x] < value - z)
                minimum = (here[r, c - 1, x] > value + z) & (here[r, c + 1, x] > value + z)
                maximum &= (here[r - 1, c, x] < value - y) & (here[r + 1, c, x] < value - y)
                minimum &= (here[r - 1, c, x] > value + y) & (here[r + 1, c, x] > value + y)
                f, g = finer[r, c, x], coarser[r, c, x]
                maximum &= (f < value - slack[2, x]) & (g < value - slack[3, x])
                minimum &= (f > value + slack[2, x]) & (g > value + slack[3, x])
                hit[r, c, x] = maximum | minimum


@njit(cache=True, nogil=True)
def slack_of(tolerance, off):
    """By how much at least samples differ where exact ones differ by more than the tolerance.

    Given how far their difference may be off. A little less, for the rounding of the comparison.
    """
    least = tolerance - off
    return np.float32(least - 1e-6 * abs(least) - 1e-30)


@njit(cache=True, nogil=True)
def _may_be(value, others, r, c, lane, tolerance, off_y, off_x, off):  # noqa: PLR0913
    """Whether a sample may exceed, or fall short of, some of its neighbours.

    Signs as bits: 1 if it may exceed all of them, 2 if it may fall short of all.

    Parameters
    ----------
    value : float
        The sample.
    others : ndarray, shape (n, n, n_lanes)
        Samples of its slice or of an adjacent one, axes (y, x, cell).
    r, c, lane : int
        Its place.
    off_y, off_x, off : float
        How far differences along y, along x, and between the slices, may be off.
    """
    above, below = True, True
    if off > 0:
        least = slack_of(tolerance, off)
        above, below = others[r, c, lane] < value - least, others[r, c, lane] > value + least
    for dy in range(-1, 2):
        for dx in range(-1, 2):
            if not (above or below):
                return 0
            if dx == 0 and dy == 0:
                continue
            least = slack_of(tolerance, abs(dy) * off_y + abs(dx) * off_x + off)
            other = others[r + dy, c + dx, lane]
            above = above and other < value - least
            below = below and other > value + least
    return int(above) + 2 * int(below)


@njit(cache=True, nogil=True, fastmath={"contract", "reassoc"})
def _sharpened(kinked, s, row, column, nodes, at, weights_y, weights_x, line, nine):
    """Write nine samples of a slice of which only the upper Gaussian is expanded.

    Parameters
    ----------
    kinked : Kinked
    s, row, column : int
        Slice, and the sample in the middle.
    nodes : ndarray, shape (HELD * NODES,)
        The upper Gaussian at the nodes that are held.
    at : (int, int)
        First row and first column of the nodes of the cell.
    weights_y, weights_x : ndarray, shape (3, STENCIL)
        Expansion to the nine samples.
    line : ndarray
        Work space.
    nine : ndarray, shape (3, 3, 1)
        Written to, axes (y, x, -).
    """
    top = kinked.first_y[s, row - 1]
    height = kinked.first_y[s, row + 1] + kinked.width_y[s] - top
    for dx in range(3):
        for m in range(STENCIL):
            line[m] = 0.0
        for k in range(STENCIL):
            begin, weight = ((at[1] + k) & (HELD - 1)) * NODES + at[0], weights_x[dx, k]
            for m in range(STENCIL):
                line[m] += weight * nodes[begin + m]
        for dy in range(3):
            total = 0.0
            for m in range(STENCIL):
                total += weights_y[dy, m] * line[m]
            nine[dy, dx, 0] = total
        columns = kinked.rows_x[s, column - 1 + dx, : kinked.width_x[s]]
        left = kinked.first_x[s, column - 1 + dx]
        for k in range(height):
            source = kinked.source[top + k, left : left + columns.size]
            total = 0.0
            for m in range(columns.size):
                total += columns[m] * source[m]
            line[k] = total
        for dy in range(3):
            rows = kinked.rows_y[s, row - 1 + dy, : kinked.width_y[s]]
            begin = kinked.first_y[s, row - 1 + dy] - top
            total = 0.0
            for k in range(rows.size):
                total += rows[k] * line[begin + k]
            nine[dy, dx, 0] -= total - kinked.level


@njit(cache=True, nogil=True)
def _expand_slices(cells, which, nodes, weights, at_nodes, half, out):
    """Expand up to `LANES` cells in the slice that is `which` further than their own."""
    for lane in range(LANES):
        values = nodes[cells[lane, 0] + which]
        begin = cells[lane, 1] + MARGIN - 3
        for dx in range(STENCIL):
            column = ((cells[lane, 3] + dx) & (HELD - 1)) * NODES + begin
            for dy in range(STENCIL):
                at_nodes[dx, dy, lane] = values[column + dy]
    _expand(at_nodes, weights, half, out)


@njit(cache=True, nogil=True)
def look_into(cells, n, nodes, bounds, largest, tolerance, rooms):
    """Keep those of up to `LANES` cells that may hold an extremum of their slice.

    Parameters
    ----------
    cells : ndarray of int, shape (LANES, 5)
        Slice, row and column of each cell, the number of its first column of nodes, and which of
        the two columns of bounds is its own; the first ones are overwritten by those that are kept.
    nodes : ndarray, shape (n_slices, HELD * NODES)
        Slices at the nodes that are held.
    bounds : ndarray, shape (2, n, CELLS / BLOCK)
        Of the last two columns of blocks.
    rooms : tuple of ndarray
        Work space.

    Returns
    -------
    n : int
        Cells that are kept.
    """
    single, at_nodes, half, samples, slack, hit, off = rooms
    n_slices, rounding = nodes.shape[0], 2 * _EXPANSION * SINGLE_ROUNDING
    for lane in range(LANES):
        s, v, own = cells[lane, 0], cells[lane, 1] // BLOCK, cells[lane, 4]
        for k in range(2):
            lacks = bounds[own, (3 + k) * n_slices + s, v] + rounding * largest[s]
            slack[k, lane] = slack_of(tolerance, lacks)
    _expand_slices(cells, np.int64(0), nodes, single, at_nodes, half, samples[1])
    _compare(samples[1], slack, hit[0, 0])
    kept = 0
    for lane in range(n):
        if hit[0, 0, lane]:
            for k in range(5):
                cells[kept, k] = cells[lane, k]
            kept += 1
    return kept


@njit(cache=True, nogil=True)
def _may_still_be(  # noqa: PLR0913
    cell, off, row, column, r, c, uppers, weights, kinked, samples, lane, tolerance, line, nine
):
    """As `_may_be`, for all neighbours, once the lower Gaussians with kinks are known."""
    s = cell[0]
    may, value = 3, 0.0
    for t in (s, s - 1, s + 1):
        if t < kinked.n:
            weights_y, weights_x = weights[r - 1 : r + 2], weights[c - 1 : c + 2]
            first = (cell[1] + MARGIN - 3, cell[3])
            _sharpened(kinked, t, row, column, uppers[t], first, weights_y, weights_x, line, nine)
        else:
            for dy in range(3):
                for dx in range(3):
                    nine[dy, dx, 0] = samples[t - s + 1, r - 1 + dy, c - 1 + dx, lane]
        if t == s:
            value = nine[1, 1, 0]
        other = 0.0 if t == s else off[6] if t < s else off[7]
        may &= _may_be(value, nine, 1, 1, 0, tolerance, off[4], off[5], other)
        if may == 0:
            break
    return may


@njit(cache=True, nogil=True)
def _set_off(off, column, n_slices, s, v, largest, n_kinked):
    """Write how far differences may be off, see `look_into`, for a slice and block."""
    rounding = _EXPANSION * SINGLE_ROUNDING
    own, finer, coarser = largest[s], largest[s - 1], largest[s + 1]
    off[0] = column[3 * n_slices + s, v] + 2 * rounding * own
    off[1] = column[4 * n_slices + s, v] + 2 * rounding * own
    off[2] = column[5 * n_slices + s - 1, v] + rounding * (own + finer)
    off[3] = column[5 * n_slices + s, v] + rounding * (own + coarser)
    if s <= n_kinked:
        n, begin = n_kinked + 1, 6 * n_slices
        off[4] = column[begin + s, v] + 2 * rounding * own
        off[5] = column[begin + n + s, v] + 2 * rounding * own
        off[6] = column[begin + 2 * n + s - 1, v] + rounding * (own + finer)
        off[7] = column[begin + 2 * n + s, v] + rounding * (own + coarser)


@njit(cache=True, nogil=True)
def look_closely(  # noqa: PLR0913
    cells, n, nodes, uppers, weights, bounds, largest, tolerance, band, kinked, rooms, nine, found,
    count,
):  # fmt: skip
    """Write samples of up to `LANES` cells that may be extrema; return how many there are now.

    Parameters
    ----------
    cells, nodes, bounds, rooms
        As for `look_into`.
    uppers : ndarray, shape (kinked.n, HELD * NODES)
        Upper Gaussians at the nodes that are held.
    """
    single, at_nodes, half, samples, slack, hit, off = rooms
    side, n_slices = weights.shape[0], nodes.shape[0]
    line = np.empty(kinked.rows_y.shape[2] + 64)
    for lane in range(LANES):
        s, v = cells[lane, 0], cells[lane, 1] // BLOCK
        _set_off(off[lane], bounds[cells[lane, 4]], n_slices, s, v, largest, kinked.n)
        for k in range(4):
            slack[k, lane] = slack_of(tolerance, off[lane, k])
    for k in range(3):
        _expand_slices(cells, k - 1, nodes, single, at_nodes, half, samples[k])
    finer, here, coarser = samples[0], samples[1], samples[2]
    _compare_slices(finer, here, coarser, slack, hit)
    for r in range(1, side - 1):
        for c in range(1, side - 1):
            words = hit[r, c].view(np.int64)
            for word in range(LANES // 8):
                if words[word] == 0:
                    continue
                for lane in range(8 * word, min(8 * word + 8, n)):
                    if not hit[r, c, lane]:
                        continue
                    cell, lacks = cells[lane], off[lane]
                    row, column = band.top + band.p * cell[1] + r - 1, band.p * cell[2] + c - 1
                    column += band.left
                    if (
                        row < 1
                        or row > band.n_rows - 2
                        or column < 1
                        or column > band.n_columns - 2
                    ):
                        continue
                    value, y, x = here[r, c, lane], lacks[0], lacks[1]
                    may = _may_be(value, here, r, c, lane, tolerance, y, x, 0.0)
                    if may:
                        may &= _may_be(value, finer, r, c, lane, tolerance, y, x, lacks[2])
                    if may:
                        may &= _may_be(value, coarser, r, c, lane, tolerance, y, x, lacks[3])
                    if may and cell[0] <= kinked.n:
                        may &= _may_still_be(
                            cell, lacks, row, column, r, c, uppers, weights, kinked, samples, lane,
                            tolerance, line, nine,
                        )  # fmt: skip
                    if may:
                        if count < found.shape[0]:
                            found[count, 0], found[count, 1] = cell[0], row
                            found[count, 2] = column
                        count += 1
    return count
