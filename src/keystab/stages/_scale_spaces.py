"""Scale-spaces of the views of a set: the detector that the command line describes, and stores."""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from keystab.dog_space import ScaleSpace
from keystab.stages._inputs import View
from keystab.stored_extrema import stored_extrema
from keystab.stores import StoredScaleSpace
from keystab.view_detection import Detector, Search


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


def store_of(folder: Path, number: int, octave: int) -> Path:
    """Place of the scale-space of one octave of one view."""
    return folder / f"view{number}_octave{octave}"


def search_of_stores(folder: Path, number: int, epsilon: float) -> Search:
    """Search of stored scale-spaces of one view."""

    def search(space: ScaleSpace, octave: int) -> NDArray[np.int64]:
        store = StoredScaleSpace(store_of(folder, number, octave))
        return stored_extrema(store, space, epsilon)

    return search
