"""Blobs: closed forms against numerical maxima, and against what the detector finds."""

import math

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from scipy.optimize import minimize_scalar

from keystab.errors import InputError
from keystab.experiments.blob_scales import blob_table, laplacian_scale
from keystab.io.tables import read_table
from keystab.scalespace import cosine_series
from keystab.scalespace.gaussian_blobs import (
    blob_image,
    dog_at_centre,
    dog_extremum_scale,
    dog_extremum_value,
    laplacian_at_centre,
    laplacian_extremum_scale,
    smallest_blob,
    variance_at_zero,
)
from keystab.stages import detect_blobs, match_blobs

sizes, ratios, blurs = st.floats(1.5, 8.0), st.floats(1.01, 2.0), st.floats(0.0, 0.9)


def lowest(function, low, high):
    found = minimize_scalar(
        lambda log: function(np.exp(log)),
        bounds=(np.log(low), np.log(high)),
        method="bounded",
        options={"xatol": 1e-10},
    )
    return np.exp(found.x), found.fun


@given(sizes, ratios, blurs, blurs)
@example(1.5, 2.0, 0.0, 0.875)  # smallest where scales begin, which is no extremum
@example(1.5, 2.0, 0.0, 0.8)
def test_extrema_are_where_numerical_minima_are(s, kappa, c, assumed):
    low, high = max(assumed, 1e-3), 4 * s
    sigma, value = lowest(lambda t: float(dog_at_centre(t, s, kappa, c, assumed)), low, high)
    scale = float(dog_extremum_scale(s, kappa, c, assumed))
    if sigma > low * (1 + 1e-4):
        assert scale == pytest.approx(sigma, rel=1e-4)
        assert float(dog_extremum_value(s, kappa, c, assumed)) == pytest.approx(value, rel=1e-9)
    else:
        assert math.isnan(scale) or scale < low * (1 + 3e-4)
    sigma, _ = lowest(lambda t: float(laplacian_at_centre(t, s, c, assumed)), low, high)
    assert float(laplacian_extremum_scale(s, c, assumed)) == pytest.approx(sigma, rel=1e-4)


def test_the_papers_scales_and_that_of_a_wrong_blur():
    s = np.array([1.5, 2.0, 4.0])
    np.testing.assert_allclose(dog_extremum_scale(s, 1.44), s / 1.2)
    np.testing.assert_allclose(dog_extremum_scale(s, 1.44, camera_blur=0.9), s / 1.2)
    np.testing.assert_allclose(laplacian_extremum_scale(s), s)
    wrong = dog_extremum_scale(s, 1.44, camera_blur=0.9, assumed_blur=0.4)
    np.testing.assert_allclose(wrong, np.sqrt((s**2 + 0.81 - 0.16) / 1.44))
    # A wrong blur is a blob of another size.
    other = np.sqrt(variance_at_zero(s, 0.9, 0.4))
    sigma = np.linspace(0.5, 4, 8)[:, None]
    ratio = dog_at_centre(sigma, s, 1.44, 0.9, 0.4) / dog_at_centre(sigma, other, 1.44)
    np.testing.assert_allclose(ratio, np.broadcast_to((s / other) ** 2, ratio.shape))


def test_the_laplacian_is_the_limit_of_the_difference():
    sigma, kappa = np.linspace(0.5, 5, 10), 1 + 1e-6
    dog = dog_at_centre(sigma, 2.0, kappa, 0.8, 0.4) / ((kappa**2 - 1) / 2)
    np.testing.assert_allclose(dog, laplacian_at_centre(sigma, 2.0, 0.8, 0.4), rtol=1e-5)


def test_closed_forms_are_those_of_the_image():
    s, c, assumed, sigma, kappa = 2.0, 0.9, 0.6, 1.7, 1.3
    image = blob_image(s, c, (61, 63), (30.0, 31.0))
    coefs = cosine_series.coefficients(image)
    lower, upper = (np.sqrt(scale**2 - assumed**2) for scale in (sigma, kappa * sigma))
    dog = [
        float(cosine_series.evaluate(coefs, [30.0], [31.0], blur)[0, 0]) for blur in (upper, lower)
    ]
    expected = float(dog_at_centre(sigma, s, kappa, c, assumed))
    assert dog[0] - dog[1] == pytest.approx(expected, rel=1e-9)
    second = [
        cosine_series.evaluate(coefs, [30.0], [31.0], lower, d)[0, 0] for d in ((2, 0), (0, 2))
    ]
    expected = float(laplacian_at_centre(sigma, s, c, assumed))
    assert sigma**2 * sum(second) == pytest.approx(expected, rel=1e-9)
    assert image.sum() == pytest.approx(2 * np.pi * s**2, rel=1e-9)  # the camera loses no light


def test_where_theory_ends():
    kappa, c, assumed = 1.3, 0.5, 1.0
    least = smallest_blob(kappa, c, assumed)
    assert float(dog_extremum_scale(1.0001 * least, kappa, c, assumed)) == pytest.approx(
        assumed, rel=1e-3
    )
    assert np.isnan(dog_extremum_scale(0.9999 * least, kappa, c, assumed))
    assert np.isnan(dog_extremum_value(0.9999 * least, kappa, c, assumed))
    # There the difference rises from the first scale that blurring reaches.
    sigma = np.linspace(assumed, 6, 400)
    assert (np.diff(dog_at_centre(sigma, 0.9999 * least, kappa, c, assumed)) > 0).all()
    # And where the variance is negative, too.
    assert variance_at_zero(0.3, c, assumed) < 0
    assert (np.diff(dog_at_centre(sigma, 0.3, kappa, c, assumed)) > 0).all()
    assert np.isnan(dog_at_centre(0.99 * assumed, 2.0, kappa, c, assumed))
    assert np.isnan(laplacian_at_centre(0.99 * assumed, 2.0, c, assumed))
    assert smallest_blob(kappa, 0.8, first_scale=1.1) == pytest.approx(1.1 * np.sqrt(kappa))
    assert smallest_blob(1.0, 2.0, 0.1) == 0.0


