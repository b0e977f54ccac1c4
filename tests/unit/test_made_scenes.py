"""Made scenes have the properties that their families are known for."""

import hashlib
import math

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.ndimage import gaussian_filter
from scipy.stats import kstest

from keystab.camera.made_scenes import (
    KINDS,
    _greys,
    dead_leaves,
    fractal_field,
    leaf_radii,
    make_scene,
)
from keystab.errors import InputError


def test_radii_have_the_density_of_discs_that_touch_the_frame():
    shape, (a, b) = (60, 90), (2.0, 300.0)

    def density(r):
        return r**-3 * (shape[0] + 2 * r) * (shape[1] + 2 * r)

    whole = quad(density, a, b)[0]
    found = leaf_radii(np.random.default_rng(1), 4000, shape, (a, b))
    law = np.vectorize(lambda r: quad(density, a, r)[0] / whole)
    assert kstest(found, law).pvalue > 0.01
    flat = leaf_radii(np.random.default_rng(1), 4000, shape, (a, b)) ** 1.05
    assert kstest(flat, law).pvalue < 0.01  # the test sees a law that is a little off


def overlap(distance, radius):
    """Area that two discs of one radius share."""
    half = np.clip(distance / (2 * radius), 0, 1)
    return 2 * radius**2 * (np.arccos(half) - half * np.sqrt(1 - half**2))


def mean_overlap(distance, radii):
    """Mean area that discs of a density of r^-3 share with themselves, moved."""
    norm = quad(lambda r: r**-3, *radii)[0]
    return quad(lambda r: r**-3 * overlap(distance, r), *radii)[0] / norm


def test_points_are_of_one_leaf_as_often_as_occlusion_says():
    # Of discs that hide one another, two points see the same one with the probability
    # g(d) / (2 g(0) - g(d)), g the mean area that a disc shares with itself, moved by d.
    radii = (3.0, 12.0)
    images = [dead_leaves((300, 400), np.random.default_rng(n), radii) for n in range(6)]
    # Of leaves, not of pixels: rims a pixel wide take a part of the variance.
    greys = _greys(np.random.default_rng(9), 10**6)
    around = np.stack(images) - greys.mean()
    for d in (2, 5, 10):
        across = (around[..., d:] * around[..., :-d]).mean() / greys.var()
        down = (around[:, d:] * around[:, :-d]).mean() / greys.var()
        shared = mean_overlap(d, radii)
        expected = shared / (2 * mean_overlap(0, radii) - shared)
        assert (across + down) / 2 == pytest.approx(expected, abs=0.03)  # standard error 0.015


@pytest.mark.parametrize("exponent", [0.0, 1.6, 2.4, 3.0])
def test_the_spectrum_of_a_field_falls_with_its_exponent(exponent):
    shape = (256, 320)
    field = fractal_field(shape, np.random.default_rng(5), exponent)
    assert field.mean() == pytest.approx(0, abs=1e-12) and field.std() == pytest.approx(1)
    power = np.abs(np.fft.rfft2(field)) ** 2
    k = np.hypot(np.fft.fftfreq(shape[0])[:, None], np.fft.rfftfreq(shape[1])[None, :])
    inside = (k > 0.01) & (k < 0.5)
    slope = np.polyfit(np.log(k[inside]), np.log(power[inside]), 1)[0]
    assert slope == pytest.approx(-exponent, abs=0.05)  # its standard error is 0.01


@pytest.mark.parametrize("kind", ["edges", "line-art"])
@pytest.mark.parametrize("angle", [0, 10, 45, 80])
def test_edges_lie_along_their_angle_and_across(kind, angle):
    image = make_scene(kind, (200, 260), 2, angle=angle)
    down, right = np.gradient(gaussian_filter(image, 2.0))  # wider than a pixel's rim
    # Four times the angle: sides along and across fall together.
    turn = np.sum((right + 1j * down) ** 4 / np.maximum(np.hypot(down, right), 1e-9) ** 2)
    found = math.degrees(np.angle(turn)) / 4 % 90
    assert min(abs(found - angle % 90), 90 - abs(found - angle % 90)) < 0.5
    weight = np.abs(turn) / np.sum(np.hypot(down, right) ** 2)
    assert weight > 0.75  # most of what changes does so along one of the two


def test_text_is_dark_on_light_in_lines():
    page = make_scene("text", (300, 400), 1)
    assert page.max() == np.median(page) > 0.9
    ink = (page < 0.6).mean(axis=1)
    assert 0.02 < ink.mean() < 0.4
    assert (ink == 0).sum() > 10  # between lines


@pytest.mark.parametrize("kind", KINDS)
def test_a_scene_is_its_seed_and_nothing_else(kind):
    first = make_scene(kind, (48, 64), 7)
    np.random.default_rng(0).random()
    np.testing.assert_array_equal(first, make_scene(kind, (48, 64), 7))
    assert (first != make_scene(kind, (48, 64), 8)).any()
    assert first.min() >= 0 and first.max() <= 1
    np.testing.assert_array_equal(65535 * first, np.rint(65535 * first))


DIGESTS = {
    "dead-leaves": "067ffe8dd6fe9639",
    "fractal": "52060a794f7a0f1d",
    "edges": "5d72ee9fa2a68070",
    "line-art": "31c7b68f28cde21e",
    "text": "b0a41a05e70469a7",
}


@pytest.mark.parametrize("kind", KINDS)
def test_pixels_are_the_same_on_every_machine(kind):
    levels = np.rint(65535 * make_scene(kind, (96, 128), 1, angle=30.0)).astype("<u2")
    assert hashlib.sha256(levels.tobytes()).hexdigest()[:16] == DIGESTS[kind]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"kind": "leaves"}, "dead-leaves, fractal, edges, line-art, text"),
        ({"shape": (4, 60)}, "height"),
        ({"shape": 60}, "height and width"),
        ({"shape": (20_000, 20_000)}, "pixels"),
        ({"seed": -1}, "seed"),
        ({"seed": 0.5}, "seed"),
        ({"exponent": 5.0}, "0 to 4"),
        ({"angle": 91.0}, "0 to 90"),
        ({"angle": math.nan}, "angle"),
    ],
)
def test_wrong_arguments_get_one_line(arguments, words):
    with pytest.raises(InputError) as error:
        make_scene(**{"kind": "edges", "shape": (32, 32)} | arguments)
    assert words in str(error.value) and "\n" not in str(error.value)
