"""Figure S2: a camera blur that is assumed too large or too small (section 6.2, abstract)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from keystab.figures import palette, style
from keystab.figures._render import Tables, check_tables, main
from keystab.figures._sweep_panels import draw_band

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from pandas import DataFrame

TABLES = {
    "figS2.csv": (
        "error",
        "scales",
        "share_found",
        "low_found",
        "high_found",
        "share_right",
        "low_right",
        "high_right",
        "scale_shift",
        "q25_shift",
        "q75_shift",
        "blob_shift",
        "dilation_shift",
    ),
    "blur_zooms_pairs.csv": (
        "assumed_blur",
        "blur",
        "zoom",
        "share_found",
        "low_found",
        "high_found",
        "scale_shift",
        "q25_shift",
        "q75_shift",
    ),
}
"""Files read, with the columns that they must have."""

SHARES = {"found": "right keypoints found again", "right": "found ones that are right"}
"""What the lines of the shares are of."""

SHIFTS: dict[str, tuple[str, dict[str, Any]]] = {
    "scale": ("measured", {"color": palette.INK, "marker": "o", "markersize": 2.5}),
    "blob": (
        "blob, closed form",
        {"color": palette.THEORY_COLOURS["blob"], "linestyle": style.REFERENCE},
    ),
    "dilation": (
        "mere dilation",
        {"color": palette.THEORY_COLOURS["dilation"], "linestyle": style.REFERENCE},
    ),
}
"""What the lines of the shifts are of, and how they look."""


def draw(tables: Tables, draft: bool = False) -> Figure:
    """Draw the keypoints kept, and the shift of their scale, against blur and zoom.

    Parameters
    ----------
    tables : mapping
        ``figS2``: one row per view and range of scales; ``blur_zooms_pairs``: one row per assumed
        blur and view at another zoom.
    draft : bool
        Say on the figure that its numbers come from quick settings.

    Returns
    -------
    matplotlib Figure
        One column per range of scales, against true minus assumed blur. a: shares of the right
        keypoints that are found and of the found ones that are right; b: median shift of scale,
        with that of two closed forms. Below, against the zoom between two views of which the same
        blur is assumed: c: share of the keypoints of the first that is found in the other; d:
        median shift of their scale, with quartiles.

    Raises
    ------
    InputError
        If the table is unusable.
    """
    check_tables(tables, TABLES)
    table = tables["figS2"]
    ranges = list(dict.fromkeys(table["scales"]))
    with style.context():
        figure = style.new_figure(6.1)
        place, below = figure.add_gridspec(2, 1, height_ratios=(2.0, 1.0))
        shares, shifts = style.panels(place, 2, len(ranges), sharex=True, hspace=0.04, wspace=0.05)
        for number, name in enumerate(ranges):
            rows = table[table["scales"] == name].sort_values("error")
            _draw_shares(shares[number], rows)
            _draw_shifts(shifts[number], rows)
            if number:
                for ax, panel in ((shares[number], "a"), (shifts[number], "b")):
                    ax.set_label(f"{panel} {name}")
                    ax.set_title(name, loc="left")
        style.letter(shares[0], "a", f"keypoints kept, {ranges[0]}")
        style.letter(shifts[0], "b", f"shift of scale, {ranges[0]}")
        shares[0].set_ylabel("share (%)")
        shifts[0].set_ylabel("$\\log_2(\\sigma' / \\sigma)$ (octaves)")
        _name_lines(shares[0], [(text, palette.COMPARED_COLOURS[k]) for k, text in SHARES.items()])
        _name_lines(shifts[0], [(text, look["color"]) for text, look in SHIFTS.values()])
        _draw_zooms(style.panels(below, 1, 2, wspace=0.05)[0], tables["blur_zooms_pairs"])
        return style.settle(figure, draft)


def _draw_shares(ax: Axes, rows: DataFrame) -> None:
    """Draw the two shares with their 95 % Wilson bands."""
    for name in SHARES:
        colour = palette.COMPARED_COLOURS[name]
        share, low, high = (100 * rows[f"{part}_{name}"] for part in ("share", "low", "high"))
        draw_band(ax, rows["error"], low, high, colour)
        line = {"color": colour, "linewidth": 1.2, "markersize": 2.5, "label": name}
        ax.plot(rows["error"], share, "o-", **line)
    ax.set(ylim=(0.0, 102.0), yticks=range(0, 101, 25))
    _mark_right(ax)


def _draw_shifts(ax: Axes, rows: DataFrame) -> None:
    """Draw the measured shift with its quartiles, and those of the closed forms."""
    ax.axhline(0.0, color=palette.GREY, linewidth=0.5, zorder=1)
    draw_band(ax, rows["error"], rows["q25_shift"], rows["q75_shift"], palette.INK)
    for name, (_, look) in SHIFTS.items():
        ax.plot(rows["error"], rows[f"{name}_shift"], **{"linewidth": 1.2, "label": name, **look})
    ax.set_xlabel("true minus assumed blur, $c - c'$ (px)")
    _mark_right(ax)


def _draw_zooms(panels: Sequence[Axes], table: DataFrame) -> None:
    """Draw what is found, and the shift of scale, against the zoom, for each assumed blur."""
    found, shift = panels
    style.letter(found, "c", "keypoints found again at another zoom")
    style.letter(shift, "d", "shift of scale")
    names = []
    for blur in sorted(table["assumed_blur"].unique()):
        rows = table[table["assumed_blur"] == blur].sort_values("zoom")
        own = rows["blur"].iloc[0]
        kind = "right" if blur == own else "below" if blur < own else "above"
        colour = palette.ASSUMED_COLOURS[kind]
        share, low, high = (100 * rows[f"{part}_found"] for part in ("share", "low", "high"))
        draw_band(found, rows["zoom"], low, high, colour)
        draw_band(shift, rows["zoom"], rows["q25_shift"], rows["q75_shift"], colour)
        line = {"color": colour, "linewidth": 1.2, "markersize": 2.5, "label": f"{blur:g}"}
        found.plot(rows["zoom"], share, "o-", **line)
        shift.plot(rows["zoom"], rows["scale_shift"], "o-", **line)
        names.append((f"assumed {blur:g} px" + (", right" if kind == "right" else ""), colour))
    found.set(ylim=(0.0, 102.0), yticks=range(0, 101, 25))
    found.set_ylabel("share (%)")
    shift.set_ylabel("$\\log_2(\\sigma_2 / \\sigma_1)$ (octaves)")
    _name_lines(found, names)
    zooms = sorted(table["zoom"].unique())
    for ax in panels:
        ax.set_xticks(zooms, [f"{zoom:g}" for zoom in zooms])
        ax.set_xlabel("zoom")
        style.finish_axes(ax)


def _mark_right(ax: Axes) -> None:
    """Mark where the assumption is right."""
    ax.axvline(0.0, color=palette.GREY, linewidth=0.5, zorder=1)
    style.finish_axes(ax)


def _name_lines(ax: Axes, lines: list[tuple[str, Any]]) -> None:
    """Write the names of lines in their colours at the foot of a panel."""
    for line, (text, colour) in enumerate(reversed(lines)):
        place = {"transform": ax.transAxes, "ha": "left", "va": "bottom"}
        ax.text(0.02, 0.03 + 0.1 * line, text, color=colour, fontsize=style.SMALL, **place)


if __name__ == "__main__":
    raise SystemExit(main(draw, TABLES))
