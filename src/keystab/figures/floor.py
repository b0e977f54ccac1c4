"""Figure floor: what makes extrema come and go at any density of the sampling (section 5.2)."""

from __future__ import annotations

import itertools
import textwrap
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from keystab.figures import palette, style
from keystab.figures._render import Tables, check_tables, main
from keystab.figures._sweep_panels import label_ends

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from pandas import DataFrame

_ENDS = ("new_rate", "new_low", "new_high", "lost_rate", "lost_low", "lost_high")
_ALWAYS = ("share_always", "low_always", "high_always")
CHOICES = ("matching", "range", "epsilon", "limit", "unique_set")
"""What a reading chooses."""

TABLES = {
    "floor_rates.csv": ("variant", "n_spo", "new_rate", "new_low", "new_high"),
    "floor_summary.csv": ("variant", *_ENDS, *_ALWAYS),
    "floor_variants.csv": ("variant", "differs_in"),
    "floor_readings.csv": (
        *("scene", "variant", *CHOICES, "n_choices", *_ENDS, *_ALWAYS),
        *("reaches_rates", "reaches_always", "reaches"),
    ),
    "floor_causes.csv": ("matching", "n_spo", "change", "cause", "rate"),
}
"""Files read, with the columns that they must have."""

RATE, ALWAYS = (9.0, 11.0), (15.0, 20.0)
"""Per cent: the paper's rates at fine samplings, and its share of keypoints found at all."""

LEAST = 0.8
"""Per cent: rates are drawn from here on, and smaller ones here."""

DESCRIBED = (
    *("usual", "epsilon_1e7", "epsilon_1e6", "epsilon_1e5", "cosine", "float64_view", "bits_16"),
    *("bits_8", "single", "single_255", "range_255", "closer", "closer_1e6", "sharper"),
    *("single_sums", "single_transforms", "single_transforms_prime"),
)
"""Variants that are named by what they differ in, those of further pictures too; others go by their
own name."""

DRAWN = ("epsilon_1e5", "epsilon_1e6", "epsilon_1e7", "usual")
"""Variants whose rates are drawn against the sampling."""

CAUSE_NAMES = {
    "edge": "edge of the range",
    "degenerate": "nearly degenerate",
    "second": "second detection",
    "merged": "merged pair",
    "missed": "missed",
    "false": "no extremum",
}
"""Why extrema come and go, in words, in the order of the bars."""

MATCHING_NAMES = {"any": "any counterpart", "one-to-one": "one-to-one"}
MARKERS = {"any": "o", "one-to-one": "s"}


