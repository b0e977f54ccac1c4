"""What is known on paper about the extrema of a difference-of-Gaussians scale-space."""

import math

import numpy as np
import pandas as pd
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scenes import blob, blobs

from keystab.camera.psf_fit import border_level, fit_psf
from keystab.camera.simulation import simulate_view
from keystab.camera.views import ViewSpec
from keystab.detection.detector import detect_keypoints
from keystab.detection.extrema import discrete_extrema
from keystab.detection.refinement import accepted
from keystab.errors import InputError
from keystab.io.pictures import write_picture
from keystab.scalespace.dog import scale_space
from keystab.scalespace.grid_kernels import cosine_domain_kernel
from keystab.scalespace.sampling import balanced_delta
from keystab.scalespace.spline_axis import SplineAxis
from keystab.truth.scene_extrema import scene_extrema
from keystab.truth.true_extrema import true_extrema

KAPPA = 2 ** (1 / 3)


def positions(table, *names):
    return table[list(names)].to_numpy()


@pytest.mark.parametrize("oversampling", ["spline", "cosine"])
@pytest.mark.parametrize(("kappa", "n_spo"), [(KAPPA, 15), (2**0.5, 14), (2 ** (1 / 15), 15)])
@pytest.mark.parametrize("size", [1.6, 1.9, 2.2])
def test_a_blob_is_found_at_its_size_over_root_kappa(oversampling, kappa, n_spo, size):
    # DoG of a Gaussian blob of standard deviation s: extremal in sigma at s / sqrt(kappa).
    camera_blur, centre = 0.9, (15.3, 16.8)
    image = blob((31, 35), centre, math.hypot(size, camera_blur))
    found = detect_keypoints(
        image, camera_blur, n_spo, kappa=kappa, sigma_min=1.1, oversampling=oversampling
    )
    at = found.loc[found["value"].idxmin()]
    delta = balanced_delta(n_spo, kappa, 1.1)
    # Central differences err by the square of the step; the cubic spline by 1e-3 of a blob.
    assert abs(at["sigma"] * math.sqrt(kappa) / size - 1) < 0.01
    assert abs(at["y"] - centre[0]) < 0.02 * delta
    assert abs(at["x"] - centre[1]) < 0.02 * delta
    assert at["sign"] == -1


def test_the_refined_scale_converges_to_theory():
    # Its mirror images are seven standard deviations away at the coarsest scale.
    image = blob((29, 31), (14.3, 14.8), math.hypot(1.9, 0.9))
    errors = []
    for n_spo in (4, 8, 16, 32):
        found = detect_keypoints(image, 0.9, n_spo, oversampling="cosine")
        errors.append(abs(found.loc[found["value"].idxmin(), "sigma"] - 1.9 / math.sqrt(KAPPA)))
    # Second order: each halving of the step takes a factor near four.
    assert errors[3] < errors[2] / 3 < errors[1] / 9
    assert errors[3] < 1e-4


def test_cosine_slices_are_the_series():
    image = blobs((23, 31), 1)
    space = scale_space(image, 1.1, 4, 0.37, oversampling="cosine")
    h, w = image.shape
    k, i = np.arange(h)[:, None], np.arange(h)[None, :] + 0.5
    cos_y = np.cos(np.pi * k * i / h)
    m, j = np.arange(w)[:, None], np.arange(w)[None, :] + 0.5
    cos_x = np.cos(np.pi * m * j / w)
    scale_y = np.where(np.arange(h) == 0, 1, 2)[:, None] / h
    scale_x = np.where(np.arange(w) == 0, 1, 2)[:, None] / w
    coefficients = (scale_y * cos_y) @ image @ (scale_x * cos_x).T
    omega2 = (np.pi * np.arange(h)[:, None] / h) ** 2 + (np.pi * np.arange(w)[None, :] / w) ** 2
    rng = np.random.default_rng(2)
    for _ in range(50):
        s, row, column = (int(rng.integers(n)) for n in space.shape)
        sigma = 1.1 * 2 ** (s / 4)
        gain = np.exp(-((KAPPA * sigma) ** 2 - 1.21) / 2 * omega2)
        gain -= np.exp(-(sigma**2 - 1.21) / 2 * omega2)
        wave_y = np.cos(np.pi * np.arange(h) * (row * 0.37 + 0.5) / h)
        wave_x = np.cos(np.pi * np.arange(w) * (column * 0.37 + 0.5) / w)
        value = wave_y @ (coefficients * gain) @ wave_x
        box = space.window(slice(s, s + 1), slice(row, row + 1), slice(column, column + 1))
        assert abs(box.item() - value) < 1e-12


