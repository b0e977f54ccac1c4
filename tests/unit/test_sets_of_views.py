"""What is known on paper about keypoints across views of one scene."""

from __future__ import annotations

import math
from functools import cache
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import ndimage

from keystab.camera.common_field import (
    common_scales,
    in_common_field,
    to_common_frame,
    windows_of_common_field,
)
from keystab.camera.simulation import Scene, simulate
from keystab.camera.view_sets import (
    assumed_blur,
    expanded,
    members,
    per_view,
    view_shapes,
    view_specs,
)
from keystab.camera.views import ViewSpec, to_reference, to_view
from keystab.detection.detector import detect_keypoints
from keystab.detection.refinement import refined_keypoints
from keystab.detection.view_detector import Detector, detect_in_view
from keystab.experiments.view_stability import (
    count_table,
    curve_table,
    keypoints_of_views,
    localization_table,
    scale_table,
)
from keystab.matching.common_range import CommonRange
from keystab.matching.correspondence import matched
from keystab.parameters import ComparedInViews
from keystab.stages._compared import common_range

SAME = {"space_tolerance": 1.0, "scale_ratio": 2**0.5, "match_sign": False}
PLAIN = {
    "blur": 1.1, "step": 6.0, "shift_y": 0.0, "shift_x": 0.0, "rotation": 0.0, "noise": 0.0,
    "height": None, "width": None,
}  # fmt: skip


@cache
def scene() -> Scene:
    """Random grey values with detail at all the scales that one octave sees."""
    rng = np.random.default_rng(7)
    detail = sum(
        size * ndimage.gaussian_filter(rng.standard_normal((480, 600)), size, mode="reflect")
        for size in (3, 8, 14, 22)
    )
    return Scene((detail - detail.min()) / np.ptp(detail))


def searched(specs, n_spo, delta_min=None, n_oct=1, sigma_min=1.1, camera_blur=1.1):
    """Extrema and traces of all views, as the stage writes them."""
    extrema, traces, first = [], [], 0
    detector = Detector(camera_blur, n_spo, delta_min, sigma_min, n_oct=n_oct)
    for number, spec in enumerate(specs):
        found, models = detect_in_view(simulate(scene(), spec), detector)
        extrema.append(found.assign(view=number))
        traces.append(models.assign(keypoint=models["keypoint"] + first))
        first += len(found)
    return pd.concat(extrema, ignore_index=True), pd.concat(traces, ignore_index=True)


def refined(specs, n_spo, delta_min=None, **options):
    return refined_keypoints(*searched(specs, n_spo, delta_min, **options), 0.6, 2)


def in_view(table, number):
    columns = ["y", "x", "sigma"]
    view = table[table["view"] == number]
    return view.sort_values(columns)[columns].reset_index(drop=True)


# ---------------------------------------------------------------------------------------------
# Translations, zooms, rotations


@pytest.mark.parametrize(("n_spo", "delta_min"), [(3, 0.5), (6, 0.25)])
def test_whole_pixel_translations_leave_every_keypoint_in_place(n_spo, delta_min):
    specs = [ViewSpec(1.1, 6.0, (100, 120), shift) for shift in ((0.0, 0.0), (3.0, -5.0))]
    extrema, traces = searched(specs, n_spo, delta_min)
    everywhere = CommonRange(specs, scene().shape, 18.0, 1.1 * 2 ** (1 / 3))
    discrete = everywhere.common(extrema, "step_sigma")
    pd.testing.assert_frame_equal(in_view(discrete, 0), in_view(discrete, 1), rtol=0, atol=1e-12)
    keypoints = everywhere.common(refined_keypoints(extrema, traces, 0.6, 2))
    assert len(in_view(keypoints, 0)) > 30
    # What the views mirror at their borders is not the same; 18 px inside it is 1e-9 of the grey.
    pd.testing.assert_frame_equal(in_view(keypoints, 0), in_view(keypoints, 1), rtol=0, atol=1e-6)


