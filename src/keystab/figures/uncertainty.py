"""Figure uncertainty: what the error bars of keypoints hold, and what they are good for."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from keystab.figures import palette, style
from keystab.figures._render import Tables, check_tables, main

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from pandas import DataFrame

PLACE = ("predicted", "against", "kind", "blur", "noise")

TABLES = {
    "uncertainty_coverage.csv": (*PLACE, "method", "quantity", "level", "n", "held", "low", "high"),
    "uncertainty_strata.csv": ("stratum", "part", "method", "quantity", "level", "held"),
    "uncertainty_reliability.csv": (*PLACE, "predicted_survival", "found", "low", "high"),
    "uncertainty_separation.csv": (*PLACE, "guess", "auc"),
    "uncertainty_weights.csv": (
        *("task", "noise", "weights", "kept"),
        *("ratio", "ratio_low", "ratio_high"),
    ),
}
"""Files read, with the columns that they must have."""

LEVEL = 0.9
"""Ellipses that all panels but the first draw."""

BLUE, ORANGE, GREEN, VIOLET, _ = palette.PICTURE_COLOURS

METHODS = {
    "bars": ("error bars", BLUE),
    "inverse_hessian": ("inverse Hessian", GREEN),
    "octave": ("one per octave", ORANGE),
}
"""Names and colours of what is judged."""

CASES = {
    ("shot", "shot"): ("one shot, noise given", BLUE),
    ("estimated", "shot"): ("one shot, noise estimated", VIOLET),
    ("view", "shot"): ("noiseless view", GREEN),
    ("shot", "view"): ("against noiseless view", ORANGE),
}
"""What error bars are predicted from; all but the last are held against a second shot."""

KINDS = {
    "additive": ("additive", BLUE),
    "signal": ("signal-dependent", GREEN),
    "jpeg": ("JPEG", ORANGE),
}

REGIONS = {"position": "ellipses", "scale": "intervals"}
"""What error bars are of a place, and of a number."""

STRATA = {"sigma": "scale", "conditioning": "conditioning", "contrast": "contrast"}

GUESSES = {
    "survival": ("survival", BLUE),
    "contrast": ("contrast", ORANGE),
    "conditioning": ("conditioning", GREEN),
}

TASKS = {
    "translation": ("translation", BLUE),
    "homography": ("homography", ORANGE),
    "triangulation": ("depth", GREEN),
}
"""What keypoints are asked for, and colours."""

KNOWN, ALONE = ("shot", "shot"), ("estimated", "shot")

_ASIDE = 1.045
"""Lines that hold as much stand beside each other by this factor of the noise."""


def draw(tables: Tables, draft: bool = False) -> Figure:
    """Draw coverage, reliability, separation, and what weights are good for.

    Parameters
    ----------
    tables : mapping
        See `TABLES`.
    draft : bool
        Say on the figure that its numbers come from quick settings.

    Returns
    -------
    matplotlib Figure
        a: coverage of ellipses of four probabilities; b, c: of 90 % ellipses of the position and
        intervals of the scale, by what they are predicted from and held against; d: by kind of
        noise; e: by camera blur; f: in quarters of the keypoints; g: reliability of survival; h:
        areas under ROC curves; i: errors of motion and depth with weights over those without.

    Raises
    ------
    InputError
        If a table is unusable.
    """
    check_tables(tables, TABLES)
    coverage = tables["uncertainty_coverage"]
    blur = _first_blur(coverage)
    bars = coverage[(coverage["method"] == "bars") & (coverage["level"] == LEVEL)]
    position = bars[bars["quantity"] == "position"]
    additive = bars[(bars["kind"] == "additive") & (bars["blur"] == blur)]
    with style.context():
        figure = style.new_figure(6.6)
        grid = figure.add_gridspec(1, 1)[0]
        axes = style.panels(grid, 3, 3, hspace=0.05, wspace=0.05).ravel()
        titles = (
            "what ellipses hold", "position, predicted from", "scale, predicted from",
            "position, by kind of noise", "position, by camera blur", "position, in quarters",
            "survival", "what tells who returns", "errors with weights",
        )  # fmt: skip
        for ax, name, title in zip(axes, "abcdefghi", titles, strict=True):
            style.letter(ax, name, title)
        _draw_levels(axes[0], _usual(coverage, blur))
        for ax, quantity in zip(axes[1:3], ("position", "scale"), strict=True):
            _draw_cases(ax, additive[additive["quantity"] == quantity], REGIONS[quantity])
        _draw_kinds(axes[3], position[position["blur"] == blur])
        _draw_blurs(axes[4], position[position["kind"] == "additive"])
        _draw_strata(axes[5], tables["uncertainty_strata"])
        _draw_reliability(axes[6], _usual(tables["uncertainty_reliability"], blur))
        _draw_areas(axes[7], _usual(tables["uncertainty_separation"], blur))
        _draw_weights(axes[8], tables["uncertainty_weights"])
        for ax in axes:
            style.finish_axes(ax)
        return style.settle(figure, draft)


def _first_blur(table: DataFrame) -> float:
    """Blur of the first view, the one that is seen with all kinds of noise."""
    others = table[table["kind"] != "additive"]
    return float((others if len(others) else table)["blur"].iloc[0])


def _usual(table: DataFrame, blur: float) -> DataFrame:
    """Rows of the first view with additive noise, predicted from one shot and held against one."""
    rows = _case(table, KNOWN)
    return rows[(rows["kind"] == "additive") & (rows["blur"] == blur)]


def _case(table: DataFrame, case: tuple[str, str]) -> DataFrame:
    return table[(table["predicted"] == case[0]) & (table["against"] == case[1])]


def _draw_levels(ax: Axes, rows: DataFrame) -> None:
    """Draw what ellipses hold beyond what they should, all noises together and their range."""
    position = rows[rows["quantity"] == "position"]
    levels = np.sort(position["level"].unique())
    ax.axhline(0.0, color=palette.GREY, linewidth=0.7, linestyle=style.REFERENCE)
    for shift, (method, (_, colour)) in zip((-0.13, 0.0, 0.13), METHODS.items(), strict=True):
        own = position[position["method"] == method]
        beyond = 100 * (own["held"] - own["level"])
        together = (own["n"] * beyond).groupby(own["level"]).sum()
        together /= own["n"].groupby(own["level"]).sum()
        ends = beyond.groupby(own["level"]).agg(["min", "max"])
        at = shift + np.arange(len(together))
        ax.vlines(at, ends["min"], ends["max"], color=colour, linewidth=1.0)
        ax.plot(at, together, "o-", color=colour, linewidth=1.0, label=method)
    ax.set_xticks(range(len(levels)), [f"{100 * level:.0f}" for level in levels])
    low, high = ax.get_ylim()
    ax.set_ylim(low - 0.45 * (high - low), high)
    ax.set_xlabel("ellipses that should hold (%)")
    ax.set_ylabel("excess held (points)")
    _name(ax, list(METHODS.values()))


def _draw_cases(ax: Axes, rows: DataFrame, regions: str) -> None:
    """Draw what is held against noise, by what it is predicted from, side by side."""
    for place, (case, (_, colour)) in enumerate(CASES.items()):
        _draw_line(ax, _case(rows, case), colour, f"{case[0]} {case[1]}", shift=place - 1.5)
    _coverage_axis(ax, rows, regions)
    _name(ax, list(CASES.values()))


def _draw_kinds(ax: Axes, rows: DataFrame) -> None:
    """Draw what is held against noise by its kind; open dots where it is estimated."""
    for place, (kind, (_, colour)) in enumerate(KINDS.items()):
        own, shift = rows[rows["kind"] == kind], place - 1.0
        _draw_line(ax, _case(own, KNOWN), colour, f"{kind} known", shift=shift)
        _draw_line(ax, _case(own, ALONE), colour, f"{kind} alone", "white", shift)
    _coverage_axis(ax, rows)
    _name(ax, [*KINDS.values(), ("open: estimated", palette.GREY)])


def _draw_blurs(ax: Axes, rows: DataFrame) -> None:
    """Draw what is held against noise by the camera's blur; open dots where it is estimated."""
    colours = palette.sweep_colours(rows["blur"].unique())
    for place, (blur, colour) in enumerate(colours.items()):
        own, shift = rows[rows["blur"] == blur], place - (len(colours) - 1) / 2
        _draw_line(ax, _case(own, KNOWN), colour, f"{blur:g} known", shift=shift)
        _draw_line(ax, _case(own, ALONE), colour, f"{blur:g} alone", "white", shift)
    _coverage_axis(ax, rows)
    names = [(f"{blur:g} px", colour) for blur, colour in colours.items()]
    _name(ax, [*names, ("open: estimated", palette.GREY)])


