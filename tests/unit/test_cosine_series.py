"""The cosine series against closed forms and direct summation."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from keystab.errors import InputError
from keystab.scalespace import cosine_series

SHAPES = [(1, 1), (1, 7), (6, 1), (5, 8), (12, 9)]


def direct_sum(a, y, x, blur=0.0, derivative=(0, 0)):
    """The defining double sum, term by term, at one point."""
    height, width = a.shape
    total = 0.0
    for k in range(height):
        for m in range(width):
            v, w = np.pi * k / height, np.pi * m / width
            term = a[k, m] * np.exp(-0.5 * blur**2 * (v**2 + w**2))
            term *= v ** derivative[0] * np.cos(v * (y + 0.5) + derivative[0] * np.pi / 2)
            term *= w ** derivative[1] * np.cos(w * (x + 0.5) + derivative[1] * np.pi / 2)
            total += term
    return total


def picture(shape, seed=0):
    return np.random.default_rng(seed).random(shape)


@pytest.mark.parametrize("shape", SHAPES)
def test_series_passes_through_every_pixel(shape):
    u = picture(shape)
    a = cosine_series.coefficients(u)
    assert a[0, 0] == pytest.approx(u.mean(), abs=1e-14)
    np.testing.assert_allclose(
        cosine_series.evaluate(a, np.arange(shape[0]), np.arange(shape[1])), u, rtol=0, atol=1e-13
    )


def test_one_cosine_has_one_coefficient():
    y, x = np.arange(10)[:, None] + 0.5, np.arange(14)[None, :] + 0.5
    u = 0.75 * np.cos(np.pi * 3 * y / 10) * np.cos(np.pi * 5 * x / 14)
    expected = np.zeros((10, 14))
    expected[3, 5] = 0.75
    np.testing.assert_allclose(cosine_series.coefficients(u), expected, rtol=0, atol=1e-15)


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("derivative", [(0, 0), (1, 0), (0, 1), (1, 1), (2, 0), (0, 3), (4, 2)])
def test_evaluation_is_the_direct_sum(shape, derivative):
    a = cosine_series.coefficients(picture(shape))
    y, x = np.array([-3.7, -0.5, 0.0, 1.25, 17.3]), np.array([-0.25, 2.0, 3.6])
    expected = [[direct_sum(a, p, q, 0.6, derivative) for q in x] for p in y]
    grid = cosine_series.evaluate(a, y, x, 0.6, derivative)
    np.testing.assert_allclose(grid, expected, rtol=0, atol=1e-12)
    scattered = cosine_series.evaluate_at(a, y[:, None], x[None, :], 0.6, derivative)
    np.testing.assert_allclose(scattered, expected, rtol=0, atol=1e-12)


def test_derivative_agrees_with_differences():
    a = cosine_series.coefficients(picture((15, 11)))
    y, x, h = np.array([3.2]), np.array([7.7]), 1e-4
    slope = (
        cosine_series.evaluate(a, y + h, x, 1.0) - cosine_series.evaluate(a, y - h, x, 1.0)
    ) / (2 * h)
    exact = cosine_series.evaluate(a, y, x, 1.0, derivative=(1, 0))
    assert slope[0, 0] == pytest.approx(exact[0, 0], abs=1e-7)  # third derivative times h^2/6
    bend = np.diff(cosine_series.evaluate(a, y, x + np.array([-h, 0, h]), 1.0)[0], 2) / h**2
    exact = cosine_series.evaluate(a, y, x, 1.0, derivative=(0, 2))
    assert bend[0] == pytest.approx(exact[0, 0], abs=1e-6)  # rounding over h^2


def test_blurred_gaussian_is_a_wider_gaussian():
    # A blob of 3 px sampled at whole pixels has no alias above exp(-(3 pi)^2 / 2) = 1e-19.
    u = np.exp(-0.5 * ((np.arange(61) - 30) / 3.0) ** 2)
    u = np.outer(u, u)
    p = np.array([20.3, 30.0, 33.9])
    wide = (3 / 5) * np.exp(-0.5 * ((p - 30) / 5.0) ** 2)
    blurred = cosine_series.evaluate(cosine_series.coefficients(u), p, p, blur=4.0)
    np.testing.assert_allclose(blurred, np.outer(wide, wide), rtol=0, atol=3e-9)  # mirror at 6 sd
    # nearer to rounding with the blob further from the mirrors
    u = np.exp(-0.5 * ((np.arange(101) - 50) / 3.0) ** 2)
    blurred = cosine_series.evaluate(
        cosine_series.coefficients(np.outer(u, u)), p + 20, p + 20, blur=4.0
    )
    np.testing.assert_allclose(blurred, np.outer(wide, wide), rtol=0, atol=1e-15)


@given(st.floats(0, 3), st.floats(0, 3), st.integers(1, 40))
def test_blurs_add_in_squares(first, second, n):
    product = cosine_series.gaussian(n, first) * cosine_series.gaussian(n, second)
    np.testing.assert_allclose(
        product, cosine_series.gaussian(n, np.hypot(first, second)), atol=1e-15
    )


@given(st.integers(1, 12), st.floats(-30, 30))
def test_series_is_even_about_both_mirrors(n, position):
    here = cosine_series.basis([position], n)
    np.testing.assert_allclose(cosine_series.basis([-1 - position], n), here, atol=1e-12)
    np.testing.assert_allclose(cosine_series.basis([2 * n - 1 - position], n), here, atol=1e-12)


def test_highest_frequency_keeps_its_digits_at_half_pixels():
    # cos(pi k (p + 1/2) / n) at p = n (j + 1/2) - 1/2 is cos(pi k (j + 1/2)): 0 for odd k. Without
    # reduction of the angle the rounding of 4000 pi, 1e-12, would be seen.
    n, j = 4000, np.arange(8)
    values = cosine_series.basis(n * (j + 0.5) - 0.5, n)[:, 1::2]
    assert np.abs(values).max() < 1e-15


def test_dropped_frequencies_do_not_count():
    a = cosine_series.coefficients(picture((40, 30)))
    y, x = np.array([3.3, 20.0]), np.array([0.1, 9.0])
    assert cosine_series.significant(40, 8.0) < 40
    full = cosine_series.basis(y, 40) @ np.diag(cosine_series.gaussian(40, 8.0)) @ a
    full = full @ np.diag(cosine_series.gaussian(30, 8.0)) @ cosine_series.basis(x, 30).T
    np.testing.assert_allclose(cosine_series.evaluate(a, y, x, 8.0), full, rtol=0, atol=1e-15)


def test_a_huge_blur_leaves_the_mean():
    u = picture((9, 7))
    values = cosine_series.evaluate(cosine_series.coefficients(u), [0, 5], [3], blur=1e6)
    np.testing.assert_allclose(values, u.mean(), rtol=1e-14)


def test_many_scattered_points_are_the_grid():
    a = cosine_series.coefficients(picture((6, 5)))
    y, x = np.linspace(0, 5, 60), np.linspace(-1, 4, 50)
    scattered = cosine_series.evaluate_at(a, y[:, None], x[None, :])  # three blocks
    np.testing.assert_allclose(scattered, cosine_series.evaluate(a, y, x), rtol=0, atol=1e-14)


@pytest.mark.parametrize(
    "bad", [np.ones(3), np.ones((2, 2, 3)), np.ones((0, 4)), [[1.0, np.nan]], [[np.inf, -np.inf]]]
)
def test_what_is_no_image_is_refused(bad):
    with pytest.raises(InputError):
        cosine_series.coefficients(bad)