def draw(tables: Tables, draft: bool = False) -> Figure:
    """Draw all readings against the paper's numbers, the causes of changes, and all variants.

    Parameters
    ----------
    tables : mapping
        ``floor_readings``: one row per reading of each run; ``floor_causes``: one per sampling,
        change and cause; ``floor_rates``: one per variant and sampling; ``floor_summary``: one per
        variant; ``floor_variants``: what each differs in, in words.
    draft : bool
        Say on the figure that its numbers come from quick settings.

    Returns
    -------
    matplotlib Figure
        a: for every reading of the usual run the share of keypoints found at all samplings against
        the mean of the rates of new and lost extrema, with the paper's numbers; b, c: readings that
        differ from the usual one in one choice, and those that reach the paper's numbers with the
        fewest, with intervals; d, e: new (up) and lost (down) extrema by cause against ``n_spo``;
        f: rate of new extrema against ``n_spo`` for four tolerances; g, h: the usual reading in
        every variant.

    Raises
    ------
    InputError
        If a table is unusable.
    """
    check_tables(tables, TABLES)
    summary, readings = tables["floor_summary"], _own(tables["floor_readings"])
    known = zip(*(tables["floor_variants"][key] for key in ("variant", "differs_in")), strict=True)
    names = {str(name): str(words) for name, words in known if _is_described(str(name))}
    listed = _listed(readings)
    labels = [_words(row, listed.iloc[0]) for _, row in listed.iterrows()]
    heights = (0.15 * _places(labels)[1] + 1.0, 1.75, 0.2, 0.128 * len(summary) + 0.7)
    with style.context():
        figure = style.new_figure(sum(heights))
        rows = figure.add_gridspec(4, 1, height_ratios=heights)
        first = rows[0].subgridspec(1, 3, width_ratios=(1.5, 0.8, 0.5), wspace=0.03)
        _draw_all(figure.add_subplot(first[0]), readings)
        titles = ("one choice, and enough", "always")
        panels = [figure.add_subplot(cell) for cell in (first[1], first[2])]
        _draw_rows(panels, "bc", titles, listed, labels)
        causes = style.panels(rows[1], 1, 2, sharey=True)[0]
        for ax, letter, matching in zip(causes, "de", MATCHING_NAMES, strict=True):
            style.letter(ax, letter, f"why, {MATCHING_NAMES[matching]}")
            _draw_causes(ax, tables["floor_causes"], matching)
        causes[0].set_ylabel("lost (%)      new (%)")
        _name_causes(figure.add_subplot(rows[2]))
        third = rows[3].subgridspec(1, 3, width_ratios=(1.05, 0.85, 0.55), wspace=0.03)
        _draw_rates(figure.add_subplot(third[0]), tables["floor_rates"], names)
        panels = [figure.add_subplot(cell) for cell in (third[1], third[2])]
        labels = [names.get(name, name) for name in summary["variant"]]
        titles = ("all variants", "always")
        _draw_rows(panels, "gh", titles, summary, labels)
        return style.settle(figure, draft)


def _own(readings: DataFrame) -> DataFrame:
    """Readings of the first run of the table."""
    first = readings.iloc[0]
    own = (readings["scene"] == first["scene"]) & (readings["variant"] == first["variant"])
    rows: DataFrame = readings[own].reset_index(drop=True)
    return rows


def _is_described(name: str) -> bool:
    return any(name == known or name.endswith(f"_{known}") for known in DESCRIBED)


def _listed(readings: DataFrame) -> DataFrame:
    """Those that differ from the usual one in one choice at most, and the first to reach all."""
    reach = readings[readings["reaches"]]
    fewest = reach["n_choices"].min()
    shown = (readings["n_choices"] <= 1) | (readings["reaches"] & (readings["n_choices"] == fewest))
    rows: DataFrame = readings[shown].sort_values("n_choices", kind="stable")
    return rows


def _words(row: Any, usual: Any) -> str:
    """Say what a reading differs in."""
    words = {
        "matching": str(row["matching"]),
        "range": {"grid": "grid scale", "soft": "soft range"}.get(row["range"], "refined scale"),
        "epsilon": _tolerance(row["epsilon"]),
        "limit": f"within {row['limit']:g} px",
        "unique_set": f"{row['unique_set']} set",
    }
    text = ", ".join(words[name] for name in CHOICES if row[name] != usual[name]) or "usual"
    return textwrap.fill(text, 22)


def _tolerance(value: float) -> str:
    return f"tolerance {value:.3g}".replace("e-0", "e-") if value else "no tolerance"


