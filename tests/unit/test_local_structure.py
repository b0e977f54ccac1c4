"""What the scale-space around a detection says, against closed forms and under symmetries."""

import math

import numpy as np
import pandas as pd
import pytest

from keystab.detection.detector import extrema_table
from keystab.detection.extrema import discrete_extrema
from keystab.prediction.local_structure import (
    WINDOW,
    annulus,
    degeneracy,
    persistence,
    saddle_distance,
)
from keystab.prediction.predictors import PREDICTORS, model_inputs, predictor_table
from keystab.scalespace.continuous_dog import DogSeries
from keystab.scalespace.dog import scale_space

KAPPA = 2 ** (1 / 3)
BLUR = 1.1
SIZE, ORDER = 48, 16
FREQUENCY = math.pi * ORDER / SIZE
#: Scale at which the response to a wave of this frequency is largest: dh/dsigma = 0.
BEST = math.sqrt(4 * math.log(KAPPA) / (FREQUENCY**2 * (KAPPA**2 - 1)))
UP = np.array([1.0])


def response(frequency, sigma):
    """The difference of Gaussians of a wave, over the wave."""
    lost = [math.exp(-((r * sigma) ** 2 - BLUR**2) * frequency**2 / 2) for r in (KAPPA, 1.0)]
    return lost[0] - lost[1]


def waves(*terms):
    """Series of a sum of waves (amplitude, order along y, order along x), of an image of SIZE."""
    coefficients = np.zeros((SIZE, SIZE))
    for amplitude, k, m in terms:
        coefficients[k, m] = amplitude
    return DogSeries(coefficients, (SIZE, SIZE), BLUR, KAPPA)


def at(sigma, y=-0.5, x=-0.5):
    """One place; all waves are cosines with a crest at -1/2."""
    return np.array([[sigma, y, x]])


# Responses are negative: where all waves have a crest, w has a minimum.
DOWN = np.array([-1.0])


@pytest.mark.parametrize("amplitudes", [(1.0, 0.6), (0.4, 1.0)])
def test_the_saddle_of_two_waves_is_half_a_period_away(amplitudes):
    # w = h(sigma) (a cos fy + b cos fx): half a period along either axis is a saddle, at the same
    # scale, and pi / (f sigma) depends on kappa alone.
    series = waves((amplitudes[0], ORDER, 0), (amplitudes[1], 0, ORDER))
    expected = math.pi * math.sqrt((KAPPA**2 - 1) / (4 * math.log(KAPPA)))
    assert saddle_distance(series, at(BEST), DOWN, reach=3.0)[0] == pytest.approx(
        expected, abs=1e-9
    )
    assert saddle_distance(series, at(BEST), DOWN, reach=2.0)[0] == 2.0
    # From beside the extremum the distance is that of the place asked about.
    moved = at(BEST * 1.1, x=-0.5 + 0.2 * BEST)
    way = np.array([math.log(1.1), 0.0, (math.pi / FREQUENCY - 0.2 * BEST) / (1.1 * BEST)])
    found = saddle_distance(series, moved, DOWN, reach=3.0)[0]
    assert found == pytest.approx(np.linalg.norm(way), abs=1e-9)


def test_a_saddle_has_no_distance_to_saddles():
    series = waves((1.0, ORDER, 0), (0.6, 0, ORDER))
    half = at(BEST, x=-0.5 + math.pi / FREQUENCY)
    assert saddle_distance(series, half, DOWN)[0] == 0.0
    assert degeneracy(series, half, DOWN)[0] < 0.0
    assert persistence(series, half, DOWN)[0] == 0.0
    # What is a minimum is no maximum.
    assert saddle_distance(series, at(BEST), UP)[0] == 0.0


