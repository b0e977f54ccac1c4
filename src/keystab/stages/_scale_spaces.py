"""Scale-spaces of one view."""

from __future__ import annotations

from keystab.io.view_store import View
from keystab.parameters import DifferenceOfGaussians
from keystab.scalespace.dog import ScaleSpace, scale_space


def sampled_space(
    view: View, n_spo: int, dog: DifferenceOfGaussians, delta_min: float | None = None
) -> ScaleSpace:
    """Scale-space of a view at its balanced sampling, or at another sampling step."""
    return scale_space(
        view.image, view.blur, n_spo, delta_min, dog.sigma_min, dog.kappa, dog.oversampling
    )
