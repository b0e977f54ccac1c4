"""Wilson intervals against published values, the bootstrap against what it must have in common."""

import numpy as np
import pytest

from keystab.errors import InputError
from keystab.evaluation.intervals import (
    bootstrap_counts,
    centred_interval,
    percentile_interval,
    table_counts,
    wilson_interval,
)


# Newcombe, Statistics in Medicine 17, 857-872 (1998), table I, method 3.
@pytest.mark.parametrize(
    ("k", "n", "low", "high"),
    [
        (81, 263, 0.2553, 0.3662),
        (15, 148, 0.0624, 0.1605),
        (0, 20, 0.0, 0.1611),
        (1, 29, 0.0061, 0.1718),
    ],
)
def test_wilson_published_values(k, n, low, high):
    np.testing.assert_allclose(wilson_interval(k, n), (low, high), atol=5.1e-5)


def test_wilson_is_symmetric_and_exact_at_the_ends():
    k = np.arange(21)
    low, high = wilson_interval(k, 20)
    np.testing.assert_allclose(low, 1 - high[::-1], atol=1e-15)
    assert low[0] == 0 and high[-1] == 1
    assert ((low <= k / 20) & (k / 20 <= high)).all()


def test_wilson_solves_the_score_equation():
    """Its ends are the shares p at which k lies z standard deviations from n p."""
    for p in wilson_interval(30, 200, confidence=0.99):
        np.testing.assert_allclose(
            (30 - 200 * p) ** 2 / (200 * p * (1 - p)), 2.5758293**2, rtol=1e-6
        )


def test_wilson_without_trials():
    assert np.isnan(wilson_interval(0, 0)).all()


@pytest.mark.parametrize(
    ("arguments", "word"),
    [((5, 4), "successes"), ((-1, 4), "successes"), ((1, 4, 1.0), "confidence")],
)
def test_wilson_errors(arguments, word):
    with pytest.raises(InputError, match=word):
        wilson_interval(*arguments)


def test_bootstrap_counts_are_multinomial():
    counts = bootstrap_counts(50, 4000, "test")
    assert (counts.sum(axis=1) == 50).all()
    # Each item: mean 1, variance 1 - 1/50, over 4000 independent draws; five standard errors.
    assert np.abs(counts.mean(axis=0) - 1).max() < 5 / np.sqrt(4000)
    assert abs(counts.var(axis=0).mean() - 0.98) < 0.02


def test_bootstrap_is_seeded_by_purpose_and_nothing_else():
    first = bootstrap_counts(20, 5, "one")
    bootstrap_counts(7, 3, "something else")
    np.testing.assert_array_equal(bootstrap_counts(20, 5, "one"), first)
    assert (bootstrap_counts(20, 5, "two") != first).any()
    np.testing.assert_array_equal(bootstrap_counts(20, 3, "one"), first[:3])  # more continue fewer


def test_table_counts_leave_alone_what_is_not_resampled():
    keypoints, sets = table_counts((6, 4), 10, ("sets",), "test")
    assert (keypoints == 1).all() and keypoints.shape == (10, 6)
    assert (sets != 1).any() and (sets.sum(axis=1) == 4).all()
    with pytest.raises(InputError, match="'views'"):
        table_counts((6, 4), 10, ("views",))


def test_percentile_interval_ignores_what_does_not_exist():
    samples = np.stack([np.arange(101.0), np.full(101, np.nan)], axis=1)
    samples[50, 0] = np.nan
    low, high = percentile_interval(samples, 0.9)
    np.testing.assert_allclose([low[0], high[0]], [5, 95], atol=0.06)
    assert np.isnan([low[1], high[1]]).all()


def test_centred_interval_keeps_the_spread_and_moves_the_mean():
    samples = np.random.default_rng(2).normal(7.0, 2.0, (20000, 2))
    low, high = centred_interval(samples, np.array([3.0, -1.0]))
    np.testing.assert_allclose(low, [3 - 3.92, -1 - 3.92], atol=0.1)
    np.testing.assert_allclose(high, [3 + 3.92, -1 + 3.92], atol=0.1)
    low, high = centred_interval(samples, np.array([3.0, -1.0]), limits=(0.0, 5.0))
    assert low.tolist() == [0.0, 0.0] and high[0] == 5.0


def test_centred_interval_of_nothing_is_nothing():
    samples = np.array([[1.0, np.nan], [2.0, np.nan]])
    low, high = centred_interval(samples, np.array([1.5, np.nan]))
    assert np.isfinite([low[0], high[0]]).all() and np.isnan([low[1], high[1]]).all()
