"""Detections against true extrema: what is known on paper, and on a picture of known extrema."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scenes import blobs

from keystab.detection.detector import detect_keypoints, extrema_table
from keystab.detection.extrema import discrete_extrema
from keystab.detection.refinement import MOST_MODELS, trace
from keystab.evaluation.recall_precision import (
    causes,
    mean_over_views,
    partners,
    recall_and_precision,
)
from keystab.experiments.refinement_choices import kept_and_lost
from keystab.scalespace.dog import scale_space
from keystab.truth.true_extrema import true_extrema


def points(seed: int, n: int) -> pd.DataFrame:
    rng = np.random.default_rng(seed)
    return pd.DataFrame(
        {
            "y": rng.uniform(0, 12, n),
            "x": rng.uniform(0, 12, n),
            "sigma": rng.uniform(1.1, 2.2, n),
            "sign": rng.choice([-1, 1], n),
            "conditioning": rng.uniform(0.05, 1.0, n),
        }
    )


def everything(table: pd.DataFrame) -> np.ndarray:
    return np.ones(len(table), dtype=bool)


@settings(deadline=None)  # the first call imports scipy
@given(st.integers(0, 10**6), st.integers(0, 40), st.integers(0, 40))
def test_partners_are_one_to_one_near_and_of_one_sign(seed, n, m):
    found, truth = points(seed, n), points(seed + 1, m)
    partner = partners(found, truth)
    paired = np.flatnonzero(partner >= 0)
    assert len(set(partner[paired])) == len(paired)
    here, there = found.iloc[paired], truth.iloc[partner[paired]]
    assert (here["sign"].to_numpy() == there["sign"].to_numpy()).all()
    for axis in "yx":
        assert (np.abs(here[axis].to_numpy() - there[axis].to_numpy()) <= 1 + 1e-6).all()
    ratio = np.abs(np.log2(here["sigma"].to_numpy() / there["sigma"].to_numpy()))
    assert (ratio <= 0.5 + 1e-6).all()


@settings(deadline=None)
@given(st.integers(0, 10**6), st.integers(1, 40))
def test_the_truth_itself_is_right_and_complete(seed, n):
    truth = points(seed, n)
    result = recall_and_precision(truth, truth, everything(truth), everything(truth))
    assert result["recall"] == result["precision"] == 1.0
    assert result["n_true"] == result["n_found"] == result["n_right"] == n
    assert result["median_location"] == result["p90_scale"] == 0.0 and result["n_twin"] == 0


def test_errors_are_those_that_were_made():
    truth = pd.DataFrame({"y": [5.0, 20.0], "x": [5.0, 20.0], "sigma": [1.5, 1.8], "sign": [1, -1]})
    found = truth.assign(y=truth["y"] + 0.3, x=truth["x"] - 0.4, sigma=truth["sigma"] * 2**0.25)
    result = recall_and_precision(found, truth, everything(found), everything(truth))
    assert result["median_location"] == pytest.approx(0.5)
    assert result["median_scale"] == pytest.approx(0.25)
    assert (
        recall_and_precision(found.assign(sign=0), truth, everything(found), everything(truth))[
            "recall"
        ]
        == 0
    )


def test_nothing_at_all_is_neither_right_nor_wrong():
    none, some = points(0, 0), points(0, 3)
    result = recall_and_precision(none, some, everything(none), everything(some))
    assert result["recall"] == 0.0 and np.isnan(result["precision"])
    assert np.isnan(result["median_location"])


def test_what_lies_beyond_the_range_serves_as_partner_but_is_not_counted():
    truth = pd.DataFrame({"y": [5.0], "x": [5.0], "sigma": [2.3], "sign": [1]})
    found = truth.assign(sigma=2.1)
    result = recall_and_precision(found, truth, everything(found), np.array([False]))
    assert result["precision"] == 1.0 and result["n_true"] == 0 and np.isnan(result["recall"])


@settings(max_examples=3, deadline=None)
@given(st.integers(0, 1000))
def test_a_fine_sampling_finds_the_true_extrema_of_blobs(seed):
    image = blobs((40, 44), seed)
    truth = true_extrema(image, 1.1, 1.1, 2.6)
    found = detect_keypoints(image, 1.1, n_spo=15)

    def inside(table):
        place = table[["y", "x"]].to_numpy()
        middle = ((place > 4) & (place < [35, 39])).all(axis=1)
        return middle & table["sigma"].between(1.4, 2.2).to_numpy()

    sure = inside(truth) & (truth["conditioning"] > 0.1).to_numpy()
    assume(sure.sum() > 2)  # a picture with little in its middle proves little
    result = recall_and_precision(found, truth, inside(found), sure)
    assert result["recall"] == 1.0 and result["n_true"] > 2
    assert result["median_location"] < 0.01


def test_what_is_kept_and_what_is_lost_adds_up():
    image = blobs((40, 44), 1)
    truth, space = true_extrema(image, 1.1, 1.1, 2.6), scale_space(image, 1.1, 5)
    extrema = extrema_table(space, discrete_extrema(space))

    def inside(table, _scale):
        return everything(table)

    paths = trace(space, extrema, 0.5)
    results = [
        kept_and_lost(extrema, paths, space.sampling, truth, inside, max_offset, n)
        for max_offset, n in ((0.5, 1), (0.6, 2), (np.inf, MOST_MODELS))
    ]
    for result in results:
        parts = ("kept_true", "lost_true", "kept_false", "lost_false")
        assert sum(result[part] for part in parts) == len(extrema)
        assert result["moved_wrong"] <= result["kept_true"]
    assert results[0]["lost_true"] >= results[1]["lost_true"] >= results[2]["lost_true"] == 0


def test_means_over_views_count_views_without_detections():
    truth = points(3, 5)
    seen = truth.assign(view=0)
    result = mean_over_views(seen, truth, 2, (1.0, 3.0))
    assert result["n_views"] == 2 and result["recall"] == 0.5
    assert result["recall_low"] < 0.5 < result["recall_high"]


def test_causes_say_what_is_nearly_degenerate():
    truth = points(4, 6).assign(y=np.arange(6) * 10.0, conditioning=[0.5, 0.01] * 3, sigma=1.6)
    assert causes(truth, truth, 1.4, 2.2).tolist() == ["true", "degenerate"] * 3
    assert set(causes(truth, truth, 1.7, 2.2)) == {"edge"}
