"""Shares, curves and rates on occurrence matrices that can be read off by eye."""

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from keystab.errors import InputError
from keystab.evaluation.intervals import table_counts, wilson_interval
from keystab.evaluation.stability import (
    keypoint_features,
    label,
    new_and_lost,
    stability,
    stability_curve,
)

SEEN = pd.DataFrame(
    [[1, 1, 1, 1, 1], [1, 1, 1, 1, 0], [0, 1, 1, 0, 0], [0, 0, 0, 0, 1]],
    columns=list("abcde"),
    index=[7, 3, 5, 9],
    dtype=bool,
)


def test_stability_is_the_share_of_sets():
    assert stability(SEEN).to_dict() == {7: 1.0, 3: 0.8, 5: 0.4, 9: 0.2}


@pytest.mark.parametrize("n_sets", [5, 10, 15, 20, 17])
def test_limits_of_the_labels_belong_to_neither(n_sets):
    """Exactly 80 % and exactly 20 % are between, for whatever number of sets."""
    count = np.arange(n_sets + 1)
    named = label(count / n_sets)
    assert (named[5 * count > 4 * n_sets] == "stable").all()
    assert (named[5 * count < n_sets] == "unstable").all()
    assert (named[(5 * count >= n_sets) & (5 * count <= 4 * n_sets)] == "between").all()


def test_label_refuses_limits_that_cross():
    with pytest.raises(InputError, match="unstable"):
        label([0.5], stable=0.2, unstable=0.8)


def test_curve_by_eye():
    curve = stability_curve(SEEN)
    assert curve["percentage_of_images"].tolist() == [20, 40, 60, 80, 100]
    assert curve["n_unique"].tolist() == [4, 3, 2, 2, 1]
    assert curve["percentage_of_unique"].tolist() == [100, 75, 50, 50, 25]
    assert curve["low"].isna().all()


def test_curve_steps_where_rounding_would_hide_it():
    """30 % of 10 images are 3, although 0.3 * 10 is computed as a little more or less than 3."""
    for n_sets in (10, 17, 32, 100):
        seen = np.tri(n_sets, dtype=bool)  # keypoint i is seen in i + 1 sets
        at = 100 * np.arange(1, n_sets + 1) / n_sets
        assert stability_curve(seen, at)["n_unique"].tolist() == list(range(n_sets, 0, -1))
    assert stability_curve(np.tri(10, dtype=bool), [30, 30.001, 0])["n_unique"].tolist() == [
        8,
        7,
        10,
    ]


@settings(max_examples=50, deadline=None)
@given(hnp.arrays(bool, st.tuples(st.integers(1, 20), st.integers(1, 9))))
def test_curve_falls_from_100_and_ignores_the_order(seen):
    curve = stability_curve(seen)
    if not seen.any():
        assert curve["percentage_of_unique"].isna().all()
        return
    assert curve["percentage_of_unique"].iloc[0] == 100
    assert curve["percentage_of_unique"].is_monotonic_decreasing
    pd.testing.assert_frame_equal(curve, stability_curve(seen[::-1, ::-1]))


