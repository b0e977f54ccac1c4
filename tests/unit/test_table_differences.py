"""Tables agree with themselves, up to rounding where that is allowed, and with nothing else."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from keystab.io.tables import write_table
from keystab.provenance.table_differences import Allowed, difference, file_difference

TABLE = pd.DataFrame(
    {
        "n_spo": [3, 4, 5],
        "auc": [0.5, np.nan, -2e6],
        "name": ["a", None, "c"],
        "stable": [True, False, True],
    }
)
NUMBERS = st.floats(allow_nan=True, allow_infinity=True)
ALLOWED = Allowed(relative=1e-6, absolute=1e-9)
AUC = {"auc": ALLOWED}


@given(st.lists(NUMBERS, min_size=1, max_size=5))
def test_a_table_agrees_with_itself(numbers):
    table = pd.DataFrame({"x": numbers})
    told = difference(table, table.copy())
    assert told.within and told.words == ""


@given(st.floats(-1e100, 1e100), st.floats(-3, 3))
def test_numbers_agree_within_the_tolerances_and_not_beyond(number, share):
    allowed = ALLOWED.absolute + ALLOWED.relative * abs(number)
    other = number + share * allowed
    told = difference(pd.DataFrame({"x": [number]}), pd.DataFrame({"x": [other]}), ALLOWED)
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
    told = difference(TABLE, other, AUC)
    assert (told.words, told.within) == (words, False)


def test_the_worst_column_is_told():
    near = TABLE.assign(auc=TABLE["auc"] * (1 + 1e-9))
    other = near.assign(n_spo=[3, 4, 6])
    assert difference(TABLE, other, AUC).words.startswith("n_spo differs in 1 of 3")
    mild = difference(TABLE, near, AUC)
    assert mild.within and "auc differs in 2 of 3 rows" in mild.words
    assert not difference(TABLE, near, {"auc": Allowed(relative=1e-12)}).within
    assert not difference(TABLE, near).within  # nothing is allowed to what is not named
    # Whole numbers and texts agree with themselves alone, whatever is allowed.
    assert not difference(TABLE, TABLE.assign(n_spo=[3, 4, 6]), Allowed(absolute=9.0)).within


COUNTS = pd.DataFrame(
    {"n_spo": [3, 4, 5], "n_common": [90, 95, 99], "n_new": [np.nan, 4, 5], "rate": [0, 0.04, 0.05]}
)
KEYPOINTS = pd.DataFrame(
    {"keypoint": [0, 1, 2, 3], "y": [1.5, 2.5, 7.25, 8.0], "x": [4.0, 9.0, 1.0, 3.0],
     "sigma": [1.2, 1.3, 1.4, 1.5], "stability": [0.5, 1.0, 1.0, 0.25]}
)  # fmt: skip


def test_a_count_that_differs_by_one_is_one_keypoint():
    other = COUNTS.assign(n_common=[90, 96, 99], rate=[0, 0.0417, 0.05])
    told = difference(COUNTS, other, {"rate": ALLOWED})
    assert not told.within
    assert told.words == (
        "n_common differs in 1 of 3 rows, most in row 2 (n_spo 4), by 1 (1%): 95 became 96; one "
        "keypoint more"
    )
    lost = difference(COUNTS, COUNTS.assign(n_new=[np.nan, 4, 4], rate=[0, 0.04, 0.04]))
    assert "row 3 (n_spo 5), by 1 (20%): 5.0 became 4.0; one keypoint less" in lost.words
    two = difference(COUNTS, COUNTS.assign(n_common=[91, 95, 98]))
    assert two.words.endswith("one keypoint in each of 2 rows")
    many = difference(COUNTS, COUNTS.assign(n_common=[90, 97, 99]))
    assert "keypoint" not in many.words and "95 became 97" in many.words
    assert "keypoint" not in difference(COUNTS, COUNTS.assign(n_spo=[3, 4, 6])).words


@pytest.mark.parametrize("row", range(4))
def test_a_keypoint_that_one_table_lacks_is_told_by_its_place(row):
    short = KEYPOINTS.drop(index=row)
    short = short.assign(keypoint=range(3), y=short["y"] + 1e-12).reset_index(drop=True)
    place = KEYPOINTS.iloc[row]
    where = f"row {row + 1} (y {place.y:g}, x {place.x:g}, sigma {place.sigma:g}); the others agree"
    for one, other, words in ((KEYPOINTS, short, "less"), (short, KEYPOINTS, "more")):
        told = difference(one, other, {"y": ALLOWED})
        rows = f"has {len(other)} rows instead of {len(one)}"
        assert (told.within, told.words) == (False, f"{rows}: one keypoint {words}, {where}")
    moved = difference(KEYPOINTS, short.assign(stability=0.75), {"y": ALLOWED})
    assert moved.words == "has 3 rows instead of 4: one keypoint less"


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
    one, two = tmp_path / f"one.{suffix}", tmp_path / f"two.{suffix}"
    assert file_difference(one, two, ALLOWED).words.startswith("auc differs")
    assert file_difference(one, two, ALLOWED).within
    # What is said of columns of this name holds in a table of any; 1e-12 is too much for shares.
    assert not file_difference(one, two).within
