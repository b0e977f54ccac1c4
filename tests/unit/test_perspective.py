"""Planes seen from the side, against closed forms and sums of the series itself."""

import math

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from keystab.camera import perspective
from keystab.camera.common_field import (
    in_common_field,
    searched_windows,
    to_common_frame,
    windows_of_common_field,
    zoom_to_common_frame,
    zooms_in_common_field,
)
from keystab.camera.simulation import Scene, simulate, simulate_view
from keystab.camera.view_sets import view_specs
from keystab.camera.views import ViewSpec, local_step, to_reference, to_view
from keystab.errors import InputError
from keystab.experiments.view_stability import of_views, parts_by
from keystab.io.view_store import Views, write_views
from keystab.scalespace import cosine_series
from keystab.truth.scene_extrema import scene_extrema

STRAIGHT = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
tilts = st.tuples(st.floats(0, 60), st.floats(-180, 180), st.floats(300, 3000))


@given(tilts, st.floats(-100, 100), st.floats(-100, 100))
def test_a_place_of_the_plane_is_seen_where_a_pinhole_sees_it(camera, down, right):
    tilt, azimuth, focal = camera
    there = perspective.to_plane(perspective.tilted(*camera), down, right)
    theta, turn = math.radians(tilt), math.radians(azimuth)
    # Along the direction in which the plane recedes, and across; the camera f before its centre.
    along = there[0] * math.sin(turn) + there[1] * math.cos(turn)
    across = there[1] * math.sin(turn) - there[0] * math.cos(turn)
    depth = focal + along * math.sin(theta)
    u, v = focal * along * math.cos(theta) / depth, focal * across / depth
    np.testing.assert_allclose(u, down * math.sin(turn) + right * math.cos(turn), atol=1e-9)
    np.testing.assert_allclose(v, right * math.sin(turn) - down * math.cos(turn), atol=1e-9)


@given(tilts, st.floats(-100, 100), st.floats(-100, 100))
def test_the_inverse_leads_back_and_areas_are_those_of_small_squares(camera, down, right):
    there = perspective.tilted(*camera)
    place = perspective.to_plane(there, down, right)
    back = perspective.to_plane(perspective.inverse(there), *place)
    np.testing.assert_allclose(back, (down, right), atol=1e-8)
    h = 1e-4
    (by, bx), (ey, ex) = (
        np.subtract(
            perspective.to_plane(there, down + h * a, right + h * b),
            perspective.to_plane(there, down - h * a, right - h * b),
        )
        / (2 * h)
        for a, b in ((1, 0), (0, 1))
    )
    area = abs(by * ex - bx * ey)
    np.testing.assert_allclose(perspective.zoom(there, down, right) ** 2, area, rtol=1e-6)
    least, most = perspective.stretch(there, down, right)
    np.testing.assert_allclose(least * most, area, rtol=1e-6)
    assert least <= np.hypot(by, bx) * (1 + 1e-6) and np.hypot(by, bx) <= most * (1 + 1e-6)


@pytest.mark.parametrize("matrix", [np.zeros((3, 3)), np.eye(2), np.full((3, 3), np.nan), "abc"])
def test_what_is_no_homography_is_refused(matrix):
    with pytest.raises(InputError, match="homography"):
        simulate_view(np.ones((8, 8)), 1.0, 1.0, (4, 4), homography=matrix)


def test_the_horizon_is_refused_and_what_lies_beyond_is_seen_nowhere():
    with pytest.raises(InputError, match="horizon"):
        ViewSpec(1.1, 2.0, (40, 40), homography=perspective.tilted(80, 0, 30))
    with pytest.raises(InputError, match="tilt is 90"):
        perspective.tilted(90, 0, 30)
    spec = ViewSpec(1.1, 1.0, (9, 9), homography=perspective.tilted(60, 0, 30))
    y, x = to_view(spec, (201, 201), 100.0, [100.0, 10.0])  # the second is behind the camera
    np.testing.assert_allclose((y[0], x[0]), (4.0, 4.0))
    assert np.isnan(x[1]) and not in_common_field([spec], (201, 201), 0.0, np.nan, np.nan)
    with pytest.raises(InputError, match="from the side"):
        scene_extrema(np.eye(20), spec)


