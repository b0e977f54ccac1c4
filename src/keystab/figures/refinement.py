"""Figure refinement: what the quadratic refinement keeps and loses of the true extrema."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from keystab.figures import palette, style
from keystab.figures._render import Tables, check_tables, main

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from pandas import DataFrame

TABLES = {
    "refinement_choices.csv": (
        "n_spo",
        "move",
        "scale_moves",
        "max_offset",
        "max_iterations",
        "kept_true",
        "lost_true",
        "kept_false",
        "lost_false",
    )
}
"""Files read, with the columns that they must have."""

QUANTITIES = {
    "lost": ("true ones lost", "true extrema lost (%)"),
    "kept": ("false ones kept", "false among the kept (%)"),
    "removed": ("false ones removed", "false extrema removed (%)"),
}
"""Title and axis of the columns of panels."""

WAYS: dict[tuple[str, bool], tuple[str, dict[str, Any]]] = {
    ("nearest", True): ("to the nearest sample", {"linewidth": 1.6}),
    ("nearest", False): (
        "the same, scale fixed",
        {"linewidth": 0.6, "marker": "o", "markersize": 3.2, "markerfacecolor": "white"},
    ),
    ("unit_step", True): (
        "one step along each axis",
        {"linewidth": 0.6, "marker": "x", "markersize": 3.2},
    ),
}
"""Ways to move (how, and in scale too or not): name, and look of the line."""


def draw(tables: Tables, draft: bool = False) -> Figure:
    """Draw what is lost, kept and removed against the number of models.

    Parameters
    ----------
    tables : mapping
        ``refinement_choices``: one row per sampling, way to move, ``M_offset`` and ``N_interp``.
    draft : bool
        Say on the figure that its numbers come from quick settings.

    Returns
    -------
    matplotlib Figure
        A row of three panels for each of two samplings.

    Raises
    ------
    InputError
        If the table is unusable.
    """
    check_tables(tables, TABLES)
    table = tables["refinement_choices"]
    shares = _shares(table)
    samplings = sorted(table["n_spo"].unique())
    with style.context():
        figure = style.new_figure(1.95 * len(samplings) + 0.6)
        grid = style.panels(
            figure.add_gridspec(1, 1)[0], len(samplings), 3, hspace=0.03, wspace=0.03
        )
        for row, n_spo in enumerate(samplings):
            for column, quantity in enumerate(QUANTITIES):
                ax = grid[row, column]
                title, axis = QUANTITIES[quantity]
                title = f"{title}, {style.N_SPO} = {n_spo}"
                style.letter(ax, "abcdef"[3 * row + column], title)
                _draw_quantity(ax, shares[shares["n_spo"] == n_spo], quantity)
                ax.set_ylabel(axis)
                if row == len(samplings) - 1:
                    ax.set_xlabel(style.N_INTERP_AXIS)
        _name_offsets(grid[0, 2], sorted(table["max_offset"].unique()))
        _name_ways(figure)
        return style.settle(figure, draft)


def _shares(table: DataFrame) -> DataFrame:
    """Add the shares that the panels draw, in per cent."""
    true = table["kept_true"] + table["lost_true"]
    false = table["kept_false"] + table["lost_false"]
    kept = table["kept_true"] + table["kept_false"]
    return table.assign(
        lost=100 * table["lost_true"] / true.where(true > 0),
        kept=100 * table["kept_false"] / kept.where(kept > 0),
        removed=100 * table["lost_false"] / false.where(false > 0),
    )


def _draw_quantity(ax: Axes, rows: DataFrame, quantity: str) -> None:
    """Draw one quantity for all limits and ways; infinity stands at the right end."""
    most = rows["max_iterations"].max()
    finite = np.sort(rows["max_iterations"].unique())[:-1]
    place = {**{n: n for n in finite}, most: finite[-1] + 2}
    for (move, scale_moves), (_, line) in WAYS.items():
        for max_offset in sorted(rows["max_offset"].unique()):
            here = rows[
                (rows["move"] == move)
                & (rows["scale_moves"] == scale_moves)
                & (rows["max_offset"] == max_offset)
            ].sort_values("max_iterations")
            x = here["max_iterations"].map(place)
            colour = palette.offset_colour(max_offset)
            ax.plot(x, here[quantity], color=colour, label=f"{move} {scale_moves} {max_offset:g}",
                    **line)  # fmt: skip
    shown = [n for n in finite if n in (1, 2, 3, 5, 10)]
    ax.set_xticks([*shown, place[most]], [*(f"{n:g}" for n in shown), "∞"])
    ax.set_ylim(bottom=0.0)
    style.finish_axes(ax)


def _name_offsets(ax: Axes, offsets: list[float]) -> None:
    """List the limits of the offset in their colours."""
    place = {"transform": ax.transAxes, "ha": "left", "va": "top", "fontsize": style.SMALL}
    ax.text(1.02, 0.97, style.M_OFFSET, **place)
    for line, offset in enumerate(offsets, 1):
        colour = palette.offset_colour(offset)
        ax.text(1.02, 0.97 - 0.1 * line, style.limit(offset), color=colour, **place)


def _name_ways(figure: Figure) -> None:
    """Say above all panels how the next model is chosen."""
    from matplotlib.lines import Line2D

    lines = [Line2D([], [], color=palette.INK, label=name, **look) for name, look in WAYS.values()]
    figure.legend(handles=lines, loc="outside upper left", ncols=len(lines), frameon=False)


if __name__ == "__main__":
    raise SystemExit(main(draw, TABLES))
