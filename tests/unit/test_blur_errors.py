"""Wrongly assumed blurs: shares and shifts that can be worked out by hand, and blobs that are seen."""

import numpy as np
import pandas as pd
import pytest
import scenes
from numpy.testing import assert_allclose

from keystab.detection.detector import detect_keypoints
from keystab.evaluation.intervals import wilson_interval
from keystab.experiments.blur_errors import blur_error_table

KAPPA, ASSUMED = 2 ** (1 / 3), 0.7
SAME = {"space_tolerance": 1.0, "scale_ratio": 2**0.5, "match_sign": False}
RANGE = {"octave": (1.4, 2.8)}


def keypoints(*views):
    """Keypoints of views, each a list of (y, x, sigma)."""
    rows = [(number, *point) for number, view in enumerate(views) for point in view]
    return pd.DataFrame(rows, columns=["view", "y", "x", "sigma"])


def in_a_row(*sigma):
    return [(0.0, 10.0 * k, s) for k, s in enumerate(sigma)]


def row_of(table, number):
    return table.iloc[number]


def test_the_view_of_the_assumed_blur_is_compared_with_itself():
    view = in_a_row(1.5, 1.7, 2.0)
    row = row_of(blur_error_table(keypoints(view), [0.7], ASSUMED, KAPPA, RANGE, SAME), 0)
    assert (row["error"], row["n_right"], row["n_view"]) == (0, 3, 3)
    assert row["share_found"] == row["share_right"] == 1
    for name in ("scale_shift", "q25_shift", "q75_shift", "blob_shift", "dilation_shift"):
        assert row[name] == 0


def test_lost_and_wrong_keypoints_are_counted_with_their_intervals():
    right, view = in_a_row(1.5, 1.7, 2.0, 2.2), in_a_row(1.5, 1.7)
    view += [(50.0, 50.0, 1.6), (50.0, 70.0, 1.6), (50.0, 90.0, 1.6)]
    table = blur_error_table(keypoints(right, view), [0.7, 0.9], ASSUMED, KAPPA, RANGE, SAME)
    row = row_of(table, 1)
    assert (row["blur"], row["n_right"], row["n_view"]) == (0.9, 4, 5)
    assert row["error"] == pytest.approx(0.2)
    assert (row["share_found"], row["share_right"]) == (2 / 4, 2 / 5)
    assert (row["low_found"], row["high_found"]) == wilson_interval(2, 4)
    assert (row["low_right"], row["high_right"]) == wilson_interval(2, 5)


@pytest.mark.parametrize("blur", [0.4, 1.0])
def test_keypoints_that_move_as_blobs_do_show_that_shift(blur):
    sigma = np.array([1.5, 1.7, 2.0, 2.2, 2.6])
    moved = np.sqrt(sigma**2 + (blur**2 - ASSUMED**2) / KAPPA)
    both = keypoints(in_a_row(*sigma), in_a_row(*moved))
    row = row_of(blur_error_table(both, [0.7, blur], ASSUMED, KAPPA, RANGE, SAME), 1)
    shift = np.log2(moved / sigma)
    assert_allclose(row["scale_shift"], shift[2], rtol=1e-12)
    assert_allclose(row["blob_shift"], shift[2], rtol=1e-12)
    ends = sorted(np.quantile(shift, [0.25, 0.75]))
    assert_allclose(sorted(row[["q25_shift", "q75_shift"]]), ends, rtol=1e-12)
    dilated = np.log2(np.sqrt(2.0**2 + ASSUMED**2 - blur**2) / 2.0)
    assert_allclose(row["dilation_shift"], dilated, rtol=1e-12)
    assert row["dilation_shift"] * row["blob_shift"] < 0


def test_what_moves_across_the_end_of_a_range_is_not_lost():
    both = keypoints([(0.0, 0.0, 1.45)], [(0.0, 0.0, 1.35)])
    row = row_of(blur_error_table(both, [0.7, 0.5], ASSUMED, KAPPA, RANGE, SAME), 1)
    assert (row["n_right"], row["share_found"], row["n_view"]) == (1, 1, 0)
    assert row["scale_shift"] == pytest.approx(np.log2(1.35 / 1.45))


def test_pairs_are_nearest_in_space_and_mutual():
    right = [(0.0, 0.0, 2.0), (0.8, 0.0, 1.6)]
    view = [(0.1, 0.0, 2.4), (0.5, 0.0, 2.0)]  # the first is nearer, the second has the scale
    row = row_of(
        blur_error_table(keypoints(right, view), [0.7, 0.9], ASSUMED, KAPPA, RANGE, SAME), 1
    )
    assert_allclose(row["scale_shift"], (np.log2(2.4 / 2.0) + np.log2(2.0 / 1.6)) / 2)


def test_scales_that_do_not_exist_have_no_shift():
    both = keypoints(in_a_row(1.5, 1.6), in_a_row(1.5, 1.6))
    row = row_of(blur_error_table(both, [0.7, 1.9], ASSUMED, KAPPA, RANGE, SAME), 1)
    assert 1.9**2 - ASSUMED**2 > 1.5**2
    assert np.isnan(row["dilation_shift"]) and row["blob_shift"] > 0


def test_views_without_keypoints_and_empty_ranges_are_counted_as_such():
    both = keypoints(in_a_row(1.5), [])
    ranges = {"octave": (1.4, 2.8), "next": (2.8, 5.6)}
    table = blur_error_table(both, [0.7, 0.9], ASSUMED, KAPPA, ranges, SAME)
    assert table["scales"].tolist() == ["octave", "next"] * 2
    lost = row_of(table, 2)
    assert (lost["share_found"], lost["n_view"]) == (0, 0)
    assert np.isnan([lost["share_right"], lost["scale_shift"], lost["blob_shift"]]).all()
    assert np.isnan(row_of(table, 1)["share_found"])


def test_blobs_that_are_seen_move_as_the_closed_form_says():
    # Well apart, between whole pixels, of sizes whose scales stay inside the octave.
    blurs, size = (0.7, 0.3, 0.5, 0.9, 1.1), np.linspace(1.75, 2.3, 9)
    centre = 20 + 32 * np.array(np.unravel_index(np.arange(9), (3, 3))).T
    centre = centre + np.random.default_rng(1).uniform(-0.5, 0.5, centre.shape)
    parts = []
    for number, blur in enumerate(blurs):
        wide = np.hypot(size, blur)
        image = sum(
            (s / w) ** 2 * scenes.blob((104, 104), place, w)
            for s, w, place in zip(size, wide, centre, strict=True)
        )
        found = detect_keypoints(image, ASSUMED, n_spo=9)
        # Between the blobs, their tails meet and make weak extrema of their own.
        apart = abs(found[["y", "x"]].to_numpy()[:, None] - centre).max(axis=2)
        parts.append(found[apart.min(axis=1) < 0.5].assign(view=number))
    table = blur_error_table(
        pd.concat(parts), blurs, ASSUMED, KAPPA, {"octave": (1.3, 2.3)}, SAME
    ).set_index("blur")
    assert (table["n_right"] == 9).all() and (table["n_view"] == 9).all()
    assert (table[["share_found", "share_right"]] == 1).all(axis=None)
    # Sampling and refinement leave 0.0001 octaves at 9 scales per octave.
    assert_allclose(table["scale_shift"], table["blob_shift"], atol=0.0005)
    assert abs(table["blob_shift"].drop(0.7)).min() > 0.02
    assert (np.sign(table["dilation_shift"]) == -np.sign(table["blob_shift"])).all()
