"""Figure 10: what aliasing does to keypoints (section 6.1)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from keystab.figures import palette, style
from keystab.figures._render import Tables, check_tables, main
from keystab.figures._sweep_panels import CURVE_COLUMNS, Colours, draw_curves, require_values

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from pandas import DataFrame

TABLES = {
    "fig10_counts.csv": ("blur", "mean_detections", "low_detections", "high_detections"),
    "fig10_curves.csv": ("blur", *CURVE_COLUMNS),
}
"""Files read, with the columns that they must have."""


def draw(tables: Tables, draft: bool = False) -> Figure:
    """Draw the number of keypoints against the camera blur, and the curves of stability.

    Parameters
    ----------
    tables : mapping
        ``fig10_counts``: one row per blur; ``fig10_curves``: one row per blur and number of views.
    draft : bool
        Say on the figure that its numbers come from quick settings.

    Returns
    -------
    matplotlib Figure
        a: mean number of keypoints per view against the camera blur; b: percentage of unique
        keypoints against that of the views that see them, one curve per blur, with the bands of
        the lowest, the middle and the highest.

    Raises
    ------
    InputError
        If a table is unusable, or lacks one of the blurs.
    """
    check_tables(tables, TABLES)
    counts = tables["fig10_counts"].sort_values("blur")
    blurs = counts["blur"].to_list()
    require_values("fig10_curves.csv", tables["fig10_curves"], "blur", blurs)
    colours = palette.sweep_colours(blurs)
    with style.context():
        figure = style.new_figure(2.7)
        grid = figure.add_gridspec(1, 1)[0]
        number, stability = style.panels(grid, 1, 2, wspace=0.05)[0]
        _draw_counts(number, counts, colours)
        style.letter(stability, "b", "stability under translation")
        banded = {blurs[0], blurs[len(blurs) // 2], blurs[-1]}
        draw_curves(stability, tables["fig10_curves"], "blur", colours, banded, "$c$ (px)")
        return style.settle(figure, draft)


def _draw_counts(ax: Axes, counts: DataFrame, colours: Colours) -> None:
    """Draw the mean number of keypoints per view, with its 95 % interval, from zero."""
    style.letter(ax, "a", "number of keypoints")
    blur, mean = counts["blur"].to_numpy(), counts["mean_detections"].to_numpy()
    ends = counts["low_detections"].to_numpy(), counts["high_detections"].to_numpy()
    ax.plot(blur, mean, color=palette.GREY, linewidth=0.8, zorder=1, label="mean_detections")
    ax.vlines(blur, *ends, colors=list(colours.values()), linewidth=1.2, zorder=2)
    ax.scatter(blur, mean, s=14, c=list(colours.values()), zorder=3)
    ax.set_xlim(0.0, 1.06 * blur[-1])
    ax.set_ylim(0.0, 1.15 * np.nanmax([*ends[1], *mean, 1.0]))
    ax.set_xlabel(style.BLUR_AXIS)
    ax.set_ylabel("keypoints per view")
    style.finish_axes(ax)


if __name__ == "__main__":
    raise SystemExit(main(draw, TABLES))
