"""True extrema against what is known on paper, and against each other."""

import math

import numpy as np
import pandas as pd
import pytest
from critical_curves import critical_balance, crossings, slice_extrema
from scenes import blob, blobs
from scipy.spatial import cKDTree

from keystab.camera.simulation import Scene, simulate
from keystab.camera.views import ViewSpec, to_reference, to_view
from keystab.detection.detector import detect_keypoints
from keystab.errors import InputError
from keystab.scalespace import cosine_series
from keystab.scalespace.continuous_dog import DogSeries
from keystab.truth.scene_extrema import scene_extrema
from keystab.truth.true_extrema import true_extrema

KAPPA = 2 ** (1 / 3)


def same_set(a, b, tolerance=1e-9):
    """Whether two tables hold the same extrema, in any order."""
    if len(a) != len(b):
        return False
    names = ["y", "x", "sigma", "value", "sign", "conditioning"]
    where = a[names[:3]].to_numpy()
    near, row = cKDTree(b[names[:3]].to_numpy()).query(where)
    apart = np.abs(a[names].to_numpy() - b.iloc[row][names].to_numpy())
    return len(set(row)) == len(row) and near.max() < 10 * tolerance and apart.max() < tolerance


@pytest.mark.parametrize("blur", [0.0, 1.1])
def test_jets_are_the_sums_and_their_differences(blur):
    image = np.random.default_rng(1).random((21, 34))
    series = DogSeries.of_image(image, blur, KAPPA)
    rng = np.random.default_rng(2)
    sigma, y, x = rng.uniform(1.2, 3, 9), rng.uniform(-3, 24, 9), rng.uniform(-3, 37, 9)
    jets = series.jets(sigma, y, x)
    coefs = cosine_series.coefficients(image)
    for i in range(9):
        upper, lower = (math.sqrt((r * sigma[i]) ** 2 - blur**2) for r in (KAPPA, 1.0))
        for order, factor, found in (
            ((0, 0), 1, jets.value[i]),
            ((1, 0), sigma[i], jets.gradient[i, 1]),
            ((0, 1), sigma[i], jets.gradient[i, 2]),
            ((2, 0), sigma[i] ** 2, jets.hessian[i, 1, 1]),
            ((1, 1), sigma[i] ** 2, jets.hessian[i, 1, 2]),
            ((0, 2), sigma[i] ** 2, jets.hessian[i, 2, 2]),
        ):
            w = cosine_series.evaluate_at(coefs, y[i], x[i], upper, order)
            w = w - cosine_series.evaluate_at(coefs, y[i], x[i], lower, order)
            assert abs(factor * w - found) < 1e-13
    # Along scale: central differences, which err by the square of the step.
    h = 1e-4
    more, less = (series.jets(sigma * math.exp(d), y, x) for d in (h, -h))
    unit = np.array([[1.0, math.exp(-h), math.exp(-h)]])  # back to the units of sigma itself
    slope = (more.value - less.value) / (2 * h)
    np.testing.assert_allclose(slope, jets.gradient[:, 0], rtol=0, atol=1e-7)
    row = (more.gradient * unit - less.gradient / unit) / (2 * h)
    np.testing.assert_allclose(row, jets.hessian[:, 0], rtol=0, atol=1e-6)
    grid = series.grid(1.7, y, x)
    assert np.abs(np.diag(grid) - series.jets(np.full(9, 1.7), y, x).value).max() < 1e-15


@pytest.mark.parametrize("kappa", [KAPPA, 2**0.5, 2 ** (1 / 15)])
@pytest.mark.parametrize("size", [1.9, 2.2])
def test_a_blob_is_where_paper_says(kappa, size):
    # The series of a sampled blob is the blob's but for exp(-pi^2 (s^2 + c^2) / 2) < 1e-11.
    blur, centre = 1.1, (35.3, 36.8)
    power = size**2 + blur**2
    image = blob((72, 75), centre, math.sqrt(power))
    found = true_extrema(image, blur, 1.15, 2.4, kappa, n_spo=[4])
    best = found.loc[found["value"].idxmin()]
    expected = [*centre, size / math.sqrt(kappa)]
    np.testing.assert_allclose(best[["y", "x", "sigma"]].tolist(), expected, rtol=0, atol=1e-9)
    strength = power / size**2 * (kappa - 1) / (kappa + 1)
    assert best["sign"] == -1
    assert best["value"] == pytest.approx(-strength, abs=1e-10)
    # Derivatives of S^2 (1/(s^2 + kappa^2 sigma^2) - 1/(s^2 + sigma^2)) exp(...), by hand.
    assert best["curvature_min"] == pytest.approx(strength / kappa, abs=1e-9)
    assert best["curvature_mid"] == pytest.approx(strength / kappa, abs=1e-9)
    assert best["conditioning"] == pytest.approx((1 + kappa) ** 2 / (8 * kappa**2), abs=1e-8)


