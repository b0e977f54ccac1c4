"""Panels that several figures share: stability curves and precision against the sampling.

A stability curve tells, for every p, how many per cent of the unique keypoints are seen in at
least p % of the views; the wider and flatter, the more stable.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from keystab.errors import InputError
from keystab.figures import palette, style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from pandas import DataFrame

CURVE = ("percentage_of_images", "n_unique", "percentage_of_unique", "low", "high")
"""Columns of a stability curve."""

PRECISION = ("n_spo", "detections", "quantity", "mean", "median", "low", "high")
"""Columns of the tables of precision."""

QUANTITIES = {
    "location": ("precision of location", "spread (px)"),
    "log2_sigma": ("precision of scale", "spread (octaves)"),
}
"""Title and vertical axis of the panel of each precision."""


class EndLabel(NamedTuple):
    """What stands to the right of a curve: its height at the end, its name, counts and colour."""

    height: float
    name: str
    counts: str
    colour: Any


def curve(
    ax: Axes,
    rows: DataFrame,
    colour: Any,
    name: str,
    band: float = 0.13,
    **line: Any,
) -> EndLabel:
    """Draw one stability curve with its 95 % band, and return what to write at its end.

    Parameters
    ----------
    ax : matplotlib Axes
        The panel; see `curve_axes`.
    rows : DataFrame
        The columns `CURVE`, of one curve.
    colour : colour
        Of the line and the band.
    name : str
        Written at the end of the curve by `end_labels`; also the label of the line.
    band : float
        Opacity of the band.
    **line
        Further options of the line, for example ``linestyle=":"``.

    Returns
    -------
    EndLabel
        With the counts "seen in all views of seen in any", for example "191 of 420". A curve of
        no keypoints has no percentages; its name stands at 0.
    """
    rows = rows.sort_values("percentage_of_images")
    share, percentage = (rows[column].to_numpy(dtype=np.float64) for column in CURVE[:3:2])
    ax.fill_between(share, rows["low"], rows["high"], color=colour, alpha=band, linewidth=0)
    ax.plot(share, percentage, color=colour, label=name, **({"zorder": 3} | line))
    unique = rows["n_unique"].astype(int)
    end = percentage[-1] if np.isfinite(percentage[-1]) else 0.0
    return EndLabel(end, name, f"{unique.iloc[-1]} of {unique.iloc[0]}", colour)


def end_labels(
    panels: Mapping[Axes, Sequence[EndLabel]],
    heads: Mapping[Axes, tuple[str, str]] | None = None,
    counts: bool = True,
    distance: float = 8.0,
) -> None:
    """Write the names of curves and their counts to the right of panels, none over another.

    Call it last, when everything else is drawn: it needs the height that panels come to have.

    Parameters
    ----------
    panels : mapping from matplotlib Axes to sequence of EndLabel
        Panels of one figure, with the labels that `curve` returned.
    heads : mapping from matplotlib Axes to two str, optional
        What stands above the names and above the counts of some of the panels.
    counts : bool
        Write the counts.
    distance : float
        Least vertical distance of two labels in points.

    Notes
    -----
    Hairlines lead from the ends of the curves to their names.
    """
    from matplotlib.text import Text

    names, numbers = {}, {}
    for ax, labels in panels.items():
        ordered = sorted(labels, key=lambda label: label.height)
        names[ax] = [_end_text(ax, one, one.name, leader=True) for one in ordered]
        numbers[ax] = [_end_text(ax, one, one.counts) for one in ordered] if counts else []
        if heads and ax in heads:
            above = (EndLabel(ax.get_ylim()[1], "", "", palette.GREY), *heads[ax])
            names[ax].append(_end_text(ax, above[0], above[1]))
            numbers[ax].append(_end_text(ax, above[0], above[2]))
    for figure in {ax.figure for ax in panels}:
        figure.draw_without_rendering()
    for ax in panels:
        per_point = ax.figure.dpi / 72
        points = ax.bbox.height / per_point / np.ptp(ax.get_ylim())
        ends = [label.height * points for label in sorted(panels[ax], key=lambda one: one.height)]
        top = ax.get_ylim()[1] * points
        heights = [*style.spread(ends, distance, high=top - distance / 2), top + 8.0]
        up = np.subtract(heights, [*ends, top])
        widths = [Text.get_window_extent(text).width for text in names[ax]]  # without leaders
        right = 10.0 + 5.0 + max(widths, default=0.0) / per_point
        for texts, x in ((names[ax], 10.0), (numbers[ax], right)):
            for text, y in zip(texts, up, strict=False):  # heads are last and may not be there
                text.xyann = (x, y)


def _end_text(ax: Axes, label: EndLabel, text: str, leader: bool = False) -> Any:
    """Write at the height of a curve's end; `end_labels` moves it."""
    line = {"arrowstyle": "-", "linewidth": 0.5, "color": label.colour, "relpos": (0.0, 0.5)}
    return ax.annotate(
        text,
        (ax.get_xlim()[1], label.height),
        (10.0, 0.0),
        textcoords="offset points",
        fontsize=style.SMALL,
        color=label.colour,
        ha="left",
        va="center",
        annotation_clip=False,
        arrowprops=line | {"patchA": None, "shrinkA": 2.0, "shrinkB": 0.0} if leader else None,
    )