def test_a_zoom_maps_positions_and_scales():
    views = {**PLAIN, "n_views": 2, "zoom": 1.5, "whole": True, "guard": 34}
    specs = view_specs("zooms", views, scene().shape)
    keypoints = refined(specs, 15, n_oct=2)
    low, high = common_scales(specs, 1.1, 2, 2 ** (1 / 3), None)
    common = CommonRange(specs, scene().shape, 34.0, low * 1.02, high / 1.02).common(keypoints)
    near, far = in_view(common, 0), in_view(common, 1)
    assert len(near) > 15
    close = matched(near, far, 0.05, 1.01, False)
    assert close.mean() > 0.9
    # Without the zoom nothing would fit.
    assert matched(near, far.assign(sigma=far["sigma"] / 1.5), 0.05, 1.01, False).mean() < 0.1


def test_quarter_turns_of_a_symmetric_grid_turn_every_keypoint():
    # With a step of one pixel grid, mirror and view turn into themselves.
    specs = [ViewSpec(1.1, 5.0, (96, 96), rotation=turn * math.pi / 2) for turn in range(4)]
    table = refined(specs, 4, 1.0, sigma_min=1.5)
    for number, spec in enumerate(specs):
        here = table["view"] == number
        y, x = to_common_frame(spec, specs[0], scene().shape, table["y"][here], table["x"][here])
        table.loc[here, "y"], table.loc[here, "x"] = y, x
    table[["y", "x"]] = table[["y", "x"]].round(7)
    assert len(in_view(table, 0)) > 40
    for number in (1, 2, 3):
        pd.testing.assert_frame_equal(in_view(table, 0), in_view(table, number), rtol=0, atol=1e-6)


def test_quarter_turns_of_any_grid_agree_within_the_sampling():
    specs = [ViewSpec(1.1, 6.0, (80, 80), rotation=turn * math.pi / 2) for turn in (0, 1)]
    everywhere = CommonRange(specs, scene().shape, 10.0, 1.45, 2.1)
    common = everywhere.common(refined(specs, 15))
    near, far = in_view(common, 0), in_view(common, 1)
    assert len(near) > 15
    assert matched(near, far, 0.05, 1.02, False).mean() > 0.9


def test_fine_sampling_is_markedly_more_stable_and_precise():
    views = {**PLAIN, "n_views": 8, "shift_spread": 0.5, "guard": 17}
    specs = view_specs("translations", views, scene().shape)
    everywhere = CommonRange(specs, scene().shape, 17.0, 1.1 * 2 ** (1 / 3))
    always, spread = {}, {}
    for n_spo in (3, 15):
        matching = keypoints_of_views(everywhere.common(refined(specs, n_spo)), len(specs), SAME)
        always[n_spo] = count_table(matching, {})["share_always"].item()
        spread[n_spo] = localization_table(matching, {}, 0.5, 0)["mean"].iloc[0]
    assert always[15] > always[3] + 0.15
    assert spread[15] < spread[3] / 4


# ---------------------------------------------------------------------------------------------
# Detection


@pytest.mark.parametrize("max_offset", [0.5, 0.6, 1.0, math.inf])
@pytest.mark.parametrize("max_iterations", [1, 2, 100])
def test_traces_decide_what_a_detection_would(max_offset, max_iterations):
    image = simulate(scene(), ViewSpec(1.1, 10.0, (48, 60)))
    options = {"max_offset": max_offset, "max_iterations": max_iterations}
    expected = detect_keypoints(image, 1.1, 5, **options)
    found = refined_keypoints(*detect_in_view(image, Detector(1.1, 5)), **options)
    names = ["y", "x", "sigma", "value", "sign", "s", "row", "column"]
    pd.testing.assert_frame_equal(found[names], expected[names], check_exact=True)


