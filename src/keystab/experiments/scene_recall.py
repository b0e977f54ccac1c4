"""What sets of views could see of the true extrema of a scene (figure truth_cameras)."""

from __future__ import annotations

from collections.abc import Sequence

import pandas as pd

from keystab.camera.views import ViewSpec
from keystab.matching.common_range import CommonRange


def seen_by_all(
    scene: pd.DataFrame,
    seen_from: ViewSpec,
    specs: Sequence[ViewSpec],
    reference_shape: tuple[int, int],
    margin: float,
) -> tuple[CommonRange, pd.DataFrame]:
    """True extrema of a scene that lie in the field of all views of a set.

    Parameters
    ----------
    scene : DataFrame
        True extrema of the scene, ``y, x, sigma, sign`` in pixels of the view `seen_from`.
    seen_from : ViewSpec
        That view.
    specs : sequence of ViewSpec
        Views of the set.
    reference_shape : tuple of int
        Height and width of the reference in pixels.
    margin : float
        Width of the margin of every view, in its pixels.

    Returns
    -------
    field : CommonRange
        The field of all views, at all scales.
    extrema : DataFrame
        The extrema in it, in the frame of the first view of the set.
    """
    first = CommonRange([specs[0], seen_from], reference_shape, 0.0, 0.0)
    field = CommonRange(specs, reference_shape, margin, 0.0)
    return field, field.common(first.common(scene.assign(view=1)).assign(view=0))
