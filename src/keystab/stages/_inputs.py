"""Tables that several stages read."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from keystab.errors import InputError
from keystab.io.tables import read_table


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