@pytest.mark.parametrize("n_samples", [11, 40, 301])
@pytest.mark.parametrize("blur", [0.0, 0.6, 1.5, 2.89, 2.9, 4.5, 30.0])
def test_kernels_are_the_sums_of_their_cosines(n_samples, blur):
    kernel = cosine_domain_kernel(n_samples, blur)
    # The transform has period 2m: of its frequencies, 0 and m count once and all others twice.
    omega = np.pi * np.arange(n_samples + 1) / n_samples
    gain = np.exp(-((blur * omega) ** 2) / 2)
    gain[1:-1] *= 2
    turns = np.outer(np.arange(n_samples + 1), np.arange(n_samples + 1)) % (2 * n_samples)
    whole = np.cos(np.pi * turns / n_samples) @ gain / (2 * n_samples)
    np.testing.assert_allclose(kernel, whole[: kernel.size], rtol=0, atol=3e-16)
    assert np.abs(whole[kernel.size :]).max(initial=0) < 3e-16


@settings(max_examples=20, deadline=None)
@example(first=0.0, second=5e-324, delta=0.5)
@given(
    first=st.floats(0.0, 4.0), second=st.floats(0.0, 4.0), delta=st.sampled_from([0.5, 0.3, 0.09])
)
def test_blurs_form_a_semigroup(first, second, delta):
    """Blur by a, then by b, is blur by sqrt(a^2 + b^2), also far below one sample."""
    n = 24
    m = int(n / delta)
    grid = SplineAxis(m, n, delta, 1, np.array([first, math.hypot(first, second)]))
    matrices = []
    block = grid.block(0, m)
    for k, j in enumerate(block.first):
        rows = block.factor(k)
        full = np.zeros((m, n + 4))
        full[:, j : j + rows.shape[1]] = rows
        matrices.append(full)
    frequency = np.pi * np.arange(m) / m
    from scipy.fft import dct, idct

    gain = np.exp(-0.5 * (second / delta * frequency) ** 2)[:, None]
    twice = idct(gain * dct(matrices[0], axis=0), axis=0)
    assert np.abs(twice - matrices[1]).max() < 1e-14


@pytest.mark.parametrize("oversampling", ["spline", "cosine"])
def test_shifts_by_whole_pixels_shift_keypoints_exactly(oversampling):
    # Where 1 / delta_min is a whole number the samples shift onto samples.
    wide = blobs((70, 116), 3)
    left, right = (
        detect_keypoints(u, 1.1, 6, delta_min=0.25, oversampling=oversampling, refine=False)
        for u in (wide[:, :100], wide[:, 16:])
    )
    # The common part, without what the borders reach: 8.3 standard deviations of 2.9 px.
    left = left[left["x"].between(41, 75)]
    right = right[right["x"].between(25, 59)]
    a = positions(left, "y", "x", "sigma", "sign") - [0, 16, 0, 0]
    b = positions(right, "y", "x", "sigma", "sign")
    assert len(a) > 15
    if oversampling == "spline":
        np.testing.assert_array_equal(a, b)
    else:
        # Band-limited interpolation feels the borders from afar (it decays like 1 / distance).
        assert len({tuple(p) for p in a} & {tuple(p) for p in b}) >= 0.8 * max(len(a), len(b))


