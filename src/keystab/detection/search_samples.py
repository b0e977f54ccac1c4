"""Search of a band of samples that are all made: where few lie on a standard deviation."""

from __future__ import annotations

import numpy as np
from numba import njit

from keystab.detection.search_expansion import slack_of
from keystab.detection.search_hulls import CELLS, FAST, MARGIN, NODES
from keystab.detection.search_records import GROUP, HELD, SINGLE_ROUNDING, TILE
from keystab.detection.search_sums import four_columns, largest_of, subtract

# Candidates from which all samples of a tile are evaluated.
_MOST_CANDIDATES = 1024


@njit(cache=True, nogil=True)
def search_samples(rows, blurred, lower, upper, band, off, tolerance, found, dense):  # noqa: PLR0913
    """As `search_cells` where every sample is a node, and samples are compared as they are.

    `off` is how far samples of each slice may be off, but for single precision.
    """
    n_slices, n_cells = lower.size, band.n_cells
    gaussians = np.empty((blurred.shape[0], GROUP, NODES), dtype=np.float32)
    nodes = np.zeros((n_slices, HELD * NODES), dtype=np.float32)
    sizes, room = np.zeros((n_slices, HELD // GROUP)), np.zeros(NODES, dtype=np.float32)
    least = np.zeros(3, dtype=np.float32)
    alive = np.zeros(CELLS, dtype=np.bool_)
    words = alive.view(np.int64)
    count = begun = 0
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
        # The columns whose neighbours are known are cells `first` to `first` + 3.
        first = GROUP * (g - 1) - MARGIN
        if first < 0:
            continue
        tile = first // TILE
        if first % TILE == 0:
            begun = count
        for x in range(first, min(first + GROUP, n_cells)):
            if dense[tile]:
                break
            column = band.left + x
            if column < 1 or column > band.n_columns - 2:
                continue
            at = ((x + MARGIN) & (HELD - 1)) * NODES + MARGIN
            left = ((x + MARGIN - 1) & (HELD - 1)) * NODES + MARGIN
            right = ((x + MARGIN + 1) & (HELD - 1)) * NODES + MARGIN
            for s in range(1, n_slices - 1):
                own = 2 * SINGLE_ROUNDING * largest_of(sizes[s])
                for k in range(3):
                    other = 2 * SINGLE_ROUNDING * largest_of(sizes[s - 1 + k])
                    least[k] = slack_of(tolerance, off[s] + off[s - 1 + k] + own + other)
                finer, here, coarser = nodes[s - 1], nodes[s], nodes[s + 1]
                _stand_out(
                    finer[at:],
                    here[left:],
                    here[at - 1 :],
                    here[right:],
                    coarser[at:],
                    least,
                    alive,
                )
                for word in range(CELLS // 8):
                    if words[word] == 0:
                        continue
                    for y in range(8 * word, 8 * word + 8):
                        row = band.top + y
                        if not alive[y] or row < 1 or row > band.n_rows - 2:
                            continue
                        if not _exceeds_all(nodes, s, (left, at, right), y, least):
                            continue
                        if count < found.shape[0]:
                            found[count, 0], found[count, 1], found[count, 2] = s, row, column
                        count += 1
        if count - begun > _MOST_CANDIDATES:
            dense[tile] = True
            count = begun
    return count


@njit(cache=True, nogil=True, fastmath=FAST)
def _stand_out(finer, left, above, right, coarser, least, alive):
    """Mark samples of a column that may exceed, or fall short of, six neighbours.

    After the one above follow the sample itself and the one below. `least` is by how much they
    differ at least from those of the finer, of the same and of the coarser slice.
    """
    f, h, c = least[0], least[1], least[2]
    for y in range(CELLS):
        value = above[y + 1]
        low, high = value - h, value + h
        maximum = (left[y] < low) & (right[y] < low) & (above[y] < low) & (above[y + 2] < low)
        maximum &= (finer[y] < value - f) & (coarser[y] < value - c)
        minimum = (left[y] > high) & (right[y] > high) & (above[y] > high) & (above[y + 2] > high)
        minimum &= (finer[y] > value + f) & (coarser[y] > value + c)
        alive[y] = maximum | minimum


@njit(cache=True, nogil=True)
def _exceeds_all(nodes, s, columns, y, least):
    """Whether a sample may exceed, or fall short of, all its neighbours."""
    value = nodes[s, columns[1] + y]
    above, below = True, True
    for ds in range(3):
        low, high = value - least[ds], value + least[ds]
        for dx in range(3):
            for dy in range(-1, 2):
                if ds == 1 and dx == 1 and dy == 0:
                    continue
                other = nodes[s - 1 + ds, columns[dx] + y + dy]
                above = above and other < low
                below = below and other > high
    return above or below
