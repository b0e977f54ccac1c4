"""The search of the views of a set, in stored scale-spaces or streaming them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from keystab.detection.stored_extrema import stored_extrema
from keystab.detection.view_detector import Detector, Search
from keystab.io.scale_space_store import StoredScaleSpace
from keystab.io.view_store import View
from keystab.parameters import ScaleSpaceOfViews
from keystab.scalespace.dog import ScaleSpace


def view_detector(view: View, n_spo: int, dog: ScaleSpaceOfViews, **search: Any) -> Detector:
    """Detector of a view of a set.

    Parameters
    ----------
    view : View
        The view, whose own blur is assumed where no other is.
    n_spo : int
        Scales per octave.
    dog : ScaleSpaceOfViews
        Its scale-spaces.
    **search
        What else the detector is told.
    """
    return Detector(
        view.blur if dog.assumed_blur is None else dog.assumed_blur,
        n_spo,
        dog.delta_min,
        dog.sigma_min,
        dog.kappa,
        dog.oversampling,
        n_oct=dog.n_oct,
        **search,
    )


def store_of(folder: Path, number: int, octave: int) -> Path:
    """Place of the scale-space of one octave of one view."""
    return folder / f"view{number}_octave{octave}"


def search_of_stores(folder: Path, number: int, epsilon: float) -> Search:
    """Search of stored scale-spaces of one view."""

    def search(space: ScaleSpace, octave: int) -> NDArray[np.int64]:
        store = StoredScaleSpace(store_of(folder, number, octave))
        return stored_extrema(store, space, epsilon)

    return search