def test_curve_interval_equals_curves_of_resampled_matrices():
    seen = np.random.default_rng(0).random((40, 8)) < np.linspace(0.1, 1, 40)[:, None]
    keypoints, sets = table_counts(seen.shape, 60, ("keypoints", "sets"), "curve", "test")
    samples = []
    for rows, columns in zip(keypoints, sets, strict=True):
        drawn = seen[np.repeat(np.arange(40), rows)][:, np.repeat(np.arange(8), columns)]
        samples.append(stability_curve(drawn)["percentage_of_unique"])
    curve = stability_curve(seen, n_resamples=60, purpose=("test",))
    moved = curve["percentage_of_unique"] - np.mean(samples, axis=0)
    low, high = np.clip(np.quantile(samples, [0.025, 0.975], axis=0) + moved.to_numpy(), 0, 100)
    np.testing.assert_allclose(curve["low"], low, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(curve["high"], high, rtol=1e-12)
    assert (curve["low"] < curve["percentage_of_unique"])[1:].all()


def test_curve_interval_covers_what_other_keypoints_and_views_would_give():
    """Keypoints of known probabilities, half of them almost sure; 95 % of the intervals cover."""
    rng = np.random.default_rng(3)

    def draw():
        sure = rng.random(300) < 0.5
        probability = np.where(sure, rng.beta(30, 0.6, 300), rng.beta(0.6, 1.0, 300))
        seen = rng.random((300, 16)) < probability[:, None]
        return seen[seen.any(axis=1)]

    truth = np.mean([stability_curve(draw())["percentage_of_unique"] for _ in range(500)], axis=0)
    covered = []
    for repetition in range(100):
        curve = stability_curve(draw(), n_resamples=100, purpose=(repetition,))
        covered.append((curve["low"] <= truth) & (truth <= curve["high"]))
    share = np.mean(covered, axis=0)
    # A hundred repetitions scatter by 2.2 %, and a hundred resamples make intervals a little short.
    assert share.min() > 0.87
    assert share[1:].mean() < 0.995


def test_curve_interval_over_keypoints_is_binomial():
    """One level and independent keypoints: the share of 300 has a known standard deviation."""
    seen = np.zeros((300, 2), dtype=bool)
    seen[:, 0] = True
    seen[:90, 1] = True
    at_all = stability_curve(seen, [100], 4000, ("test",), resample=("keypoints",))
    half = 100 * 1.96 * np.sqrt(0.3 * 0.7 / 300)
    # The quantiles of 4000 draws scatter by about 4 % of the half width; counts are whole.
    np.testing.assert_allclose(at_all["high"] - 30, half, rtol=0.12)
    np.testing.assert_allclose(30 - at_all["low"], half, rtol=0.12)


def test_curve_errors():
    with pytest.raises(InputError, match="0 to 100"):
        stability_curve(SEEN, [50, 101])


def test_rates_by_eye():
    """b keeps one of a's two and adds three (two of them near each other); c keeps all of b's."""
    table = pd.DataFrame(
        [("a", 0.0), ("a", 10.0), ("b", 0.4), ("b", 20.0), ("b", 20.5), ("b", 30.0)]
        + [("c", 0.0), ("c", 20.2), ("c", 30.0)],
        columns=["set", "y"],
    ).assign(x=0.0, sigma=1.1, sign=1)
    rates = new_and_lost(table).set_index("set")
    assert rates["n_detections"].tolist() == [2, 4, 3]
    assert rates["n_new"].isna().tolist() == [True, False, False]
    assert rates["n_new"][1:].tolist() == [3, 0]
    assert rates["n_lost"][:2].tolist() == [1, 0]
    assert rates["n_lost"].isna().tolist() == [False, False, True]
    assert rates["new_rate"][1:].tolist() == [0.75, 0.0]
    assert rates["lost_rate"][:2].tolist() == [0.5, 0.0]
    assert rates[["new_rate", "new_low", "new_high"]].loc["a"].isna().all()
    np.testing.assert_allclose(
        rates.loc["b", ["new_low", "new_high"]].tolist(), wilson_interval(3, 4)
    )
    np.testing.assert_allclose(
        rates.loc["a", ["lost_low", "lost_high"]].tolist(), wilson_interval(1, 2)
    )


def test_rates_backwards_exchange_new_and_lost():
    generator = np.random.default_rng(5)
    table = pd.DataFrame({"y": generator.uniform(0, 20, 90), "x": generator.uniform(0, 20, 90)})
    table = table.assign(sigma=1.1, set=generator.integers(0, 4, 90))
    forward = new_and_lost(table).set_index("set")
    backward = new_and_lost(table, sets=[3, 2, 1, 0]).set_index("set").loc[forward.index]
    assert forward["n_new"].fillna(-1).tolist() == backward["n_lost"].fillna(-1).tolist()
    assert (forward["n_new"][1:] > 0).all()


def test_rates_with_an_empty_set():
    table = pd.DataFrame({"y": [0.0, 0.0], "x": 0.0, "sigma": 1.1, "set": [1, 3]})
    rates = new_and_lost(table, sets=[1, 2, 3])
    assert rates["n_lost"].tolist()[:2] == [1, 0]
    assert rates["n_new"].tolist()[1:] == [0, 1]
    assert rates["new_rate"].isna().tolist() == [True, True, False]


def test_feature_of_a_keypoint_is_the_median_of_its_detections():
    features = pd.DataFrame({"dog": [1.0, 5.0, 3.0, 8.0], "condition": [1.0, np.inf, 2.0, 4.0]})
    found = np.array([[0, 1, 2], [-1, 3, -1], [-1, -1, -1]])
    medians = keypoint_features(features, found)
    np.testing.assert_array_equal(medians["dog"], [3.0, 8.0, np.nan])
    np.testing.assert_array_equal(medians["condition"], [2.0, 4.0, np.nan])
