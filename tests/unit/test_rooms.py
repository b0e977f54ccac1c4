"""The rooms of the house: who may import whom, and which libraries."""

from __future__ import annotations

import ast
from functools import cache
from graphlib import TopologicalSorter
from importlib import import_module
from pathlib import Path

import pytest

import keystab
from keystab.provenance.code_digest import imported_modules

ROOT = Path(__file__).parents[2] / "src/keystab"

# Rooms in the order in which data flows, and the rooms above that each imports from. A new entry
# is a decision: it makes whatever the importing room computes depend on one more room.
ROOMS = {
    "root": "",  # the modules directly in src/keystab
    "utils": "root",
    "scalespace": "root utils",
    "camera": "root utils scalespace",
    "io": "root utils camera",
    "matching": "root camera",
    "detection": "root utils scalespace",
    "evaluation": "root utils matching",  # knows no detector, and so can audit any
    "truth": "root utils scalespace camera detection",
    "prediction": "root utils scalespace detection",
    "audit": "root camera io evaluation truth",  # detectors of others, in processes of their own
    "experiments": "root utils scalespace camera matching detection evaluation prediction",
    "study": "root utils scalespace camera io evaluation",
    "provenance": "root utils io study",
    "stages": "root utils scalespace camera io matching detection evaluation truth audit experiments "
    "study",
    "figures": "root utils io",  # tables, and no science
    "cli": "root utils io audit provenance figures",
}
ALLOWED = {(room, other) for room, others in ROOMS.items() for other in others.split()}
MOST_ARROWS = 70
MOST_IN_ROOT = 8
MOST_LINES, MOST_LONG_FILES = 450, 3


def name_of(path: Path) -> str:
    """Dotted name of a module."""
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(("keystab", *parts)).removesuffix(".__init__")


FILES = {name_of(path): path for path in sorted(ROOT.rglob("*.py"))}


def imported(code: str, names: set[str]) -> set[str]:
    """Modules that code imports anywhere in it, by statements or by `import_module`."""
    found: set[str] = set()
    for node in ast.walk(ast.parse(code)):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert not node.level, "write from keystab.room.module import name"
            for alias in node.names:
                inner = f"{node.module}.{alias.name}"
                found.add(inner if inner in names else str(node.module))
        elif isinstance(node, ast.Call) and "import_module" in (
            getattr(node.func, "id", ""),
            getattr(node.func, "attr", ""),
        ):
            (name,) = node.args
            assert isinstance(name, ast.Constant), "import_module of a name made at run time"
            found.add(name.value)
    return found


def room(name: str) -> str:
    """Room of a module of the package."""
    parts = name.split(".")
    return parts[1] if len(parts) > 1 and (ROOT / parts[1]).is_dir() else "root"


@cache
def imports() -> dict[str, set[str]]:
    """What each module imports."""
    # The front door leads everywhere by the table of public names, when one of them is used.
    return {
        name: imported(path.read_text(encoding="utf-8"), set(FILES))
        for name, path in FILES.items()
        if name != "keystab"
    }


@cache
def own() -> dict[str, set[str]]:
    """What each module imports of the package."""
    return {name: names & set(FILES) for name, names in imports().items()}


@pytest.mark.parametrize(
    "code",
    [
        "import keystab.io.tables",
        "from keystab.io import tables",
        "from keystab.io.tables import read_table",
        "def late():\n    from keystab.io.tables import read_table",
        "if TYPE_CHECKING:\n    from keystab.io import tables as t",
        "import importlib\nimportlib.import_module('keystab.io.tables')",
        "from importlib import import_module\nimport_module('keystab.io.tables').read_table",
    ],
)
def test_imports_of_all_kinds_are_seen(code):
    assert "keystab.io.tables" in imported(code, set(FILES))


def test_rooms_import_from_the_rooms_that_the_table_says_and_no_other():
    arrows: dict[tuple[str, str], list[str]] = {}
    for name, others in own().items():
        for other in others:
            if room(name) != room(other):
                arrows.setdefault((room(name), room(other)), []).append(f"{name} > {other}")
    unknown = {arrow: who for arrow, who in arrows.items() if arrow not in ALLOWED}
    assert not unknown, unknown
    assert set(arrows) == ALLOWED, f"nobody needs {ALLOWED - set(arrows)} any more"
    assert len(arrows) <= MOST_ARROWS


