"""What is compared in several stages, and when two detections are the same."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from keystab.io.view_store import Views
from keystab.matching.common_range import CommonRange, common_scales, comparable


def common_range(views: Views, args: argparse.Namespace) -> CommonRange:
    """Field of view and range of scales that all views of a set have in common."""
    specs = views.specs
    scales = common_scales(specs, args.sigma_min, args.n_oct, args.first_scale, args.last_scale)
    return CommonRange(specs, views.reference_shape, max(args.guard, args.border), *scales)


def comparable_only(
    detections: pd.DataFrame,
    shape: tuple[int, int],
    args: argparse.Namespace,
    scale_column: str = "step_sigma",
) -> pd.DataFrame:
    """Select the detections that `keystab.matching.common_range.comparable` says are compared."""
    return detections[compared(args, shape)(detections, scale_column)]


def compared(
    args: argparse.Namespace, shape: tuple[int, int]
) -> Callable[[pd.DataFrame, str], NDArray[np.bool_]]:
    """Say which rows of a table, by the scale in one of its columns, are compared."""

    def inside(table: pd.DataFrame, scale_column: str) -> NDArray[np.bool_]:
        return comparable(
            table,
            shape,
            args.sigma_min,
            args.first_scale,
            args.border,
            scale_column,
            args.last_scale,
        )

    return inside


def tolerances(args: argparse.Namespace) -> dict[str, float]:
    """Collect how far apart a detection and a true extremum may be."""
    return {name: getattr(args, name) for name in ("space_tolerance", "scale_ratio")}


def same_options(args: argparse.Namespace) -> dict[str, Any]:
    """Collect the options of `keystab.matching.correspondence.same`."""
    return {**tolerances(args), "match_sign": args.match_sign}
