"""Judging error bars: what is certain by construction is found to be so."""

from __future__ import annotations

import math

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import chi2

from keystab.experiments.uncertainty_calibration import (
    METHODS,
    counterparts,
    coverage_table,
    judged,
    noise_argument,
    reliability_table,
    returned,
    separation_table,
    shot,
    weighted_error,
)

KAPPA = 2 ** (1 / 3)


def keypoints(n, seed=0):
    """Keypoints far apart, with error bars that differ and are correlated."""
    draw = np.random.default_rng(seed)
    place = 10.0 * np.arange(n)
    table = pd.DataFrame({"y": 50.0, "x": place, "sigma": 2.0, "sign": 1, "value": 0.1})
    table["octave"] = draw.integers(0, 2, n)
    table["std_y"], table["std_x"] = draw.uniform(0.01, 0.1, (2, n))
    table["std_log_sigma"] = draw.uniform(0.005, 0.04, n)
    table["cov_yx"] = 0.6 * table["std_y"] * table["std_x"]
    table["cov_y_log_sigma"] = table["cov_x_log_sigma"] = 0.0
    table["survival"], table["conditioning"] = draw.uniform(0, 1, (2, n))
    return table


def moved(table, seed, shots=2):
    """A second shot whose shifts have the covariance that the error bars say."""
    draw = np.random.default_rng(seed).standard_normal((3, len(table))) * shots**0.5
    y, x = table["std_y"] * draw[0], table["std_x"] * (0.6 * draw[0] + 0.8 * draw[1])
    sigma = table["sigma"] * np.exp(table["std_log_sigma"] * draw[2])
    return table.assign(y=table["y"] + y, x=table["x"] + x, sigma=sigma)


def test_ellipses_hold_what_they_say_where_the_shifts_are_drawn_from_them():
    table = keypoints(1500)
    image = np.random.default_rng(2).standard_normal((100, 100))
    for shots in (1, 2):
        held = judged(table, moved(table, 5, shots), image, 0.8, KAPPA, shots)
        assert held["found"].all()
        for row in coverage_table(held, methods=("bars",)).itertuples():
            deviation = np.sqrt(row.level * (1 - row.level) / row.n)
            assert abs(row.held - row.level) < 4 * deviation, row
            assert row.low < row.held < row.high


def test_rivals_get_the_factor_that_suits_them_best_in_the_middle():
    table = keypoints(400)
    image = np.random.default_rng(2).standard_normal((100, 100))
    held = coverage_table(judged(table, moved(table, 5), image, 0.8, KAPPA))
    half = held[(held["level"] == 0.5) & (held["method"] != "bars")]
    assert len(half) == 2 * (len(METHODS) - 1)
    assert half["held"].to_numpy() == pytest.approx(0.5, abs=0.01)


@pytest.mark.parametrize("seed", range(3))
def test_rounding_does_not_decide_over_the_keypoint_in_the_middle(seed):
    draw = np.random.default_rng(seed)
    table = pd.DataFrame({"found": np.full(4001, True), "group": draw.integers(0, 40, 4001)})
    table["kind"] = table["group"]  # rivals get a factor for each kind
    columns = [f"{quantity}_octave" for quantity in ("position", "scale")]
    table[columns] = draw.chisquare(2, (4001, 2))
    held = coverage_table(table, ["group"], methods=["octave"])
    half = held[held["level"] == 0.5]
    assert (half["n"] % 2 == 1).any()
    assert (2 * half["held"] * half["n"]).round().tolist() == (half["n"] + half["n"] % 2).tolist()
    other = table.copy()
    other[columns] *= 1 + 1e-15 * draw.standard_normal((4001, 2))
    assert coverage_table(other, ["group"], methods=["octave"]).equals(held)


def test_error_bars_that_are_half_as_long_hold_less():
    table = keypoints(1500)
    second = moved(table, 5)
    half = table.assign(
        std_y=table["std_y"] / 2, std_x=table["std_x"] / 2, cov_yx=table["cov_yx"] / 4
    )
    held = coverage_table(judged(half, second, np.eye(100), 0.8, KAPPA), methods=("bars",))
    said = chi2.cdf(chi2.ppf(0.9, 2) / 4, 2)
    row = held[(held["level"] == 0.9) & (held["quantity"] == "position")].iloc[0]
    assert row["held"] == pytest.approx(said, abs=0.04)


