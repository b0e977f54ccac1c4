"""A climb to a true extremum, beside what the samples and the refinement say."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from explaining.views import KAPPA, view
from keystab.detection.detector import detect_keypoints
from keystab.evaluation.recall_precision import partners
from keystab.figures import palette, style
from keystab.scalespace.continuous_dog import DogSeries
from keystab.scalespace.sampling import balanced_delta
from keystab.truth.newton import newton_step
from keystab.truth.true_extrema import true_extrema

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

BLUR, N_SPO = 1.1, 3
STEPS = 6


class Climb(NamedTuple):
    """One true extremum, and what finds it; places are (sigma, y, x) in pixels."""

    series: DogSeries
    true: Array
    steps: Array
    refined: Array
    finely_refined: Array


def distance(places: Array, true: Array) -> Array:
    """Distances from an extremum in scale-space units."""
    apart = np.atleast_2d(places)
    along = np.log(apart[:, 0] / true[0])
    away: Array = np.sqrt(along**2 + ((apart[:, 1:] - true[1:]) ** 2).sum(axis=1) / true[0] ** 2)
    return away


@cache
def climb() -> Climb:
    """Of the well shaped extrema of a view, that whose discrete detection is farthest off."""
    image = view(BLUR, 112, 200)
    series = DogSeries.of_image(image, BLUR, KAPPA)
    truth = true_extrema(image, BLUR)
    truth = truth[(truth["conditioning"] > 0.06) & truth["sigma"].between(1.4, 2.0)]
    found = {
        name: detect_keypoints(image, BLUR, n_spo, refine=refine)
        for name, n_spo, refine in (
            ("discrete", N_SPO, False), ("refined", N_SPO, True), ("fine", 15, True),
        )
    }  # fmt: skip
    best: Climb | None = None
    rows = {name: partners(truth, table) for name, table in found.items()}
    for i, true in enumerate(truth[["sigma", "y", "x"]].to_numpy()):
        if min(row[i] for row in rows.values()) < 0:
            continue
        begin, refined, fine = (
            table[["sigma", "y", "x"]].to_numpy()[rows[name][i]] for name, table in found.items()
        )
        steps = _newton(series, begin)
        if distance(steps[-1], true)[0] > 1e-9:
            continue
        far = distance(begin, true)[0]
        if best is None or far > distance(best.steps[0], best.true)[0]:
            best = Climb(series, true, steps, refined, fine)
    assert best is not None
    return best


def _newton(series: DogSeries, begin: Array) -> Array:
    places = [begin]
    for _ in range(STEPS):
        sigma, y, x = places[-1]
        jets = series.jets(np.array([sigma]), np.array([y]), np.array([x]))
        step = newton_step(jets)[0]
        places.append(np.array([sigma * np.exp(step[0]), y + sigma * step[1], x + sigma * step[2]]))
    return np.stack(places)


def draw() -> Figure:
    """Draw both panels."""
    figure = style.new_figure(2.8)
    plane, steps = figure.subplots(1, 2, width_ratios=(1.3, 1))
    _draw_plane(plane)
    _draw_steps(steps)
    style.finish_axes(steps)
    return figure


def _draw_plane(ax: Axes) -> None:
    found = climb()
    delta = balanced_delta(N_SPO, KAPPA, 1.1)
    x = np.linspace(found.true[2] - 1.0, found.true[2] + 1.0, 81)
    sigma = np.geomspace(found.true[0] / 1.4, found.true[0] * 1.4, 81)
    grid_sigma, grid_x = np.meshgrid(sigma, x, indexing="ij")
    y = np.full(grid_x.size, found.true[1])
    values = found.series.jets(grid_sigma.ravel(), y, grid_x.ravel()).value.reshape(grid_x.shape)
    ax.contour(
        grid_x, grid_sigma, values, 16, colors=[palette.PALE], linewidths=0.9, linestyles="-"
    )
    columns = np.arange(np.ceil(x[0] / delta), np.floor(x[-1] / delta) + 1) * delta
    slices = 1.1 * 2 ** (np.arange(0, N_SPO + 2) / N_SPO)
    for scale in slices[(slices >= sigma[0]) & (slices <= sigma[-1])]:
        ax.plot(columns, 0 * columns + scale, "o", color=palette.GREY, ms=3, mec="none")
    ax.plot(found.steps[:, 2], found.steps[:, 0], "-", color=palette.INK, lw=1, marker=".", ms=5)
    for place, mark, kind in (
        (found.steps[0], "s", "discrete"), (found.refined, "D", "refined"),
    ):  # fmt: skip
        colour = palette.DETECTION_COLOURS[kind]
        ax.plot(place[2], place[0], mark, color=colour, ms=6, mec="white", zorder=4)
    ax.plot(found.true[2], found.true[0], "*", color=palette.INK, ms=8, mec="white", zorder=5)
    handles = [
        ax.plot([], [], mark, color=colour, ms=5, mec="none", label=name)[0]
        for mark, colour, name in (
            ("o", palette.GREY, "samples"),
            ("s", palette.DETECTION_COLOURS["discrete"], "discrete extremum"),
            ("D", palette.DETECTION_COLOURS["refined"], "refined"),
            ("*", palette.INK, "true extremum"),
        )
    ]
    ax.legend(
        handles=handles, ncols=4, loc="lower center", bbox_to_anchor=(0.5, -0.32), frameon=False,
        handletextpad=0.1, columnspacing=0.9,
    )  # fmt: skip
    style.log_y_axis(ax, float(sigma[0]), float(sigma[-1]))
    ax.set(xlim=(x[0], x[-1]), xlabel="x (px)", ylabel="scale σ (px)")
    style.letter(ax, "a", "contours of w, and the samples")


def _draw_steps(ax: Axes) -> None:
    found = climb()
    away = np.maximum(distance(found.steps, found.true), 1e-16)
    number = np.arange(away.size)
    last = int(np.argmax(away < 1e-11)) if (away < 1e-11).any() else away.size - 1
    number, away = number[: last + 1], away[: last + 1]
    ax.plot(number, away, "o-", color=palette.INK, ms=4, lw=1)
    ax.plot([0], away[:1], "s", color=palette.DETECTION_COLOURS["discrete"], ms=6, mec="white")
    for place, n_spo in ((found.refined, N_SPO), (found.finely_refined, 15)):
        off = distance(place, found.true)[0]
        colour = palette.DETECTION_COLOURS["refined"]
        ax.axhline(off, color=colour, lw=1)
        above = n_spo == N_SPO
        ax.text(
            number[-1] if above else 0, off * (1.5 if above else 0.6),
            f"refined, {style.N_SPO} = {n_spo}", color=colour, ha="right" if above else "left",
            va="bottom" if above else "top", fontsize=style.SMALL,
        )  # fmt: skip
    style.log_y_axis(ax, 3e-16, 3.0)
    ax.text(0.15, 1.2 * away[0], "discrete", color=palette.DETECTION_COLOURS["discrete"],
            fontsize=style.SMALL, va="bottom")  # fmt: skip
    ax.set(xlabel="Newton's steps", ylabel="distance (scale-space units)", xticks=number)
    style.letter(ax, "b", "how far each is from the truth")
