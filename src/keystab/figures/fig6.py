"""Figure 6: the DoG around stable and unstable keypoints, as iso-surfaces (section 5.4)."""

from __future__ import annotations

from itertools import product
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from keystab.errors import InputError
from keystab.figures import palette, style
from keystab.figures._render import Tables, check_tables, main

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from pandas import DataFrame

TABLES = {
    "fig6.csv": ("panel", "group", "stability", "extremum", "level", "condition"),
    "fig6_cubes.parquet": ("panel", "k_s", "k_y", "k_x", "value"),
}
"""Files read, with the columns that they must have."""

GROUPS = ("stable", "unstable")
"""The two groups, from top to bottom."""

COLUMNS = 5
"""Panels per row."""

VIEW = {"elev": 24.0, "azim": -62.0}
"""Where every cube is seen from, in degrees."""


class Surface(NamedTuple):
    """Triangles of an iso-surface: corners (n, 3) as (x, y, sigma) samples, and faces (m, 3)."""

    corners: NDArray[np.float64]
    faces: NDArray[np.int64]


def draw(tables: Tables, draft: bool = False) -> Figure:
    """Draw the iso-surface around each keypoint, stable ones above unstable ones.

    Parameters
    ----------
    tables : mapping
        ``fig6``: one row per cube; ``fig6_cubes``: the DoG at offsets ``k_s, k_y, k_x`` in samples
        from the keypoint.
    draft : bool
        Say on the figure that its numbers come from quick settings.

    Returns
    -------
    matplotlib Figure
        One cube per panel, all seen from the same direction: the part of the surface ``DoG =
        level`` that encloses the keypoint in its group's colour, other parts in grey. A keypoint
        without an extremum in the dense scale-space is marked so.

    Raises
    ------
    InputError
        If a table is unusable, a group is empty, a cube has holes or its level is that of the
        keypoint itself.
    """
    check_tables(tables, TABLES)
    panels = tables["fig6"].sort_values("panel")
    cubes = dict(tuple(tables["fig6_cubes"].groupby("panel")))
    rows = {group: -(-int((panels["group"] == group).sum()) // COLUMNS) for group in GROUPS}
    empty = [group for group in GROUPS if rows[group] == 0]
    if empty:
        raise InputError(f"fig6.csv: the group {empty[0]} is empty; choose keypoints for it")
    with style.context():
        figure = style.new_figure(1.33 * sum(rows.values()) + 0.55)
        strips = figure.subfigures(2, 1, height_ratios=[rows[group] for group in GROUPS])
        for group, strip in zip(GROUPS, strips, strict=True):
            members = panels[panels["group"] == group]
            strip.suptitle(_heading(members), x=0.01, ha="left", fontsize=style.NORMAL)
            for place, row in enumerate(members.to_dict("records"), start=1):
                ax = strip.add_subplot(rows[group], COLUMNS, place, projection="3d")
                cube = _cube(cubes.get(row["panel"]), row["panel"])
                _draw_cube(ax, cube, row)
                if group == GROUPS[0] and place == 1:
                    _draw_triad(ax, len(cube) // 2)
                    text = f"cubes of {len(cube)}$^3$ samples; stability and condition number"
                    strip.text(0.99, 0.985, text, ha="right", va="top", fontsize=style.SMALL)
        return style.settle(figure, draft)


def _heading(members: DataFrame) -> str:
    """Return the title of a group."""
    low, high = 100 * members["stability"].min(), 100 * members["stability"].max()
    span = f"{high:.0f} %" if round(low) == round(high) else f"{low:.0f} to {high:.0f} %"
    return rf"$\bf{{{members['group'].iloc[0]}}}$, detected at {span} of the samplings"


def _cube(rows: DataFrame | None, panel: int) -> NDArray[np.float64]:
    """Put a cube's rows into an array ``[k_s, k_y, k_x]`` with the keypoint in the middle."""
    if rows is None:
        raise InputError(f"fig6_cubes.parquet: has no cube for panel {panel}; remake the table")
    offsets = rows[["k_s", "k_y", "k_x"]].to_numpy(dtype=int)
    half = int(np.abs(offsets).max())
    cube = np.full((2 * half + 1,) * 3, np.nan)
    cube[tuple((offsets + half).T)] = rows["value"].to_numpy()
    if not np.isfinite(cube).all():
        raise InputError(
            f"fig6_cubes.parquet: the cube of panel {panel} needs {cube.shape[0]}^3 finite values; "
            "remake the table"
        )
    return cube


def iso_surfaces(cube: NDArray[np.float64], level: float) -> tuple[Surface, Surface | None]:
    """Triangulate where the DoG takes a level, closed by the cube's sides.

    Parameters
    ----------
    cube : ndarray, shape (n, n, n)
        DoG values ``[k_s, k_y, k_x]``, n odd.
    level : float
        DoG value of the surface.

    Returns
    -------
    own : Surface
        The boundary of the part of the cube, on the keypoint's side of `level`, that holds the
        keypoint.
    others : Surface or None
        The boundaries of the other parts on that side, if there are any.

    Raises
    ------
    InputError
        If the keypoint itself has the value `level`.
    """
    from skimage.measure import label, marching_cubes

    half = len(cube) // 2
    height = cube - level
    if height[half, half, half] == 0:
        raise InputError(
            f"fig6.csv: level {level} is the value of the keypoint; choose one nearer 0"
        )
    height *= np.sign(height[half, half, half])
    parts = label(height > 0, connectivity=1)
    own = parts == parts[half, half, half]

    def boundary(inside: NDArray[np.bool_]) -> Surface:
        outside = -np.abs(height).max()
        # What belongs to other parts is pushed under; the far value closes the surface at +-half.
        kept = np.where(inside | (height <= 0), height, -height)
        padded = np.pad(kept, 1, constant_values=1e6 * outside)
        corners, faces, _, _ = marching_cubes(padded, 0.0)
        return Surface((corners - 1 - half)[:, ::-1].astype(np.float64), faces)

    others = (parts > 0) & ~own
    return boundary(own), boundary(others) if others.any() else None


def _draw_cube(ax: Any, cube: NDArray[np.float64], row: dict[Any, Any]) -> None:
    """Draw the surfaces in a cube, its far edges, and the keypoint's numbers."""
    from matplotlib.colors import LightSource, to_rgb
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    own, others = iso_surfaces(cube, float(row["level"]))
    triangles, colours = [own.corners[own.faces]], [palette.SURFACE_COLOURS[row["group"]]]
    if others is not None:
        triangles.append(others.corners[others.faces])
        colours.append(palette.OTHERS_COLOUR)
    _frame(ax, len(cube) // 2)
    # One collection, so that near triangles hide far ones whatever they belong to; as pixels
    # inside the PDF, because vectors would be megabytes with seams between triangles.
    surfaces = Poly3DCollection(
        np.concatenate(triangles),
        facecolors=np.repeat([to_rgb(c) for c in colours], [len(t) for t in triangles], axis=0),
        shade=True,
        lightsource=LightSource(azdeg=-15.0, altdeg=40.0),
        linewidths=0,
        antialiased=False,
        rasterized=True,
        zorder=2,
    )
    ax.add_collection3d(surfaces)
    ax.set_label(f"panel {row['panel']}")
    shape = f"cond. {row['condition']:.3g}" if row["extremum"] else "no extremum"
    text = f"{100 * row['stability']:.0f} %, {shape}"
    ax.set_title(text, fontsize=style.SMALL, y=1.09, pad=0)


def _frame(ax: Any, half: int) -> None:
    """Set the view of a cube and draw the edges that do not touch its nearest corner."""
    ax.computed_zorder = False
    ax.set_proj_type("ortho")
    ax.view_init(**VIEW)
    ax.set_box_aspect((1, 1, 1), zoom=1.08)
    ax.set(xlim=(-half, half), ylim=(half, -half), zlim=(-half, half))  # y runs down a picture
    ax.set_axis_off()
    nearest = (1, 1, 1)
    for start in product((-1, 1), repeat=3):
        for axis in range(3):
            stop = tuple(1 if i == axis else value for i, value in enumerate(start))
            if start[axis] == -1 and nearest not in (start, stop):
                ends = half * np.array([start, stop]).T
                ax.plot(*ends, color=palette.PALE, linewidth=0.6, zorder=0)


def _draw_triad(ax: Any, half: int) -> None:
    """Draw the edges that leave the far lower corner as axes, each named at its positive end."""
    corner = -half * np.ones(3)
    names = (("$x$", "left"), ("$y$", "right"), (r"$\sigma$", "right"))
    for axis, (name, where) in enumerate(names):
        tip = corner.copy()
        tip[axis] = half
        ends = np.stack([corner, tip], axis=1)
        ax.plot(*ends, color=palette.INK, linewidth=0.9, zorder=1, label=name)
        tip[axis] = half * (0.6 if axis == 2 else 1.08)
        ax.text(*tip, f" {name} ", fontsize=style.SMALL, ha=where, va="center")


if __name__ == "__main__":
    raise SystemExit(main(draw, TABLES))
