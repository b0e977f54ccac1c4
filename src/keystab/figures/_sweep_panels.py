"""Panels that figures 10 to 12 share: what happens to keypoints when one value is swept."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from keystab.errors import InputError
from keystab.figures import style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from pandas import DataFrame

CURVE_COLUMNS = ("percentage_of_images", "percentage_of_unique", "low", "high")
"""Columns of a curve, beside that of the swept value."""

SCALE_COLUMNS = ("sigma_from", "seen_by", "percentage_seen", "low", "high")
"""Columns of the stability against scale, beside that of the swept value."""

Colours = Mapping[float, Any]
"""Swept value -> colour. What is drawn are its values, in its order."""


def require_values(name: str, table: DataFrame, column: str, values: Collection[float]) -> None:
    """Raise `InputError` if a table lacks some of the swept values."""
    missing = sorted(set(values) - set(table[column]))
    if missing:
        raise InputError(f"{name}: has no rows of {column} = {missing[0]:g}; remake the table")


def draw_curves(
    ax: Axes,
    curves: DataFrame,
    column: str,
    colours: Colours,
    banded: Collection[float],
    symbol: str,
    gap: float = 0.08,
) -> None:
    """Draw the percentage of unique keypoints against that of the views that see them.

    Parameters
    ----------
    ax : matplotlib Axes
        The panel.
    curves : DataFrame
        `column` and `CURVE_COLUMNS`.
    column : str
        The swept value.
    colours : mapping
        Colour of each value that is drawn.
    banded : collection of float
        The values whose 95 % bands are drawn.
    symbol : str
        Name of the swept value, over the labels.
    gap : float
        Least distance of the labels; see `label_ends`.
    """
    ends = {}
    for value, colour in colours.items():
        rows = curves[curves[column] == value].sort_values("percentage_of_images")
        x = rows["percentage_of_images"].to_numpy()
        if value in banded:
            draw_band(ax, x, rows["low"], rows["high"], colour)
        ax.plot(x, rows["percentage_of_unique"], color=colour, linewidth=1.2, label=f"{value:g}")
        ends[f"{value:g}"] = (float(rows["percentage_of_unique"].iloc[-1]), colour)
    ax.set(xlim=(0.0, 100.0), ylim=(0.0, 102.0))
    ax.set(xticks=range(0, 101, 25), yticks=range(0, 101, 25))
    ax.set_xlabel(style.VIEWS_AXIS)
    ax.set_ylabel(style.UNIQUE_AXIS)
    style.finish_axes(ax)
    label_ends(ax, ends, symbol, gap)


def draw_against_scale(
    ax: Axes,
    scales: DataFrame,
    column: str,
    colours: Colours,
    quantity: str = "percentage_seen",
    interval: tuple[str, str] | None = ("low", "high"),
) -> dict[str, tuple[float, Any]]:
    """Draw a line per swept value against the first scale of the octave, with 95 % bands.

    Parameters
    ----------
    ax : matplotlib Axes
        The panel; its vertical limits are left to the caller.
    scales : DataFrame
        `column`, ``sigma_from``, `quantity` and the columns of `interval`.
    column : str
        The swept value.
    colours : mapping
        Colour of each value that is drawn.
    quantity : str
        What is drawn.
    interval : pair of str, optional
        Ends of its band; None for no band.

    Returns
    -------
    dict
        For `label_ends`.
    """
    ends = {}
    for value, colour in colours.items():
        rows = scales[scales[column] == value].sort_values("sigma_from")
        x = rows["sigma_from"].to_numpy()
        if interval:
            draw_band(ax, x, rows[interval[0]], rows[interval[1]], colour)
        line = {"color": colour, "linewidth": 1.2, "markersize": 2.5, "label": f"{value:g}"}
        ax.plot(x, rows[quantity], "o-", clip_on=False, **line)
        ends[f"{value:g}"] = (float(rows[quantity].iloc[-1]), colour)
    scale_axis(ax, scales["sigma_from"])
    style.finish_axes(ax)
    return ends


def draw_seen(
    ax: Axes, scales: DataFrame, column: str, colours: Colours, symbol: str, gap: float
) -> None:
    """Draw the percentage of an octave's unique keypoints that are seen often, against scale.

    Parameters
    ----------
    ax : matplotlib Axes
        The panel.
    scales : DataFrame
        `column` and `SCALE_COLUMNS`.
    column, colours, symbol, gap
        See `draw_curves`.
    """
    ends = draw_against_scale(ax, scales, column, colours)
    ax.set(ylim=(0.0, 102.0), yticks=range(0, 101, 25))
    ax.set_ylabel(f"unique keypoints seen in\n≥ {100 * scales['seen_by'].max():g} % of views (%)")
    label_ends(ax, ends, symbol, gap)


def scale_axis(ax: Axes, starts: ArrayLike) -> None:
    """Make the horizontal axis one of first scales: logarithmic, from the first to the last one."""
    from matplotlib.ticker import NullLocator

    ticks = np.unique(np.asarray(starts, dtype=float))
    ax.set_xscale("log")
    if len(ticks) > 1:
        ax.set_xlim(ticks[0], ticks[-1])
    shown = ticks[:: 1 if len(ticks) <= 4 else 2]
    ax.set_xticks(shown, [f"{tick:.3g}" for tick in shown])
    ax.xaxis.set_minor_locator(NullLocator())
    ax.set_xlabel("$\\sigma_{\\mathrm{min}}$ (px)")


def draw_band(ax: Axes, x: ArrayLike, low: ArrayLike, high: ArrayLike, colour: Any) -> None:
    """Draw a band around a line."""
    low, high = np.asarray(low, dtype=float), np.asarray(high, dtype=float)
    ax.fill_between(np.asarray(x), low, high, color=colour, alpha=0.14, linewidth=0)


def label_ends(
    ax: Axes, ends: Mapping[str, tuple[float, Any]], symbol: str = "", gap: float = 0.08
) -> None:
    """Write the name of each line to the right of the panel, where the line ends or near it.

    Parameters
    ----------
    ax : matplotlib Axes
        The panel, with its final limits and scales; lines end at its right edge.
    ends : mapping
        Name -> height at which the line ends, in data coordinates, and colour.
    symbol : str
        What the names are values of; written above the highest. Nothing where they say it.
    gap : float
        Least distance of two names, as a share of the panel's height.
    """
    known = {name: end for name, end in ends.items() if np.isfinite(end[0])}
    if not known:
        return
    to_share = ax.transScale + ax.transLimits
    x = ax.get_xlim()[1]
    heights = [to_share.transform((x, height))[1] for height, _ in known.values()]
    top = [max(heights) + gap] if symbol else []
    places = style.spread([*heights, *top], gap, 0.0, 1.0)
    text: dict[str, Any] = {"fontsize": style.SMALL, "va": "center", "ha": "left"}
    for (name, (_, colour)), height, place in zip(known.items(), heights, places, strict=False):
        ax.annotate(
            name,
            (1.0, height),
            (1.05, place),
            xycoords="axes fraction",
            color=colour,
            arrowprops={
                "arrowstyle": "-",
                "color": colour,
                "linewidth": 0.5,
                "patchA": None,  # to find where a line leaves the text's box takes seconds
                "shrinkA": 2.0,
                "shrinkB": 0.0,
                "relpos": (0.0, 0.5),
            },
            **text,
        )
    if symbol:
        ax.text(1.05, places[-1], symbol, transform=ax.transAxes, **text)
