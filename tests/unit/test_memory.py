"""Memory is asked about before it is taken."""

import mmap

import pytest

from keystab.errors import InputError
from keystab.utils import memory


def test_available_memory_is_plausible():
    assert mmap.PAGESIZE < memory.available() < 2**63


def test_a_limit_of_the_machine_is_named(monkeypatch):
    monkeypatch.setattr(memory, "available", lambda: 3_000_000_000)
    memory.require(3e9, "a fitting thing", "nothing")
    with pytest.raises(InputError) as raised:
        memory.require(1.25e12, "a view", "ask for less")
    assert str(raised.value) == (
        "a view needs about 1.25 TB of memory, 3 GB are available: ask for less"
    )


def test_a_machine_without_proc_still_answers(monkeypatch):
    def nothing(path):
        raise FileNotFoundError(path)

    monkeypatch.setattr(memory.Path, "read_text", nothing)
    assert memory.available() > mmap.PAGESIZE
