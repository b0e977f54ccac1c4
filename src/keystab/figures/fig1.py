"""Figure 1: which discrete Gaussian blur obeys the semigroup property (section 2.2)."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from keystab.errors import InputError
from keystab.figures import palette, style
from keystab.figures._render import Tables, check_tables, main

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from pandas import DataFrame, Series

TABLES = {
    "fig1.csv": (
        "sigma",
        "method",
        "repeated_blur",
        "single_blur",
        "theory",
        "residual",
        "c",
        "n_passes",
    )
}
"""Files read, with the columns that they must have."""

PANELS = {"sampled": "a", "dct": "b", "discrete_analogue": "c"}
"""The panel of each method."""

LIMIT = 0.7
"""Blur in pixels below which the paper sees the sampled kernel fail; drawn as a guide."""


def draw(tables: Tables, draft: bool = False) -> Figure:
    """Draw the blur that each method adds against theory, its error, and the property's residual.

    Parameters
    ----------
    tables : mapping
        ``fig1``: the table of `keystab.experiments.semigroup_table.semigroup_table`.
    draft : bool
        Say on the figure that its numbers come from quick settings.

    Returns
    -------
    matplotlib Figure
        Panels a to c: blur added by ``N`` passes and by a single one, ``sqrt(fit**2 - c**2)``, over
        the line of theory ``sqrt(N) * sigma``; d: relative error of the blur fitted after ``N``
        passes; e: largest difference of the two pictures.

    Raises
    ------
    InputError
        If the table is unusable or a method is missing.
    """
    check_tables(tables, TABLES)
    table = tables["fig1"].sort_values("sigma", kind="stable")
    by_method = {method: table[table["method"] == method] for method in PANELS}
    for method, rows in by_method.items():
        if len(rows) == 0:
            raise InputError(f"fig1.csv: has no rows of the method {method}; remake the table")
    passes = int(table["n_passes"].iloc[0])
    with style.context():
        figure = style.new_figure(4.4)
        outer = figure.add_gridspec(2, 1, hspace=0.08)
        top = style.panels(outer[0], 1, 3, sharex=True, sharey=True)[0]
        for ax, (method, rows) in zip(top, by_method.items(), strict=True):
            style.letter(ax, PANELS[method], style.METHOD_NAMES[method])
            _draw_added_blur(ax, rows, palette.METHOD_COLOURS[method])
        top[0].set_ylabel("blur added, from the fit (px)")
        _name_the_lines(top[0], passes)
        error, residual = style.panels(outer[1], 1, 2)[0]
        style.letter(error, "d", f"error of the blur fitted after {passes} passes")
        _draw_by_method(error, by_method, lambda rows: rows["repeated_blur"] / rows["theory"] - 1)
        error.set_ylabel("relative to theory")
        style.letter(residual, "e", f"largest difference, {passes} passes against one")
        _draw_by_method(residual, by_method, lambda rows: rows["residual"], below=("dct",))
        residual.set_ylabel("relative to the maximum")
        return style.settle(figure, draft)


def _added(blur: ArrayLike, c: float) -> NDArray[np.float64]:
    """Return the blur in pixels that widened a blob of standard deviation `c` to `blur`."""
    return np.sqrt(np.maximum(np.square(np.asarray(blur, dtype=np.float64)) - c**2, 0.0))


def _draw_added_blur(ax: Axes, rows: DataFrame, colour: str) -> None:
    """Draw the blur added by many passes and by one, over the line of theory."""
    sigma, c = rows["sigma"].to_numpy(), float(rows["c"].iloc[0])
    lines: dict[str, dict[str, Any]] = {
        "theory": {"color": palette.PALE, "linewidth": 5.0},
        "repeated_blur": {"color": colour, "linewidth": 2.2},
        "single_blur": {"color": palette.INK, "linewidth": 0.7},
    }
    for depth, (column, options) in enumerate(lines.items()):
        ax.plot(sigma, _added(rows[column], c), label=column, zorder=2 + depth, **options)
    ax.axvline(
        LIMIT, ymax=0.42, color=palette.GREY, linewidth=0.7, linestyle=style.REFERENCE, zorder=1
    )
    ax.set(xlim=(0.0, sigma[-1]), xticks=np.arange(0.0, sigma[-1] + 0.01, 0.5))
    ax.set_ylim(0.0, 1.03 * _added(rows["theory"], c).max())
    ax.set_xlabel(r"$\sigma$ of one pass (px)")
    style.finish_axes(ax)


def _name_the_lines(ax: Axes, passes: int) -> None:
    """Write what the lines of the first panel are: the same in the two beside it."""
    names = {
        "theory": rf"theory, $\sqrt{{{passes}}}\,\sigma$",
        "single_blur": rf"one pass of $\sqrt{{{passes}}}\,\sigma$",
        "repeated_blur": rf"{passes} passes of $\sigma$",
    }
    handles = {line.get_label(): line for line in ax.get_lines()}
    ax.legend(
        [handles[column] for column in names],
        list(names.values()),
        loc="upper left",
        bbox_to_anchor=(0.0, 1.02),
        frameon=False,
        handlelength=1.5,
        handletextpad=0.5,
        labelspacing=0.3,
        borderaxespad=0.2,
    )
    style.direct_label(ax, LIMIT, 0.0, f"{LIMIT} px", palette.GREY, right=3.0, up=5.0, ha="left")


def _draw_by_method(
    ax: Axes,
    by_method: Mapping[str, DataFrame],
    quantity: Callable[[DataFrame], Series[float]],
    below: tuple[str, ...] = (),
) -> None:
    """Draw the size of a quantity for every method, named above its line or `below` it."""
    for method, rows in by_method.items():
        sigma, values = rows["sigma"].to_numpy(), quantity(rows).abs().to_numpy()
        colour = palette.METHOD_COLOURS[method]
        ax.plot(sigma, values, color=colour, label=method)
        name, above = style.METHOD_NAMES[method], method not in below
        style.direct_label(ax, sigma[-1], values[-1], name, colour, up=8.0 if above else -8.0)
    ax.axvline(LIMIT, color=palette.GREY, linewidth=0.7, linestyle=style.REFERENCE, zorder=1)
    ax.set_yscale("log")
    ax.margins(y=0.1)
    ax.set(xlim=(0.0, sigma[-1]), xticks=np.arange(0.0, sigma[-1] + 0.01, 0.5))
    ax.set_xlabel(r"$\sigma$ of one pass (px)")
    style.finish_axes(ax)


if __name__ == "__main__":
    raise SystemExit(main(draw, TABLES))
