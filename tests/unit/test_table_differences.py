"""Tables agree with themselves, up to rounding where that is allowed, and with nothing else."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from keystab.io.tables import write_table
from keystab.provenance.table_differences import ATOL, RTOL, difference, file_difference

TABLE = pd.DataFrame(
    {
        "n_spo": [3, 4, 5],
        "auc": [0.5, np.nan, -2e6],
        "name": ["a", None, "c"],
        "stable": [True, False, True],
    }
)
NUMBERS = st.floats(allow_nan=True, allow_infinity=True)


@given(st.lists(NUMBERS, min_size=1, max_size=5))
def test_a_table_agrees_with_itself(numbers):
    table = pd.DataFrame({"x": numbers})
    told = difference(table, table.copy(), rtol=0.0, atol=0.0)
    assert told.within and told.words == ""


@given(st.floats(-1e100, 1e100), st.floats(-3, 3))
def test_numbers_agree_within_the_tolerances_and_not_beyond(number, share):
    allowed = ATOL + RTOL * abs(number)
    other = number + share * allowed
    told = difference(pd.DataFrame({"x": [number]}), pd.DataFrame({"x": [other]}))
    # Rounding of the sum itself may decide on the edge.
    if abs(abs(other - number) - allowed) > 1e-12 * (abs(number) + allowed):
        assert told.within == (abs(other - number) <= allowed)
    assert (told.words == "") == (other == number)


@pytest.mark.parametrize(
    ("column", "row", "value", "words"),
    [
        ("n_spo", 1, 7, "n_spo differs in 1 of 3 rows, most in row 2, by 3 (75%): 4 became 7"),
        ("auc", 0, 0.6, "auc differs in 1 of 3 rows, most in row 1, by 0.1 (20%): 0.5 became 0.6"),
        ("auc", 0, np.nan, "auc differs in 1 of 3 rows, most in row 1: 0.5 became nan"),
        ("auc", 1, 0.5, "auc differs in 1 of 3 rows, most in row 2: nan became 0.5"),
        ("auc", 2, np.inf, "auc differs in 1 of 3 rows, most in row 3: -2000000.0 became inf"),
        ("name", 0, "b", "name differs in 1 of 3 rows, most in row 1: a became b"),
        ("name", 1, "None", "name differs in 1 of 3 rows, most in row 2: nan became None"),
        ("stable", 0, False, "stable differs in 1 of 3 rows, most in row 1: True became False"),
    ],
)
def test_one_changed_value_is_named_with_its_size(column, row, value, words):
    other = TABLE.copy()
    other.loc[row, column] = value
    told = difference(TABLE, other)
    assert (told.words, told.within) == (words, False)


def test_the_worst_column_is_told():
    other = TABLE.assign(n_spo=[3, 4, 6], auc=TABLE["auc"] * (1 + 1e-9))
    assert difference(TABLE, other).words.startswith("n_spo differs in 1 of 3")
    mild = difference(TABLE, TABLE.assign(auc=TABLE["auc"] * (1 + 1e-9)))
    assert mild.within and "auc differs in 2 of 3 rows" in mild.words
    assert not difference(
        TABLE, TABLE.assign(auc=TABLE["auc"] * (1 + 1e-9)), rtol=1e-12, atol=0.0
    ).within


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda table: table.drop(columns="auc"), "lacks auc"),
        (lambda table: table.assign(more=1), "has also more"),
        (lambda table: table.rename(columns={"auc": "area"}), "lacks auc and has also area"),
        (
            lambda table: table[["auc", "n_spo", "name", "stable"]],
            "has its columns in another order",
        ),
        (lambda table: table.iloc[:2], "has 2 rows instead of 3"),
    ],
)
def test_other_shapes_are_told(change, words):
    told = difference(TABLE, change(TABLE))
    assert (told.words, told.within) == (words, False)


@pytest.mark.parametrize("suffix", ["csv", "parquet"])
def test_files_are_compared_by_their_numbers(tmp_path, suffix):
    write_table(TABLE, tmp_path / f"one.{suffix}")
    write_table(TABLE.assign(auc=TABLE["auc"] + 1e-12), tmp_path / f"two.{suffix}")
    told = file_difference(tmp_path / f"one.{suffix}", tmp_path / f"two.{suffix}")
    assert told.within and told.words.startswith("auc differs")
