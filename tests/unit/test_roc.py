"""ROC curves and areas against counting pairs and against normal distributions."""

from statistics import NormalDist

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from keystab.errors import InputError
from keystab.evaluation.roc import area_under_curve, auc_interval, auc_table, roc, threshold_curve

VALUES = st.lists(st.integers(-3, 3).map(float) | st.just(np.inf), min_size=1, max_size=12)
DIRECTION = st.sampled_from([1, -1])


def test_perfect_feature_is_always_equal_to_one():
    """The paper's convention: sensitivity stays 1 until every unstable keypoint is removed."""
    curve = roc([5.0, 6.0, 7.0], [1.0, 2.0])
    assert (curve["sensitivity"][curve["specificity"] < 1] == 1).all()
    assert curve.loc[2, ["threshold", "specificity", "sensitivity"]].tolist() == [5.0, 1.0, 1.0]
    assert area_under_curve([5.0, 6.0, 7.0], [1.0, 2.0]) == 1
    assert area_under_curve([5.0, 6.0, 7.0], [1.0, 2.0], direction=-1) == 0


@settings(max_examples=150, deadline=None)
@given(VALUES, VALUES, DIRECTION)
def test_curve_is_what_a_filter_keeps_and_removes(stable, unstable, direction):
    curve = roc(stable, unstable, direction)
    for row in curve[:-1].itertuples():

        def keep(values, threshold=row.threshold):
            return [v >= threshold if direction == 1 else v <= threshold for v in values]

        assert row.sensitivity == pytest.approx(np.mean(keep(stable)), abs=1e-15)
        assert row.specificity == pytest.approx(1 - np.mean(keep(unstable)), abs=1e-15)
    assert curve.iloc[0, 1:].tolist() == [0, 1]
    assert curve.iloc[-1, 1:].tolist() == [1, 0]
    assert curve["specificity"].is_monotonic_increasing
    assert curve["sensitivity"].is_monotonic_decreasing


@settings(max_examples=150, deadline=None)
@given(VALUES, VALUES, DIRECTION)
def test_area_counts_pairs_and_is_the_area_under_the_curve(stable, unstable, direction):
    area = area_under_curve(stable, unstable, direction)
    pairs = [
        0.5 if s == u else float((s > u) == (direction == 1)) for s in stable for u in unstable
    ]
    assert area == pytest.approx(np.mean(pairs), abs=1e-14)
    curve = roc(stable, unstable, direction)
    assert area == pytest.approx(
        np.trapezoid(curve["sensitivity"], curve["specificity"]), abs=1e-14
    )
    assert area == pytest.approx(1 - area_under_curve(unstable, stable, direction), abs=1e-14)


def normal_groups(seed, distance, n_stable=120, n_unstable=60):
    generator = np.random.default_rng(seed)
    return generator.normal(distance, 1, n_stable), generator.normal(0, 1, n_unstable)


def test_area_of_two_normal_distributions():
    """Phi(distance / sqrt 2); with 20000 each the standard error is 0.0025."""
    expected = NormalDist().cdf(1 / 2**0.5)
    assert area_under_curve(*normal_groups(0, 1.0, 20_000, 20_000)) == pytest.approx(
        expected, abs=0.012
    )


def test_interval_covers_the_truth_about_as_often_as_it_says():
    truth = NormalDist().cdf(1 / 2**0.5)
    hits = 0
    for seed in range(100):
        low, high = auc_interval(*normal_groups(seed, 1.0), purpose=("test", seed), n_resamples=300)
        hits += low <= truth <= high
    assert 88 <= hits <= 99  # 95 expected, standard deviation 2.2


def test_interval_depends_on_purpose_only():
    stable, unstable = normal_groups(1, 0.5)
    interval = auc_interval(stable, unstable, purpose=("a",), n_resamples=200)
    assert auc_interval(stable[::-1], unstable[::-1], purpose=("a",), n_resamples=200) == interval
    assert auc_interval(stable, unstable, purpose=("b",), n_resamples=200) != interval
    assert interval[0] < area_under_curve(stable, unstable) < interval[1]


def test_empty_groups_give_no_area():
    assert np.isnan(area_under_curve([], [1.0]))
    assert np.isnan(auc_interval([1.0], [])).all()
    assert len(roc([], [1.0])) == 0
    curve = threshold_curve([1.0, 2.0], [])
    assert curve["stable_below"].tolist() == [0, 0.5]
    assert curve["unstable_below"].isna().all()


def test_table_of_areas():
    features = pd.DataFrame({"dog": [3.0, 2.0, 1.0, 9.0], "condition": [1.0, 2.0, 3.0, 9.0]})
    label = ["stable", "stable", "unstable", "between"]
    table = auc_table(features, label, {"dog": 1, "condition": -1}, ("test",), 50)
    assert table["feature"].tolist() == ["dog", "condition"]
    assert table["auc"].tolist() == [1, 1]
    assert table["n_stable"].tolist() == [2, 2] and table["n_unstable"].tolist() == [1, 1]
    assert table["direction"].tolist() == [1, -1]
    assert (table["low"] <= table["auc"]).all() and (table["auc"] <= table["high"]).all()


@settings(max_examples=50, deadline=None)
@given(VALUES, VALUES)
def test_threshold_curve_is_consistent_with_the_roc(stable, unstable):
    """Below the threshold: removed unstable ones, and the stable ones that are not kept."""
    curve = roc(stable, unstable)[:-1]
    below = threshold_curve(stable, unstable, curve["threshold"])
    np.testing.assert_allclose(below["unstable_below"], curve["specificity"], atol=1e-15)
    np.testing.assert_allclose(below["stable_below"], 1 - curve["sensitivity"], atol=1e-15)


@pytest.mark.parametrize(
    ("stable", "direction", "word"), [([1.0, np.nan], 1, "1 of 2 stable"), ([1.0], 0, "direction")]
)
def test_errors(stable, direction, word):
    with pytest.raises(InputError, match=word):
        roc(stable, [1.0], direction)
