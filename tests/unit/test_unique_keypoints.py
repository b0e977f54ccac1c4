"""Unique sets against enumeration, and the rules that make them and their matches canonical."""

import itertools
import math

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from keystab.errors import InputError
from keystab.matching.unique_keypoints import (
    gather,
    matches,
    minimum_unique_set,
    occurrence,
    unique_keypoints,
)

COLUMNS = ["y", "x", "sigma", "sign", "set"]


def is_same(a, b, match_sign):
    return (
        max(abs(a["y"] - b["y"]), abs(a["x"] - b["x"])) <= 1
        and abs(math.log2(a["sigma"] / b["sigma"])) <= 0.5 + 1e-12
        and (not match_sign or a["sign"] == b["sign"])
    )


def unique_by_enumeration(table, match_sign, reverse):
    """The definition, tried out: smallest subsets first, preferred ones first among them."""
    rows = table.to_dict("records")
    duplicates = [{j for j, b in enumerate(rows) if is_same(a, b, match_sign)} for a in rows]

    def preference(i):
        sets = {rows[j]["set"] for j in duplicates[i]}
        return (-len(sets), *(rows[i][name] for name in COLUMNS))

    order = sorted(range(len(rows)), key=preference, reverse=reverse)
    for size in range(len(rows) + 1):
        for subset in itertools.combinations(order, size):
            if set().union(*(duplicates[i] for i in subset)) == set(range(len(rows))):
                return {tuple(rows[i][name] for name in COLUMNS) for i in subset}
    raise AssertionError("all rows together cover everything")


# Few distinct values, so that ties, exact limits and chains are common.
DETECTION = st.tuples(
    st.integers(0, 8).map(lambda v: v / 2),
    st.integers(0, 3).map(lambda v: v / 2),
    st.integers(0, 3).map(lambda v: 2 ** (v / 4)),
    st.sampled_from([-1, 1]),
    st.integers(0, 3),
)


@settings(max_examples=250, deadline=None)
@given(st.lists(DETECTION, min_size=1, max_size=11), st.booleans(), st.booleans())
def test_unique_set_equals_enumeration(rows, match_sign, reverse):
    table = pd.DataFrame(rows, columns=COLUMNS)
    unique = minimum_unique_set(table, match_sign=match_sign, reverse_order=reverse)
    found = set(unique.keypoints[COLUMNS].itertuples(index=False, name=None))
    assert found == unique_by_enumeration(table, match_sign, reverse)
    assert len(unique.keypoints) == len(found)
    assert unique.gap == 0
    assert unique.canonical


@settings(max_examples=60, deadline=None)
@given(st.lists(DETECTION, min_size=1, max_size=40), st.randoms(use_true_random=False))
def test_unique_set_does_not_depend_on_the_order_of_rows(rows, random):
    table = pd.DataFrame(rows, columns=COLUMNS)
    shuffled = table.sample(frac=1, random_state=random.randrange(2**32))
    pd.testing.assert_frame_equal(
        unique_keypoints(table).reset_index(drop=True),
        unique_keypoints(shuffled).reset_index(drop=True),
    )


