"""The examples in the docstrings of the tools are right."""

from __future__ import annotations

import doctest
import importlib
import os
import subprocess
import sys
from pathlib import Path

import pytest

from keystab.utils.compiled_loops import forget_outdated

TOOLS = Path(__file__).parents[2] / "tools"
NAMES = [
    "changes",
    "findings",
    "interrupted",
    "mutations",
    "overheads",
    "reference_pages",
    "report",
    "report_words",
    "rule_graph",
    "study",
    "study_end",
    "tutorial",
    "why",
]


@pytest.mark.parametrize("name", NAMES)
def test_examples_of_tools(name, monkeypatch):
    monkeypatch.syspath_prepend(TOOLS)
    failed, tried = doctest.testmod(importlib.import_module(name))
    assert tried and not failed


@pytest.mark.parametrize(
    "room", [*(pytest.param(it, marks=pytest.mark.slow) for it in ("", "near/")), "far/away/"]
)
def test_loops_that_the_set_up_compiled_are_found_beside_their_module(room, tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(TOOLS)
    package, loops = tmp_path / "toy", tmp_path / "loops"
    (package / room).mkdir(parents=True)
    (package / room / "fast.py").write_text(
        "import sys\nfrom numba import njit\n\n@njit(cache=True)\ndef twice(x):\n    return x + x\n\n"
        "twice(2)\nsys.exit(0 if twice.stats.cache_hits else 'compiled')\n"
    )
    command = [sys.executable, "-B", "-m", f"toy/{room}fast".replace("/", ".")]
    variables = {name: os.environ[name] for name in os.environ if name != "NUMBA_CACHE_DIR"}

    def said(**more: str) -> str:
        run = subprocess.run(
            command, cwd=tmp_path, env=variables | more, capture_output=True, text=True
        )
        return run.stderr.strip()

    assert said(NUMBA_CACHE_DIR=str(loops)) == "compiled"
    importlib.import_module("compile_loops").copy_beside_modules(loops, package)
    assert not forget_outdated(package)  # what every first use of the library asks
    assert said() == ""
