"""What the sources leave alone: private parts of other packages, and attributes of tables."""

from __future__ import annotations

import ast
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]

# Members of named tuples and syntax trees whose underscore only keeps them apart from fields: the
# documentation of Python has them all.
DOCUMENTED = {"_replace", "_asdict", "_fields", "_make"}

# Private parts that are used all the same, and why.
NO_PUBLIC_WAY = {
    ("tools/reruns.py", name): "Snakemake has no public name for its plan and for what it compares"
    for name in ("_workflow", "_code", "_params", "_input")
} | {
    ("tools/reference_pages.py", name): "argparse has no public name for what a parser takes"
    for name in (
        "_actions", "_expand_help", "_get_formatter", "_HelpAction", "_SubParsersAction",
    )
}  # fmt: skip

# What is called `attrs` there belongs to groups and arrays of Zarr, which write it down.
OF_ZARR = {
    f"src/keystab/io/{name}.py" for name in ("scale_space_store", "view_store", "zarr_groups")
}


@cache
def files() -> dict[str, list[ast.AST]]:
    """The syntax of all files."""
    return {
        path.relative_to(ROOT).as_posix(): list(ast.walk(ast.parse(path.read_text("utf-8"))))
        for folder in ("src", "tools")
        for path in sorted((ROOT / folder).rglob("*.py"))
    }


def is_private(name: str) -> bool:
    return name.startswith("_") and not (name.startswith("__") and name.endswith("__"))


def own_names(nodes: list[ast.AST]) -> set[str]:
    """Names that a file itself gives to functions, classes, fields and attributes of self."""
    found = set()
    for node in nodes:
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            found.add(node.name)
        elif isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name):
            found.add(node.target.id)
        elif isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Store):
            found |= {node.attr} if ast.unparse(node.value) in ("self", "cls") else set()
    return found


def private_parts(nodes: list[ast.AST]) -> set[str]:
    """Private names of others that code imports, or takes from what is not its own."""
    found = set()
    for node in nodes:
        if isinstance(node, ast.Attribute):
            found.add(node.attr)
        elif isinstance(node, ast.Import | ast.ImportFrom):
            base = [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            for alias in node.names:
                parts = ".".join([*base, alias.name]).split(".")
                found.update(parts if parts[0] != "keystab" else ())
        elif isinstance(node, ast.Call) and getattr(node.func, "id", "") in (
            "getattr",
            "hasattr",
        ):
            found |= {each.value for each in node.args[1:2] if isinstance(each, ast.Constant)}
    return {name for name in found if is_private(name)} - own_names(nodes) - DOCUMENTED


@pytest.mark.parametrize(
    ("code", "found"),
    [
        ("import pandas as pd\npd.DataFrame()._mgr", {"_mgr"}),
        ("from numba.core._config import x", {"_config"}),
        ("import zarr._storage as s", {"_storage"}),
        ("getattr(figure, '_layout')", {"_layout"}),
        ("class A:\n    def _b(self): return self._c", {"_c"}),
        ("class A:\n    def __init__(self): self._b = 1\ndef f(a): return a._b", set()),
        ("from keystab.utils.stage_command import command\nx.__dict__, row._asdict()", set()),
    ],
)
def test_private_parts_are_seen(code, found):
    assert private_parts(list(ast.walk(ast.parse(code)))) == found


def test_nobody_reaches_into_private_parts_of_other_packages():
    found = {(name, part) for name, nodes in files().items() for part in private_parts(nodes)}
    assert found == set(NO_PUBLIC_WAY)


def test_no_result_travels_in_the_attributes_of_a_table():
    # pandas drops and copies them as it likes, and no type says what is in them.
    users = {
        name
        for name, nodes in files().items()
        for node in nodes
        if isinstance(node, ast.Attribute) and node.attr == "attrs"
    }
    assert users == OF_ZARR