@pytest.mark.parametrize(("blur", "step"), [(1.1, 5.0), (0.5, 3.0), (0.8, 1.0)])
def test_looking_straight_is_the_plain_camera(blur, step):
    scene = Scene(np.random.default_rng(0).random((60, 70)))
    plain = ViewSpec(blur, step, (9, 11), (0.3, -0.2), 0.4)
    aside = ViewSpec(blur, step, (9, 11), (0.3, -0.2), 0.4, homography=STRAIGHT)
    # White noise is the worst: it has all frequencies.
    np.testing.assert_allclose(simulate(scene, aside), simulate(scene, plain), rtol=0, atol=1e-8)


def test_a_blob_seen_through_an_affine_map_has_its_closed_form():
    shape, centre, sd = (120, 140), (60.3, 70.9), 5.0
    down, right = (np.arange(n) - c for n, c in zip(shape, centre, strict=True))
    scene = np.outer(np.exp(-0.5 * (down / sd) ** 2), np.exp(-0.5 * (right / sd) ** 2))
    affine = np.array([[1.3, 0.4], [-0.2, 0.8]])
    matrix = np.eye(3)
    matrix[:2, :2] = affine
    spec = ViewSpec(1.1, 3.0, (13, 15), (0.2, 0.1), homography=matrix.tolist())
    # A Gaussian of the view is one of the reference, of covariance S^2 c^2 A A^T.
    covariance = sd**2 * np.eye(2) + (1.1 * 3.0) ** 2 * affine @ affine.T
    y, x = to_reference(spec, shape, *np.indices(spec.shape))
    off = np.stack([y - centre[0], x - centre[1]], axis=-1)
    power = np.einsum("...i,ij,...j", off, np.linalg.inv(covariance), off)
    expected = sd**2 / math.sqrt(np.linalg.det(covariance)) * np.exp(-0.5 * power)
    np.testing.assert_allclose(simulate(scene, spec), expected, rtol=0, atol=1e-8)
    assert expected.max() > 0.3


def test_a_tilted_view_integrates_the_blur_of_the_camera():
    scene = Scene(np.random.default_rng(1).random((50, 60)))
    spec = ViewSpec(0.9, 3.0, (10, 12), rotation=0.4, homography=perspective.tilted(40, 30, 60.0))
    view = simulate(scene, spec)
    near = np.linspace(-6.5, 6.5, 201)  # in units of the blur: 17 points per pixel
    weight = np.exp(-0.5 * near**2)
    weight /= weight.sum()
    for i, j in ((0, 0), (4, 7), (9, 11)):
        y, x = to_reference(spec, scene.shape, i + 0.9 * near[:, None], j + 0.9 * near[None, :])
        seen = cosine_series.evaluate_at(scene.coefficients, y, x)
        assert weight @ seen @ weight == pytest.approx(view[i, j], abs=1e-8)


def test_a_view_without_blur_is_the_series_where_it_looks():
    scene = Scene(np.random.default_rng(2).random((30, 30)))
    spec = ViewSpec(0.0, 2.0, (6, 6), homography=perspective.tilted(30, 70, 40.0))
    y, x = to_reference(spec, scene.shape, *np.indices(spec.shape))
    expected = cosine_series.evaluate_at(scene.coefficients, y, x)
    np.testing.assert_allclose(simulate(scene, spec), expected, rtol=0, atol=1e-6)


def tilted_views(*tilts, focal=60.0):
    return [
        ViewSpec(1.1, 4.0, (40, 50), (0.25, 0.5), homography=perspective.tilted(tilt, a, focal))
        for tilt, a in tilts
    ]


