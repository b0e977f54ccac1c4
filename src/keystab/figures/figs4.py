"""Figure S4: at which scale a Gaussian blob is detected (sections 2.3 and 3.2)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from keystab.errors import InputError
from keystab.figures import palette, style
from keystab.figures._render import Tables, check_tables, main
from keystab.figures._sweep_panels import label_ends

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from pandas import DataFrame

TABLES = {
    "figS4.csv": (
        "experiment",
        "operator",
        "kappa",
        "n_spo",
        "detection",
        "blob",
        "camera_blur",
        "assumed_blur",
        "sigma_min",
        "detected",
        "error",
    ),
}
"""Files read, with the columns that they must have."""

EXPERIMENTS = ("operator", "sampling", "assumed_blur")
"""What differs in the panels a to c."""

EXACT = 1e-7
"""Errors below this are drawn as this: that far the search for a maximum goes."""


def draw(tables: Tables, draft: bool = False) -> Figure:
    """Draw the detected scale of blobs against theory, its error, and what a wrong blur does.

    Parameters
    ----------
    tables : mapping
        ``figS4``: the table of `keystab.experiments.blob_scales.blob_table`.
    draft : bool
        Say on the figure that its numbers come from quick settings.

    Returns
    -------
    matplotlib Figure
        a: detected scale over the blob's standard deviation for several operators, over the lines
        of theory; b: relative error of discrete and refined scales at several samplings; c:
        detected scale over the right one where the assumed blur differs from the camera's.

    Raises
    ------
    InputError
        If the table is unusable, an experiment is missing, or nothing was detected.
    """
    check_tables(tables, TABLES)
    table = tables["figS4"]
    parts = {name: table[table["experiment"] == name] for name in EXPERIMENTS}
    for name, rows in parts.items():
        if len(rows) == 0:
            raise InputError(f"figS4.csv: has no rows of the experiment {name}; remake the table")
        if rows["detected"].isna().all():
            raise InputError(
                f"figS4.csv: no blob of the experiment {name} was detected, so there is nothing to "
                "draw; give larger blobs"
            )
    with style.context():
        figure = style.new_figure(2.75)
        axes = style.panels(figure.add_gridspec(1, 1)[0], 1, 3, wspace=0.04)[0]
        style.letter(axes[0], "a", "scale found")
        _draw_operators(axes[0], parts["operator"])
        style.letter(axes[1], "b", "error of the scale found")
        ends = _draw_errors(axes[1], parts["sampling"], parts["operator"])
        style.letter(axes[2], "c", "assumed camera blur")
        _draw_assumptions(axes[2], parts["assumed_blur"])
        for ax in axes:
            ax.set_xlabel("size $s$ of the blob (px)")
            style.log_x_axis(ax, table["blob"].min(), table["blob"].max())
            ax.set_xlim(table["blob"].min() / 1.05, table["blob"].max() * 1.05)
            _plain_ticks(ax, table["blob"].min(), table["blob"].max())
            style.finish_axes(ax)
        label_ends(axes[1], ends, style.N_SPO)
        return style.settle(figure, draft)


def _plain_ticks(ax: Axes, low: float, high: float) -> None:
    """Label every half pixel where the range is short, and leave it to the axis where it is not."""
    from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

    halves = np.arange(np.ceil(2 * low), np.floor(2 * high) + 1) / 2
    if 2 <= len(halves) <= 6:
        ax.xaxis.set_major_locator(FixedLocator(halves))
        ax.xaxis.set_minor_locator(NullLocator())
        ax.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))


def _power(kappa: float) -> str:
    r"""Return a ratio as a root of 2 where it is one.

    Examples
    --------
    >>> _power(2 ** (1 / 3)), _power(1.6)
    ('$\\kappa = 2^{1/3}$', '$\\kappa = 1.6$')
    """
    root = 1 / np.log2(kappa)
    whole = abs(root - round(root)) < 1e-6
    return f"$\\kappa = 2^{{1/{round(root)}}}$" if whole else f"$\\kappa = {kappa:.4g}$"


def _draw_operators(ax: Axes, rows: DataFrame) -> None:
    """Draw detected scales over the blobs' own, and the lines of theory."""
    kappas = sorted(set(rows["kappa"]))
    last = rows["blob"].max()
    for kappa in kappas:
        own = rows[rows["kappa"] == kappa].sort_values("blob")
        operator = own["operator"].iloc[0]
        dogs = [other for other in kappas if other > 1]
        colour: Any = palette.OPERATOR_COLOURS["laplacian"]
        if operator == "dog":
            colour = palette.shade((dogs.index(kappa) + 1) / len(dogs))
        ax.axhline(kappa**-0.5, color=colour, linewidth=1.0, label=f"theory {kappa:.6g}")
        ratio = own["detected"] / own["blob"]
        ax.plot(own["blob"], ratio, color=colour, label=f"{kappa:.6g}", **_marks())
        name = _power(kappa) if operator == "dog" else "normalised Laplacian"
        # The lines of the smallest ratio and of its limit are neighbours: one label on each side.
        up = -9.0 if 1 < kappa < 1.05 else 6.0
        style.direct_label(ax, last, kappa**-0.5, name, colour, up=up)
    blob = np.geomspace(rows["blob"].min(), last, 50)
    first = rows["sigma_min"].iloc[0] / blob
    ax.plot(
        blob,
        first,
        color=palette.GREY,
        linewidth=0.8,
        linestyle=style.REFERENCE,
        label="first scale",
    )
    low = min(kappa**-0.5 for kappa in kappas)
    ax.set_ylim(low - 0.09, 1.09)
    # Beside the curve, in the region where there is nothing.
    at = rows["sigma_min"].iloc[0] / (low - 0.04)
    if at < last:
        style.direct_label(
            ax, at, low - 0.04, "first scale", palette.GREY, right=6.0, up=-1.0, ha="left"
        )
    ax.set_ylabel(r"detected $\sigma\,/\,s$")


