r"""What detectors are shown, and what they should find there.

A *scene* is a picture of known pixels, seen by the simulated camera: its views differ by known
shifts, zooms, rotations, blur and noise, and its true extrema, computed once, are known in each.
*Blobs* are Gaussians at known places, evenly spread over all sub-pixel phases and far enough apart
not to disturb one another; what should be found of each has a closed form, s / sqrt(kappa).

All scales are in pixels of the view. `LOW` to `HIGH` are compared; what is known reaches `KNOWN`
times farther on both sides, so that nothing at the ends is without a partner.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from keystab.camera.simulation import Scene, simulate, simulate_view
from keystab.camera.views import ViewSpec, to_reference, to_view
from keystab.errors import InputError
from keystab.truth.scene_extrema import scene_extrema

__all__ = [
    "BLOBS",
    "Condition",
    "Plan",
    "QUICK",
    "Stage",
    "View",
    "blobs",
    "conditions",
    "made_picture",
    "stage_of",
    "taken",
]

KAPPA = 2 ** (1 / 3)
LOW, HIGH = 1.4, 5.6
"""Scales that are compared, pixels of the view: two octaves."""

KNOWN = 2**0.25
"""How far what is known reaches beyond them, as a ratio."""

MARGIN = 18.0
"""Pixels at the border of a view, and of the scene in it, in which nothing is compared: 3.2 times
the largest scale."""

BLUR = 0.5
"""Camera blur of views where nothing else is said: what most detectors assume."""

STEP = 4.0
"""Pixels of the scene per pixel of a view, so that a view is blurred much more than the scene."""

SPAN = 1.7
"""How many times a view the scene is, so that views can turn and zoom in it."""

BLOBS = "blobs"
_SIZES, _APART = (1.6, 2.8, 5.0), 7.0
_GREY, _HEIGHT = 0.2, 0.6
_RADII = (3.0, 200.0)
_GOLDEN = 1.32471795724474602596  # the plastic number: its powers spread points evenly


@dataclass(frozen=True)
class Plan:
    """How much is asked.

    Parameters
    ----------
    width : int
        Width of a view in pixels; a scene that is smaller gives smaller ones.
    n_views : int
        Views of most conditions; translations have twice as many.
    blobs : int
        Blobs of each size, along each side.
    """

    width: int = 288
    n_views: int = 4
    blobs: int = 11


QUICK = Plan(width=192, n_views=2, blobs=10)


@dataclass(frozen=True, eq=False)
class View:
    """One picture that detectors are shown.

    Parameters
    ----------
    image : ndarray, shape (height, width)
        Grey values.
    blur : float
        Camera blur, pixels.
    truth : DataFrame
        ``y, x, sigma`` in pixels of the view: all that is known of it.
    wanted : ndarray of bool
        What of it is compared.
    spec : ViewSpec or None
        How the view was taken; None for blobs.
    """

    image: NDArray[np.float64]
    blur: float
    truth: pd.DataFrame
    wanted: NDArray[np.bool_]
    spec: ViewSpec | None

    @cached_property
    def _levels(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Scales a third of an octave apart, and the absolute difference of Gaussians at each."""
        scene = Scene(self.image)
        sigma = LOW / KNOWN * 2 ** (np.arange(10) / 3)
        blurred = [
            simulate(scene, ViewSpec(math.sqrt(max(s**2 - self.blur**2, 0)), 1.0, scene.shape))
            for s in sigma
        ]
        return sigma[:-1], np.abs(np.diff(blurred, axis=0))

    def strength(self, keypoints: pd.DataFrame) -> NDArray[np.float64]:
        """Contrast of keypoints, by one measure for all detectors.

        Parameters
        ----------
        keypoints : DataFrame
            ``y, x, sigma`` in pixels of the view.

        Returns
        -------
        ndarray of float64
            Absolute difference of Gaussians at the nearest pixel and the nearest third of an
            octave: enough to say which are the strongest.
        """
        sigma, levels = self._levels
        level = np.abs(
            np.log(keypoints["sigma"].to_numpy()[:, None]) - np.log(sigma)[None, :]
        ).argmin(axis=1)
        at = [
            np.clip(np.round(keypoints[name].to_numpy()).astype(int), 0, size - 1)
            for name, size in zip(("y", "x"), self.image.shape, strict=True)
        ]
        found: NDArray[np.float64] = levels[level, at[0], at[1]]
        return found


