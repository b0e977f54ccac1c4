"""The examples in the docstrings of the tools are right."""

from __future__ import annotations

import doctest
import importlib
from pathlib import Path

import pytest


@pytest.mark.parametrize("name", ["interrupted", "overheads", "rule_graph", "study"])
def test_examples_of_tools(name, monkeypatch):
    monkeypatch.syspath_prepend(Path(__file__).parents[2] / "tools")
    failed, tried = doctest.testmod(importlib.import_module(name))
    assert tried and not failed
