"""Roots are found to the digits of their functions."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from keystab.utils.roots import root_between


@given(st.floats(-5, 5), st.floats(1e-3, 3), st.floats(1e-3, 3), st.sampled_from([1e-30, 1.0, 1e9]))
def test_a_root_between_two_signs_is_found(root, before, after, slope):
    found = root_between(lambda x: slope * math.sinh(x - root), root - before, root + after)
    assert found == pytest.approx(root, rel=1e-14, abs=2e-15)


@pytest.mark.parametrize(
    ("function", "found"),
    [(lambda x: x + 1, 0.0), (lambda x: x - 3, 2.0), (lambda x: x, 0.0), (lambda x: x - 2, 2.0)],
)
def test_without_a_root_the_nearer_end_is_taken(function, found):
    assert root_between(function, 0, 2) == found
