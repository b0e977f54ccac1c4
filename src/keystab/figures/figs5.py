"""Figure S5: stability and precision when the scene is seen from the side (section 5.5)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from keystab.errors import InputError
from keystab.figures import palette, style
from keystab.figures._render import Tables, check_tables, main
from keystab.figures._stability_panels import QUANTITIES, EndLabel, end_labels
from keystab.figures._sweep_panels import draw_band

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from pandas import DataFrame

TABLES = {
    "figS5_counts.csv": (
        *("tilt", "n_spo", "detections", "n_unique", "n_always", "share_always"),
        *("low_always", "high_always"),
    ),
    "figS5_precision.csv": ("tilt", "n_spo", "detections", "quantity", "mean", "low", "high"),
}
"""Files read, with the columns that they must have."""


def draw(tables: Tables, draft: bool = False) -> Figure:
    """Draw stability and precision of discrete and refined extrema against the tilt.

    Parameters
    ----------
    tables : mapping
        ``figS5_counts`` and ``figS5_precision``: of a view that looks straight at the scene and
        those of one tilt, for each tilt, sampling and kind of detection.
    draft : bool
        Say on the figure that its numbers come from quick settings.

    Returns
    -------
    matplotlib Figure
        The coarser sampling dashed, the finer one solid. a: share of the unique keypoints that is
        seen in all views, with 95 % Wilson bands; b: precision of the location in pixels of the
        view that looks straight; c: of the scale.

    Raises
    ------
    InputError
        If a table is unusable.
    """
    check_tables(tables, TABLES)
    counts, precision = tables["figS5_counts"], tables["figS5_precision"]
    with style.context():
        figure = style.new_figure(2.75)
        stable, place, scale = style.panels(
            figure.add_gridspec(1, 1)[0], 1, 3, width_ratios=(1.2, 1.0, 1.0), wspace=0.04
        )[0]
        style.letter(stable, "a", "seen in all views")
        labels = _draw_shares(stable, counts)
        for ax, name, quantity in ((place, "b", "location"), (scale, "c", "log2_sigma")):
            style.letter(ax, name, QUANTITIES[quantity][0])
            _draw_precision(ax, precision[precision["quantity"] == quantity], quantity)
        end_labels({stable: labels}, {stable: (style.N_SPO, "")}, counts=False)
        return style.settle(figure, draft)


def _lines(table: DataFrame) -> list[tuple[DataFrame, str, object, str]]:
    """Rows, name, dashes and colour of each line: of each sampling and kind of detection."""
    found: list[tuple[DataFrame, str, object, str]] = []
    finest = table["n_spo"].max()
    for n_spo in sorted(table["n_spo"].unique()):
        for detections, colour in palette.DETECTION_COLOURS.items():
            rows = table[(table["n_spo"] == n_spo) & (table["detections"] == detections)]
            dashes = "-" if n_spo == finest else style.COARSE
            if len(rows):
                name = f"{n_spo}, {detections}"
                found.append((rows.sort_values("tilt"), name, dashes, colour))
    return found


def _draw_shares(ax: Axes, table: DataFrame) -> list[EndLabel]:
    """Draw the shares; return what stands at the ends of their lines."""
    labels = []
    for rows, name, dashes, colour in _lines(table):
        share, low, high = (100 * rows[f"{part}_always"] for part in ("share", "low", "high"))
        draw_band(ax, rows["tilt"], low, high, colour)
        look = {"color": colour, "linestyle": dashes, "linewidth": 1.2, "label": name}
        ax.plot(rows["tilt"], share, marker="o", markersize=2.6, **look)
        labels.append(EndLabel(float(share.iloc[-1]), name, "", colour))
    ax.set(ylim=(0, 102), yticks=range(0, 101, 25))
    ax.set_ylabel(style.UNIQUE_AXIS)
    _tilt_axis(ax, table)
    return labels


def _draw_precision(ax: Axes, table: DataFrame, quantity: str) -> None:
    """Draw means with their bands, on a logarithmic axis."""
    seen = [np.empty(0)]
    for rows, name, dashes, colour in _lines(table):
        draw_band(ax, rows["tilt"], rows["low"], rows["high"], colour)
        look = {"color": colour, "linestyle": dashes, "linewidth": 1.2, "label": name}
        ax.plot(rows["tilt"], rows["mean"], marker="o", markersize=2.6, **look)
        seen += [rows[part].to_numpy(dtype=np.float64) for part in ("mean", "low", "high")]
    above = np.concatenate(seen)
    above = above[above > 0]
    if not above.size:
        raise InputError(f"there is no {quantity} above 0 to draw; remake the tables of figure S5")
    style.log_y_axis(ax, 0.7 * float(above.min()), 1.4 * float(above.max()))
    ax.set_ylabel(QUANTITIES[quantity][1])
    _tilt_axis(ax, table)


def _tilt_axis(ax: Axes, table: DataFrame) -> None:
    tilts = sorted(table["tilt"].unique())
    ax.set(xticks=tilts, xlim=(min(tilts) - 1.5, max(tilts) + 1.5))
    ax.set_xticklabels([f"{tilt:g}" for tilt in tilts])
    ax.set_xlabel("tilt (degrees)")
    style.finish_axes(ax)


if __name__ == "__main__":
    raise SystemExit(main(draw, TABLES))