def forked(scale):
    """Waves whose minimum at -1/2 becomes a saddle as sigma falls below `scale`.

    Along x, w'' = -f^2 (h(f) + 4 b h(2f)) there, which vanishes where h(f) = -4 b h(2f).
    """
    b = -response(FREQUENCY / 2, scale) / (4 * response(FREQUENCY, scale))
    return waves((1.0, ORDER // 2, 0), (1.0, 0, ORDER // 2), (b, 0, ORDER))


def test_the_distance_to_degeneracy_is_that_to_the_fork():
    series = forked(1.8)
    for away in (0.02, -0.02):
        found = degeneracy(series, at(1.8 * math.exp(away)), DOWN)[0]
        assert found == pytest.approx(away, abs=2e-3)


@pytest.mark.parametrize("steps", [2.5, 5.5])
def test_persistence_ends_at_the_fork(steps):
    sigma = 1.8 * math.exp(steps * WINDOW / 8)
    lasts = persistence(forked(1.8), at(sigma), DOWN)[0]
    assert lasts == pytest.approx((1 + 8 + math.floor(steps)) / 17)


def test_a_wave_persists():
    assert persistence(waves((1.0, ORDER, 0), (0.6, 0, ORDER)), at(BEST), DOWN)[0] == 1.0


def test_the_annulus_of_two_waves():
    a, b = 1.0, 0.6
    series = waves((a, ORDER, 0), (b, 0, ORDER))
    angle = 2 * np.pi * np.arange(16) / 16
    around = a * np.cos(FREQUENCY * BEST * np.sin(angle)) + b * np.cos(
        FREQUENCY * BEST * np.cos(angle)
    )
    expected = 1 - around.max() / (a + b)
    assert annulus(series, at(BEST), DOWN)[0] == pytest.approx(expected, abs=1e-12)
    # A single wave is an edge: along its crest nothing changes.
    assert annulus(waves((1.0, ORDER, 0)), at(BEST), DOWN)[0] == pytest.approx(0.0, abs=1e-12)


def described(image):
    space = scale_space(image, BLUR, n_spo=4)
    found = extrema_table(space, discrete_extrema(space))
    found = found.assign(n_spo=4, delta_min=space.sampling.delta_min)
    inside = found["y"].between(5, image.shape[0] - 6) & found["x"].between(5, image.shape[1] - 6)
    found = found[inside & found["step_sigma"].notna()].reset_index(drop=True)
    return found, predictor_table(found, DogSeries.of_image(image, BLUR, KAPPA), (1.386, 2.2))


@pytest.fixture(scope="module")
def picture():
    from scipy.ndimage import gaussian_filter

    # White noise has most of its extrema at the finest scales; coarser noise has some at all.
    noise = np.random.default_rng(5).standard_normal((3, 81, 81))
    blurred = [
        4**k * gaussian_filter(n, b, mode="reflect")
        for k, (n, b) in enumerate(zip(noise, (1.1, 1.8, 3.0), strict=True))
    ]
    return 0.5 + 0.1 * sum(blurred)


@pytest.fixture(scope="module")
def seen(picture):
    return described(picture)


def test_exchanged_axes_change_nothing(picture, seen):
    # The detector's grid begins at the first pixel, so that turns would move it.
    here, before = seen
    there, after = described(picture.T)
    order = [
        np.lexsort((t["sigma"], t[b], t[a])) for t, a, b in ((here, "y", "x"), (there, "x", "y"))
    ]
    assert len(here) == len(there) > 20
    for name in PREDICTORS:
        np.testing.assert_allclose(
            before[name].to_numpy()[order[0]],
            after[name].to_numpy()[order[1]],
            rtol=1e-6,
            atol=1e-7,
        )


def test_surroundings_turn_with_the_picture(picture, seen):
    found, _ = seen
    places = found[["sigma", "y", "x"]].to_numpy()
    turned = np.stack([places[:, 0], picture.shape[1] - 1 - places[:, 2], places[:, 1]], axis=1)
    sign = found["sign"].to_numpy(dtype=float)
    series = [DogSeries.of_image(p, BLUR, KAPPA) for p in (picture, np.rot90(picture))]
    for what in (degeneracy, persistence, annulus, saddle_distance):
        np.testing.assert_allclose(
            what(series[0], places, sign), what(series[1], turned, sign), rtol=1e-6, atol=1e-7
        )


@pytest.mark.parametrize("gain", [0.25, -0.5])
def test_contrast_changes_nothing_that_models_see(picture, seen, gain):
    _, before = seen
    here, after = described(0.5 + gain * picture)
    same = [
        name for name in PREDICTORS if name not in ("dog", "difference", "laplacian", "eigenvalue")
    ]
    np.testing.assert_allclose(before[same], after[same], rtol=1e-6, atol=1e-7)
    for name in ("dog", "difference", "laplacian", "eigenvalue"):
        np.testing.assert_allclose(abs(gain) * before[name], after[name], rtol=1e-6)
    groups = pd.DataFrame({"picture": "one", "n_spo": here["n_spo"]})
    inputs = [model_inputs(table, groups) for table in (before, after)]
    np.testing.assert_allclose(inputs[0], inputs[1], rtol=0, atol=1e-5)


def test_models_see_nothing_of_the_sampling(seen):
    _, table = seen
    both = pd.concat([table, 3.0 * table], ignore_index=True)
    groups = pd.DataFrame({"picture": "one", "n_spo": np.repeat([3, 5], len(table))})
    inputs = model_inputs(both, groups)["dog"].to_numpy().reshape(2, -1)
    np.testing.assert_allclose(inputs[0], inputs[1], rtol=0, atol=1e-12)
