"""Gaussians fitted to pictures of point spread functions."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.special import erf

from keystab.camera.psf_fit import border_level, fit_psf
from keystab.errors import InputError


def bump(shape=(41, 47), y=20.3, x=22.6, major=3.0, minor=3.0, angle=0.0, height=1.0):
    rows, columns = np.indices(shape)
    dy, dx = rows - y, columns - x
    along = dx * np.cos(angle) + dy * np.sin(angle)
    across = dy * np.cos(angle) - dx * np.sin(angle)
    return height * np.exp(-0.5 * ((along / major) ** 2 + (across / minor) ** 2))


@settings(max_examples=25, deadline=None)
@given(st.floats(0.4, 6.0), st.floats(15.0, 25.0), st.floats(15.0, 25.0), st.floats(1e-3, 1e5))
def test_a_gaussian_fits_itself(sd, y, x, height):
    fit = fit_psf(bump(y=y, x=x, major=sd, minor=sd, height=height))
    assert [fit.blur, fit.y, fit.x] == pytest.approx([sd, y, x], rel=1e-6)
    assert [fit.height, fit.residual] == pytest.approx([height, 0.0], rel=1e-6, abs=1e-6)


@settings(max_examples=25, deadline=None)
@given(st.floats(1.5, 4.0), st.floats(1.05, 1.8), st.floats(-1.5, 1.5))
def test_axes_and_direction_of_an_elliptic_gaussian(minor, ratio, angle):
    fit = fit_psf(
        bump(shape=(81, 81), y=40.0, x=40.0, major=ratio * minor, minor=minor, angle=angle)
    )
    assert [fit.major, fit.minor] == pytest.approx([ratio * minor, minor], rel=1e-5)
    assert np.sin(fit.angle - angle) == pytest.approx(0.0, abs=1e-4)
    assert fit.general_residual < 1e-6
    # The nearest isotropic one has the geometric mean of both axes: where its variance is the
    # product of the standard deviations, the overlap 2 s / (1 + s^2) of each axis is stationary.
    assert fit.blur == pytest.approx(np.sqrt(ratio) * minor, rel=1e-4)


def test_oversampling_turns_samples_into_pixels():
    plain, finer = (fit_psf(bump(major=4.0, minor=3.0), oversampling=k) for k in (1.0, 4.0))
    assert finer.blur == pytest.approx(plain.blur / 4)
    assert [finer.major, finer.minor] == pytest.approx([plain.major / 4, plain.minor / 4])
    assert (finer.y, finer.x, finer.residual) == (plain.y, plain.x, plain.residual)


def test_a_background_is_subtracted_first():
    picture = bump(height=0.6) + 0.2
    assert border_level(picture) == pytest.approx(0.2, abs=1e-6)
    fit = fit_psf(picture, background=0.2)
    assert [fit.blur, fit.height, fit.residual] == pytest.approx([3.0, 0.6, 0.0], abs=1e-6)
    with pytest.raises(InputError, match="or subtract its background"):
        fit_psf(picture)


def test_a_square_pixel_has_the_gaussian_of_a_box():
    # A pixel of 32 samples that lens and noise leave alone; see test_optics for the number.
    picture = np.zeros((96, 96))
    picture[32:64, 32:64] = 1.0
    fit = fit_psf(picture, oversampling=32.0)
    assert fit.blur == pytest.approx(0.3572, abs=3e-4)
    u = 1 / (np.sqrt(8) * fit.blur)
    assert fit.residual**2 == pytest.approx(
        1 - (2 * np.sqrt(np.pi) * fit.blur * erf(u) ** 2) ** 2, abs=2e-3
    )
    assert fit.major == pytest.approx(fit.minor, rel=1e-6)


def test_noise_and_negative_values_do_little():
    noise = 0.01 * np.random.default_rng(3).standard_normal((41, 47))
    fit = fit_psf(bump() + noise)
    assert fit.blur == pytest.approx(3.0, abs=0.01)
    assert fit.residual == pytest.approx(np.sqrt((noise**2).sum() / (bump() ** 2).sum()), rel=0.1)


def test_the_brightest_of_two_bumps_counts_where_the_fit_begins():
    fit = fit_psf(
        bump(y=10, x=10, major=1.5, minor=1.5) + 0.6 * bump(y=35, x=40, major=1.5, minor=1.5)
    )
    assert [fit.y, fit.x, fit.blur] == pytest.approx([10.0, 10.0, 1.5], abs=1e-3)


@pytest.mark.parametrize(
    ("picture", "options", "words"),
    [
        (np.ones((5, 5)), {}, "the picture is constant"),
        (np.zeros((5, 5)), {}, "the picture is constant"),
        (bump() * np.where(np.arange(47) == 3, np.nan, 1.0), {}, "holds NaN or infinite"),
        (np.ones((2, 9)), {}, "at least 3 x 3 samples"),
        (np.ones(9), {}, "at least 3 x 3 samples"),
        (bump(), {"background": 1.5}, "nothing in the picture lies above the background"),
        (bump(), {"oversampling": 0.0}, "oversampling is 0.0"),
        (bump(), {"background": np.inf}, "background is inf"),
        (np.eye(9)[4][:, None] * np.eye(9)[4], {}, "sampled more finely"),
        (bump(major=60.0, minor=60.0), {}, "less than 1.5 standard deviations of its bump"),
    ],
)
def test_what_cannot_be_fitted_is_named_in_one_line(picture, options, words):
    with pytest.raises(InputError, match=words) as caught:
        fit_psf(picture, **options)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(("y", "x"), [(9.0, 48.5), (12.5, 11.0)])
def test_the_fit_of_a_transposed_picture_is_transposed(y, x):
    # Oblong, its bump farther along than the picture is high: no axis can be taken for the other.
    picture = bump((21, 61), y, x, major=3.2, minor=2.4, angle=0.4)
    fit, turned = fit_psf(picture), fit_psf(picture.T)
    assert (fit.y, fit.x) == pytest.approx((y, x), abs=1e-3)
    assert (turned.y, turned.x) == pytest.approx((fit.x, fit.y), abs=1e-6)
    same = [(it.blur, it.height, it.residual, it.major, it.minor) for it in (fit, turned)]
    assert same[0] == pytest.approx(same[1], rel=1e-6)
    assert np.sin(turned.angle - (np.pi / 2 - fit.angle)) == pytest.approx(0.0, abs=1e-6)


def test_a_mirrored_picture_has_the_mirrored_fit():
    picture = bump((21, 61), 9.0, 48.5, major=3.2, minor=2.4, angle=0.4)
    fit, mirrored = fit_psf(picture), fit_psf(picture[:, ::-1])
    assert (mirrored.y, mirrored.x) == pytest.approx((fit.y, 60 - fit.x), abs=1e-6)
    assert np.sin(mirrored.angle + fit.angle) == pytest.approx(0.0, abs=1e-6)


def test_the_border_is_the_outermost_sample_of_each_side_and_nothing_else():
    # 9 samples on each side of the level: one more or less, at any place, and the median moves.
    picture = np.full((4, 7), 9.0)
    ring = [(y, x) for y, x in np.ndindex(4, 7) if y in (0, 3) or x in (0, 6)]
    for number, place in enumerate(ring):
        picture[place] = number
    for turned in (picture, picture[::-1], picture[:, ::-1], picture.T, picture.T[::-1]):
        assert border_level(turned) == 8.5
    picture[1:3, 1:6] = -9.0
    assert border_level(picture) == 8.5


@pytest.mark.parametrize("shape", [(3, 3), (3, 9), (9, 3), (2, 9), (9, 2)])
def test_a_picture_has_three_samples_along_each_side_at_least(shape):
    if min(shape) < 3:
        with pytest.raises(InputError, match="at least 3 x 3"):
            border_level(np.ones(shape))
    else:
        assert border_level(np.ones(shape)) == 1.0


@pytest.mark.parametrize(("y", "x"), [(-1.5, 20.0), (20.0, -1.5), (41.5, 20.0), (20.0, 47.5)])
def test_a_bump_whose_centre_lies_outside_of_the_picture_is_none(y, x):
    with pytest.raises(InputError, match="no bump that a Gaussian fits"):
        fit_psf(bump(y=y, x=x))
