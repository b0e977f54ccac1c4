"""Minimum set cover: exact, proven, and always the same answer.

A minimum cover is seldom unique. Here candidates are numbered in order of preference and, of all
minimum covers, the one whose sorted numbers come first is returned. That answer is a property of
the problem: it depends neither on a solver's ties nor on the order in which anything is visited.

Sets of elements are whole numbers used as bit masks: bit e says whether element e is covered.
Python's integers have any width, and one operation on them handles 64 elements at a time.
"""

from __future__ import annotations

import heapq
import math
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from scipy.sparse import csr_array

# Candidate number (lower is preferred) -> bit mask of the elements it covers; ascending numbers.
Candidates = dict[int, int]


@dataclass(frozen=True)
class Cover:
    """A cover and what is known about it.

    Attributes
    ----------
    chosen : list of int
        Candidates of the cover, ascending.
    lower_bound : int
        Proven: no cover has fewer members. Equal to ``len(chosen)`` where the cover is minimum.
    canonical : bool
        Whether this is proven to be the first of all minimum covers.
    n_milp : int
        Integer programs that were solved on the way.
    """

    chosen: list[int]
    lower_bound: int
    canonical: bool
    n_milp: int


class _NotProvenError(Exception):
    """The time ran out before an optimum was proven."""


@dataclass
class _Solver:
    """Integer programs within a time limit, counted."""

    deadline: float
    n_milp: int = field(default=0)

    def check_time(self) -> None:
        """Raise if the time is up."""
        if time.monotonic() >= self.deadline:
            raise _NotProvenError

    def minimum(self, candidates: Candidates) -> list[int]:
        """Return one minimum cover, whichever the solver happens to find."""
        from scipy.optimize import Bounds, LinearConstraint, milp

        self.check_time()
        self.n_milp += 1
        numbers = list(candidates)
        result = milp(
            np.ones(len(numbers)),
            integrality=np.ones(len(numbers)),
            bounds=Bounds(0, 1),
            constraints=LinearConstraint(_incidence(candidates), lb=1),
            options={"time_limit": self.deadline - time.monotonic(), "mip_rel_gap": 0.0},
        )
        if result.status != 0:
            raise _NotProvenError
        return [number for number, x in zip(numbers, result.x, strict=True) if x > 0.5]


def first_minimum_cover(
    candidates: Candidates, size_limit: int = 5000, time_limit: float = 60.0
) -> Cover:
    """First, in order of preference, of all minimum covers.

    Candidates and elements that cannot matter are removed first. Then the candidates are visited
    in order of preference, and each is taken if and only if some minimum cover holds it together
    with those already taken. Most of these questions are settled by a pair of bounds (greedy cover
    above, elements without a common candidate below), the others by an integer program.

    Parameters
    ----------
    candidates : dict of int to int
        Candidate number (lower is preferred) to the bit mask of the elements that it covers. The
        elements to be covered are those that some candidate covers.
    size_limit : int
        With more candidates than this the greedy cover is returned, with its proven bound.
    time_limit : float
        Seconds after which a cover is returned that is not proven minimum (or not proven to be the
        first). Only then does the answer depend on the machine.

    Returns
    -------
    Cover
        The cover, its proven lower bound, and whether it is proven to be the first.

    Examples
    --------
    Elements 0, 1, 2; candidate 1 covers the first two, 0 and 2 cover one or two of them.

    >>> first_minimum_cover({0: 0b100, 1: 0b011, 2: 0b110}).chosen
    [0, 1]
    """
    candidates = dict(sorted(candidates.items()))
    if len(candidates) > size_limit:
        cover = _greedy(candidates)
        return Cover(cover, max(_packing(candidates), _relaxation(candidates)), False, 0)
    solver = _Solver(time.monotonic() + time_limit)
    certain, candidates = _reduce(candidates, in_order=True)
    chosen, lower_bound, canonical = list(certain), len(certain), True
    for part in _split(candidates):
        greedy = _greedy(part)
        try:
            found = _minimum(part, len(greedy), solver)
            assert found is not None  # the greedy cover is one of the allowed size
            lower_bound += len(found)
            first, proven = _first(part, found, solver)
        except _NotProvenError:
            first, proven = greedy, False
            lower_bound += max(_packing(part), _relaxation(part))
        chosen += first
        canonical &= proven
    return Cover(sorted(chosen), lower_bound, canonical, solver.n_milp)


