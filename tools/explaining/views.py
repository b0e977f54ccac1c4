"""The views that the figures of docs/how_it_works show."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from keystab.camera.simulation import Scene, simulate_view
from keystab.io.pictures import read_picture

Array = NDArray[np.float64]

KAPPA = 2 ** (1 / 3)
STEP = 20.0
"""Reference pixels per pixel of a view."""


@cache
def scene() -> Scene:
    """The study's picture."""
    return Scene(read_picture(Path(__file__).parents[2] / "config/images/coldwarm.png"))


@cache
def view(blur: float, height: int, width: int, down: float = 0.0, right: float = 0.0) -> Array:
    """A small view of it, without noise."""
    return simulate_view(scene(), blur, STEP, (height, width), (down, right))
