"""White noise in a difference of Gaussians: closed form, quadrature, and noise that is drawn."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.integrate import quad

from keystab.errors import InputError
from keystab.scalespace.dog import scale_space
from keystab.scalespace.white_noise import dog_noise, gaussian_noise

KAPPA = 2 ** (1 / 3)


@pytest.mark.parametrize("blur", [0.0, 1e-10, 1e-4, 0.3, 1.0, 4.0])
def test_noise_after_a_blur_agrees_with_quadrature(blur):
    integral, _ = quad(lambda w: np.exp(-((blur * w) ** 2)) / (2 * np.pi), -np.pi, np.pi)
    # The variance is the product of both axes.
    assert_allclose(gaussian_noise(blur), np.sqrt(integral**2), rtol=1e-8)


@pytest.mark.parametrize("camera_blur", [0.0, 0.8, 1.1])
@pytest.mark.parametrize("sigma", [1.1, 1.5, 4.4])
def test_noise_of_the_difference_agrees_with_quadrature(sigma, camera_blur):
    node, weight = np.polynomial.legendre.leggauss(200)
    power = (np.pi * node) ** 2
    squared = power[:, None] + power
    upper, lower = (
        np.exp(-(scale**2 - camera_blur**2) * squared / 2) for scale in (KAPPA * sigma, sigma)
    )
    # Frequencies from -pi to pi on both axes, over 4 pi^2: a quarter of the sum of weights.
    variance = (weight[:, None] * weight * (upper - lower) ** 2).sum() / 4
    assert_allclose(dog_noise(sigma, camera_blur, KAPPA), np.sqrt(variance), rtol=1e-9)


@pytest.mark.parametrize(("oversampling", "octave"), [("cosine", 0), ("cosine", 1), ("spline", 1)])
def test_noise_of_the_difference_agrees_with_drawn_noise(oversampling, octave):
    draw = np.random.default_rng(1)
    variance = []
    for _ in range(3):
        noise = draw.normal(size=(250, 250))
        space = scale_space(noise, 0.8, 3, None, 1.1, KAPPA, oversampling, octave, (0, 4))
        edge = int(25 / space.sampling.step)
        window = space.window(slice(0, 3))[:, edge:-edge, edge:-edge]
        variance.append((window**2).mean(axis=(1, 2)))
    drawn = np.sqrt(np.mean(variance, axis=0))
    # Three draws determine it to 0.2 to 1 %, the more the smaller the scale.
    assert_allclose(drawn, dog_noise(space.sigma[:3], 0.8, KAPPA), rtol=0.03)


def test_noise_halves_from_octave_to_octave_far_above_the_blur_only():
    near, far = 1.1, 50.0
    ratio = [dog_noise(s, 0.8, KAPPA) / dog_noise(2 * s, 0.8, KAPPA) for s in (near, far)]
    assert ratio[0] > 3.8
    assert_allclose(ratio[1], 2.0, rtol=1e-3)
    variance = (1 / KAPPA**2 + 1 - 4 / (KAPPA**2 + 1)) / (4 * np.pi * far**2)
    assert_allclose(dog_noise(far, 0.0, KAPPA), np.sqrt(variance), rtol=1e-6)
    scales = np.linspace(1.1, 4.4, 50)
    assert (np.diff(dog_noise(scales, 0.8, KAPPA) / dog_noise(2 * scales, 0.8, KAPPA)) < 0).all()


def test_at_the_camera_blur_the_lower_gaussian_is_the_noise_itself():
    upper = np.sqrt(KAPPA**2 - 1) * 1.1
    variance = gaussian_noise(upper) ** 2 + 1 - 2 * gaussian_noise(upper / np.sqrt(2)) ** 2
    assert_allclose(dog_noise(1.1, 1.1, KAPPA) ** 2, variance, rtol=1e-12)


def test_impossible_blurs_are_refused():
    with pytest.raises(InputError, match="sigma goes down to 0.7 px"):
        dog_noise([0.7, 1.1], 0.8, KAPPA)
    with pytest.raises(InputError, match="kappa"):
        dog_noise(1.1, 0.8, 1.0)
    with pytest.raises(InputError, match="camera_blur"):
        dog_noise(1.1, -0.1, KAPPA)


def test_the_spline_leaves_a_little_less_noise_at_the_first_scale():
    noise = np.random.default_rng(2).normal(size=(400, 400))
    space = scale_space(noise, 0.8, 3, None, 1.1, KAPPA, "spline", 0, (0, 2))
    edge = int(25 / space.sampling.step)
    drawn = space.window(slice(0, 2))[:, edge:-edge, edge:-edge].std(axis=(1, 2))
    ratio = drawn / dog_noise(space.sigma[:2], 0.8, KAPPA)
    assert 0.94 < ratio[0] < 0.975 < ratio[1] < 1.01
