"""The five stations of the data, each drawn from one small view."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from explaining.error_bars import draw_shots, shots
from explaining.matching import draw_occurrence
from explaining.views import KAPPA, view
from keystab.detection.detector import detect_keypoints
from keystab.figures import palette, style
from keystab.scalespace.dog import scale_space

if TYPE_CHECKING:
    from matplotlib.figure import Figure

BLUR, HEIGHT, WIDTH = 1.1, 64, 64


def draw() -> Figure:
    """Draw the five tiles."""
    image = view(BLUR, HEIGHT, WIDTH)
    found = detect_keypoints(image, BLUR, 15, kappa=KAPPA)
    dog = scale_space(image, BLUR, 3, kappa=KAPPA).scale_slice(2)[::2, ::2]
    limit = float(np.abs(dog).max())
    figure = style.new_figure(1.6)
    tiles = figure.subplots(1, 5)
    pictures = {"interpolation": "nearest", "cmap": "gray"}
    frame = (-0.5, WIDTH - 0.5, HEIGHT - 0.5, -0.5)
    tiles[0].imshow(image, **pictures)
    tiles[1].imshow(dog, vmin=-limit, vmax=limit, extent=frame, **pictures)
    tiles[2].imshow(image, alpha=0.55, **pictures)
    for name, sign in (("maximum", 1), ("minimum", -1)):
        some = found[found["sign"] == sign]
        tiles[2].scatter(
            some["x"], some["y"], s=6 * some["sigma"] ** 2, fc="none", lw=0.9,
            ec=palette.SIGN_COLOURS[name],
        )  # fmt: skip
    draw_occurrence(tiles[3])
    tiles[3].set(xlabel="", ylabel="")
    tiles[3].set_box_aspect(1)
    draw_shots(tiles[4], shots()[1])
    titles = ("view", "scale-space", "extrema", "matching", "error bar")
    for ax, title in zip(tiles, titles, strict=True):
        ax.set(title=title, xticks=[], yticks=[])
        ax.spines[:].set_visible(True)
    return figure
