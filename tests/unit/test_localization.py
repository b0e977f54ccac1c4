"""Spread of locations whose distribution is known."""

import numpy as np
import pandas as pd
import pytest

from keystab.errors import InputError
from keystab.evaluation.intervals import table_counts
from keystab.evaluation.localization import localization, mean_localization


def repeated(n_keypoints, n_sets, draw):
    """Detections of keypoints seen in all sets, with `draw(shape)` added to their places."""
    shape = (n_keypoints, n_sets)
    place = 10.0 * np.arange(n_keypoints)[:, None]
    table = pd.DataFrame(
        {
            "y": (place + draw(shape)).ravel(),
            "x": (place - draw(shape)).ravel(),
            "sigma": (1.1 * 2 ** draw(shape)).ravel(),
        }
    )
    return table, np.arange(n_keypoints * n_sets).reshape(shape)


def test_by_hand():
    """A 3-4-5 triangle seen from its corners, and one octave of scale."""
    table = pd.DataFrame(
        {"y": [0.0, 3.0, 0.0, 9.0], "x": [0.0, 0.0, 4.0, 9.0], "sigma": [1, 2, 4, 1]}
    )
    found = np.array([[0, 1, 2, -1], [-1, -1, -1, 3]])
    spread = localization(table, found)
    assert spread.index.tolist() == [0]
    assert spread["n_sets"].tolist() == [3]
    row = spread.loc[0]
    np.testing.assert_allclose(row[["y", "x", "sigma"]].tolist(), [1, 4 / 3, 2], rtol=1e-14)
    np.testing.assert_allclose(row["sd_y"], np.sqrt(3), rtol=1e-14)
    np.testing.assert_allclose(row["sd_x"], np.sqrt(16 / 3), rtol=1e-14)
    np.testing.assert_allclose(row["sd_location"], np.sqrt(3 + 16 / 3), rtol=1e-14)
    np.testing.assert_allclose(row["sd_log2_sigma"], 1, rtol=1e-14)


def test_rounding_to_a_grid_gives_its_known_spread():
    """Sub-pixel shifts make the rounding error uniform: step / sqrt(12) along each axis."""
    generator, step = np.random.default_rng(1), 0.5
    table, found = repeated(400, 100, lambda shape: generator.uniform(-step / 2, step / 2, shape))
    mean = mean_localization(table, found)["mean"]
    # 400 x 100 draws: relative error below 1 %, of which the bias of a mean of roots is 0.1 %.
    np.testing.assert_allclose(mean["location"], step / np.sqrt(6), rtol=0.01)
    np.testing.assert_allclose(mean["log2_sigma"], step / np.sqrt(12), rtol=0.01)


def test_translation_and_zoom_act_as_they_must():
    table, found = repeated(20, 6, np.random.default_rng(2).standard_normal)
    moved = table.assign(y=3 * table["y"] + 1000, x=3 * table["x"] - 70, sigma=3 * table["sigma"])
    before, after = localization(table, found), localization(moved, found)
    np.testing.assert_allclose(after["sd_location"], 3 * before["sd_location"], rtol=1e-10)
    np.testing.assert_allclose(after["sd_log2_sigma"], before["sd_log2_sigma"], rtol=1e-10)


@pytest.mark.parametrize(
    ("share", "kept"), [(0.0, [1, 2, 3]), (0.5, [1, 2, 3]), (0.6, [2, 3]), (1.0, [3])]
)
def test_only_keypoints_seen_often_enough(share, kept):
    """Seen in 1 to 4 of 4 sets; a spread needs two detections whatever the share."""
    table, found = repeated(4, 4, np.random.default_rng(3).standard_normal)
    found = np.where(np.tri(4, dtype=bool), found, -1)
    assert localization(table, found, share).index.tolist() == kept
    assert (mean_localization(table, found, share)["n_keypoints"] == len(kept)).all()


def test_interval_equals_means_of_resampled_tables():
    generator = np.random.default_rng(4)
    table, found = repeated(30, 7, generator.standard_normal)
    found = np.where(generator.random(found.shape) < 0.7, found, -1)
    keypoints, sets = table_counts(found.shape, 50, ("keypoints", "sets"), "precision", "test")
    samples = []
    for rows, columns in zip(keypoints, sets, strict=True):
        drawn = found[np.repeat(np.arange(30), rows)][:, np.repeat(np.arange(7), columns)]
        spread = localization(table, drawn)[["sd_location", "sd_log2_sigma"]]
        # Undo the loss of variance by repeated sets: m / (m - 1) for a keypoint seen m times.
        original = np.repeat(np.arange(30), rows)[spread.index]
        m = (found[original] >= 0).sum(axis=1)
        samples.append(spread.mul(np.sqrt(m / (m - 1)), axis=0).mean())
    low, high = np.quantile(samples, [0.025, 0.975], axis=0)
    result = mean_localization(table, found, n_resamples=50, purpose=("test",))
    np.testing.assert_allclose(result["low"], low, rtol=1e-9)
    np.testing.assert_allclose(result["high"], high, rtol=1e-9)
    assert (result["low"] < result["high"]).all()


@pytest.mark.parametrize("resample", [("keypoints",), ("sets",), ("keypoints", "sets")])
def test_interval_lies_around_the_mean(resample):
    """With 6 sets the uncorrected resamples would be 9 % too small, far outside the interval."""
    table, found = repeated(500, 6, np.random.default_rng(6).standard_normal)
    result = mean_localization(table, found, n_resamples=200, purpose=("test",), resample=resample)
    assert (result["low"] < result["mean"]).all()
    assert (result["mean"] < result["high"]).all()


def test_no_keypoint_seen_often_enough():
    table, _ = repeated(2, 2, np.zeros)
    result = mean_localization(table, np.array([[0, -1], [-1, 3]]), n_resamples=10)
    assert (result["n_keypoints"] == 0).all()
    assert result[["mean", "median", "low", "high"]].isna().all(axis=None)


def test_share_out_of_range():
    with pytest.raises(InputError, match="minimum_share"):
        localization(*repeated(2, 2, np.zeros), minimum_share=50)
