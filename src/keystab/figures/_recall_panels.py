"""Recall and precision in one panel, as figures truth and truth_cameras draw them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from numpy.typing import ArrayLike

from keystab.figures import palette, style
from keystab.figures._sweep_panels import draw_band, label_ends

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from pandas import DataFrame

SHARES = ("recall", "recall_low", "recall_high", "precision", "precision_low", "precision_high")
"""Columns of both shares, between 0 and 1, with their intervals."""


def draw_recall_precision(ax: Axes, x: ArrayLike, rows: DataFrame, bottom: float = 0.0) -> None:
    """Draw both shares with their bands, named where they end.

    Parameters
    ----------
    ax : matplotlib Axes
        The panel, its horizontal axis already of the kind that it will be.
    x : array_like, shape (n,)
        Place of each row, increasing.
    rows : DataFrame, n rows
        The columns `SHARES`.
    bottom : float
        Where the vertical axis begins, in per cent; it ends at 100.
    """
    colours = {"recall": palette.CHANGE_COLOURS["new"], "precision": palette.CHANGE_COLOURS["lost"]}
    ends = {}
    for name, colour in colours.items():
        share, low, high = (100 * rows[f"{name}{part}"] for part in ("", "_low", "_high"))
        draw_band(ax, x, low, high, colour)
        ax.plot(x, share, "o-", color=colour, label=name, linewidth=1.2, clip_on=False)
        ends[name] = (float(share.iloc[-1]), colour)
    ax.set_ylim(bottom, 100 + 0.03 * (100 - bottom))
    ax.set_ylabel(style.RIGHT_AXIS)
    style.finish_axes(ax)
    label_ends(ax, ends, gap=0.1)
