"""Figure truth_cameras: what aliasing, an unknown blur and noise cost of the true extrema."""

from __future__ import annotations

from typing import TYPE_CHECKING

from keystab.figures import style
from keystab.figures._recall_panels import SHARES, draw_recall_precision
from keystab.figures._render import Tables, check_tables, main

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from pandas import DataFrame

TABLES = {"truth_views.csv": ("sweep", "value", "n_spo", "detections", *SHARES)}
"""Files read, with the columns that they must have."""

SWEEPS = {
    "aliasing": ("aliasing", style.BLUR_AXIS),
    "unknown_blur": ("unknown blur", "spread of the blur, $\\Delta c$ (px)"),
    "noise": ("noise", style.NOISE_AXIS),
}
"""Sweep -> title and axis of the panels a to c."""


def draw(tables: Tables, draft: bool = False) -> Figure:
    """Draw what refined keypoints of views find of the extrema of the scene.

    Parameters
    ----------
    tables : mapping
        ``truth_views``: one row per set of views, sampling and kind of detection.
    draft : bool
        Say on the figure that its numbers come from quick settings.

    Returns
    -------
    matplotlib Figure
        Recall and precision at the finest sampling against a: the camera blur; b: the spread of an
        unknown one; c: noise.

    Raises
    ------
    InputError
        If the table is unusable.
    """
    check_tables(tables, TABLES)
    with style.context():
        figure = style.new_figure(2.2)
        panels = style.panels(figure.add_gridspec(1, 1)[0], 1, len(SWEEPS), wspace=0.03)[0]
        for ax, letter, (sweep, (title, axis)) in zip(panels, "abc", SWEEPS.items(), strict=True):
            style.letter(ax, letter, title)
            _draw_sweep(ax, tables["truth_views"], sweep)
            ax.set_xlabel(axis)
        return style.settle(figure, draft)


def _draw_sweep(ax: Axes, table: DataFrame, sweep: str) -> None:
    """Draw recall and precision of refined keypoints of views against the scene."""
    rows = table[(table["sweep"] == sweep) & (table["detections"] == "refined")]
    rows = rows[rows["n_spo"] == rows["n_spo"].max()].sort_values("value")
    values = rows["value"].to_numpy()
    if len(values):
        ax.set_xlim(0.0, values[-1])
        draw_recall_precision(ax, values, rows)


if __name__ == "__main__":
    raise SystemExit(main(draw, TABLES))
