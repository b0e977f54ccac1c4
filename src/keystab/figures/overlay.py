"""Keypoints drawn on the picture that they were found in."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from keystab.errors import InputError
from keystab.figures import palette
from keystab.figures.style import NORMAL, context
from keystab.utils.files import check_writable, written_whole

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["COLOURS", "FORMATS", "check_drawing", "draw_keypoints"]

FORMATS = (".png", ".svg")
"""Suffixes of the files that pictures with keypoints are written to."""

COLOURS = ("survival", "sign", "conditioning")
"""Columns that may decide the colour of a keypoint."""

_TWO_NORMALS = 5.991
"""The 95 % quantile of the sum of two squared normal variables."""

_LARGEST_SIDE, _LEAST_SIDE = 2400, 1200
"""Longer side of what is drawn, in its pixels: large pictures are reduced, small ones enlarged."""

_DPI, _FOOT = 100, 0.75
"""Pixels per inch, and the height in inches of the line below the picture."""

_FACTORS = (1, 2, 5, 10, 20, 50, 100, 200, 500)
"""Factors by which ellipses are enlarged if none is given."""

_LARGEST_FACTOR = 10000.0
"""Larger ellipses fill any picture, and take for ever."""


def draw_keypoints(
    image: NDArray[np.float64],
    keypoints: pd.DataFrame,
    path: str | os.PathLike[str],
    colour: str | None = None,
    part: tuple[int, int, int, int] | None = None,
    enlarge: float | None = None,
) -> str:
    """Draw keypoints as circles of radius sigma, with 95 % ellipses where they have error bars.

    Parameters
    ----------
    image : ndarray, shape (height, width)
        The picture, grey.
    keypoints : DataFrame
        Columns ``y, x, sigma``; for ellipses ``std_y, std_x, cov_yx``; for colour ``survival``,
        ``sign`` or ``conditioning``.
    path : path
        ``.png`` or ``.svg``. The same keypoints give the same bytes.
    colour : {"survival", "sign", "conditioning"}, optional
        What colours tell; by default the first of these that the table has.
    part : (int, int, int, int), optional
        First row, first column, height and width of what is drawn; all by default.
    enlarge : float, optional
        Factor by which ellipses are enlarged, at most 10000; by default the largest of 1, 2, 5, 10
        and so on at which half of them stay within their circles. The drawing says which.

    Returns
    -------
    str
        What the drawing shows, in a line of words.

    Raises
    ------
    InputError
        If the colour is no column of the table, the part lies outside of the picture, the factor
        is not allowed, or the file cannot be written.
    """
    check_writable(path, FORMATS)
    colour = _colour(keypoints, colour)
    top, left, height, width = check_drawing(image.shape, part, enlarge)
    inside = keypoints["y"].between(top - 0.5, top + height - 0.5)
    inside &= keypoints["x"].between(left - 0.5, left + width - 0.5)
    # Those that come back lie on top.
    shown = keypoints[inside].sort_values(colour, kind="stable")
    crop = image[top : top + height, left : left + width]
    with context():
        figure, axes, zoom = _canvas(crop, (top, left))
        values = shown[colour].to_numpy(dtype=np.float64)
        _circles(axes, shown, _rgb(colour, values), zoom)
        beyond = f" of {len(keypoints)}" if len(shown) < len(keypoints) else ""
        words = f"{len(shown)}{beyond} keypoints; circles: radius σ"
        factor = _ellipses(axes, shown, _rgb(colour, values), enlarge)
        if factor:
            words += f"; ellipses: 95 % of the position, enlarged {factor:g} times"
        _key(figure, colour, words)
        with written_whole(path) as file:
            # Neither date nor version: the same keypoints give the same bytes.
            nothing = {"Software": None} if file.suffix.lower() == ".png" else {"Date": None}
            figure.savefig(file, dpi=_DPI, metadata=nothing)
    return f"{words}; colour: {colour}"


def check_drawing(
    shape: tuple[int, ...], part: tuple[int, int, int, int] | None, enlarge: float | None
) -> tuple[int, int, int, int]:
    """First row and column, height and width of what is drawn.

    Parameters
    ----------
    shape : tuple of int
        Height and width of the picture.
    part, enlarge
        See `draw_keypoints`.

    Raises
    ------
    InputError
        If the part lies outside of the picture or the factor is not allowed.

    Examples
    --------
    >>> check_drawing((60, 100), (50, 0, 20, 30), None)
    (50, 0, 10, 30)
    """
    if enlarge is not None and not 0 < enlarge <= _LARGEST_FACTOR:
        raise InputError(
            f"the factor of ellipses is {enlarge:g}, allowed are positive numbers up to "
            f"{_LARGEST_FACTOR:g}"
        )
    top, left, height, width = (0, 0, *shape) if part is None else part
    if height < 1 or width < 1 or not (0 <= top < shape[0] and 0 <= left < shape[1]):
        raise InputError(
            f"the part {top} {left} {height} {width} lies outside of a picture of {shape[0]} x "
            f"{shape[1]} pixels: give first row, first column, height and width"
        )
    return top, left, min(height, shape[0] - top), min(width, shape[1] - left)


def _colour(keypoints: pd.DataFrame, colour: str | None) -> str:
    """Column that decides the colour."""
    have = [name for name in COLOURS if name in keypoints]
    if colour is None and have:
        return have[0]
    if colour not in have:
        raise InputError(
            f"colour is {colour!r}, allowed are columns that these keypoints have: "
            f"{', '.join(have) or 'none'}"
        )
    return colour


def _canvas(crop: NDArray[np.float64], first: tuple[int, int]) -> tuple[Figure, Axes, float]:
    """Figure with the picture, faint, and how many of its pixels a pixel of the picture takes."""
    from matplotlib.figure import Figure

    longer = max(crop.shape)
    zoom = min(max(longer, _LEAST_SIDE), _LARGEST_SIDE) / longer
    height, width = (n * zoom / _DPI for n in crop.shape)
    figure = Figure(figsize=(max(width, 6.0), height + _FOOT), layout="none")
    whole_width, whole_height = figure.get_size_inches()
    axes = figure.add_axes(
        (
            0.5 - width / whole_width / 2,
            _FOOT / whole_height,
            width / whole_width,
            height / whole_height,
        )
    )
    (top, left), (bottom, right) = first, (first[0] + crop.shape[0], first[1] + crop.shape[1])
    low, high = np.quantile(crop, [0.002, 0.998])
    shown = (crop - low) / max(high - low, np.finfo(np.float64).tiny)
    axes.imshow(
        np.clip(shown, 0.0, 1.0),
        cmap="gray",
        vmin=0.0,
        vmax=1.0,
        alpha=0.75,
        extent=(left - 0.5, right - 0.5, bottom - 0.5, top - 0.5),
        interpolation="antialiased",
    )
    axes.set_xlim(left - 0.5, right - 0.5)
    axes.set_ylim(bottom - 0.5, top - 0.5)
    axes.set_axis_off()
    return figure, axes, zoom


def _rgb(colour: str, values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Colours of values of a column, shape (n, 4)."""
    import matplotlib
    from matplotlib.colors import to_rgba

    if colour == "sign":
        signs = [palette.SIGN_COLOURS["maximum" if value > 0 else "minimum"] for value in values]
        return np.array([to_rgba(sign) for sign in signs]).reshape(-1, 4)
    return np.asarray(matplotlib.colormaps[palette.STABILITY_MAP](np.clip(values, 0.0, 1.0)))