def test_octaves_meet_without_losing_or_doubling():
    image = simulate(scene(), ViewSpec(1.1, 6.0, (80, 100)))
    extrema, traces = detect_in_view(image, Detector(1.1, 6, n_oct=2))
    single = detect_keypoints(image, 1.1, 6, refine=False, n_oct=2)
    pd.testing.assert_frame_equal(
        extrema[["y", "x", "sigma", "octave"]], single[["y", "x", "sigma", "octave"]]
    )
    assert set(traces["keypoint"]) == set(range(len(extrema)))
    first = traces[traces["model"] == 1].set_index("keypoint")
    np.testing.assert_allclose(first["sigma"], extrema["step_sigma"], rtol=1e-12)


# ---------------------------------------------------------------------------------------------
# Sets


def test_views_do_not_depend_on_how_many_there_are():
    views = {**PLAIN, "shift_spread": 0.5, "rotation_spread": 1.0, "blur_spread": 0.4}
    few, many = (view_specs("some", {**views, "n_views": n}, (400, 500)) for n in (5, 32))
    assert many[:5] == few


def test_draws_are_spread_evenly_and_stay_within():
    views = {**PLAIN, "n_views": 32, "shift_spread": 0.5}
    values = per_view(views)
    values["blur"] = per_view({**PLAIN, "n_views": 32, "blur_spread": 0.4, "blur": 0.7})["blur"]
    for key, centre, spread in (("shift_y", 0, 0.5), ("shift_x", 0, 0.5), ("blur", 0.7, 0.4)):
        drawn = np.sort(values[key])
        assert abs(drawn - centre).max() < spread
        even = centre + spread * (2 * (np.arange(32) + 0.5) / 32 - 1)
        assert abs(drawn - even).max() < 0.2 * spread  # what 32 random numbers hardly reach
    pairs = np.column_stack([values["shift_y"], values["shift_x"]])
    cells = {tuple(cell) for cell in np.floor(4 * (pairs + 0.5)).astype(int)}
    assert len(cells) == 16


def test_sweeps_become_sets():
    sets = {"noise": {**PLAIN, "sweep": {"noise": [0.01, 0.15]}}, "still": {**PLAIN, "sweep": None}}
    names = expanded(sets)
    assert list(names) == ["noise_0p01", "noise_0p15", "still"]
    assert [names[one.name]["noise"] for one in members(sets, "noise")] == [0.01, 0.15]
    assert expanded(names) == names


def test_whole_views_show_the_whole_reference_at_every_zoom():
    views = {**PLAIN, "n_views": 3, "zoom": 2.0, "whole": True, "guard": 7}
    assert view_shapes(views, (480, 600)) == [(94, 114), (70, 84), (54, 64)]


@settings(max_examples=50, deadline=None)
@given(
    st.tuples(*[st.floats(-2, 2)] * 2),
    st.floats(-4, 4),
    st.floats(5, 20),
    st.tuples(*[st.floats(0, 60)] * 2),
)
def test_frames_are_inverse_to_each_other(shift, rotation, step, position):
    first = ViewSpec(1.1, 6.0, (80, 100))
    other = ViewSpec(1.1, step, (70, 60), shift, rotation)
    there = to_common_frame(other, first, (480, 600), *position)
    back = to_common_frame(first, other, (480, 600), *there)
    np.testing.assert_allclose(back, position, atol=1e-9)


def test_common_field_is_that_of_every_view_and_of_the_reference():
    specs = [ViewSpec(1.1, 10.0, (60, 80), (shift, 0.0)) for shift in (0.0, 8.0)]
    y = np.arange(60.0)
    inside = in_common_field(specs, (600, 800), 3, y, np.full(60, 40.0))
    # The second view begins 8 px lower and needs 3 px more; the first ends 3 px before its border.
    assert y[inside].min() == 11 and y[inside].max() == 56
    wide = [ViewSpec(1.1, 10.0, (80, 80))]
    beyond = in_common_field(wide, (600, 800), 0, [9.0, 10.0, 69.0, 70.0], np.full(4, 40.0))
    assert beyond.tolist() == [False, True, True, False]


