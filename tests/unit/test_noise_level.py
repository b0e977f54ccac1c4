"""Noise that was put into a picture is found in it, whatever else the picture holds."""

from __future__ import annotations

import numpy as np
import pytest

from keystab.errors import InputError
from keystab.prediction.noise_level import estimated_noise

SHAPE = (160, 200)


def noise_of(seed, shape=SHAPE):
    return np.random.default_rng(seed).standard_normal(shape)


def texture(blur=0.8, contrast=0.2):
    """A random field with the spectrum of natural scenes, the same everywhere: no flat place."""
    size = (2 * SHAPE[0], 2 * SHAPE[1])  # twice as fine, so that frequencies are folded back
    y, x = np.meshgrid(*(np.fft.fftfreq(n, 0.5) for n in size), indexing="ij")
    radius = np.maximum(np.hypot(y, x), 1 / size[1])
    wave = np.fft.fft2(noise_of(5, size)) / radius * np.exp(-2 * (np.pi * blur * radius) ** 2)
    field = np.fft.ifft2(wave).real[::2, ::2]
    return contrast * field / field.std()


@pytest.mark.parametrize("noise", [0.003, 0.01, 0.1])
@pytest.mark.parametrize("scene", ["flat", "texture", "half", "steps"])
def test_white_noise_is_found(scene, noise):
    picture = {"flat": np.zeros(SHAPE), "texture": texture(), "half": texture(), "steps": None}[
        scene
    ]
    if scene == "half":
        picture[:, : SHAPE[1] // 2] = 0.3
    if scene == "steps":
        picture = np.kron(np.random.default_rng(2).random((10, 10)), np.ones((16, 20)))
    found = estimated_noise(picture + noise * noise_of(1))
    assert found == pytest.approx(noise, rel=0.06)


def test_texture_alone_leaves_less_than_a_hundredth_of_its_contrast():
    picture = texture()
    assert estimated_noise(picture) < 0.01 * picture.std()


def test_a_picture_in_other_units_or_on_a_ramp_has_as_much_noise():
    picture = texture() + 0.01 * noise_of(3)
    once = estimated_noise(picture)
    assert estimated_noise(256 * picture + 7) == pytest.approx(256 * once, rel=1e-9)
    assert estimated_noise(1e300 * picture) == pytest.approx(1e300 * once, rel=1e-9)
    ramp = 0.01 * np.arange(SHAPE[1])
    assert estimated_noise(picture + ramp) == pytest.approx(once, rel=0.1)
    assert estimated_noise(picture.T) == pytest.approx(once, rel=1e-9)
    assert estimated_noise(picture[::-1, ::-1]) == pytest.approx(once, rel=1e-9)


def test_clipped_places_do_not_count():
    picture = np.where(np.arange(SHAPE[1]) < 120, 1.2, 0.5) + 0.02 * noise_of(4)
    assert estimated_noise(np.minimum(picture, 1.0)) == pytest.approx(0.02, rel=0.06)


@pytest.mark.parametrize("shape", [(8, 8), (8, 300), (15, 9), (23, 23)])
def test_small_pictures_have_an_estimate(shape):
    assert 0.2 < estimated_noise(noise_of(6, shape)) < 3
    assert estimated_noise(np.full(shape, 0.3)) == 0


def test_large_pictures_are_looked_at_in_fewer_places():
    picture = 0.05 * noise_of(7, (1100, 1000))
    assert estimated_noise(picture) == pytest.approx(0.05, rel=0.01)


@pytest.mark.parametrize("shape", [(7, 300), (1, 1)])
def test_too_small_a_picture_is_refused_in_one_line(shape):
    with pytest.raises(InputError, match="at least 8 x 8 pixels") as error:
        estimated_noise(np.zeros(shape))
    assert "\n" not in str(error.value)
