"""Tables that claims are judged by: pieces of the scene, paired differences, edges, kernels."""

from __future__ import annotations

import math

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from keystab.camera.views import ViewSpec
from keystab.evaluation.localization import mean_localization
from keystab.evaluation.roc import area_under_curve, areas_above
from keystab.evaluation.scene_pieces import SIDE, count_ratios, piece_numbers, ratio_intervals
from keystab.experiments.blur_errors import blur_error_table
from keystab.experiments.filtered_keypoints import edge_spreads, kept_by_filters
from keystab.experiments.kappa_stability import scale_slopes
from keystab.experiments.sampling_stability import (
    count_sampling,
    keypoints_of_samplings,
    ratio_columns,
)
from keystab.experiments.sampling_theory import kernel_distances, sampling_theory
from keystab.experiments.view_differences import (
    QUANTITIES,
    Choice,
    difference_table,
    pairs_of_choices,
)
from keystab.experiments.view_stability import MatchedViews, scale_table
from keystab.matching.common_range import CommonRange
from keystab.parameters import Scales, Semigroup

SAME = {"space_tolerance": 1.0, "scale_ratio": 2**0.5, "match_sign": False}
rng = np.random.default_rng(17)


def places(n: int, size: float = 320.0) -> pd.DataFrame:
    return pd.DataFrame(rng.uniform(0, size, (n, 2)), columns=["y", "x"])


# Pieces of the scene


def test_pieces_are_squares_that_tables_share():
    one = pd.DataFrame({"y": [0.0, SIDE - 0.1, SIDE], "x": [0.0, 0.0, 0.0]})
    first, second = piece_numbers([one, one[2:]])
    assert first[0] == first[1] != first[2] == second[0]
    assert piece_numbers([one[:0], one[:0]])[0].shape == (0,)


def test_a_table_is_as_large_as_itself_in_every_resample():
    table = places(200)
    ratios, samples = count_ratios([table, table[:50]], reference=0, n_resamples=40)
    assert ratios.tolist() == [1.0, 0.25] and (samples[:, 0] == 1).all()
    assert samples[:, 1].std() > 0


def test_a_share_of_points_varies_as_a_binomial():
    """Points of a Poisson field, each kept with chance 0.3: the ratio's spread is that of a share."""
    table = places(3000, 1600.0)
    kept = table[rng.random(len(table)) < 0.3]
    columns = ratio_intervals([kept, table], 1, "ratio", "ends", "test")
    width = columns["high_ends"][0] - columns["low_ends"][0]
    assert width == pytest.approx(2 * 1.96 * math.sqrt(0.3 * 0.7 / 3000), rel=0.15)


def extrema(n: int) -> pd.DataFrame:
    hessian = {f"h_{name}": rng.normal(size=n) for name in ("ss", "yy", "xx", "sy", "sx", "yx")}
    return places(n).assign(sigma=1.5, sign=1, **hessian)


