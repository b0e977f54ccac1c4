"""Figure 4: which detections stay when the sampling of the scale-space changes (section 5.2)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from keystab.errors import InputError
from keystab.figures import palette, style
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


class Occurrence(NamedTuple):
    """Which unique keypoint is detected at which sampling.

    ``detected[i, j]`` says whether keypoint j is seen at ``n_spo[i]``; ``stability[j]`` is the
    share of samplings that see it; ``order`` lists the keypoints from least to most stable.
    """

    n_spo: NDArray[np.int64]
    detected: NDArray[np.bool_]
    stability: NDArray[np.float64]
    order: NDArray[np.int64]


class Share(NamedTuple):
    """A share of the unique keypoints, between 0 and 1, and what is counted."""

    value: float
    note: str

    @property
    def percent(self) -> str:
        """The share in per cent, as written on the figure."""
        return f"{100 * self.value:.0f} %"

    def __str__(self) -> str:
        """Return what is counted and the share, as written on the figure."""
        return f"{self.note}: {self.percent}"


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
    occurrence = _occurrence(tables["fig4_occurrence"], tables["fig4_keypoints"])
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
        seen = np.where(occurrence.detected, 1.0, np.nan)
        _draw_matrix(matrix, occurrence.n_spo, seen, ListedColormap([palette.INK]))
        matrix.set_xlabel("unique keypoints")
        style.letter(ordered, "d", "the same, ordered and coloured by stability")
        stability = np.where(occurrence.detected, occurrence.stability, np.nan)
        shown = stability[:, occurrence.order]
        image = _draw_matrix(ordered, occurrence.n_spo, shown, palette.stability_map())
        _mark_groups(ordered, len(occurrence.stability), shares)
        bar = figure.colorbar(image, cax=figure.add_subplot(lower[1, 1]), label="stability")
        bar.outline.set_visible(False)
        return style.settle(figure, draft)


def _occurrence(detections: DataFrame, keypoints: DataFrame) -> Occurrence:
    """Turn the tidy tables into a matrix, and order its columns."""
    matrix = detections.pivot_table(index="n_spo", columns="keypoint", values="detected")
    matrix = matrix.reindex(columns=keypoints["keypoint"])
    if matrix.isna().any(axis=None):
        raise InputError(
            "fig4_occurrence.csv: lacks some pairs of a keypoint of fig4_keypoints.csv and a "
            "sampling; remake both tables"
        )
    detected = matrix.to_numpy() > 0
    n_spo = matrix.index.to_numpy(dtype=np.int64)
    stability = keypoints["stability"].to_numpy(dtype=np.float64)
    mean_n_spo = (n_spo[:, None] * detected).sum(axis=0) / np.maximum(detected.sum(axis=0), 1)
    return Occurrence(n_spo, detected, stability, np.lexsort((mean_n_spo, stability)))


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
    style.letter(ax, "b", "new and lost detections")
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
    ax.axhline(FLOOR, color=palette.GREY, linewidth=0.7, linestyle=":", zorder=1)
    text = f"floor in the paper: {FLOOR:g} %"
    style.direct_label(ax, n_spo[-1], FLOOR, text, palette.GREY, up=5.0)
    highest = 100 * np.nanmax(counts[["new_high", "lost_high"]].to_numpy(dtype=np.float64))
    ax.set_ylim(0.0, 1.2 * max(float(highest), FLOOR))  # leaves room for the text
    ax.set_ylabel("share of detections (%)")
    style.sampling_axis(ax, n_spo)
    style.finish_axes(ax)


def _draw_matrix(
    ax: Axes, n_spo: NDArray[np.int64], values: NDArray[np.float64], colours: Any
) -> Any:
    """Draw an occurrence matrix, the coarsest sampling on top; NaN is left white."""
    image = ax.imshow(
        values, cmap=colours, vmin=0.0, vmax=1.0, aspect="auto", interpolation="nearest"
    )
    rows = np.arange(0, len(n_spo), -(-len(n_spo) // 5))
    ax.set_yticks(rows, [str(n) for n in n_spo[rows]])
    ax.set_ylabel(style.N_SPO)
    ax.tick_params(length=2)
    return image


def _mark_groups(ax: Axes, n: int, shares: dict[str, Share]) -> None:
    """Underline the unstable and the stable ones of `n` columns, and say which share they are."""
    unstable, stable, always = (shares[name] for name in ("unstable", "stable", "always"))
    low, high = round(n * unstable.value), round(n * stable.value)
    ax.set_xticks([])
    below = ax.get_xaxis_transform()
    for group, start, stop, side, text in (
        ("unstable", 0, low, "left", str(unstable)),
        ("stable", n - high, n, "right", f"{stable}, at all of them: {always.percent}"),
    ):
        colour = palette.LABEL_COLOURS[group]
        span = (start - 0.5, stop - 0.5)
        line: dict[str, Any] = {"linewidth": 2.5, "solid_capstyle": "butt", "clip_on": False}
        ax.plot(span, (-0.05, -0.05), transform=below, color=colour, label=group, **line)
        place: dict[str, Any] = {"ha": side, "va": "top", "fontsize": style.SMALL}
        edge = span[0] if side == "left" else span[1]
        ax.text(edge, -0.1, text, transform=below, color=colour, **place)


if __name__ == "__main__":
    raise SystemExit(main(draw, TABLES))