def _first(candidates: Candidates, minimum: list[int], solver: _Solver) -> tuple[list[int], bool]:
    """First minimum cover of a connected part, given any one; and whether that is proven."""
    proven = True
    for number, covered in candidates.items():
        # Candidates before this one were rejected and must not come back.
        remaining = {
            other: mask & ~covered
            for other, mask in candidates.items()
            if other > number and mask & ~covered
        }
        if number not in minimum:
            if _union(remaining) != _union(candidates) & ~covered:
                continue
            try:
                rest = _minimum(remaining, len(minimum) - 1, solver)
            except _NotProvenError:
                proven = False
                continue
            if rest is None:
                continue
            minimum = [number, *rest]
        chosen = [number]
        for part in _split(remaining):
            first, part_proven = _first(part, [m for m in minimum if m in part], solver)
            chosen += first
            proven &= part_proven
        return chosen, proven
    return [], proven


def _minimum(candidates: Candidates, at_most: int, solver: _Solver) -> list[int] | None:
    """Return some minimum cover, or None if every cover has more than `at_most` members."""
    solver.check_time()
    chosen, candidates = _reduce(candidates, in_order=False)
    parts = _split(candidates)
    bounds = [_packing(part) for part in parts]
    spare = at_most - len(chosen) - sum(bounds)
    for part, bound in sorted(zip(parts, bounds, strict=True), key=lambda item: len(item[0])):
        if spare < 0:
            return None
        cover = _minimum_of_part(part, bound, solver)
        spare -= len(cover) - bound
        chosen += cover
    return chosen if spare >= 0 else None


def _minimum_of_part(candidates: Candidates, bound: int, solver: _Solver) -> list[int]:
    """Return some minimum cover of a reduced part whose covers have `bound` members or more."""
    cover = _greedy(candidates)
    if len(cover) == bound:
        return cover
    if bound == 2:
        pair = _pair(candidates)
        if pair:
            return pair
        if len(cover) == 3:
            return cover
    return solver.minimum(candidates)


def _pair(candidates: Candidates) -> list[int]:
    """Return two candidates that cover everything, or an empty list."""
    everything = _union(candidates)
    hardest = min(_elements(candidates).values(), key=int.bit_count)
    for number in _bits(hardest):
        rest = everything & ~candidates[number]
        for other, mask in candidates.items():
            if not rest & ~mask:
                return [number, other]
    return []


def _reduce(candidates: Candidates, in_order: bool) -> tuple[list[int], Candidates]:
    """Take the candidates without alternative and drop what cannot matter, until nothing changes.

    - An element whose candidates include all those of another one is covered whenever that is.
    - A candidate that covers nothing beyond another one is never needed. With `in_order` the other
      one must also be preferred, so that the first minimum cover survives.
    - An element with one candidate forces it.
    """
    chosen: list[int] = []
    while True:
        before = (len(candidates), len(chosen))
        elements = _without_supersets(_elements(candidates))
        # A forced candidate covers no element with alternatives: those were supersets.
        chosen += [mask.bit_length() - 1 for mask in elements.values() if mask.bit_count() == 1]
        is_open = sum(1 << e for e, mask in elements.items() if mask.bit_count() > 1)
        candidates = _without_subsets(
            {n: mask & is_open for n, mask in candidates.items() if mask & is_open}, in_order
        )
        if not candidates or before == (len(candidates), len(chosen)):
            return chosen, candidates


