"""Figure 9: which keypoints depend on the ratio of the difference of Gaussians (section 5.6)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from keystab.figures import palette, style
from keystab.figures._occurrence import Share, draw_matrix, mark_groups, occurrence
from keystab.figures._render import Tables, check_tables, main

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from pandas import DataFrame

TABLES = {
    "fig9_counts.csv": ("kappa", "n_octave", "n_common"),
    "fig9_keypoints.csv": ("keypoint", "stability"),
    "fig9_occurrence.csv": ("keypoint", "kappa", "detected"),
}
"""Files read, with the columns that they must have."""

MOST = 0.8
"""A keypoint is detected with most ratios if with more than this share of them, the one that the
paper names."""

TICKS = (30, 20, 14, 10, 7, 5, 3, 2)
"""Values of n at which the ratio 2^(1/n) is written on the axis."""

LINES = {
    "n_octave": ("in the octave", palette.GREY, 8.0),
    "n_common": ("in the range that all cover", palette.INK, -8.0),
}
"""Name and colour of each line of the counts, and how far above the line its name stands."""


def draw(tables: Tables, draft: bool = False) -> Figure:
    """Draw the number of keypoints against the ratio, and the occurrence matrix.

    Parameters
    ----------
    tables : mapping
        ``fig9_counts``: one row per ratio; ``fig9_keypoints``: one row per unique keypoint;
        ``fig9_occurrence``: one row per unique keypoint and ratio.
    draft : bool
        Say on the figure that its numbers come from quick settings.

    Returns
    -------
    matplotlib Figure
        a: keypoints against kappa, the logarithm of the latter being drawn logarithmically; b:
        occurrence matrix, a row per ratio and a column per unique keypoint, in increasing order
        of stability and coloured by it; those detected with most ratios are underlined.

    Raises
    ------
    InputError
        If a table is unusable or the occurrence matrix has holes.
    """
    check_tables(tables, TABLES)
    seen = occurrence(tables["fig9_occurrence"], tables["fig9_keypoints"], "kappa", "fig9")
    with style.context():
        figure = style.new_figure(2.9)
        outer = figure.add_gridspec(1, 2, width_ratios=(1.0, 1.55), wspace=0.03)
        (number,) = style.panels(outer[0], 1, 1)[0]
        _draw_counts(number, tables["fig9_counts"].sort_values("kappa"))
        matrix, scale = style.panels(outer[1], 1, 2, width_ratios=(1.0, 0.025), wspace=0.02)[0]
        style.letter(matrix, "b", f"occurrence of {len(seen.stability)} unique keypoints")
        image = draw_matrix(matrix, seen.coloured(), palette.stability_map())
        _label_rows(matrix, seen.sets)
        most = Share(
            float((seen.stability > MOST).mean()),
            f"with more than {100 * MOST:.0f} % of the ratios",
        )
        always = Share(float(seen.detected.all(axis=0).mean()), "with all")
        mark_groups(matrix, len(seen.stability), {"stable": (most, f"{most}, {always}")})
        figure.colorbar(image, cax=scale, label="stability").outline.set_visible(False)
        return style.settle(figure, draft)


def _draw_counts(ax: Axes, counts: DataFrame) -> None:
    """Draw the number of keypoints with each ratio."""
    style.letter(ax, "a", "number of keypoints")
    octaves = np.log2(counts["kappa"].to_numpy(dtype=np.float64))
    place = np.log(octaves)  # on the logarithmic axis
    for column, (text, colour, up) in LINES.items():
        number = counts[column].to_numpy()
        ax.plot(octaves, number, "o-", color=colour, label=column, markersize=2.6)
        start = 0.65 if up > 0 else 0.4  # of the axis: where the name begins
        beside = np.linspace(place[0] + start * np.ptp(place), place[-1])
        heights = np.interp(beside, place, number)
        height = heights.max() if up > 0 else heights.min()
        style.direct_label(ax, octaves[-1], height, text, colour, up=up)
    ax.set_xscale("log")
    ax.set_ylim(0.0, 1.15 * counts["n_octave"].max())
    kappas = counts["kappa"].to_numpy()
    nearest = {int(np.argmin(abs(octaves * n - 1))) for n in TICKS}
    rows = sorted(nearest)
    ax.set_xticks(octaves[rows], [f"{style.ratio_name(k)}\n{k:.2f}" for k in kappas[rows]])
    ax.minorticks_off()
    ax.set_xlabel(style.KAPPA_AXIS)
    ax.set_ylabel("keypoints")
    style.finish_axes(ax)


def _label_rows(ax: Axes, kappas: NDArray[np.float64]) -> None:
    """Name some rows of the matrix by their ratio."""
    rows = np.arange(0, len(kappas), -(-len(kappas) // 8))
    ax.set_yticks(rows, [style.ratio_name(kappa) for kappa in kappas[rows]])
    ax.set_ylabel(style.KAPPA_AXIS)


if __name__ == "__main__":
    raise SystemExit(main(draw, TABLES))
