"""Reading and selecting what several stages read and select."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from keystab.comparison import comparable
from keystab.errors import InputError
from keystab.seals import verify
from keystab.stores import attributes_of, open_views, view
from keystab.tables import read_table
from keystab.views import effective_blur


class View(NamedTuple):
    """One simulated view and the blur that it has."""

    image: NDArray[np.float64]
    blur: float

    @property
    def shape(self) -> tuple[int, int]:
        """Height and width in pixels."""
        height, width = self.image.shape
        return height, width


def read_view(store: Path, digest: Path, number: int = 0) -> View:
    """Read one view of a stored set, after checking the store against its seal."""
    verify(store, digest)
    views = open_views(store)
    blur, step = (float(views[name][number]) for name in ("blur", "step"))
    reference_blur = attributes_of(store)["reference_blur"]
    return View(view(views, number), effective_blur(blur, step, reference_blur))


def read_extrema(paths: Sequence[Path]) -> pd.DataFrame:
    """Read the extrema of several samplings as one table; ``row_in_file`` counts within each."""
    tables = [read_table(path) for path in paths]
    tables = [table.assign(row_in_file=np.arange(len(table))) for table in tables]
    return pd.concat(tables, ignore_index=True)


def read_keypoints(path: Path, columns: Sequence[str]) -> pd.DataFrame:
    """Read the table of unique keypoints, for what cannot be done without any.

    Raises
    ------
    InputError
        If there is none.
    """
    keypoints = read_table(path, columns)
    if keypoints.empty:
        raise InputError(
            f"{path} has no keypoints: no sampling finds an extremum in the compared range; give a "
            "picture with more detail, or widen comparison.first_scale, last_scale and border"
        )
    return keypoints


def comparable_only(
    detections: pd.DataFrame,
    shape: tuple[int, int],
    args: argparse.Namespace,
    scale_column: str = "step_sigma",
) -> pd.DataFrame:
    """Select the detections that `keystab.comparison.comparable` says are compared."""
    return detections[
        comparable(
            detections,
            shape,
            args.sigma_min,
            args.first_scale,
            args.border,
            scale_column,
            args.last_scale,
        )
    ]


def same_options(args: argparse.Namespace) -> dict[str, Any]:
    """Collect the options of `keystab.duplicates.same`."""
    return {name: getattr(args, name) for name in ("space_tolerance", "scale_ratio", "match_sign")}


def positions_of_matches(matches: pd.DataFrame, extrema: pd.DataFrame) -> NDArray[np.intp]:
    """Turn rows within files into row positions of `read_extrema`'s table.

    Parameters
    ----------
    matches : DataFrame
        ``keypoint, n_spo, row``, from `keystab.sampling_tables.long_matches`.
    extrema : DataFrame
        From `read_extrema`, of the same samplings in the same order.

    Returns
    -------
    ndarray of int, shape (n_keypoints, n_samplings)
        -1 where a keypoint is not detected.
    """
    if matches.empty:
        return np.empty((0, extrema["n_spo"].nunique()), dtype=np.intp)
    n_spo = matches["n_spo"].unique()
    first = np.searchsorted(extrema["n_spo"].to_numpy(), n_spo)  # extrema ascend in n_spo
    row = matches["row"].to_numpy().reshape(-1, len(n_spo))
    return np.where(row >= 0, row + first, -1)
