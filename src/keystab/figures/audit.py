"""Figure audit: detectors of others against what is there."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from keystab.figures import palette, style
from keystab.figures._render import Tables, check_tables, main

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import NDArray
    from pandas import DataFrame

_ENDS = ("", "_low", "_high")
_WITH_ENDS = ("bias_y", "bias_x", "error_median", "recall", "precision", "own_recall")

TABLES = {
    "audit.csv": (
        *("detector", "setting", "condition", "problem", "chance", "error_p90"),
        *("repeatability_1", "repeatability_matched"),
        *(f"{name}{end}" for name in _WITH_ENDS for end in _ENDS),
    ),
    "audit_octaves.csv": (
        *("detector", "setting", "condition", "sigma_low", "sigma_high"),
        *(f"{name}{end}" for name in ("bias_y", "bias_x", "recall") for end in _ENDS),
    ),
}
"""Files read, with the columns that they must have."""

BLOBS, SCENE, TURNED, NOISY = "blobs", "translations", "rotation 90", "noise 0.03"

_CLEAR = {"facecolor": "white", "edgecolor": "none", "pad": 0.6, "alpha": 0.8}  # of lines beneath

FARTHEST = 0.35
"""Pixels at which panels a and b end; what lies beyond stands there as a number."""


def draw(tables: Tables, draft: bool = False) -> Figure:
    """Draw what an audit found: a row for each setting of each detector.

    Parameters
    ----------
    tables : mapping
        See `TABLES`.
    draft : bool
        Say on the figure that its numbers come from quick settings.

    Returns
    -------
    matplotlib Figure
        a: bias on isolated blobs; b: bias by octave, on the scene; c: errors on the scene; d:
        recall and precision; e: repeatability within a pixel. A row without numbers says "failed",
        or "too few" where so little was found that numbers have no interval.

    Raises
    ------
    InputError
        If a table is unusable.
    """
    check_tables(tables, TABLES)
    table = tables["audit"]
    names = list(dict.fromkeys(zip(table["detector"], table["setting"], strict=True)))
    with style.context():
        figure = style.new_figure(0.95 + 0.155 * len(names))
        axes = style.panels(
            figure.add_gridspec(1, 1)[0], 1, 5, wspace=0.02, width_ratios=(1, 1, 1, 1, 1)
        )[0]
        by = {
            name: rows.set_index(["detector", "setting"]).reindex(names)
            for name, rows in table.groupby("condition", sort=False)
        }
        nothing = table.iloc[:0].set_index(["detector", "setting"]).reindex(names)
        scene = by.get(SCENE, nothing)
        titles = ("bias, blobs", "bias, scene", "error", "found", "same to 1 px")
        for ax, letter, title in zip(axes, "abcde", titles, strict=True):
            style.letter(ax, letter, title)
            ax.set_ylim(len(names) - 0.5, -0.5)
            ax.set_yticks(range(len(names)), [""] * len(names))
            for at in range(0, len(names), 2):
                ax.axhspan(at - 0.5, at + 0.5, color=palette.PALE, alpha=0.35, linewidth=0)
        labels = [f"{detector}, {setting}" for detector, setting in names]
        axes[0].set_yticks(range(len(names)), labels)
        _draw_bias(axes[0], by.get(BLOBS, nothing))
        _draw_octaves(axes[1], tables["audit_octaves"], names)
        _draw_errors(axes[2], scene)
        _draw_found(axes[3], scene)
        _draw_repeated(axes[4], by.get(TURNED, nothing), by.get(NOISY, nothing))
        for ax, name in zip(axes, (BLOBS, SCENE, SCENE, SCENE, TURNED), strict=True):
            if name in by:
                _say_why(ax, by[name]["problem"].tolist())
        return style.settle(figure, draft)


def _dots(
    ax: Axes, rows: DataFrame, name: str, colour: str, up: float, times: float = 1.0
) -> NDArray[np.float64]:
    """Draw a number of every row with its interval; none that has no interval. Returns these."""
    place = np.arange(len(rows)) + up
    low, high = (times * rows[f"{name}{end}"].to_numpy(dtype=float) for end in ("_low", "_high"))
    value = times * rows[name].to_numpy(dtype=float)
    value = np.where(np.isnan(low) | np.isnan(high), np.nan, value)
    ax.hlines(place, low, high, color=colour, linewidth=0.9)
    ax.plot(value, place, "o", color=colour, markersize=2.6, label=name)
    return value


def _end_at(ax: Axes, values: list[NDArray[np.float64]], colours: Sequence[str]) -> None:
    """End an axis, and write what lies beyond beside an arrow there."""
    ax.set(xlim=(-FARTHEST, FARTHEST), xticks=(-0.2, 0.0, 0.2))
    for side, marker, align in ((-1, "<", "left"), (1, ">", "right")):
        beyond = [side * each > FARTHEST for each in values]
        for far, up, colour in zip(beyond, (-0.16, 0.16), colours, strict=False):
            place = np.flatnonzero(far)
            ax.plot(
                np.full(len(place), 0.96 * side * FARTHEST), place + up, marker, color=colour,
                markersize=2.6, label="beyond",
            )  # fmt: skip
        for row in np.flatnonzero(np.any(beyond, axis=0)):
            numbers = [
                f"{each[row]:+.2f}" for each, far in zip(values, beyond, strict=True) if far[row]
            ]
            ax.annotate(
                ", ".join(dict.fromkeys(numbers)), (side * FARTHEST, row), (-side * 4, 0),
                textcoords="offset points", ha=align, va="center_baseline", fontsize=style.SMALL,
                bbox=_CLEAR,
            )  # fmt: skip


def _say_why(ax: Axes, problems: list[object]) -> None:
    """Write into each row without numbers why there are none."""
    drawn = np.zeros(len(problems), dtype=bool)
    for line in ax.lines:
        if line.get_marker() not in ("None", "|"):
            x, y = (np.asarray(each, dtype=float) for each in line.get_data())
            drawn[np.round(y[np.isfinite(x)]).astype(int)] = True
    for row in np.flatnonzero(~drawn):
        failed = isinstance(problems[row], str) and problems[row] != ""
        ax.text(
            0.5, row, "failed" if failed else "too few", transform=ax.get_yaxis_transform(),
            color=palette.GREY, fontsize=style.SMALL, ha="center", va="center_baseline",
            bbox=_CLEAR,
        )  # fmt: skip


def _list(ax: Axes, names: list[tuple[str, str]]) -> None:
    """Write what colours mean below the axis."""
    text = "   ".join(name for name, _ in names)
    ax.set_xlabel(text, fontsize=style.SMALL)
    if len(names) > 1:
        ax.set_xlabel("")
        for k, (name, colour) in enumerate(names):
            ax.annotate(
                name, (0.02, 0), (0, -19 - 9 * k), xycoords="axes fraction",
                textcoords="offset points", color=colour, fontsize=style.SMALL, va="top",
            )  # fmt: skip


def _draw_bias(ax: Axes, rows: DataFrame) -> None:
    colours = palette.AXIS_COLOURS
    values = [
        _dots(ax, rows, f"bias_{axis}", colours[axis], up)
        for axis, up in (("y", -0.16), ("x", 0.16))
    ]
    ax.axvline(0.0, color=palette.GREY, linewidth=0.6)
    _end_at(ax, values, (colours["y"], colours["x"]))
    _list(ax, [("y, median (px)", colours["y"]), ("x", colours["x"])])
    style.finish_axes(ax)


def _draw_octaves(ax: Axes, table: DataFrame, names: list[tuple[str, str]]) -> None:
    rows = table[table["condition"] == SCENE]
    colours = palette.OCTAVE_COLOURS
    values = []
    for low, up, colour in zip(
        sorted(set(rows["sigma_low"])), (-0.16, 0.16), colours, strict=False
    ):
        own = rows[rows["sigma_low"] == low].set_index(["detector", "setting"]).reindex(names)
        values.append(_dots(ax, own, "bias_y", colour, up))
    ax.axvline(0.0, color=palette.GREY, linewidth=0.6)
    _end_at(ax, values, colours)
    _list(ax, [("y, first octave (px)", colours[0]), ("second octave", colours[1])])
    style.finish_axes(ax)


def _draw_errors(ax: Axes, rows: DataFrame) -> None:
    place = np.arange(len(rows))
    known = np.isfinite(_dots(ax, rows, "error_median", palette.INK, 0.0))
    ax.plot(
        rows["error_p90"].where(known),
        place,
        "|",
        color=palette.GREY,
        markersize=6.0,
        label="error_p90",
    )
    ax.set_xscale("log")
    values = rows.loc[known, ["error_median", "error_p90"]].to_numpy(dtype=float)
    values = values[np.isfinite(values) & (values > 0)]
    if len(values):
        ax.set_xlim(0.6 * values.min(), 1.6 * values.max())
    _list(ax, [("median (px)", palette.INK), ("nine in ten", palette.GREY)])
    style.finish_axes(ax)


def _draw_found(ax: Axes, rows: DataFrame) -> None:
    colours = {"recall": palette.CHANGE_COLOURS["new"], "precision": palette.CHANGE_COLOURS["lost"]}
    _dots(ax, rows, "recall", colours["recall"], -0.16, 100.0)
    _dots(ax, rows, "precision", colours["precision"], 0.16, 100.0)
    ax.plot(100 * rows["chance"], np.arange(len(rows)), "|", color=palette.GREY, markersize=5.0)
    ax.set_xlim(-4, 106)
    names = ("recall (%)", "precision", "chance")
    _list(ax, list(zip(names, (*colours.values(), palette.GREY), strict=True)))
    style.finish_axes(ax)


def _draw_repeated(ax: Axes, turned: DataFrame, noisy: DataFrame) -> None:
    place = np.arange(len(turned))
    for rows, colour, up in ((turned, palette.INK, -0.16), (noisy, palette.NOISY_COLOUR, 0.16)):
        ax.plot(100 * rows["repeatability_1"], place + up, "o", color=colour, markersize=2.6)
        ax.plot(
            100 * rows["repeatability_matched"], place + up, "o", color=colour, markersize=4.0,
            markerfacecolor="none",
        )  # fmt: skip
    ax.set_xlim(-4, 106)
    names = ("turned by 90° (%)", "noise 0.03 (rings:", "at matched number)")
    colours = (palette.INK, palette.NOISY_COLOUR, palette.NOISY_COLOUR)
    _list(ax, list(zip(names, colours, strict=True)))
    style.finish_axes(ax)


if __name__ == "__main__":
    raise SystemExit(main(draw, TABLES))
