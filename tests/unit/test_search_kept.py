"""Kept results: the last that were asked for, up to a number of bytes."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from keystab.detection import search_lattice
from keystab.detection.detector import detect_keypoints
from keystab.detection.search_kept import Kept


def counted(most: int) -> tuple[Kept[str], list[int]]:
    made: list[int] = []

    def make(n: int) -> str:
        made.append(n)
        return "x" * n

    return Kept(make, len, most), made


def test_the_oldest_goes_first_and_use_makes_young():
    line, made = counted(6)
    for n in (1, 2, 3, 1):
        assert line(n) == "x" * n
    assert made == [1, 2, 3]
    line(4)  # 2 and 3 have to go, 1 was used after them
    line(1)
    assert made == [1, 2, 3, 4]
    line(3)
    assert made == [1, 2, 3, 4, 3]


def test_what_is_too_large_displaces_nothing():
    line, made = counted(3)
    for n in (3, 5, 5, 3):
        line(n)
    assert made == [3, 5, 5]


def test_threads_get_what_they_ask_for():
    line, _ = counted(40)
    asked = [n % 17 for n in range(600)]
    with ThreadPoolExecutor(4) as pool:
        assert [len(text) for text in pool.map(line, asked)] == asked


def test_an_error_keeps_nothing():
    line = Kept(lambda n: 1 / n, lambda _: 1, 5)
    with pytest.raises(ZeroDivisionError):
        line(0)
    assert line(2) == 0.5


def test_rows_at_nodes_of_a_search_are_kept_up_to_their_bytes(monkeypatch):
    asked: list[int] = []

    def n_bytes(rows):
        asked.append(sum(part.nbytes for part in rows))
        return asked[-1]

    image = np.random.default_rng(1).standard_normal((140, 150)).cumsum(0).cumsum(1)
    whole = detect_keypoints(image, 0.8, 9, n_oct=3)
    few = Kept(search_lattice.spline_nodes, n_bytes, 2**17)
    monkeypatch.setattr(search_lattice, "_nodes", few)
    found = detect_keypoints(image, 0.8, 9, n_oct=3)
    assert sum(asked) > 2**18  # more than is kept
    assert few._total <= 2**17
    assert found.equals(whole)