@pytest.mark.parametrize("kappa", [KAPPA, 2**0.5])
@pytest.mark.parametrize("blur", [0.0, 1.1])
def test_one_cosine_has_its_extrema_where_paper_says(kappa, blur):
    # w = g(sigma) cos cos with g = e^(-kappa^2 sigma^2 f^2/2) - e^(-sigma^2 f^2/2) < 0, whose
    # derivative vanishes where kappa^2 = e^((kappa^2 - 1) sigma^2 f^2 / 2).
    (height, width), (k, m) = (40, 60), (7, 11)
    y, x = np.arange(height)[:, None] + 0.5, np.arange(width)[None, :] + 0.5
    image = 0.3 * np.cos(np.pi * k * y / height) * np.cos(np.pi * m * x / width) + 0.5
    found = true_extrema(image, blur, 1.1, 2.2, kappa, n_spo=[4])
    f2 = (np.pi * k / height) ** 2 + (np.pi * m / width) ** 2
    sigma = math.sqrt(4 * math.log(kappa) / ((kappa**2 - 1) * f2))
    depth = (
        0.3
        * math.exp(blur**2 * f2 / 2)
        * (kappa**2 - 1)
        * kappa ** (-(2 * kappa**2) / (kappa**2 - 1))
    )
    i, j = (a.ravel() for a in np.mgrid[1:k, 1:m])
    expected = pd.DataFrame({"y": i * height / k - 0.5, "x": j * width / m - 0.5, "sigma": sigma})
    expected["sign"] = np.where((i + j) % 2 == 0, -1, 1)
    expected["value"] = expected["sign"] * depth
    assert len(found) == len(expected) == (k - 1) * (m - 1)
    names = ["y", "x", "sigma", "sign", "value"]
    a, b = (t.round({"y": 6, "x": 6}).sort_values(["y", "x"])[names] for t in (found, expected))
    np.testing.assert_allclose(a, b, rtol=0, atol=1e-6)
    near, row = cKDTree(expected[names[:3]]).query(found[names[:3]])
    assert near.max() < 1e-9
    assert np.abs(expected["value"].to_numpy()[row] - found["value"]).max() < 1e-12


@pytest.fixture(scope="module")
def crowd():
    """A picture of blobs that disturb each other, and its extrema."""
    image = blobs((44, 52), 3)
    return image, true_extrema(image, 1.1)


def test_what_is_found_are_extrema(crowd):
    image, found = crowd
    assert len(found) > 20
    assert found["residual"].max() < 1e-12 and found["error"].max() < 1e-9
    assert found["sigma"].between(1.1, 2.2).all() and found["sigma"].is_monotonic_increasing
    assert found["conditioning"].between(0, 1, inclusive="right").all()
    # Around each, w is beyond its value in no direction.
    series = DogSeries.of_image(image, 1.1, KAPPA)
    rng = np.random.default_rng(5)
    for _ in range(20):
        d = rng.standard_normal(3)
        d *= 1e-4 / np.linalg.norm(d)
        sigma = found["sigma"].to_numpy()
        around = series.jets(
            sigma * np.exp(d[0]),
            found["y"].to_numpy() + sigma * d[1],
            found["x"].to_numpy() + sigma * d[2],
        )
        assert (found["sign"] * (around.value - found["value"]) < 0).all()


def test_the_negative_has_the_same_extrema_of_the_other_sign(crowd):
    image, found = crowd
    negative = true_extrema(1 - image, 1.1)
    assert same_set(negative, found.assign(sign=-found["sign"], value=-found["value"]))


@pytest.mark.parametrize("turn", ["y", "x", "transposed"])
def test_a_mirrored_picture_has_mirrored_extrema(crowd, turn):
    image, found = crowd
    if turn == "y":
        image, found = image[::-1], found.assign(y=image.shape[0] - 1 - found["y"])
    elif turn == "x":
        image, found = image[:, ::-1], found.assign(x=image.shape[1] - 1 - found["x"])
    else:
        image, found = image.T, found.rename(columns={"y": "x", "x": "y"})
    assert same_set(true_extrema(image, 1.1), found)


