"""Figure truth: detections against the true extrema of the continuous scale-space."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from keystab.figures import palette, style
from keystab.figures._render import Tables, check_tables, main

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from pandas import DataFrame

SHARES = ("recall", "recall_low", "recall_high", "precision", "precision_low", "precision_high")
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
    "truth_views.csv": ("sweep", "value", "n_spo", "detections", *SHARES),
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

SWEEPS = {
    "aliasing": ("aliasing", "camera blur $c$ (px)"),
    "unknown_blur": ("unknown blur", "spread of the blur, $\\Delta c$ (px)"),
    "noise": ("noise", "noise $n$"),
}
"""Sweep -> title and axis of the panels i to k."""


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
        against the ratio of the two blurs; g: causes of instability; h: areas under ROC curves; i
        to k: views against the scene.

    Raises
    ------
    InputError
        If a table is unusable.
    """
    check_tables(tables, TABLES)
    with style.context():
        figure = style.new_figure(7.6)
        outer = figure.add_gridspec(4, 1, height_ratios=(1, 1, 0.9, 1), hspace=0.03)
        first, second, third, last = (
            style.panels(outer[row], 1, columns, wspace=0.03, **more)[0]
            for row, columns, more in (
                (0, 3, {}),
                (1, 3, {}),
                (2, 2, {"width_ratios": (1.25, 1.0)}),
                (3, 3, {}),
            )
        )
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
        for ax, letter, (sweep, (title, axis)) in zip(last, "ijk", SWEEPS.items(), strict=True):
            style.letter(ax, letter, title)
            _draw_sweep(ax, tables["truth_views"], sweep)
            ax.set_xlabel(axis)
        last[0].set_ylabel("against the scene (%)")
        return style.settle(figure, draft)


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
            ax.plot(n_spo, 100 * forgiven, ":", color=colour, label=f"{detections}, with second")
        other = _of(cosine, detections)
        ax.plot(
            other["n_spo"], 100 * other[name], "o", color=colour, markerfacecolor="none",
            markersize=4.0, label=f"{detections}, cosine",
        )  # fmt: skip
    bottom = 100 * min(spline[f"{name}_low"].min(), cosine[name].min())
    ax.set_ylim(bottom - 0.03 * (100 - bottom), 100 + 0.06 * (100 - bottom))
    if name == "precision":
        names = [("dotted: second detections too", palette.GREY)]
    else:
        names = [*palette.DETECTION_COLOURS.items(), ("circles: cosine series", palette.GREY)]
    _list(ax, names)
    style.sampling_axis(ax, spline["n_spo"])
    style.finish_axes(ax)


def _draw_errors(ax: Axes, spline: DataFrame, cosine: DataFrame, name: str) -> None:
    """Draw quantiles of an error, and the root mean square in space, against the sampling."""
    lines = [("median", "-"), ("p90", ":"), *([("rms", "-.")] if name == "location" else [])]
    for detections, colour in palette.DETECTION_COLOURS.items():
        rows, other = _of(spline, detections), _of(cosine, detections)
        for quantile, line in lines:
            column = f"{quantile}_{name}"
            ax.plot(rows["n_spo"], rows[column], line, color=colour, linewidth=1.2,
                    label=f"{detections}, {quantile}")  # fmt: skip
        ax.plot(
            other["n_spo"], other[f"median_{name}"], "o", color=colour, markerfacecolor="none",
            markersize=4.0, label=f"{detections}, cosine",
        )  # fmt: skip
    drawn = [spline[f"{quantile}_{name}"] for quantile, _ in lines]
    values = np.concatenate([*drawn, cosine[f"median_{name}"]])
    values = values[values > 0]
    room = 5.0 if name == "location" else 2.5  # for what the lines mean
    style.log_y_axis(ax, 0.6 * values.min(), room * values.max())
    if name == "location":
        words = ("solid: median, dotted: 90 %", "dash-dotted: r.m.s.")
        _list(ax, [(each, palette.GREY) for each in words], top=True)
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
    ax.set_xlabel(style.N_SPO)
    ax.set_ylabel(f"{style.DELTA_MIN} (px)")
    ax.tick_params(length=0)
    ax.spines[:].set_visible(False)


def _draw_kappas(ax: Axes, table: DataFrame) -> None:
    """Draw recall and precision of refined keypoints against log2 kappa."""
    rows = _of(table, "refined", "kappa")
    place = np.log2(rows["kappa"].to_numpy())
    colours = _share_colours()
    for name in ("recall", "precision"):
        low, high = 100 * rows[f"{name}_low"], 100 * rows[f"{name}_high"]
        ax.fill_between(place, low, high, color=colours[name], alpha=0.15, linewidth=0)
        ax.plot(place, 100 * rows[name], "o-", color=colours[name], label=name, linewidth=1.2)
    ax.set_xscale("log")
    ax.set_xticks(place, [f"1/{1 / at:.3g}" for at in place])
    ax.minorticks_off()
    ax.set_xlabel("$\\log_2\\kappa$")
    ax.set_ylabel("refined keypoints (%)")
    bottom = 100 * np.nanmin(rows[["recall_low", "precision_low"]].to_numpy())
    ax.set_ylim(bottom - 0.25 * (100 - bottom), 100 + 0.05 * (100 - bottom))
    _list(ax, list(colours.items()))
    style.finish_axes(ax)


def _share_colours() -> dict[str, str]:
    return {"recall": palette.CHANGE_COLOURS["new"], "precision": palette.CHANGE_COLOURS["lost"]}


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
    ax.axvline(0.5, color=palette.GREY, linewidth=0.7, linestyle=":")
    ax.set_yticks(place, [style.FEATURE_NAMES[name] for name in features])
    ax.set(xlim=(0.4, 1.0), ylim=(len(features) - 0.5, -0.6))
    ax.set_xlabel("area under the ROC curve\n(open: stability, full: truth)")
    style.finish_axes(ax)


def _draw_sweep(ax: Axes, table: DataFrame, sweep: str) -> None:
    """Draw recall and precision of refined keypoints of views against the scene."""
    rows = table[(table["sweep"] == sweep) & (table["detections"] == "refined")]
    rows = rows[rows["n_spo"] == rows["n_spo"].max()].sort_values("value")
    for name, colour in _share_colours().items():
        low, high = 100 * rows[f"{name}_low"], 100 * rows[f"{name}_high"]
        ax.fill_between(rows["value"], low, high, color=colour, alpha=0.15, linewidth=0)
        ax.plot(rows["value"], 100 * rows[name], "o-", color=colour, label=name, linewidth=1.2)
    ax.set_ylim(0, 103)
    _list(ax, list(_share_colours().items()), top=sweep == "noise")
    style.finish_axes(ax)


def _list(ax: Axes, names: list[tuple[str, str]], top: bool = False) -> None:
    """Write names in their colours in the lower right or the upper right corner."""
    place = {"transform": ax.transAxes, "ha": "right", "fontsize": style.SMALL}
    for line, (name, colour) in enumerate(names):
        height = 0.97 - 0.11 * line if top else 0.04 + 0.11 * (len(names) - 1 - line)
        ax.text(0.98, height, name, color=colour, va="top" if top else "bottom", **place)


if __name__ == "__main__":
    raise SystemExit(main(draw, TABLES))
