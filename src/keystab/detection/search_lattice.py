r"""Search of a scale-space that looks only where an extremum can be.

A sample is an extremum only if the differences to its neighbours along y, along x and along scale
all change their sign there. Every p-th sample along y and x is a *node*. Between four nodes stands
a *cell* of :math:`(p + 1)^2` samples, with a polynomial through the nodes whose coefficients prove,
for nearly all cells, that along one axis all differences have one sign
(`keystab.detection.search_hulls`), however far the polynomial may be from the samples
(`keystab.detection.search_bounds`). What is left is expanded and compared
(`keystab.detection.search_expansion`), and what then may be an extremum is decided by the caller
from its own neighbourhood.

**No sample is lost between cells.** Samples on a line between two cells belong to both. Where a
cell is excluded along y, its samples rise, or fall, from each to the next, and so does its
polynomial at each node: the slope there is larger than the bound, or less than minus it. Two cells
above each other that are both excluded along y share the slope at their common nodes, so that both
rise or both fall, and no sample on the line between them is an extremum. A cell that is excluded
along x or along scale is so with the samples on its border. Of the four cells around a node, if
none is excluded along scale, either one above and one below are excluded along y, and rise or fall
together by the slope at the node, or the two on one side are excluded along x, and rise or fall
together by theirs.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from keystab.detection.search_bounds import SplineBounds, off_at_nodes
from keystab.detection.search_cells import search_cells
from keystab.detection.search_field import Field, field_of
from keystab.detection.search_functionals import expansion
from keystab.detection.search_hulls import CELLS, MARGIN, NODES
from keystab.detection.search_kept import Kept
from keystab.detection.search_nodes import LocalAxis, kinked_rows, spline_nodes
from keystab.detection.search_records import BLOCK, GROUP, TILE, Band, Kinked
from keystab.detection.search_samples import search_samples
from keystab.detection.search_sums import rows_of_nodes
from keystab.scalespace.dog import ScaleSpace

# Samples from one node to the next, where they lie one standard deviation of the finest slice
# apart, and the power with which they become fewer: measured. Extrema among coarser samples differ
# more from their neighbours and bear larger bounds, so that nodes may lie further apart. Where the
# rule gives less than `_LEAST`, all samples are made: cells of two samples exclude little.
_SAMPLES, _POWER, _LEAST = 0.546, -0.83, 2.1

# Fewer samples than this are all made: what bounds the others takes some milliseconds.
_FEW = 2e7

# Tiles between two that are evaluated in full which cost less with them than apart: what a tile
# sees of the source is some times as wide.
_BETWEEN = 8

# Share of a part that may be left over before nodes are moved closer together.
_LEFT_OVER = 0.15

# Lower Gaussians with a smaller blur, in distances of nodes, are not expanded at a second look.
_KINKED = 1.4

# Cells along x that are searched at once: bounds the memory on wide images.
_COLUMNS = 1536

# Bytes of rows at nodes that are kept for further images of one size. Those of a small view are a
# few megabytes; in the coarse octaves of a photograph each part has a hundred megabytes of its own.
_KEPT = 2**26

# Images with larger values are left to a dense evaluation, which does not use single precision.
LARGEST = 1e30


def applies(space: ScaleSpace) -> bool:
    """Whether a scale-space can be searched so."""
    return space.largest <= LARGEST and space.shape[0] > 2


def node_distance(space: ScaleSpace) -> int:
    """Samples from one node to the next."""
    p = _SAMPLES * (space.sampling.step / float(space.sigma.min())) ** _POWER
    if p < _LEAST or np.prod(space.shape, dtype=float) < _FEW:
        return 1
    fit = min(space.shape[1:]) // (2 * MARGIN + 2)
    return int(max(1, min(round(p), fit)))


Found = tuple[NDArray[np.int64], list[tuple[slice, slice]]]
"""Candidates, shape (n, 4), and regions of which nothing is known."""


class LatticeSearch:
    """Candidates for extrema of a spline scale-space, one part at a time.

    Parameters
    ----------
    space : ScaleSpace
        The octave.
    tolerance : float
        By how much an extremum differs from each of its 26 neighbours.
    window : (slice, slice)
        Rows and columns of samples that are asked for; others may be among the candidates.
    threads : int
        Parts that are searched at once.
    p : int, optional
        Samples from one node to the next; by default as many as leave little over in a part in the
        middle. Noise makes bounds large, the more so the coarser the octave: they know how the
        image varies, and not that blur averages it.
    field : Field, optional
        What is searched, where it has been made.
    """

    def __init__(
        self,
        space: ScaleSpace,
        tolerance: float,
        window: tuple[slice, slice],
        threads: int = 1,
        p: int | None = None,
        field: Field | None = None,
    ) -> None:
        self.space, self.tolerance = space, tolerance
        self.field = field or field_of(space, p or node_distance(space))
        self._set_up(p or node_distance(space), window, threads)
        self._tried: dict[tuple[int, int, int], Found] = {}
        while p is None and self.p > 1 and self.parts:
            part = self.parts[len(self.parts) // 2]
            found = self.candidates(part)
            cells = sum(columns.stop - columns.start - 1 for _, columns in found[1]) / self.p
            if cells <= _LEFT_OVER * part[2]:
                self._tried[part] = found
                break
            self._set_up(self.p - 1 if cells < part[2] / 2 else self.p // 2, window, threads)

    def _set_up(self, p: int, window: tuple[slice, slice], threads: int) -> None:
        """Make what all parts need, for nodes `p` samples apart."""
        space, self.p = self.space, p
        # Samples on a line between cells belong to both; blocks and groups are kept together.
        first, n_cells = [], []
        for asked in window:
            begin = max((asked.start - 1) // p, 0) // GROUP * GROUP
            first.append(begin)
            n_cells.append(
                max((asked.stop - 1) // p + 1 - begin, 0) if asked.stop > asked.start else 0
            )
        self.first, self.n_cells = first, n_cells
        if min(n_cells) == 0:
            self.parts: list[tuple[int, int, int]] = []
            return
        n_chunks = max(-(-n_cells[1] // _COLUMNS), min(threads, 2))
        wide = -(-n_cells[1] // (n_chunks * TILE)) * TILE
        self.parts = [
            (top, left, min(wide, n_cells[1] - left))
            for top in range(0, n_cells[0], CELLS)
            for left in range(0, n_cells[1], wide)
        ]
        field, n_samples = self.field, (space.shape[1], space.shape[2])
        y_axis, x_axis = field.axes
        self.across = _nodes(
            x_axis, p, first[1] - MARGIN, -(-(n_cells[1] + 2 * MARGIN) // GROUP) + 1, np.float32
        )
        self.off = off_at_nodes(field)
        if p > 1:
            small = field.blurs[field.lower] < _KINKED * p * field.step
            n_kinked = min(int(np.cumprod(small).sum()), field.lower.size - 2)
            lower = tuple(field.lower[:n_kinked].tolist())
            self.kinked = _kinked(field.axes, lower, n_samples)
            many = tuple(
                begin + -(-n // CELLS) * CELLS for begin, n in zip(first, n_cells, strict=True)
            )
            self.bounds = SplineBounds(field, p, (many[0], many[1]), n_kinked)

    def candidates(self, part: tuple[int, int, int]) -> Found:
        """Samples of a part that may be extrema, and rows and columns to be evaluated.

        Returns
        -------
        candidates : ndarray of int, shape (n, 4)
            Slice, row, column; the fourth column is not used.
        dense : list of (slice, slice)
            Samples among which all are candidates.
        """
        if part in self._tried:
            return self._tried.pop(part)
        field, p = self.field, self.p
        lower, upper = field.lower, field.upper
        top, left, n_cells = part
        along = _nodes(field.axes[0], p, self.first[0] + top - MARGIN, NODES // GROUP, np.float64)
        begin = left // GROUP
        across = self.across.part(begin, begin + -(-(n_cells + 2 * MARGIN) // GROUP))
        # Only what the nodes see of the source.
        y0, y1 = along.first.min(), (along.first + along.width).max()
        x0, x1 = across.first.min(), (across.first + across.width).max()
        source = field.source[y0:y1, x0:x1]
        # Differences of Gaussians do not see a level: without it, less is rounded.
        level = float(source.min() + source.max()) / 2
        amplitude = float(source.max() - level)
        blurred = np.empty((field.blurs.size, source.shape[1], NODES), dtype=np.float32)
        rows_of_nodes(along._replace(first=along.first - y0), source - level, blurred)
        across = across._replace(first=across.first - x0)
        n_tiles = -(-n_cells // TILE)
        dense = np.zeros(n_tiles, dtype=np.bool_)
        found = np.empty((1024 * n_tiles, 3), dtype=np.int64)
        row, column = p * (self.first[0] + top), p * (self.first[1] + left)
        band = Band(p, row, column, n_cells, *field.shape[1:])
        if p == 1:
            off = amplitude * self.off + field.missed + field.rounding
            count = search_samples(
                across, blurred, lower, upper, band, off, self.tolerance, found, dense
            )
        else:
            count = search_cells(
                across,
                blurred,
                lower,
                upper,
                band,
                expansion(p),
                self.bounds.of(
                    (self.first[0] + top) // BLOCK,
                    (self.first[1] + left) // BLOCK,
                    -(-n_cells // BLOCK),
                    amplitude,
                    self.tolerance,
                ),
                self.tolerance,
                self.kinked._replace(source=field.source, level=level),
                found,
                dense,
            )
        candidates = np.zeros((count, 4), dtype=np.int64)
        candidates[:, :3] = found[:count]
        regions = [
            (slice(row, row + p * CELLS + 1), slice(column + p * x, column + p * end + 1))
            for x, end in _runs(dense, _BETWEEN if p == 1 else 0)
        ]
        return candidates, regions

    def closer(self, rows: slice, columns: slice) -> LatticeSearch | None:
        """Search of a region that was left over, by all its samples; None where they are known."""
        if self.p == 1:
            return None
        inner = [
            slice(max(part.start, 1), min(part.stop, n - 1))
            for part, n in zip((rows, columns), self.space.shape[1:], strict=True)
        ]
        window = inner[0], inner[1]
        return LatticeSearch(self.space, self.tolerance, window, p=1, field=self.field)


def _runs(dense: NDArray[np.bool_], between: int) -> list[tuple[int, int]]:
    """First and last cell, plus one, of tiles that are left over, with up to so many between them.

    Examples
    --------
    >>> _runs(np.array([True, True, False, True]), 0)
    [(0, 128), (192, 256)]
    >>> _runs(np.array([True, True, False, True]), 1)
    [(0, 256)]
    """
    left = np.flatnonzero(dense)
    if not left.size:
        return []
    parts = np.split(left, np.flatnonzero(np.diff(left) > between + 1) + 1)
    return [(TILE * int(part[0]), TILE * (int(part[-1]) + 1)) for part in parts]


#: Rows at nodes, kept for further images of this size.
_nodes = Kept(spline_nodes, lambda rows: sum(part.nbytes for part in rows), _KEPT)


@lru_cache(maxsize=4)
def _kinked(
    axes: tuple[LocalAxis, LocalAxis], blurs: tuple[int, ...], n_samples: tuple[int, int]
) -> Kinked:
    """Rows of Gaussians of a small blur, kept for further images of this size."""
    return kinked_rows(axes, np.empty((0, 0)), np.array(blurs, dtype=np.int64), n_samples)