def test_ratios_of_samplings_are_to_sifts_and_missing_without_it():
    counted = []
    for n_spo, delta_min, n in ((3, 0.5, 80), (5, 0.3, 120)):
        table = extrema(n)
        one = count_sampling(table, table[: n // 2], SAME)
        numbers = {"n_spo": n_spo, "delta_min": delta_min, "balanced": False} | one.numbers
        counted.append(one._replace(numbers=numbers))
    table = ratio_columns(counted)
    assert table["extrema_ratio"].tolist() == [1.0, 1.5] == table["common_ratio"].tolist()
    assert (table["low_extrema"] <= table["extrema_ratio"]).all()
    assert table["low_extrema"][0] == table["high_extrema"][0] == 1.0
    medians = [one.numbers["median_condition"] for one in counted]
    assert ((table["low_condition"] < medians) & (medians < table["high_condition"])).all()
    assert ratio_columns(counted[1:])["extrema_ratio"].isna().all()


def test_a_range_that_halves_all_samplings_alike_reduces_no_ratio():
    """Half of the extrema are comparable at two samplings, a quarter at the third."""
    counted = []
    for n_spo, delta_min, n, kept in ((3, 0.5, 400, 200), (5, 0.3, 600, 300), (7, 0.2, 600, 150)):
        table = extrema(n)
        one = count_sampling(table, table[:kept], SAME)
        numbers = {"n_spo": n_spo, "delta_min": delta_min, "balanced": False} | one.numbers
        counted.append(one._replace(numbers=numbers))
    table = ratio_columns(counted)
    assert table["range_drop"].tolist() == [0.0, 0.0, 0.75]
    assert table["low_range"][0] == table["high_range"][0] == 0.0
    assert table["low_range"][1] < 0 < table["high_range"][1]
    assert 0 < table["low_range"][2] < 0.75 < table["high_range"][2]
    assert ratio_columns(counted[1:])["range_drop"].isna().all()


def test_changes_count_how_often_a_keypoint_comes_or_goes():
    """One keypoint seen by samplings 3, 5 and 6 of five, another by all."""
    steady = [{"y": 9.0, "x": 9.0, "n_spo": n} for n in range(3, 8)]
    table = pd.DataFrame(steady + [{"y": 2.0, "x": 2.0, "n_spo": n} for n in (3, 5, 6)])
    matched = keypoints_of_samplings(table.assign(sigma=1.5, sign=1), range(3, 8), SAME)
    assert matched.keypoints["n_changes"].tolist() == [3, 0]


# Paired differences


def views_of(seen: np.ndarray) -> MatchedViews:
    """Keypoints a long way from each other, seen where `seen` says."""
    rows, views = np.nonzero(seen)
    common = pd.DataFrame({"view": views, "y": 40.0 * rows, "x": 3.0, "sigma": 1.5})
    found = np.full(seen.shape, -1, dtype=np.intp)
    found[rows, views] = np.arange(len(rows))
    return MatchedViews(common, found, 0)


def labels(detections="refined", max_offset=0.6, max_iterations=2.0, n_spo=3):
    if detections == "discrete":
        max_offset = max_iterations = math.nan
    return {
        "n_spo": n_spo,
        "detections": detections,
        "max_offset": max_offset,
        "max_iterations": max_iterations,
    }


SEEN = rng.random((60, 8)) < 0.9
SEEN[:, 0] = True


def test_choices_are_paired_with_what_they_are_compared_with():
    choices = [
        Choice(labels(kind, offset, models, n_spo), views_of(SEEN))
        for n_spo in (3, 15)
        for kind, offset, models in (
            ("discrete", 0, 0), ("refined", 0.6, 2.0), ("refined", 1.0, 2.0), ("refined", 1.0, math.inf),
        )
    ]  # fmt: skip
    pairs = pairs_of_choices(choices, (0.6, 2))
    named = [(pair.one.labels["n_spo"], pair.against) for pair in pairs]
    assert named.count((3, "usual")) == named.count((15, "usual")) == 3  # not with itself
    assert named.count((3, "usual at 15")) == 4 and named.count((15, "usual at 15")) == 3
    twos = [pair for pair in pairs if pair.against == "two"]
    assert [pair.other.labels["max_iterations"] for pair in twos] == [2.0, 2.0]
    assert {pair.other.labels["max_offset"] for pair in twos} == {1.0}


def test_parts_of_a_set_are_compared_each_by_itself():
    kinds = [labels(), labels("discrete")]
    choices = [Choice({"tilt": tilt, **kind}, views_of(SEEN[:, :n])) for tilt, n in ((5, 8), (40, 6)) for kind in kinds]  # fmt: skip
    pairs = pairs_of_choices(choices, (0.6, 2))
    assert all(pair.one.labels["tilt"] == pair.other.labels["tilt"] for pair in pairs)
    table = difference_table(pairs, 20)
    assert (table["difference"] == 0).all() and table["tilt"].tolist().count(40) == 10


def differences(one: np.ndarray, other: np.ndarray, n_resamples: int = 200) -> pd.DataFrame:
    choices = [Choice(labels(), views_of(other)), Choice(labels("discrete"), views_of(one))]
    table = difference_table(pairs_of_choices(choices, (0.6, 2)), n_resamples)
    return table[table["against"] == "usual"].set_index("quantity")


def test_the_same_keypoints_differ_by_nothing_in_no_resample():
    table = differences(SEEN, SEEN)
    assert list(table.index) == list(QUANTITIES)
    assert (table[["difference", "low", "high"]] == 0).all(axis=None)


def test_differences_are_those_of_the_shares():
    fewer = SEEN.copy()
    fewer[:20, 1] = False
    table = differences(fewer, SEEN)
    shares = fewer.all(axis=1).mean(), SEEN.all(axis=1).mean()
    found = table.loc["share_always"]
    assert (found["value"], found["other"]) == pytest.approx(shares)
    assert found["difference"] == pytest.approx(shares[0] - shares[1])
    assert found["low"] < found["difference"] < found["high"] < 0
    relative = fewer.all(axis=1).sum() / SEEN.all(axis=1).sum() - 1
    assert table.loc["relative_n_always", "difference"] == pytest.approx(relative)
    assert table.loc["mean_stability", "difference"] == pytest.approx(fewer.mean() - SEEN.mean())


def test_a_difference_is_surer_than_the_shares_that_it_is_of():
    """What hits both alike, here pieces and views, does not count."""
    table = differences(np.where(rng.random(SEEN.shape) < 0.02, ~SEEN, SEEN), SEEN)
    width = table.loc["mean_stability", "high"] - table.loc["mean_stability", "low"]
    error = 1.96 * SEEN.mean(axis=1).std() / math.sqrt(len(SEEN))
    assert width < 2 * error


def test_steps_are_those_of_the_percentages_and_paired():
    """Octaves that hold the same keypoints differ by nothing, however they are drawn."""
    views = [ViewSpec(1.1, 1.0, (2500, 40)) for _ in range(8)]
    table = views_of(SEEN).common.assign(sigma=np.where(np.arange(SEEN.sum()) < 200, 2.0, 3.5))
    everywhere = CommonRange(views, (2500, 40), 0.0, 0.0)
    found = scale_table(table.assign(x=20.0), everywhere, [1.8, 1.9, 2.2], SAME, 0.7, {}, 60)
    assert found["step"].isna().tolist() == [True, False, False]
    assert found["step"][2] == pytest.approx(np.diff(found["percentage_seen"])[1])
    assert (found.loc[1, ["step", "low_step", "high_step"]] == 0).all()
    assert found["low_step"][2] < found["step"][2] < found["high_step"][2]


def test_areas_above_are_differences_of_areas_on_the_same_keypoints():
    n = 300
    names = np.where(np.arange(n) < n // 2, "stable", "unstable")
    good = rng.normal(size=n) + (names == "stable")
    features = pd.DataFrame(
        {"good": good, "same": 3 * good, "bad": -good, "noise": rng.normal(size=n)}
    )
    directions = {"good": 1, "same": 1, "bad": 1, "noise": 1}
    table = areas_above(features, names, directions, "good", n_resamples=200)
    for row, name in enumerate(directions):
        groups = (features.loc[names == kind, name] for kind in ("stable", "unstable"))
        area = area_under_curve(*groups)
        whole = area_under_curve(
            *(features.loc[names == k, "good"] for k in ("stable", "unstable"))
        )
        assert table["above"][row] == pytest.approx(area - whole)
    assert (table.loc[1, ["above", "low_above", "high_above"]] == 0).all()
    assert table.loc[3, "high_above"] < 0


# Edges, filters, chance


def test_a_keypoint_that_slides_along_an_edge_is_seen_to():
    """An edge at 30 degrees: curved across only, and detections scatter along it."""
    turn = math.radians(30)
    along, across = (
        np.array([math.sin(turn), math.cos(turn)]),
        np.array([math.cos(turn), -math.sin(turn)]),
    )
    hessian = -(0.02 * np.outer(along, along) + 1.0 * np.outer(across, across))
    rows = []
    for keypoint in range(40):
        curved = hessian if keypoint < 20 else -np.eye(2)
        for view in range(16):
            scatter = rng.normal(0, 0.2) * along + rng.normal(0, 0.01) * across
            y, x = np.array([20.0 * keypoint, 5.0]) + (
                scatter if keypoint < 20 else 0.05 * rng.normal(size=2)
            )
            rows.append(
                {
                    "view": view,
                    "y": y,
                    "x": x,
                    "h_yy": curved[0, 0],
                    "h_xx": curved[1, 1],
                    "h_yx": curved[0, 1],
                }
            )
    matched = MatchedViews(pd.DataFrame(rows), np.arange(640).reshape(40, 16), 0)
    edge, other = edge_spreads(matched, 10.0).to_dict("records")
    assert (edge["group"], edge["n_keypoints"]) == ("edge", 20)
    assert edge["along"] == pytest.approx(0.2, rel=0.15) and edge["across"] == pytest.approx(
        0.01, rel=0.15
    )
    assert (
        other["along"] == pytest.approx(0.05, rel=0.15) == pytest.approx(other["across"], rel=0.2)
    )
    assert edge["low_along"] < edge["along"] < edge["high_along"]


def test_without_keypoints_edges_have_no_spread():
    nothing = pd.DataFrame(
        {name: [] for name in ("view", "y", "x", "h_yy", "h_xx", "h_yx")}, dtype=float
    )
    table = edge_spreads(MatchedViews(nothing, np.empty((0, 4), dtype=np.intp), 0), 10.0)
    assert table["n_keypoints"].tolist() == [0, 0] and table["along"].isna().all()


def test_a_filter_that_keeps_all_keeps_all():
    counts = pd.DataFrame({"n_unique": [10], "n_always": [10]})
    kept = kept_by_filters([counts, counts])
    assert kept["kept_always"].tolist() == [1.0, 1.0] and kept["kept_others"].isna().all()


def test_chance_finds_as_many_as_the_density_says():
    """Points at random: found within a square of 2 px with chance 1 - exp(-4 n / area)."""
    field = places(2000, 200.0).assign(sigma=1.5, sign=1)
    other = places(2000, 200.0).assign(sigma=1.5, sign=1)
    table = pd.concat([field.assign(view=0), other.assign(view=1)], ignore_index=True)
    ranges = {"all": (1.0, 2.0), "none": (5.0, 6.0)}
    found = blur_error_table(table, [0.7, 0.8], 0.7, 2 ** (1 / 3), ranges, SAME)
    expected = 1 - math.exp(-4 * 2000 / 200**2)
    row = found[(found["blur"] == 0.8) & (found["scales"] == "all")].iloc[0]
    assert row["share_chance"] == pytest.approx(expected, abs=0.01)
    assert row["low_chance"] < row["share_chance"] < row["high_chance"]
    assert row["share_found"] == pytest.approx(expected, abs=0.04)
    same = found[(found["blur"] == 0.7) & (found["scales"] == "all")].iloc[0]
    assert same["share_found"] == 1 and same["share_chance"] == pytest.approx(expected, abs=0.02)
    assert found.loc[found["scales"] == "none", "share_chance"].isna().all()


# Scales, medians, kernels


@given(st.floats(-1.5, 1.5), st.integers(0, 2**20 - 1))
def test_slopes_are_those_of_power_laws(exponent, pattern):
    kappas = np.linspace(1.05, 1.4, 20)
    sigma = 1.7 * kappas ** (exponent + 0.5)
    seen = (pattern >> np.arange(20)) & 1 == 1
    (slope,) = scale_slopes(np.where(seen, sigma, np.nan)[None], kappas)
    if seen.sum() < 10:
        assert math.isnan(slope)
    else:
        assert slope == pytest.approx(exponent, abs=1e-9)


def test_the_median_of_precision_has_an_interval():
    table = pd.DataFrame(rng.normal(0, 0.1, (400, 2)), columns=["y", "x"]).assign(sigma=1.5)
    found = mean_localization(table, np.arange(400).reshape(100, 4))
    row = found.loc["location"]
    assert row["low_median"] < row["median"] < row["high_median"]


def test_distances_of_kernels_are_those_of_their_densities():
    """Hellinger's integral, by sums over a fine grid."""
    sigma, step, aside = 1.4, 0.3, 0.5
    x = np.linspace(-12, 12, 4801)

    def density(width, centre=0.0):
        return np.exp(-0.5 * ((x - centre) / width) ** 2) / (width * math.sqrt(2 * math.pi))

    def overlap(one, other):
        return float(np.sqrt(one * other).sum() * (x[1] - x[0]))

    found = kernel_distances(sigma, step, aside)
    moved = overlap(density(sigma), density(sigma, aside))
    wider = overlap(density(sigma), density(sigma + step))
    assert found["moved_1d"] == pytest.approx(math.sqrt(1 - moved)) == found["moved_2d"]
    assert found["widened_1d"] == pytest.approx(math.sqrt(1 - wider))
    assert found["widened_2d"] == pytest.approx(math.sqrt(1 - wider**2))


def test_blur_added_falls_with_n_spo_at_a_fixed_step_and_rises_on_balanced_grids():
    blurs = Semigroup(1.1, 10, 0.1, 1.5, 57, 4.0)
    table = sampling_theory([3, 9, 19], Scales(1.1, 2 ** (1 / 3)), (0.8, 0.5), blurs)
    fixed, balanced = (table[table["grid"] == grid] for grid in ("sift", "balanced"))
    assert (np.diff(fixed["increment"]) < 0).all() and (np.diff(balanced["increment"]) > 0).all()
    assert fixed["increment"].iloc[0] == pytest.approx(1.6 * math.sqrt(2 ** (2 / 3) - 1))
    assert (table["dct_error"] < 1e-6).all()
