"""What arguments may be: each kind on its limits, and what is none of it."""

from __future__ import annotations

import math

import numpy as np
import pytest

from keystab.errors import InputError
from keystab.utils import validation
from keystab.utils.grey_values import grey_unit


@pytest.mark.parametrize(
    ("check", "limits", "good", "bad"),
    [
        (
            validation.number, {},
            [0, -2.5, 3, np.float32(1.5), np.int64(4)],
            [True, np.bool_(True), "1", None, math.nan, math.inf, -math.inf, np.nan, [1.0], 1j],
        ),
        (validation.number, {"least": 0.5}, [0.5, 2], [0.5 - 1e-12, -1, math.inf]),
        (validation.number, {"above": 0.5}, [0.5 + 1e-12, 2], [0.5, 0.25, math.inf]),
        (validation.number, {"least": -1, "above": -3}, [-1, 0], [-2, -3]),
        (validation.limit, {"above": 0}, [math.inf, np.float64("inf"), 0.1], [-math.inf, 0, math.nan]),
        (validation.integer, {"least": 2}, [2, 3, np.int64(7)], [1, 2.0, True, "2", math.inf]),
        (validation.integer, {"least": 2, "most": 4}, [2, 3, 4], [1, 5]),
        (validation.count, {"least": 1}, [1, 2.0, math.inf], [0, 0.5, 1.5, -math.inf, "1", True]),
        (
            validation.boolean, {},
            [True, False, np.bool_(True), np.bool_(False)],
            [0, 1, 1.0, "True", None, np.array([True, False])],
        ),
    ],
)  # fmt: skip
def test_arguments_are_taken_up_to_their_limits_and_no_farther(check, limits, good, bad):
    for value in good:
        assert check("it", value, **limits) == value
    for value in bad:
        with pytest.raises(InputError, match="^it is .*allowed (is|are) .*: change it$"):
            check("it", value, **limits)


@pytest.mark.parametrize("exponent", [-1074, -3, 0, 7, 1023])
@pytest.mark.parametrize("sign", [1, -1])
def test_the_unit_of_grey_values_is_the_power_of_two_up_to_the_largest(exponent, sign):
    unit = 2.0**exponent
    for factor in (1.0, 1.5) if exponent > -1074 else (1.0,):
        # The largest is one of many, and its sign does not matter.
        assert grey_unit(np.array([0.0, sign * factor * unit, -0.9 * sign * unit])) == unit
