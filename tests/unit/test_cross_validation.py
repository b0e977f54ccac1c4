"""Models that combine predictors: what they gain is known on paper, and nothing leaks."""

from statistics import NormalDist

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from keystab.errors import InputError
from keystab.evaluation.cross_validation import block_splits, blocks, folds, picture_split, scores
from keystab.evaluation.roc import area_under_curve
from keystab.evaluation.stratified_roc import Detections, areas, mean_curve, rejected
from keystab.experiments.predictor_scores import described, score_predictors
from keystab.prediction.predictors import PREDICTORS
from keystab.scalespace.continuous_dog import DogSeries

PHI = NormalDist().cdf


def places(seed, n, side=200.0):
    rng = np.random.default_rng(seed)
    return pd.DataFrame(rng.uniform(0, side, (n, 2)), columns=["y", "x"])


@given(st.integers(0, 10**6), st.integers(1, 200), st.integers(2, 9), st.floats(5, 100))
def test_folds_keep_blocks_whole(seed, n, n_folds, side):
    where = places(seed, n)
    block = blocks(where, side)
    fold = folds(block, n_folds, "test", seed)
    cells = np.floor(where.to_numpy() / side)
    for number in np.unique(block):
        assert len(np.unique(fold[block == number])) == 1
        assert len(np.unique(cells[block == number], axis=0)) == 1
    each = np.bincount([fold[block == number][0] for number in np.unique(block)], minlength=n_folds)
    assert each.max() - each.min() <= 1
    # The order of detections decides nothing.
    turned = blocks(where[::-1], side)[::-1]
    assert (folds(turned, n_folds, "test", seed) == fold).all()


def test_splits_share_no_detection_and_score_each_once():
    within = np.array([True] * 6 + [False] * 2)
    splits = list(block_splits(np.array([0, 0, 1, 1, 2, 2, 0, 1]), within))
    assert sum(scored.astype(int) for _, scored in splits).tolist() == [1] * 6 + [0] * 2
    for learnt, scored in [*splits, picture_split(np.array(["a", "b"] * 4), "a")]:
        assert not (learnt & scored).any()
    assert not any((learnt & ~within).any() for learnt, _ in splits)


@pytest.mark.parametrize(("what", "value"), [("side", 0.0), ("n_folds", 1)])
def test_limits_are_refused(what, value):
    with pytest.raises(InputError, match=f"{value}, allowed is"):
        blocks(places(0, 3), value) if what == "side" else folds(np.arange(3), value)


def test_two_normals_have_the_area_of_their_distance():
    rng = np.random.default_rng(1)
    good = np.repeat([True, False], 4000)
    for shift in (0.0, 0.5, 1.5):
        score = rng.standard_normal(8000) + shift * good
        among = Detections(good, np.tile([3, 5], 4000), np.ones((1, 8000), dtype=int))
        # 4 standard errors of an area of two groups of 4000.
        assert areas(score, among)[0] == pytest.approx(PHI(shift / 2**0.5), abs=0.03)
        # At a limit that keeps 95 % of the good, the bad above it are Phi(-z - shift).
        limit = NormalDist(shift).inv_cdf(0.05)
        assert rejected(score, among)[0] == pytest.approx(PHI(limit), abs=0.03)


def test_models_of_two_independent_normals_add_squares():
    rng = np.random.default_rng(2)
    good = rng.random(6000) < 0.7
    inputs = pd.DataFrame(rng.standard_normal((6000, 3)) + good[:, None] * [1.0, 0.7, 0.0])
    fold = folds(np.arange(6000), 5, "test")
    everything = np.ones(6000, dtype=bool)
    score = scores(inputs, good, everything, block_splits(fold, everything))
    expected = PHI((1.0 + 0.49) ** 0.5 / 2**0.5)
    assert area_under_curve(score[good], score[~good]) == pytest.approx(expected, abs=0.02)