def _draw_all(ax: Axes, readings: DataFrame) -> None:
    """Draw one mark per reading, where its rates and its share of keypoints put it."""
    from matplotlib.patches import Rectangle

    style.letter(ax, "a", f"all {len(readings)} readings")
    low, high = RATE[0], ALWAYS[0]
    box = Rectangle(
        (low, high), RATE[1] - low, ALWAYS[1] - high, facecolor=palette.PALE, linewidth=0, zorder=0
    )
    ax.add_patch(box)
    tolerances = sorted(readings["epsilon"].unique())
    limits = sorted(readings["limit"].unique())
    shades = {each: palette.shade(k / max(len(tolerances) - 1, 1)) for k, each in
              enumerate(tolerances)}  # fmt: skip
    rate = np.maximum(50 * (readings["new_rate"] + readings["lost_rate"]), LEAST)
    always = 100 * readings["share_always"]
    for matching, scale in itertools.product(MARKERS, readings["range"].unique()):
        rows = readings[(readings["matching"] == matching) & (readings["range"] == scale)]
        colours = [shades[each] for each in rows["epsilon"]]
        sizes = 5.0 + 6.0 * np.searchsorted(limits, rows["limit"])
        ax.scatter(
            rate[rows.index], always[rows.index], s=sizes, marker=MARKERS[matching],
            facecolors="none" if scale == "grid" else colours, edgecolors=colours,
            linewidths=0.8, alpha=0.45 if scale == "soft" else 1.0, label=f"{matching}, {scale}",
        )  # fmt: skip
    ax.set_xscale("log")
    ticks = (1, 2, 5, 10, 20, 50, 100)
    ax.set_xticks(ticks, [str(tick) for tick in ticks])
    ax.set_xlim(0.9 * LEAST, 1.2 * max(float(np.nan_to_num(rate).max()), 20.0))
    ax.set_xlabel(style.CHANGES_AXIS)
    ax.set_ylabel(style.ALWAYS_AXIS)
    reach = readings[readings["reaches"]]
    ax.scatter(
        rate[reach.index], always[reach.index], s=60.0, facecolors="none",
        edgecolors=palette.CHANGE_COLOURS["lost"], linewidths=1.0, label="reaches",
    )  # fmt: skip
    signs = ("round: any", "square: one-to-one", "open: grid scale", "pale: soft range",
             f"size: {limits[0]:g} to {limits[-1]:g} px")  # fmt: skip
    left: list[tuple[str, Any]] = [("grey: the paper", palette.GREY)]
    left += [(_tolerance(each), shades[each]) for each in tolerances]
    _list_above(ax, left, [(sign, palette.INK) for sign in signs], float(always.max()))
    style.finish_axes(ax)


def _list_above(
    ax: Axes, left: list[tuple[str, Any]], right: list[tuple[str, Any]], highest: float
) -> None:
    """Write two lists of names in their colours above all that is drawn."""
    step, lines = 0.05, max(len(left), len(right))
    ax.set_ylim(-2.0, (highest + 4.0) / (1.0 - step * lines))
    ax.set_yticks([tick for tick in range(0, 101, 20) if tick <= highest + 4.0])
    for names, x, side in ((left, 0.02, "left"), (right, 0.99, "right")):
        for line, (text, colour) in enumerate(names):
            ax.text(x, 0.99 - step * line, text, color=colour, transform=ax.transAxes,
                    fontsize=style.SMALL, ha=side, va="top")  # fmt: skip


def _draw_rows(
    panels: list[Axes], letters: str, titles: tuple[str, str], table: DataFrame, labels: list[str]
) -> None:
    """Draw new and lost extrema, and keypoints found at all samplings, a line per row."""
    settled, always = panels
    place, end = _places(labels)
    style.letter(settled, letters[0], titles[0])
    style.letter(always, letters[1], titles[1])
    for change, up in (("new", -0.13), ("lost", 0.13)):
        colour = palette.CHANGE_COLOURS[change]
        rate, low, high = (
            np.maximum(100 * table[f"{change}_{part}"].to_numpy(float), LEAST)
            for part in ("rate", "low", "high")
        )
        settled.hlines(place + up, low, high, color=colour, linewidth=1.0)
        face = colour if change == "new" else "white"
        settled.plot(
            rate, place + up, "o", color=colour, markerfacecolor=face, label=change, markersize=2.8
        )
    low, high = (100 * table[f"{end}_always"].to_numpy(float) for end in ("low", "high"))
    always.hlines(place, low, high, color=palette.INK, linewidth=1.0)
    share = 100 * table["share_always"].to_numpy(float)
    always.plot(share, place, "o", color=palette.INK, label="always", markersize=2.8)
    settled.set_yticks(place, labels)
    always.set_yticks(place, [])
    for ax, (least, most) in ((settled, RATE), (always, ALWAYS)):
        ax.axvspan(least, most, color=palette.PALE, linewidth=0, zorder=0)
        ax.set_ylim(end, -0.6)
        style.finish_axes(ax)
    settled.set_xscale("log")
    settled.set_xticks([1, 10, 100], ["1", "10", "100"])
    settled.set_xlim(LEAST, 100.0)
    settled.set_xlabel(f"{style.CHANGES_AXIS}\n(full: new, open: lost)")
    always.set_xlim(0.0, 100.0)
    always.set_xlabel(style.ALWAYS_AXIS.replace(" samplings", "\nsamplings"))


