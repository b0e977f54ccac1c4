"""Figure 11: what a wrongly assumed camera blur does to keypoints (section 6.2)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from keystab.figures import palette, style
from keystab.figures._render import Tables, check_tables, main
from keystab.figures._sweep_panels import (
    CURVE_COLUMNS,
    SCALE_COLUMNS,
    draw_against_scale,
    draw_curves,
    draw_seen,
    require_values,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure

TABLES = {
    "fig11_curves.csv": ("blur_spread", *CURVE_COLUMNS),
    "fig11_scales.csv": ("blur_spread", *SCALE_COLUMNS, "n_unique"),
}
"""Files read, with the columns that they must have."""

SYMBOL = "$\\Delta c$ (px)"


def draw(tables: Tables, draft: bool = False) -> Figure:
    """Draw stability against the uncertainty of the blur, and against scale.

    Parameters
    ----------
    tables : mapping
        ``fig11_curves``: one row per uncertainty and number of views; ``fig11_scales``: one row
        per uncertainty and first scale of an octave.
    draft : bool
        Say on the figure that its numbers come from quick settings.

    Returns
    -------
    matplotlib Figure
        a: percentage of unique keypoints against that of the views that see them, one curve per
        uncertainty; b: percentage of an octave's unique keypoints seen often enough, against the
        first scale of the octave, and below it ("b counts") how many these are.

    Raises
    ------
    InputError
        If a table is unusable, or lacks one of the uncertainties.
    """
    check_tables(tables, TABLES)
    scales = tables["fig11_scales"]
    colours = palette.sweep_colours(tables["fig11_curves"]["blur_spread"])
    require_values("fig11_scales.csv", scales, "blur_spread", colours)
    ends = {min(colours), max(colours)}
    with style.context():
        figure = style.new_figure(3.1)
        left, right = figure.add_gridspec(1, 2, wspace=0.05)
        curves = style.panels(left, 1, 1)[0, 0]
        style.letter(curves, "a", "stability where the blur is unknown")
        draw_curves(curves, tables["fig11_curves"], "blur_spread", colours, ends, SYMBOL, 0.07)
        seen, number = style.panels(right, 2, 1, sharex=True, height_ratios=(2.2, 1.0))[:, 0]
        style.letter(seen, "b", "against scale")
        draw_seen(seen, scales, "blur_spread", colours, SYMBOL, 0.085)
        seen.set_xlabel("")
        number.set_label("b counts")
        draw_against_scale(number, scales, "blur_spread", colours, "n_unique", None)
        number.set_ylim(0.0, 1.05 * scales["n_unique"].max())
        number.set_ylabel("unique\nkeypoints")
        figure.align_ylabels([seen, number])
        return style.settle(figure, draft)


if __name__ == "__main__":
    raise SystemExit(main(draw, TABLES))