def test_shifts_move_keypoints_by_the_accuracy_of_the_sampling_otherwise():
    wide = blobs((70, 116), 3)
    left = detect_keypoints(wide[:, :100], 1.1, 15)
    right = detect_keypoints(wide[:, 16:], 1.1, 15)
    left = positions(left[left["x"].between(41, 75)], "y", "x") - [0, 16]
    right = positions(right[right["x"].between(24, 60)], "y", "x")
    gap = np.abs(left[:, None] - right[None]).max(axis=2).min(axis=1)
    assert len(left) > 15
    assert np.median(gap) < 0.02
    assert (gap < 0.1).mean() > 0.8


@settings(max_examples=8, deadline=None)
@given(
    seed=st.integers(0, 2**31), n_spo=st.integers(3, 9), mode=st.sampled_from(["spline", "cosine"])
)
def test_negation_swaps_signs(seed, n_spo, mode):
    image = blobs((24, 28), seed)
    plus = detect_keypoints(image, 1.1, n_spo, oversampling=mode)
    minus = detect_keypoints(-image, 1.1, n_spo, oversampling=mode)
    assert len(plus) == len(minus)
    np.testing.assert_array_equal(plus["sign"], -minus["sign"])
    np.testing.assert_allclose(
        positions(plus, "y", "x", "sigma"), positions(minus, "y", "x", "sigma"), atol=1e-9
    )


@settings(max_examples=8, deadline=None)
@given(seed=st.integers(0, 2**31), gain=st.floats(0.01, 255), offset=st.floats(-100, 100))
def test_gain_and_offset_do_not_move_keypoints(seed, gain, offset):
    image = blobs((24, 28), seed)
    plain = detect_keypoints(image, 1.1, 5)
    changed = detect_keypoints(gain * image + offset, 1.1, 5)
    assert len(plain) == len(changed)
    np.testing.assert_allclose(
        positions(plain, "y", "x", "sigma"), positions(changed, "y", "x", "sigma"), atol=1e-6
    )


@pytest.mark.parametrize("oversampling", ["spline", "cosine"])
@pytest.mark.parametrize("value", [0.0, 0.1, 1.0, 255.0])
def test_constant_images_have_no_keypoints(oversampling, value):
    image = np.full((20, 24), value)
    assert len(detect_keypoints(image, 0.5, 19, oversampling=oversampling)) == 0
    assert len(detect_keypoints(image, 0.5, 3, refine=False, oversampling=oversampling)) == 0


@pytest.mark.parametrize("oversampling", ["spline", "cosine"])
def test_flat_areas_do_not_explode(oversampling):
    """Rounding must not become thousands of extrema where the picture is flat."""
    image = np.full((96, 130), 0.7)
    image[10:50, 12:72] = blobs((40, 60), 7)
    image[:, 120:] = 0.2
    image = image.astype(np.float32).astype(float)
    coarse, fine = (
        detect_keypoints(image, 1.1, n, oversampling=oversampling, refine=False) for n in (3, 11)
    )
    assert len(coarse) > 10
    assert len(fine) < 2 * len(coarse)
    inside = fine["y"].between(0, 60) & fine["x"].between(2, 82)
    assert inside.mean() > 0.9


@pytest.mark.parametrize("oversampling", ["spline", "cosine"])
def test_a_straight_edge_has_no_keypoints(oversampling):
    """Constant along one axis: ridges in scale and space, equal along the edge but for rounding."""
    image = np.zeros((50, 70))
    image[:, 35:] = 0.9
    image[:, 50:52] = 0.1
    assert len(detect_keypoints(image, 0.5, 12, refine=False, oversampling=oversampling)) == 0


