"""Error bars against noisy shots, and the survival of a keypoint beside a saddle."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from explaining.views import KAPPA, view
from keystab.detection.detector import detect_keypoints
from keystab.figures import palette, style
from keystab.prediction.survival import RADIUS
from keystab.prediction.uncertainty import keypoint_uncertainty
from keystab.utils.random import random_generator

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

BLUR, NOISE, N_SPO, SHOTS = 0.8, 0.01, 12, 60
TWO_NORMALS = 4.605
"""The 90 % quantile of the sum of two squared normal variables."""

BLOB, WEAKER = 2.0, 0.7
DISTANCES = {5.8: "near a saddle", 7.0: "far from it"}
"""Of two blobs, pixels: at 5.7 px the weaker one has no extremum of its own."""

NOISES = np.geomspace(0.01, 0.32, 8)


class Shots(NamedTuple):
    """A keypoint with its error bars, and where it is in noisy shots, pixels."""

    keypoint: pd.Series[float]
    places: Array


def returns(keypoint: pd.Series[float], image: Array, noise: float, purpose: str) -> Array:
    """Where a keypoint is in noisy shots, shape (n, 3): y, x and sigma."""
    places = []
    for shot in range(SHOTS):
        draw = random_generator("explained", purpose, shot)
        noisy = image + noise * draw.standard_normal(image.shape)
        found = detect_keypoints(noisy, BLUR, N_SPO, kappa=KAPPA)
        found = found[found["sign"] == keypoint["sign"]]
        sigma = keypoint["sigma"]
        away = np.sqrt(
            np.log(found["sigma"] / sigma) ** 2
            + ((found["y"] - keypoint["y"]) ** 2 + (found["x"] - keypoint["x"]) ** 2) / sigma**2
        )
        if len(away) and away.min() < RADIUS:
            nearest = int(np.argmin(away.to_numpy()))
            places.append(found[["y", "x", "sigma"]].to_numpy(dtype=float)[nearest])
    return np.array(places).reshape(-1, 3)


@cache
def shots() -> tuple[Shots, Shots]:
    """Two keypoints that are likely to survive: a round one, and the most elongated one."""
    image = view(BLUR, 64, 96)
    found = keypoint_uncertainty(image, BLUR, NOISE, N_SPO, kappa=KAPPA, noise_free=True)
    inside = found["y"].between(8, 55) & found["x"].between(8, 87)
    found = found[inside & (found["survival"] > 0.95) & found["sigma"].between(1.4, 2.0)]
    covariance = np.array(
        [[found["std_y"] ** 2, found["cov_yx"]], [found["cov_yx"], found["std_x"] ** 2]]
    )
    axes = np.sqrt(np.linalg.eigvalsh(covariance.transpose(2, 0, 1)))
    ratio = axes[:, 1] / axes[:, 0]
    rows = np.argmin(ratio), np.argmax(ratio)
    return tuple(  # type: ignore[return-value]
        Shots(found.iloc[k], returns(found.iloc[k], image, NOISE, f"view {k}")) for k in rows
    )


@cache
def survivals() -> pd.DataFrame:
    """Survival of the weaker of two blobs, predicted and counted, by distance and noise."""
    rows = []
    y, x = np.mgrid[:33, :49].astype(float)
    spread = 2 * (BLOB**2 + BLUR**2)
    for distance in DISTANCES:
        places = 24 - distance / 2, 24 + distance / 2
        strong, weak = (np.exp(-((y - 16) ** 2 + (x - place) ** 2) / spread) for place in places)
        image = strong + WEAKER * weak
        for noise in NOISES:
            found = keypoint_uncertainty(image, BLUR, noise, N_SPO, kappa=KAPPA, noise_free=True)
            near = found[(found["sign"] < 0) & ((found["y"] - 16).abs() < 1) & (found["x"] > 25)]
            keypoint = near.iloc[int(np.argmin(near["value"].to_numpy()))]
            seen = len(returns(keypoint, image, noise, "blobs"))
            rows.append((distance, noise, keypoint["survival"], seen / SHOTS))
    return pd.DataFrame(rows, columns=["distance", "noise", "predicted", "counted"])


def ellipse(keypoint: pd.Series[float]) -> Array:
    """Outline of the 90 % ellipse, shape (2, n): y and x about the keypoint."""
    covariance = np.array(
        [
            [keypoint["std_y"] ** 2, keypoint["cov_yx"]],
            [keypoint["cov_yx"], keypoint["std_x"] ** 2],
        ]
    )
    angle = np.linspace(0, 2 * np.pi, 121)
    root = np.linalg.cholesky(covariance)
    outline: Array = np.sqrt(TWO_NORMALS) * root @ np.stack([np.cos(angle), np.sin(angle)])
    return outline


def draw() -> Figure:
    """Draw the panels."""
    figure = style.new_figure(2.4)
    left, right, survival = figure.subplots(1, 3, width_ratios=(1, 1, 1.3))
    for ax, shot in zip((left, right), shots(), strict=True):
        draw_shots(ax, shot)
        ax.set(xlabel="shift in x (px)")
    left.set(ylabel="shift in y (px)")
    style.letter(left, "a", "shots, and 90 % ellipses")
    _draw_survival(survival)
    style.finish_axes(left, right, survival)
    return figure


def draw_shots(ax: Axes, shot: Shots) -> None:
    """Draw where shots have a keypoint, about where it is without noise."""
    keypoint = shot.keypoint
    away = shot.places[:, :2] - keypoint[["y", "x"]].to_numpy(dtype=float)
    outline = ellipse(keypoint)
    ax.plot(away[:, 1], away[:, 0], "o", color=palette.GREY, ms=2.6, mec="none")
    ax.plot(outline[1], outline[0], color=palette.DETECTION_COLOURS["refined"], lw=1.4)
    ax.plot(0, 0, "+", color=palette.INK, ms=7)
    reach = 1.15 * max(float(np.abs(away).max()), float(np.abs(outline).max()))
    ax.set(xlim=(-reach, reach), ylim=(reach, -reach), aspect="equal")


def _draw_survival(ax: Axes) -> None:
    colours = palette.DETECTION_COLOURS["discrete"], palette.DETECTION_COLOURS["refined"]
    for (distance, table), colour in zip(survivals().groupby("distance"), colours, strict=True):
        ax.plot(table["noise"], table["predicted"], color=colour, lw=1.4)
        ax.plot(table["noise"], table["counted"], "o", color=colour, ms=4, mec="none")
        name = DISTANCES[float(str(distance))]
        y = 0.1 if colour == colours[0] else 0.22
        ax.text(0.03, y, name, color=colour, fontsize=style.SMALL, transform=ax.transAxes)
    style.log_x_axis(ax, 0.01, 0.32)
    ax.set(xlabel="noise (grey value)", ylabel="survival", ylim=(0, 1.04))
    style.letter(ax, "b", "lines: predicted; dots: counted")