@pytest.mark.parametrize("n", [1, 2, 3, 4, 5, 6, 7, 30, 91, 200])
def test_chain(n):
    """Detections 0.9 px apart form a path, whose domination number is ceil(n / 3)."""
    table = pd.DataFrame({"y": 0.9 * np.arange(n), "x": 0.0, "sigma": 1.1, "set": 0})
    unique = minimum_unique_set(table)
    assert len(unique.keypoints) == -(-n // 3)
    assert unique.gap == 0
    assert unique.n_components == 1
    assert unique.largest_component == n
    assert occurrence(unique.keypoints, table).to_numpy().all()


def test_unique_rows_keep_index_columns_and_dtypes():
    table = pd.DataFrame(
        {"y": [9.0, 0.0, 0.3], "x": 0.0, "sigma": 1.1, "set": ["b", "a", "b"], "extra": [1, 2, 3]},
        index=[10, 20, 30],
    )
    unique = unique_keypoints(table)
    assert unique.index.tolist() == [20, 10]  # sorted by y
    pd.testing.assert_frame_equal(unique, table.loc[[20, 10]])


def test_detections_seen_with_more_sets_are_preferred():
    """On a path of four, {0, 2} and {1, 2} are minimum; only 0 sees a single set."""
    table = pd.DataFrame({"y": 0.9 * np.arange(4), "x": 0.0, "sigma": 1.1, "set": list("ppqp")})
    assert unique_keypoints(table).index.tolist() == [1, 2]
    assert unique_keypoints(table, set_column=None).index.tolist() == [0, 2]


def test_reversed_order_takes_the_other_end_of_a_tie():
    table = pd.DataFrame({"y": [0.0, 0.5], "x": 0.0, "sigma": 1.1, "set": 0})
    assert unique_keypoints(table).index.tolist() == [0]
    assert unique_keypoints(table, reverse_order=True).index.tolist() == [1]


def test_past_the_size_limit_the_gap_is_reported():
    generator = np.random.default_rng(0)
    table = pd.DataFrame(
        {
            "y": generator.uniform(0, 9, 120),
            "x": generator.uniform(0, 9, 120),
            "sigma": 1.1,
            "set": 0,
        }
    )
    exact, greedy = minimum_unique_set(table), minimum_unique_set(table, size_limit=20)
    assert exact.gap == 0
    assert not greedy.canonical
    n_greedy = len(greedy.keypoints)
    assert n_greedy - greedy.gap <= len(exact.keypoints) <= n_greedy
    assert occurrence(greedy.keypoints, table).to_numpy().all()
    assert (matches(table, greedy.keypoints, set_column=None) >= 0).all()  # everything is covered


def test_nothing_detected():
    table = pd.DataFrame({name: [] for name in COLUMNS}, dtype=float)
    unique = minimum_unique_set(table)
    assert len(unique.keypoints) == 0
    assert unique.gap == 0
    assert matches(unique.keypoints, table, sets=[0, 1]).shape == (0, 2)


def test_matches_equal_search_by_hand():
    generator = np.random.default_rng(3)
    n = 300
    table = pd.DataFrame(
        {
            "y": generator.uniform(0, 12, n),
            "x": generator.uniform(0, 12, n),
            "sigma": 1.1 * 2 ** generator.uniform(0, 1, n),
            "sign": generator.choice([-1, 1], n),
            "set": generator.integers(0, 5, n),
        }
    )
    unique = unique_keypoints(table)
    found = matches(unique, table)
    several = 0
    for i, keypoint in enumerate(unique.to_dict("records")):
        for k in range(5):
            near = [
                (
                    (row["y"] - keypoint["y"]) ** 2
                    + (row["x"] - keypoint["x"]) ** 2
                    + (2 * math.log2(row["sigma"] / keypoint["sigma"])) ** 2,
                    j,
                )
                for j, row in enumerate(table.to_dict("records"))
                if row["set"] == k and is_same(keypoint, row, match_sign=False)
            ]
            several += len(near) > 1
            assert found[i, k] == (min(near)[1] if near else -1)
    assert several > 50
    assert (found[np.arange(len(unique)), unique["set"]] == unique.index).all()  # itself is nearest


def test_equally_near_detections_are_told_apart_by_position():
    unique = pd.DataFrame({"y": [0.0], "x": [0.0], "sigma": [1.0]})
    table = pd.DataFrame({"y": [0.5, -0.5], "x": 0.0, "sigma": 1.0, "set": 0})
    assert matches(unique, table).tolist() == [[1]]
    assert matches(unique, table[::-1]).tolist() == [[0]]


def test_sets_without_detections_need_to_be_named():
    table = pd.DataFrame({"y": [0.0, 5.0], "x": 0.0, "sigma": 1.1, "set": ["a", "c"]})
    seen = occurrence(unique_keypoints(table), table, sets=["c", "b", "a"])
    assert seen.columns.tolist() == ["c", "b", "a"]
    assert seen.to_numpy().tolist() == [[False, False, True], [True, False, False]]
    assert occurrence(unique_keypoints(table), table).columns.tolist() == ["a", "c"]


@pytest.mark.parametrize(
    ("keywords", "word"),
    [
        ({"sets": ["a"]}, "'c'"),
        ({"sets": ["a", "c", "a"]}, "more than once"),
        ({"set_column": "view"}, "'view'"),
    ],
)
def test_errors_about_sets(keywords, word):
    table = pd.DataFrame({"y": [0.0, 5.0], "x": 0.0, "sigma": 1.1, "set": ["a", "c"]})
    with pytest.raises(InputError, match=word):
        matches(table, table, **keywords)


def test_gather_marks_what_is_missing():
    gathered = gather([1.5, 2.5], np.array([[0, -1], [-1, 1]]))
    np.testing.assert_array_equal(gathered, [[1.5, np.nan], [np.nan, 2.5]])


def test_what_is_no_number_or_has_no_order_gets_one_line():
    table = pd.DataFrame({"y": 0.0, "x": [0.0, 5.0], "sigma": 1.1, "set": ["a", "b"]})
    for change, words in (
        ({"y": ["top", "low"]}, "column 'y' holds text"),
        ({"set": [1, "a"]}, "column 'set' names sets by values that have no common order"),
    ):
        wrong = table.assign(**change)
        for compute in (unique_keypoints, lambda bad: occurrence(table, bad)):
            with pytest.raises(InputError) as raised:
                compute(wrong)
            assert words in str(raised.value) and "\n" not in str(raised.value)
    with pytest.raises(InputError, match="space_tolerance is 'wide'"):
        unique_keypoints(table, space_tolerance="wide")
    with pytest.raises(InputError, match="scale_ratio is None"):
        occurrence(table, table, scale_ratio=None)


@pytest.mark.parametrize("name", ["y", "x", "sigma", "sign"])
def test_each_coordinate_decides_among_equally_near_detections(name):
    # They differ in one coordinate alone: the lower one goes first, in any order of rows.
    unique = pd.DataFrame({"y": [0.0], "x": [0.0], "sigma": [1.0], "sign": [0]})
    pair = {"y": [0.0, 0.0], "x": [0.0, 0.0], "sigma": [1.0, 1.0], "sign": [1, 1], "set": 0}
    if name == "sigma":  # both as far away as y says
        pair |= {"y": [0.5, 0.5], "sigma": [1.01, 1.0]}
    else:
        pair[name] = [1, -1]
    table = pd.DataFrame(pair)
    assert matches(unique, table).tolist() == [[1]]
    assert matches(unique, table[::-1]).tolist() == [[0]]


def test_a_set_that_is_not_named_is_refused_wherever_its_row_stands():
    for sets in (["a", "b", "a"], ["b", "a", "a"], ["a", "a", "b"]):
        table = pd.DataFrame({"y": [0.0, 5.0, 9.0], "x": 0.0, "sigma": 1.1, "set": sets})
        with pytest.raises(InputError, match="holds 'b', which is none of the sets given"):
            matches(table, table, sets=["a"])
