"""The slices of two octaves, the balanced step, and a blob seen by two samplings."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from explaining.views import KAPPA
from keystab.figures import palette, style
from keystab.scalespace.gaussian_blobs import dog_at_centre, dog_extremum_scale
from keystab.scalespace.sampling import Sampling, balanced_delta

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SIGMA_MIN, CAMERA_BLUR = 1.1, 1.1
BLOB = 2.0
SIZE = (100, 100)


def draw() -> Figure:
    """Draw the three panels."""
    figure = style.new_figure(2.5)
    slices, balance, blob = figure.subplots(1, 3, width_ratios=(1.25, 0.9, 1))
    _draw_slices(slices)
    _draw_balance(balance)
    _draw_blob(blob)
    style.finish_axes(slices, balance, blob)
    return figure


def _draw_slices(ax: Axes) -> None:
    step = balanced_delta(3, KAPPA, SIGMA_MIN)
    ticks, names = [], []
    for octave, colour in enumerate(palette.OCTAVE_COLOURS):
        sampling = Sampling(SIZE, CAMERA_BLUR, 3, step, SIGMA_MIN, KAPPA, octave)
        for s, sigma in enumerate(sampling.sigma):
            height = s + 6.4 * octave
            searched = 1 <= s <= sampling.n_spo
            shade = colour if searched else palette.PALE
            ax.plot([sigma, KAPPA * sigma], [height] * 2, color=shade, lw=2.2, marker="o", ms=3.5)
            ticks.append(height)
            names.append(str(s))
        name = f"octave {octave + 1}: step {sampling.step:.2f} px"
        ax.text(1.02, 5.1 + 6.4 * octave, name, color=colour, fontsize=style.SMALL, va="center")
    style.log_x_axis(ax, 1.0, 8.0)
    ax.set(xlim=(1.0, 8.0), ylim=(-0.6, 12.2), xlabel="blur (px)", ylabel="slice s")
    ax.set_yticks(ticks, names)
    style.letter(ax, "a", "two blurs for each slice")


def _draw_balance(ax: Axes) -> None:
    n_spo = np.arange(2, 21)
    steps = [balanced_delta(int(n), KAPPA, SIGMA_MIN) for n in n_spo]
    ax.plot(n_spo, steps, "o-", color=palette.BALANCED_COLOUR, ms=3, mec="none", lw=1)
    ax.plot([3], [0.5], "D", color=palette.SIFT_COLOURS["unfiltered"], ms=4.5, mec="white")
    style.direct_label(
        ax, 3, 0.5, "SIFT", palette.SIFT_COLOURS["unfiltered"], right=7, up=4, ha="left"
    )
    style.log_y_axis(ax, 0.06, 0.95)
    ax.set(xlabel=f"{style.N_SPO} (scales per octave)", ylabel=f"{style.DELTA_MIN} (px)")
    ax.set_xticks([3, 5, 10, 15, 20])
    style.letter(ax, "b", "balanced step")


def _draw_blob(ax: Axes) -> None:
    sigma = np.geomspace(1.1, 3.3, 200)
    found = float(dog_extremum_scale(BLOB, KAPPA))
    ax.axvline(found, color=palette.GREY, ls=style.REFERENCE, lw=0.8, ymax=0.9)
    ax.plot(sigma, dog_at_centre(sigma, BLOB, KAPPA), color=palette.PALE, lw=2.5, zorder=1)
    for n_spo, mark, size, colour in (
        (15, ".", 3.5, palette.DETECTION_COLOURS["refined"]),
        (3, "s", 4.5, palette.DETECTION_COLOURS["discrete"]),
    ):
        count = math.floor(n_spo * math.log2(3.3 / SIGMA_MIN)) + 1
        scales = SIGMA_MIN * 2 ** (np.arange(count) / n_spo)
        ax.plot(scales, dog_at_centre(scales, BLOB, KAPPA), mark, color=colour, ms=size, mec="none")
    for y, text, colour in (
        (-0.0825, r"$\sigma_{\mathrm{blob}}/\sqrt{\kappa}$", palette.GREY),
        (-0.0905, f"{style.N_SPO} = 3", palette.DETECTION_COLOURS["discrete"]),
        (-0.0935, f"{style.N_SPO} = 15", palette.DETECTION_COLOURS["refined"]),
    ):
        ax.text(1.03 * found, y, text, color=colour, fontsize=style.SMALL)
    style.log_x_axis(ax, 1.0, 3.4)
    ax.set(xlabel="scale σ (px)", ylabel="w (grey value)", xlim=(1.05, 3.4))
    style.letter(ax, "c", "a blob of 2 px")
