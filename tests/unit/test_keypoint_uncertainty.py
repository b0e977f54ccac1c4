"""Error bars against closed forms, against Monte Carlo, and against what must leave them alone."""

from __future__ import annotations

import math

import numpy as np
import pandas as pd
import pytest
from scipy import integrate, ndimage
from scipy.special import erf
from scipy.stats import chi2

import keystab
from keystab.detection.detector import detect_keypoints
from keystab.prediction.detector_error import detector_error
from keystab.prediction.local_jets import local_jets
from keystab.prediction.noise_covariance import ORDER, ORDERS, band_moments, noise_jets, scene_jets
from keystab.prediction.noise_level import estimated_noise
from keystab.prediction.quartic_extrema import slopes
from keystab.prediction.survival import after_noise
from keystab.prediction.uncertainty import _at_keypoints, _error_bars
from keystab.scalespace.continuous_dog import DogSeries

KAPPA, BLUR = 2 ** (1 / 3), 0.8
ERRORS = ["std_y", "std_x", "std_log_sigma"]


def blobs(height, width, places, zoom=1.0, contrast=1.0):
    """Gaussian blobs at (y, x, standard deviation), seen with the camera's blur."""
    y, x = np.mgrid[:height, :width] / zoom
    image = np.zeros((height, width))
    for top, left, size in places:
        variance = size**2 + BLUR**2
        image += np.exp(-((y - top) ** 2 + (x - left) ** 2) / (2 * variance)) / variance
    return contrast * image


def deepest(table):
    return table.loc[table["value"].idxmin()]


def noise_of(shape, seed):
    return np.random.default_rng(seed).standard_normal(shape)


# -------------------------------------------------------------------------------------------------
# Covariances of derivatives


@pytest.mark.parametrize("t", [0.0, 0.05, 0.57, 1.49, 1.51, 4.0, 30.0])
def test_moments_are_the_integrals_over_the_band(t):
    for k, moment in enumerate(band_moments(t)):
        area = integrate.quad(lambda w, k=k: w ** (2 * k) * np.exp(-t * w * w), 0, np.pi)[0]
        assert moment == pytest.approx(area / np.pi, rel=1e-9)


@pytest.mark.parametrize("t", [0.3, 1.0, 3.0])
def test_moments_are_the_closed_forms_with_the_error_function(t):
    edge, root = np.exp(-(np.pi**2) * t), erf(np.pi * np.sqrt(t)) / np.sqrt(np.pi)
    closed = [
        root / (2 * t**0.5),
        root / (4 * t**1.5) - edge / (2 * t),
        3 * root / (8 * t**2.5) - edge * (3 / (4 * t**2) + np.pi**2 / (2 * t)),
    ]
    assert band_moments(t, 2) == pytest.approx(closed, rel=1e-12)


def test_far_above_the_blur_the_gradient_has_the_covariance_of_continuous_white_noise():
    sigma, c = 9.0, 0.8
    a, b = (KAPPA * sigma) ** 2 - c**2, sigma**2 - c**2
    m = (a + b) / 2
    found = noise_jets(np.array([sigma]), c, KAPPA)[0]
    along = sigma**2 / (8 * np.pi) * (1 / a**2 + 1 / b**2 - 2 / m**2)
    scale = sigma**4 / (2 * np.pi) * (KAPPA**4 / a**3 + 1 / b**3 - 2 * KAPPA**2 / m**3)
    value = 1 / (4 * np.pi) * (1 / a + 1 / b - 2 / m)
    mixed = sigma**2 / (4 * np.pi) * (-(KAPPA**2) / a**2 - 1 / b**2 + (1 + KAPPA**2) / m**2)
    assert np.diag(found)[:4] == pytest.approx([value, scale, along, along], rel=1e-9)
    assert found[0, 1] == pytest.approx(mixed, rel=1e-9)


def test_derivatives_of_white_noise_have_the_covariance_that_is_said():
    sigma, count = 1.7, 25
    at = 6 + 8.0 * np.arange(count)  # far enough apart to be independent
    y, x = (part.ravel() for part in np.meshgrid(at, at, indexing="ij"))
    jets = local_jets(noise_of((210, 210), 5), np.full(y.size, sigma), y, x, BLUR, KAPPA)
    said = noise_jets(np.array([sigma]), BLUR, KAPPA)[0]
    root = np.sqrt(np.diag(said))
    correlation = said / np.outer(root, root)
    seen = (jets / root).T @ (jets / root) / y.size
    deviation = np.sqrt((1 + correlation**2) / y.size)
    assert np.abs((seen - correlation) / deviation).max() < 4.5


