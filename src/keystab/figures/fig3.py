"""Figure 3: how the sampling of the scale-space changes the number of extrema (section 5.1)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from keystab.errors import InputError
from keystab.figures import palette, style
from keystab.figures._render import Tables, check_tables, main

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.colors import Colormap, Normalize
    from matplotlib.figure import Figure
    from pandas import DataFrame

TABLES = {
    "fig3.csv": (
        "n_spo",
        "delta_min",
        "balanced",
        "n_extrema",
        "n_common",
        "n_unique",
        "median_condition",
        "q25_condition",
        "q75_condition",
    )
}
"""Files read, with the columns that they must have."""

COUNTS = {
    "n_extrema": ("a", "discrete extrema"),
    "n_common": ("b", "in the common scale range"),
    "n_unique": ("c", "unique, in the common range"),
}
"""Letter and title of the heat map of each count."""

SIFT = (3, 0.5)
"""Scales per octave and sampling step of SIFT, which the heat maps outline."""


def draw(tables: Tables, draft: bool = False) -> Figure:
    """Draw counts and condition numbers over the grid of samplings and along the balanced curve.

    Parameters
    ----------
    tables : mapping
        ``fig3``: one row per sampling. Steps that two or more ``n_spo`` share make the grid; rows
        marked ``balanced`` make the curve, on or off the grid.
    draft : bool
        Say on the figure that its numbers come from quick settings.

    Returns
    -------
    matplotlib Figure
        a to c: heat maps of the counts, one colour scale for all; d: median condition number of
        the 3D Hessian on a logarithmic colour scale; e: the balanced curve, and the median and
        quartiles of the condition number along it.

    Raises
    ------
    InputError
        If the table is unusable, holds no grid, no balanced sampling or no extremum.
    """
    check_tables(tables, TABLES)
    table = tables["fig3"]
    curve = table[table["balanced"].astype(bool)].sort_values("n_spo")
    grid = _grid(table)
    if len(curve) == 0:
        raise InputError("fig3.csv: no row is marked balanced; remake the table")
    if len(grid) == 0:
        raise InputError("fig3.csv: no two n_spo share a delta_min, so there is no grid to draw")
    if not (grid["n_extrema"] > 0).any() or not (curve["n_extrema"] > 0).any():
        raise InputError(
            "fig3.csv: no sampling has an extremum, so there is nothing to draw; give a picture "
            "with more detail"
        )
    limits = grid[list(COUNTS)].min().min(), grid[list(COUNTS)].max().max()
    with style.context():
        from matplotlib.colors import LogNorm, Normalize

        figure = style.new_figure(7.1)
        outer = figure.add_gridspec(2, 1, height_ratios=(2.55, 1.0), hspace=0.04)
        maps = style.panels(outer[0], 2, 2)
        for ax, (column, (name, title)) in zip(maps.flat, COUNTS.items(), strict=False):
            style.letter(ax, name, title)
            counted = _heat_map(ax, grid, column, palette.count_map(), Normalize(*limits))
            _mark_samplings(ax, grid, curve)
        condition = grid["median_condition"]
        scale = LogNorm(condition.min(), condition.max())
        style.letter(maps[1, 1], "d", "median condition number of the Hessian")
        conditions = _heat_map(maps[1, 1], grid, "median_condition", palette.condition_map(), scale)
        _mark_samplings(maps[1, 1], grid, curve)
        for ax in maps[:, 1]:
            ax.set(ylabel="", yticklabels=[])
        for ax in maps[0]:
            ax.set(xlabel="", xticklabels=[])
        _colour_bar(figure, counted, maps[0, 1], "keypoints, (a) to (c)")
        _colour_bar(figure, conditions, maps[1, 1], "condition number", format="%g")
        _key(maps[0, 0])
        steps, conditions = style.panels(outer[1], 1, 2)[0]
        _draw_curve(steps, curve)
        _draw_condition(conditions, curve)
        return style.settle(figure, draft)


def _grid(table: DataFrame) -> DataFrame:
    """Return the rows whose ``delta_min`` occurs for two or more ``n_spo``."""
    rounded = table.assign(delta_min=table["delta_min"].round(9))
    shared = rounded.groupby("delta_min")["n_spo"].transform("nunique") > 1
    return rounded[shared].drop_duplicates(["n_spo", "delta_min"])


def _heat_map(ax: Axes, grid: DataFrame, column: str, colours: Colormap, norm: Normalize) -> Any:
    """Draw one column over the grid, steps upwards, with the number written in each cell."""
    cells = grid.pivot(index="delta_min", columns="n_spo", values=column).astype(float)
    values = cells.to_numpy()
    image = ax.pcolormesh(values, cmap=colours, norm=norm, edgecolor="white", linewidth=0.4)
    decimals = 1 if column == "median_condition" else 0
    for (i, j), value in np.ndenumerate(values):
        if np.isfinite(value):
            text = f"{value:.{decimals if value < 99.95 else 0}f}"
            colour = palette.readable_on(colours(norm(value)))
            place = {"ha": "center", "va": "center", "fontsize": style.SMALL}
            ax.text(j + 0.5, i + 0.5, text, color=colour, **place)
    ax.set_yticks(np.arange(len(cells.index)) + 0.5, [f"{step:.3f}" for step in cells.index])
    ax.set_xticks(np.arange(len(cells.columns)) + 0.5, [str(n_spo) for n_spo in cells.columns])
    ax.tick_params(length=0, pad=3)
    ax.spines[:].set_visible(False)
    ax.set(xlabel=style.N_SPO_AXIS, ylabel=f"{style.DELTA_MIN} (px)")
    return image


def _mark_samplings(ax: Axes, grid: DataFrame, curve: DataFrame) -> None:
    """Draw the balanced curve and outline SIFT's sampling."""
    from matplotlib.patches import Rectangle

    samplings, steps = (np.sort(grid[name].unique()) for name in ("n_spo", "delta_min"))

    def column(n_spo: Any) -> Any:
        return np.interp(n_spo, samplings, np.arange(len(samplings)) + 0.5)

    def row(delta_min: Any) -> Any:
        return np.interp(np.log(delta_min), np.log(steps), np.arange(len(steps)) + 0.5)

    inside = curve["n_spo"].between(samplings[0], samplings[-1])
    points = np.stack([column(curve.loc[inside, "n_spo"]), row(curve.loc[inside, "delta_min"])])
    x, y = _dots(points)
    ax.plot(x, y, ".", color=palette.BALANCED_COLOUR, markersize=2.2, label="balanced")
    n_spo, delta_min = SIFT
    if n_spo in samplings and steps[0] <= delta_min <= steps[-1]:
        corner = column(n_spo) - 0.5, row(delta_min) - 0.5
        outline: dict[str, Any] = {"edgecolor": palette.INK, "linewidth": 1.4, "facecolor": "none"}
        ax.add_patch(Rectangle(corner, 1, 1, clip_on=False, zorder=5, label="SIFT", **outline))