@pytest.mark.parametrize(
    ("n_spo", "refine", "count"),
    [
        (3, True, 12),
        (5, False, 12),
        *(
            pytest.param(n_spo, refine, 32, marks=pytest.mark.slow)
            for n_spo in (3, 5)
            for refine in (True, False)
        ),
    ],
)
def test_no_extremum_is_lost_or_doubled_at_seams(n_spo, refine, count):
    """Blobs whose scales lie around two seams: one keypoint each."""
    around = np.linspace(-1.2, 2.2, count) / n_spo
    # The seams are alike: what is tried at one lies between what is tried at the other.
    scales = 1.1 * np.concatenate([2.0 ** (1 + around[::2]), 2.0 ** (2 + around[1::2])])
    for scale in scales:
        size = scale * math.sqrt(KAPPA)
        image = blob((72, 72), (35.37, 36.11), math.hypot(size, 0.8))
        found = detect_keypoints(image, 0.8, n_spo, n_oct=3, refine=refine)
        strong = found[found["value"] < -0.05]
        assert len(strong) == 1
        error = math.log2(strong["sigma"].iloc[0] / scale) * n_spo
        assert abs(error) < (0.25 if refine else 0.75)


@pytest.mark.parametrize("n_spo", [3, 5])
def test_rows_do_not_grow_with_the_image(n_spo):
    """At coarse samplings the kernel of the grid rings; on large images its rows are cut."""
    delta = balanced_delta(n_spo, KAPPA, 1.1)
    widths, rows = [], []
    for n in (700, 1400):
        blurs = scale_space(np.zeros((4, n)), 1.1, n_spo).blurs[0]
        axis = SplineAxis(int(n / delta), n, delta, 1, blurs)
        widths.append(np.diff(axis.block(600, 640).offset) // 40)
        rows.append(axis)
    assert np.abs(np.subtract(*widths)).max() <= 4 and max(widths[1]) < 120
    whole = SplineAxis(int(350 / delta), 350, delta, 1, blurs)
    for blur in range(blurs.size):
        (first, cut), (other, full) = (
            (block.first[blur], block.factor(blur))
            for block in (rows[0].block(300, 340), whole.block(300, 340))
        )
        kept = full[:, first - other : first - other + cut.shape[1]] if first >= other else full
        at = max(other - first, 0)
        assert np.abs(cut[:, at : at + kept.shape[1]] - kept).max() < 1e-12


def test_octaves_continue_each_other():
    image = blobs((64, 80), 11)
    one = detect_keypoints(image, 1.1, 5)
    two = detect_keypoints(image, 1.1, 5, n_oct=2)
    below = one[one["sigma"] < 2.2]
    kept = two[(two["octave"] == 0) & (two["sigma"] < 2.2)]
    np.testing.assert_array_equal(positions(below, "y", "x"), positions(kept, "y", "x"))
    assert (two["octave"] == 1).sum() > 3
    assert two.loc[two["octave"] == 1, "sigma"].min() > 2.2


def test_differences_are_those_to_the_nearest_neighbour():
    image = blobs((30, 30), 5)
    found = detect_keypoints(image, 1.1, 4, refine=False)
    space = scale_space(image, 1.1, 4)
    w = space.window()
    for _, k in found.iterrows():
        s, i, j = (int(k[name]) for name in ("s", "row", "column"))
        cube = w[s - 1 : s + 2, i - 1 : i + 2, j - 1 : j + 2].ravel()
        others = np.delete(cube, 13)
        assert abs(np.abs(others - cube[13]).min() - k["difference"]) < 1e-14
        assert k["value"] == pytest.approx(cube[13], abs=1e-14)


def test_a_tolerance_keeps_exactly_the_extrema_that_exceed_it():
    space = scale_space(blobs((50, 60), 6), 1.1, 7)
    image = space.image
    every = detect_keypoints(image, 1.1, 7, refine=False)
    for epsilon in (1e-6, 1e-5, 1e-4):
        kept = detect_keypoints(image, 1.1, 7, refine=False, epsilon=epsilon)
        expected = every[every["difference"] > epsilon].reset_index(drop=True)
        assert kept.equals(expected)
    assert len(discrete_extrema(space, 1e-4)) < len(every)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"image": np.ones(4)}, "shape"),
        ({"image": np.ones((2, 2, 3))}, "grey"),
        ({"image": np.array([[1.0, np.nan], [0, 1]])}, "(0, 1)"),
        ({"image": np.array([["a", "b"]])}, "real numbers"),
        ({"camera_blur": 1.2}, "sigma_min"),
        ({"camera_blur": -1.0}, "camera_blur"),
        ({"camera_blur": math.nan}, "camera_blur"),
        ({"n_spo": 0}, "n_spo"),
        ({"n_spo": 2.5}, "n_spo"),
        ({"delta_min": 0.0}, "delta_min"),
        ({"delta_min": 1e-7}, "larger delta_min"),
        ({"delta_min": 30.0}, "smaller delta_min"),
        ({"kappa": 1.0}, "kappa"),
        ({"sigma_min": math.inf}, "sigma_min"),
        ({"oversampling": "linear"}, "spline and cosine"),
        ({"epsilon": -1.0}, "epsilon"),
        ({"max_offset": 0.0}, "max_offset"),
        ({"max_iterations": 0}, "max_iterations"),
        ({"move": "far"}, "nearest and unit_step"),
        ({"n_oct": 0}, "n_oct"),
        ({"n_oct": 9}, "octave"),
        ({"threads": 0}, "threads"),
        ({"threads": 1.5}, "threads"),
        ({"camera_blur": None}, "camera_blur"),
        ({"camera_blur": "0.5"}, "camera_blur"),
        ({"n_spo": None}, "n_spo"),
        ({"n_spo": 10**9, "delta_min": 0.5}, "n_spo"),
        ({"delta_min": "1"}, "delta_min"),
        ({"epsilon": "0"}, "epsilon"),
        ({"max_offset": None}, "max_offset"),
        ({"max_iterations": True}, "max_iterations"),
        ({"move": "far", "refine": False}, "nearest and unit_step"),
        ({"refine": "no"}, "True and False"),
        ({"scale_moves": "x"}, "scale_moves"),
        ({"max_iterations": 2.5}, "whole number"),
        ({"max_iterations": math.nan}, "max_iterations"),
        ({"delta_min": 1e-4, "image": np.zeros((300, 300))}, "samples"),
    ],
    ids=str,
)
def test_wrong_input_gets_one_line(change, words):
    arguments = {"image": blobs((20, 20), 8), "camera_blur": 0.5} | change
    with pytest.raises(InputError, match=None) as error:
        detect_keypoints(**arguments)
    assert words in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("oversampling", ["spline", "cosine"])
