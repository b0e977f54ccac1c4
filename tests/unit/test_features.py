"""Features against quadratics, whose central differences on any grid are known exactly."""

import itertools
import math

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from keystab.errors import InputError
from keystab.prediction.features import DIRECTIONS, condition_numbers, feature_table, normalised

NAMES = ("s", "y", "x")


def sampled(hessian, value, n_spo, delta, sigma):
    """Row that a detector records at the centre of a quadratic in (ln sigma, y/sigma, x/sigma)."""
    step = np.array([math.log(2) / n_spo, delta / sigma, delta / sigma])

    def dog(k):
        t = step * k
        return value + t @ hessian @ t / 2

    unit = np.eye(3)
    row = {"sigma": sigma, "value": dog(np.zeros(3))}
    for i in range(3):
        row[f"h_{NAMES[i] * 2}"] = dog(unit[i]) - 2 * dog(np.zeros(3)) + dog(-unit[i])
    for i, j in ((0, 1), (0, 2), (1, 2)):
        corners = [
            p * q * dog(p * unit[i] + q * unit[j]) for p, q in itertools.product((1, -1), repeat=2)
        ]
        name = {"sy": "sy", "sx": "sx", "yx": "yx"}[NAMES[i] + NAMES[j]]
        row[f"h_{name}"] = sum(corners) / 4
    neighbours = (np.array(k) for k in itertools.product((-1, 0, 1), repeat=3) if any(k))
    row["difference"] = min(abs(dog(k) - row["value"]) for k in neighbours)
    return row


def table(samplings, hessian, value=-0.1, sigma=1.5):
    rows = [sampled(hessian, value, n, delta, sigma) for n, delta in samplings]
    n_spo, delta = np.array(samplings).T
    return feature_table(pd.DataFrame(rows), n_spo, delta)


HESSIAN = np.array([[0.31, 0.05, -0.02], [0.05, 0.40, 0.11], [-0.02, 0.11, 0.23]])


def test_same_quadratic_has_the_same_features_on_every_sampling():
    found = table([(3, 0.5), (5, 0.29), (15, 0.0927), (3, 0.0927), (19, 0.5)], HESSIAN)
    eigenvalues = np.linalg.eigvalsh(HESSIAN)
    # The smallest differences are 1e-5 of the value, so that about 11 digits survive.
    np.testing.assert_allclose(found["dog"], 0.1, rtol=1e-12)
    np.testing.assert_allclose(found["laplacian"], np.trace(HESSIAN), rtol=1e-9)
    np.testing.assert_allclose(
        found["condition_normalised"], eigenvalues[2] / eigenvalues[0], rtol=1e-9
    )


def test_condition_number_of_the_grid_grows_with_imbalance():
    """With an isotropic Hessian it is the squared ratio of the steps, and 1 if they are equal."""
    sigma = 1.5
    step = math.log(2) / 6
    samplings = [(6, sigma * step), (6, 3 * sigma * step), (18, sigma * step)]
    np.testing.assert_allclose(table(samplings, -np.eye(3))["condition"], [1, 9, 9], rtol=1e-8)


def test_difference_compares_between_samplings_of_one_ratio_of_steps():
    """Scale step and space step shrink together by 1, 2 and 4."""
    found = table([(4, 0.4), (8, 0.2), (16, 0.1)], HESSIAN)
    np.testing.assert_allclose(found["difference"], found["difference"][0], rtol=1e-9)
    # Isotropic, equal steps r: the nearest sample differs by r^2 / 2.
    step = math.log(2) / 6
    isotropic = table([(6, 1.5 * step)], np.eye(3))
    np.testing.assert_allclose(isotropic["difference"], 0.5, rtol=1e-9)


def test_features_do_not_change_with_zoom():
    """Zooming by 2 doubles sigma and the step; the grid-step differences stay."""
    near, far = (pd.DataFrame([sampled(HESSIAN, -0.1, 5, 0.3 * z, 1.3 * z)]) for z in (1, 2))
    pd.testing.assert_frame_equal(
        feature_table(near, 5, 0.3), feature_table(far, 5, 0.6), rtol=1e-12
    )


def test_unit_of_log_scale_acts_on_scale_derivatives_only():
    found = normalised(np.ones((1, 3, 3)), 2.0, 1, 2.0, log_scale_unit=3.0)[0]
    scale = 1 / (3 * math.log(2))
    np.testing.assert_allclose(found[0], [scale**2, scale, scale], rtol=1e-14)
    np.testing.assert_allclose(found[1:, 1:], 1.0, rtol=1e-14)


def test_balanced_sampling_is_isotropic_in_the_papers_unit():
    """delta_min / sigma_min over a ln 2 / n_spo tends to 1 for a = sqrt(2) kappa."""
    kappa, sigma_min, n_spo = 2 ** (1 / 3), 1.1, 10**5
    delta = math.sqrt(2) * kappa * sigma_min * (2 ** (1 / n_spo) - 1)
    found = normalised(np.eye(3)[None], sigma_min, n_spo, delta, math.sqrt(2) * kappa)
    np.testing.assert_allclose(condition_numbers(found), 1.0, rtol=1e-4)


@settings(max_examples=100, deadline=None)
@given(
    st.lists(st.floats(-1, 1).filter(lambda v: abs(v) > 1e-6), min_size=3, max_size=3),
    st.integers(0, 2**32 - 1),
)
def test_condition_number_of_rotated_matrices(eigenvalues, seed):
    q, _ = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    size = np.abs(eigenvalues)
    # Eigenvalues are exact to 1e-16 of the largest, so the smallest to 1e-10 of itself.
    np.testing.assert_allclose(
        condition_numbers(q @ np.diag(eigenvalues) @ q.T), size.max() / size.min(), rtol=1e-8
    )


def test_condition_number_of_degenerate_matrices():
    broken = np.eye(3)
    broken[2, 1] = np.nan
    many = np.array([np.zeros((3, 3)), np.diag([1.0, 2.0, 0.0]), np.eye(3), broken])
    np.testing.assert_array_equal(condition_numbers(many), [np.inf, np.inf, 1.0, np.nan])
    assert condition_numbers(np.empty((0, 3, 3))).shape == (0,)


def test_every_feature_has_a_direction_and_keeps_the_index():
    extrema = pd.DataFrame([sampled(HESSIAN, -0.1, 5, 0.3, 1.3)], index=[42])
    found = feature_table(extrema, 5, 0.3)
    assert set(found) == set(DIRECTIONS)
    assert found.index.tolist() == [42]


@pytest.mark.parametrize("change", [{"n_spo": 0}, {"delta_min": -0.5}, {"log_scale_unit": 0.0}])
def test_errors_name_the_number(change):
    extrema = pd.DataFrame([sampled(HESSIAN, -0.1, 5, 0.3, 1.3)])
    with pytest.raises(InputError, match=next(iter(change))):
        feature_table(extrema, **{"n_spo": 5, "delta_min": 0.3, **change})


def test_missing_column():
    with pytest.raises(InputError, match="'h_yx'"):
        feature_table(
            pd.DataFrame([sampled(HESSIAN, 0.1, 5, 0.3, 1.3)]).drop(columns="h_yx"), 5, 0.3
        )