def _circles(
    axes: Axes, keypoints: pd.DataFrame, colours: NDArray[np.float64], zoom: float
) -> None:
    """Circles of radius sigma, in pixels of the picture; dark lines around them keep them apart."""
    size = 2 * keypoints["sigma"].to_numpy(dtype=np.float64)
    place = keypoints[["x", "y"]].to_numpy(dtype=np.float64)
    fine = float(np.clip(zoom, 0.6, 1.5))
    for width, edge in ((1.6 * fine, (0, 0, 0, 0.55)), (0.9 * fine, colours)):
        _collect(axes, size, size, np.zeros(size.size), place, edge, width)


def _ellipses(
    axes: Axes, keypoints: pd.DataFrame, colours: NDArray[np.float64], enlarge: float | None
) -> float | None:
    """Draw 95 % ellipses of positions; return the factor by which they are enlarged."""
    if not {"std_y", "std_x", "cov_yx"} <= set(keypoints) or keypoints.empty:
        return None
    y, x, yx = (keypoints[name].to_numpy(dtype=np.float64) for name in ("std_y", "std_x", "cov_yx"))
    covariance = np.stack([x**2, yx, yx, y**2], axis=1).reshape(-1, 2, 2)
    squares, axes_of = np.linalg.eigh(covariance)
    half = np.sqrt(_TWO_NORMALS * np.maximum(squares, 0.0))  # shorter first
    if enlarge is None:
        room = float(np.median(keypoints["sigma"] / half[:, 1]))
        enlarge = max([factor for factor in _FACTORS if factor <= room], default=1)
    angle = np.degrees(np.arctan2(axes_of[:, 1, 1], axes_of[:, 0, 1]))
    place = keypoints[["x", "y"]].to_numpy(dtype=np.float64)
    width, height = 2 * enlarge * half[:, 1], 2 * enlarge * half[:, 0]
    face = colours.copy()
    face[:, 3] = 0.6
    _collect(axes, width, height, angle, place, colours, 0.4, face)
    return enlarge


def _collect(
    axes: Axes,
    widths: NDArray[np.float64],
    heights: NDArray[np.float64],
    angles: NDArray[np.float64],
    place: NDArray[np.float64],
    edge: object,
    line: float,
    face: object = "none",
) -> None:
    """Many ellipses at once, in pixels of the picture."""
    from matplotlib.collections import EllipseCollection

    axes.add_collection(
        EllipseCollection(
            widths, heights, angles, units="xy", offsets=place, offset_transform=axes.transData,
            edgecolors=edge, facecolors=face, linewidths=line,
        ),
        autolim=False,
    )  # fmt: skip


def _key(figure: Figure, colour: str, words: str) -> None:
    """Say below the picture what is drawn, and what colours mean."""
    import matplotlib
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize

    height = float(figure.get_size_inches()[1])
    line = _FOOT / height
    figure.text(0.01, 0.72 * line, words, va="center", ha="left", fontsize=NORMAL + 2)
    if colour == "sign":
        for k, (name, own) in enumerate(palette.SIGN_COLOURS.items()):
            figure.text(
                0.01 + 0.16 * k, 0.28 * line, f"○ {name} of the DoG", color=own,
                va="center", ha="left", fontsize=NORMAL + 2,
            )  # fmt: skip
        return
    label = {"survival": "survival: chance to be found again", "conditioning": "conditioning"}
    figure.text(0.01, 0.28 * line, label[colour], va="center", ha="left", fontsize=NORMAL + 2)
    bar = figure.add_axes((0.48, 0.24 * line, 0.4, 0.14 * line))
    scale = ScalarMappable(Normalize(0, 1), matplotlib.colormaps[palette.STABILITY_MAP])
    figure.colorbar(scale, cax=bar, orientation="horizontal", ticks=[0, 0.5, 1])
    bar.tick_params(labelsize=NORMAL, length=2, pad=1)