def _places(labels: list[str]) -> tuple[NDArray[np.float64], float]:
    """Place of each row, of which each line of its label takes one, and the end of the last."""
    lines = np.array([1 + 0.85 * label.count("\n") for label in labels])
    ends = lines.cumsum() - 0.5
    return ends - lines / 2, float(ends[-1])


def _draw_causes(ax: Axes, causes: DataFrame, matching: str) -> None:
    """Draw stacked bars per sampling, new extrema upwards and lost ones downwards."""
    own = causes[causes["matching"] == matching]
    samplings = np.unique(own["n_spo"])
    for change, sign in (("new", 1.0), ("lost", -1.0)):
        table = own[own["change"] == change].pivot(index="n_spo", columns="cause", values="rate")
        table = table.reindex(samplings).fillna(0.0)
        base = np.zeros(len(samplings))
        for cause, name in CAUSE_NAMES.items():
            height = sign * 100 * table[cause].to_numpy(float)
            ax.bar(samplings, height, bottom=base, width=0.8, linewidth=0,
                   color=palette.CHANGE_CAUSE_COLOURS[cause],
                   label=name if change == "new" else f"{name}, lost")  # fmt: skip
            base += height
    ax.axhline(0.0, color=palette.INK, linewidth=0.6)
    for value in (-10.0, 10.0):
        ax.axhline(value, color=palette.GREY, linewidth=0.7, linestyle=style.REFERENCE, zorder=0)
    ax.yaxis.set_major_formatter(lambda value, _: f"{abs(value):g}")
    style.sampling_axis(ax, samplings)
    style.finish_axes(ax)


def _name_causes(ax: Axes) -> None:
    """Say in a line of its own what the colours of the bars are."""
    from matplotlib.patches import Patch

    patches = [Patch(color=palette.CHANGE_CAUSE_COLOURS[cause], linewidth=0, label=name)
               for cause, name in CAUSE_NAMES.items()]  # fmt: skip
    ax.legend(handles=patches, loc="center", ncols=len(patches), frameon=False, borderpad=0.0,
              handlelength=0.8, handleheight=0.8, handletextpad=0.4)  # fmt: skip
    ax.set_label("causes")
    ax.set_axis_off()


def _draw_rates(ax: Axes, rates: DataFrame, names: Mapping[str, str]) -> None:
    """Draw the rates of new extrema against the sampling."""
    style.letter(ax, "f", "new extrema, by tolerance")
    shown = [name for name in DRAWN if (rates["variant"] == name).any()]
    ends = {"the paper": (10.0, palette.GREY)}
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
        ends[text] = (float(rate[-1]), colour)
    ax.axhline(10.0, color=palette.GREY, linewidth=0.7, linestyle=style.REFERENCE, zorder=1)
    ax.set_ylim(bottom=0.0)
    samplings = np.unique(rates["n_spo"])
    ax.set_xlim(samplings[0] - 0.5, samplings[-1] + 0.2)
    style.sampling_axis(ax, samplings)
    ax.set_ylabel("new extrema (%)")
    style.finish_axes(ax)
    label_ends(ax, ends, "tolerance", 0.045)


if __name__ == "__main__":
    raise SystemExit(main(draw, TABLES))