def test_only_near_extrema_of_the_same_sign_return():
    first = pd.DataFrame({"y": [10.0] * 4, "x": [10.0, 40, 70, 100], "sigma": 2.0, "sign": 1})
    second = first.assign(
        x=[10.9, 41.1, 70, 100], sign=[1, 1, -1, 1], sigma=[2.0, 2.0, 2.0, 2.0 * np.exp(0.51)]
    )
    shift = returned(first, second)
    assert np.isfinite(shift[:, 0]).tolist() == [True, False, False, False]
    assert shift[0] == pytest.approx([0, 0, 0.9])
    assert np.isnan(returned(first, second.iloc[:0])).all()


def test_reliability_of_draws_from_the_survival_itself():
    n = 20000
    table = keypoints(n)
    table["found"] = np.random.default_rng(1).uniform(size=n) < table["survival"]
    bins = reliability_table(table)
    assert bins["n"].sum() == n
    assert weighted_error(bins) < 0.015
    wrong = reliability_table(table.assign(survival=1 - table["survival"]))
    assert weighted_error(wrong) == pytest.approx(0.5, abs=0.03)


def test_survival_separates_and_contrast_that_knows_nothing_does_not():
    table = keypoints(4000).assign(contrast=np.random.default_rng(4).uniform(size=4000))
    table["found"] = np.random.default_rng(1).uniform(size=4000) < table["survival"]
    area = separation_table(table).set_index("guess")["auc"]
    # Of those that return p has the density 2 p, of the others 2 (1 - p): P(p > q) is 5/6.
    assert area["survival"] == pytest.approx(5 / 6, abs=0.02)
    assert area["contrast"] == pytest.approx(0.5, abs=0.03)


def test_shots_have_the_noise_that_is_said_and_differ_by_their_purpose():
    view = np.full((120, 120), 0.9)
    offset, slope = noise_argument("signal", 0.02)
    assert shot(view, "signal", 0.02, 1).std() == pytest.approx(
        (offset + 0.9 * slope) ** 0.5, rel=0.03
    )
    assert offset + 0.5 * slope == pytest.approx(0.02**2)
    assert shot(view, "additive", 0.02, 1).std() == pytest.approx(0.02, rel=0.03)
    assert (shot(view, "additive", 0.02, 1) == shot(view, "additive", 0.02, 1)).all()
    assert (shot(view, "additive", 0.02, 1) != shot(view, "additive", 0.02, 2)).any()
    packed = shot(0.5 * view, "jpeg", 0.02, 1)
    assert packed.std() == pytest.approx(0.02, rel=0.1)
    assert np.abs(packed - shot(0.5 * view, "jpeg", 0.0, 1)).max() > 0.02
    assert np.rint(255 * packed) == pytest.approx(255 * packed)


def test_a_counterpart_lies_nearer_than_the_radius_in_scale_rows_and_columns():
    first = pd.DataFrame({"y": [20.0], "x": [30.0], "sigma": [2.0], "sign": [1]})
    for name in ("y", "x", "sigma"):
        for inside in (True, False):
            second = first.copy()
            far = 0.999 if inside else 1.001
            if name == "sigma":
                second["sigma"] *= math.exp(far * 0.5)
            else:
                second[name] += far * 0.5 * 2.0
            assert (counterparts(first, second, radius=0.5).tolist() == [0]) == inside, name
    # Exactly on the radius is not nearer: 0.5 times 2 pixels.
    assert counterparts(first, first.assign(y=21.0), radius=0.5).tolist() == [-1]
    # Both shifts count together, and neither for the other.
    both = first.assign(y=20.0 + 0.8, x=30.0 + 0.8)
    assert counterparts(first, both, radius=0.5).tolist() == [-1]


@settings(deadline=None, max_examples=30)
@given(st.integers(0, 10**6), st.booleans())
def test_counterparts_do_not_depend_on_the_order_of_rows_nor_of_axes(seed, one_to_one):
    rng = np.random.default_rng(seed)
    first, second = (
        pd.DataFrame(
            {
                "y": rng.uniform(0, 9, n), "x": rng.uniform(20, 33, n),
                "sigma": rng.uniform(1, 3, n), "sign": rng.choice([-1, 1], n),
            }
        )
        for n in (12, 15)
    )  # fmt: skip
    plain = counterparts(first, second, one_to_one)
    turned = [it.rename(columns={"y": "x", "x": "y"}) for it in (first, second)]
    assert (counterparts(*turned, one_to_one) == plain).all()
    a, b = rng.permutation(12), rng.permutation(15)
    moved = counterparts(first.iloc[a], second.iloc[b], one_to_one)
    assert (np.where(moved >= 0, b[moved], -1) == plain[a]).all()
    negated = [it.assign(sign=-it["sign"]) for it in (first, second)]
    assert (counterparts(*negated, one_to_one) == plain).all()
    if one_to_one:
        kept = plain[plain >= 0]
        assert len(set(kept.tolist())) == len(kept)
