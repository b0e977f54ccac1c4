"""Figure 5: can simple features tell unstable keypoints from stable ones? (section 5.3)."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from keystab.errors import InputError
from keystab.figures import palette, style
from keystab.figures._render import Tables, check_tables, main

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from pandas import DataFrame

TABLES = {
    "fig5_thresholds.csv": ("feature", "threshold", "stable_below", "unstable_below"),
    "fig5_roc.csv": ("feature", "specificity", "sensitivity"),
    "fig5_auc.csv": ("feature", "auc", "low", "high", "n_stable", "n_unstable"),
}
"""Files read, with the columns that they must have."""

PANELS = {
    "dog": ("a", "DoG value"),
    "difference": ("b", "difference to the neighbours"),
    "laplacian": ("c", "3D Laplacian of the DoG"),
    "condition": ("d", "condition number"),
}
"""Letter and title of each feature's panel, in the order of the paper's caption."""

THRESHOLDS = {
    "dog": "threshold on |DoG|",
    "difference": "threshold on the difference",
    "laplacian": "threshold on |Laplacian|",
    "condition": "threshold on the condition number",
}
"""Names of the horizontal axes. Grey values are in [0, 1]."""


def draw(tables: Tables, draft: bool = False) -> Figure:
    """Draw the shares of stable and unstable keypoints below thresholds, and ROC curves.

    Parameters
    ----------
    tables : mapping
        ``fig5_thresholds``: shares below each threshold; ``fig5_roc``: points of the ROC curves;
        ``fig5_auc``: the area under each, with its interval and the sizes of both groups.
    draft : bool
        Say on the figure that its numbers come from quick settings.

    Returns
    -------
    matplotlib Figure
        a to d: one feature each, logarithmic thresholds; e: stable keypoints kept (sensitivity)
        against unstable ones rejected (specificity), the features named in the order of their area.

    Raises
    ------
    InputError
        If a table is unusable or a feature is missing.
    """
    check_tables(tables, TABLES)
    for name in TABLES:
        found = set(tables[Path(name).stem]["feature"])
        missing = [feature for feature in PANELS if feature not in found]
        if missing:
            raise InputError(f"{name}: has no rows of the feature {missing[0]}; remake the table")
    areas = tables["fig5_auc"].set_index("feature")
    with style.context():
        figure = style.new_figure(3.7)
        outer = figure.add_gridspec(1, 2, width_ratios=(1.62, 1.0), wspace=0.03)
        panels = style.panels(outer[0], 2, 2, sharey=True, hspace=0.03, wspace=0.03)
        for ax, (feature, (name, title)) in zip(panels.flat, PANELS.items(), strict=True):
            style.letter(ax, name, title)
            _draw_shares(ax, _of(tables["fig5_thresholds"], feature))
            ax.set_xlabel(THRESHOLDS[feature])
        for ax in panels[:, 0]:
            ax.set_ylabel("share below (%)")
        _name_groups(panels[0, 0], areas)
        ax, names = style.panels(outer[1], 2, 1, height_ratios=(2.2, 1.0))[:, 0]
        style.letter(ax, "e", "ROC")
        _draw_roc(ax, tables["fig5_roc"])
        _name_features(names, areas)
        return style.settle(figure, draft)


def _of(table: DataFrame, feature: str) -> DataFrame:
    """Return the rows of one feature."""
    return table[table["feature"] == feature]


def _draw_shares(ax: Axes, rows: DataFrame) -> None:
    """Draw the share of each group whose feature lies below the threshold."""
    positive = rows[rows["threshold"] > 0].sort_values("threshold")
    for group in ("unstable", "stable"):
        colour = palette.LABEL_COLOURS[group]
        ax.plot(positive["threshold"], 100 * positive[f"{group}_below"], color=colour, label=group)
    style.log_x_axis(ax, positive["threshold"].min(), positive["threshold"].max())
    ax.set(ylim=(0.0, 102.0), yticks=np.arange(0, 101, 25))
    style.finish_axes(ax)


def _name_groups(ax: Axes, areas: DataFrame) -> None:
    """Name both lines of the first panel with the sizes of the groups."""
    for line, group in enumerate(("unstable", "stable")):
        text = f"{group} ({int(areas[f'n_{group}'].max())})"
        colour = palette.LABEL_COLOURS[group]
        place = {"transform": ax.transAxes, "ha": "left", "va": "top"}
        ax.text(0.04, 0.97 - 0.13 * line, text, color=colour, fontsize=style.SMALL, **place)


def _draw_roc(ax: Axes, roc: DataFrame) -> None:
    """Draw the ROC curves and the diagonal of a feature that knows nothing."""
    ax.plot(
        [0, 100],
        [100, 0],
        color=palette.GREY,
        linewidth=0.7,
        linestyle=style.REFERENCE,
        label="chance",
    )
    for feature in PANELS:
        rows = _of(roc, feature).sort_values(
            ["specificity", "sensitivity"], ascending=[True, False]
        )
        colour = palette.FEATURE_COLOURS[feature]
        ax.plot(100 * rows["specificity"], 100 * rows["sensitivity"], color=colour, label=feature)
    ax.set(xlim=(0, 100), ylim=(0, 102), aspect="equal", anchor="NE")
    ticks = np.arange(0, 101, 25)
    ax.set(xticks=ticks, yticks=ticks)
    ax.set_xlabel("unstable ones rejected (%)")
    ax.set_ylabel("stable ones kept (%)")
    style.finish_axes(ax)


def _name_features(ax: Axes, areas: DataFrame) -> None:
    """List the features below the curves, best first, each in its colour with its area."""
    best_first = areas.loc[list(PANELS)].sort_values("auc", ascending=False)
    lines = [(f"{style.AREA_AXIS} (95 %)", palette.INK)]
    for feature, row in best_first.iterrows():
        area = f"{row['auc']:.2f} ({row['low']:.2f} to {row['high']:.2f})"
        name = style.FEATURE_NAMES[str(feature)]
        lines.append((f"{area}  {name}", palette.FEATURE_COLOURS[str(feature)]))
    ax.set_axis_off()
    ax.set_label("areas")
    for line, (text, colour) in enumerate(lines):
        place = {"transform": ax.transAxes, "ha": "left", "va": "top"}
        ax.text(0.0, 0.95 - 0.2 * line, text, color=colour, fontsize=style.SMALL, **place)


if __name__ == "__main__":
    raise SystemExit(main(draw, TABLES))
