"""Bias, spread, phase, drift and coverage against closed forms and simulated truth."""

from __future__ import annotations

import math

import numpy as np
import pandas as pd
import pytest

from keystab.errors import InputError
from keystab.evaluation.convention_found import found_convention
from keystab.evaluation.location_errors import (
    coverage,
    drift,
    phase_pattern,
    phase_regression,
    quantile,
    share,
    spread,
    strongest_phase,
)
from keystab.evaluation.repeatability import displaced, distinct, in_common, seam_deficit

SWAPPED = [[-1.0, 1.0], [1.0, -1.0]]


def draw(*seed: int) -> np.random.Generator:
    return np.random.default_rng(seed)


def points(n: int, *seed: int) -> np.ndarray:
    return draw(*seed).uniform(0, 100, (n, 2))


@pytest.mark.parametrize(("n", "at"), [(30, 0.5), (200, 0.5), (200, 0.9)])
def test_intervals_of_quantiles_hold_what_they_say(n, at):
    true = -math.log(1 - at)  # of the exponential distribution
    found = [quantile(draw(n, k).exponential(size=n), at) for k in range(600)]
    held = np.mean([each.low <= true <= each.high for each in found])
    assert 0.94 <= held <= 0.99  # ranks are rounded outwards


def test_an_interval_beyond_the_last_value_is_not_known():
    few = quantile([1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0], 0.9)
    assert few.value == pytest.approx(6.4) and math.isnan(few.high) and few.low == 4.0
    assert all(map(math.isnan, quantile([])))
    assert math.isnan(quantile([1.0, 2.0]).low)
    with pytest.raises(InputError, match="between 0 and 1"):
        quantile([1.0], 1.0)


def test_outliers_do_not_move_the_spread():
    values = draw(5).normal(3.0, 0.2, 2000)
    values[:100] = 1e6
    found = spread(values)
    assert found.low < 0.215 and 0.2 <= found.value <= 0.22 and found.high > 0.215
    assert all(map(math.isnan, spread([])))


def test_shares_of_nothing_are_not_known():
    assert all(map(math.isnan, share(0, 0)))
    assert share(3, 3).value == 1.0 and share(3, 3).high == 1.0


@pytest.mark.parametrize("step", [0.5, 1.0, 2.0])
def test_swapped_offsets_are_found_at_their_own_samples_beneath_noise(step):
    p = points(400, 1)
    offset = p - step * np.round(p / step)
    errors = offset[:, ::-1] - offset + draw(2).normal(0.2, 0.1 * step, p.shape)
    assert np.abs(errors.mean(axis=0) - 0.2).max() < 0.06 * step  # the mean sees nothing
    found = strongest_phase(errors, p)
    assert found.step == step and found.n == 400
    assert (np.abs(found.matrix - SWAPPED) <= 2 * found.half_width).all()
    assert phase_pattern(found) == "swapped offsets"


def test_intervals_of_phases_hold_what_they_say():
    held = []
    for k in range(300):
        p = points(60, 3, k)
        found = phase_regression(draw(4, k).normal(0.0, 0.3, p.shape), p)
        held.append(np.abs(found.matrix) <= found.half_width)
    assert 0.92 <= np.mean(held) <= 0.97


def test_other_dependences_have_their_names():
    p = points(300, 6)
    offset = p - np.round(p)
    assert phase_pattern(phase_regression(-offset, p)) == "no offsets"
    assert phase_pattern(phase_regression(0.6 * offset, p)) == "some"
    assert phase_pattern(phase_regression(np.full_like(p, 0.25), p)) == "none"
    assert phase_pattern(phase_regression(offset[:3], p[:3])) == ""
    assert phase_pattern(phase_regression(offset, np.round(p))) == ""  # all of one phase