def _draw_line(
    ax: Axes, rows: DataFrame, colour: Any, label: str, face: Any = None, shift: float = 0.0
) -> None:
    """Draw a coverage with its interval against noise, some steps aside of those beside it."""
    line = {"linewidth": 1.0} if face is None else {"linewidth": 0.6, "markerfacecolor": face}
    rows = rows.sort_values("noise")
    at = rows["noise"] * _ASIDE**shift
    ax.vlines(at, 100 * rows["low"], 100 * rows["high"], color=colour, linewidth=0.8)
    ax.plot(at, 100 * rows["held"], "o-", color=colour, markersize=2.8, label=label, **line)


def _coverage_axis(ax: Axes, rows: DataFrame, regions: str = REGIONS["position"]) -> None:
    """Mark what should be held, and leave room for names below what is."""
    ax.axhline(100 * LEVEL, color=palette.GREY, linewidth=0.7, linestyle=style.REFERENCE)
    noise = np.sort(rows["noise"].unique())
    _noise_axis(ax, noise)
    low = min(82.0, 100 * float(rows["low"].min()) - 1)
    # Names stand on the right, where noise is large: what dips on the left needs no room below.
    least = min(82.0, 100 * float(rows.loc[rows["noise"] == noise[-1], "low"].min()) - 1)
    ax.set_ylim(min(low, least - 0.6 * (100 - least)), 100.0)
    ax.set_ylabel(f"held by {100 * LEVEL:.0f} % {regions} (%)")


