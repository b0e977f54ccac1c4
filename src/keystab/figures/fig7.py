"""Figure 7: stability and precision under translations, by the limits of the refinement (5.5)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from keystab.errors import InputError
from keystab.figures import palette, style
from keystab.figures._render import Tables, check_tables, main
from keystab.figures._stability_panels import (
    CURVE,
    PRECISION,
    QUANTITIES,
    EndLabel,
    curve,
    curve_axes,
    end_labels,
    precision,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from pandas import DataFrame

CHOICE = ("n_spo", "detections", "max_offset", "max_iterations")
"""What a curve is of: the sampling and, unless the extrema are discrete, M_offset and N_interp."""

TABLES = {
    "fig7_curves.csv": (*CHOICE, *CURVE),
    "fig7_precision.csv": (*PRECISION, "max_offset", "max_iterations"),
    "fig7_counts.csv": (*CHOICE, "n_unique", "n_always"),
    "fig7_shipped.csv": ("shipped", *CURVE),
}
"""Files read, with the columns that they must have."""


def draw(tables: Tables, draft: bool = False) -> Figure:
    """Draw stability curves for all limits of the refinement, precision, counts, and SIFT's curves.

    Parameters
    ----------
    tables : mapping
        ``fig7_curves``: stability curves at a coarse and a fine sampling; ``fig7_precision``: one
        row per sampling, kind of detection and quantity, with the refinement that is usual;
        ``fig7_counts``: one row per sampling and choice; ``fig7_shipped``: curves of SIFT's own
        refinement, ``unfiltered`` and ``filtered``.
    draft : bool
        Say on the figure that its numbers come from quick settings.

    Returns
    -------
    matplotlib Figure
        a, b: curves at the coarse and at the fine sampling, a row for each ``N_interp``, a curve
        for each ``M_offset``, discrete extrema dotted; c: precision of the location; d: of the
        scale; e: numbers of keypoints seen in all views (dots) and in any (ticks); f: curves of
        SIFT's own refinement.

    Raises
    ------
    InputError
        If a table is unusable or a curve is missing.
    """
    check_tables(tables, TABLES)
    curves = tables["fig7_curves"]
    refined = curves[curves["detections"] == "refined"]
    samplings = sorted(refined["n_spo"].unique())
    if len(samplings) != 2:
        raise InputError(
            f"fig7_curves.csv: has refined extrema of {len(samplings)} samplings, the figure shows "
            "2; remake the table"
        )
    counts = tables["fig7_counts"]
    for name, table in (("curves", curves), ("counts", counts)):
        for n_spo in samplings:
            if not ((table["n_spo"] == n_spo) & (table["detections"] == "discrete")).any():
                raise InputError(
                    f"fig7_{name}.csv: has no discrete extrema of {n_spo} scales per octave; "
                    "remake the table"
                )
    models = sorted(refined["max_iterations"].unique())
    with style.context():
        figure = style.new_figure(1.32 * len(models) + 3.6)
        heights = (1.32 * len(models), 1.7, 1.8)
        outer = figure.add_gridspec(3, 1, height_ratios=heights, hspace=0.03)
        grid = style.panels(outer[0], len(models), 2, sharex=True, sharey=True, wspace=0.03)
        labels: dict[Axes, Sequence[EndLabel]] = {}
        for column, (n_spo, name) in enumerate(zip(samplings, "ab", strict=True)):
            style.letter(grid[0, column], name, f"{style.N_SPO} = {n_spo}")
            here = curves[curves["n_spo"] == n_spo]
            for ax, n_models in zip(grid[:, column], models, strict=True):
                labels[ax] = _draw_choices(ax, here, n_models)
                ax.set_label(name if ax is grid[0, column] else f"{name} {style.limit(n_models)}")
        grid[len(models) // 2, 0].set_ylabel(style.UNIQUE_AXIS)
        for ax in grid[-1]:
            ax.set_xlabel(style.VIEWS_AXIS)
        heads: dict[Axes, tuple[str, str]] = dict.fromkeys(grid[0], (style.M_OFFSET, "seen in all"))
        precisions = style.panels(outer[1], 1, 2, wspace=0.03)[0]
        for ax, name, quantity in zip(precisions, "cd", QUANTITIES, strict=True):
            style.letter(ax, name, QUANTITIES[quantity][0])
            precision(ax, tables["fig7_precision"], quantity, medians=quantity == "location")
        number, sift = style.panels(outer[2], 1, 2, wspace=0.03)[0]
        labels[number] = _draw_counts(number, counts[counts["n_spo"].isin(samplings)])
        heads[sift] = ("", "seen in all")
        labels[sift] = _draw_sift(
            sift, tables["fig7_shipped"], _usual(curves, tables["fig7_precision"])
        )
        end_labels(labels, heads)
        return style.settle(figure, draft)


def _draw_choices(ax: Axes, curves: DataFrame, n_models: float) -> list[EndLabel]:
    """Draw the curves of one sampling and ``N_interp``, and the discrete extrema dotted."""
    curve_axes(ax)
    ax.set(xlabel="", ylabel="")
    place = {"transform": ax.transAxes, "fontsize": style.SMALL}
    ax.text(0.05, 0.07, f"{style.N_INTERP} = {style.limit(n_models)}", **place)
    discrete = curves[curves["detections"] == "discrete"]
    dots: dict[str, Any] = {"linestyle": style.REFERENCE, "zorder": 4}
    labels = [curve(ax, discrete, palette.DETECTION_COLOURS["discrete"], "discrete", **dots)]
    refined = curves[curves["max_iterations"] == n_models]
    for max_offset in sorted(refined["max_offset"].unique()):
        rows = refined[refined["max_offset"] == max_offset]
        colour = palette.offset_colour(max_offset)
        labels.append(curve(ax, rows, colour, style.limit(max_offset), linewidth=1.2))
    return labels


def _draw_counts(ax: Axes, counts: DataFrame) -> list[EndLabel]:
    """Draw how many keypoints are seen in all views, by sampling, ``N_interp`` and ``M_offset``."""
    style.letter(ax, "e", "number of keypoints")
    refined = counts[counts["detections"] == "refined"].sort_values("max_offset")
    models = sorted(refined["max_iterations"].unique())
    offsets = sorted(refined["max_offset"].unique())
    orange = palette.DETECTION_COLOURS["discrete"]
    blocks = sorted(refined["n_spo"].unique())
    for block, n_spo in enumerate(blocks):
        left = block * (len(models) + 0.5)
        ends = (left - 0.5, left + len(models) - 0.5)
        here = counts["n_spo"] == n_spo
        discrete = counts[here & (counts["detections"] == "discrete")]
        always = discrete["n_always"].iloc[0]
        label = f"{n_spo} discrete"
        ax.plot(ends, (always, always), color=orange, linestyle=style.REFERENCE, label=label)
        ax.text(sum(ends) / 2, 1.0, f"{style.N_SPO} = {n_spo}", **_above(ax))
        for row in refined[refined["n_spo"] == n_spo].to_dict("records"):
            shift = offsets.index(row["max_offset"]) - (len(offsets) - 1) / 2
            x = left + models.index(row["max_iterations"]) + 0.18 * shift
            line: dict[str, Any] = {"color": palette.offset_colour(row["max_offset"])}
            label = f"{n_spo} {style.limit(row['max_offset'])} {style.limit(row['max_iterations'])}"
            ax.plot([x, x], [row["n_always"], row["n_unique"]], linewidth=0.6, **line)
            ax.plot(x, row["n_unique"], "_", markersize=4.0, label=f"{label}, any", **line)
            # Whole dots, also where none is seen in all views.
            ax.plot(x, row["n_always"], "o", markersize=4.0, label=label, clip_on=False, **line)
    lefts = (len(models) + 0.5) * np.arange(len(blocks))
    ticks = (lefts[:, None] + np.arange(len(models))).ravel()
    ax.set_xticks(ticks, [style.limit(n_models) for n_models in models] * len(blocks))
    ax.set_xlim(-0.7, ends[1] + 0.05)
    ax.set_ylim(0, 1.2 * counts["n_unique"].max())
    ax.set(xlabel=style.N_INTERP_AXIS, ylabel="unique keypoints")
    style.finish_axes(ax)
    last = refined[(refined["n_spo"] == blocks[-1]) & (refined["max_iterations"] == models[-1])]
    return [
        EndLabel(always, "discrete, in all", "", orange),
        EndLabel(last["n_always"].iloc[-1], "seen in all", "", palette.INK),
        EndLabel(last["n_unique"].iloc[-1], "seen in any", "", palette.INK),
    ]


def _above(ax: Axes) -> dict[str, Any]:
    """Return where the names of the blocks of the counts stand."""
    place = {"transform": ax.get_xaxis_transform(), "ha": "center", "va": "top"}
    return place | {"fontsize": style.SMALL}


def _usual(curves: DataFrame, precision: DataFrame) -> DataFrame:
    """Return the curve of the coarse sampling with the refinement whose precision is drawn."""
    limits = ["max_offset", "max_iterations"]
    usual = precision[precision["detections"] == "refined"][limits].drop_duplicates()
    coarse = curves[curves["n_spo"] == curves["n_spo"].min()]
    found: DataFrame = coarse.merge(usual, on=limits)
    if len(usual) != 1 or found.empty:
        raise InputError(
            "fig7_precision.csv: its refined keypoints are not of one refinement that "
            "fig7_curves.csv has; remake both tables"
        )
    return found


def _draw_sift(ax: Axes, sift: DataFrame, usual: DataFrame) -> list[EndLabel]:
    """Draw the curves of SIFT's own refinement, and beside them the usual one."""
    style.letter(ax, "f", "SIFT as shipped")
    curve_axes(ax)
    labels = []
    for name, colour in palette.SIFT_COLOURS.items():
        rows = sift[sift["shipped"] == name]
        if len(rows) == 0:
            raise InputError(f"fig7_shipped.csv: has no rows of {name}; remake the table")
        labels.append(curve(ax, rows, colour, name))
    colour = palette.DETECTION_COLOURS["refined"]
    labels.append(curve(ax, usual, colour, "as in (a)", linewidth=0.8))
    return labels


if __name__ == "__main__":
    raise SystemExit(main(draw, TABLES))