def test_strata_are_not_compared_with_each_other():
    # Bad ones are most of one stratum, whose scores are low whatever the label.
    rng = np.random.default_rng(3)
    stratum = np.repeat([3, 19], 3000)
    good = rng.random(6000) < np.where(stratum == 3, 0.2, 0.8)
    score = rng.standard_normal(6000) + (stratum == 19) * 3.0
    assert area_under_curve(score[good], score[~good]) > 0.75
    among = Detections(good, stratum, np.ones((1, 6000), dtype=int))
    assert areas(score, among)[0] == pytest.approx(0.5, abs=0.03)


def test_one_stratum_is_the_usual_curve():
    rng = np.random.default_rng(4)
    good, score = rng.random(50) < 0.5, np.round(rng.standard_normal(50), 1)
    among = Detections(good, np.zeros(50), np.ones((1, 50), dtype=int))
    assert areas(score, among)[0] == pytest.approx(area_under_curve(score[good], score[~good]))
    for share in (1.0, 0.9, 0.5):
        limits = [t for t in score[good] if (score[good] >= t).mean() >= share - 1e-12]
        wanted = (score[~good] < max(limits)).mean()
        assert rejected(score, among, share)[0] == pytest.approx(wanted)
    curve = mean_curve(score, among, [0.0, 0.5, 0.9, 1.0])
    assert curve["rejected"].is_monotonic_decreasing and curve["rejected"].iloc[0] == 1.0


def test_resamples_are_those_of_repeated_blocks():
    rng = np.random.default_rng(5)
    good, score, block = rng.random(40) < 0.5, rng.standard_normal(40), np.repeat(np.arange(10), 4)
    among = Detections.in_blocks(good, np.zeros(40), block, 3, "test")
    weight = among.weight[2]
    assert all(len(np.unique(weight[block == b])) == 1 for b in range(10))
    repeated = np.repeat(np.arange(40), weight)
    expected = area_under_curve(*(score[repeated[good[repeated] == one]] for one in (True, False)))
    assert areas(score, among)[2] == pytest.approx(expected)


