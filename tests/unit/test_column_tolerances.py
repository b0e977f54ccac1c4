"""What tables of two machines may differ by is said of every column, and small forgeries exceed it."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from keystab.io.tables import read_table
from keystab.provenance.table_differences import difference
from keystab.study.claims import read_claims, table_names
from keystab.study.column_tolerances import COLUMNS, NOTHING, allowed_in

ROOT = Path(__file__).parents[2]
TABLES = sorted(ROOT.glob("results/reference/tables/*.csv"))
FLOATS = [
    (path, column)
    for path in TABLES
    for column, values in read_table(path).items()
    if values.dtype.kind == "f"
]


def test_every_column_of_numbers_is_named():
    assert len(TABLES) > 50
    unnamed = [
        f"{path.name}: {column}"
        for path, column in FLOATS
        if column not in allowed_in(path.stem, [column])
    ]
    assert unnamed == []


def test_no_line_names_nothing():
    wanted = {f"{name}.csv" for name in table_names(read_claims(ROOT / "config/claims.yaml"))}
    if not wanted <= {path.name for path in TABLES}:
        pytest.skip("results/reference lacks tables of claims that are new: run make reference")
    # Tables that are no CSV lie in no reference: of pixels, cubes and single detections.
    names = {(path.stem, column) for path, column in FLOATS}
    for tables, columns, _ in COLUMNS:
        if not re.search("pixels|cubes|detections", tables):
            own = re.compile("|".join(columns.split()))
            assert any(re.fullmatch(tables, a) and own.fullmatch(b) for a, b in names), columns


def test_nothing_is_allowed_that_is_not_said():
    assert allowed_in("fig1", ["method", "n_passes", "new"]) == {}
    assert allowed_in("no_such_table", ["y"]) == {}
    assert NOTHING == (0.0, 0.0)


@pytest.mark.parametrize("path", TABLES, ids=[path.stem for path in TABLES])
def test_a_forgery_in_the_sixth_digit_or_by_one_is_found_in_any_column(path):
    table = read_table(path).head(300)
    allowed = allowed_in(path.stem, table.columns)
    assert difference(table, table.copy(), allowed).words == ""
    for column, values in table.items():
        if values.dtype.kind not in "if" or not np.isfinite(values).any():
            continue
        forged = table.copy()
        # Of what is not zero but for rounding, the median.
        size = values.abs().replace([0.0, np.inf], np.nan)
        row = int((size - size[size > 1e-12].median()).abs().argmin()) if size.notna().any() else 0
        old = values.iloc[row]
        new = old + 1 if values.dtype.kind == "i" else old * (1 + 1e-6)
        if values.dtype.kind == "f" and abs(old) < 1e-12:
            new = old + 1e-9
        # Places of keypoints and deviations of them are known to 1e-8 pixels and more.
        if abs(new - old) < 2 * allowed.get(column, NOTHING).absolute:
            new = old + 2 * allowed[column].absolute
        forged[column] = values.where(np.arange(len(values)) != row, new)
        told = difference(table, forged, allowed)
        assert not told.within and told.words.startswith(f"{column} differs in 1 of"), column
