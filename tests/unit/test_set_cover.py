"""Minimum covers against enumeration and against domination numbers that are known."""

import itertools

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from keystab.matching.set_cover import first_minimum_cover


def first_by_enumeration(candidates):
    """Try all subsets, small ones first and in order of preference among equal sizes."""
    everything = 0
    for mask in candidates.values():
        everything |= mask
    for size in range(len(candidates) + 1):
        for subset in itertools.combinations(sorted(candidates), size):
            covered = 0
            for number in subset:
                covered |= candidates[number]
            if covered == everything:
                return list(subset)
    raise AssertionError("all candidates together cover everything")


def grid(height, width):
    """Closed neighbourhoods of a grid graph whose nodes are numbered along its rows."""
    masks = {}
    for y, x in itertools.product(range(height), range(width)):
        cross = [(y, x), (y - 1, x), (y + 1, x), (y, x - 1), (y, x + 1)]
        masks[y * width + x] = sum(
            1 << (v * width + u) for v, u in cross if 0 <= v < height and 0 <= u < width
        )
    return masks


def covers(cover, candidates):
    return {e for n in cover for e in range(999) if candidates[n] >> e & 1} == {
        e for m in candidates.values() for e in range(999) if m >> e & 1
    }


@settings(max_examples=400, deadline=None)
@given(st.lists(st.integers(1, 2**11 - 1), max_size=11))
def test_equals_enumeration(masks):
    candidates = dict(enumerate(masks))
    cover = first_minimum_cover(candidates)
    assert cover.chosen == first_by_enumeration(candidates)
    assert cover.lower_bound == len(cover.chosen)
    assert cover.canonical


@settings(max_examples=200, deadline=None)
@given(st.lists(st.sets(st.integers(0, 10), min_size=2, max_size=3), min_size=6, max_size=13))
def test_equals_enumeration_when_candidates_cover_little(sets):
    """Covers of many members, where reductions settle the least."""
    candidates = {n: sum(1 << e for e in members) for n, members in enumerate(sets)}
    assert first_minimum_cover(candidates).chosen == first_by_enumeration(candidates)


# Domination numbers of grid graphs (Alanko et al., Electronic J. Combinatorics 18, P141, 2011).
@pytest.mark.parametrize(("side", "number"), [(4, 4), (5, 7), (6, 10), (7, 12), (8, 16)])
def test_domination_numbers_of_square_grids(side, number):
    cover = first_minimum_cover(grid(side, side))
    assert len(cover.chosen) == cover.lower_bound == number
    assert covers(cover.chosen, grid(side, side))
    assert cover.canonical


def test_grid_needs_integer_programs_and_equals_enumeration():
    """A case beyond the shortcuts, so that the path through the solver is compared as well."""
    candidates = grid(5, 5)
    cover = first_minimum_cover(candidates)
    assert cover.n_milp > 0
    assert cover.chosen == first_by_enumeration(candidates)


def test_between_a_lower_bound_of_two_and_a_greedy_cover_of_four():
    """No two of these do, although the bound allows two; greedy takes four, and three suffice."""
    masks = [36, 160, 520, 194, 386, 134, 332, 10, 864]
    candidates = dict(enumerate(masks))
    cover = first_minimum_cover(candidates)
    assert len(cover.chosen) == 3
    assert cover.chosen == first_by_enumeration(candidates)


def test_names_of_elements_do_not_matter():
    candidates = grid(6, 6)
    mirrored = {n: int(f"{mask:036b}"[::-1], 2) for n, mask in candidates.items()}
    assert first_minimum_cover(mirrored).chosen == first_minimum_cover(candidates).chosen


def test_preference_decides_among_minimum_covers():
    """A ring of six is dominated by three pairs of opposite nodes; the preferred pair is taken."""
    ring = [1 << i | 1 << (i + 1) % 6 | 1 << (i - 1) % 6 for i in range(6)]
    assert first_minimum_cover(dict(enumerate(ring))).chosen == [0, 3]
    preferred = [2, 4, 5, 1, 3, 0]  # node by place: the pair (2, 5) has places 0 and 2
    assert first_minimum_cover({p: ring[n] for p, n in enumerate(preferred)}).chosen == [0, 2]


@pytest.mark.parametrize("limit", [{"size_limit": 10}, {"time_limit": 0.0}])
def test_past_a_limit_the_cover_is_valid_and_its_bound_proven(limit):
    cover = first_minimum_cover(grid(9, 9), **limit)
    assert covers(cover.chosen, grid(9, 9))
    assert 19 <= cover.lower_bound <= 20 <= len(cover.chosen)  # 19: the linear program
    assert not cover.canonical


def test_nothing_to_cover():
    cover = first_minimum_cover({})
    assert (cover.chosen, cover.lower_bound, cover.canonical) == ([], 0, True)


def test_a_cover_of_as_many_candidates_as_allowed_is_proven():
    candidates = grid(3, 4)
    assert first_minimum_cover(candidates, size_limit=12).canonical
    assert not first_minimum_cover(candidates, size_limit=11).canonical