def detections(seed, n=400, informative=0.0):
    """One picture's table of `described` with invented predictors, four detections a keypoint."""
    rng = np.random.default_rng(seed)
    keypoint = np.arange(n) // 4
    where = places(seed, n // 4 + 1, 300.0).to_numpy()[keypoint]
    stable = rng.random(n // 4 + 1)[keypoint] < 0.7
    own = rng.standard_normal((n // 4 + 1, len(PREDICTORS)))[keypoint]
    values = np.exp(0.5 * (own + informative * stable[:, None]))
    table = pd.DataFrame(values, columns=list(PREDICTORS))
    for name in ("condition",):
        table[name] = 1 / table[name]
    return table.assign(
        n_spo=np.tile([3, 5, 9, 15], n // 4), keypoint=keypoint,
        y=where[:, 0], x=where[:, 1], keypoint_y=where[:, 0], keypoint_x=where[:, 1],
        sigma=1.5, sign=1, stability=np.where(stable, 1.0, 0.0), cause=np.where(stable, "true", "nothing"),
    )  # fmt: skip


def test_labels_drawn_by_lot_cannot_be_predicted():
    scored = score_predictors({"a": detections(1), "b": detections(2)}, 0.8, 0.2, 32.0, 5, 300)
    models = scored.auc[scored.auc["predictor"].isin(["combined", "figure_5", "combined_end"])]
    # The four detections of a keypoint are copies. Had folds torn them apart, models would know.
    inside = (models["auc_low"] <= 0.5) & (models["auc_high"] >= 0.5)
    assert inside.mean() > 0.8 and models["auc"].between(0.35, 0.65).all()
    assert (scored.gain["gain_low"] <= 0.05).all()


def test_what_is_informative_is_found_in_pictures_never_seen():
    pictures = {name: detections(k, informative=1.0) for k, name in enumerate("abc", 1)}
    scored = score_predictors(pictures, 0.8, 0.2, 32.0, 5, 100)
    own = scored.auc.set_index(["label", "picture", "predictor", "validation"])
    one = own.loc[("stability", "a", "edge", "none")]
    together = own.loc[("stability", "a", "combined", "pictures")]
    assert one["auc"] == pytest.approx(PHI(0.5**0.5), abs=0.15)
    assert together["auc"] > one["auc_high"] and together["rejected"] > one["rejected"]
    gain = scored.gain[scored.gain["model"] == "combined"]
    assert set(gain["picture"]) == set("abc") and (gain["gain_low"] > 0).all()
    assert set(scored.roc["predictor"]) >= {"combined", *scored.gain["best"]}
    # Blocks of a picture and their folds depend on nothing but the picture.
    alone = score_predictors({"a": pictures["a"]}, 0.8, 0.2, 32.0, 5, 100)
    first = scored.detections[scored.detections["picture"] == "a"].reset_index(drop=True)
    pd.testing.assert_frame_equal(first[["block", "fold"]], alone.detections[["block", "fold"]])
    assert alone.gain.empty


def test_what_lies_outside_the_range_is_left_out_of_it():
    table = detections(1).assign(end=np.tile([0.1, 0.1, -0.1, 0.1], 100))
    scored = score_predictors({"a": table, "b": detections(2)}, 0.8, 0.2, 32.0, 5, 100)
    counts = scored.auc[scored.auc["picture"] == "a"].groupby("label")[["n_good", "n_bad"]].first()
    assert counts.sum(axis=1).to_dict() == {"stability": 400, "inside": 300, "truth": 400}


def test_a_picture_of_one_kind_has_no_area():
    table = detections(1).assign(stability=1.0)
    scored = score_predictors({"a": table, "b": detections(2)}, 0.8, 0.2, 32.0, 5, 100)
    rows = scored.auc[(scored.auc["picture"] == "a") & (scored.auc["label"] == "stability")]
    assert rows["auc"].isna().all() and (rows["n_bad"] == 0).all()


def test_detections_take_the_labels_of_the_nearest_keypoint():
    columns = {"g_s": 0.0, "g_y": 0.0, "g_x": 0.0, "h_sy": 0.0, "h_sx": 0.0, "h_yx": 0.0}
    columns |= {"value": 0.1, "difference": 0.01, "h_ss": -1.0, "h_yy": -1.0, "h_xx": -1.0}
    found = pd.DataFrame(
        {"n_spo": [3, 3, 5, 5], "delta_min": 0.5, "y": [10.0, 20.0, 10.4, 30.0], "x": 10.0,
         "sigma": 1.5, "sign": 1, **columns}
    )  # fmt: skip
    for name in ("y", "x", "sigma"):
        found[f"step_{name}"] = found[name]
    keypoints = pd.DataFrame(
        {"keypoint": [0, 1, 2], "y": [9.5, 10.6, 20.0], "x": 10.0, "sigma": 1.5, "sign": 1,
         "stability": [0.1, 0.9, 0.5]}
    )  # fmt: skip
    truth = pd.DataFrame(
        {"y": [10.2], "x": [10.0], "sigma": [1.5], "sign": [1], "conditioning": [0.5]}
    )
    series = DogSeries.of_image(np.random.default_rng(1).random((40, 24)), 1.1, 2 ** (1 / 3))
    same = {"space_tolerance": 1.0, "scale_ratio": 2**0.5, "match_sign": False}
    table = described(found, np.ones(4, bool), keypoints, truth, series, (1.386, 2.2), same)
    # Each sampling is held against the truth by itself; the last one is the same as no keypoint.
    assert table["stability"].tolist() == [0.1, 0.5, 0.9]
    assert table["cause"].tolist() == ["true", "nothing", "true"]
    assert table["keypoint_y"].tolist() == [9.5, 20.0, 10.6]
    end = min(np.log(1.5 / 1.386), np.log(2.2 / 1.5))
    assert table["end"].tolist() == pytest.approx([end] * 3)
    assert table["edge"].tolist() == [1.0] * 3 and (table["condition"] == 1.0).all()
    # A picture without any is described, and has no areas.
    nothing = described(found, np.zeros(4, bool), keypoints, truth, series, (1.386, 2.2), same)
    assert nothing.empty and list(nothing) == list(table)
    scored = score_predictors({"a": nothing, "b": detections(1)}, 0.8, 0.2, 32.0, 5, 100)
    assert scored.auc.loc[scored.auc["picture"] == "a", "auc"].isna().all()