@pytest.mark.parametrize("n_spo", [[12], [7, 19]])
def test_other_seeds_find_the_same(crowd, n_spo):
    image, found = crowd
    assert same_set(true_extrema(image, 1.1, n_spo=n_spo), found)


def test_the_range_of_scales_cuts_and_does_nothing_else(crowd):
    image, found = crowd
    part = found[found["sigma"].between(1.3, 1.7)].reset_index(drop=True)
    assert 5 < len(part) < len(found)
    assert same_set(true_extrema(image, 1.1, 1.3, 1.7), part)


def test_extrema_just_above_the_cameras_blur_are_found():
    for sigma in (1.1001, 1.102, 1.11, 1.13):
        size = sigma * math.sqrt(KAPPA)
        found = true_extrema(blob((48, 48), (23.3, 24.4), math.hypot(size, 1.1)), 1.1, n_spo=[10])
        assert abs(found.loc[found["value"].idxmin(), "sigma"] - sigma) < 1e-4


def test_refined_detections_converge_to_the_truth(crowd):
    image, found = crowd
    good = found[found["conditioning"] > 0.05]
    errors = []
    for n_spo in (10, 20, 40):
        keypoints = detect_keypoints(image, 1.1, n_spo, oversampling="cosine")
        near, _ = cKDTree(keypoints[["y", "x", "sigma"]]).query(good[["y", "x", "sigma"]])
        errors.append(np.median(near))
    # Second order: each halving of the step takes a factor near four.
    assert errors[2] < errors[1] / 3 < errors[0] / 9 and errors[2] < 1e-3


@pytest.mark.parametrize("image", [np.full((30, 40), 0.3), np.zeros((30, 40))], ids=str)
def test_a_constant_picture_has_none(image):
    found = true_extrema(image, 1.1)
    assert len(found) == 0
    assert list(found)[:6] == ["y", "x", "sigma", "value", "sign", "conditioning"]


def test_a_picture_of_rows_has_none():
    image = np.tile(np.random.default_rng(3).random((40, 1)), (1, 30))
    assert len(true_extrema(image, 1.1, n_spo=[5])) == 0


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"image": np.ones(4)}, "shape"),
        ({"image": np.array([[1.0, np.nan], [0, 1]])}, "(0, 1)"),
        ({"camera_blur": 1.2}, "sigma_min is 1.1"),
        ({"camera_blur": -1.0}, "camera_blur"),
        ({"camera_blur": None}, "camera_blur"),
        ({"sigma_min": 0.0}, "sigma_min"),
        ({"sigma_max": 1.1}, "raise sigma_max"),
        ({"sigma_max": math.inf}, "sigma_max"),
        ({"kappa": 1.0}, "kappa"),
        ({"n_spo": []}, "n_spo"),
        ({"n_spo": [0]}, "n_spo"),
        ({"n_spo": 5}, "n_spo"),
        ({"threads": 0}, "threads"),
    ],
    ids=str,
)
def test_wrong_input_gets_one_line(change, words):
    arguments = {"image": blobs((20, 20), 8), "camera_blur": 0.5} | change
    with pytest.raises(InputError) as error:
        true_extrema(**arguments)
    assert words in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("seed", [3, 5, 7])
def test_following_the_extrema_of_slices_finds_the_same(seed):
    # Shares the sums with true_extrema, but no seed: see critical_curves.
    image = blobs((44, 52), seed)
    height, width = image.shape
    found = crossings(DogSeries.of_image(image, 1.1, KAPPA), 1.1, 2.2)
    inside = found["y"].between(0, height - 1) & found["x"].between(0, width - 1)
    assert 0 < (~inside).sum() < len(found) / 3  # on the mirror axes
    assert same_set(found[inside].reset_index(drop=True), true_extrema(image, 1.1))


@pytest.mark.parametrize("sigma", [1.1, 1.6, 2.2])
def test_a_slice_has_as_many_saddles_as_extrema(sigma):
    # Poincare and Hopf: the mirrored picture is a torus, of Euler characteristic 0.
    series = DogSeries.of_image(blobs((44, 52), 7), 1.1, KAPPA)
    balance, count = critical_balance(series, sigma, 0.1)
    assert balance == 0 and count > 100
    extrema = slice_extrema(series, sigma)
    assert len(extrema.sign) > 50
    assert np.linalg.norm(extrema.jets.gradient[:, 1:], axis=1).max() < 1e-12


SIDE = 400


@pytest.fixture(scope="module")
def scene():
    """Blobs of 11 to 26 pixels, to be seen from ten times as far away."""
    rng = np.random.default_rng(4)
    picture = np.zeros((SIDE, SIDE + 40))
    for _ in range(200):
        centre = [rng.uniform(0, n) for n in picture.shape]
        picture += rng.choice([-1, 1]) * blob(picture.shape, centre, rng.uniform(11, 26))
    return Scene(picture)


