"""Figure S3: the Gaussian blur of a real camera (section 4)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from keystab.errors import InputError
from keystab.figures import palette, style
from keystab.figures._render import Tables, check_tables, main

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from pandas import DataFrame

TABLES = {
    "figS3.csv": ("model", "pitch", "f_number", "c", "residual"),
    "figS3_profiles.csv": (
        "model",
        "f_number",
        "pitch",
        "radius",
        "psf",
        "gaussian",
        "c",
        "residual",
    ),
}
"""Files read, with the columns that they must have."""

MODELS = {
    "diffraction": ("a", "d", "perfect lens"),
    "defocus": ("b", "e", "out of focus"),
    "spherical": ("c", "f", "spherical aberration"),
}
"""Letters of the two panels of each lens, and what it is."""

PAPER = (0.35, 0.95)
"""Smallest and largest camera blur in pixels that the paper measured."""

STOPS = (1.0, 1.4, 2.0, 2.8, 4.0, 5.6, 8.0, 11.0, 16.0, 22.0, 32.0, 45.0, 64.0)
"""F-numbers by which photographers name apertures."""


def draw(tables: Tables, draft: bool = False) -> Figure:
    """Draw camera blur against f-number for three lenses, and how good their Gaussians are.

    Parameters
    ----------
    tables : mapping
        ``figS3``: the table of `keystab.experiments.camera_blur.optics_table`;
        ``figS3_profiles``: that of `keystab.experiments.camera_blur.profile_table`.
    draft : bool
        Say on the figure that its numbers come from quick settings.

    Returns
    -------
    matplotlib Figure
        a to c: c in pixels against the f-number, one line per pixel pitch, thick up to its minimum,
        where c rises as the aperture opens; d to f: point spread function and Gaussian of each lens
        at one aperture and pitch.

    Raises
    ------
    InputError
        If a table is unusable or a lens is missing.
    """
    check_tables(tables, TABLES)
    for name in TABLES:
        found = set(tables[name.removesuffix(".csv")]["model"])
        missing = [model for model in MODELS if model not in found]
        if missing:
            raise InputError(f"{name}: has no rows of the model {missing[0]}; remake the table")
    blurs, profiles = tables["figS3"], tables["figS3_profiles"]
    with style.context():
        figure = style.new_figure(4.6)
        outer = figure.add_gridspec(2, 1, height_ratios=(1.25, 1.0), hspace=0.06)
        top = style.panels(outer[0], 1, 3, sharex=True, sharey=True)[0]
        bottom = style.panels(outer[1], 1, 3, sharex=True)[0]
        for model, above, below in zip(MODELS, top, bottom, strict=True):
            upper, lower, title = MODELS[model]
            style.letter(above, upper, title)
            _draw_blurs(above, _of(blurs, model))
            style.letter(below, lower, f"its spread at {_camera(profiles)}")
            _draw_profile(below, _of(profiles, model))
        top[0].set_ylabel(style.BLUR_AXIS)
        bottom[0].set_ylabel("per square pixel")
        _name_pitches(top[0], _of(blurs, "diffraction"))
        _explain(top[1])
        _name_profiles(bottom[0])
        return style.settle(figure, draft)


def _camera(profiles: DataFrame) -> str:
    """Return the camera that the profiles belong to."""
    return f"f/{profiles['f_number'].iloc[0]:g}, {profiles['pitch'].iloc[0]:g} µm"


def _of(table: DataFrame, model: str) -> DataFrame:
    """Return the rows of one lens."""
    return table[table["model"] == model]


def _pitches(rows: DataFrame) -> dict[float, str]:
    """Return the pixel pitches of a table, smallest first, with their colours: light to dark."""
    from matplotlib.colors import to_hex

    pitches = sorted(set(rows["pitch"]))
    shades = np.linspace(0.0, 1.0, max(len(pitches), 2))
    return {pitch: to_hex(palette.shade(x)) for pitch, x in zip(pitches, shades, strict=False)}


def _draw_blurs(ax: Axes, rows: DataFrame) -> None:
    """Draw c against the f-number, thick where it rises as the aperture opens."""
    from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

    ax.axhspan(*PAPER, color=palette.PALE, alpha=0.55, linewidth=0, zorder=0, label="paper")
    for pitch, colour in _pitches(rows).items():
        own = rows[rows["pitch"] == pitch].sort_values("f_number")
        f_number, c = own["f_number"].to_numpy(), own["c"].to_numpy()
        ax.plot(f_number, c, color=colour, linewidth=1.1, label=f"{pitch:g}")
        opens = slice(0, int(c.argmin()) + 1)
        ax.plot(f_number[opens], c[opens], color=colour, linewidth=3.0, label=f"rising {pitch:g}")
    ax.set(xscale="log", yscale="log")
    low, high = rows["f_number"].min(), rows["f_number"].max()
    stops = [stop for stop in STOPS if low <= stop <= high]
    ax.xaxis.set_major_locator(FixedLocator(stops))
    ax.yaxis.set_major_locator(FixedLocator([0.2, 0.35, 0.5, 0.7, 0.95, 1.4, 2.0, 3.0, 5.0]))
    for axis in (ax.xaxis, ax.yaxis):
        axis.set_minor_locator(NullLocator())
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    ax.set_ylim(top=1.3 * max(rows["c"].max(), PAPER[1]))  # room for words
    ax.set_xlim(low / 1.08, high * 1.7)  # room for the pixel pitches
    ax.set_xlabel("f-number (open $\\rightarrow$ closed)")
    style.finish_axes(ax)


def _name_pitches(ax: Axes, rows: DataFrame) -> None:
    """Write the pixel pitches beside the lines of the first panel."""
    for pitch, colour in _pitches(rows).items():
        last = rows[rows["pitch"] == pitch].sort_values("f_number").iloc[-1]
        style.direct_label(
            ax, last["f_number"], last["c"], f"{pitch:g} µm", colour, right=3.0, ha="left"
        )
    place = {"transform": ax.transAxes, "ha": "left", "va": "top", "fontsize": style.SMALL}
    ax.text(0.03, 0.97, "pixel pitch at the right", color=palette.GREY, **place)


def _explain(ax: Axes) -> None:
    """Say what the band and the thick lines are."""
    place = {"ha": "right", "fontsize": style.SMALL, "color": palette.GREY}
    text = ax.get_yaxis_transform()
    name = f"paper: {PAPER[0]} to {PAPER[1]} px"
    ax.text(0.98, PAPER[0], name, transform=text, va="bottom", **place)
    ax.text(
        0.98,
        0.97,
        "thick: $c$ rises as\nthe aperture opens",
        transform=ax.transAxes,
        va="top",
        **place,
    )


def _draw_profile(ax: Axes, rows: DataFrame) -> None:
    """Draw a point spread function along the radius, and its Gaussian."""
    rows = rows.sort_values("radius")
    radius = rows["radius"].to_numpy()
    lines = {
        "gaussian": {"color": palette.GAUSSIAN_COLOUR, "linewidth": 2.6, "alpha": 0.75},
        "psf": {"color": palette.INK, "linewidth": 1.2},
    }
    for column, options in lines.items():
        ax.plot(radius, rows[column], label=column, **options)
    ax.set(xlim=(0.0, radius[-1]), xticks=np.arange(0.0, radius[-1] + 0.01, 0.5))
    ax.set_ylim(0.0, 1.08 * max(rows["psf"].max(), rows["gaussian"].max()))
    ax.set_xlabel("distance from the centre (px)")
    text = f"$c$ = {rows['c'].iloc[0]:.2f} px\nresidual {100 * rows['residual'].iloc[0]:.0f} %"
    place = {"transform": ax.transAxes, "ha": "right", "va": "top", "fontsize": style.SMALL}
    ax.text(0.99, 0.97, text, color=palette.GREY, **place)
    style.finish_axes(ax)


def _name_profiles(ax: Axes) -> None:
    """Name both lines of the first profile."""
    names = {"mean over circles": palette.INK, "nearest Gaussian": palette.GAUSSIAN_COLOUR}
    for line, (text, colour) in enumerate(names.items()):
        place = {"transform": ax.transAxes, "ha": "right", "va": "top"}
        ax.text(0.99, 0.55 - 0.13 * line, text, color=colour, fontsize=style.SMALL, **place)


if __name__ == "__main__":
    raise SystemExit(main(draw, TABLES))
