"""Criteria over numbers with intervals: what decides them, and how surely."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import norm

from keystab.errors import InputError
from keystab.evaluation.intervals import wilson_interval
from keystab.study.decisions import Decision, Known, decide, holm, interval_of

A, B = Known(0.30, 0.25, 0.35), Known(0.40, 0.35, 0.45)
NUMBERS = {"a": A, "b": B, "sum": Known(0.7, expression="a + b"), "exact": Known(0.37)}
Z = norm.ppf(0.975)


def p_of(distance: float, half_width: float) -> float:
    return float(2 * norm.sf(Z * abs(distance) / half_width))


@pytest.mark.parametrize(
    ("criterion", "holds", "p"),
    [
        ("a < 0.36", True, p_of(0.06, 0.05)),
        ("a > 0.36", False, p_of(0.06, 0.05)),
        ("not a > 0.36", True, p_of(0.06, 0.05)),
        ("a < b", True, p_of(0.1, math.hypot(0.05, 0.05))),
        ("a < b / 2", False, p_of(0.1, math.hypot(0.05, 0.025))),
        ("sum < 0.8", True, p_of(0.1, math.hypot(0.05, 0.05))),
        ("exact < 0.38", True, 0.0),
        ("exact == 0.37", True, 0.0),
        # All are needed: the weakest decides. One would do to refute them: each is charged.
        ("a < 0.36 and b < 0.5", True, p_of(0.06, 0.05)),
        ("a < 0.2 and b < 0.5", False, 2 * p_of(0.1, 0.05)),
        ("a < 0.2 or b < 0.5", True, 2 * p_of(0.1, 0.05)),
        ("a < 0.2 or b < 0.3", False, p_of(0.1, 0.05)),
        # No number misses both ends of a range.
        ("0.4 <= a <= 0.5", False, p_of(0.1, 0.05)),
        ("0.2 <= a <= 0.45", True, p_of(0.1, 0.05)),
    ],
)
def test_known_cases(criterion, holds, p):
    found = decide(criterion, NUMBERS)
    assert found.holds is holds and found.p == pytest.approx(p, abs=1e-12)


def test_the_interval_that_touches_the_line_is_the_limit():
    assert decide("a <= 0.35", NUMBERS).p == pytest.approx(0.05)
    assert decide("a <= 0.3500001", NUMBERS).decided
    assert not decide("a <= 0.3499999", NUMBERS).decided


def test_a_number_on_the_line_holds_and_is_not_decided():
    assert decide("a >= 0.3", NUMBERS) == Decision(True, 1.0)


def test_the_largest_of_several_is_charged_for_the_choice_where_one_would_do():
    largest = {"a": A._replace(extreme="max", chosen_from=5)}
    p = p_of(0.06, 0.05)
    assert decide("a < 0.36", largest).p == pytest.approx(p)  # all lie below
    assert decide("a > 0.24", largest).p == pytest.approx(5 * p)  # one of them lies above
    smallest = {"a": A._replace(extreme="min", chosen_from=5)}
    assert decide("a < 0.36", smallest).p == pytest.approx(5 * p)
    assert decide("-a < -0.24", smallest).p == pytest.approx(p)


def test_two_choices_are_charged_each_in_its_own_interval():
    """By hand: at the level found, the wider intervals of both just touch."""
    pair = {
        "most": Known(2.0, 1.9, 2.1, extreme="max", chosen_from=9),
        "least": Known(1.7, 1.65, 1.75, extreme="min", chosen_from=4),
    }
    p = decide("most - least > 0.1", pair).p
    widths = (h * norm.ppf(1 - p / (2 * k)) / Z for h, k in ((0.1, 9), (0.05, 4)))
    assert math.hypot(*widths) == pytest.approx(0.2)
    assert p < 36 * p_of(0.2, math.hypot(0.1, 0.05))
    assert decide("most - least > 0.3", pair).p == 1.0


def test_a_difference_of_shares_has_the_interval_of_newcombe():
    """Newcombe 1998, method 10: 56 of 70 against 48 of 80 is 0.2, 0.0524 to 0.3339."""
    shares = {}
    for name, (k, n) in {"one": (56, 70), "other": (48, 80)}.items():
        low, high = wilson_interval(k, n)
        shares[name] = Known(k / n, float(low), float(high))
    assert interval_of("one - other", shares) == pytest.approx((0.0524, 0.3339), abs=5e-5)


def test_numbers_without_intervals_have_none_together():
    assert all(math.isnan(end) for end in interval_of("exact + 1", NUMBERS))


def test_expressions_are_computed_again_from_what_moves():
    numbers = {
        "a": A,
        "twice": Known(0.6, expression="2 * a"),
        "c": Known(1.2, expression="2 * twice"),
    }
    assert interval_of("c - 4 * a", numbers) == pytest.approx((0, 0), abs=1e-12)
    assert interval_of("c", numbers) == pytest.approx((1.0, 1.4))


def test_what_criteria_may_not_say():
    with pytest.raises(InputError):
        decide("open(a) > 1", NUMBERS)


@given(st.floats(-1, 1), st.floats(0.01, 1), st.floats(-1, 1))
def test_a_criterion_and_its_contrary_are_decided_alike(value, half, line):
    numbers = {"x": Known(value, value - half, value + half)}
    below, above = (decide(f"x {sign} {line!r}", numbers) for sign in ("<=", ">"))
    assert below.holds is not above.holds and below.p == pytest.approx(above.p)


@given(st.lists(st.floats(0, 1), min_size=1, max_size=9))
def test_holm_is_between_single_levels_and_bonferroni(levels):
    together = holm(levels)
    for one, adjusted in zip(levels, together, strict=True):
        assert one <= adjusted <= min(1.0, len(levels) * one)
    order = np.argsort(levels, kind="stable")
    assert np.all(np.diff(np.array(together)[order]) >= 0)
    assert together[order[0]] == min(1.0, len(levels) * min(levels))