def test_scenes_have_the_covariance_of_their_spectrum():
    found = scene_jets(KAPPA)

    def spectrum(r):
        return (np.exp(-((KAPPA * r) ** 2) / 2) - np.exp(-(r**2) / 2)) ** 2 / r**2

    value = integrate.quad(lambda r: spectrum(r) * r, 0, 20)[0] / (2 * np.pi)
    slope = integrate.quad(lambda r: spectrum(r) * r**3, 0, 20)[0] / (4 * np.pi)
    assert found[0, 0] == pytest.approx(value, rel=1e-8)
    assert found[2, 2] == found[3, 3] == pytest.approx(slope, rel=1e-8)
    # Semidefinite: w nearly obeys a diffusion equation, and the least eigenvalue is rounding.
    assert np.linalg.eigvalsh(found).min() > -np.finfo(float).eps * np.trace(found)
    odd = (ORDERS[:, None] + ORDERS[None, :])[:, :, 1] % 2 == 1
    assert not found[odd].any()


def test_local_derivatives_are_those_of_the_whole_series():
    image = blobs(48, 60, [(20, 22, 2.0), (27, 37, 1.6), (23, 30, 3.0)])
    series = DogSeries.of_image(image, BLUR, KAPPA)
    sigma, y, x = np.array([[1.7, 20.3, 22.1], [2.4, 25.0, 33.3], [3.1, 23.7, 29.9]]).T
    found, true = local_jets(image, sigma, y, x, BLUR, KAPPA), series.jets(sigma, y, x)
    size = np.abs(true.hessian).max()
    assert found[:, 0] == pytest.approx(true.value, abs=2e-3 * size)
    assert found[:, 1:4] == pytest.approx(true.gradient, abs=2e-3 * size)
    upper = true.hessian[:, [0, 0, 0, 1, 1, 2], [0, 1, 2, 1, 2, 2]]
    assert found[:, 4:10] == pytest.approx(upper, abs=4e-3 * size)
    h = 1e-3
    for axis, column in ((1, 16), (2, 19)):
        ends = [
            series.jets(sigma, *(p + s * h * sigma * (k == axis) for k, p in ((1, y), (2, x))))
            for s in (1, -1)
        ]
        third = (ends[0].hessian[:, axis, axis] - ends[1].hessian[:, axis, axis]) / (2 * h)
        assert found[:, column] == pytest.approx(third, abs=4e-3 * size)


def entry(*orders):
    """Place of a derivative in a jet."""
    return int(np.flatnonzero((orders == ORDERS).all(axis=1))[0])


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_every_local_derivative_is_that_of_the_one_before(axis):
    image = blobs(48, 60, [(20, 22, 2.0), (27, 37, 1.6), (23, 30, 3.0)])
    at, h = np.array([[1.7, 20.3, 22.1], [3.1, 23.7, 29.9]]), 1e-4
    jets = local_jets(image, *at.T, BLUR, KAPPA)
    ends = []
    for step in (h, -h):
        scale = np.exp(step * (axis == 0))
        moved = at * [scale, 1, 1]
        moved[:, axis] += step * at[:, 0] * (axis > 0)
        units = scale ** -ORDERS[:, 1:].sum(axis=1)  # those of the scale from which it moved
        ends.append(local_jets(image, *moved.T, BLUR, KAPPA) * units)
    slopes = (ends[0] - ends[1]) / (2 * h)
    for row, orders in enumerate(ORDERS):
        if orders.sum() < ORDER:
            more = entry(*(orders + (np.arange(3) == axis)))
            size = np.abs(jets).max()
            assert slopes[:, row] == pytest.approx(jets[:, more], abs=1e-5 * size), orders