# ---------------------------------------------------------------------------------------------
# Tables, from detections made by hand


def by_hand(n_views: int, jitter: float = 0.0) -> tuple[list[ViewSpec], pd.DataFrame]:
    """Ten keypoints in every view, of which the last five miss in the odd views."""
    specs = [ViewSpec(1.1, 10.0, (60, 80), (0.1 * k, -0.2 * k)) for k in range(n_views)]
    rows = []
    for k, spec in enumerate(specs):
        for i in range(10 if k % 2 == 0 else 5):
            moved = jitter * (-1) ** (k // 2)
            rows.append(
                {
                    "view": k,
                    "y": 20.0 + moved - spec.shift[0],
                    "x": 10.0 + 6 * i - spec.shift[1],
                    "sigma": 1.5 if i % 2 else 2.0,
                    "step_sigma": 1.5 if i % 2 else 2.0,
                }
            )
    return specs, pd.DataFrame(rows)


def test_counts_curves_and_precision_of_known_detections():
    specs, table = by_hand(8, jitter=0.03)
    matching = keypoints_of_views(CommonRange(specs, (600, 800), 3, 1.4).common(table), 8, SAME)
    counts = count_table(matching, {"n_spo": 3}).iloc[0]
    assert (counts["n_unique"], counts["n_always"], counts["gap"]) == (10, 5, 0)
    assert counts["mean_detections"] == 7.5 and counts["share_always"] == 0.5
    curve = curve_table(matching, {"n_spo": 3}, 100)
    expected = [100] * 4 + [50] * 4
    assert curve["percentage_of_unique"].tolist() == expected
    assert (curve["low"] <= curve["percentage_of_unique"]).all()
    spread = localization_table(matching, {"n_spo": 3}, 0.5, 100).set_index("quantity")
    # Half of the views lie 0.03 px above, half below: s^2 = m / (m - 1) 0.03^2, m = 8 and m = 4.
    known = 0.03 * (math.sqrt(8 / 7) + math.sqrt(4 / 3)) / 2
    assert spread["mean"]["location"] == pytest.approx(known, abs=1e-12)
    assert spread["mean"]["log2_sigma"] == pytest.approx(0, abs=1e-12)
    assert spread["low"]["location"] <= known <= spread["high"]["location"]


def test_scales_are_cut_in_the_frame_of_the_first_view():
    specs = [ViewSpec(1.1, step, (60, 80)) for step in (10.0, 20.0)]
    table = pd.DataFrame({"view": [0, 1, 1], "y": 29.5, "x": 39.5, "sigma": [2.0, 1.0, 0.5]})
    common = CommonRange(specs, (600, 800), 3, 1.5, 2.5).common(table)
    assert common[["view", "sigma"]].to_numpy().tolist() == [[0, 2.0], [1, 2.0]]


def test_stability_against_scale_counts_each_octave_by_itself():
    specs, table = by_hand(8)
    everywhere = CommonRange(specs, (600, 800), 3, 1.4)
    rows = scale_table(table, everywhere, [0.9, 1.8, 2.5], SAME, 0.7, {"noise": 0.1}, 100)
    # Keypoints 1, 3, 5, 7, 9 have scale 1.5, the others 2; 0 to 4 are in all views, the rest in half.
    assert rows["n_unique"].tolist() == [5, 5, 0]
    assert rows["n_seen"].tolist() == [2, 3, 0]
    assert (
        rows["percentage_seen"].tolist()[:2] == [40.0, 60.0] and rows["percentage_seen"].isna()[2]
    )
    assert rows["mean_above"].tolist() == [7.5, 4.0, 0.0]


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 10**6))
def test_windows_hold_the_common_field_and_touch_it(seed):
    rng = np.random.default_rng(seed)
    specs = [
        ViewSpec(1.1, rng.uniform(8, 12), (50, 70), tuple(rng.uniform(-3, 3, 2)), rng.uniform(0, 7))
        for _ in range(3)
    ]
    y, x = (grid.ravel() for grid in np.mgrid[0:50:0.1, 0:70:0.1])
    inside = in_common_field(specs, (640, 880), 5, y, x)
    assert inside.any()
    reference = to_reference(specs[0], (640, 880), y[inside], x[inside])
    for spec, (top, bottom, left, right) in zip(
        specs, windows_of_common_field(specs, (640, 880), 5), strict=True
    ):
        there_y, there_x = to_view(spec, (640, 880), *reference)
        assert top - 1e-6 <= there_y.min() <= top + 0.4
        assert bottom - 0.4 <= there_y.max() <= bottom + 1e-6
        assert left - 1e-6 <= there_x.min() <= left + 0.4
        assert right - 0.4 <= there_x.max() <= right + 1e-6


