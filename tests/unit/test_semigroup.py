"""Three discrete Gaussian blurs against closed forms, and the property that figure 1 tests."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import curve_fit

from keystab.errors import InputError
from keystab.experiments.semigroup_table import SIGMAS, semigroup_table
from keystab.scalespace.semigroup import (
    METHODS,
    blob_profile,
    blur_profile,
    discrete_analogue_kernel,
    fitted_blur,
    sampled_kernel,
    semigroup_residual,
)

widths = st.floats(0.1, 2.0)


def variance(kernel):
    n = np.arange(len(kernel)) - len(kernel) // 2
    return float((kernel * n**2).sum())


@given(widths, st.floats(1.0, 6.0))
def test_the_sampled_kernel_is_a_normalised_cut_gaussian(sigma, truncation):
    kernel = sampled_kernel(sigma, truncation)
    radius = len(kernel) // 2
    assert truncation * sigma <= radius < truncation * sigma + 1
    assert kernel.sum() == pytest.approx(1.0, abs=1e-15)
    assert kernel[radius + 1] / kernel[radius] == pytest.approx(np.exp(-0.5 / sigma**2))
    assert (kernel == kernel[::-1]).all()


@given(widths, widths)
def test_discrete_analogues_compose_and_their_variances_add(first, second):
    composed = np.convolve(
        discrete_analogue_kernel(first, 60), discrete_analogue_kernel(second, 60), mode="same"
    )
    np.testing.assert_allclose(
        composed, discrete_analogue_kernel(np.hypot(first, second), 60), atol=1e-15
    )
    assert variance(composed) == pytest.approx(first**2 + second**2, rel=1e-12)


def test_a_narrow_sampled_kernel_falls_short_of_its_variance():
    assert variance(sampled_kernel(0.3)) < 0.1 * 0.3**2
    # What is left at 1.5 px is the cut at 4 sigma: the variance beyond it is 1.1e-3 of the whole.
    assert variance(sampled_kernel(1.5)) == pytest.approx(1.5**2, rel=2e-3)


@pytest.mark.parametrize("sigma", [0.1, 0.5, 1.5])
def test_the_dct_blurs_a_well_sampled_blob_exactly(sigma):
    # At 2 px the blob's spectrum is 3e-9 of its maximum at the Nyquist frequency.
    widened = np.hypot(2.0, sigma)
    blurred = blur_profile(blob_profile(81, 2.0), sigma, "dct")
    np.testing.assert_allclose(blurred, 2.0 / widened * blob_profile(81, widened), atol=1e-8)


@pytest.mark.parametrize("method", METHODS)
def test_every_blur_keeps_the_mean_the_symmetry_and_the_length(method):
    blob = blob_profile(81, 1.1)
    blurred = blur_profile(blob, 0.9, method)
    assert blurred.shape == blob.shape
    assert blurred.sum() == pytest.approx(blob.sum(), rel=1e-14)
    np.testing.assert_allclose(blurred, blurred[::-1], atol=1e-15)
    assert blurred.max() < blob.max()


@given(st.floats(0.4, 5.0), st.floats(0.1, 100.0))
def test_the_fit_recovers_a_gaussian(blur, amplitude):
    assert fitted_blur(amplitude * blob_profile(101, blur)) == pytest.approx(blur, rel=1e-10)


def test_the_fit_of_the_profile_is_the_fit_of_the_picture():
    profile = blob_profile(41, 1.5) + 0.4 * blob_profile(41, 3.5)  # no Gaussian
    y, x = np.indices((41, 41)) - 20

    def gaussian(_, amplitude, sd):
        return (amplitude * np.exp(-0.5 * (x**2 + y**2) / sd**2)).ravel()

    picture = np.outer(profile, profile).ravel()
    (_, sd), _ = curve_fit(gaussian, None, picture, p0=(1.0, 2.0), ftol=1e-14, xtol=1e-14)
    assert fitted_blur(profile) == pytest.approx(sd, rel=1e-7)


@pytest.mark.parametrize("method", METHODS)
def test_no_other_width_explains_what_the_fit_leaves(method):
    profile = blob_profile(121, 1.1)
    for _ in range(10):
        profile = blur_profile(profile, 1.3, method)
    bump = blob_profile(121, fitted_blur(profile))
    wider = bump * (np.arange(121) - 60) ** 2
    # To rounding; a search for the least misfit, which is flat, leaves a million times as much.
    left = profile - (profile @ bump) / (bump @ bump) * bump
    assert abs(left @ wider) < 1e-14 * (profile @ wider)


def test_the_residual_is_that_of_the_pictures():
    single, repeated = np.array([0.5, 2.0, 0.5]), np.array([0.5, 1.8, 0.6])
    assert semigroup_residual(repeated, single) == pytest.approx((4.0 - 1.8**2) / 4.0)
    assert semigroup_residual(single, single) == 0.0


@pytest.fixture(scope="module")
def by_method():
    return {name: rows for name, rows in semigroup_table().groupby("method")}


def test_the_table_covers_every_method_and_blur(by_method):
    assert set(by_method) == set(METHODS)
    for rows in by_method.values():
        assert rows["sigma"].tolist() == list(SIGMAS)
        np.testing.assert_allclose(rows["theory"] ** 2, 1.1**2 + 10 * rows["sigma"] ** 2)
        assert (rows["c"] == 1.1).all() and (rows["n_passes"] == 10).all()


def test_the_sampled_kernel_fails_below_two_thirds_of_a_pixel_and_not_above(by_method):
    rows = by_method["sampled"]
    error = abs(rows["repeated_blur"] / rows["theory"] - 1)
    low, high = rows["sigma"] <= 0.65, rows["sigma"] >= 0.8
    assert (error[low] > 3e-3).all() and error[low].max() > 0.2
    assert (error[high] < 2e-4).all()
    assert (rows["residual"][low] > 5e-3).all() and (rows["residual"][high] < 5e-4).all()


def test_the_dct_has_the_property_at_every_blur(by_method):
    rows = by_method["dct"]
    # Rounding of ten transforms there and back; measured 4e-15.
    assert rows["residual"].max() < 5e-14
    np.testing.assert_allclose(rows["repeated_blur"], rows["single_blur"], rtol=1e-7)
    # The blob itself is sampled: at 1.1 px its spectrum is 2.5e-3 of its maximum at Nyquist.
    np.testing.assert_allclose(rows["repeated_blur"], rows["theory"], rtol=3e-5)


def test_the_discrete_analogue_has_the_property_without_being_gaussian(by_method):
    rows = by_method["discrete_analogue"]
    assert rows["residual"].max() < 5e-14
    shortfall = 1 - rows["repeated_blur"] / rows["theory"]
    assert 0.02 < shortfall.max() < 0.03 and (shortfall > 0).all()


@pytest.mark.parametrize(
    ("wrong", "name"),
    [
        ({"c": 0.0}, "c"),
        ({"c": float("nan")}, "c"),
        ({"n_passes": 0}, "n_passes"),
        ({"n_passes": 2.5}, "n_passes"),
        ({"sigmas": []}, "sigmas"),
        ({"sigmas": [0.5, -0.1]}, "sigmas"),
        ({"methods": ["box"]}, "methods"),
        ({"methods": []}, "methods"),
        ({"truncation": 0.0}, "truncation"),
    ],
)
def test_parameters_out_of_range_are_named(wrong, name):
    with pytest.raises(InputError, match=f"^{name}: ") as caught:
        semigroup_table(**wrong)
    assert "\n" not in str(caught.value)


def test_an_unknown_method_is_named():
    with pytest.raises(InputError, match="choose one of sampled, dct, discrete_analogue"):
        blur_profile(blob_profile(11, 1.0), 0.5, "box")
