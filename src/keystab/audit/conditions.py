r"""What detectors are shown, and what they should find there.

A *scene* is a picture of known pixels, seen by the simulated camera: its views differ by known
shifts, zooms, rotations, blur and noise, and its true extrema, computed once, are known in each.
*Blobs* are Gaussians at known places, as many at every sub-pixel phase and far enough apart not to
disturb one another; what should be found of each has a closed form, s / sqrt(kappa).

All scales are in pixels of the view. `LOW` to `HIGH` are compared; what is known reaches `KNOWN`
times farther on both sides, so that nothing at the ends is without a partner.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from keystab.audit.phases import PERIOD, even_phases, spread_points
from keystab.camera.made_scenes import make_scene
from keystab.camera.simulation import Scene, simulate, simulate_view
from keystab.camera.views import ViewSpec, to_reference, to_view
from keystab.errors import InputError
from keystab.parameters import AuditPlan
from keystab.truth.scene_extrema import scene_extrema

__all__ = [
    "BLOBS",
    "CONDITIONS",
    "PLAN",
    "QUICK",
    "Condition",
    "Stage",
    "View",
    "blobs",
    "condition_of",
    "made_picture",
    "scene_of",
    "stage_of",
    "views_of",
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

_SIZES, _APART = (1.6, 2.8, 5.0), 7.0
_GREY, _HEIGHT = 0.2, 0.6


BLOBS = "blobs"
PLAN, QUICK = AuditPlan(288, 4, 11), AuditPlan(192, 2, 10)
"""How much is asked, and how much in a hurry."""

CONDITIONS = (
    BLOBS, "translations", "blur 0.3", "blur 0.5", "blur 0.8", "blur 1.1", "zoom 1.25", "zoom 1.6",
    "rotation 90", "rotation 30", "noise 0.01", "noise 0.03",
)  # fmt: skip
"""All conditions; the numbers are pixels, a ratio, degrees, and grey values."""


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
    extremum : ndarray of int, optional
        Which extremum of the scene each row of the truth is: the same number in every view. None
        where no two rows of any views are the same.
    """

    image: NDArray[np.float64]
    blur: float
    truth: pd.DataFrame
    wanted: NDArray[np.bool_]
    spec: ViewSpec | None
    extremum: NDArray[np.intp] | None = None

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
        image = simulate(self.scene, spec)
        return View(image, spec.blur, truth, wanted, spec, np.flatnonzero(seen))


def scene_of(picture: NDArray[np.float64], plan: AuditPlan) -> NDArray[np.float64]:
    """Scene that is made of a picture: as many pixels as views need.

    Parameters
    ----------
    picture : ndarray, shape (height, width)
        Grey values. A large one is seen from farther away, a small one is the scene itself.
    plan : AuditPlan

    Returns
    -------
    ndarray of float64

    Raises
    ------
    InputError
        If the picture is too small for views of which something is left inside of the margins.
    """
    farther = picture.shape[1] / (STEP * SPAN * plan.width)
    scene = simulate_view(picture, BLUR, farther) if farther > 1 else picture
    least = math.ceil(3 * MARGIN * STEP * SPAN)
    if min(scene.shape) < least:
        needed = math.ceil(least * max(farther, 1.0))
        raise InputError(
            f"the picture has {picture.shape[0]} x {picture.shape[1]} pixels; give one of at "
            f"least {needed} x {needed}"
        )
    return scene


def stage_of(
    pixels: NDArray[np.float64], threads: int = 1, truth: pd.DataFrame | None = None
) -> Stage:
    """Scene with its true extrema.

    Parameters
    ----------
    pixels : ndarray, shape (height, width)
        What `scene_of` returns.
    threads : int
        Threads of the search for extrema.
    truth : DataFrame, optional
        Its true extrema, where they are known from before.

    Returns
    -------
    Stage
    """
    scene = Scene(pixels)
    height, width = (int(n / (STEP * SPAN)) for n in scene.shape)
    if truth is not None:
        return Stage(scene, truth, (height, width))
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
    """Picture for whoever has none at hand: dead leaves, the same wherever it is made.

    Parameters
    ----------
    height, width : int
        Pixels.

    Returns
    -------
    ndarray of float64, shape (height, width)
        Grey values in [0, 1]; see `keystab.make_scene`.

    Examples
    --------
    >>> made_picture(20, 30).shape
    (20, 30)
    """
    return make_scene("dead-leaves", (height, width), 1511)