def test_a_well_sampled_view_has_the_extrema_of_its_scene(scene):
    # The view sees all of the reference, so that both have the same mirrors.
    spec = ViewSpec(1.6, 10.0, (40, 44))
    of_view = true_extrema(simulate(scene, spec), 1.6, 1.6, 3.2, n_spo=[10])
    of_scene = scene_extrema(scene, spec, 1.6, 3.2, n_spo=[10])
    # Frequencies beyond a cycle per two pixels are damped by exp(-(1.6 pi)^2 / 2) = 3e-6, and less.
    assert len(of_scene) > 10 and same_set(of_view, of_scene, 1e-5)


@pytest.mark.parametrize(
    "change",
    [
        {"shift": (2.3, -1.7)},
        {"step": 8.7},
        {"rotation": 0.4},
        {"rotation": math.pi / 2},
        {"blur": 0.3, "noise": 0.1, "seed": 1},
    ],
    ids=str,
)
def test_a_view_moves_the_extrema_of_the_scene_and_nothing_else(scene, change):
    first, second = (
        ViewSpec(**({"blur": 1.1, "step": 10.0, "shape": (24, 26)} | c)) for c in ({}, change)
    )
    ratio = first.step / second.step
    a = scene_extrema(scene, first, 1.3, 2.2, n_spo=[10])
    b = scene_extrema(scene, second, 1.3 * ratio, 2.2 * ratio, n_spo=[10])
    y, x = to_view(second, scene.shape, *to_reference(first, scene.shape, a["y"], a["x"]))
    moved = a.assign(y=y, x=x, sigma=a["sigma"] * ratio)
    moved = moved[(y >= 0) & (y <= 23) & (x >= 0) & (x <= 25)]
    y, x = to_view(first, scene.shape, *to_reference(second, scene.shape, b["y"], b["x"]))
    seen = b[(y >= 0) & (y <= 23) & (x >= 0) & (x <= 25)]
    assert len(moved) > 3 and same_set(moved.reset_index(drop=True), seen.reset_index(drop=True))


def test_a_view_beyond_the_border_sees_mirrored_extrema(scene):
    all_of_it = scene_extrema(scene, ViewSpec(1.1, 10.0, (40, 44)), n_spo=[10])
    beyond = scene_extrema(scene, ViewSpec(1.1, 10.0, (40, 44), shift=(40.0, 0.0)), n_spo=[10])
    mirrored = all_of_it.assign(y=39 - all_of_it["y"])
    assert len(beyond) > 5 and same_set(beyond, mirrored)
    both = scene_extrema(scene, ViewSpec(1.1, 10.0, (80, 44), shift=(20.0, 0.0)), n_spo=[10])
    upper = both[both["y"] <= 39].reset_index(drop=True)
    assert same_set(upper, all_of_it)
    # On the mirror axis an extremum is seen once.
    assert not both.round(6).duplicated(["y", "x", "sigma"]).any()
    assert ((both["y"] - 39.5).abs() < 1e-6).any()


def test_the_blur_of_the_reference_counts(scene):
    # A scene of blobs of s, photographed with a blur of 10 reference pixels.
    size, own = 24.0, 10.0
    picture = blob((300, 300), (140.0, 150.0), math.hypot(size, own))
    found = scene_extrema(picture, ViewSpec(0.5, 10.0, (30, 30)), reference_blur=own, n_spo=[5])
    best = found.loc[found["value"].idxmin()]
    expected = [(140 - 4.5) / 10, (150 - 4.5) / 10, size / 10 / math.sqrt(KAPPA)]
    np.testing.assert_allclose(best[["y", "x", "sigma"]].tolist(), expected, rtol=0, atol=1e-9)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"reference": np.ones(4)}, "shape"),
        ({"reference_blur": -1.0}, "reference_blur"),
        ({"reference_blur": 12.0}, "at least 1.2"),
        ({"sigma_max": 1.0}, "raise sigma_max"),
        ({"n_spo": 3}, "n_spo"),
    ],
    ids=str,
)
def test_wrong_input_for_a_scene_gets_one_line(change, words):
    arguments = {"reference": np.eye(40), "spec": ViewSpec(1.0, 10.0, (4, 4))} | change
    with pytest.raises(InputError) as error:
        scene_extrema(**arguments)
    assert words in str(error.value)
    assert "\n" not in str(error.value)
