"""Figure 12: what noise does to keypoints (section 6.3)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from keystab.errors import InputError
from keystab.figures import palette, style
from keystab.figures._render import Tables, check_tables, main
from keystab.figures._sweep_panels import (
    CURVE_COLUMNS,
    SCALE_COLUMNS,
    Colours,
    draw_against_scale,
    draw_curves,
    draw_seen,
    label_ends,
    require_values,
    scale_axis,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from pandas import DataFrame

TABLES = {
    "fig12_curves.csv": ("noise", *CURVE_COLUMNS),
    "fig12_pixels.parquet": ("noise", "y", "x", "grey"),
    "fig12_scales.csv": (
        "noise",
        *SCALE_COLUMNS,
        "mean_above",
        "low_above",
        "high_above",
    ),
    "fig12_theory.csv": ("sigma", "octave_ratio"),
}
"""Files read, with the columns that they must have."""

SYMBOL = "noise"

# Space between a point and the axis that a noise written beside it needs, in per cent of keypoints.
SPACE_FOR_A_NAME = 12.0

PAPERS_RATIO = 2.0
"""Noise of an octave over that of the next one, in the paper."""


class Comparison(NamedTuple):
    """Percentages seen often enough, each with its interval: (value, low, high)."""

    noise: float
    half_in_first: tuple[float, float, float]
    whole_in_second: tuple[float, float, float]


def draw(tables: Tables, draft: bool = False) -> Figure:
    """Draw stability under noise, against scale, and the paper's rule of octaves.

    Parameters
    ----------
    tables : mapping
        ``fig12_curves``: one row per noise and number of views; ``fig12_pixels``: one row per noise
        and pixel; ``fig12_scales``: one row per noise and first scale of an octave;
        ``fig12_theory``: noise of the difference of Gaussians, one row per scale.
    draft : bool
        Say on the figure that its numbers come from quick settings.

    Returns
    -------
    matplotlib Figure
        A noise that is half of another one serves panel e only. a: percentage of unique keypoints
        against that of the views that see them; b: crops of views, on one grey scale; c: keypoints
        per view above a scale, and d: percentage of an octave's unique keypoints seen often enough,
        both against the first scale; e: that percentage for a noise in the second octave against
        that for half the noise in the first; f: noise of an octave over that of the next one.

    Raises
    ------
    InputError
        If a table is unusable, lacks one of the noises, or a crop is no rectangle.
    """
    check_tables(tables, TABLES)
    curves, scales = tables["fig12_curves"], tables["fig12_scales"]
    noises = sorted(set(curves["noise"]))
    drawn = [noise for noise in noises if not any(_is(2 * noise, other) for other in noises)]
    require_values("fig12_scales.csv", scales, "noise", noises)
    require_values("fig12_pixels.parquet", tables["fig12_pixels"], "noise", drawn)
    colours = palette.sweep_colours(drawn)
    with style.context():
        figure = style.new_figure(4.7)
        grid = figure.add_gridspec(2, 1, hspace=0.05)
        top, bottom = (row.subgridspec(1, 3, wspace=0.06) for row in grid)
        stability, crops, above, seen, rule, ratio = (
            figure.add_subplot(place) for row in (top, bottom) for place in row
        )
        style.letter(stability, "a", "stability under noise")
        draw_curves(stability, curves, "noise", colours, colours, SYMBOL, 0.1)
        _draw_crops(crops, tables["fig12_pixels"], drawn[:: -(-len(drawn) // 4)], colours)
        _draw_counts(above, scales, colours)
        style.letter(seen, "d", "stability against scale")
        draw_seen(seen, scales, "noise", colours, SYMBOL, 0.1)
        _draw_rule(rule, compare_octaves(scales), colours)
        _draw_ratio(ratio, tables["fig12_theory"])
        return style.settle(figure, draft)


def compare_octaves(scales: DataFrame) -> list[Comparison]:
    """Pair each noise in the second octave with its half in the first.

    Parameters
    ----------
    scales : DataFrame
        ``fig12_scales``. The first octave is that from the lowest ``sigma_from``.

    Returns
    -------
    list of Comparison
        In the order of the noises; empty where no noise is half of another, or no octave starts
        where the first one ends.
    """
    first = scales["sigma_from"].min()
    noises = sorted(set(scales["noise"]))
    pairs = [(half, noise) for noise in noises for half in noises if _is(2 * half, noise)]
    found = []
    for half, noise in pairs:
        ends = []
        for value, start in ((half, first), (noise, 2 * first)):
            here = _is(scales["sigma_from"], start) & (scales["noise"] == value)
            numbers = scales.loc[here, ["percentage_seen", "low", "high"]].to_numpy(dtype=float)
            ends += [tuple(row) for row in numbers[:1].tolist()]
        if len(ends) == 2:
            found.append(Comparison(noise, *ends))
    return found


def _is(values: Any, wanted: float) -> Any:
    """Whether numbers equal one, but for rounding."""
    return np.isclose(values, wanted, rtol=1e-6, atol=0)


def _draw_crops(ax: Axes, pixels: DataFrame, noises: Sequence[float], colours: Colours) -> None:
    """Draw one crop per noise, two a row, on the grey scale of the picture."""
    style.letter(ax, "b", style.NOISE_AXIS)
    crops = [_crop(pixels[pixels["noise"] == noise], noise) for noise in noises]
    height, width = (max(crop.shape[axis] for crop in crops) for axis in (0, 1))
    for number, (noise, crop) in enumerate(zip(noises, crops, strict=True)):
        top, left = (1.05 * height * (number // 2), 1.05 * width * (number % 2))
        place = (left, left + crop.shape[1], top + crop.shape[0], top)
        look = {"cmap": "gray", "vmin": 0.0, "vmax": 1.0, "interpolation": "nearest"}
        ax.imshow(crop, extent=place, label=f"{noise:g}", **look)
        box = {"facecolor": "white", "edgecolor": "none", "pad": 1.2}
        corner = {"xytext": (1.2, -1.2), "textcoords": "offset points", "bbox": box}
        text = {"ha": "left", "va": "top", "fontsize": style.SMALL, "color": colours[noise]}
        ax.annotate(f"{noise:g}", (left, top), **corner, **text)
    rows = -(-len(noises) // 2)
    ax.set(xlim=(0.0, 2.05 * width), ylim=((1.05 * rows - 0.05) * height, 0.0), anchor="N")
    ax.set_axis_off()


def _crop(pixels: DataFrame, noise: float) -> NDArray[np.float64]:
    """Arrange pixels in rows and columns."""
    table = pixels.pivot_table(index="y", columns="x", values="grey")
    if table.isna().any(axis=None) or table.size != len(pixels):
        raise InputError(
            f"fig12_pixels.parquet: the pixels of noise {noise:g} fill no rectangle, each once; "
            "remake the table"
        )
    return table.to_numpy(dtype=float)


def _draw_counts(ax: Axes, scales: DataFrame, colours: Colours) -> None:
    """Draw the mean number of keypoints above a scale, logarithmically."""
    style.letter(ax, "c", "keypoints above $\\sigma_{\\mathrm{min}}$")
    columns = ["mean_above", "low_above", "high_above"]
    positive = scales[columns].where(scales[columns] > 0)
    known = scales.assign(**{name: positive[name] for name in columns})
    ends = draw_against_scale(
        ax, known, "noise", colours, "mean_above", ("low_above", "high_above")
    )
    shown = known.loc[known["noise"].isin(list(colours)), columns].to_numpy(dtype=float)
    ax.set_ylabel("keypoints per view")
    if np.isfinite(shown).any():
        ax.set_yscale("log")
        ax.set_ylim(0.8 * np.nanmin(shown), 1.25 * np.nanmax(shown))
        _plain_numbers(ax)
    label_ends(ax, ends, SYMBOL, 0.1)


def _plain_numbers(ax: Axes) -> None:
    """Label a logarithmic vertical axis at 1, 2 and 5 of every power of ten, as plain numbers."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    ax.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    ax.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    ax.yaxis.set_minor_formatter(NullFormatter())


