"""Blocks of interpolated samples: where they lie, and the scan for what may be an extremum there.

For the search that interpolates most of its samples in single precision
(`keystab.detection.search_cosine`).
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

# Relative error of single precision.
SINGLE_ROUNDING = 2.0**-24

# Images with larger values are left to a dense evaluation, which does not use single precision.
LARGEST = 1e30

# Candidates that have room in one block; blocks with more are left to a dense evaluation.
ROOM = 256


def starts_of(wanted: slice, n_samples: int, length: int) -> tuple[int, ...]:
    """First samples of the blocks in which the wanted samples of an axis have both neighbours.

    Samples at the rim of a block have none, so that blocks overlap by two; the last may overlap
    more where the axis ends.
    """
    starts = np.arange(wanted.start - 1, max(wanted.stop - 1, wanted.start), length - 2)
    return tuple(int(start) for start in np.unique(np.minimum(starts, n_samples - length)))


def gathered(
    found: NDArray[np.int64], counts: NDArray[np.int64], starts: NDArray[np.int64], left: int
) -> tuple[NDArray[np.int64], list[tuple[int, int]]]:
    """Candidates of a column of blocks.

    Parameters
    ----------
    found : ndarray of int, shape (n_blocks, ROOM, 4)
        What `scan` wrote for every block.
    counts : ndarray of int, shape (n_blocks,)
        How many candidates every block has, more than it has room for perhaps.
    starts : ndarray of int, shape (n_blocks,)
        First row of every block.
    left : int
        First column of the blocks.

    Returns
    -------
    candidates : ndarray of int, shape (n, 4)
        Slice, row, column; the fourth column is not used.
    undecided : list of (int, int)
        First row and first column of blocks that had too many, of which none are returned.
    """
    parts = [rows[:count] for rows, count in zip(found, counts, strict=True) if count <= ROOM]
    undecided = [(int(top), left) for top in starts[counts > ROOM]]
    return np.concatenate([np.empty((0, 4), dtype=np.int64), *parts]), undecided


# Without regard for NaN, which no image up to `LARGEST` gives, a maximum takes vector instructions.
_FINITE = {"nnan", "nsz"}


@njit(cache=True, nogil=True, fastmath=_FINITE)
def largest_size(values):
    """Largest absolute value of a row."""
    largest = abs(values[0])
    for x in range(values.size):
        largest = max(largest, abs(values[x]))
    return largest


@njit(cache=True, nogil=True, fastmath=_FINITE)
def difference(high, low, out):
    """Write ``high - low`` in single precision; return its largest absolute value."""
    largest = abs(high[0, 0] - low[0, 0])
    for y in range(out.shape[0]):
        for x in range(out.shape[1]):
            value = high[y, x] - low[y, x]
            largest = max(largest, abs(value))
            out[y, x] = value
    return largest


@njit(cache=True, nogil=True)
def scan(dog, error, tolerance, top, left, found):
    """Write samples that may be extrema, given how far each slice may be off.

    Few rows hold one that exceeds, or falls short of, its four neighbours in the slice, and almost
    none one that does so in scale as well. Both are asked of whole rows without a branch, which the
    compiler turns into vector instructions; only then a row is looked at sample by sample.
    """
    n_slices, n_rows, n_columns = dog.shape
    count = 0
    slack = np.empty(3, dtype=np.float32)
    for s in range(1, n_slices - 1):
        _set_slack(slack, tolerance, error, s)
        slack_f, slack_h, slack_c = slack
        for y in range(1, n_rows - 1):
            here, above, below = dog[s, y], dog[s, y - 1], dog[s, y + 1]
            in_slice = False
            for x in range(1, n_columns - 1):
                low, high = here[x] - slack_h, here[x] + slack_h
                maximum = (
                    (here[x - 1] < low) & (here[x + 1] < low) & (above[x] < low) & (below[x] < low)
                )
                minimum = (
                    (here[x - 1] > high)
                    & (here[x + 1] > high)
                    & (above[x] > high)
                    & (below[x] > high)
                )
                in_slice |= maximum | minimum
            if not in_slice:
                continue
            finer, coarser = dog[s - 1, y], dog[s + 1, y]
            in_scale = False
            for x in range(1, n_columns - 1):
                low, high = here[x] - slack_h, here[x] + slack_h
                maximum = (
                    (here[x - 1] < low)
                    & (here[x + 1] < low)
                    & (above[x] < low)
                    & (below[x] < low)
                    & (finer[x] < here[x] - slack_f)
                    & (coarser[x] < here[x] - slack_c)
                )
                minimum = (
                    (here[x - 1] > high)
                    & (here[x + 1] > high)
                    & (above[x] > high)
                    & (below[x] > high)
                    & (finer[x] > here[x] + slack_f)
                    & (coarser[x] > here[x] + slack_c)
                )
                in_scale |= maximum | minimum
            if not in_scale:
                continue
            for x in range(1, n_columns - 1):
                if _may_be(dog, s, y, x, slack):
                    if count < found.shape[0]:
                        found[count, 0] = s
                        found[count, 1] = top + y
                        found[count, 2] = left + x
                        found[count, 3] = 0
                    count += 1
    return count


@njit(cache=True, nogil=True)
def _set_slack(slack, tolerance, error, s):
    """Write by how much at least samples differ, in three slices, where exact ones do sufficiently.

    A little less, for the rounding of the comparison.
    """
    for ds in range(3):
        least = tolerance - error[s] - error[s - 1 + ds]
        slack[ds] = least - 1e-6 * abs(least) - 1e-30


@njit(cache=True, nogil=True)
def _may_be(dog, s, y, x, slack):
    """Whether a sample exceeds, or falls short of, all 26 neighbours by more than the slack."""
    value = dog[s, y, x]
    above, below = True, True
    for ds in range(-1, 2):
        low, high = value - slack[ds + 1], value + slack[ds + 1]
        for dy in range(-1, 2):
            for dx in range(-1, 2):
                if ds == 0 and dy == 0 and dx == 0:
                    continue
                other = dog[s + ds, y + dy, x + dx]
                above = above and other < low
                below = below and other > high
                if not (above or below):
                    return False
    return True