class Condition(NamedTuple):
    """Views that are compared with their truth and with the first of them."""

    name: str
    views: list[View]
    stage: Stage | None


@dataclass(frozen=True)
class Stage:
    """A scene with its true extrema.

    Attributes
    ----------
    scene : Scene
        What the camera sees.
    truth : DataFrame
        ``y, x, sigma`` of its extrema in pixels of the scene.
    shape : (int, int)
        Height and width of views.
    """

    scene: Scene
    truth: pd.DataFrame
    shape: tuple[int, int]

    def compared(
        self, spec: ViewSpec, y: NDArray[np.float64], x: NDArray[np.float64]
    ) -> NDArray[np.bool_]:
        """Whether positions of a view lie inside of its margin and of the scene's."""
        inside = np.ones(len(y), dtype=bool)
        for position, size in zip((y, x), spec.shape, strict=True):
            inside &= (position >= MARGIN) & (position <= size - 1 - MARGIN)
        there = to_reference(spec, self.scene.shape, y, x)
        for position, size in zip(there, self.scene.shape, strict=True):
            rim = MARGIN * spec.step
            inside &= (position >= rim) & (position <= size - 1 - rim)
        return inside

    def view(self, spec: ViewSpec) -> View:
        """Take a view, and say what is in it."""
        y, x = to_view(spec, self.scene.shape, self.truth["y"], self.truth["x"])
        sigma = self.truth["sigma"].to_numpy() / spec.step
        seen = (y >= 0) & (y <= spec.shape[0] - 1) & (x >= 0) & (x <= spec.shape[1] - 1)
        seen &= (sigma >= LOW / KNOWN) & (sigma <= HIGH * KNOWN)
        truth = pd.DataFrame({"y": y, "x": x, "sigma": sigma})[seen].reset_index(drop=True)
        wanted = truth["sigma"].between(LOW, HIGH).to_numpy()
        wanted = wanted & self.compared(spec, truth["y"].to_numpy(), truth["x"].to_numpy())
        return View(simulate(self.scene, spec), spec.blur, truth, wanted, spec)


def stage_of(picture: NDArray[np.float64], plan: Plan, threads: int = 1) -> Stage:
    """Make a scene of a picture: as many of its pixels as views need, and their true extrema.

    Parameters
    ----------
    picture : ndarray, shape (height, width)
        Grey values. A large one is seen from farther away first.
    plan : Plan
    threads : int
        Threads of the search for extrema.

    Returns
    -------
    Stage

    Raises
    ------
    InputError
        If the picture is too small for views of which something is left inside of the margins.
    """
    farther = max(1.0, picture.shape[1] / (STEP * SPAN * plan.width))
    scene = Scene(picture)
    if farther > 1:
        scene = Scene(simulate_view(scene, BLUR, farther))
    height, width = (int(n / (STEP * SPAN)) for n in scene.shape)
    least = int(3 * MARGIN)
    if min(height, width) < least:
        needed = math.ceil(least * STEP * SPAN)
        raise InputError(
            f"the picture has {picture.shape[0]} x {picture.shape[1]} pixels; give one of at "
            f"least {needed} x {needed}"
        )
    parts = []
    for octave in range(3):
        step = STEP * 2**octave
        spec = ViewSpec(BLUR, step, (int(scene.shape[0] / step), int(scene.shape[1] / step)))
        low = LOW / KNOWN
        found = scene_extrema(scene, spec, low, 2 * low, KAPPA, n_spo=[13], threads=threads)
        y, x = to_reference(spec, scene.shape, found["y"], found["x"])
        parts.append(pd.DataFrame({"y": y, "x": x, "sigma": found["sigma"] * step}))
    return Stage(scene, pd.concat(parts, ignore_index=True), (height, width))


