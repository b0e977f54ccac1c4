"""A run of another machine is held against the reference by what is said beside each column."""

from __future__ import annotations

from pathlib import Path

import pandas as pd
import pytest

from keystab.io.tables import read_table, write_table
from keystab.provenance.result_checks import Check
from keystab.provenance.run_comparison import compare_tables

REFERENCE = Path(__file__).parents[2] / "results/reference"
LOCK = 64 * "0"


def compared(folder: Path, name: str, change) -> Check:
    """The reference against a run that changed one of its tables, on another machine."""
    table = read_table(REFERENCE / f"tables/{name}.csv")
    (folder / "tables").mkdir(exist_ok=True)
    write_table(change(table), folder / f"tables/{name}.csv")
    return compare_tables(REFERENCE, folder, LOCK, [f"{name}.csv"], machine="another")


def shifted(column: str, by: float, row: int | None = None):
    def change(table: pd.DataFrame) -> pd.DataFrame:
        rows = slice(None) if row is None else [row]
        table.loc[table.index[rows], column] += by
        return table

    return change


@pytest.mark.parametrize(
    ("name", "column", "honest", "forged"),
    [
        ("fig1", "residual", 1e-15, 9e-10),
        ("figS4", "error", 1e-12, 2.7e-8),
        ("figS3", "c", 1e-13, 1e-9),
        ("fig5_features", "difference", 1e-14, 1e-9),
        ("fig9_keypoints", "y", 1e-9, 1e-5),
        ("fig7_precision", "mean", 1e-11, 1e-6),
        ("truth_samplings", "recall", 1e-16, 1e-6),
        ("predictors_auc", "auc", 1e-15, 1e-6),
    ],
)
def test_rounding_is_noted_and_more_than_that_is_a_problem(name, column, honest, forged, tmp_path):
    check = compared(tmp_path, name, shifted(column, honest))
    assert check.problems == [] and check.notes[0].startswith(f"{name}.csv: {column} differs in")
    check = compared(tmp_path, name, shifted(column, forged))
    assert len(check.problems) == 1 and f"{name}.csv: {column} differs in" in check.problems[0]


def test_a_keypoint_that_flips_is_one_and_comes_first(tmp_path):
    (tmp_path / "tables").mkdir()
    for name in ("fig3", "fig4_counts"):
        table = read_table(REFERENCE / f"tables/{name}.csv")
        # The median moves with the keypoint that comes or goes.
        column, by = ("median_condition", 0.1) if name == "fig3" else ("n_common", 1)
        write_table(shifted(column, by, 2)(table), tmp_path / f"tables/{name}.csv")
    check = compare_tables(
        REFERENCE, tmp_path, LOCK, ["fig3.csv", "fig4_counts.csv"], machine="another"
    )
    assert len(check.problems) == 2
    assert check.problems[0].startswith("fig4_counts.csv: n_common differs in 1 of 17 rows")
    assert "(n_spo 5" in check.problems[0] and check.problems[0].endswith("; one keypoint more")
    assert "rounding may decide over a single keypoint" in check.notes[-1]
    assert "by as much as is said beside each column" in check.words
