"""Single changes of meaning are made where they should be, and nowhere else."""

from __future__ import annotations

import importlib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


@pytest.fixture(autouse=True)
def tools(monkeypatch):
    monkeypatch.syspath_prepend(ROOT / "tools")


def made(source, layout=False):
    """Kind of each change, with the line that it makes."""
    module = importlib.import_module("mutations")
    return {
        (one.operator, module.applied(source, one).splitlines()[one.line - 1].strip())
        for one in module.changes(source, layout)
    }


@pytest.mark.parametrize(
    ("source", "expected"),
    [
        ("a <= b", {("comparison", "a < b"), ("comparison", "a >= b")}),
        ("a = 1.5", {("constant", "a = 1.515")}),
        ("a = 1e-9", {("constant", "a = 1e-06")}),
        ("a - b", {("arithmetic", "a + b")}),
        ("min(a)", {("extreme", "max(a)")}),
        ("np.floor(a)", {("extreme", "np.ceil(a)")}),
        ("a or b", {("logic", "a and b"), ("clause", "(a)"), ("clause", "(b)")}),
        ("not a", {("logic", "bool(a)")}),
        ("a.shape[0]", {("axes", "a.shape[1]")}),
        ("a[0]", {("constant", "a[1]")}),
        ("f(y, x)", {("axes", "f(x, y)")}),
        ("def f(y, x): return y", {("axes", "def f(y, x): return x")}),
        ("def f(y): return y", set()),  # there is no x
        ("row.y", {("axes", "row.x")}),
        ("d > bound", {("comparison", "d >= bound"), ("comparison", "d < bound"), ("bound", "d > (0.5 * bound)")}),
        ("np.lexsort((a, b))", {("tie-break", "np.lexsort((a,))"), ("tie-break", "np.lexsort((b,))")}),
        ("def f():\n    if a:\n        raise ValueError(1)", {("check", "if False:")}),
        ("def f():\n    if a:\n        return b\n    return c", {("check", "if False:")}),
        ("'ÿ', a < b", {("comparison", "'ÿ', a <= b"), ("comparison", "'ÿ', a > b")}),
    ],
)  # fmt: skip
def test_each_kind_of_change(source, expected):
    assert made(source) == expected


@pytest.mark.parametrize(
    "source",
    [
        '"""Words, 3."""',
        "__all__ = ['x'][:1]",
        "raise InputError(f'{a + 1}')",
        "def f(a: Literal[1]) -> Array[2]: pass",
        "if TYPE_CHECKING:\n    a = 1",
        "f'{a + 1}'",
    ],
)
def test_what_only_a_reader_notices_is_left_alone(source):
    assert made(source) == set()


def test_layout_is_left_alone_where_figures_are_drawn_and_data_are_not():
    source = "WIDTH = 3\ndef draw(ax):\n    ax.plot(a + 1)\n    b = a + 1\n"
    assert {text for _, text in made(source, layout=True)} == {"b = a - 1", "b = a + 2"}


def test_a_place_is_found_again_where_lines_above_it_came_and_it_is_gone_when_it_changed():
    mutants = importlib.import_module("mutants")
    source = "def f(a, b):\n    return a < b\n\n\ndef g(a, b):\n    return a < b\n"
    change = importlib.import_module("mutations").changes(source)[-2]
    row = mutants._row(1, "camera", "views.py", source.splitlines()[change.line - 1], change)
    assert mutants.find(row, source) == change
    later = mutants.find(row, "# more\n\n" + source)
    assert later is not None and (later.line, later.function) == (change.line + 2, "g")
    assert mutants.find(row, source.replace("a < b", "b > a")) is None


def test_tests_of_a_module_are_those_that_name_it():
    own, *others = importlib.import_module("mutants").tests_of("matching/set_cover.py")
    assert "tests/unit/test_set_cover.py" in own
    assert "tests/unit/test_unique_keypoints.py" in others[1]
    assert not any(own & near for near in others)


def test_the_sample_is_of_all_rooms_with_each_place_once():
    mutants = importlib.import_module("mutants")
    sample = mutants.read(mutants.KEPT / "sample.csv")
    assert [int(row["number"]) for row in sample] == list(range(1, mutants.SIZE + 1))
    rooms = [row["room"] for row in sample]
    folders = {path.parent.name for path in (ROOT / "src/keystab").glob("*/__init__.py")}
    assert {room: rooms.count(room) >= mutants.LEAST for room in folders} == dict.fromkeys(
        folders, True
    )
    assert len({(row["module"], row["line"]) for row in sample}) == mutants.SIZE


def test_what_changes_nothing_is_of_the_sample_with_a_reason_and_was_not_noticed():
    mutants = importlib.import_module("mutants")
    results = {row["number"]: row["by"] for row in mutants.read(mutants.KEPT / "results.csv")}
    numbers = [row["number"] for row in mutants.read(mutants.KEPT / "equivalent.csv")]
    assert len(set(numbers)) == len(numbers)
    assert all(not results.get(number) for number in numbers)
    assert {int(number) for number in numbers} <= set(range(1, mutants.SIZE + 1))
    assert all(len(row["reason"]) > 20 for row in mutants.read(mutants.KEPT / "equivalent.csv"))
