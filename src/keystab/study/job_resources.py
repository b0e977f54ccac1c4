"""What jobs may take where time and memory are handed out, as on a cluster.

Minutes and megabytes grow with the samples that a job visits, with room to spare over what
docs/reproduce/costs.md lists. Jobs without them are content with the defaults of a cluster's
profile. Nothing here changes a result or makes anything run again. Settings are those of
`keystab.study.scenes.resolved`.

Every job has one thread: matrix products differ in their last digits between numbers of threads.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import cache
from typing import Any

from keystab.camera.view_sets import view_shapes
from keystab.io.pictures import picture_shape

Settings = Mapping[str, Any]

SECONDS = 15e-6
"""Of a search, per pixel and scale per octave: three times what views with the most noise took."""

MEGABYTES = 600
"""Of Python with its libraries, twice."""

_shape_of_file = cache(picture_shape)


def pixels(settings: Settings, name: str) -> tuple[int, int]:
    """Pixels of all views of a set, and of the widest one per row."""
    shapes = view_shapes(settings["sets"][name], _shape(settings))
    return sum(height * width for height, width in shapes), max(width for _, width in shapes)


def _shape(settings: Settings) -> tuple[int, int]:
    """Height and width of the scene's picture, which may not have been made yet."""
    made = settings.get("reference_shape")
    return made or _shape_of_file(settings["reference"])


def _minutes(seconds: float) -> int:
    """Whole minutes, with some for waking up a machine."""
    return 5 + math.ceil(seconds / 60)


def minutes_of_set(settings: Settings, name: str, n_spo: str) -> int:
    """Time to search or write one sampling of all views of a set."""
    return _minutes(SECONDS * pixels(settings, name)[0] * int(n_spo))


def minutes_of_grid(settings: Settings, n_spo: str) -> int:
    """Time to search the view ``still`` at all steps of figure 3's grid."""
    n_steps = len(settings["grid"]["delta_min"])
    return _minutes(n_steps * SECONDS * pixels(settings, "still")[0] * int(n_spo))


def minutes_of_kappas(settings: Settings) -> int:
    """Time to search the view ``still`` for all ratios of the two blurs."""
    kappas = settings["kappas"]
    n_samplings = len(kappas["fractions"]) * kappas["n_spo"]
    return _minutes(10 * SECONDS * pixels(settings, "still")[0] * n_samplings)


def minutes_of_variant(settings: Settings) -> int:
    """Time to search a view at all samplings in a variant of the arithmetic."""
    n_scales = sum(settings["samplings"]["n_spo"])
    return _minutes(10 * SECONDS * pixels(settings, "still")[0] * n_scales)


def minutes_of_truth(settings: Settings) -> int:
    """Time to find the true extrema of a view or of the scene."""
    return _minutes(300 * SECONDS * pixels(settings, "still")[0])


def minutes_of_shots(settings: Settings) -> int:
    """Time to detect keypoints and their error bars in pairs of shots."""
    asked = settings["uncertainty"]
    # Each pair takes three searches and some error bars; other kinds of noise come with the first
    # view, other views without them.
    pairs = asked["n_pairs"] + 4 * asked["n_pairs_others"]
    scales = asked["n_spo"] * asked["n_oct"]
    shots = 5 * pairs * pixels(settings, "shots")[0]
    shots += 2 * asked["n_moved"] * pixels(settings, "moved")[0]
    return _minutes(SECONDS * scales * shots * len(asked["noise"]))


def megabytes_of_reference(settings: Settings) -> int:
    """Memory to work on the whole reference: some copies of it."""
    height, width = _shape(settings)
    return MEGABYTES + math.ceil(10 * 8 * height * width / 1e6)


def megabytes_of_store(settings: Settings, name: str, n_spo: str) -> int:
    """Memory to write or read a stored scale-space: rows of tiles, and their copies."""
    scales = int(n_spo)
    across = (
        pixels(settings, name)[1] * scales
    )  # at least the samples of a row at the balanced step
    return MEGABYTES + math.ceil(3 * 8 * 128 * (scales + 2) * across / 1e6)
