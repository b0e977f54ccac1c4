"""Unique keypoints of a made example, and the occurrence matrix of a small view."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from explaining.views import KAPPA, view
from keystab.detection.detector import extrema_table
from keystab.detection.extrema import discrete_extrema
from keystab.figures import palette, style
from keystab.matching.common_range import comparable
from keystab.matching.correspondence import SCALE_RATIO, SPACE_TOLERANCE
from keystab.matching.unique_keypoints import occurrence, unique_keypoints
from keystab.scalespace.dog import scale_space

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

BLUR, SIGMA_MIN = 1.1, 1.1
SAMPLINGS = range(3, 13)

EXAMPLE = pd.DataFrame(
    {
        "y": 0.0,
        "x": [1.5, 1.7, 2.4, 3.1, 5.3, 5.5, 5.4, 8.1],
        "sigma": [1.6, 1.55, 1.7, 1.75, 2.6, 1.45, 2.5, 2.0],
        "set": [3, 5, 7, 5, 3, 7, 5, 7],
    }
)
"""Detections of three samplings along a line."""

MARKS = {3: "s", 5: "D", 7: "o"}


@cache
def occurrences() -> pd.DataFrame:
    """Occurrence of the unique keypoints of a small view, most stable first, at `SAMPLINGS`."""
    image = view(BLUR, 64, 96)
    tables = []
    for n_spo in SAMPLINGS:
        space = scale_space(image, BLUR, n_spo, sigma_min=SIGMA_MIN, kappa=KAPPA)
        table = extrema_table(space, discrete_extrema(space)).assign(set=n_spo)
        tables.append(table[comparable(table, image.shape, SIGMA_MIN)])
    found = pd.concat(tables, ignore_index=True)
    seen = occurrence(unique_keypoints(found), found)
    order = np.argsort(-seen.mean(axis=1).to_numpy(), kind="stable")
    return seen.iloc[order]


def draw() -> Figure:
    """Draw both panels."""
    figure = style.new_figure(2.5)
    same, matrix = figure.subplots(1, 2, width_ratios=(1, 1.2))
    _draw_same(same)
    draw_occurrence(matrix)
    bar = figure.colorbar(matrix.images[0], ax=matrix, pad=0.02, aspect=25)
    bar.set_label("stability")
    style.letter(matrix, "b", "found (coloured) or not (white)")
    style.finish_axes(same)
    return figure


def _draw_same(ax: Axes) -> None:
    from matplotlib.patches import Rectangle

    unique = unique_keypoints(EXAMPLE)
    for x, sigma in unique[["x", "sigma"]].to_numpy():
        corner = x - SPACE_TOLERANCE, sigma / SCALE_RATIO
        size = 2 * SPACE_TOLERANCE, sigma * SCALE_RATIO - sigma / SCALE_RATIO
        ax.add_patch(Rectangle(corner, *size, fc="#eef4f8", ec=palette.GREY, lw=0.8, zorder=0))
    chosen = EXAMPLE.index.isin(unique.index)
    for name, rows in EXAMPLE.groupby("set"):
        mark = MARKS[int(str(name))]
        for is_chosen, colour in (
            (False, palette.GREY),
            (True, palette.DETECTION_COLOURS["refined"]),
        ):
            some = rows[chosen[rows.index] == is_chosen]
            ax.plot(some["x"], some["sigma"], mark, color=colour, ms=5, mec="none", zorder=2)
    for n, (name, mark) in enumerate(MARKS.items()):
        x = 0.4 + 3.2 * n
        ax.plot(x, 4.9, mark, color=palette.GREY, ms=5, mec="none")
        ax.text(x + 0.3, 4.9, f"{style.N_SPO} = {name}", va="center", fontsize=style.SMALL)
    style.log_y_axis(ax, 0.95, 5.5)
    ax.set_yticks([1, 1.5, 2, 3, 4], ["1", "1.5", "2", "3", "4"])
    ax.set(xlim=(0, 9.8), xlabel="x (px)", ylabel="scale σ (px)")
    style.letter(ax, "a", "detections, and what is the same")


def draw_occurrence(ax: Axes) -> None:
    """Draw the matrix, coloured by stability."""
    seen = occurrences().to_numpy()
    coloured = np.where(seen, seen.mean(axis=1, keepdims=True), np.nan).T
    ax.imshow(
        coloured, cmap=palette.stability_map(), vmin=0, vmax=1, aspect="auto", origin="lower",
        interpolation="nearest", extent=(0, len(seen), SAMPLINGS[0] - 0.5, SAMPLINGS[-1] + 0.5),
    )  # fmt: skip
    ax.set(xlabel="unique keypoint", ylabel=style.N_SPO, yticks=list(SAMPLINGS)[::3])