@pytest.mark.parametrize(
    "jets", [lambda: noise_jets(np.array([1.4]), BLUR, KAPPA)[0], lambda: scene_jets(KAPPA)]
)
def test_covariances_of_derivatives_in_space_are_those_of_a_stationary_field(jets):
    found = jets()
    for first, second, third in (
        ("yyyy", "yyy", "yy"),
        ("xxxx", "xxx", "xx"),
        ("yyxx", "yxx", "xx"),
    ):
        a, b, c = (entry(0, name.count("y"), name.count("x")) for name in (first, second, third))
        rest = entry(0, 1, 0) if second != "xxx" else entry(0, 0, 1)
        assert found[a, 0] == pytest.approx(-found[b, rest], rel=1e-12)
        left = entry(*(ORDERS[a] - ORDERS[c]))
        assert found[a, 0] == pytest.approx(found[c, left], rel=1e-12)


def test_covariances_grow_along_scale_as_the_next_derivatives_say():
    sigma, h = 1.4, 1e-4
    near = noise_jets(sigma * np.exp([-h, 0.0, h]), BLUR, KAPPA)
    growth, said = (near[2] - near[0]) / (2 * h), near[1]
    for n in range(ORDER):
        for m in range(ORDER):
            one, other = entry(n, 0, 0), entry(m, 0, 0)
            expected = said[entry(n + 1, 0, 0), other] + said[one, entry(m + 1, 0, 0)]
            size = np.sqrt(said[entry(n + 1, 0, 0), entry(n + 1, 0, 0)] * said[other, other])
            assert growth[one, other] == pytest.approx(expected, abs=1e-5 * size)


def test_scenes_are_alike_at_all_scales():
    found, scale = scene_jets(KAPPA), [entry(n, 0, 0) for n in range(ORDER + 1)]
    along = found[np.ix_(scale, scale)]
    assert along[4, 0] == pytest.approx(-along[3, 1], rel=1e-9)
    assert along[4, 0] == pytest.approx(along[2, 2], rel=1e-9)
    assert along[4, 3] == pytest.approx(0, abs=1e-9 * along[4, 4])


# -------------------------------------------------------------------------------------------------
# Extrema of quartics


def test_slopes_of_a_quartic_are_differences_of_its_values():
    jet = np.random.default_rng(4).standard_normal(len(ORDERS))
    over = [math.prod(math.factorial(int(n)) for n in orders) for orders in ORDERS]

    def value(at):
        return float((jet * np.prod(at**ORDERS, axis=1) / over).sum())

    at, h = np.array([0.3, -0.2, 0.4]), 1e-3
    gradient, hessian = np.empty(3), np.empty((3, 3))
    work = np.empty(10), np.empty(10), np.empty(6)
    slopes(jet, -2.0, at, *work, gradient, hessian)
    for i, a in enumerate(h * np.eye(3)):
        assert gradient[i] == pytest.approx(
            -2 * (value(at + a) - value(at - a)) / (2 * h), abs=1e-5
        )
        for k, b in enumerate(h * np.eye(3)):
            ends = value(at + a + b) - value(at + a - b) - value(at - a + b) + value(at - a - b)
            assert hessian[i, k] == pytest.approx(-2 * ends / (4 * h * h), abs=1e-4)


def one_way_cubic(slope, curvature, third):
    """Jet of a maximum that is cubic along x and quadratic along the rest."""
    jet = np.zeros((1, len(ORDERS)))
    jet[0, [4, 7]] = -1.0
    jet[0, 9], jet[0, 19] = -curvature, third
    noise = np.zeros((1, len(ORDERS), len(ORDERS)))
    noise[0, 3, 3] = slope**2
    return jet, np.ones(1), noise, np.array([[0.05, 0.05, 0.0, 0.0, 0.0]])


def test_without_a_fold_in_reach_the_shift_is_the_gradient_over_the_curvature():
    outcome = after_noise(*one_way_cubic(0.02, 0.4, 0.0))
    assert outcome.survival[0] == 1
    assert np.sqrt(outcome.moments[0, 2, 2]) == pytest.approx(0.02 / 0.4, rel=0.02)


@pytest.mark.parametrize("third", [2.0, 6.0])
def test_extrema_die_where_the_gradient_passes_the_fold(third):
    from scipy.stats import norm

    curvature, slope = 0.5, 0.05
    outcome = after_noise(*one_way_cubic(slope, curvature, third))
    # -curvature d + third d**2 / 2 + g = 0 has no solution for g above curvature**2 / (2 third).
    # On the other side the extremum is at -0.5 for a g far beyond what is drawn.
    said = norm.cdf(curvature**2 / (2 * third) / slope)
    assert outcome.survival[0] == pytest.approx(said, abs=0.03)