def _draw_errors(
    ax: Axes, samplings: DataFrame, operators: DataFrame
) -> dict[str, tuple[float, Any]]:
    """Draw the sizes of relative errors; the Laplacian is that of the exact series.

    Returns the height at which each line ends and its colour, for its name.
    """
    from matplotlib.ticker import NullLocator

    finest = samplings["n_spo"].max()
    ends = {}
    for n_spo in sorted(set(samplings["n_spo"])):
        for detection in ("discrete", "refined"):
            own = samplings[(samplings["detection"] == detection) & (samplings["n_spo"] == n_spo)]
            colour = palette.DETECTION_COLOURS[detection]
            fill = colour if n_spo == finest else "white"
            size = _draw_size(ax, own, colour, fill, f"{detection} {n_spo}")
            ends[f"{n_spo}, {detection}"] = (size, colour)
    laplacian = operators[operators["operator"] == "laplacian"]
    colour = palette.OPERATOR_COLOURS["laplacian"]
    ends["Laplacian"] = (_draw_size(ax, laplacian, colour, colour, "laplacian"), colour)
    ax.set_yscale("log")
    ax.set_ylim(EXACT / 1.5, 1.0)
    ax.set_yticks([1e-6, 1e-4, 1e-2, 1.0])
    ax.yaxis.set_minor_locator(NullLocator())
    ax.set_ylabel(r"|detected $\sigma$ / theory $-$ 1|")
    return ends


def _draw_size(ax: Axes, rows: DataFrame, colour: Any, fill: Any, label: str) -> float:
    """Draw the size of the errors of blobs; return that of the largest blob."""
    rows = rows.sort_values("blob")
    size = np.maximum(rows["error"].abs().to_numpy(), EXACT)
    size[rows["error"].isna()] = np.nan
    (line,) = ax.plot(rows["blob"], size, color=colour, **_marks(fill, 0.7, colour))
    line.set_gid(label)
    return float(size[-1])


def _draw_assumptions(ax: Axes, rows: DataFrame) -> None:
    """Draw detected scales over those of the right blur, and the curves of theory."""
    c, kappa = rows["camera_blur"].iloc[0], rows["kappa"].iloc[0]
    blob = np.geomspace(rows["blob"].min(), rows["blob"].max(), 200)
    for assumed in sorted(set(rows["assumed_blur"])):
        own = rows[rows["assumed_blur"] == assumed].sort_values("blob")
        side = "right" if assumed == c else "below" if assumed < c else "above"
        colour = palette.ASSUMED_COLOURS[side]
        theory = _over_right(blob, c, assumed)
        ax.plot(blob, theory, color=colour, linewidth=0.8, linestyle=style.REFERENCE, label="below")
        reached = theory * blob / np.sqrt(kappa) >= rows["sigma_min"].iloc[0]
        label = f"theory {assumed:g}"
        ax.plot(blob[reached], theory[reached], color=colour, linewidth=1.0, label=label)
        ratio = own["detected"] * np.sqrt(kappa) / own["blob"]
        ax.plot(own["blob"], ratio, color=colour, label=f"{assumed:g}", **_marks())
        # Beside the curve, on the side where it leaves room: right of a third of it, and for the
        # right blur, whose curve is level, below its beginning.
        relation, at, up = {
            "below": ("< $c$", len(blob) // 3, 6.0),
            "right": ("right", 0, -8.0),
            "above": ("> $c$", len(blob) // 3, -8.0),
        }[side]
        level = float(theory[at])
        text = f"{assumed:g} px ({relation})"
        if np.isfinite(level):
            style.direct_label(ax, blob[at], level, text, colour, right=4.0, up=up, ha="left")
    seen = rows["detected"] * np.sqrt(kappa) / rows["blob"]
    ax.set_ylim(min(0.75, seen.min() - 0.06), max(1.15, seen.max() + 0.06))
    place = {"transform": ax.transAxes, "ha": "right", "va": "top"}
    ax.text(0.99, 0.99, f"camera blur $c$ = {c:g} px", fontsize=style.SMALL, **place)
    ax.set_ylabel(r"detected $\sigma\,\sqrt{\kappa}\,/\,s$")


def _over_right(blob: ArrayLike, c: float, assumed: float) -> NDArray[np.float64]:
    """Return the theoretical scale over that of the right blur; NaN where there is none."""
    share = 1 + (c**2 - assumed**2) / np.square(np.asarray(blob, dtype=np.float64))
    return np.sqrt(np.where(share > 0, share, np.nan))


def _marks(fill: Any = None, linewidth: float = 0.0, edge: Any = None) -> dict[str, Any]:
    """Return the options of dots, joined by a line where it has a width."""
    options: dict[str, Any] = {"marker": "o", "markersize": 3.2, "linewidth": linewidth}
    if fill is not None:
        options |= {"markerfacecolor": fill, "markeredgecolor": edge, "markeredgewidth": 0.8}
    return options


if __name__ == "__main__":
    raise SystemExit(main(draw, TABLES))