def test_drifts_are_those_of_a_wrong_zoom():
    p = points(500, 7)
    errors = 0.002 * p + draw(8).normal(0.1, 0.05, p.shape)
    for found in drift(errors, p, (100.0, 100.0)):
        assert found.low <= 0.2 <= found.high and found.high - found.low < 0.05
    assert math.isnan(drift(errors[:2], p[:2], (100.0, 100.0))[0].value)


def test_drifts_of_few_extrema_in_many_views_have_wide_intervals():
    # An extremum has the same error in eight views, as have those that are no extremum.
    held, naive = 0, 0
    extent = (100.0, 100.0)
    for seed in range(200):
        own = draw(20, seed)
        p = np.repeat(own.uniform(0, 100, (40, 2)), 8, axis=0)
        false = own.random((40, 1)) < 0.3
        errors = np.where(false, own.uniform(-1, 1, (40, 2)), own.normal(0, 0.1, (40, 2)))
        errors = np.repeat(errors, 8, axis=0)
        found = drift(errors, p, extent, np.repeat(np.arange(40), 8), 0.5)[0]
        held += not (found.low > 0 or found.high < 0)  # nothing is said of fewer than 30
        found = drift(errors, p, extent)[0]
        naive += found.low <= 0 <= found.high
    assert held >= 182 and naive < 150


