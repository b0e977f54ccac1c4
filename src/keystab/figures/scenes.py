"""Figure scenes: which claims hold on all scenes, and which depend on the family."""

from __future__ import annotations

from collections.abc import Hashable
from typing import TYPE_CHECKING, Any

import numpy as np

from keystab.errors import InputError
from keystab.figures import palette, style
from keystab.figures._render import Tables, check_tables, main

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from pandas import DataFrame

TABLES = {
    "claims_over_scenes.csv": ("claim", "kind", "share", "low", "high"),
    "claims_by_family.csv": ("claim", "family", "n_scenes", "n_holds"),
}
"""Files read, with the columns that they must have."""

TITLES = {
    "general": "General",
    "scene-dependent": "Depend on the family",
    "undecided": "Undecided",
    "generally not": "Hold on hardly any scene",
}
"""Kinds of claims that are drawn, in the order of the figure; what no scene can test is not."""

_Line = str | dict[Hashable, Any]

_ROW, _HEAD = 0.125, 1.15
_COLUMNS = 2
_SAID = ("share of scenes where it holds", "yellow: all, blue: none")


def draw(tables: Tables, draft: bool = False) -> Figure:
    """Draw a row for every claim: a square for each family, and the share of all scenes.

    Parameters
    ----------
    tables : mapping
        See `TABLES`.
    draft : bool
        Say on the figure that its numbers come from quick settings.

    Returns
    -------
    matplotlib Figure
        Panels a and b, side by side, continue each other.

    Raises
    ------
    InputError
        If a table is unusable.
    """
    check_tables(tables, TABLES)
    table, parts = tables["claims_over_scenes"], tables["claims_by_family"]
    families = list(dict.fromkeys(parts["family"]))
    holds = parts.set_index(["claim", "family"])[["n_holds", "n_scenes"]]
    lines = _lines(table)
    if not lines:
        raise InputError("claims_over_scenes.csv: no claim that a scene could test")
    high = -(-len(lines) // _COLUMNS)
    with style.context():
        figure = style.new_figure(_HEAD + _ROW * high)
        axes = style.panels(figure.add_gridspec(1, 1)[0], 1, _COLUMNS)[0]
        for number, ax in enumerate(axes):
            style.letter(ax, "ab"[number], _SAID[number])
            part = lines[number * high : (number + 1) * high]
            _draw_rows(ax, part, high, families, holds)
        return style.settle(figure, draft)


def _lines(table: DataFrame) -> list[_Line]:
    """Titles, and the claims below them, those that hold most first."""
    lines: list[_Line] = []
    for kind, title in TITLES.items():
        rows = table[table["kind"] == kind].sort_values("share", ascending=False, kind="stable")
        if len(rows):
            lines += [f"{title} ({len(rows)})", *rows.to_dict("records")]
    return lines


def _draw_rows(
    ax: Axes, lines: list[_Line], high: int, families: list[str], holds: DataFrame
) -> None:
    n = len(families)
    colours = palette.stability_map()
    ax.set_ylim(high - 0.5, -0.5)
    ax.set_xlim(-0.5, n + 5.2)
    names = [line if isinstance(line, str) else str(line["claim"]) for line in lines]
    labels = ax.set_yticks(range(len(lines)), names) and ax.get_yticklabels()
    for at, (line, label) in enumerate(zip(lines, labels, strict=True)):
        if isinstance(line, str):
            label.set_fontweight("bold")
            continue
        for x, family in enumerate(families):
            held, tested = holds.loc[(line["claim"], family)]
            colour = colours(held / tested) if tested else "white"
            edge = "white" if tested else palette.GREY
            ax.add_patch(_square(x, at, colour, edge))
        share, low, far = (n + 5.0 * float(line[name]) for name in ("share", "low", "high"))
        ax.plot([low, far], [at, at], color=palette.INK, linewidth=1.0)
        ax.plot(share, at, "o", color=palette.INK, markersize=2.4)
    ticks = [*range(n), *(n + 5.0 * np.array([0.0, 0.5, 1.0]))]
    ax.set_xticks(ticks, [*families, "0", "½", "1"], rotation=90)
    ax.xaxis.tick_top()
    ax.tick_params(length=0)
    for share in (0.2, 0.8):
        ax.axvline(n + 5.0 * share, color=palette.PALE, linewidth=0.8, zorder=0)
    for side in ax.spines.values():
        side.set_visible(False)


def _square(x: float, y: float, colour: object, edge: str) -> object:
    from matplotlib.patches import Rectangle

    return Rectangle((x - 0.5, y - 0.5), 1, 1, facecolor=colour, edgecolor=edge, linewidth=0.8)


if __name__ == "__main__":
    raise SystemExit(main(draw, TABLES))