@pytest.mark.parametrize("max_offset", [0.3, 0.6, 1.5])
def test_positions_stay_in_the_documented_range(oversampling, max_offset):
    image = np.random.default_rng(5).random((120, 140))
    options = {"max_offset": max_offset, "oversampling": oversampling}
    found = detect_keypoints(image, 0.5, 7, 0.2, 0.8, n_oct=2, **options)
    assert len(found) > 5
    step = 0.2 * 2.0 ** found["octave"]
    for name, size in zip(("y", "x"), image.shape, strict=True):
        assert (found[name] > (1 - max_offset) * step).all()
        assert (found[name] < size - 0.2 - (1 - max_offset) * step).all()


def test_keypoints_are_found_beyond_the_last_pixel():
    # Its mirror image makes a blob on the border whole: the centre lies half a pixel beyond.
    image = blob((30, 34), (29.5, 33.5), math.hypot(2.0, 0.9))
    found = detect_keypoints(image, 0.9, 15, oversampling="cosine")
    at = found.loc[found["value"].idxmin()]
    assert [at["y"], at["x"]] == pytest.approx([29.5, 33.5], abs=0.01)
    noise = np.random.default_rng(6).random((40, 400))
    assert detect_keypoints(noise, 0.8, 9, 0.1)["y"].max() == pytest.approx(39.594, abs=0.001)


