"""What is compared in several stages."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from keystab.camera.common_field import common_scales, zooms_in_common_field
from keystab.io.view_store import Views
from keystab.matching.common_range import CommonRange, comparable
from keystab.parameters import Compared, ComparedInViews

Inside = Callable[[pd.DataFrame, str], NDArray[np.bool_]]


def inside(compared: Compared, sigma_min: float, shape: tuple[int, int]) -> Inside:
    """Say which rows of a table, by the scale in one of its columns, are compared in a view."""

    def rows(table: pd.DataFrame, scale_column: str) -> NDArray[np.bool_]:
        return comparable(table, shape, sigma_min, scale_column=scale_column, **vars(compared))

    return rows


def common_range(views: Views, compared: ComparedInViews, soft_ends: bool = False) -> CommonRange:
    """Field of view and range of scales that all views of a set have in common."""
    it, specs, margin = compared, views.specs, max(compared.guard, compared.border)
    zooms = zooms_in_common_field(specs, views.reference_shape, margin)
    scales = common_scales(specs, it.sigma_min, it.n_oct, it.first_scale, it.last_scale, zooms)
    return CommonRange(specs, views.reference_shape, margin, *scales, soft_ends)