def _noise_axis(ax: Axes, noise: Any) -> None:
    """Mark the noises that were measured, or round ones where these are many or close."""
    noise = np.sort(noise)
    style.log_x_axis(ax, noise[0] / 1.15, noise[-1] * 1.15)
    if len(noise) < 6 and (np.diff(np.log(noise)) > 0.15 * np.log(noise[-1] / noise[0])).all():
        ax.set_xticks(noise, [f"{level:g}" for level in noise])
        ax.set_xticks([], minor=True)
    ax.set_xlim(noise[0] / 1.25, noise[-1] * 1.25)
    ax.set_xlabel(style.NOISE_AXIS)


def _draw_strata(ax: Axes, table: DataFrame) -> None:
    """Draw what 90 % ellipses hold in quarters of the keypoints."""
    rows = table[(table["quantity"] == "position") & (table["level"] == LEVEL)]
    ax.axhline(100 * LEVEL, color=palette.GREY, linewidth=0.7, linestyle=style.REFERENCE)
    ticks: list[float] = []
    for place, stratum in enumerate(STRATA):
        at = 5 * place + np.arange(4)
        for method, (_, colour) in METHODS.items():
            part = rows[(rows["stratum"] == stratum) & (rows["method"] == method)]
            held = 100 * part.set_index("part")["held"].reindex(range(4)).to_numpy()
            ax.plot(at, held, "o-", color=colour, linewidth=1.0, label=f"{method} {stratum}")
        ticks.append(float(at.mean()))
    low, high = ax.get_ylim()
    ax.set_ylim(low - 0.35 * (high - low), high)
    ax.set_xticks(ticks, list(STRATA.values()))
    ax.tick_params(axis="x", length=0)
    ax.set_xlabel("each from low to high")
    ax.set_ylabel(f"held by {100 * LEVEL:.0f} % ellipses (%)")
    _name(ax, list(METHODS.values()))