@pytest.mark.parametrize("fold", [0.2, 0.35])
def test_extrema_die_on_both_sides_where_terms_of_the_fourth_order_bend_the_slope(fold):
    from scipy.stats import norm

    curvature, slope = 0.5, 0.06
    jet, *others = one_way_cubic(slope, curvature, 0.0)
    jet[0, 34] = 2 * curvature / fold**2
    outcome = after_noise(jet, *others)
    # -curvature d + fourth d**3 / 6 + g = 0 has the solution nearest to 0 up to |d| = fold.
    most = 2 / 3 * curvature * fold
    said = 2 * norm.cdf(most / slope) - 1
    assert outcome.survival[0] == pytest.approx(said, abs=0.03)


@pytest.mark.parametrize(("angle", "seen"), [(0.0, 0.0), (np.pi / 8, 1.0), (np.pi / 4, 0.0)])
def test_a_saddle_counts_where_all_neighbours_lie_on_its_steep_sides(angle, seen):
    # Curvature -1 across a ridge at an angle to the grid, and 0.03 along it: 22.5 degrees off the
    # nearest direction of the grid, cos**2 x 0.03 - sin**2 is negative.
    jet, sign, _, grid = one_way_cubic(0.0, 1.0, 0.0)
    ridge = np.array([np.cos(angle), np.sin(angle)])
    hessian = -np.eye(2) + 1.03 * np.outer(ridge, ridge)
    jet[0, 7], jet[0, 8], jet[0, 9] = hessian[0, 0], hessian[0, 1], hessian[1, 1]
    outcome = after_noise(jet, sign, np.zeros((1, len(ORDERS), len(ORDERS))), grid)
    assert outcome.survival[0] == seen


def tops_its_neighbours(hessian, steps, off):
    """Whether a sample within two steps of the nearest is a strict maximum of a quadratic form."""
    axes = [
        (np.arange(-3, 4) + (c - np.rint(c))) * step for c, step in zip(off, steps, strict=True)
    ]
    at = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    value = np.einsum("...i,ij,...j->...", at, hessian, at)
    around = np.ones((3, 3, 3), dtype=bool)
    around[1, 1, 1] = False
    others = ndimage.maximum_filter(value, footprint=around)
    return bool((value > others)[1:-1, 1:-1, 1:-1].any())


def test_a_saddle_counts_where_a_sample_of_the_grid_tops_its_neighbours():
    draw = np.random.default_rng(11)
    n, steps = 120, (0.05, 0.08, 0.08)
    jets, off = np.zeros((n, len(ORDERS))), draw.uniform(-0.6, 0.6, (n, 3))
    axes = np.linalg.qr(draw.standard_normal((n, 3, 3)))[0]
    curvature = -np.abs(draw.uniform(0.5, 2.0, (n, 3)))
    curvature[:, 0] = draw.uniform(0.0, 0.1, n)  # up along one direction: a saddle
    hessians = np.einsum("nik,nk,njk->nij", axes, curvature, axes)
    jets[:, 4:10] = hessians[:, [0, 0, 0, 1, 1, 2], [0, 1, 2, 1, 2, 2]]
    grid = np.column_stack([np.tile(steps[:2], (n, 1)), off])
    nothing = np.zeros((n, len(ORDERS), len(ORDERS)))
    said = after_noise(jets, np.ones(n), nothing, grid).survival
    seen = [tops_its_neighbours(h, steps, o) for h, o in zip(hessians, off, strict=True)]
    assert 0.1 < np.mean(seen) < 0.9
    assert said.tolist() == [float(one) for one in seen]


# -------------------------------------------------------------------------------------------------
# Pictures


