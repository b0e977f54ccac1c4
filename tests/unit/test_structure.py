"""The rooms of the house: who may import whom, and which libraries."""

from __future__ import annotations

import ast
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2] / "src/keystab"
FILES = {
    ".".join(("keystab", *path.relative_to(ROOT).with_suffix("").parts)): path
    for path in ROOT.rglob("*.py")
    if path.name != "__init__.py"
}


def imported(path: Path) -> set[str]:
    """Modules that a file imports, anywhere in it."""
    names = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            inner = {f"{node.module}.{alias.name}" for alias in node.names}
            names |= inner & set(FILES) or {node.module}
    return names


LAST = ("records", "workflow", "provenance", "foreign_tables", "differences", "crate", "archive")
LAST += ("run_description", "unpacking", "bare_code", "archived_settings", "archive_contents")
LAST += ("result_checks", "verification", "recomputation")
IMPORTS = {name: imported(path) for name, path in FILES.items()}


def room(name: str) -> str:
    """Folder of a module: figures, stages, or the science."""
    first = name.removeprefix("keystab.").split(".")[0]
    return first if first in ("figures", "stages") else "science"


def test_no_two_modules_need_each_other():
    order = TopologicalSorter({name: names & set(FILES) for name, names in IMPORTS.items()})
    assert len(tuple(order.static_order())) == len(FILES)  # a cycle raises


def test_the_science_knows_neither_stages_nor_figures():
    for name, names in IMPORTS.items():
        if room(name) == "science":
            assert not [other for other in names & set(FILES) if room(other) != "science"], name


def test_figures_read_tables_and_nothing_else():
    allowed = {"keystab.errors", "keystab.files", "keystab.tables", "keystab.checks"}
    allowed |= {"keystab.passports"}
    for name, names in IMPORTS.items():
        if room(name) == "figures":
            known = {other for other in names & set(FILES) if room(other) != "figures"}
            assert known <= allowed, name


def test_nothing_but_the_command_knows_the_rooms_that_come_last():
    last = {f"keystab.{name}" for name in LAST}
    assert last <= set(FILES)
    for name, names in IMPORTS.items():
        assert name in last | {"keystab.cli"} or last.isdisjoint(names), name


@pytest.mark.parametrize(
    ("library", "where"),
    [("zarr", "keystab.zarr_groups"), ("seaborn", "keystab.figures")],
)
def test_a_library_stays_in_its_room(library, where):
    users = [
        name
        for name, names in IMPORTS.items()
        if any(other.split(".")[0] == library for other in names)
    ]
    assert users and all(name.startswith(where) for name in users), users


def test_only_figures_draw():
    for name, names in IMPORTS.items():
        draws = any(other.split(".")[0] in ("matplotlib", "seaborn") for other in names)
        assert not draws or room(name) == "figures", name
