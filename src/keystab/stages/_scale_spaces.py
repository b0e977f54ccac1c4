"""Balanced scale-spaces of one view."""

from __future__ import annotations

from keystab.io.view_store import View
from keystab.parameters import DifferenceOfGaussians
from keystab.scalespace.dog import ScaleSpace, scale_space


def balanced_space(view: View, n_spo: int, dog: DifferenceOfGaussians) -> ScaleSpace:
    """Scale-space of a view at its balanced sampling."""
    return scale_space(
        view.image, view.blur, n_spo, None, dog.sigma_min, dog.kappa, dog.oversampling
    )