def curve_axes(ax: Axes) -> None:
    """Set limits, ticks and names of the axes of a panel of stability curves."""
    ax.set(xlim=(0, 100), ylim=(0, 102))
    ax.set(xticks=np.arange(0, 101, 25), yticks=np.arange(0, 101, 25))
    ax.set_xlabel(style.VIEWS_AXIS)
    ax.set_ylabel(style.UNIQUE_AXIS)
    style.finish_axes(ax)


def precision(ax: Axes, table: DataFrame, quantity: str, medians: bool = False) -> None:
    """Draw the precision of discrete and of refined extrema against the sampling.

    Parameters
    ----------
    ax : matplotlib Axes
        The panel.
    table : DataFrame
        The columns `PRECISION`.
    quantity : str
        A key of `QUANTITIES`.
    medians : bool
        Draw medians as thin lines, where they are above 0.
    """
    table = table[table["quantity"] == quantity]
    lowest, highest = np.inf, 0.0
    for detections, colour in palette.DETECTION_COLOURS.items():
        rows = table[table["detections"] == detections].sort_values("n_spo")
        mean = rows["mean"].to_numpy(dtype=np.float64)
        n_spo = rows["n_spo"].to_numpy()
        lower, upper = (rows[end].to_numpy(dtype=np.float64) for end in ("low", "high"))
        ax.fill_between(n_spo, lower, upper, color=colour, alpha=0.18, linewidth=0)
        ax.plot(n_spo, mean, "o-", color=colour, label=detections, markersize=2.6, linewidth=1.2)
        if medians:
            median = rows["median"].to_numpy(dtype=np.float64)
            ax.plot(n_spo, median, color=colour, label=f"{detections}, median", linewidth=0.6)
            lower = np.fmin(lower, median)
        if len(rows):
            # The name stands above its curve; below the lower one, unless its median is there.
            beneath = detections == "refined" and not medians
            edge = lower if beneath else upper
            edge = np.where(edge > 0, edge, np.where(mean > 0, mean, 1e-9))
            beside = np.linspace(0.35 * n_spo[0] + 0.65 * n_spo[-1], n_spo[-1])
            heights = np.exp(np.interp(beside, n_spo, np.log(edge)))
            height, up = (heights.min(), -6.0) if beneath else (heights.max(), 5.0)
            style.direct_label(ax, n_spo[-1], height, detections, colour, up=up)
        seen = np.concatenate([mean, lower, upper])
        seen = seen[seen > 0]
        if seen.size:
            lowest, highest = min(lowest, seen.min()), max(highest, seen.max())
    if not highest:
        raise InputError(f"there is no {quantity} above 0 to draw; remake the tables of precision")
    if medians:
        place = {"transform": ax.transAxes, "color": palette.GREY, "fontsize": style.SMALL}
        ax.text(0.04, 0.03, "thin: median", **place)
    style.log_y_axis(ax, (0.8 if medians else 0.55) * lowest, 1.6 * highest)
    ax.set_ylabel(QUANTITIES[quantity][1])
    style.sampling_axis(ax, table["n_spo"])
    style.finish_axes(ax)


def views_figure(curves: DataFrame, table: DataFrame, draft: bool = False) -> Figure:
    """Draw figures 8 and S1: stability curves at two samplings, and precision at all.

    Parameters
    ----------
    curves : DataFrame
        ``n_spo, detections`` and the columns `CURVE`.
    table : DataFrame
        The columns `PRECISION`.
    draft : bool
        Say on the figure that its numbers come from quick settings.

    Returns
    -------
    matplotlib Figure
        a: the curves of the coarser sampling dashed, those of the finer one solid; b: precision of
        the location; c: of the scale.
    """
    with style.context():
        figure = style.new_figure(2.75)
        stable, place, scale = style.panels(
            figure.add_gridspec(1, 1)[0], 1, 3, width_ratios=(1.35, 1.0, 1.0), wspace=0.03
        )[0]
        style.letter(stable, "a", "stability")
        curve_axes(stable)
        labels = []
        finest = curves["n_spo"].max()
        for n_spo in sorted(curves["n_spo"].unique()):
            for detections, colour in palette.DETECTION_COLOURS.items():
                rows = curves[(curves["n_spo"] == n_spo) & (curves["detections"] == detections)]
                if len(rows):
                    dashes = "-" if n_spo == finest else style.COARSE
                    labels.append(
                        curve(stable, rows, colour, f"{n_spo}, {detections}", linestyle=dashes)
                    )
        for ax, name, quantity in ((place, "b", "location"), (scale, "c", "log2_sigma")):
            style.letter(ax, name, QUANTITIES[quantity][0])
            precision(ax, table, quantity, medians=quantity == "location")
        end_labels({stable: labels}, {stable: (style.N_SPO, "seen in all")})
        return style.settle(figure, draft)