def made_picture(height: int = 800, width: int = 1360) -> NDArray[np.float64]:
    """Picture for whoever has none at hand: discs of all sizes that hide one another.

    Parameters
    ----------
    height, width : int
        Pixels.

    Returns
    -------
    ndarray of float64, shape (height, width)
        Grey values in [0, 1]. The same wherever it is made.

    Notes
    -----
    The density of the radii falls with their third power, as it must for a picture that looks alike
    from near and far. Edges are not smoothed: views blur them.

    Examples
    --------
    >>> made_picture(20, 30).shape
    (20, 30)
    """
    draw = np.random.default_rng(1511)
    picture = np.full((height, width), 0.5)
    n = int(height * width / 60)
    radius = _RADII[0] / np.sqrt(1 - draw.random(n) * (1 - (_RADII[0] / _RADII[1]) ** 2))
    centres = draw.random((n, 2)) * (height, width)
    rows, columns = np.arange(height)[:, None], np.arange(width)[None, :]
    for (y, x), r, grey in zip(centres, radius, draw.uniform(0.05, 0.95, n), strict=True):
        down = slice(max(0, math.ceil(y - r)), math.floor(y + r) + 1)
        across = slice(max(0, math.ceil(x - r)), math.floor(x + r) + 1)
        inside = (rows[down] - y) ** 2 + (columns[:, across] - x) ** 2 <= r**2
        picture[down, across][inside] = grey
    return picture


def conditions(plan: Plan) -> dict[str, list[ViewSpec]]:
    """Views of all conditions of a scene, by name; shapes are filled in by `taken`.

    Examples
    --------
    >>> [len(specs) for specs in conditions(Plan()).values()][:3]
    [8, 4, 4]
    """
    n = plan.n_views

    def views(count: int, blur: float = BLUR) -> list[ViewSpec]:
        shifts = 4 * (spread_points(count) - 0.5)  # all phases of samples up to four pixels apart
        return [ViewSpec(blur, STEP, (1, 1), (float(y), float(x))) for y, x in shifts]

    found = {"translations": views(2 * n)}
    found |= {f"blur {blur}": views(n, blur=blur) for blur in (0.3, 0.5, 0.8, 1.1)}
    found |= {
        f"zoom {zoom}": [
            replace(spec, step=STEP * zoom ** (number % 2)) for number, spec in enumerate(views(n))
        ]
        for zoom in (1.25, 1.6)
    }
    found |= {
        f"rotation {degrees}": [
            replace(spec, rotation=math.radians(degrees) * number)
            for number, spec in enumerate(views(min(n, most)))
        ]
        for degrees, most in ((90, 4), (30, 2))
    }
    found |= {
        f"noise {noise}": [
            replace(spec, noise=noise, seed=("audit", number))
            for number, spec in enumerate(views(n))
        ]
        for noise in (0.01, 0.03)
    }
    return found


def taken(name: str, specs: Sequence[ViewSpec], stage: Stage) -> Condition:
    """Take the views of a condition."""
    whole = [replace(spec, shape=stage.shape) for spec in specs]
    return Condition(name, [stage.view(spec) for spec in whole], stage)


def blobs(plan: Plan) -> Condition:
    """Pictures of isolated blobs, one for each of three sizes, an octave apart or nearly.

    Each blob's neighbours are seven of its standard deviations away, and change where it is by less
    than 1e-3 pixels; its phase is spread over four pixels, so that samples up to two pixels apart
    are met evenly.
    """
    views = []
    for size in _SIZES:
        apart = math.ceil(_APART * size)
        n = plan.blobs
        phases = 4 * spread_points(n * n).reshape(n, n, 2)
        grid = np.moveaxis(np.mgrid[1 : n + 1, 1 : n + 1], 0, -1) * apart
        centres = (grid + phases).reshape(-1, 2)
        side = (n + 1) * apart + 4
        variance = size**2 + BLUR**2
        pixels = np.arange(side)
        rows, columns = (
            np.exp(-((pixels[None, :] - centres[:, axis, None]) ** 2) / (2 * variance))
            for axis in range(2)
        )
        image = _GREY + _HEIGHT * rows.T @ columns
        truth = pd.DataFrame(
            {"y": centres[:, 0], "x": centres[:, 1], "sigma": size / math.sqrt(KAPPA)}
        )
        views.append(View(image, BLUR, truth, np.ones(len(truth), dtype=bool), None))
    return Condition(BLOBS, views, None)


def spread_points(n: int) -> NDArray[np.float64]:
    """Points in the unit square, spread more evenly than by chance: an additive recurrence.

    Examples
    --------
    >>> spread_points(1000).mean(axis=0).round(2).tolist()
    [0.5, 0.5]
    """
    steps = np.array([1 / _GOLDEN, 1 / _GOLDEN**2])
    points: NDArray[np.float64] = (0.5 + np.arange(1, n + 1)[:, None] * steps) % 1.0
    return points
