"""Lenses and pixels against closed forms, and Gaussian fits against brute force in the plane."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad
from scipy.optimize import brentq, minimize
from scipy.special import erf, j1

from keystab.camera.optics import (
    MODELS,
    Camera,
    camera,
    diffraction_mtf,
    fit_camera,
    lens_transfer,
    pixel_transfer,
    psf_profile,
)
from keystab.errors import InputError
from keystab.experiments.camera_blur import optics_table, profile_table

# The Gaussian nearest to a box of side 1: c^2 erf(u)^2 / c is greatest at u = 1 / (sqrt(8) c).
BOX = 1 / (np.sqrt(8) * brentq(lambda u: erf(u) - 4 * u * np.exp(-(u**2)) / np.sqrt(np.pi), 0.5, 2))
# The Gaussian nearest to a disc of radius 1: (1 - exp(-x)) c is greatest at x = 1 / (2 c^2).
DISC = 1 / np.sqrt(2 * brentq(lambda x: 1 - np.exp(-x) - 2 * x * np.exp(-x), 0.5, 3))


def test_a_perfect_lens_has_the_closed_form():
    f = np.linspace(0, 1.2, 60)
    assert diffraction_mtf([0.0, 1.0, 1.2]).tolist() == [1.0, 0.0, 0.0]
    np.testing.assert_allclose(lens_transfer(f), diffraction_mtf(f), atol=1e-12)
    # Its integral over the plane is the height of the Airy pattern, pi / 4 per (wavelength N)^2.
    volume, _ = quad(lambda v: 2 * np.pi * v * float(diffraction_mtf(v)), 0, 1)
    assert volume == pytest.approx(np.pi / 4, rel=1e-8)
    # And along a line it is 4 / (3 pi) times 1.
    assert quad(lambda v: float(diffraction_mtf(v)), 0, 1)[0] == pytest.approx(4 / (3 * np.pi))


def test_the_spread_of_a_perfect_lens_is_the_airy_pattern():
    r = np.linspace(0.05, 6, 40)
    z = np.pi * r / (0.5 * 4)
    airy = np.pi / 4 / (0.5 * 4) ** 2 * (2 * j1(z) / z) ** 2
    tiny = Camera(wavelength=0.5, f_number=4.0, pitch=1e-3)
    np.testing.assert_allclose(psf_profile(tiny, r), airy, atol=1e-6 * np.pi / 16)


@pytest.mark.parametrize(("w20", "w40"), [(0.7, 0.0), (3.0, 0.0), (-2.0, 2.0), (0.0, 1.3)])
def test_aberrations_against_the_sum_over_a_pupil(w20, w40):
    n = 1200
    y, x = (np.indices((n, n)) + 0.5) / n * 2 - 1

    def pupil(x):
        square = x**2 + y**2
        return (square <= 1) * np.exp(2j * np.pi * (w20 * square + w40 * square**2))

    for f in (0.1, 0.3, 0.6):
        expected = (pupil(x + f) * pupil(x - f).conj()).sum() * 4 / n**2 / np.pi
        # Samples at the edge of the overlap count whole or not at all.
        assert lens_transfer([f], w20, w40)[0] == pytest.approx(expected.real, abs=2e-3)
        assert abs(expected.imag) < 1e-3


def test_the_sign_of_defocus_does_not_matter_and_aberrations_only_lower_contrast():
    f = np.linspace(0, 1, 30)
    np.testing.assert_allclose(lens_transfer(f, 1.5), lens_transfer(f, -1.5), atol=1e-12)
    for w in ((1.5, 0.0), (-3.0, 3.0)):
        assert (abs(lens_transfer(f, *w)) <= diffraction_mtf(f) + 1e-12).all()
        assert lens_transfer([0.0], *w)[0] == pytest.approx(1.0, abs=1e-12)


def test_far_out_of_focus_the_lens_makes_a_disc():
    w20, f = 40.0, np.linspace(0.002, 0.03, 12)
    # The disc has the diameter 8 w20 wavelength N, so 8 w20 f in units of the cut-off.
    z = np.pi * 8 * w20 * f
    np.testing.assert_allclose(lens_transfer(f, w20), 2 * j1(z) / z, atol=0.02)
    wide = Camera(0.55, 1.4, pitch=0.1, w20=w20)
    radius = 4 * w20 * 0.55 * 1.4
    assert fit_camera(wide).blur * 0.1 == pytest.approx(DISC * radius, rel=0.02)


def test_the_pixel_is_a_product_of_boxes():
    assert pixel_transfer(0.0, 0.0, 5.0) == 1.0
    f = np.linspace(0.01, 1, 20)
    expected = np.sin(np.pi * f * 5) / (np.pi * f * 5)
    np.testing.assert_allclose(pixel_transfer(f, 0.0, 5.0), expected, atol=1e-15)
    np.testing.assert_allclose(pixel_transfer(f, 2 * f, 5.0), expected * np.sinc(10 * f))


def test_a_pixel_alone_has_the_gaussian_of_a_box():
    assert pytest.approx(0.3572, abs=1e-4) == BOX
    # What diffraction adds goes down with the ratio of its width to the pixel's.
    errors = [fit_camera(Camera(0.2, 1.0, pitch)).blur / BOX - 1 for pitch in (10.0, 40.0)]
    assert 0 < errors[1] < 0.3 * errors[0] < 1e-3
    filled = fit_camera(Camera(0.2, 1.0, 40.0, fill_factor=0.25)).blur
    assert filled == pytest.approx(0.5 * BOX, rel=2e-3)
    # The residual of the square against its Gaussian, in closed form.
    overlap = 2 * np.pi * BOX**2 * erf(1 / (np.sqrt(8) * BOX)) ** 2
    residual = np.sqrt(1 - overlap**2 / (np.pi * BOX**2))
    assert fit_camera(Camera(0.2, 1.0, 60.0)).residual == pytest.approx(residual, abs=0.01)


@settings(max_examples=10, deadline=None)
@given(st.floats(0.3, 0.8), st.floats(1.2, 22.0))
def test_diffraction_alone_grows_with_wavelength_and_f_number(wavelength, f_number):
    pitch = 0.01 * wavelength * f_number
    c = fit_camera(Camera(wavelength, f_number, pitch)).blur * pitch
    reference = fit_camera(Camera(1.0, 1.0, 0.01))
    assert c / (wavelength * f_number) == pytest.approx(0.01 * reference.blur, rel=1e-7)
    assert 0.01 * reference.blur == pytest.approx(0.412, abs=1e-3)


def test_units_do_not_matter():
    one = fit_camera(Camera(0.5, 4.0, 4.0, 0.8, w20=0.7, w40=-0.2))
    other = fit_camera(Camera(1.0, 6.0, 12.0, 0.8, w20=0.7, w40=-0.2))  # all three times as large
    assert one.blur == pytest.approx(other.blur, rel=1e-8)
    assert one.residual == pytest.approx(other.residual, rel=1e-6)


@pytest.mark.parametrize("aberrations", [{}, {"w20": 0.7}, {"w20": -2.0, "w40": 2.0}])
@pytest.mark.parametrize("unit", [1.7, 0.3, 25.4])
def test_a_change_of_units_changes_the_rounding_and_so_the_last_digit_alone(aberrations, unit):
    one = fit_camera(Camera(0.5, 4.0, 4.0, 0.8, **aberrations))
    other = fit_camera(Camera(0.5 * unit, 4.0, 4.0 * unit, 0.8, **aberrations))
    # The maximum of what is explained is flat: searched for by its value it was off by 1e-8.
    assert one.blur == pytest.approx(other.blur, rel=1e-13)
    assert one.residual == pytest.approx(other.residual, rel=1e-12)


@pytest.mark.parametrize(
    "what",
    [
        Camera(0.55, 5.6, 4.5),
        Camera(0.55, 2.0, 4.5, w20=1.2),
        Camera(0.55, 2.0, 4.5, w20=-2.0, w40=2.0),
    ],
)
def test_the_fit_is_that_of_a_picture_of_the_spread(what):
    # The spread on a grid, by a Fourier sum over a fine grid of frequencies.
    step, n = what.pitch / 8, 256
    f = np.fft.fftfreq(n, step)
    radius = np.hypot(f[:, None], f) / what.cutoff
    lens = np.interp(radius, v := np.linspace(0, 1, 2001), lens_transfer(v, what.w20, what.w40))
    transfer = lens * pixel_transfer(f[:, None], f, what.side)
    picture = np.fft.fftshift(np.fft.ifft2(transfer).real) / step**2
    x = (np.arange(n) - n // 2) * step
    square = x[:, None] ** 2 + x**2

    def misfit(parameters):
        height, c = parameters
        return ((height * np.exp(-0.5 * square / c**2) - picture / picture.max()) ** 2).sum()

    found = minimize(
        misfit,
        [1.0, 0.5 * what.pitch],
        method="Nelder-Mead",
        options={"xatol": 1e-9, "fatol": 1e-15},
    )
    fit = fit_camera(what)
    assert fit.blur * what.pitch == pytest.approx(found.x[1], rel=2e-4)
    assert fit.height == pytest.approx(found.x[0] * picture.max(), rel=1e-3)
    norm = ((picture / picture.max()) ** 2).sum()
    assert fit.residual == pytest.approx(np.sqrt(found.fun / norm), rel=2e-3, abs=1e-3)


def test_profiles_hold_the_light_and_meet_their_gaussians():
    table = profile_table(4.0, 4.5, reach=30.0, count=3001)
    assert set(table["model"]) == set(MODELS)
    for _, rows in table.groupby("model"):
        rings = 2 * np.pi * rows["radius"] * 0.01
        # An Airy pattern leaves 2 wavelength N / (pi^2 r) beyond r: here 0.4 %.
        assert (rings * rows["psf"]).sum() == pytest.approx(1.0, abs=0.006)
        assert rows["gaussian"].iloc[0] == pytest.approx(rows["psf"].iloc[0], rel=0.3)
        c = rows["c"].iloc[0]
        fall = rows["gaussian"] / rows["gaussian"].iloc[0]
        np.testing.assert_allclose(fall, np.exp(-0.5 * (rows["radius"] / c) ** 2), atol=1e-12)


@pytest.fixture(scope="module")
def blurs():
    table = optics_table([1.4, 2.0, 2.8, 4.0, 8.0, 16.0], [6.5])
    return table.pivot(index="f_number", columns="model", values="c")


def test_only_aberrations_make_the_blur_rise_with_the_aperture(blurs):
    assert (blurs["diffraction"].diff().dropna() > 0).all()
    for model in ("defocus", "spherical"):
        opening = blurs[model].loc[:2.8]
        assert (opening.diff().dropna() < 0).all()
        # The defaults span the paper's range at this pitch.
        assert opening.iloc[0] == pytest.approx(0.95, abs=0.01)
        assert 0.35 < blurs[model].min() < 0.43
    # Stopped down, diffraction is all that counts.
    np.testing.assert_allclose(blurs.loc[16.0], blurs.loc[16.0, "diffraction"], rtol=2e-3)


def test_the_table_says_what_was_computed():
    table = optics_table(
        [2.0, 4.0], [3.0, 6.0], wavelength=0.5, fill_factor=0.9, defocus=16.0, spherical=1.6
    )
    assert len(table) == 2 * 2 * 3
    np.testing.assert_allclose(table["c_um"], table["c"] * table["pitch"])
    rows = table.set_index(["model", "pitch", "f_number"])
    assert rows.loc[("defocus", 3.0, 2.0), "w20"] == 1.0  # 16 / (8 4 0.5)
    assert rows.loc[("spherical", 6.0, 4.0), ["w20", "w40"]].tolist() == [-0.1, 0.1]
    assert rows.loc[("diffraction", 6.0, 4.0), ["w20", "w40"]].tolist() == [0.0, 0.0]
    fit = fit_camera(camera("spherical", 0.5, 4.0, 6.0, 0.9, 16.0, 1.6))
    assert rows.loc[("spherical", 6.0, 4.0), ["c", "residual"]].tolist() == [fit.blur, fit.residual]


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ({"f_numbers": []}, "f_numbers: none"),
        ({"f_numbers": [0.0]}, "f_numbers is 0.0"),
        ({"pitches": [-1.0]}, "pitches is -1.0"),
        ({"wavelength": np.nan}, "wavelength is nan"),
        ({"fill_factor": 1.5}, "fill_factor is 1.5, allowed is a number up to 1"),
        ({"defocus": 1e5}, "w20 is 5682 wavelengths at f/2"),
        ({"pitches": [1e5]}, "pitch is 100000 um, allowed are 1100 at f/2"),
    ],
)
def test_what_cannot_be_computed_is_named(wrong, words):
    with pytest.raises(InputError, match=words) as caught:
        optics_table(**({"f_numbers": [2.0], "pitches": [4.5]} | wrong))
    assert "\n" not in str(caught.value)


def test_an_unknown_model_and_wrong_radii_are_named():
    with pytest.raises(InputError, match="choose one of diffraction, defocus, spherical"):
        camera("pinhole", 0.5, 2.0, 4.0)
    with pytest.raises(InputError, match="radius: must be a list of finite numbers"):
        psf_profile(Camera(0.5, 2.0, 4.0), [[1.0]])


@pytest.mark.parametrize("bad", [np.nan, np.inf])
@pytest.mark.parametrize("at", [0, 1, 2])
def test_one_wrong_radius_among_right_ones_is_refused(bad, at):
    radii = [0.0, 1.0, 2.0]
    radii[at] = bad
    with pytest.raises(InputError, match="radius: must be a list of finite numbers"):
        psf_profile(Camera(0.5, 2.0, 4.0), radii)
