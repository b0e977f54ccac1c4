"""The image as a function: its mirror images, and two interpolants."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from keystab.figures import palette, style
from keystab.scalespace.cosine_series import coefficients, evaluate
from keystab.scalespace.spline_axis import spline_rows, spline_source

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

PIXELS = np.array([0.35, 0.55, 0.9, 0.75, 0.3, 0.2, 0.45, 0.7])
EDGE = np.repeat([0.2, 0.8], 8)
_STEP = 1 / 64


def by_series(pixels: Array, position: Array) -> Array:
    """Values of the cosine series of a row of pixels."""
    return evaluate(coefficients(pixels[:, None]), position, [0.0])[:, 0]


def by_spline(pixels: Array) -> tuple[Array, Array]:
    """Positions, and values of the cubic spline there."""
    n = int((pixels.size - 1) / _STEP) + 1
    column, weight = spline_rows(n, pixels.size, _STEP)
    source = spline_source(pixels[:, None])[:, 2]
    values = (weight * source[column[:, None] + np.arange(4)]).sum(axis=1)
    level = float(pixels.mean())
    return np.linspace(0.0, (n - 1) * _STEP, n), np.asarray(values + level)


def draw() -> Figure:
    """Draw both panels."""
    figure = style.new_figure(2.7)
    grid = figure.add_gridspec(2, 2, width_ratios=(1.25, 1), height_ratios=(2.3, 1))
    _draw_mirrors(figure.add_subplot(grid[:, 0]))
    top = figure.add_subplot(grid[0, 1])
    _draw_edge(top, figure.add_subplot(grid[1, 1], sharex=top))
    return figure


def _draw_mirrors(ax: Axes) -> None:
    n = PIXELS.size
    where = np.arange(-n, 2 * n)
    mirrored = np.pad(PIXELS, n, mode="symmetric")
    inside = (where >= 0) & (where < n)
    fine = np.linspace(-n, 2 * n - 1, 1200)
    ax.plot(fine, by_series(PIXELS, fine), color=palette.METHOD_COLOURS["dct"], lw=1.2)
    ax.plot(where[inside], mirrored[inside], "o", color=palette.INK, ms=4, mec="none")
    ax.plot(where[~inside], mirrored[~inside], "o", mfc="white", mec=palette.INK, ms=4, mew=0.8)
    for mirror in (-0.5, n - 0.5):
        ax.axvline(mirror, color=palette.GREY, ls=style.REFERENCE, lw=0.8, ymax=0.86)
    for x, text in (
        (-n / 2 - 0.5, "mirror image"),
        (n / 2 - 0.5, "image"),
        (1.5 * n, "mirror image"),
    ):
        ax.text(x, 1.09, text, ha="center", fontsize=style.SMALL, color=palette.GREY)
    ax.set(xlabel="position y (px)", ylabel="grey value", ylim=(0, 1.18), xticks=range(-8, 17, 4))
    style.letter(ax, "a", "continued by its mirror images")
    style.finish_axes(ax)


def _draw_edge(ax: Axes, below: Axes) -> None:
    where = np.arange(EDGE.size)
    position, spline = by_spline(EDGE)
    series = by_series(EDGE, position)
    colours = palette.METHOD_COLOURS["dct"], palette.METHOD_COLOURS["sampled"]
    for values, colour in zip((series, spline), colours, strict=True):
        ax.plot(position, values, color=colour, lw=1.2)
    ax.plot(where, EDGE, "o", color=palette.INK, ms=3, mec="none", zorder=3)
    ax.text(4.4, 0.62, "cosine series", color=colours[0], fontsize=style.SMALL, ha="center")
    ax.text(4.4, 0.5, "cubic spline", color=colours[1], fontsize=style.SMALL, ha="center")
    ax.set(ylabel="grey value", xlim=(2.5, 12.5), ylim=(0.05, 0.95))
    ax.tick_params(labelbottom=False)
    below.plot(position, series - spline, color=palette.INK, lw=1)
    below.plot(where, 0 * EDGE, "o", color=palette.INK, ms=3, mec="none")
    below.set(xlabel="position y (px)", ylabel="difference", ylim=(-0.06, 0.06))
    style.letter(ax, "b", "an edge between its pixels")
    style.finish_axes(ax, below)