def test_the_spread_of_a_blob_under_noise_is_the_error_bar():
    image = blobs(36, 40, [(17.3, 20.6, 1.8)], contrast=3.0)
    noise, draws = 0.02, 60
    said = deepest(keystab.keypoint_uncertainty(image, BLUR, noise, 15, noise_free=True))
    found = [
        deepest(detect_keypoints(image + noise * noise_of(image.shape, seed), BLUR, 15))
        for seed in range(draws)
    ]
    seen = pd.DataFrame(found)
    low, high = np.sqrt(chi2.ppf([0.0005, 0.9995], draws - 1) / (draws - 1))
    for name, values in (("y", seen["y"]), ("x", seen["x"]), ("log_sigma", np.log(seen["sigma"]))):
        assert low < values.astype(float).std() / said[f"std_{name}"] < high, name
    assert said["survival"] > 0.98


def test_the_error_bar_of_one_noisy_shot_is_that_of_the_scene():
    image = blobs(36, 40, [(17.3, 20.6, 1.8)], contrast=3.0)
    scene = deepest(keystab.keypoint_uncertainty(image, BLUR, 0.02, noise_free=True))
    shot = deepest(
        keystab.keypoint_uncertainty(image + 0.02 * noise_of(image.shape, 3), BLUR, 0.02)
    )
    assert shot[ERRORS].to_list() == pytest.approx(scene[ERRORS].to_list(), rel=0.2)


def test_twice_the_noise_doubles_its_part_of_the_spread():
    image = blobs(36, 40, [(17.3, 20.6, 1.8)], contrast=3.0)
    once, twice, none = (
        deepest(keystab.keypoint_uncertainty(image, BLUR, noise)) for noise in (0.004, 0.008, 0.0)
    )
    for name in ERRORS:
        parts = [np.sqrt(row[name] ** 2 - none[name] ** 2) for row in (once, twice)]
        assert parts[1] / parts[0] == pytest.approx(2, rel=0.02), name


def test_without_noise_the_error_of_the_detector_is_left():
    image = blobs(36, 40, [(17.3, 20.6, 1.8)])
    for n_spo, refine in ((15, True), (5, True), (5, False)):
        found = deepest(keystab.keypoint_uncertainty(image, BLUR, 0.0, n_spo, refine=refine))
        delta = keystab.balanced_delta(n_spo)
        own = detector_error(np.array([0]), n_spo, delta, 1.1, refine)
        assert found["std_y"] == found["std_x"] == pytest.approx(own.location[0])
        assert found["std_log_sigma"] == pytest.approx(own.log_sigma[0])
        assert found["survival"] == pytest.approx(own.recall)
    coarse, fine = (
        detector_error(np.array([0]), n, keystab.balanced_delta(n), 1.1, True) for n in (3, 15)
    )
    assert coarse.location[0] > 5 * fine.location[0]


def test_error_bars_follow_a_zoom_when_the_noise_is_scaled_with_it():
    places = [(17, 18, 1.9), (22, 25, 1.5), (14, 30, 2.4)]
    once = keystab.keypoint_uncertainty(blobs(40, 48, places), 0.8, 0.002)
    large = blobs(80, 96, places, zoom=2.0)
    twice = keystab.keypoint_uncertainty(large, 1.6, 0.004, sigma_min=2.2)
    pairs = 0
    for _, row in once[(once["sigma"] ** 2 - 0.8**2 > 0.5) & (once["survival"] > 0.9)].iterrows():
        away = np.hypot(twice["y"] / 2 - row["y"], twice["x"] / 2 - row["x"])
        away += np.abs(np.log(twice["sigma"] / 2 / row["sigma"]))
        if away.min() > 0.05 or not 8 < row["y"] < 32 or not 8 < row["x"] < 40:
            continue
        other = twice.loc[away.idxmin()]
        pairs += 1
        assert other["std_y"] / 2 == pytest.approx(row["std_y"], rel=0.05)
        assert other["std_x"] / 2 == pytest.approx(row["std_x"], rel=0.05)
        assert other["std_log_sigma"] == pytest.approx(row["std_log_sigma"], rel=0.05)
        assert other["survival"] == pytest.approx(row["survival"], abs=0.03)
        assert other["conditioning"] == pytest.approx(row["conditioning"], rel=0.05)
    assert pairs >= 2


def test_a_picture_in_other_units_of_grey_has_the_same_error_bars():
    image = blobs(36, 44, [(17, 18, 1.9), (20, 29, 1.5)]) + 0.01 * noise_of((36, 44), 1)
    one, other = (keystab.keypoint_uncertainty(k * image, BLUR, k * 0.01) for k in (1.0, 256.0))
    names = [*ERRORS, "survival", "conditioning"]
    pd.testing.assert_frame_equal(one[names], other[names], rtol=1e-9)