def _draw_reliability(ax: Axes, rows: DataFrame) -> None:
    """Draw the share that returns against the survival that was predicted, for every noise."""
    ax.plot([0, 100], [0, 100], color=palette.GREY, linewidth=0.7, linestyle=style.REFERENCE)
    colours = palette.sweep_colours(rows["noise"].unique())
    for noise, colour in colours.items():
        part = rows[rows["noise"] == noise]
        x = 100 * part["predicted_survival"]
        # Of bins that hold a handful, the interval says all, and is not what the eye should meet.
        sure = part["high"] - part["low"] < 0.3
        for rows_of, width in ((sure, 0.8), (~sure, 0.4)):
            ends = 100 * part.loc[rows_of, "low"], 100 * part.loc[rows_of, "high"]
            ax.vlines(x[rows_of], *ends, color=colour, linewidth=width)
        ax.plot(x, (100 * part["found"]).where(sure), "o-", color=colour, linewidth=1.0,
                label=f"{noise:g}")  # fmt: skip
    ax.set(xlim=(0, 100), ylim=(0, 101))
    ax.set_xlabel("survival that is predicted (%)")
    ax.set_ylabel("found again (%)")
    _name(ax, [(f"noise {noise:g}", colour) for noise, colour in colours.items()])


def _draw_areas(ax: Axes, rows: DataFrame) -> None:
    """Draw the areas under ROC curves against noise."""
    for guess, (_, colour) in GUESSES.items():
        part = rows[rows["guess"] == guess].sort_values("noise")
        ax.plot(part["noise"], part["auc"], "o-", color=colour, linewidth=1.2, label=guess)
    _noise_axis(ax, rows["noise"].unique())
    ax.axhline(0.5, color=palette.GREY, linewidth=0.7, linestyle=style.REFERENCE, label="chance")
    style.direct_label(ax, ax.get_xlim()[0], 0.5, "chance", palette.GREY, 2, 5, ha="left")
    ax.set_ylim(min(0.28, float(rows["auc"].min()) - 0.02), 1.0)  # names stand below chance
    ax.set_ylabel(style.AREA_AXIS)
    _name(ax, list(GUESSES.values()))


def _draw_weights(ax: Axes, table: DataFrame) -> None:
    """Draw errors with weights, and without low survival, over those of all alike."""
    shown = table[table["weights"] == "bars"]
    ax.axhline(1.0, color=palette.GREY, linewidth=0.7, linestyle=style.REFERENCE)
    for place, (task, (_, colour)) in enumerate(TASKS.items()):
        for kept, width, face in (("all", 1.0, colour), ("surviving", 0.6, "white")):
            own = shown[(shown["task"] == task) & (shown["kept"] == kept)].sort_values("noise")
            at = own["noise"] * 1.05 ** (place - 1)
            ax.vlines(at, own["ratio_low"], own["ratio_high"], color=colour, linewidth=0.8)
            ax.plot(at, own["ratio"], "o-", color=colour, linewidth=width, markerfacecolor=face,
                    label=f"{task} {kept}")  # fmt: skip
    _noise_axis(ax, shown["noise"].unique())
    low, high = np.nanmin([*shown["ratio_low"], 0.8]), np.nanmax([*shown["ratio_high"], 1.1])
    ax.set_yscale("log")
    ax.set_ylim(low * (low / high) ** 0.6, high * 1.03)  # names stand below the lines
    ax.set_yticks(
        [tick for tick in (0.25, 0.5, 0.7, 1.0, 1.5, 2.0, 4.0) if low / 1.1 < tick < high]
    )
    ax.set_yticks([], minor=True)
    ax.yaxis.set_major_formatter(lambda value, _: f"{value:g}")
    ax.set_ylabel("error (equal weights: 1)")
    _name(ax, [*TASKS.values(), ("open: survival ≥ 50 %", palette.GREY)])


def _name(ax: Axes, names: Sequence[tuple[str, Any]]) -> None:
    """Write names in their colours in the lower right corner."""
    place = {"transform": ax.transAxes, "ha": "right", "va": "bottom", "fontsize": style.SMALL}
    for line, (text, colour) in enumerate(reversed(names)):
        ax.text(0.99, 0.02 + 0.085 * line, text, color=colour, **place)


if __name__ == "__main__":
    raise SystemExit(main(draw, TABLES))
