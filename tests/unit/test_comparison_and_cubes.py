"""Which detections are compared, what the tables of figures 3 to 5 count, and cubes."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from keystab.errors import InputError
from keystab.experiments.local_volumes import (
    HALF,
    cubes_around,
    dense_scale_space,
    drawn,
    nearest_extrema,
    places,
)
from keystab.experiments.sampling_stability import (
    change_counts,
    keypoints_of_samplings,
    long_matches,
    positions_of_matches,
    summary,
)
from keystab.matching.common_range import comparable

SAME = {"space_tolerance": 1.0, "scale_ratio": 2**0.5, "match_sign": False}
KAPPA = 2 ** (1 / 3)


def detections(rows: list[tuple[int, float]]) -> pd.DataFrame:
    """Detections at one scale, from pairs of n_spo and x."""
    table = pd.DataFrame(rows, columns=["n_spo", "x"])
    return table.assign(y=5.0, sigma=1.5, sign=1)


def test_margin_and_range_include_their_limits():
    table = pd.DataFrame({"y": [3.0, 2.999, 7.0, 7.001, 5.0, 5.0], "x": 5.0, "step_sigma": 2.0})
    table.loc[4, "step_sigma"] = np.nan
    table.loc[5, "step_sigma"] = np.inf
    kept = comparable(table, (11, 11), sigma_min=1.0, first_scale=2.0, border=3.0)
    assert kept.tolist() == [True, False, True, False, False, True]
    kept = comparable(table, (11, 11), 1.0, first_scale=2.0, border=3.0, last_scale=2.0)
    assert kept.tolist() == [True, False, True, False, False, False]
    kept = comparable(table, (11, 11), 1.0, first_scale=1.0, border=3.0, last_scale=1.999)
    assert not kept.any()


def test_new_and_lost_refer_to_the_neighbouring_sampling():
    # Keypoint A (x = 10) everywhere, B (x = 30) at 3 and 5 only, C (x = 50) at 5 only.
    common = detections([(3, 10.0), (3, 30.0), (4, 10.1), (5, 9.9), (5, 30.0), (5, 50.0)])
    extrema = pd.concat([common, detections([(4, 1.0)])])
    table = change_counts(extrema, common, {3: 0.5, 4: 0.4, 5: 0.3, 6: 0.2}, SAME)
    assert table["n_extrema"].tolist() == [2, 2, 3, 0]
    assert table["n_common"].tolist() == [2, 1, 3, 0]
    assert table["n_new"].fillna(-1).tolist() == [-1, 0, 2, 0]
    assert table["n_lost"].fillna(-1).tolist() == [1, 0, 3, -1]
    assert table["lost_rate"].iloc[0] == 0.5


def test_matches_lead_back_to_the_detections_of_each_sampling():
    common = detections([(3, 10.0), (3, 30.0), (4, 10.1), (5, 9.9), (5, 30.2)])
    samplings = [3, 4, 5, 6]
    matched = keypoints_of_samplings(common, samplings, SAME)
    assert matched.gap == 0
    assert matched.keypoints["n_samplings"].tolist() == [3, 2]
    assert matched.keypoints["stability"].tolist() == [0.75, 0.5]
    rows = np.array([4, 7, 0, 1, 5])  # rows in the files of all extrema
    long = long_matches(matched, samplings, rows)
    assert long["row"].tolist() == [4, 0, 1, -1, 7, -1, 5, -1]
    extrema = pd.DataFrame({"n_spo": [3] * 8 + [4] + [5] * 6})
    assert positions_of_matches(long, extrema).tolist() == [[4, 8, 10, -1], [7, -1, 14, -1]]
    told = summary(matched, matched, 0.7, 0.6).set_index("quantity")["value"]
    assert told[["n_unique", "gap", "share_always"]].tolist() == [2, 0, 0]
    assert told[["share_stable", "share_unstable"]].tolist() == [0.5, 0.5]


@pytest.fixture(scope="module")
def blob_space():
    """A Gaussian blob of 1.5 px, found at 1.5 / sqrt(kappa)."""
    y, x = np.mgrid[:41, :41]
    blob = np.exp(-((y - 20) ** 2 + (x - 20) ** 2) / (2 * (1.9**2)))
    return dense_scale_space(blob, 0.8, 40, 1.1, KAPPA, "cosine")


@pytest.mark.parametrize("n_spo", [16, 40, 60])
def test_an_extremum_is_sought_as_far_away_at_every_density(n_spo):
    y, x = np.mgrid[:41, :41]
    blob = np.exp(-((y - 20) ** 2 + (x - 20) ** 2) / (2 * (1.9**2)))
    space = dense_scale_space(blob, 0.8, n_spo, 1.1, KAPPA, "cosine")
    sigma = np.sqrt((1.9**2 - 0.8**2) / KAPPA)
    keypoints = pd.DataFrame(
        [(0.9, 0, 1), (-1.1, 0, 1), (0, -0.9, 1.33), (0, 1.1, 1), (0, 0, 1.5), (0, 0, 0.75)],
        columns=["y", "x", "sigma"],
    )
    keypoints = keypoints * [1, 1, sigma] + [20, 20, 0]
    _, found = nearest_extrema(space, keypoints.assign(sign=-1))
    assert found.tolist() == [True, False, True, False, False, True]
    _, found = nearest_extrema(space, keypoints.assign(sign=-1), 1.2, 1.6)
    assert found.all()
    assert not nearest_extrema(space, keypoints.assign(sign=1))[1].any()


def test_cubes_have_room_around_extrema_above_the_octave():
    y, x = np.mgrid[:61, :61]
    blob = np.exp(-((y - 30) ** 2 + (x - 30) ** 2) / (2 * 3.1**2))
    space = dense_scale_space(blob, 0.8, 20, 1.1, KAPPA, "cosine")
    sigma = np.sqrt((3.1**2 - 0.8**2) / KAPPA)  # 2.67, beyond the octave's end at 2.2
    keypoint = pd.DataFrame({"keypoint": [0], "y": [30.0], "x": [30.0], "sigma": [2.2]})
    panels, samples = cubes_around(space, keypoint.assign(stability=0.1, sign=-1))
    assert panels["extremum"].item()
    middle = samples[(samples[["k_s", "k_y", "k_x"]] == 0).all(axis=1)]["value"].item()
    assert middle == samples["value"].min()
    s, _, _ = nearest_extrema(space, keypoint.assign(sign=-1))[0][0]
    assert space.sampling.sigma_min * 2 ** (s / 20) == pytest.approx(sigma, rel=0.02)


def test_cube_of_a_blob_is_centred_on_its_extremum(blob_space):
    sigma = np.sqrt((1.9**2 - 0.8**2) / KAPPA)  # standard deviation before the camera / sqrt(kappa)
    keypoint = pd.DataFrame({"keypoint": [0], "y": [20.0], "x": [20.0], "sigma": [sigma]})
    keypoint = keypoint.assign(stability=1.0, sign=-1)  # a bright blob is a minimum
    panels, samples = cubes_around(blob_space, keypoint)
    assert panels["extremum"].item()
    assert len(samples) == 25**3
    middle = samples[(samples[["k_s", "k_y", "k_x"]] == 0).all(axis=1)]["value"].item()
    assert middle == samples["value"].min()
    assert middle < panels["level"].item() < samples["value"].max()
    assert 1 <= panels["condition"].item() < 20


def test_cube_without_an_extremum_is_centred_on_the_keypoint(blob_space):
    keypoint = pd.DataFrame({"keypoint": [0], "y": [20.0], "x": [20.0], "sigma": [1.6]})
    panels, samples = cubes_around(blob_space, keypoint.assign(stability=0.1, sign=1))
    assert not panels["extremum"].item()
    middle = samples[(samples[["k_s", "k_y", "k_x"]] == 0).all(axis=1)]["value"].item()
    centre = np.rint(places(blob_space, keypoint)).astype(int)[0]
    there = blob_space.neighbourhoods(*centre[:, None])[0, 1, 1, 1]
    assert middle == pytest.approx(there, rel=1e-12)


def test_cubes_are_drawn_only_where_they_fit(blob_space):
    n = 200
    draw = np.random.default_rng(2)
    keypoints = pd.DataFrame(
        {
            "keypoint": np.arange(n),
            "y": draw.uniform(0, 40, n),
            "x": draw.uniform(0, 40, n),
            "sigma": 1.1 * 2 ** draw.uniform(0, 1, n),
            "stability": draw.choice([0.1, 0.5, 1.0], n),
        }
    )
    chosen = drawn(keypoints, blob_space, 0.8, 0.2, per_group=10)
    assert chosen["group"].tolist() == ["stable"] * 10 + ["unstable"] * 10
    assert (chosen["stability"] == [1.0] * 10 + [0.1] * 10).all()
    centre = np.rint(places(blob_space, chosen))
    assert (centre >= HALF).all() and (centre + HALF < blob_space.shape).all()
    again = drawn(keypoints.sample(frac=1, random_state=3), blob_space, 0.8, 0.2, per_group=500)
    assert set(chosen["keypoint"]) <= set(again["keypoint"])
    with pytest.raises(InputError, match="no unstable keypoint"):
        drawn(keypoints[keypoints["stability"] > 0.2], blob_space, 0.8, 0.2, per_group=5)


def test_drawn_keypoints_are_the_most_stable_first_and_of_the_same_by_their_numbers(blob_space):
    n = 40
    keypoints = pd.DataFrame(
        {
            "keypoint": np.arange(n)[::-1],
            "y": 20.0,
            "x": 20.0,
            "sigma": 1.6,
            "stability": np.tile([0.1, 0.85, 0.0, 1.0], n // 4),
        }
    )
    chosen = drawn(keypoints, blob_space, 0.8, 0.2, per_group=8)
    for _, group in chosen.groupby("group"):
        ranked = list(zip(-group["stability"], group["keypoint"], strict=True))
        assert ranked == sorted(ranked) and group["stability"].nunique() == 2
