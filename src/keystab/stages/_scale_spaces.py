"""Scale-spaces of the views of a set: the detector that the command line describes, and stores."""

from __future__ import annotations

import argparse
import math
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from keystab.camera.common_field import windows_of_common_field
from keystab.detection.stored_extrema import stored_extrema
from keystab.detection.view_detector import Detector, Search, Window
from keystab.io.scale_space_store import StoredScaleSpace
from keystab.io.view_store import View, Views
from keystab.scalespace.dog import ScaleSpace

# Pixels around what all views have in common in which extrema are sought too.
_RIM = 4.0


def view_detector(args: argparse.Namespace, view: View) -> Detector:
    """Detector of the views of a set, as the command line describes it."""
    blur = view.blur if args.assumed_blur is None else args.assumed_blur
    names = ("n_spo", "delta_min", "sigma_min", "kappa", "oversampling", "n_oct")
    options = {name: getattr(args, name) for name in names}
    if "epsilon" in args:
        options |= {name: getattr(args, name) for name in ("epsilon", "scale_moves", "move")}
        # Paths of nearest moves serve every M_offset; below 1/2 they do not move on anyway.
        options["max_offset"] = 0.5 if args.max_offset is None else args.max_offset
    return Detector(camera_blur=blur, **options)


def searched_windows(views: Views, guard: float) -> list[Window | None]:
    """Part of each view in which extrema are sought: what all views have in common, and a rim.

    No keypoint beyond it is ever compared. The rim is for what the refinement moves and for
    neighbours that are the same; windows end at every fourth pixel, so that views that differ by a
    fraction of a pixel are searched alike.
    """
    if guard == 0:
        return [None] * len(views)
    windows = windows_of_common_field(views.specs, views.reference_shape, guard)
    return [
        (
            4.0 * math.floor((top - _RIM) / 4),
            4.0 * math.ceil((bottom + _RIM) / 4),
            4.0 * math.floor((left - _RIM) / 4),
            4.0 * math.ceil((right + _RIM) / 4),
        )
        for top, bottom, left, right in windows
    ]


def store_of(folder: Path, number: int, octave: int) -> Path:
    """Place of the scale-space of one octave of one view."""
    return folder / f"view{number}_octave{octave}"


def search_of_stores(folder: Path, number: int, epsilon: float) -> Search:
    """Search of stored scale-spaces of one view."""

    def search(space: ScaleSpace, octave: int) -> NDArray[np.int64]:
        store = StoredScaleSpace(store_of(folder, number, octave))
        return stored_extrema(store, space, epsilon)

    return search