def _draw_rule(ax: Axes, comparisons: Sequence[Comparison], colours: Colours) -> None:
    """Draw the second octave at a noise against the first at half of it, and their equality."""
    style.letter(ax, "e", "one octave = half the noise?")
    ax.plot(
        [0, 100],
        [0, 100],
        color=palette.GREY,
        linewidth=0.7,
        linestyle=style.REFERENCE,
        label="equal",
    )
    style.direct_label(ax, 60, 60, "equal", palette.GREY, right=8.0, up=-4.0, ha="left")
    for noise, half, whole in comparisons:
        colour = colours.get(noise, palette.INK)
        ax.plot([half[0]] * 2, whole[1:], color=colour, linewidth=1.0, label="interval")
        ax.plot(half[1:], [whole[0]] * 2, color=colour, linewidth=1.0, label="interval")
        ax.plot([half[0]], [whole[0]], "o", color=colour, markersize=4.0, label=f"{noise:g}")
        # On the side away from the line of equality; near the origin, where the intervals of the
        # strongest noises meet and the axis leaves no room, to the right of them.
        left = whole[0] > half[0] and half[1] > SPACE_FOR_A_NAME
        at, right, ha = (half[1], -4.0, "right") if left else (half[2], 4.0, "left")
        kind: dict[str, Any] = {"bbox": {"color": "white", "pad": 0.4}, "ha": ha}
        style.direct_label(ax, at, whole[0], f"{noise:g}", colour, right, **kind)
    if not comparisons:
        text = "nothing to compare"
        place: dict[str, Any] = {"transform": ax.transAxes, "ha": "center", "fontsize": style.SMALL}
        ax.text(0.5, 0.5, text, color=palette.GREY, **place)
    ticks = range(0, 101, 25)
    ax.set(xlim=(-4, 102), ylim=(-4, 102), xticks=ticks, yticks=ticks)
    ax.set_xlabel("first octave, half the noise (%)")
    ax.set_ylabel("second octave (%)")
    style.finish_axes(ax)


