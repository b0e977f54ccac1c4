"""What the parts of the search hand to each other, for compiled code."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

# Columns of nodes that are held, a power of two; columns made at once.
HELD, GROUP = 16, 4

# Cells expanded at once, and nodes of each along either axis.
LANES, STENCIL = 32, 8

# Cells along either axis that share their bounds, and that are given up together where candidates
# are too many.
BLOCK, TILE = 4, 64

SINGLE_ROUNDING = 2.0**-24
"""Relative error of single precision."""


class NodeRows(NamedTuple):
    """Rows of consecutive nodes of an axis, four at a time.

    Attributes
    ----------
    first, width, offset : ndarray of int, shape (n_blurs, n_groups)
        First column of the source, columns, and where the entries of a group begin.
    entries : ndarray
        Entries of all groups, column by column: four numbers, one for each node.
    """

    first: NDArray[np.int64]
    width: NDArray[np.int64]
    offset: NDArray[np.int64]
    entries: NDArray[np.float64]

    def part(self, begin: int, end: int) -> NodeRows:
        """Some of the groups."""
        first, width, offset = (
            np.ascontiguousarray(each[:, begin:end])
            for each in (self.first, self.width, self.offset)
        )
        return NodeRows(first, width, offset, self.entries)


class Kinked(NamedTuple):
    """Lower Gaussians of the first slices, of so small a blur that polynomials hardly follow them.

    Attributes
    ----------
    n : int
        How many.
    first_y, first_x : ndarray of int, shape (n, n_samples)
        First column of the source for every sample of an axis.
    width_y, width_x : ndarray of int, shape (n,)
        Columns of the rows of each.
    rows_y, rows_x : ndarray, shape (n, n_samples, most_columns)
        Entries of the rows.
    source : ndarray
        What the rows act on.
    level : float
        What is subtracted from it elsewhere.
    """

    n: int
    first_y: NDArray[np.int64]
    width_y: NDArray[np.int64]
    rows_y: NDArray[np.float64]
    first_x: NDArray[np.int64]
    width_x: NDArray[np.int64]
    rows_x: NDArray[np.float64]
    source: NDArray[np.float64]
    level: float


class Bounds(NamedTuple):
    """Bounds of the blocks of cells of a band, as sums that are taken when they are needed.

    Attributes
    ----------
    off : ndarray, shape (n,)
        What all blocks have in common.
    weights : ndarray, shape (n, n_rings)
        What largest fourth differences are multiplied by.
    rings : ndarray, shape (n_blocks_x, n_rings, n_blocks_y)
        Largest fourth differences within some distance.
    ends_y, along_x : ndarray, shapes (n, 2, n_blocks_y) and (2, n_blocks_x)
        Factors of what the ends of the y axis add.
    ends_x, along_y : ndarray, shapes (n_blocks_x, n, 2) and (2, n_blocks_y)
        Factors of what the ends of the x axis add.
    flat : ndarray of bool, shape (n_blocks_x, n_blocks_y)
        Blocks that see no more than the tolerance of the source.
    """

    off: NDArray[np.float32]
    weights: NDArray[np.float32]
    rings: NDArray[np.float32]
    ends_y: NDArray[np.float32]
    along_x: NDArray[np.float32]
    ends_x: NDArray[np.float32]
    along_y: NDArray[np.float32]
    flat: NDArray[np.bool_]


class Band(NamedTuple):
    """Where a band of cells lies.

    Attributes
    ----------
    p : int
        Samples from one node to the next.
    top, left : int
        First sample of the first cell.
    n_cells : int
        Cells along x.
    n_rows, n_columns : int
        Samples of the scale-space.
    """

    p: int
    top: int
    left: int
    n_cells: int
    n_rows: int
    n_columns: int