def test_a_drift_is_found_though_there_are_false_matches():
    p = points(300, 21)
    errors = 0.005 * p + draw(22).normal(0, 0.05, p.shape) - 0.25
    errors[:60] = draw(23).uniform(-1, 1, (60, 2))
    for found in drift(errors, p, (100.0, 100.0), np.arange(300) // 2, 0.5):
        assert 0.4 < found.value < 0.51 and found.low > 0.35  # they flatten it somewhat
    for found in drift(errors, p, (100.0, 100.0), np.arange(300) % 29, 0.5):
        assert math.isnan(found.low) and not math.isnan(
            found.value
        )  # of 29 extrema nothing is said


def test_ellipses_hold_what_their_covariance_says():
    covariance = np.array([[0.04, 0.018], [0.018, 0.01]])
    errors = draw(9).multivariate_normal([0, 0], covariance, 4000)
    ones = np.ones(len(errors))
    bars = np.sqrt(np.diag(covariance))
    found = coverage(errors, bars[0] * ones, bars[1] * ones, covariance[0, 1] * ones)
    assert found.low <= 0.9 <= found.high
    assert (
        coverage(errors, bars[0] * ones, bars[1] * ones).high < 0.89
    )  # another shape, and it tells
    assert coverage(errors, bars[0] * ones / 3, bars[1] * ones / 3).value < 0.5
    assert coverage(errors[:2], [np.nan, 1.0], [1.0, 0.0]).value == 0.0


# What views have in common


def keypoints(y, x, sigma=2.0):
    return pd.DataFrame({"y": np.asarray(y, float), "x": np.asarray(x, float), "sigma": sigma})


def test_copies_are_merged_and_neighbours_are_not():
    found = keypoints([5, 5, 5.05, 5.2, 5], [5, 5, 5, 5, 5], [2.0, 2.0, 2.02, 2.0, 2.3])
    assert distinct(found).tolist() == [True, False, False, True, True]
    assert distinct(found.iloc[:0]).tolist() == []


def test_a_keypoint_has_one_partner_at_most():
    one, crowd = keypoints([5], [5]), keypoints([5.1, 5.2, 5.3], [5, 5, 5])
    assert in_common(one, crowd, 1.0) == (1, 1)
    assert in_common(keypoints([5, 9], [5, 9]), crowd, 1.0) == (1, 2)


def test_the_strongest_are_compared_at_a_number_or_none():
    first = keypoints([1, 2, 30], [1, 20, 30]).assign(strength=[1.0, 2.0, 3.0])
    second = first.assign(strength=[3.0, 2.0, 1.0])
    assert in_common(first, second, 1.0) == (3, 3)
    assert in_common(first, second, 1.0, number=2) == (1, 2)  # only the middle is in both
    assert in_common(first, second, 1.0, number=4) == (0, 0)


def test_displaced_keypoints_stay_in_the_field_and_come_back_after_a_whole_turn():
    found = keypoints(*points(50, 10).T)
    moved = displaced(found, (0.0, 100.0, 0.0, 100.0), turns=3)
    for each in moved:
        assert each["y"].between(0, 100).all() and each["x"].between(0, 100).all()
        assert (np.hypot(each["y"] - found["y"], each["x"] - found["x"]) > 20).all()
    quarters = [(each["y"] - found["y"]) % 100 for each in moved]
    np.testing.assert_allclose(quarters, np.repeat([[25.0], [50.0], [75.0]], 50, axis=1))


def test_a_seam_is_found_where_it_is_and_nowhere_else():
    octave = np.tile(np.linspace(0.5, 2.5, 2000, endpoint=False), 2)
    group = np.repeat([0, 1], 2000)
    seam = 0.85
    near = np.abs((octave - seam + 0.5) % 1 - 0.5) < 0.125
    seen = draw(11).random(4000) < np.where(near, 0.5, 0.9)
    deficit, at = seam_deficit(2**octave, seen, group)
    assert abs(math.log2(at) - seam) < 0.05
    assert 0.35 < deficit.value < 0.45 and deficit.low < 0.4 < deficit.high


def test_no_seam_is_measured_where_there_is_none():
    # Sought in one half and measured in the other: no deficit on average.
    octave = np.tile(np.linspace(0.5, 2.5, 200, endpoint=False), 2)
    group = np.repeat([0, 1], 200)
    found = [
        seam_deficit(2**octave, draw(12, k).random(400) < 0.8, group)[0].value for k in range(100)
    ]
    assert abs(np.mean(found)) < 3 * np.std(found) / 10
    assert math.isnan(seam_deficit([2.0], [True], [0])[0].value)


# Conventions


@pytest.mark.parametrize(
    ("origin", "order", "factor", "said"),
    [
        (0.0, "yx", 1.0, "0 yx sigma"),
        (0.25, "xy", 2.0, "0.25 xy diameter"),
        (0.5, "yx", 2**0.5, "0.5 yx radius"),
        (1.0, "xy", 8**0.5, "1 xy blob diameter"),
        (0.0, "yx", 4.0, "0 yx 4 sigma"),
        (0.0, "xy", 6.0, "0 xy 6 sigma"),  # kornia
        (0.12, "yx", 1.2, "(0.12, 0.12) yx 1.2 sigma"),
    ],
)
def test_conventions_are_found_beneath_noise_and_other_keypoints(origin, order, factor, said):
    blobs = keypoints(*(np.mgrid[1:9, 1:13].reshape(2, -1) * 13 + points(96, 13).T / 25), 1.8)
    true = blobs[["y", "x"]].to_numpy() + origin + draw(14).normal(0, 0.05, (96, 2))
    found = np.concatenate([true[:80], points(30, 15)])
    names = ["y", "x"] if order == "yx" else ["x", "y"]
    table = pd.DataFrame(found, columns=names).assign(scale=1.8 * factor)
    assert str(found_convention([table], [blobs])) == said
    # Who says that x comes first, and names columns accordingly, has nothing swapped.
    if order == "xy":
        renamed = table.rename(columns={"y": "x", "x": "y"})
        assert str(found_convention([renamed], [blobs], "xy")) == said


def test_no_convention_is_found_of_nothing():
    blobs = keypoints(*(np.mgrid[1:9, 1:13].reshape(2, -1) * 13.0), 1.8)
    table = pd.DataFrame(points(60, 16), columns=["y", "x"]).assign(scale=1.8)
    assert str(found_convention([table], [blobs])) == ""
    assert str(found_convention([table.iloc[:0]], [blobs])) == ""