def test_views_without_a_common_field_have_empty_windows():
    specs = [ViewSpec(1.1, 10.0, (20, 20), (0.0, shift)) for shift in (0.0, 15.0)]
    for top, bottom, left, right in windows_of_common_field(specs, (200, 200), 3):
        assert bottom < top and right < left


@pytest.mark.parametrize("axis", [0, 1])
def test_the_common_field_begins_on_the_margin_of_each_view_and_ends_on_the_reference(axis):
    shape = (21, 33)
    large, small = ViewSpec(1.1, 2.0, shape), ViewSpec(1.1, 2.0, (15, 19))
    middle = [(size - 1) / 2 for size in shape]

    def inside(specs, reference, margin, at):
        position = list(middle)
        position[axis] = at
        return bool(in_common_field(specs, reference, margin, *position))

    far = (400, 500)  # the reference ends nowhere near: the smaller view decides
    half = (small.shape[axis] - 1) / 2 - 3.0
    for side in (-1, 1):
        for beyond, expected in ((0.0, True), (1e-6, False), (-1e-6, True)):
            at = middle[axis] + side * (half + beyond)
            assert inside([large, small], far, 3.0, at) == expected
    near = (30, 50)  # and here the reference does: its outermost pixels belong to it
    half = (near[axis] - 1) / 2 / 2.0
    for side in (-1, 1):
        for beyond, expected in ((-1e-9, True), (1e-6, False)):
            assert inside([large], near, 0.0, middle[axis] + side * (half + beyond)) == expected


@pytest.mark.parametrize(
    ("assumed", "spread", "expected"),
    [(None, 0.0, None), (None, 0.2, 0.7), (0.5, 0.0, 0.5), (0.5, 0.2, 0.5)],
)
def test_a_blur_is_assumed_where_it_is_given_or_spreads(assumed, spread, expected):
    assert assumed_blur({"blur": 0.7, "blur_spread": spread, "assumed_blur": assumed}) == expected


@pytest.mark.parametrize(
    ("guard", "border", "margin"), [(2, 3.0, 3.0), (5, 3.0, 5.0), (3, 3.0, 3.0)]
)
def test_the_larger_of_guard_band_and_border_is_left_out(guard, border, margin):
    views = SimpleNamespace(specs=[ViewSpec(1.1, 2.0, (20, 30))] * 2, reference_shape=(200, 200))
    asked = ComparedInViews(border, 1.26, 1.9, sigma_min=1.1, n_oct=1, guard=guard)
    found = common_range(views, asked)
    at = pd.DataFrame({"view": 0, "y": [margin, margin - 0.01], "x": 15.0, "sigma": 1.6})
    assert found.margin == margin and len(found.common(at)) == 1
    assert (found.low, found.high) == pytest.approx((1.1 * 1.26, 1.1 * 1.9))
