"""The simulated camera: blur, sampling, and what aliasing is."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from explaining.views import STEP, scene
from keystab.figures import palette, style
from keystab.scalespace.cosine_series import evaluate

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

BLUR = 0.8
ROW, FIRST, PIXELS = 1210, 1000, 18
"""Row of the reference, its first column, and pixels of the view."""

BLURS = (0.25, 0.5, 0.8, 1.1)
WAVE = 0.7
"""Cycles per pixel of a wave that aliases."""


def draw() -> Figure:
    """Draw the three panels."""
    figure = style.new_figure(2.3)
    scene_row, left, wave = figure.subplots(1, 3, width_ratios=(1.25, 1, 1))
    _draw_row(scene_row)
    _draw_left(left)
    _draw_wave(wave)
    style.finish_axes(scene_row, left, wave)
    return figure


def _draw_row(ax: Axes) -> None:
    fine = np.arange(FIRST, FIRST + STEP * (PIXELS - 1) + 1)
    centres = FIRST + STEP * np.arange(PIXELS)
    series = scene().coefficients
    sharp = evaluate(series, [ROW], fine)[0]
    blurred, pixels = (evaluate(series, [ROW], x, BLUR * STEP)[0] for x in (fine, centres))
    ax.plot((fine - FIRST) / STEP, sharp, color=palette.PALE, lw=0.8)
    ax.plot((fine - FIRST) / STEP, blurred, color=palette.METHOD_COLOURS["dct"], lw=1.2)
    ax.plot(np.arange(PIXELS), pixels, "o", color=palette.INK, ms=3.5, mec="none", zorder=3)
    ax.set(xlabel="position x (px of the view)", ylabel="grey value", ylim=(0, 1.35))
    ax.set_yticks(np.arange(0, 1.1, 0.25))
    for x, text, colour in (
        (0.02, "scene", palette.GREY),
        (0.30, "blurred", palette.METHOD_COLOURS["dct"]),
        (0.66, "pixels", palette.INK),
    ):
        ax.text(x, 0.93, text, color=colour, fontsize=style.SMALL, transform=ax.transAxes)
    style.letter(ax, "a", "a row of a view")


def _draw_left(ax: Axes) -> None:
    frequency = np.linspace(0, 1, 200)
    ax.axvspan(0.5, 1, color=palette.PALE, alpha=0.45, lw=0)
    ax.axvline(0.5, color=palette.GREY, ls=style.REFERENCE, lw=0.8)
    colours = palette.sweep_colours(BLURS)
    for blur in BLURS:
        left = np.exp(-((2 * np.pi * frequency * blur) ** 2) / 2)
        ax.plot(frequency, left, color=colours[blur], lw=1.3)
    names = ("c = 0.25 px", "0.5", "0.8", "1.1")
    places = ((0.66, 0.68), (0.53, 0.33), (0.28, 0.45), (0.06, 0.45))
    for blur, name, (x, y) in zip(BLURS, names, places, strict=True):
        ax.text(x, y, name, color=colours[blur], fontsize=style.SMALL)
    ax.text(0.76, 0.95, "folded back", color=palette.GREY, fontsize=style.SMALL, ha="center")
    ax.set(xlabel="frequency (cycles/px)", ylabel="share of contrast left", xlim=(0, 1))
    ax.set_ylim(0, 1.03)
    style.letter(ax, "b", "what the blur leaves")


def _draw_wave(ax: Axes) -> None:
    fine, pixels = np.linspace(0, 8, 400), np.arange(9)
    fast, slow = (
        np.cos(2 * np.pi * np.multiply.outer((WAVE, 1 - WAVE), place)) for place in (fine, pixels)
    )
    colours = palette.METHOD_COLOURS["sampled"], palette.METHOD_COLOURS["dct"]
    for values, colour in zip(fast, colours, strict=True):
        ax.plot(fine, values, color=colour, lw=1.1)
    ax.plot(pixels, slow[0], "o", color=palette.INK, ms=3.5, mec="none", zorder=3)
    ax.text(0.1, 1.42, "scene: 0.7 cycles/px", color=colours[0], fontsize=style.SMALL)
    ax.text(0.1, 1.18, "seen: 0.3 cycles/px", color=colours[1], fontsize=style.SMALL)
    ax.set(xlabel="position x (px)", ylabel="grey value", ylim=(-1.15, 1.65), yticks=(-1, 0, 1))
    style.letter(ax, "c", "aliasing")
