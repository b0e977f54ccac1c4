"""Figure floor: why some extrema come and go at any density of the sampling (section 5.2)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from keystab.figures import palette, style
from keystab.figures._render import Tables, check_tables, main

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from pandas import DataFrame

TABLES = {
    "floor_rates.csv": ("variant", "n_spo", "new_rate", "new_low", "new_high"),
    "floor_summary.csv": (
        "variant",
        "new_rate",
        "new_low",
        "new_high",
        "lost_rate",
        "lost_low",
        "lost_high",
        "share_always",
        "low_always",
        "high_always",
    ),
    "floor_variants.csv": ("variant", "differs_in"),
}
"""Files read, with the columns that they must have."""

FLOOR, ALWAYS = 10.0, 20.0
"""Per cent: the paper's rates at fine samplings, and its share of keypoints found at all."""

DESCRIBED = (
    *("usual", "epsilon_1e7", "epsilon_1e6", "epsilon_1e5", "cosine", "float64_view", "bits_16"),
    *("bits_8", "single", "single_255", "range_255", "closer", "closer_1e6"),
)
"""Variants that are named by what they differ in; others go by their own name."""

DRAWN = ("epsilon_1e5", "epsilon_1e6", "epsilon_1e7", "usual")
"""Variants whose rates are drawn against the sampling."""


def draw(tables: Tables, draft: bool = False) -> Figure:
    """Draw rates of new extrema against the sampling, and what remains of them at fine ones.

    Parameters
    ----------
    tables : mapping
        ``floor_rates``: one row per variant and sampling; ``floor_summary``: one row per variant;
        ``floor_variants``: what each differs in, in words.
    draft : bool
        Say on the figure that its numbers come from quick settings.

    Returns
    -------
    matplotlib Figure
        a: rate of new extrema against ``n_spo`` for four tolerances, with 95 % Wilson bands; b: new
        and lost extrema at fine samplings in every variant; c: share of the keypoints found at all
        samplings.

    Raises
    ------
    InputError
        If a table is unusable.
    """
    check_tables(tables, TABLES)
    summary = tables["floor_summary"]
    known = tables["floor_variants"].set_index("variant")["differs_in"].to_dict()
    names = {name: known[name] for name in DESCRIBED if name in known}
    with style.context():
        figure = style.new_figure(0.19 * len(summary) + 1.3)
        grid = figure.add_gridspec(1, 3, width_ratios=(1.2, 1.0, 0.6), wspace=0.03)
        rates, settled, always = (figure.add_subplot(cell) for cell in grid)
        _draw_rates(rates, tables["floor_rates"], names)
        _draw_settled(settled, summary, names)
        _draw_always(always, summary)
        return style.settle(figure, draft)


def _draw_rates(ax: Axes, rates: DataFrame, names: Mapping[str, str]) -> None:
    """Draw the rates of new extrema against the sampling."""
    style.letter(ax, "a", "new extrema, by tolerance")
    shown = [name for name in DRAWN if (rates["variant"] == name).any()]
    for name in shown:
        colour = palette.TOLERANCE_COLOURS[name]
        rows = rates[(rates["variant"] == name) & rates["new_rate"].notna()].sort_values("n_spo")
        if rows.empty:  # a picture so soft that no extremum exceeds this tolerance
            continue
        n_spo = rows["n_spo"].to_numpy()
        rate, low, high = (100 * rows[f"new_{part}"].to_numpy() for part in ("rate", "low", "high"))
        ax.fill_between(n_spo, low, high, color=colour, alpha=0.15, linewidth=0)
        ax.plot(n_spo, rate, "o-", color=colour, label=name)
        text = names.get(name, name).removeprefix("tolerance ").replace("no tolerance", "none")
        up = {"epsilon_1e7": 4.0, "usual": -4.0}.get(name, 0.0)  # these two all but coincide
        style.direct_label(ax, n_spo[-1], rate[-1], text, colour, right=5.0, up=up, ha="left")
    ax.axhline(FLOOR, color=palette.GREY, linewidth=0.7, linestyle=":", zorder=1)
    style.direct_label(ax, 3.0, FLOOR, "paper", palette.GREY, up=-5.0, ha="left")
    ax.set_ylim(bottom=0.0)
    samplings = np.unique(rates["n_spo"])
    ax.set_xlim(samplings[0] - 0.5, samplings[-1] + 0.28 * (samplings[-1] - samplings[0]))
    style.sampling_axis(ax, samplings)
    ax.set_ylabel("new extrema (%)")
    style.finish_axes(ax)


def _draw_settled(ax: Axes, summary: DataFrame, names: Mapping[str, str]) -> None:
    """Draw the rates at fine samplings, a line per variant."""
    style.letter(ax, "b", "at fine samplings")
    place = np.arange(len(summary))
    for change, up in (("new", -0.13), ("lost", 0.13)):
        colour = palette.CHANGE_COLOURS[change]
        rate, low, high = (
            100 * summary[f"{change}_{part}"].to_numpy() for part in ("rate", "low", "high")
        )
        ax.hlines(place + up, low, high, color=colour, linewidth=1.0)
        face = colour if change == "new" else "white"
        ax.plot(rate, place + up, "o", color=colour, markerfacecolor=face, label=change)
    for line, (change, text) in enumerate((("new", "new (full)"), ("lost", "lost (open)"))):
        ax.text(
            1.0,
            0.30 - 0.05 * line,
            text,
            transform=ax.transAxes,
            color=palette.CHANGE_COLOURS[change],
            fontsize=style.SMALL,
            ha="right",
        )
    _guide(ax, FLOOR)
    ax.set_yticks(place, [names.get(name, name) for name in summary["variant"]])
    ax.set_ylim(len(summary) - 0.5, -1.0)
    ax.set_xlim(left=0.0)
    ax.set_xlabel("extrema (%)")
    style.finish_axes(ax)


def _draw_always(ax: Axes, summary: DataFrame) -> None:
    """Draw the share of keypoints found at all samplings, a line per variant."""
    style.letter(ax, "c", "always found")
    place = np.arange(len(summary))
    low, high = (100 * summary[f"{end}_always"].to_numpy() for end in ("low", "high"))
    ax.hlines(place, low, high, color=palette.INK, linewidth=1.0)
    ax.plot(100 * summary["share_always"], place, "o", color=palette.INK, label="always")
    _guide(ax, ALWAYS)
    ax.set_yticks(place, [])
    ax.set_ylim(len(summary) - 0.5, -1.0)
    ax.set_xlim(0.0, 100.0)
    ax.set_xlabel("keypoints (%)")
    style.finish_axes(ax)


def _guide(ax: Axes, value: float) -> None:
    """Mark what the paper reports."""
    ax.axvline(value, color=palette.GREY, linewidth=0.7, linestyle=":", zorder=1)
    ax.text(
        value,
        0.995,
        " paper",
        transform=ax.get_xaxis_transform(),
        color=palette.GREY,
        fontsize=style.SMALL,
        va="top",
    )


if __name__ == "__main__":
    raise SystemExit(main(draw, TABLES))
