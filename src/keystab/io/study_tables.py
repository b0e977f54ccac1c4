"""Tables that several stages read and write."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from keystab.errors import InputError
from keystab.io.tables import read_table, write_table


def read_extrema(paths: Sequence[Path]) -> pd.DataFrame:
    """Read the extrema of several samplings as one table; ``row_in_file`` counts within each."""
    tables = [read_table(path) for path in paths]
    tables = [table.assign(row_in_file=np.arange(len(table))) for table in tables]
    return pd.concat(tables, ignore_index=True)


def write_joined(tables: Sequence[pd.DataFrame], path: Path) -> pd.DataFrame:
    """Write tables below each other as one, and return it."""
    joined = pd.concat(tables, ignore_index=True)
    write_table(joined, path)
    return joined


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
