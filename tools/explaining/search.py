"""How cells are excluded from the search, by the library's own loops and bounds."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from explaining.views import KAPPA, view
from keystab.detection.extrema import discrete_extrema
from keystab.detection.search_hulls import (
    CELLS,
    COLUMN,
    MARGIN,
    NODES,
    PAIR,
    advance,
    may_turn,
    range_of_difference,
)
from keystab.detection.search_lattice import LatticeSearch
from keystab.detection.search_records import BLOCK, Bounds
from keystab.figures import palette, style
from keystab.scalespace.dog import ScaleSpace, scale_space

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

N_SPO, SLICE = 15, 8
P = 4
"""Samples from one node to the next."""

EXCLUDED = {"along y": "#b9d7ea", "along x": "#7fb2d4", "along scale": "#d9d9d9", "left": "#D55E00"}
"""Colours of cells by what excludes them."""


class Cells(NamedTuple):
    """Cells of one slice: what excludes them, and derivatives along x of one row of cells.

    Attributes
    ----------
    reason : ndarray of int, shape (n_rows, n_columns)
        0: along y, 1: along x, 2: along scale, 3: not excluded.
    low, high : ndarray, shape (n_rows, n_columns)
        Least and largest Bernstein coefficient along x, grey values per node.
    bound : ndarray, shape (n_rows, n_columns)
        What they are compared with.
    """

    reason: NDArray[np.int64]
    low: Array
    high: Array
    bound: Array


@cache
def space() -> ScaleSpace:
    """Scale-space of a small view."""
    return scale_space(view(1.1, 44, 72, down=12.0, right=-20.0), 1.1, N_SPO, kappa=KAPPA)


def columns_of_bounds(bounds: Bounds, column: int) -> Array:
    """Bounds of one column of blocks of cells, as `keystab.detection.search_cells` adds them up."""
    along_y, along_x = bounds.along_y, bounds.along_x
    ends = sum(
        along_x[k, column] * bounds.ends_y[:, k]
        + bounds.ends_x[column, :, k][:, None] * along_y[k][None, :]
        for k in range(2)
    )
    total: Array = bounds.weights @ bounds.rings[column] + ends + bounds.off[:, None]
    return total


@cache
def cells() -> Cells:
    """Cells of the slice `SLICE`."""
    lattice = space()
    window = slice(1, lattice.shape[1] - 1), slice(1, lattice.shape[2] - 1)
    tolerance = lattice.rounding
    search = LatticeSearch(lattice, tolerance, window, p=P)
    n_columns = (lattice.shape[2] - 2) // P - 3
    source = search.field.source
    amplitude = float(source.max() - source.min()) / 2
    bounds = search.bounds.of(0, 0, -(-search.n_cells[1] // BLOCK), amplitude, tolerance)
    nodes = _nodes(lattice, n_columns + 2 * MARGIN)
    n_slices = lattice.shape[0]
    pairs = np.zeros((3, PAIR), dtype=np.float32)
    reason = np.full((CELLS, n_columns), 3)
    low, high, bound = (np.zeros((CELLS, n_columns)) for _ in range(3))
    for right in range(MARGIN, n_columns + MARGIN + 1):
        for pair, values in zip(pairs, nodes, strict=True):
            pair[:COLUMN] = pair[COLUMN:]
            advance(pair, *values[right - 2 : right + 3])
        k = right - MARGIN - 1
        if k < 0:
            continue
        each = columns_of_bounds(bounds, k // BLOCK)
        along_y, along_x, to_next, to_this = (
            np.repeat(each[row], BLOCK).astype(np.float32)
            for row in (SLICE, n_slices + SLICE, 2 * n_slices + SLICE, 2 * n_slices + SLICE - 1)
        )
        anything = np.full(CELLS, np.inf, dtype=np.float32)
        turns = np.zeros((2, CELLS), dtype=np.bool_)
        may_turn(pairs[1], np.concatenate([along_y, anything]), turns[0])
        may_turn(pairs[1], np.concatenate([anything, along_x]), turns[1])
        stands_out = _stands_out(pairs, to_this, to_next)
        for number, may in ((2, stands_out), (1, turns[1]), (0, turns[0])):
            reason[~may, k] = number
        low[:, k], high[:, k] = _along_x(pairs[1])
        bound[:, k] = along_x
    rows = (lattice.shape[1] - 2) // P - 3
    return Cells(reason[:rows], low[:rows], high[:rows], bound[:rows])


def _nodes(lattice: ScaleSpace, n_columns: int) -> NDArray[np.float32]:
    """Nodes of three slices, shape (3, n_columns, NODES); `MARGIN` of them before the grid."""
    box = lattice.window(slice(SLICE - 1, SLICE + 2))[:, ::P, ::P]
    missing = MARGIN + NODES, MARGIN + n_columns
    padded = np.pad(box, ((0, 0), (MARGIN, missing[0]), (MARGIN, missing[1])), mode="edge")
    nodes = padded[:, :NODES, :n_columns].swapaxes(1, 2)
    return np.ascontiguousarray(nodes, dtype=np.float32)


def _stands_out(
    pairs: NDArray[np.float32], to_this: NDArray[np.float32], to_next: NDArray[np.float32]
) -> NDArray[np.bool_]:
    """Cells in which samples may exceed, or fall short of, those of both other slices."""
    before, after = np.zeros((2, 2 * CELLS), dtype=np.float32)
    range_of_difference(pairs[0], pairs[1], before)
    range_of_difference(pairs[1], pairs[2], after)
    rises = (before[CELLS:] >= -to_this) & (after[:CELLS] <= to_next)
    falls = (before[:CELLS] <= to_this) & (after[CELLS:] >= -to_next)
    either: NDArray[np.bool_] = rises | falls
    return either


def _along_x(pair: NDArray[np.float32]) -> tuple[Array, Array]:
    """Least and largest of the twelve coefficients of the derivative along x."""
    a, p, c, u, b, q, d, v = pair.reshape(8, NODES)
    # Four rows of coefficients: at the upper nodes, a third below, a third above the lower ones.
    left, right, slope_left, slope_right = (
        _rows(value, slope) for value, slope in ((a, c), (b, d), (p, u), (q, v))
    )
    middle = 3 * (right - left) - slope_left - slope_right
    every = np.concatenate([slope_left, middle, slope_right])
    return every.min(axis=0), every.max(axis=0)


def _rows(value: NDArray[np.float32], slope: NDArray[np.float32]) -> Array:
    above, below = slice(MARGIN, MARGIN + CELLS), slice(MARGIN + 1, MARGIN + 1 + CELLS)
    third = slope / 3
    rows = value[above], value[above] + third[above], value[below] - third[below], value[below]
    return np.stack(rows).astype(np.float64)


ROW, FIRST, LAST = 40, 60, 100
"""Row of cells that is shown, its first cell and the one after its last."""


def draw() -> Figure:
    """Draw both panels."""
    figure = style.new_figure(3.0)
    grid = figure.add_gridspec(2, 2, width_ratios=(1, 1.35), height_ratios=(1, 1.1))
    top = figure.add_subplot(grid[0, 0])
    _draw_row(top, figure.add_subplot(grid[1, 0], sharex=top))
    _draw_cells(figure.add_subplot(grid[:, 1]))
    return figure


def _draw_row(ax: Axes, below: Axes) -> None:
    lattice, found = space(), cells()
    step = lattice.sampling.step
    columns = slice(P * FIRST, P * LAST + 1)
    values = lattice.window(slice(SLICE, SLICE + 1), slice(P * ROW, P * ROW + 1), columns)[0, 0]
    where = np.arange(columns.start, columns.stop) * step
    ax.plot(where, values, ".", color=palette.GREY, ms=1.8, mec="none")
    ax.plot(where[::P], values[::P], "o", color=palette.INK, ms=3, mec="none")
    ax.set(ylabel="w (grey value)")
    ax.tick_params(labelbottom=False)
    for k in range(FIRST, LAST):
        low, high, bound = (1e3 * each[ROW, k] for each in (found.low, found.high, found.bound))
        clear = low > bound or high < -bound
        colour = palette.DETECTION_COLOURS["refined" if clear else "discrete"]
        left = P * k * step
        below.fill_between([left, left + P * step], low, high, color=colour, lw=0)
        below.fill_between([left, left + P * step], -bound, bound, color=palette.PALE, lw=0)
    below.axhline(0, color=palette.INK, lw=0.5)
    below.set(xlabel="position x (px)", ylabel="change of w per\nnode (0.001)")
    style.letter(ax, "a", "one row of nodes")
    style.finish_axes(ax, below)


def _draw_cells(ax: Axes) -> None:
    from matplotlib.colors import ListedColormap
    from matplotlib.patches import Patch

    lattice, found = space(), cells()
    step = lattice.sampling.step
    height, width = (P * step * n for n in found.reason.shape)
    ax.imshow(
        found.reason, cmap=ListedColormap(list(EXCLUDED.values())), vmin=-0.5, vmax=3.5,
        extent=(0, width, height, 0), interpolation="nearest",
    )  # fmt: skip
    extrema = discrete_extrema(lattice)
    here = extrema[extrema[:, 0] == SLICE]
    ax.plot(here[:, 2] * step, here[:, 1] * step, "o", mfc="none", mec=palette.INK, ms=7, mew=1)
    ax.set(xlim=(0, width), ylim=(height, 0), xlabel="x (px)", ylabel="y (px)")
    shares = [float((found.reason == k).mean()) for k in range(4)]
    handles = [
        Patch(color=colour, label=f"{name} ({share:.0%})")
        for (name, colour), share in zip(EXCLUDED.items(), shares, strict=True)
    ]
    ax.legend(
        handles=handles, ncols=4, loc="upper center", bbox_to_anchor=(0.5, -0.2), frameon=False,
        handlelength=1, columnspacing=1, handletextpad=0.4,
    )  # fmt: skip
    style.letter(ax, "b", "cells of a slice; circles: extrema")