def test_the_common_field_of_tilted_views_is_within_its_windows():
    specs = [ViewSpec(1.1, 4.0, (40, 50)), *tilted_views((30, 10), (45, 200))]
    shape, margin = (160, 200), 4
    y, x = (np.linspace(0, n - 1, 79) for n in specs[0].shape)
    y, x = (part.ravel() for part in np.meshgrid(y, x, indexing="ij"))
    inside = in_common_field(specs, shape, margin, y, x)
    assert 100 < inside.sum() < inside.size
    windows = windows_of_common_field(specs, shape, margin)
    for spec, (top, bottom, left, right) in zip(specs, windows, strict=True):
        v, u = to_view(spec, shape, *to_reference(specs[0], shape, y[inside], x[inside]))
        ends = (v.min() - top, bottom - v.max(), u.min() - left, right - u.max())
        # The samples come near the ends of the windows, and not over them.
        assert min(ends) > -1e-6 and max(ends) < 2.0
    assert len(searched_windows(specs, shape, margin)) == 3
    least, most = zooms_in_common_field(specs, shape, margin)
    local = [
        local_step(s, *to_view(s, shape, *to_reference(specs[0], shape, y[inside], x[inside])))
        for s in specs
    ]
    assert least <= np.min(local) / 4 and np.max(local) / 4 <= most


def test_scales_in_the_first_view_are_those_of_the_area_there():
    first, second = tilted_views((20, 0), (40, 120))
    y, x, h = 17.0, 31.0, 1e-4
    zoom = zoom_to_common_frame(second, first, (160, 200), y, x)
    corners = [
        np.array(to_common_frame(second, first, (160, 200), y + a * h, x + b * h))
        for a, b in ((0, 0), (1, 0), (0, 1))
    ]
    sides = np.array([corners[1] - corners[0], corners[2] - corners[0]]) / h
    assert zoom == pytest.approx(math.sqrt(abs(np.linalg.det(sides))), rel=1e-4)


def test_a_set_of_tilted_views_is_stored_and_read_as_it_was(tmp_path):
    still = {"blur": 1.1, "step": 4, "shift_y": 0, "shift_x": 0, "rotation": 0, "noise": 0}
    views = {**still, "height": None, "width": None, "tilt": [0, 30], "azimuth": [0, 45]}
    specs = view_specs("tilts", {**views, "focal_length": 90.0}, (80, 100))
    assert specs[0].homography is None
    assert specs[1].homography == perspective.tilted(30, 45, 90.0)
    images = [np.zeros(spec.shape) for spec in specs]
    write_views(images, specs, tmp_path / "views", {"set": "tilts", "reference_blur": 0.0})
    assert Views(tmp_path / "views").specs == specs


def test_views_of_one_tilt_are_matched_with_the_first():
    table = pd.DataFrame({"view": [0, 1, 2, 3, 3]})
    (_, members), (label, others) = parts_by([0, 5, 5, 40], 4)
    assert of_views(table, members)["view"].tolist() == [0, 1, 2]
    assert label == {"tilt": 40} and of_views(table, others)["view"].tolist() == [0, 1, 1]
    assert of_views(table, range(4)) is table


@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("blur", [0.5, 1.1])
def test_a_view_may_come_as_near_to_the_horizon_as_its_blur_reaches(axis, sign, blur):
    shape = (10, 16)
    reach = shape[axis] / 2 + 0.5 + perspective.REACH * blur
    for factor, allowed in ((0.99, True), (1.01, False)):
        third = [0.0, 0.0, 1.0]
        third[axis] = sign * factor / reach
        plane = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), tuple(third))
        if allowed:
            ViewSpec(blur, 2.0, shape, homography=plane)
        else:
            with pytest.raises(InputError, match="horizon of the plane"):
                ViewSpec(blur, 2.0, shape, homography=plane)


def test_a_tilted_view_of_a_transposed_scene_is_transposed():
    scene = np.random.default_rng(4).random((40, 60))
    plane = np.array([[0.9, 0.1, 0.4], [0.05, 1.1, -0.3], [0.01, -0.006, 1.0]])
    swap = np.eye(3)[[1, 0, 2]]
    view = simulate(scene, ViewSpec(0.8, 3.0, (9, 14), (0.7, -1.1), homography=plane))
    other = simulate(
        scene.T, ViewSpec(0.8, 3.0, (14, 9), (-1.1, 0.7), homography=swap @ plane @ swap)
    )
    np.testing.assert_allclose(other.T, view, atol=1e-6)