def views_of(condition: str, plan: AuditPlan) -> list[ViewSpec]:
    """Views of a condition of a scene; their shapes are those of the scene.

    Parameters
    ----------
    condition : str
        ``translations``, or one of ``blur C``, ``zoom Z``, ``rotation DEGREES`` and ``noise SD``
        with a number; see `CONDITIONS`.
    plan : AuditPlan

    Returns
    -------
    list of ViewSpec
        All views are moved by other fractions of a pixel, and by up to two pixels, so that samples
        of coarser octaves are met at all phases too. The first looks straight at the scene from
        nearby; zooms step back in every second view, rotations turn by the angle from view to view.

    Raises
    ------
    InputError
        If there is no such condition.

    Examples
    --------
    >>> [spec.step for spec in views_of("zoom 1.5", PLAN)]
    [4.0, 6.0, 4.0, 6.0]
    """
    kind, _, text = condition.partition(" ")
    try:
        value = float(text) if text else 0.0
        if (kind == "translations") is bool(text) or not math.isfinite(value):
            raise ValueError
        if kind not in ("translations", *_LIMITS) or not _within(kind, value):
            raise ValueError
    except ValueError:
        raise InputError(
            f"condition {condition!r}: give {BLOBS}, translations, blur 0 to {LOW}, zoom 1 to "
            f"{SPAN}, rotation or noise with a number"
        ) from None
    count = {"translations": 2 * plan.n_views, "rotation": min(plan.n_views, 4)}.get(
        kind, plan.n_views
    )
    if kind == "rotation" and value % 90:
        count = min(count, 2)  # views at other angles take long
    specs = []
    for number, (y, x) in enumerate(4 * (spread_points(count) - 0.5)):
        spec = ViewSpec(BLUR, STEP, (1, 1), (float(y), float(x)))
        specs.append(
            {
                "translations": spec,
                "blur": replace(spec, blur=value),
                "zoom": replace(spec, step=STEP * value ** (number % 2) if value else STEP),
                "rotation": replace(spec, rotation=math.radians(value) * number),
                "noise": replace(spec, noise=abs(value), seed=("audit", number)),
            }[kind]
        )
    return specs


_LIMITS = {"blur": (0.0, LOW), "zoom": (1.0, SPAN), "rotation": (-360.0, 360.0), "noise": (0, 1)}


def _within(kind: str, value: float) -> bool:
    low, high = _LIMITS.get(kind, (0.0, 0.0))
    return low <= value <= high


def condition_of(name: str, plan: AuditPlan, stage: Stage | None) -> Condition:
    """Take the views of a condition; blobs need no scene.

    Parameters
    ----------
    name : str
        One of `CONDITIONS`, or another that `views_of` knows.
    plan : AuditPlan
    stage : Stage or None

    Raises
    ------
    InputError
        As `views_of`.
    """
    if name == BLOBS:
        return blobs(plan)
    assert stage is not None, "only blobs need no scene"
    specs = [replace(spec, shape=stage.shape) for spec in views_of(name, plan)]
    return Condition(name, [stage.view(spec) for spec in specs], stage)


def blobs(plan: AuditPlan) -> Condition:
    """Pictures of isolated blobs, one for each of three sizes, an octave apart or nearly.

    Each blob's neighbours are at least seven of its standard deviations away, and change where it
    is by less than 1e-3 pixels. Phases are even over four pixels, so that samples up to four pixels
    apart are met evenly, and others for each size; see `even_phases`.
    """
    views = []
    n = plan.blobs
    for number, size in enumerate(_SIZES):
        apart = PERIOD * (math.ceil(_APART * size / PERIOD) + 1)
        grid = np.moveaxis(np.mgrid[1 : n + 1, 1 : n + 1], 0, -1).reshape(-1, 2) * apart
        centres = grid + even_phases(n, number)
        side = (n + 1) * apart + PERIOD
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
