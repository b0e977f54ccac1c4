"""Figure 4: which detections stay when the sampling of the scale-space changes (section 5.2)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from keystab.errors import InputError
from keystab.figures import palette, style
from keystab.figures._occurrence import Share, draw_matrix, mark_groups, occurrence
from keystab.figures._render import Tables, check_tables, main

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from pandas import DataFrame

TABLES = {
    "fig4_counts.csv": (
        "n_spo",
        "n_extrema",
        "n_common",
        "new_rate",
        "new_low",
        "new_high",
        "lost_rate",
        "lost_low",
        "lost_high",
    ),
    "fig4_keypoints.csv": ("keypoint", "stability"),
    "fig4_occurrence.csv": ("keypoint", "n_spo", "detected"),
    "fig4_summary.csv": ("quantity", "value", "note"),
}
"""Files read, with the columns that they must have."""

FLOOR = 10.0
"""Per cent: the level at which the paper sees the rates settle; drawn as a guide."""


def draw(tables: Tables, draft: bool = False) -> Figure:
    """Draw counts, rates of new and lost detections and the occurrence matrix.

    Parameters
    ----------
    tables : mapping
        ``fig4_counts``: one row per sampling; ``fig4_keypoints``: one row per unique keypoint;
        ``fig4_occurrence``: one row per unique keypoint and sampling; ``fig4_summary``: the shares
        of stable and unstable keypoints and what is meant by them.
    draft : bool
        Say on the figure that its numbers come from quick settings.

    Returns
    -------
    matplotlib Figure
        a: detections against ``n_spo``; b: rates of new and lost detections with Wilson bands;
        c: occurrence matrix, a row per sampling and a column per unique keypoint; d: its columns
        in increasing order of stability and coloured by it, the unstable and the stable ones
        underlined. Keypoints of the same stability are
        ordered by the mean ``n_spo`` at which they are seen.

    Raises
    ------
    InputError
        If a table is unusable, the occurrence matrix has holes or a share is not in the summary.
    """
    check_tables(tables, TABLES)
    counts = tables["fig4_counts"].sort_values("n_spo")
    seen = occurrence(tables["fig4_occurrence"], tables["fig4_keypoints"], "n_spo", "fig4")
    shares = _shares(tables["fig4_summary"])
    with style.context():
        from matplotlib.colors import ListedColormap

        figure = style.new_figure(5.9)
        outer = figure.add_gridspec(2, 1, height_ratios=(1.0, 1.75), hspace=0.03)
        number, rates = style.panels(outer[0], 1, 2, wspace=0.04)[0]
        _draw_counts(number, counts)
        _draw_rates(rates, counts)
        lower = outer[1].subgridspec(2, 2, width_ratios=(1.0, 0.012), wspace=0.01)
        matrix, ordered = figure.add_subplot(lower[0, 0]), figure.add_subplot(lower[1, 0])
        style.letter(matrix, "c", "occurrence of each unique keypoint at each sampling")
        black = np.where(seen.detected, 1.0, np.nan)
        draw_matrix(matrix, black, ListedColormap([palette.INK]))
        matrix.set_xlabel("unique keypoints")
        style.letter(ordered, "d", "the same, ordered and coloured by stability")
        image = draw_matrix(ordered, seen.coloured(), palette.stability_map())
        for ax in (matrix, ordered):
            _label_rows(ax, seen.sets)
        stable = f"{shares['stable']}, at all of them: {shares['always'].percent}"
        groups = {
            "unstable": (shares["unstable"], str(shares["unstable"])),
            "stable": (shares["stable"], stable),
        }
        mark_groups(ordered, len(seen.stability), groups)
        bar = figure.colorbar(image, cax=figure.add_subplot(lower[1, 1]), label="stability")
        bar.outline.set_visible(False)
        return style.settle(figure, draft)


def _shares(summary: DataFrame) -> dict[str, Share]:
    """Return the shares of unique keypoints that the summary tells, by the name of the group."""
    rows = summary.set_index("quantity")
    shares = {}
    for group in ("unstable", "stable", "always"):
        if f"share_{group}" not in rows.index:
            raise InputError(
                f"fig4_summary.csv: lacks the quantity share_{group}; remake the table"
            )
        value = float(rows["value"][f"share_{group}"])
        shares[group] = Share(value, str(rows["note"][f"share_{group}"]).removeprefix("detected "))
    return shares


def _draw_counts(ax: Axes, counts: DataFrame) -> None:
    """Draw the number of extrema, and of those that are compared."""
    style.letter(ax, "a", "number of discrete extrema")
    n_spo = counts["n_spo"].to_numpy()
    for column, text, colour in (
        ("n_extrema", "all", palette.GREY),
        ("n_common", "in the common scale range, inside the margin", palette.INK),
    ):
        ax.plot(n_spo, counts[column], "o-", color=colour, label=column)
        style.direct_label(ax, n_spo[-1], counts[column].iloc[-4:].max(), text, colour, up=8.0)
    ax.set_ylim(0.0, 1.12 * counts["n_extrema"].max())
    ax.set_ylabel("extrema")
    style.sampling_axis(ax, n_spo)
    style.finish_axes(ax)


def _draw_rates(ax: Axes, counts: DataFrame) -> None:
    """Draw the rates of new and lost detections with their 95 % bands."""
    style.letter(ax, "b", "new and lost extrema")
    n_spo = counts["n_spo"].to_numpy()
    meaning = {"new": "new: not at the next coarser one", "lost": "lost: not at the next finer one"}
    for line, (change, text) in enumerate(meaning.items()):
        rate, low, high = (
            100 * counts[f"{change}_{part}"].to_numpy() for part in ("rate", "low", "high")
        )
        colour = palette.CHANGE_COLOURS[change]
        ax.fill_between(n_spo, low, high, color=colour, alpha=0.15, linewidth=0)
        face = colour if change == "new" else "white"
        ax.plot(n_spo, rate, "o-", color=colour, markerfacecolor=face, label=change)
        place = {"transform": ax.transAxes, "ha": "right", "va": "top"}
        ax.text(1.0, 0.98 - 0.1 * line, text, color=colour, fontsize=style.SMALL, **place)
    ax.axhline(FLOOR, color=palette.GREY, linewidth=0.7, linestyle=style.REFERENCE, zorder=1)
    text = f"floor in the paper: {FLOOR:g} %"
    style.direct_label(ax, n_spo[-1], FLOOR, text, palette.GREY, up=5.0)
    highest = 100 * np.nanmax(counts[["new_high", "lost_high"]].to_numpy(dtype=np.float64))
    ax.set_ylim(0.0, 1.2 * max(float(highest), FLOOR))  # leaves room for the text
    ax.set_ylabel(style.CHANGES_AXIS)
    style.sampling_axis(ax, n_spo)
    style.finish_axes(ax)


def _label_rows(ax: Axes, n_spo: NDArray[np.int64]) -> None:
    """Name some rows of an occurrence matrix by their sampling."""
    rows = np.arange(0, len(n_spo), -(-len(n_spo) // 5))
    ax.set_yticks(rows, [str(n) for n in n_spo[rows]])
    ax.set_ylabel(style.N_SPO_AXIS)


if __name__ == "__main__":
    raise SystemExit(main(draw, TABLES))
