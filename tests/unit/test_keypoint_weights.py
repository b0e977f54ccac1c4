"""Motion from keypoints: exact without errors, and better with weights where errors differ."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from keystab.camera.common_field import to_common_frame
from keystab.camera.views import ViewSpec
from keystab.experiments.keypoint_weights import (
    KEPT,
    TASKS,
    WEIGHTS,
    Motion,
    motion_errors,
    moved_shots,
    weights_table,
)

REFERENCE = (900, 1200)
FIRST = ViewSpec(0.8, 5.0, (180, 240))
SECOND = ViewSpec(0.8, 5.5, (180, 240), (2.5, -1.5), 0.1)
MOTION = Motion.between(FIRST, SECOND, REFERENCE)


def keypoints(seed, worst=0.0, count=80):
    """Keypoints that are far apart, of very different errors: up to `worst` pixels."""
    draw = np.random.default_rng(seed)
    place = np.array([[12 + 20 * (k // 10), 12 + 22 * (k % 10)] for k in range(count)], dtype=float)
    table = pd.DataFrame(place + draw.uniform(-3, 3, place.shape), columns=["y", "x"])
    table["sigma"], table["sign"] = 2.0, np.where(draw.random(count) < 0.5, 1, -1)
    table["octave"], table["survival"] = 0, 1.0
    size = worst * np.geomspace(0.01, 1.0, count)[draw.permutation(count)]
    table["std_y"] = table["std_x"] = np.maximum(size, 1e-6)
    return table.assign(cov_yx=0.0)


def second_shot(table, seed):
    """The same keypoints seen after the motion, both shots with the errors that they say."""
    draw = np.random.default_rng(seed).standard_normal((2, len(table), 2))
    errors = draw * table["std_y"].to_numpy()[:, None]
    there = MOTION(table[["y", "x"]].to_numpy()) + errors[1]
    first = table.assign(y=table["y"] + errors[0][:, 0], x=table["x"] + errors[0][:, 1])
    zoom = np.sqrt(np.linalg.det(MOTION.matrix))
    return first, table.assign(y=there[:, 0], x=there[:, 1], sigma=zoom * table["sigma"])


def test_a_motion_is_that_of_the_cameras():
    y, x = np.random.default_rng(0).uniform(0, 170, (2, 20))
    there = MOTION(np.column_stack([y, x]))
    back = to_common_frame(SECOND, FIRST, REFERENCE, *there.T)
    assert back[0] == pytest.approx(y, abs=1e-9) and back[1] == pytest.approx(x, abs=1e-9)


def test_without_errors_motion_and_depth_are_exact():
    found = list(motion_errors(*second_shot(keypoints(1), 2), MOTION, "exact"))
    assert len(found) == len(TASKS) * len(WEIGHTS) * len(KEPT)
    for row in found:
        assert row["matches"] == 80
        assert row["error"] < 1e-4, row


def test_weights_help_where_errors_differ_and_wrong_matches_do_little():
    rows = []
    for pair in range(8):
        first, second = second_shot(keypoints(pair, worst=0.4), 100 + pair)
        stray = np.random.default_rng(pair).random(len(second)) < 0.05
        second = second.assign(y=second["y"] + 0.7 * stray)
        found = motion_errors(first, second, MOTION, pair)
        rows += [row | {"noise": 0.01, "pair": pair} for row in found]
    table = weights_table(pd.DataFrame(rows), [0.01]).set_index(["task", "weights", "kept"])
    assert (table["n"] == 8).all()
    for task in ("translation", "homography"):
        bars, equal = (table.loc[(task, weights, "all")] for weights in ("bars", "equal"))
        assert bars["ratio_high"] < 1 and bars["error"] < 0.6 * equal["error"]
        # One octave, so one error per octave is the same for all.
        assert table.loc[(task, "octave", "all"), "ratio"] == pytest.approx(1, abs=1e-3)
    assert table["low"].le(table["error"]).all() and table["error"].le(table["high"]).all()


def test_the_coordinate_that_is_known_better_tells_the_depth():
    table = keypoints(3, worst=0.05).assign(std_y=0.2, std_x=0.01)
    draw = np.random.default_rng(4).standard_normal((len(table), 2))
    there = MOTION(table[["y", "x"]].to_numpy())
    second = table.assign(y=there[:, 0] + 0.2 * draw[:, 0], x=there[:, 1] + 0.01 * draw[:, 1])
    rows = {
        row["weights"]: row["error"]
        for row in motion_errors(table, second, MOTION, "depth")
        if row["task"] == "triangulation" and row["kept"] == "all"
    }
    assert rows["bars"] < 0.25 * rows["equal"]


def test_too_few_matches_are_not_asked():
    assert not list(motion_errors(*second_shot(keypoints(1, count=11), 2), MOTION, "few"))
    empty = moved_shots(
        [np.zeros((20, 20))] * 2, [FIRST, SECOND], REFERENCE, [0.01], 1, {"n_spo": 3}
    )
    table = weights_table(empty, [0.01])
    assert (table["n"] == 0).all() and table["ratio"].isna().all()
    assert len(table) == len(TASKS) * len(WEIGHTS) * len(KEPT)
