"""Local sums of a difference of Gaussians against the sums over all coefficients."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.ndimage import gaussian_filter

from keystab.scalespace.continuous_dog import DogSeries
from keystab.scalespace.local_dog import LocalDog

KAPPA = 2 ** (1 / 3)


def picture(shape, blur, seed=0):
    """White noise, which has all frequencies, blurred as a camera would."""
    noise = np.random.default_rng(seed).random(shape)
    return gaussian_filter(noise, blur, mode="reflect") if blur else noise


def scattered(shape, low, high, n=60, seed=1):
    """Points anywhere between the mirrors, some of them on these."""
    rng = np.random.default_rng(seed)
    sigma = np.exp(rng.uniform(np.log(low), np.log(high), n))
    y, x = (rng.uniform(-0.5, size - 0.5, n) for size in shape)
    y[:3], x[2:5] = -0.5, shape[1] - 0.5
    sigma[:2] = low, high
    return sigma, y, x


def differences(local, full, contrast):
    return {
        name: float(np.abs(getattr(local, name) - getattr(full, name)).max()) / contrast
        for name in ("value", "gradient", "hessian")
    }


@settings(deadline=None, max_examples=25)
@given(
    height=st.integers(1, 60),
    width=st.integers(2, 60),
    blur=st.floats(0, 1.6),
    low=st.floats(0.92, 4),
    octaves=st.floats(0.1, 2),
    seed=st.integers(0, 99),
)
def test_local_sums_are_the_full_sums(height, width, blur, low, octaves, seed):  # noqa: PLR0913
    low = max(low * blur, 0.7)
    series = DogSeries.of_image(picture((height, width), blur, seed), blur, KAPPA)
    at = scattered((height, width), low, low * 2**octaves, seed=seed)
    local = LocalDog.of_series(series, low, low * 2**octaves)
    for within in (False, True):
        one, other = local.jets(*at, within), series.jets(*at, within)
        off = differences(one, other, series.contrast or 1.0)
        # Rounding, amplified by what undoes the image's own blur: the full sums have it too.
        assert off["value"] < 2e-13 and off["gradient"] < 1e-12 and off["hessian"] < 1e-11


@pytest.mark.parametrize("blur", [3.0, 5.0])
def test_a_large_blur_is_undone_by_the_full_sums(blur):
    series = DogSeries.of_image(picture((40, 50), 0.0), blur, KAPPA)  # noise beyond the blur
    local = LocalDog.of_series(series, 0.92 * blur, 2 * blur)
    assert local.sharpened is series
    at = scattered((40, 50), blur, 2 * blur)
    off = differences(local.jets(*at), series.jets(*at), series.contrast)
    # Derivatives along scale are those of the image times sigma squared, here up to 160.
    assert off["value"] < 1e-13 and off["gradient"] < 1e-11
    below = (np.full(5, 0.95 * blur), *np.random.default_rng(2).uniform(0, 39, (2, 5)))
    np.testing.assert_array_equal(local.jets(*below).value, series.jets(*below).value)


def test_every_scale_is_served_by_few_samples():
    series = DogSeries.of_image(picture((200, 300), 1.1), 1.1, KAPPA)
    local = LocalDog.of_series(series, 1.0, 40.0)
    ends = [*(level.least for level in local.levels), 40.0 * KAPPA]
    for level, end in zip(local.levels, ends[1:], strict=True):
        reach = 8.8 * np.sqrt(end**2 - level.variance)
        assert 2 * reach / min(level.distance) < 90
    sizes = [level.samples.size for level in local.levels]
    assert sizes == sorted(sizes, reverse=True) and sum(sizes) < 20 * 200 * 300
