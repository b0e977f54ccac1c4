"""Figure truth: detections against the true extrema of the continuous scale-space."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from keystab.figures import palette, style
from keystab.figures._recall_panels import SHARES, draw_recall_precision
from keystab.figures._render import Tables, check_tables, main

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from pandas import DataFrame

ERRORS = ("median_location", "p90_location", "rms_location", "median_scale", "p90_scale")

TABLES = {
    "truth_samplings.csv": (
        *("n_spo", "detections", "n_detections", "n_right", "n_twin"),
        *SHARES,
        *ERRORS,
    ),
    "truth_cosine.csv": ("n_spo", "detections", *SHARES, *ERRORS),
    "truth_grid.csv": ("n_spo", "delta_min", "recall"),
    "truth_kappas.csv": ("kappa", "detections", *SHARES),
    "truth_causes.csv": ("group", "cause", "share", "n_group"),
    "truth_auc.csv": ("label", "feature", "auc", "low", "high"),
}
"""Files read, with the columns that they must have."""

QUANTITIES = {
    "recall": ("true extrema found", "recall (%)"),
    "precision": ("detections that are true", "precision (%)"),
    "location": ("distance in space", "distance (px)"),
    "scale": ("distance in scale", "|$\\log_2\\sigma/\\sigma_{true}$| (octaves)"),
}
"""Title and axis of the panels a to d."""

CAUSE_NAMES = {
    "true": "a true extremum",
    "degenerate": "true, nearly degenerate",
    "edge": "true, beyond the range",
    "twin": "second on one extremum",
    "nothing": "no extremum near",
}
"""What a keypoint can be, in words."""

ERROR_LINES: dict[str, dict[str, Any]] = {
    "median": {"linewidth": 1.5},
    "p90": {"linewidth": 0.6},
    "rms": {"linewidth": 0.6, "marker": "s", "markersize": 2.2},
}
"""How the median of an error, what nine in ten stay below, and its root mean square are drawn."""


def draw(tables: Tables, draft: bool = False) -> Figure:
    """Draw what detectors find of the true extrema.

    Parameters
    ----------
    tables : mapping
        See `TABLES`.
    draft : bool
        Say on the figure that its numbers come from quick settings.

    Returns
    -------
    matplotlib Figure
        a, b: recall and precision against the sampling; c, d: errors; e: recall on the grid; f:
        against the ratio of the two blurs; g: causes of instability; h: areas under ROC curves.

    Raises
    ------
    InputError
        If a table is unusable.
    """
    check_tables(tables, TABLES)
    with style.context():
        figure = style.new_figure(6.1)
        outer = figure.add_gridspec(3, 1, height_ratios=(1, 1, 0.9), hspace=0.03)
        first = style.panels(outer[0], 1, 3, wspace=0.03)[0]
        # Numbers of three digits stand side by side in (e).
        second = style.panels(outer[1], 1, 3, wspace=0.03, width_ratios=(0.85, 1.3, 0.85))[0]
        third = style.panels(outer[2], 1, 2, wspace=0.03, width_ratios=(1.25, 1.0))[0]
        places = dict(zip(QUANTITIES, (*first, second[0]), strict=True))
        for (name, ax), letter in zip(places.items(), "abcd", strict=True):
            style.letter(ax, letter, QUANTITIES[name][0])
            if name in ("recall", "precision"):
                _draw_share(ax, tables["truth_samplings"], tables["truth_cosine"], name)
            else:
                _draw_errors(ax, tables["truth_samplings"], tables["truth_cosine"], name)
            ax.set_ylabel(QUANTITIES[name][1])
        style.letter(second[1], "e", "recall of discrete extrema (%)")
        _draw_grid(second[1], tables["truth_grid"])
        style.letter(second[2], "f", "ratio of the two blurs")
        _draw_kappas(second[2], tables["truth_kappas"])
        style.letter(third[0], "g", "what the keypoints of figure 4 are")
        _draw_causes(third[0], tables["truth_causes"])
        style.letter(third[1], "h", "what features predict")
        _draw_areas(third[1], tables["truth_auc"])
        _name_detections(figure)
        return style.settle(figure, draft)


def _name_detections(figure: Figure) -> None:
    """Say above all panels what colours and circles are, in (a) to (d)."""
    from matplotlib.lines import Line2D

    lines = [
        Line2D([], [], color=colour, linewidth=1.5, label=f"{detections} extrema")
        for detections, colour in palette.DETECTION_COLOURS.items()
    ]
    lines.append(
        Line2D(
            [],
            [],
            label="cosine series instead of the spline, (a) to (d)",
            **_circles(palette.GREY),
        )
    )
    figure.legend(handles=lines, loc="outside upper left", ncols=len(lines), frameon=False)


def _circles(colour: str) -> dict[str, Any]:
    """Look of what was found with the cosine series."""
    return {"linestyle": "none", "marker": "o", "color": colour, "markerfacecolor": "none",
            "markersize": 4.0}  # fmt: skip


def _of(table: DataFrame, detections: str, by: str = "n_spo") -> DataFrame:
    return table[table["detections"] == detections].sort_values(by)


def _draw_share(ax: Axes, spline: DataFrame, cosine: DataFrame, name: str) -> None:
    """Draw recall or precision against the sampling."""
    for detections, colour in palette.DETECTION_COLOURS.items():
        rows = _of(spline, detections)
        n_spo, share, low, high = (
            rows[column].to_numpy() for column in ("n_spo", name, f"{name}_low", f"{name}_high")
        )
        ax.fill_between(n_spo, 100 * low, 100 * high, color=colour, alpha=0.15, linewidth=0)
        ax.plot(n_spo, 100 * share, "-", color=colour, label=detections, linewidth=1.2)
        if name == "precision":
            forgiven = (rows["n_right"] + rows["n_twin"]) / rows["n_detections"]
            ax.plot(
                n_spo, 100 * forgiven, color=colour, label=f"{detections}, with second",
                linewidth=0.6,
            )  # fmt: skip
        other = _of(cosine, detections)
        ax.plot(
            other["n_spo"], 100 * other[name], label=f"{detections}, cosine", **_circles(colour)
        )
    bottom = 100 * min(spline[f"{name}_low"].min(), cosine[name].min())
    room = 0.2 if name == "precision" else 0.03  # for what thin lines mean
    ax.set_ylim(bottom - room * (100 - bottom), 100 + 0.06 * (100 - bottom))
    if name == "precision":
        _say(ax, ["thin: second detections too"])
    style.sampling_axis(ax, spline["n_spo"])
    style.finish_axes(ax)


def _draw_errors(ax: Axes, spline: DataFrame, cosine: DataFrame, name: str) -> None:
    """Draw quantiles of an error, and the root mean square in space, against the sampling."""
    lines = {quantile: look for quantile, look in ERROR_LINES.items()
             if f"{quantile}_{name}" in ERRORS}  # fmt: skip
    for detections, colour in palette.DETECTION_COLOURS.items():
        rows, other = _of(spline, detections), _of(cosine, detections)
        for quantile, look in lines.items():
            ax.plot(rows["n_spo"], rows[f"{quantile}_{name}"], color=colour,
                    label=f"{detections}, {quantile}", **look)  # fmt: skip
        ax.plot(other["n_spo"], other[f"median_{name}"], label=f"{detections}, cosine",
                **_circles(colour))  # fmt: skip
    drawn = [spline[f"{quantile}_{name}"] for quantile in lines]
    values = np.concatenate([*drawn, cosine[f"median_{name}"]])
    values = values[values > 0]
    low, high = 0.6 * values.min(), 1.4 * values.max()
    style.log_y_axis(ax, low, high * (high / low) ** 0.35)  # room for what the lines mean
    words = ["thick: median, thin: 90 %", "squares: root mean square"]
    _say(ax, words[: len(lines) - 1], top=True)
    style.sampling_axis(ax, spline["n_spo"])
    style.finish_axes(ax)


def _draw_grid(ax: Axes, grid: DataFrame) -> None:
    """Draw the recall on the grid of samplings, with its numbers."""
    table = grid.pivot(index="delta_min", columns="n_spo", values="recall")
    colours = palette.count_map()
    lowest = np.floor(10 * np.nanmin(table.to_numpy()) - 1e-9) / 10
    ax.imshow(table, cmap=colours, vmin=lowest, vmax=1.0, aspect="auto", origin="lower")
    for (row, column), share in np.ndenumerate(table.to_numpy()):
        if np.isfinite(share):
            colour = palette.readable_on(colours((share - lowest) / (1 - lowest)))
            ax.text(column, row, f"{100 * share:.0f}", color=colour, ha="center", va="center",
                    fontsize=style.SMALL)  # fmt: skip
    ax.set_xticks(range(len(table.columns)), [f"{n}" for n in table.columns])
    ax.set_yticks(range(len(table.index)), [f"{d:g}" for d in table.index])
    ax.set_xlabel(style.N_SPO_AXIS)
    ax.set_ylabel(f"{style.DELTA_MIN} (px)")
    ax.tick_params(length=0)
    ax.spines[:].set_visible(False)


def _draw_kappas(ax: Axes, table: DataFrame) -> None:
    """Draw recall and precision of refined keypoints against log2 kappa."""
    rows = _of(table, "refined", "kappa")
    place = np.log2(rows["kappa"].to_numpy())
    ax.set_xscale("log")
    if len(place) > 1:
        ax.set_xlim(place[0], place[-1])
    bottom = 100 * np.nanmin(rows[["recall_low", "precision_low"]].to_numpy())
    draw_recall_precision(ax, place, rows, max(0.0, bottom - 0.1 * (100 - bottom)))
    ax.set_xticks(place, [style.ratio_name(kappa) for kappa in rows["kappa"]])
    ax.minorticks_off()
    ax.set_xlabel(style.KAPPA_AXIS)


def _draw_causes(ax: Axes, table: DataFrame) -> None:
    """Draw what the keypoints of every group are, as bars of shares."""
    groups = ["stable", "between", "unstable"]
    left = np.zeros(len(groups))
    for cause, name in CAUSE_NAMES.items():
        rows = table[table["cause"] == cause].set_index("group").loc[groups]
        share = 100 * rows["share"].fillna(0.0).to_numpy()
        colour = palette.CAUSE_COLOURS[cause]
        ax.barh(range(len(groups)), share, left=left, color=colour, height=0.62, linewidth=0,
                label=name)  # fmt: skip
        for at, (start, width) in enumerate(zip(left, share, strict=True)):
            if width >= 6:
                ax.text(start + width / 2, at, f"{width:.0f}", ha="center", va="center",
                        fontsize=style.SMALL, color=_readable(colour))  # fmt: skip
        left += share
    counts = table.drop_duplicates("group").set_index("group")["n_group"]
    ax.set_yticks(range(len(groups)), [f"{group} ({counts[group]})" for group in groups])
    ax.set(xlim=(0, 100), ylim=(len(groups) - 0.5, -0.5))
    ax.set_xlabel("keypoints (%)")
    place = {"transform": ax.transAxes, "fontsize": style.SMALL, "va": "center"}
    for line, (cause, name) in enumerate(CAUSE_NAMES.items()):
        height = 0.9 - 0.2 * line
        ax.text(1.02, height, "\N{BLACK SQUARE}", color=palette.CAUSE_COLOURS[cause], **place)
        ax.text(1.07, height, name, **place)
    style.finish_axes(ax)


def _readable(colour: str) -> str:
    from matplotlib.colors import to_rgb

    return palette.readable_on(to_rgb(colour))


def _draw_areas(ax: Axes, table: DataFrame) -> None:
    """Draw the area under the ROC curve of every feature, for stability and for truth."""
    features = [name for name in style.FEATURE_NAMES if (table["feature"] == name).any()]
    place = np.arange(len(features))
    for label, up, face in (("stability", -0.14, "white"), ("truth", 0.14, palette.INK)):
        rows = table[table["label"] == label].set_index("feature").loc[features]
        ax.hlines(place + up, rows["low"], rows["high"], color=palette.INK, linewidth=0.9)
        ax.plot(rows["auc"], place + up, "o", color=palette.INK, markerfacecolor=face, label=label,
                markersize=4.0)  # fmt: skip
    ax.axvline(0.5, color=palette.GREY, linewidth=0.7, linestyle=style.REFERENCE)
    ax.set_yticks(place, [style.FEATURE_NAMES[name] for name in features])
    ax.set(xlim=(0.4, 1.0), ylim=(len(features) - 0.5, -0.6))
    ax.set_xlabel(f"{style.AREA_AXIS}\n(open: stability, full: truth)")
    style.finish_axes(ax)


def _say(ax: Axes, lines: list[str], top: bool = False) -> None:
    """Write lines in the lower or the upper right corner, where the caller has left room."""
    place = {"transform": ax.transAxes, "ha": "right", "fontsize": style.SMALL}
    ax.text(0.99, 0.98 if top else 0.03, "\n".join(lines), color=palette.GREY,
            va="top" if top else "bottom", **place)  # fmt: skip


if __name__ == "__main__":
    raise SystemExit(main(draw, TABLES))