def test_grey_values_of_any_size_have_error_bars():
    image = blobs(36, 44, [(17, 18, 1.9), (20, 29, 1.5)]) + 0.01 * noise_of((36, 44), 1)
    names = [*ERRORS, "survival", "conditioning"]
    usual = keystab.keypoint_uncertainty(image, BLUR, n_spo=3)
    for size in (2.0**-200, 2.0**200):
        found = keystab.keypoint_uncertainty(size * image, BLUR, n_spo=3)
        pd.testing.assert_frame_equal(usual[names], found[names], rtol=1e-9)
        assert found["noise"].to_numpy() / size == pytest.approx(usual["noise"].to_numpy())


def test_eigenvectors_of_another_processor_give_the_same_survival(monkeypatch):
    image = blobs(36, 44, [(17, 18, 1.9), (20, 29, 1.5)]) + 0.01 * noise_of((36, 44), 1)
    one = keystab.keypoint_uncertainty(image, BLUR, 0.02)
    eigh, draw = np.linalg.eigh, np.random.default_rng(3)

    def otherwise(matrices):
        """Eigenvectors with other signs, and of equal eigenvalues turned: as good as those."""
        values, axes = eigh(matrices)
        axes = axes * draw.choice([-1.0, 1.0], size=(*axes.shape[:-2], 1, axes.shape[-1]))
        for k in range(values.shape[-1] - 1):
            near = abs(values[..., k + 1] - values[..., k]) < 1e-12 * abs(values[..., -1])
            first, second = axes[near, :, k], axes[near, :, k + 1]
            axes[near, :, k] = 0.6 * first + 0.8 * second
            axes[near, :, k + 1] = 0.6 * second - 0.8 * first
        return values, axes

    monkeypatch.setattr(np.linalg, "eigh", otherwise)
    other = keystab.keypoint_uncertainty(image, BLUR, 0.02)
    assert one["survival"].between(0.05, 0.95).any()
    pd.testing.assert_frame_equal(one, other, rtol=1e-9)


def test_a_transposed_picture_swaps_y_and_x():
    image = blobs(34, 50, [(17, 18, 1.9), (16, 31, 1.5)], contrast=2.0) + 0.01 * noise_of(
        (34, 50), 2
    )
    one = keystab.keypoint_uncertainty(image, BLUR, 0.01)
    other = keystab.keypoint_uncertainty(image.T, BLUR, 0.01)
    keys = ["sigma", "y", "x"]
    one = one.sort_values(keys, ignore_index=True)
    other = other.rename(columns={"y": "x", "x": "y"}).sort_values(keys, ignore_index=True)
    assert one[keys].to_numpy() == pytest.approx(other[keys].to_numpy(), abs=1e-6)
    assert one["conditioning"].to_numpy() == pytest.approx(
        other["conditioning"].to_numpy(), abs=1e-6
    )
    # The draws are the same in other directions: equal within what 256 of them are good for.
    assert one["survival"].to_numpy() == pytest.approx(other["survival"].to_numpy(), abs=0.15)
    sure = one["survival"] > 0.9
    assert sure.any()
    for name, swapped in (("std_y", "std_x"), ("std_x", "std_y"), ("std_log_sigma",) * 2):
        a, b = one.loc[sure, name].to_numpy(), other.loc[sure, swapped].to_numpy()
        assert a == pytest.approx(b, rel=0.2), name


def test_no_row_depends_on_another():
    image = 0.05 * noise_of((40, 40), 7)
    table = detect_keypoints(image, BLUR, 5)
    order = np.random.default_rng(0).permutation(len(table))
    jets, level = _at_keypoints(image, table, BLUR, KAPPA, (0.05**2, 0.0))
    settings = (BLUR, KAPPA, (5, keystab.balanced_delta(5), 1.1, True), False)
    straight = _error_bars(table, jets, level, *settings)
    part = table.iloc[order[:20]]
    seen = _at_keypoints(image, part, BLUR, KAPPA, (0.05**2, 0.0))
    mixed = _error_bars(part, *seen, *settings)
    for name, values in straight.items():
        assert values[order[:20]] == pytest.approx(mixed[name], rel=1e-9), name


