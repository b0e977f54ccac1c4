"""Reading and selecting what several stages read and select."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from keystab.camera.view_sets import common_scales
from keystab.camera.views import ViewSpec, effective_blur
from keystab.errors import InputError
from keystab.evaluation.recall_precision import judged, with_positions
from keystab.experiments.view_stability import CommonRange
from keystab.io.checksums import verify
from keystab.io.scale_space_store import StoredViews
from keystab.io.tables import read_table
from keystab.matching.common_range import comparable


class View(NamedTuple):
    """One simulated view and the blur that it has."""

    image: NDArray[np.float64]
    blur: float

    @property
    def shape(self) -> tuple[int, int]:
        """Height and width in pixels."""
        height, width = self.image.shape
        return height, width


def read_view(store: Path, digest: Path) -> View:
    """Read the first view of a stored set, after checking the store against its seal."""
    return read_views(store, digest)[0]


class Views:
    """The views of a stored set, each read when it is asked for.

    Parameters
    ----------
    store : path
        Store of the views, already checked.
    """

    def __init__(self, store: Path) -> None:
        self._views = StoredViews(store)

    def __len__(self) -> int:
        return len(self._views.columns["blur"])

    def __iter__(self) -> Iterator[View]:
        return (self[number] for number in range(len(self)))

    def __getitem__(self, number: int) -> View:
        blur, step = (float(self._views.columns[name][number]) for name in ("blur", "step"))
        own = effective_blur(blur, step, self._views.attributes["reference_blur"])
        return View(self._views[number], own)

    @property
    def reference_shape(self) -> tuple[int, int]:
        """Height and width of the reference in pixels."""
        height, width = self._views.attributes["reference_shape"]
        return height, width

    @property
    def specs(self) -> list[ViewSpec]:
        """How each view was taken."""
        numbers = {name: values.tolist() for name, values in self._views.columns.items()}
        return [
            ViewSpec(
                numbers["blur"][k],
                numbers["step"][k],
                (numbers["height"][k], numbers["width"][k]),
                (numbers["shift_y"][k], numbers["shift_x"][k]),
                numbers["rotation"][k],
                numbers["noise"][k],
                (str(self._views.attributes["set"]), k),
            )
            for k in range(len(self))
        ]


def read_views(store: Path, digest: Path) -> Views:
    """Open all views of a stored set, after checking the store against its seal."""
    verify(store, digest)
    return Views(store)


def common_range(views: Views, args: argparse.Namespace) -> CommonRange:
    """Field of view and range of scales that all views of a set have in common."""
    specs = views.specs
    scales = common_scales(specs, args.sigma_min, args.n_oct, args.first_scale, args.last_scale)
    return CommonRange(specs, views.reference_shape, max(args.guard, args.border), *scales)


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


def judged_in_octave(
    found: pd.DataFrame,
    truth: pd.DataFrame,
    shape: tuple[int, int],
    args: argparse.Namespace,
    scale_column: str,
) -> dict[str, Any]:
    """Hold detections against true extrema in the range that is compared."""
    inside = compared(args, shape)
    finite = with_positions(found)
    return judged(
        finite, truth, inside(finite, scale_column), inside(truth, "sigma"), **tolerances(args)
    )


def tolerances(args: argparse.Namespace) -> dict[str, float]:
    """Collect how far apart a detection and a true extremum may be."""
    return {name: getattr(args, name) for name in ("space_tolerance", "scale_ratio")}


def same_options(args: argparse.Namespace) -> dict[str, Any]:
    """Collect the options of `keystab.matching.correspondence.same`."""
    return {**tolerances(args), "match_sign": args.match_sign}


def positions_of_matches(matches: pd.DataFrame, extrema: pd.DataFrame) -> NDArray[np.intp]:
    """Turn rows within files into row positions of `read_extrema`'s table.

    Parameters
    ----------
    matches : DataFrame
        ``keypoint, n_spo, row``, from `keystab.experiments.sampling_stability.long_matches`.
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
