"""What moves across an end of the compared range: lost with hard ends, a counterpart with soft ones."""

import numpy as np
import pandas as pd
from hypothesis import given, settings
from hypothesis import strategies as st

from keystab.camera.views import ViewSpec
from keystab.evaluation.stability import new_and_lost
from keystab.experiments.kappa_stability import kappa_tables
from keystab.experiments.sampling_stability import keypoints_of_samplings
from keystab.experiments.view_stability import count_table, keypoints_of_views
from keystab.matching.common_range import CommonRange, compared, in_range

SHAPE = (60, 60)


def scales(*rows):
    """Detections at one place of each keypoint: rows of scales by n_spo."""
    table = [(n, 10.0 * k + 9, 20.0, s, 1) for k, row in enumerate(rows) for n, s in row.items()]
    return pd.DataFrame(table, columns=["n_spo", "y", "x", "sigma", "sign"])


def test_a_keypoint_that_moves_across_the_end_is_not_lost_with_soft_ends():
    # One well within the range, and one that lies below its end of 1.26 at one of two samplings.
    table = scales({3: 2.0, 4: 2.0}, {3: 1.25, 4: 1.27})
    for soft, new, stability in ((False, 1, [0.5, 1.0]), (True, 0, [1.0, 1.0])):
        found = in_range(table, "sigma", SHAPE, 1.0, soft, 1.26)
        assert compared(found).sum() == 3  # what is counted is the same
        rates = new_and_lost(found, set_column="n_spo").set_index("n_spo")
        assert rates["n_detections"].tolist() == [1, 2] and rates.loc[4, "n_new"] == new
        matched = keypoints_of_samplings(found, [3, 4], {})
        assert len(matched.keypoints) == 2
        assert sorted(matched.keypoints["stability"]) == stability


def test_views_count_what_lies_within_and_match_what_lies_beyond():
    views = [ViewSpec(1.1, 1.0, SHAPE)] * 2
    table = scales({0: 2.0, 1: 2.1}, {0: 4.1, 1: 3.9}).rename(columns={"n_spo": "view"})
    counts = []
    for soft in (False, True):
        everywhere = CommonRange(views, SHAPE, 3.0, 1.5, 4.0, soft)
        matched = keypoints_of_views(everywhere.common(table), 2, {})
        counts.append(count_table(matched, {}).iloc[0])
    hard, soft = counts
    assert hard["mean_detections"] == soft["mean_detections"] == 1.5
    assert (hard["n_unique"], hard["n_always"]) == (2, 1)
    assert (soft["n_unique"], soft["n_always"]) == (2, 2)


def test_ratios_find_counterparts_beyond_the_common_normalised_scales():
    table = scales({1.1: 1.5, 1.2: 1.5}, {1.1: 2.05, 1.2: 2.05}).rename(columns={"n_spo": "kappa"})
    hard, soft = (kappa_tables(table, [1.1, 1.2], 3, 1.0, SHAPE, 3.0, {}, s) for s in (False, True))
    assert hard.counts.equals(soft.counts)
    # 2.05 sqrt(1.1) lies beyond 2 sqrt(1.1), with both; 1.5 within.
    assert hard.keypoints["stability"].tolist() == soft.keypoints["stability"].tolist() == [1.0]


@settings(max_examples=25)
@given(st.integers(0, 2**32), st.floats(1.1, 1.6))
def test_soft_ends_lose_nothing_that_hard_ends_keep(seed, first):
    draw = np.random.default_rng(seed)
    n = 80
    table = pd.DataFrame(
        {
            "n_spo": draw.integers(3, 6, n),
            "y": draw.uniform(0, 60, n),
            "x": draw.uniform(0, 60, n),
            "sigma": 2 ** draw.uniform(0, 1.5, n),
            "sign": 1,
        }
    )
    hard, soft = (in_range(table, "sigma", SHAPE, 1.0, s, first, 3.0, 2.2) for s in (False, True))
    assert hard.equals(soft[compared(soft)].drop(columns="beyond"))
    one, other = (
        new_and_lost(t, 6.0, 1.4, set_column="n_spo", sets=[3, 4, 5]) for t in (hard, soft)
    )
    assert (one["n_detections"] == other["n_detections"]).all()
    for name in ("n_new", "n_lost"):
        assert (other[name].dropna() <= one[name].dropna()).all()