def _without_subsets(candidates: Candidates, in_order: bool) -> Candidates:
    order = list(candidates)
    if not in_order:
        order.sort(key=lambda number: -candidates[number].bit_count())
    kept: list[int] = []
    holders: dict[int, list[int]] = {}  # element -> masks kept so far that hold it
    for number in order:
        mask = candidates[number]
        if all(mask & ~other for other in holders.get(mask & -mask, ())):
            kept.append(number)
            for element in _bits(mask):
                holders.setdefault(1 << element, []).append(mask)
    return {number: candidates[number] for number in sorted(kept)}


def _without_supersets(elements: dict[int, int]) -> dict[int, int]:
    kept: dict[int, int] = {}
    lowest: dict[int, list[int]] = {}  # candidate -> masks kept so far whose lowest bit it is
    for element in sorted(elements, key=lambda element: elements[element].bit_count()):
        mask = elements[element]
        if all(other & ~mask for bit in _bits(mask) for other in lowest.get(bit, ())):
            kept[element] = mask
            lowest.setdefault((mask & -mask).bit_length() - 1, []).append(mask)
    return kept


def _elements(candidates: Candidates) -> dict[int, int]:
    """Element -> bit mask of the candidates that cover it."""
    elements: dict[int, int] = {}
    for number, mask in candidates.items():
        bit = 1 << number
        for element in _bits(mask):
            elements[element] = elements.get(element, 0) | bit
    return elements


def _split(candidates: Candidates) -> list[Candidates]:
    """Parts of the problem that share no element, each in order of preference."""
    groups: list[tuple[int, list[int]]] = []
    for number, mask in candidates.items():
        members, apart = [number], []
        for group in groups:
            if group[0] & mask:
                mask |= group[0]
                members += group[1]
            else:
                apart.append(group)
        groups = [*apart, (mask, members)]
    return [{n: candidates[n] for n in sorted(members)} for _, members in groups]


def _greedy(candidates: Candidates) -> list[int]:
    """Cover that takes the candidate with most new elements each time, the preferred one on ties.

    Gains only shrink, so a candidate whose gain is out of date is put back at its new place.
    """
    missing = _union(candidates)
    heap = [(-mask.bit_count(), number) for number, mask in candidates.items()]
    heapq.heapify(heap)
    chosen = []
    while missing:
        _, number = heap[0]
        entry = (-(candidates[number] & missing).bit_count(), number)
        if entry == heap[0]:
            heapq.heappop(heap)
            chosen.append(number)
            missing &= ~candidates[number]
        else:
            heapq.heapreplace(heap, entry)
    return chosen


def _packing(candidates: Candidates) -> int:
    """Lower bound: elements no two of which share a candidate, collected greedily."""
    used = count = 0
    for mask in sorted(_elements(candidates).values(), key=int.bit_count):
        if not mask & used:
            used |= mask
            count += 1
    return count


def _relaxation(candidates: Candidates) -> int:
    """Lower bound: candidates may be taken in part (linear program), rounded up."""
    from scipy.optimize import linprog

    result = linprog(
        np.ones(len(candidates)),
        A_ub=-_incidence(candidates),
        b_ub=-np.ones(len(_elements(candidates))),
        bounds=(0, 1),
        options={"time_limit": 60.0},
    )
    return math.ceil(result.fun - 1e-6) if result.status == 0 else 1


def _incidence(candidates: Candidates) -> csr_array:
    """Sparse 0/1 matrix, one row per element and one column per candidate."""
    from scipy.sparse import csr_array

    elements = [list(_bits(mask)) for mask in candidates.values()]
    column = np.repeat(np.arange(len(elements)), [len(e) for e in elements])
    _, row = np.unique(np.concatenate(elements), return_inverse=True)
    return csr_array((np.ones(column.size), (row, column)))


def _union(candidates: Candidates) -> int:
    everything = 0
    for mask in candidates.values():
        everything |= mask
    return everything


def _bits(mask: int) -> Iterator[int]:
    while mask:
        lowest = mask & -mask
        yield lowest.bit_length() - 1
        mask ^= lowest