@pytest.mark.parametrize("mask", [[[0, 1], [0, 0]], [[1, 1], [1, 1]]])
def test_what_is_masked_is_not_taken_for_seen(mask, tmp_path):
    masked = np.ma.array(np.tile(np.float64([[0.2, 0.4], [0.3, 0.5]]), (9, 9)))
    plain = detect_keypoints(masked, 0.5)  # nothing is masked yet
    pd.testing.assert_frame_equal(plain, detect_keypoints(masked.data, 0.5))
    masked.mask = np.tile(mask, (9, 9))
    spec = ViewSpec(1.0, 2.0, (3, 3))
    for use in (
        lambda: detect_keypoints(masked, 0.5),
        lambda: scale_space(masked, 0.5),
        lambda: true_extrema(masked, 0.5),
        lambda: scene_extrema(masked, spec),
        lambda: simulate_view(masked, 1.0, 2.0, (3, 3)),
        lambda: fit_psf(masked),
        lambda: border_level(masked),
        lambda: write_picture(masked, tmp_path / "u.npy"),
    ):
        with pytest.raises(InputError, match=rf"{np.sum(masked.mask)} masked values"):
            use()
    assert list(tmp_path.iterdir()) == []


@settings(max_examples=8, deadline=None)
@given(
    seed=st.integers(0, 2**31), n_spo=st.integers(3, 9), mode=st.sampled_from(["spline", "cosine"])
)
def test_a_transposed_picture_has_transposed_keypoints(seed, n_spo, mode):
    image = blobs((22, 37), seed)  # oblong: no axis can stand for the other
    plain, turned = (detect_keypoints(it, 1.1, n_spo, oversampling=mode) for it in (image, image.T))
    assert len(plain) == len(turned)
    order = np.lexsort((turned["row"], turned["column"], turned["s"], turned["octave"]))
    before = plain.sort_values(["octave", "s", "row", "column"])
    for names in (("y", "x", "sigma", "value", "sign"), ("row", "column", "s", "octave")):
        swapped = [
            {"y": "x", "x": "y", "row": "column", "column": "row"}.get(it, it) for it in names
        ]
        np.testing.assert_allclose(
            turned.iloc[order][swapped], before[list(names)], rtol=1e-9, atol=1e-7
        )


@pytest.mark.parametrize("sign", [1, -1])
def test_grey_values_are_allowed_up_to_their_limits(sign):
    picture = blobs((22, 37), 1)
    picture /= np.abs(picture).max()
    n = len(detect_keypoints(picture, 1.1, 3))
    for largest, allowed in ((1e-90, True), (1e90, True), (0.9e-90, False), (1.1e90, False)):
        image = sign * largest * picture
        if allowed:
            assert len(detect_keypoints(image, 1.1, 3)) == n > 0
        else:
            with pytest.raises(InputError, match="allowed are 1e-90 to 1e90"):
                detect_keypoints(image, 1.1, 3)


@pytest.mark.parametrize("name", ["alpha_s", "alpha_y", "alpha_x"])
@pytest.mark.parametrize("sign", [1, -1])
def test_an_offset_that_meets_the_largest_one_exactly_is_not_accepted(name, sign):
    trace = pd.DataFrame({"keypoint": [0, 0, 1, 2, 2], "model": [1, 2, 1, 1, 2]})
    trace = trace.assign(alpha_s=0.1, alpha_y=-0.2, alpha_x=0.3)
    trace[name] = sign * np.array([0.6, 0.5999, 0.6, 0.1, 0.2])
    assert accepted(trace, 0.6, 2)["model"].tolist() == [2, 1]
    assert accepted(trace, 0.6, 2)["keypoint"].tolist() == [0, 2]
    assert accepted(trace, 0.6, 1)["keypoint"].tolist() == [2]  # the second model comes too late
    assert accepted(trace, math.inf, 2)["model"].tolist() == [1, 1, 1]
    shuffled = trace.iloc[[4, 2, 0, 3, 1]].sort_values("model", kind="stable")
    assert set(accepted(shuffled, 0.6, 2)["keypoint"]) == {0, 2}