def _dots(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return dots along a line of `points` (2, n) in units of cells, off the cells' numbers."""
    along = np.append(0.0, np.hypot(*np.diff(points, axis=1)).cumsum())
    places = np.arange(0.0, along[-1], 0.11)
    dots = np.stack([np.interp(places, along, values) for values in points])
    from_centre = np.abs(dots % 1 - 0.5)
    return dots[:, (from_centre[0] > 0.35) | (from_centre[1] > 0.27)]


def _key(ax: Axes) -> None:
    """Say above the first heat map what the dotted line and the outline mean."""
    handles, labels = ax.get_legend_handles_labels()
    ax.legend(
        handles,
        labels,
        numpoints=4,
        loc="lower right",
        bbox_to_anchor=(1.0, 0.99),
        ncols=2,
        frameon=False,
        borderpad=0.2,
        borderaxespad=0.0,
        handlelength=1.5,
        handletextpad=0.4,
        columnspacing=0.9,
    )


def _colour_bar(
    figure: Figure, mappable: Any, ax: Axes, label: str, format: str | None = None
) -> None:
    """Draw a slim colour bar to the right of a heat map."""
    bar = figure.colorbar(mappable, ax=ax, aspect=28, pad=0.02, label=label, format=format)
    bar.outline.set_visible(False)


def _draw_curve(ax: Axes, curve: DataFrame) -> None:
    """Draw the balanced step against the scales per octave, and SIFT's sampling."""
    style.letter(ax, "e", "balanced sampling")
    colour = palette.BALANCED_COLOUR
    ax.plot(curve["n_spo"], curve["delta_min"], "o:", color=colour, label="balanced")
    ax.plot(*SIFT, "s", markersize=7, markerfacecolor="none", color=palette.INK, label="SIFT")
    style.direct_label(ax, *SIFT, "SIFT", palette.INK, right=8.0, up=1.0, ha="left")
    style.sampling_axis(ax, curve["n_spo"])
    ax.set_ylabel(f"{style.DELTA_MIN} (px)")
    ax.set_ylim(0.0, None)
    style.finish_axes(ax)


def _draw_condition(ax: Axes, curve: DataFrame) -> None:
    """Draw the median of the condition number along the curve, and its quartiles as a band."""
    n_spo, colour = curve["n_spo"].to_numpy(), palette.CONDITION_COLOUR
    ax.set_label("e condition")
    ax.set_title("condition number of the Hessian along it", loc="left")
    low, high = curve["q25_condition"].to_numpy(), curve["q75_condition"].to_numpy()
    ax.fill_between(n_spo, low, high, color=colour, alpha=0.18, linewidth=0, label="quartiles")
    ax.plot(n_spo, curve["median_condition"], "o-", color=colour, label="median_condition")
    style.direct_label(ax, n_spo[-1], curve["median_condition"].iloc[-1], "median", colour, up=6.0)
    style.direct_label(ax, n_spo[-1], high[-1], "quartiles", colour, up=-6.0)
    style.sampling_axis(ax, curve["n_spo"])
    ax.set_ylabel("condition number")
    ax.set_ylim(0.0, None)
    style.finish_axes(ax)


if __name__ == "__main__":
    raise SystemExit(main(draw, TABLES))
