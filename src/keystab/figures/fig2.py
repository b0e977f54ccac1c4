"""Figure 2: simulated pictures of one scene at several blurs and zooms (section 4)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from keystab.errors import InputError
from keystab.figures import palette, style
from keystab.figures._render import Tables, check_tables, main

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from pandas import DataFrame

TABLES = {
    "fig2.csv": ("view", "label", "blur", "step", "height", "width"),
    "fig2_pixels.parquet": ("view", "y", "x", "value"),
}
"""Files read, with the columns that they must have."""

DETAIL = 0.16
"""Width and height of the magnified detail, as a share of the scene that all views see."""


class View(NamedTuple):
    """One simulated picture: its name, camera blur (px), subsampling step and pixels."""

    label: str
    blur: float
    step: float
    pixels: NDArray[np.float64]


def draw(tables: Tables, draft: bool = False) -> Figure:
    """Draw the views, and below each the same detail of the scene with its pixels visible.

    Parameters
    ----------
    tables : mapping
        ``fig2``: one row per view; ``fig2_pixels``: one row per pixel, values in [0, 1] drawn from
        black to white.
    draft : bool
        Say on the figure that its numbers come from quick settings.

    Returns
    -------
    matplotlib Figure
        One column per view, in the order of ``view``.

    Raises
    ------
    InputError
        If a table is unusable or a view's pixels are not all there.
    """
    check_tables(tables, TABLES)
    views = _views(tables["fig2"], tables["fig2_pixels"])
    aspect = max(view.pixels.shape[0] / view.pixels.shape[1] for view in views)
    detail = _busiest_detail(views)
    with style.context():
        column = style.WIDTH / len(views)
        figure = style.new_figure(2 * aspect * column + 0.3)
        panels = style.panels(figure.add_gridspec(1, 1)[0], 2, len(views))
        for k, (view, whole, zoomed) in enumerate(zip(views, panels[0], panels[1], strict=True)):
            height, width = view.pixels.shape
            style.letter(whole, "abcdefghijklmnopqrstuvwxyz"[k % 26], f"$c$ = {view.blur} px")
            whole.set_title(
                f"$S$ = {view.step:.4g}, {width} × {height} px", loc="right", fontsize=style.SMALL
            )
            _show(whole, view.pixels)
            window = _window(view, detail)
            _outline(whole, window)
            _show(zoomed, view.pixels)
            (top, bottom), (left, right) = window
            zoomed.set(xlim=(left, right), ylim=(bottom, top), label=f"detail {k}")
            for edge in zoomed.spines.values():
                edge.set(color=palette.FRAME, linewidth=1.0)
        return style.settle(figure, draft)


def _views(views: DataFrame, pixels: DataFrame) -> list[View]:
    """Collect the views and put their pixels back into arrays ``[y, x]``."""
    found = []
    for row in views.sort_values("view").to_dict("records"):
        height, width = int(row["height"]), int(row["width"])
        own = pixels[pixels["view"] == row["view"]]
        array = np.full((height, width), np.nan)
        y, x = own["y"].to_numpy(dtype=int), own["x"].to_numpy(dtype=int)
        if len(own) == height * width and y.max() < height and x.max() < width:
            array[y, x] = own["value"].to_numpy()
        if not np.isfinite(array).all():
            raise InputError(
                f"fig2_pixels.parquet: view {row['view']} needs {height} x {width} pixels, each "
                "once and finite; remake the table"
            )
        found.append(View(str(row["label"]), float(row["blur"]), float(row["step"]), array))
    return found


def _busiest_detail(views: list[View]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return centre and half size, as (y, x) in reference pixels from the views' common centre.

    The detail is the window of the coarsest view where the picture varies most, so that blur and
    pixels have something to show.
    """
    from scipy.ndimage import uniform_filter

    coarsest = max(views, key=lambda view: view.step)
    common = np.min([np.array(view.pixels.shape) * view.step for view in views], axis=0)
    half = 0.5 * DETAIL * common
    size = np.maximum(np.round(2 * half / coarsest.step).astype(int), 1)
    mean = uniform_filter(coarsest.pixels, size)
    variance = uniform_filter(coarsest.pixels**2, size) - mean**2
    middle = (np.array(coarsest.pixels.shape) - 1) / 2
    offsets = np.moveaxis(np.indices(coarsest.pixels.shape), 0, -1) - middle
    inside = (np.abs(offsets) * coarsest.step + half <= 0.5 * common).all(axis=-1)
    best = np.unravel_index(np.argmax(np.where(inside, variance, -1.0)), variance.shape)
    return offsets[best] * coarsest.step, half


Window = tuple[tuple[float, float], tuple[float, float]]


def _window(view: View, detail: tuple[NDArray[np.float64], NDArray[np.float64]]) -> Window:
    """Return ((top, bottom), (left, right)) of the detail in the view's pixels."""
    centre, half = detail
    middle = (np.array(view.pixels.shape) - 1) / 2 + centre / view.step
    (top, left), (bottom, right) = middle - half / view.step, middle + half / view.step
    return (float(top), float(bottom)), (float(left), float(right))


def _show(ax: Axes, pixels: NDArray[np.float64]) -> None:
    """Show pixels as they are, black at 0 and white at 1."""
    ax.imshow(pixels, cmap="gray", vmin=0.0, vmax=1.0, interpolation="nearest")
    ax.set(xticks=[], yticks=[])


def _outline(ax: Axes, window: Window) -> None:
    """Outline the detail that is magnified below."""
    from matplotlib.patches import Rectangle

    (top, bottom), (left, right) = window
    frame: dict[str, Any] = {"edgecolor": palette.FRAME, "facecolor": "none", "linewidth": 1.0}
    ax.add_patch(Rectangle((left, top), right - left, bottom - top, **frame))


if __name__ == "__main__":
    raise SystemExit(main(draw, TABLES))