def _draw_ratio(ax: Axes, theory: DataFrame) -> None:
    """Draw the closed-form ratio of noise, and the paper's."""
    style.letter(ax, "f", "noise, octave over next")
    rows = theory.sort_values("sigma")
    sigma, ratio = rows["sigma"].to_numpy(), rows["octave_ratio"].to_numpy()
    colour = palette.THEORY_COLOURS["blob"]
    ax.plot(sigma, ratio, color=colour, label="octave_ratio")
    style.direct_label(ax, sigma[0], ratio[0], "closed form", colour, right=8.0, up=-3.0, ha="left")
    ax.axhline(PAPERS_RATIO, color=palette.GREY, linewidth=0.7, linestyle=style.REFERENCE, zorder=1)
    text = f"in the paper: {PAPERS_RATIO:g}"
    style.direct_label(ax, sigma[0], PAPERS_RATIO, text, palette.GREY, 4.0, -6.0, ha="left")
    n_octaves = np.floor(np.log2(sigma[-1] / sigma[0]) + 1e-9)
    scale_axis(ax, [sigma[0] * 2**k for k in np.arange(n_octaves + 1)])
    ax.set_xlim(sigma[0], sigma[-1])
    ax.set_ylim(0.0, 1.08 * max(ratio.max(), PAPERS_RATIO))
    ax.set_xlabel("$\\sigma$ (px)")
    ax.set_ylabel("ratio of DoG noise")
    style.finish_axes(ax)


if __name__ == "__main__":
    raise SystemExit(main(draw, TABLES))