# What uses the package as any program does, and is in no digest of a stage but as itself.
AT_THE_FRONT_DOOR = ["keystab.audit.worker", "keystab.cli.library"]


def test_nobody_inside_goes_through_the_front_door():
    # A new public name would count in the digest of whoever imports from the package itself.
    assert [name for name, others in own().items() if "keystab" in others] == AT_THE_FRONT_DOOR


def test_no_room_imports_from_a_later_one():
    order = list(ROOMS)
    assert [arrow for arrow in ALLOWED if order.index(arrow[0]) <= order.index(arrow[1])] == []
    assert {room(name) for name in FILES} == set(order)


def test_no_two_modules_need_each_other():
    order = TopologicalSorter(own())
    assert {*order.static_order(), "keystab"} == set(FILES)  # a circle raises


def test_few_modules_lie_outside_the_rooms():
    assert len(list(ROOT.glob("*.py"))) <= MOST_IN_ROOT


def test_files_are_of_a_length_that_can_be_read():
    lengths = {name: len(path.read_text("utf-8").splitlines()) for name, path in FILES.items()}
    long = {name: lines for name, lines in lengths.items() if lines > MOST_LINES}
    assert len(long) <= MOST_LONG_FILES, long


@pytest.mark.parametrize("name", sorted(set(ROOMS) - {"root"}))
def test_the_door_of_a_room_is_a_docstring(name):
    # It runs before every module of the room, and so counts in the digest of its code.
    body = ast.parse((ROOT / name / "__init__.py").read_text("utf-8")).body
    assert len(body) == 1 and ast.get_docstring(ast.Module(body, []))


def test_no_room_hides_a_public_name():
    # Python puts a room that is imported in the place of what the package says it is.
    assert set(ROOMS).isdisjoint(keystab.__all__)
    for name, home in keystab._HOME.items():
        assert getattr(import_module(f"keystab.{home}"), name) is getattr(keystab, name)


def test_nothing_but_the_command_knows_how_a_run_is_packed_and_verified():
    for name, names in own().items():
        known = {other for other in names if room(other) == "provenance"}
        if room(name) not in ("provenance", "cli"):
            assert not known, name


SEARCHING = ("simulate", "scale_space", "detect", "find_", "crop_views", "describe_views")


@pytest.mark.parametrize(
    "stage",
    [path.stem for path in (ROOT / "stages").glob("[!_]*.py") if path.stem.startswith(SEARCHING)],
)
def test_what_is_searched_for_does_not_depend_on_how_it_is_evaluated(stage):
    rooms = {room(name) for name in imported_modules(f"keystab.stages.{stage}")}
    assert "utils" in rooms
    assert rooms.isdisjoint({"matching", "evaluation", "prediction", "study", "provenance"})
    assert rooms.isdisjoint({"experiments"}) or stage == "detect_blobs"  # makes its own pictures


def test_figures_read_tables_and_nothing_else():
    allowed = {"keystab._version", "keystab.errors", "keystab.utils.files", "keystab.io.tables"}
    allowed |= {"keystab.io.figure_metadata", "keystab.utils.memory"}
    for name, names in own().items():
        if room(name) == "figures":
            assert {other for other in names if room(other) != "figures"} <= allowed, name


@pytest.mark.parametrize(
    ("library", "where"),
    [("zarr", "keystab.io.zarr_groups"), ("seaborn", "keystab.figures")],
)
def test_a_library_stays_in_its_room(library, where):
    users = [
        name
        for name, names in imports().items()
        if any(other.split(".")[0] == library for other in names)
    ]
    assert users and all(name.startswith(where) for name in users), users


def test_only_figures_draw():
    for name, names in imports().items():
        draws = any(other.split(".")[0] in ("matplotlib", "seaborn") for other in names)
        assert not draws or room(name) == "figures", name