def test_conditioning_is_that_of_the_true_extremum():
    y, x = np.mgrid[:40, :44]
    image = np.exp(-((y - 19.3) ** 2 / (2 * 2.4**2) + (x - 21) ** 2 / (2 * 2.0**2)))
    found = deepest(keystab.keypoint_uncertainty(image, BLUR, 0.01, noise_free=True))
    true = deepest(keystab.true_extrema(image, BLUR, n_spo=[9]))
    assert found["conditioning"] == pytest.approx(true["conditioning"], rel=0.02)
    assert 0 < found["conditioning"] < 1


def test_survival_is_the_share_that_a_second_shot_has_again():
    scene = ndimage.gaussian_filter(noise_of((110, 110), 10), 2)
    scene *= 0.02 / scene.std()
    first, second = (scene + 0.02 * noise_of(scene.shape, seed) for seed in (11, 12))
    found = keystab.keypoint_uncertainty(first, BLUR, 0.02, 5, n_oct=2)
    again = detect_keypoints(second, BLUR, 5, n_oct=2)
    inside = found[found["sigma"].between(1.39, 3.5)]
    seen = 0
    for _, row in inside.iterrows():
        near = again[again["sign"] == row["sign"]]
        away = np.log(near["sigma"] / row["sigma"]) ** 2
        away += ((near["y"] - row["y"]) ** 2 + (near["x"] - row["x"]) ** 2) / row["sigma"] ** 2
        seen += away.min() < 0.25
    assert len(inside) > 60
    deviation = np.sqrt((inside["survival"] * (1 - inside["survival"])).sum()) / len(inside)
    assert inside["survival"].mean() == pytest.approx(seen / len(inside), abs=3 * deviation)
    assert inside["survival"].between(0.05, 0.95).mean() > 0.5


def test_without_a_number_the_noise_is_estimated():
    image = blobs(80, 90, [(30, 40, 2.0), (50, 60, 3.0)]) + 0.02 * noise_of((80, 90), 1)
    found = keystab.keypoint_uncertainty(image, BLUR, n_spo=3)
    assert found["noise"].nunique() == 1
    assert found["noise"].iloc[0] == estimated_noise(image) == pytest.approx(0.02, rel=0.12)


def test_noise_that_grows_with_the_grey_value_is_larger_where_it_is_bright():
    bright = blobs(40, 80, [(20, 20, 1.8), (20, 60, 1.8)])
    bright[:, 40:] += 1.0
    found = keystab.keypoint_uncertainty(bright, BLUR, (1e-5, 1e-4), 5, noise_free=True)
    pair = [found.iloc[np.hypot(found["y"] - 20, found["x"] - x).argmin()] for x in (20, 60)]
    assert pair[1]["noise"] > 1.5 * pair[0]["noise"]
    own = detector_error(np.array([0]), 5, keystab.balanced_delta(5), 1.1, True).location[0]
    ratio = np.sqrt((pair[1]["std_y"] ** 2 - own**2) / (pair[0]["std_y"] ** 2 - own**2))
    assert ratio == pytest.approx(pair[1]["noise"] / pair[0]["noise"], rel=0.05)
    plain, constant = (
        keystab.keypoint_uncertainty(bright, BLUR, noise, 5) for noise in (0.01, (1e-4, 0.0))
    )
    pd.testing.assert_frame_equal(plain, constant)


@pytest.mark.parametrize(
    "noise",
    [
        -0.1,
        "much",
        (1.0,),
        (1, 2, 3),
        (-1.0, 0.1),
        (0.1, -1),
        np.nan,
        1e300,
        (0, 1e300),
        (1e308, 0),
    ],
)
def test_noise_that_is_none_is_refused_in_one_line(noise):
    with pytest.raises(keystab.InputError, match="noise") as error:
        keystab.keypoint_uncertainty(np.eye(12), BLUR, noise)
    assert "\n" not in str(error.value)


def test_a_constant_picture_has_no_rows_and_all_columns():
    found = keystab.keypoint_uncertainty(np.ones((20, 20)), BLUR, n_spo=3)
    assert len(found) == 0
    assert {*ERRORS, "survival", "conditioning", "noise", "cov_yx"} <= set(found.columns)
