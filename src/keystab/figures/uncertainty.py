"""Figure uncertainty: what the error bars of keypoints hold, and what their survival says."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from keystab.figures import palette, style
from keystab.figures._render import Tables, check_tables, main

if TYPE_CHECKING:
    from collections.abc import Iterable

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from pandas import DataFrame

PLACE = ("predicted", "against", "kind", "blur", "noise")

TABLES = {
    "uncertainty_coverage.csv": (*PLACE, "method", "quantity", "level", "held", "low", "high"),
    "uncertainty_strata.csv": ("stratum", "part", "method", "quantity", "level", "held"),
    "uncertainty_reliability.csv": (*PLACE, "n", "predicted_survival", "found", "low", "high"),
    "uncertainty_separation.csv": (*PLACE, "guess", "auc"),
}
"""Files read, with the columns that they must have."""

LEVEL = 0.9
"""Ellipses that the panels b to e draw."""

METHODS = {
    "bars": ("error bars", palette.PICTURE_COLOURS[0]),
    "octave": ("one error per octave", palette.PICTURE_COLOURS[1]),
    "inverse_hessian": ("inverse Hessian", palette.PICTURE_COLOURS[2]),
}
"""Names and colours of what is judged."""

CASES = {
    ("shot", "shot"): ("one shot, its noise known", palette.PICTURE_COLOURS[0]),
    ("estimated", "shot"): ("one shot alone", palette.PICTURE_COLOURS[3]),
    ("view", "shot"): ("the view without noise", palette.PICTURE_COLOURS[2]),
    ("shot", "view"): ("one shot, against the view", palette.PICTURE_COLOURS[1]),
}
"""What error bars are predicted from and held against."""

KINDS = {
    "additive": ("additive", palette.PICTURE_COLOURS[0]),
    "signal": ("signal-dependent", palette.PICTURE_COLOURS[2]),
    "jpeg": ("JPEG", palette.PICTURE_COLOURS[1]),
}

STRATA = {"sigma": "scale", "conditioning": "conditioning", "contrast": "contrast"}

GUESSES = {
    "survival": ("survival", palette.PICTURE_COLOURS[0]),
    "contrast": ("contrast", palette.PICTURE_COLOURS[1]),
    "conditioning": ("conditioning", palette.PICTURE_COLOURS[2]),
}


def draw(tables: Tables, draft: bool = False) -> Figure:
    """Draw coverage, reliability and separation.

    Parameters
    ----------
    tables : mapping
        See `TABLES`.
    draft : bool
        Say on the figure that its numbers come from quick settings.

    Returns
    -------
    matplotlib Figure
        a: coverage of ellipses of four probabilities; b: of 90 % ellipses by what they are
        predicted from and held against; c: by kind of noise and camera blur; d: in quarters of the
        keypoints; e: reliability of survival; f: areas under ROC curves.

    Raises
    ------
    InputError
        If a table is unusable.
    """
    check_tables(tables, TABLES)
    coverage = tables["uncertainty_coverage"]
    blur = coverage["blur"].iloc[0]  # the first view is written first
    with style.context():
        figure = style.new_figure(4.4)
        axes = style.panels(figure.add_gridspec(1, 1)[0], 2, 3, hspace=0.05, wspace=0.05).ravel()
        titles = (
            "what ellipses hold",
            "predicted from",
            "noise and blur",
            "quarters of the keypoints",
            "survival",
            "what tells who returns",
        )
        for ax, name, title in zip(axes, "abcdef", titles, strict=True):
            style.letter(ax, name, title)
        _draw_levels(axes[0], _usual(coverage, blur))
        _draw_cases(
            axes[1], coverage[(coverage["kind"] == "additive") & (coverage["blur"] == blur)]
        )
        _draw_kinds(axes[2], coverage, blur)
        _draw_strata(axes[3], tables["uncertainty_strata"])
        _draw_reliability(axes[4], _usual(tables["uncertainty_reliability"], blur))
        _draw_areas(axes[5], _usual(tables["uncertainty_separation"], blur))
        for ax in axes:
            style.finish_axes(ax)
        return style.settle(figure, draft)


def _usual(table: DataFrame, blur: float) -> DataFrame:
    """Rows of the first view with additive noise, predicted from one shot and held against one."""
    return table[
        (table["predicted"] == "shot")
        & (table["against"] == "shot")
        & (table["kind"] == "additive")
        & (table["blur"] == blur)
    ]


def _draw_levels(ax: Axes, rows: DataFrame) -> None:
    """Draw what ellipses hold beyond what they should, at every noise, for every method."""
    position = rows[rows["quantity"] == "position"]
    ax.axhline(0.0, color=palette.GREY, linewidth=0.7, linestyle=":")
    for method, (_, colour) in METHODS.items():
        for noise, part in position[position["method"] == method].groupby("noise"):
            part = part.sort_values("level")
            ax.plot(
                range(len(part)), 100 * (part["held"] - part["level"]), "o-", color=colour,
                linewidth=0.9, label=f"{method} {noise:g}",
            )  # fmt: skip
    levels = np.sort(position["level"].unique())
    ax.set_xticks(range(len(levels)), [f"{100 * level:.0f}" for level in levels])
    ax.set_xlabel("ellipse (%)")
    ax.set_ylabel("held beyond that (points)")
    _name(ax, METHODS.values())


def _draw_cases(ax: Axes, rows: DataFrame) -> None:
    """Draw what 90 % ellipses hold against noise, by what they are predicted from."""
    rows = rows[(rows["method"] == "bars") & (rows["level"] == LEVEL)]
    for (predicted, against), (_, colour) in CASES.items():
        own = rows[(rows["predicted"] == predicted) & (rows["against"] == against)]
        _draw_lines(ax, own, colour, f"{predicted} {against}")
    _coverage_axis(ax, rows)
    _name(ax, CASES.values())


def _draw_kinds(ax: Axes, rows: DataFrame, blur: float) -> None:
    """Draw what 90 % ellipses hold against noise, by its kind, and for other blurs."""
    rows = rows[(rows["method"] == "bars") & (rows["level"] == LEVEL)]
    rows = rows[(rows["predicted"] == "shot") & (rows["against"] == "shot")]
    for kind, (_, colour) in KINDS.items():
        _draw_lines(ax, rows[(rows["kind"] == kind) & (rows["blur"] == blur)], colour, kind)
    others = [each for each in sorted(rows["blur"].unique()) if each != blur]
    lines = ("--", ":", "-.", (0, (1, 3)))
    for other, line in zip(others, lines, strict=False):
        part = rows[(rows["blur"] == other) & (rows["quantity"] == "position")]
        part = part.sort_values("noise")
        ax.plot(part["noise"], 100 * part["held"], color=palette.INK, linestyle=line,
                label=f"blur {other:g}")  # fmt: skip
    _coverage_axis(ax, rows)
    _name(ax, [*KINDS.values(), *((f"blur {other:g} px", palette.INK) for other in others)])


def _draw_lines(ax: Axes, rows: DataFrame, colour: str, label: str) -> None:
    """Draw the coverage of positions with its interval, and that of scales dashed."""
    for quantity, line in (("position", "-"), ("scale", (0, (2, 1)))):
        part = rows[rows["quantity"] == quantity].sort_values("noise")
        if quantity == "position":
            ax.fill_between(
                part["noise"], 100 * part["low"], 100 * part["high"], color=colour, alpha=0.15,
                linewidth=0,
            )  # fmt: skip
        ax.plot(part["noise"], 100 * part["held"], color=colour, linestyle=line,
                linewidth=1.1, label=f"{label} {quantity}")  # fmt: skip


def _coverage_axis(ax: Axes, rows: DataFrame) -> None:
    """Mark what 90 % ellipses should hold, on axes that begin where the data do."""
    ax.axhline(100 * LEVEL, color=palette.GREY, linewidth=0.7, linestyle=":")
    noise = np.sort(rows["noise"].unique())
    style.log_x_axis(ax, noise[0] / 1.15, noise[-1] * 1.15)
    low = min(80.0, 100 * float(rows["held"].min()) - 2)
    ax.set_ylim(low - 0.6 * (100 - low), 100.0)
    ax.set_xlabel("noise")
    ax.set_ylabel(f"held by {100 * LEVEL:.0f} % ellipses (%)")


def _draw_strata(ax: Axes, table: DataFrame) -> None:
    """Draw what 90 % ellipses hold in quarters of the keypoints."""
    rows = table[(table["quantity"] == "position") & (table["level"] == LEVEL)]
    ax.axhline(100 * LEVEL, color=palette.GREY, linewidth=0.7, linestyle=":")
    ticks: list[float] = []
    for place, stratum in enumerate(STRATA):
        at = 5 * place + np.arange(4)
        for method, (_, colour) in METHODS.items():
            part = rows[(rows["stratum"] == stratum) & (rows["method"] == method)]
            held = 100 * part.set_index("part")["held"].reindex(range(4)).to_numpy()
            ax.plot(at, held, "o-", color=colour, linewidth=0.9, label=f"{method} {stratum}")
        ticks.append(float(at.mean()))
    ax.set_xticks(ticks, [f"{name}\nlow to high" for name in STRATA.values()])
    ax.tick_params(axis="x", length=0)
    ax.set_ylabel(f"held by {100 * LEVEL:.0f} % ellipses (%)")


def _draw_reliability(ax: Axes, rows: DataFrame) -> None:
    """Draw the share that returns against the survival that was predicted, for every noise."""
    ax.plot([0, 100], [0, 100], color=palette.GREY, linewidth=0.7, linestyle=":")
    colours = palette.sweep_colours(rows["noise"].unique())
    for noise, colour in colours.items():
        part = rows[rows["noise"] == noise]
        x = 100 * part["predicted_survival"]
        ax.vlines(x, 100 * part["low"], 100 * part["high"], color=colour, linewidth=0.8)
        ax.plot(x, 100 * part["found"], "o-", color=colour, linewidth=0.9, label=f"{noise:g}")
    ax.set(xlim=(0, 100), ylim=(0, 100))
    ax.set_xlabel("survival (%)")
    ax.set_ylabel("found again (%)")
    _name(ax, [(f"noise {noise:g}", colour) for noise, colour in colours.items()])


def _draw_areas(ax: Axes, rows: DataFrame) -> None:
    """Draw the areas under ROC curves against noise."""
    for guess, (_, colour) in GUESSES.items():
        part = rows[rows["guess"] == guess].sort_values("noise")
        ax.plot(part["noise"], part["auc"], "o-", color=colour, linewidth=1.1, label=guess)
    noise = np.sort(rows["noise"].unique())
    style.log_x_axis(ax, noise[0] / 1.15, noise[-1] * 1.15)
    ax.set_ylim(0.4, 1.0)
    ax.set_xlabel("noise")
    ax.set_ylabel("area under the ROC curve")
    _name(ax, GUESSES.values())


def _name(ax: Axes, names: Iterable[tuple[str, Any]]) -> None:
    """Write names in their colours in the lower right corner."""
    place = {"transform": ax.transAxes, "ha": "right", "va": "bottom", "fontsize": style.SMALL}
    for line, (text, colour) in enumerate(reversed(list(names))):
        ax.text(0.98, 0.02 + 0.085 * line, text, color=colour, **place)


if __name__ == "__main__":
    raise SystemExit(main(draw, TABLES))