@pytest.fixture(scope="module")
def table():
    return blob_table(
        [1.5, 2.5], kappas=[1.1, 2 ** (1 / 3)], n_spo=(3, 12), assumed_blurs=[0.5, 1.1]
    )


def test_the_table_holds_three_experiments(table):
    assert table.groupby("experiment").size().to_dict() == {
        "operator": 6,
        "sampling": 8,
        "assumed_blur": 6,
    }
    dogs = table[table["operator"] == "dog"]
    theory = dog_extremum_scale(
        dogs["blob"], dogs["kappa"], dogs["camera_blur"], dogs["assumed_blur"]
    )
    np.testing.assert_allclose(dogs["theory"], theory)
    np.testing.assert_allclose(table["error"], table["detected"] / table["theory"] - 1)
    assert (table["camera_blur"] == 0.8).all() and (table["sigma_min"] == 1.1).all()


def test_detection_agrees_with_theory(table):
    found = table.dropna(subset=["detected"])
    fine = found[(found["n_spo"] == 12) & (found["detection"] == "refined")]
    assert len(fine) == 2 * 2 + 2 + 2 * 3 - 1  # too much blur assumed hides the small blob
    assert fine["error"].abs().max() < 3e-3
    grid = found[found["detection"] == "discrete"]
    # A grid scale is at most a little more than half a step away.
    steps = abs(np.log2(1 + grid["error"])) * grid["n_spo"]
    assert len(grid) == 4 and steps.max() < 0.6
    laplacian = found[found["operator"] == "laplacian"]
    assert laplacian["error"].abs().max() < 1e-6


def test_blobs_below_the_first_scale_are_not_found():
    lost = blob_table([1.0], kappas=[1.2], n_spo=[6], assumed_blurs=[])
    dogs = lost[lost["operator"] == "dog"]
    assert dogs["detected"].isna().all() and dogs["theory"].notna().all()


def test_scales_begin_at_the_largest_blur():
    table = blob_table([3.0], kappas=[1.2], n_spo=[6], assumed_blurs=[1.3], sigma_min=1.0)
    assert (table["sigma_min"] == 1.3).all()
    assert table["error"].abs().max() < 0.1


def test_no_laplacian_extremum_at_an_end_of_the_range():
    image = blob_image(2.0, 0.8, (41, 41), (20.0, 20.0))
    assert np.isnan(laplacian_scale(image, (20.0, 20.0), 0.8, near=0.4))
    assert laplacian_scale(image, (20.0, 20.0), 0.8, near=3.0) == pytest.approx(2.0, rel=1e-6)


@pytest.mark.parametrize("blob", [2.6, 3.6])
def test_the_laplacian_has_its_extremum_to_the_digits_of_the_series(blob):
    # Neither what lies beyond the border nor what the pixels do not resolve is above 1e-14.
    n = 2 * math.ceil(8 * math.hypot(blob, 0.8)) + 1
    image, centre = blob_image(blob, 0.8, (n, n), (n // 2, n // 2)), (n // 2, n // 2)
    # Searched for as a flat maximum it was off by 1e-8, another way on every processor.
    assert laplacian_scale(image, centre, 0.8, near=1.2 * blob) == pytest.approx(blob, rel=1e-13)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: variance_at_zero(0.0), "blob: 0 is no standard deviation"),
        (lambda: dog_extremum_scale([2.0, -1.0]), "blob: .* at least 0"),
        (lambda: dog_extremum_scale(2.0, kappa=1.0), "kappa: 1.0 must be finite and above 1"),
        (lambda: dog_at_centre(np.nan, 2.0), "sigma: "),
        (lambda: laplacian_extremum_scale(2.0, assumed_blur=-1), "assumed_blur: "),
        (lambda: smallest_blob(kappa=0.5), "kappa is 0.5"),
        (lambda: blob_image(2.0, 0.8, (0, 4), (0, 0)), "height is 0"),
        (lambda: blob_table([]), "blobs: none were given"),
        (lambda: blob_table([2.0, 0.0]), "blobs is 0.0"),
        (lambda: blob_table([2.0], sigma_min=-1.0, camera_blur=-1.0), "camera_blur is -1"),
    ],
)
def test_wrong_arguments_are_named(call, words):
    with pytest.raises(InputError, match=words) as caught:
        call()
    assert "\n" not in str(caught.value)


def test_detections_serve_every_limit_of_the_refinement(tmp_path):
    ways = [
        *("--size-from", "1.5", "--size-to", "3", "--size-count", "2", "--kappas", "1.2"),
        *("--n-spo", "3", "--camera-blur", "0.8", "--assumed-blurs", "0.5"),
        *("--sigma-min", "1.1", "--kappa", "1.25"),
        *("--extrema", str(tmp_path / "extrema.parquet")),
        *("--traces", str(tmp_path / "traces.parquet")),
    ]
    assert detect_blobs.main(ways) == 0
    for max_offset, max_iterations in ((0.6, 2), (0.3, 1)):
        limits = ["--max-offset", str(max_offset), "--max-iterations", str(max_iterations)]
        assert match_blobs.main([*ways, *limits, "--table", str(tmp_path / "table.csv")]) == 0
        anew = blob_table(
            [1.5, 3.0],
            kappa=1.25,
            kappas=[1.2],
            n_spo=[3],
            assumed_blurs=[0.5],
            max_offset=max_offset,
            max_iterations=max_iterations,
        )
        assert read_table(tmp_path / "table.csv").equals(anew)
