"""Steps of a climb to a true extremum, and where its seeds lie, against what is known on paper."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from keystab.scalespace.continuous_dog import Jets
from keystab.truth import newton
from keystab.truth.seeds import Seeds, coarser


def jets_of(seed, n=20):
    rng = np.random.default_rng(seed)
    half = rng.standard_normal((n, 3, 3))
    return Jets(np.zeros(n), rng.standard_normal((n, 3)), half + half.transpose(0, 2, 1))


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**32 - 1), st.sampled_from([0.05, 0.5, 3.0]))
def test_no_step_within_the_radius_promises_more(seed, size):
    jets, rng = jets_of(seed), np.random.default_rng(seed + 1)
    sign = rng.choice([-1.0, 1.0], 20)
    radius = size * rng.uniform(0.5, 2.0, 20)
    step, promised, _ = newton._step(jets, sign, radius)
    assert (np.linalg.norm(step, axis=1) <= radius * (1 + 1e-9)).all()

    def model(d):
        gain = (jets.gradient * d).sum(axis=1)
        return sign * (gain + 0.5 * np.einsum("ni,nij,nj->n", d, jets.hessian, d))

    np.testing.assert_allclose(model(step), promised, rtol=1e-6, atol=1e-9)
    for _ in range(200):
        other = rng.standard_normal((20, 3))
        # On the sphere, where most are, and within it.
        other *= (radius * rng.choice([1.0, rng.uniform()]) / np.linalg.norm(other, axis=1))[
            :, None
        ]
        assert (model(other) <= promised + 1e-6 * np.abs(promised) + 1e-9).all()


def test_a_step_to_a_near_extremum_is_newtons_and_one_to_a_far_one_ends_on_the_radius():
    hessian = np.array([[-2.0, 0.3, 0.1], [0.3, -1.0, 0.2], [0.1, 0.2, -3.0]])
    there = np.array([0.3, -0.2, 0.1])
    jets = Jets(np.zeros(1), -(hessian @ there)[None], hessian[None])
    far = float(np.linalg.norm(there))
    for radius, inner in ((far * 1.001, True), (far * 0.999, False), (far * 0.3, False)):
        for sign in (1.0, -1.0):
            mirrored = Jets(jets.value, sign * jets.gradient, sign * jets.hessian)
            step, promised, _ = newton._step(mirrored, np.array([sign]), np.array([radius]))
            assert np.linalg.norm(step) == pytest.approx(min(radius, far), rel=1e-6)
            assert promised[0] > 0
            if inner:
                np.testing.assert_allclose(step[0], there, rtol=1e-9)


def test_on_a_saddle_without_slope_the_step_goes_down_the_way_that_rises():
    hessian = np.diag([-1.0, -2.0, 0.5])[None]  # a maximum along two axes, none along the third
    step, promised, stop = newton._step(
        Jets(np.zeros(1), np.zeros((1, 3)), hessian), np.ones(1), np.array([0.4])
    )
    np.testing.assert_allclose(np.abs(step), [[0, 0, 0.4]], atol=1e-9)
    assert promised[0] == pytest.approx(0.5 * 0.5 * 0.4**2) and not stop[0]


@pytest.mark.parametrize(("factor", "rim"), [(1, 0), (2, 3), (4, 1)])
def test_seeds_of_a_finer_picture_lie_where_its_pixels_are(factor, rim):
    # Pixel k of the picture covers the fine ones from factor (k + rim) on, factor of them.
    shape = (5, 8)
    k, m = np.array([0, 2, 4]), np.array([7, 3, 0])
    fine_y, fine_x = (factor * (it + rim) + (factor - 1) / 2 for it in (k, m))
    seeds = Seeds(np.full(3, 2.0), fine_y, fine_x, np.array([1, -1, 1]))
    found = coarser(seeds, factor, rim, shape)
    np.testing.assert_allclose(found.y, k)
    np.testing.assert_allclose(found.x, m)
    np.testing.assert_allclose(found.sigma, 2.0 / factor)
    assert found.sign.tolist() == [1, -1, 1]


@pytest.mark.parametrize("axis", ["y", "x"])
def test_seeds_beyond_the_mirrors_of_a_picture_are_left_out(axis):
    shape = (5, 8)
    size = shape["yx".index(axis)]
    at = np.array([-0.5, -0.5 - 1e-9, size - 0.5, size - 0.5 + 1e-9])
    middle = {"y": np.full(4, 2.0), "x": np.full(4, 3.5)} | {axis: at}
    found = coarser(Seeds(np.ones(4), middle["y"], middle["x"], np.ones(4)), 1, 0, shape)
    assert getattr(found, axis).tolist() == [-0.5, size - 0.5]
