"""The fingerprint sees every edit of code, however far away, and nothing else."""

from __future__ import annotations

from pathlib import Path

import pytest

from keystab.provenance import code_digest

FILES = {
    "__init__.py": '"""Names."""\n__version__ = "1"\n',
    "base.py": '"""Base."""\n\ndef double(x):\n    """Twice."""\n    return 2 * x  # twice\n',
    "late.py": "LIMIT = 3\n",
    "alone.py": "VALUE = 1\n",
    "types_only.py": "class Thing: ...\n",
    "stages/__init__.py": '"""Stages."""\n',
    "stages/work.py": (
        "from __future__ import annotations\n"
        "from typing import TYPE_CHECKING\n"
        "import os\n"
        "from toy.base import double\n"
        "if TYPE_CHECKING:\n"
        "    from toy.types_only import Thing\n"
        "def main():\n"
        "    try:\n"
        "        from toy import late\n"
        "    finally:\n"
        "        pass\n"
        "    return double(late.LIMIT)\n"
    ),
    "stages/near.py": "from ..base import double\nfrom . import work\n",
}


@pytest.fixture
def toy(tmp_path: Path) -> Path:
    folder = tmp_path / "toy"
    for name, text in FILES.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text)
    return folder


def taken(folder: Path, module: str = "toy.stages.work") -> str:
    code_digest._read.cache_clear()
    return code_digest.fingerprint(module, folder)


def test_closure_follows_nested_and_relative_imports(toy):
    modules = code_digest.imported_modules("toy.stages.near", toy)
    assert modules == ["toy.base", "toy.late", "toy.stages", "toy.stages.near", "toy.stages.work"]


@pytest.mark.parametrize(
    ("name", "old", "new"),
    [
        ("stages/work.py", "return double", "return 1 + double"),
        ("base.py", "2 * x", "3 * x"),  # imported
        ("late.py", "LIMIT = 3", "LIMIT = 4"),  # imported inside a function
        ("stages/__init__.py", '"""Stages."""', "import os"),  # runs before the stage
    ],
)
def test_code_edits_change_it(toy, name, old, new):
    before = taken(toy)
    text = (toy / name).read_text()
    assert old in text
    (toy / name).write_text(text.replace(old, new))
    assert taken(toy) != before


@pytest.mark.parametrize(
    ("name", "old", "new"),
    [
        ("base.py", "# twice", "# two times"),
        ("base.py", '"""Twice."""', '"""Two times what was given."""'),
        ("base.py", '    """Twice."""\n', ""),
        ("base.py", "2 * x", "(2  *  x)"),  # layout
        ("base.py", '"""Base."""\n', '"""Base.\n\nMore words.\n"""\n\n\n'),
        ("stages/__init__.py", '"""Stages."""\n', ""),
        ("alone.py", "VALUE = 1", "VALUE = 2"),  # not imported
        ("types_only.py", "class Thing: ...", "class Thing: x = 1"),  # never imported at run time
        ("__init__.py", '"1"', '"2"'),  # the table of public names
    ],
)
def test_other_edits_keep_it(toy, name, old, new):
    before = taken(toy)
    text = (toy / name).read_text()
    assert old in text
    (toy / name).write_text(text.replace(old, new))
    assert taken(toy) == before


def test_texts_that_explain_constants_do_not_count_and_those_that_are_used_do(toy):
    before = taken(toy)
    (toy / "late.py").write_text('LIMIT = 3\n"""Largest number of tries."""\n')
    assert taken(toy) == before
    (toy / "late.py").write_text('LIMIT = 3\nWORDS = "Largest number of tries."\n')
    assert taken(toy) != before


@pytest.mark.parametrize(
    "line", ["import toy", "from toy import nothing", "from toy.stages import nothing"]
)
def test_imports_that_cannot_be_followed_are_refused(toy, line):
    (toy / "late.py").write_text(f"{line}\n")
    with pytest.raises(ValueError, match=r"toy\.late"):
        taken(toy)


def test_name_taken_from_the_package_brings_its_code_in(toy):
    (toy / "late.py").write_text("from toy import __version__\nLIMIT = 3\n")
    before = taken(toy)
    (toy / "__init__.py").write_text('__version__ = "2"\n')
    assert taken(toy) != before


PALETTE = """\
from math import pi
INK = "#222"
LINES = {"a": "#111", "b": INK}
_SHADES = ("#000", "#fff")
def shade(share):
    return _SHADES[0] if share < pi else LINES["a"]
"""


@pytest.fixture
def painted(toy: Path) -> Path:
    (toy / "figures").mkdir()
    (toy / "figures/__init__.py").write_text("")
    (toy / "figures/palette.py").write_text(PALETTE)
    (toy / "figures/ink.py").write_text("from toy.figures import palette\nC = palette.INK\n")
    (toy / "figures/shades.py").write_text("from toy.figures.palette import shade as tone\n")
    return toy


@pytest.mark.parametrize(
    ("old", "new", "changed"),
    [
        ("#222", "#333", {"ink", "shades"}),  # LINES, which shade needs, uses it
        ("#fff", "#eee", {"shades"}),
        ("< pi", "<= pi", {"shades"}),
        ("import pi", "import tau as pi", {"ink", "shades"}),  # runs for all
        ('INK = "#222"', 'INK = "#222"  # nearly black\n"""Text."""\nMORE = 1', set()),
    ],
)
def test_a_colour_counts_for_the_figures_that_use_it(painted, old, new, changed):
    before = {name: taken(painted, f"toy.figures.{name}") for name in ("ink", "shades")}
    assert old in PALETTE
    (painted / "figures/palette.py").write_text(PALETTE.replace(old, new))
    code_digest._read_catalogue.cache_clear()
    after = {name: taken(painted, f"toy.figures.{name}") for name in before}
    assert {name for name in before if before[name] != after[name]} == changed


BLOCKS = """\
from dataclasses import dataclass
@dataclass
class Scales:
    \"\"\"Of what is detected.\"\"\"
    sigma_min: float
@dataclass
class Detection(Scales):
    epsilon: float
@dataclass
class Optics:
    defocus: float
"""


@pytest.mark.parametrize(
    ("old", "new", "changed"),
    [
        ("defocus: float", "defocus: int", set()),
        ("epsilon: float", "epsilon: int", {"detect"}),
        ("sigma_min: float", "sigma_min: int", {"detect", "match"}),  # inherited
        ("Of what is detected", "Of all", set()),
    ],
)
def test_a_block_of_parameters_counts_for_the_stages_that_use_it(toy, old, new, changed):
    (toy / "stages/detect.py").write_text("from toy.parameters import Detection\n")
    (toy / "stages/match.py").write_text("from toy.parameters import Scales\n")
    taken_before = {}
    for text, found in ((BLOCKS, taken_before), (BLOCKS.replace(old, new), after := {})):
        (toy / "parameters.py").write_text(text)
        code_digest._read_catalogue.cache_clear()
        found.update({name: taken(toy, f"toy.stages.{name}") for name in ("detect", "match")})
    assert old in BLOCKS
    assert {name for name in after if after[name] != taken_before[name]} == changed


@pytest.mark.parametrize(
    ("name", "text", "said"),
    [
        ("ink.py", "from toy.figures import palette\nC = getattr(palette, 'INK')\n", "as a whole"),
        ("ink.py", "from toy.figures.palette import *\n", "as a whole"),
        ("ink.py", "import toy.figures.palette\n", "says 'import toy.figures.palette'"),
        ("ink.py", "from toy.figures import palette\nC = palette.NONE\n", "has no NONE"),
        ("palette.py", "INK = 1\nprint(INK)\n", "holds imports, constants, functions and classes"),
        ("palette.py", "INK = 1\nINK = 2\n", "defines INK twice"),
        ("palette.py", "INK = vars()\n", "must name the entries"),
    ],
)
def test_uses_of_a_catalogue_that_cannot_be_followed_are_refused(painted, name, text, said):
    (painted / "figures" / name).write_text(text)
    code_digest._read_catalogue.cache_clear()
    with pytest.raises(ValueError, match=said):
        taken(painted, "toy.figures.ink")


@pytest.mark.parametrize("folder", ["", "near/", "far/away/"])
@pytest.mark.parametrize("edited", ["the loop", "what it calls"])
def test_compiled_loops_are_kept_apart_for_other_code(toy, folder, edited):
    for part in [*Path(folder).parents, Path(folder)]:
        (toy / part).mkdir(exist_ok=True)
        (toy / part / "__init__.py").touch()
    loops = toy / folder / "loops.py"
    loops.write_text("\nfrom numba import njit\nfrom toy.base import double\n")
    code_digest._read.cache_clear()
    before = code_digest.folder_of_loops(toy, toy)
    if edited == "the loop":
        loops.write_text(loops.read_text() + "TWO = double(1)\n")
    else:
        (toy / "base.py").write_text(FILES["base.py"].replace("2 * x", "3 * x"))
    code_digest._read.cache_clear()
    assert code_digest.folder_of_loops(toy, toy) != before


def test_every_stage_and_figure_of_the_study_can_be_followed():
    for folder in ("stages", "figures"):
        for path in (code_digest.PACKAGE_FOLDER / folder).glob("*.py"):
            name = f"keystab.{folder}" + ("" if path.stem == "__init__" else f".{path.stem}")
            assert name in code_digest.imported_modules(name)
    assert "keystab.detection.extrema" in code_digest.imported_modules("keystab.stages.detect")
    assert "keystab.detection.extrema" not in code_digest.imported_modules(
        "keystab.stages.simulate"
    )
    assert "keystab.detection.detector" not in code_digest.imported_modules("keystab.figures.fig1")


@pytest.mark.parametrize(
    ("bound", "name"),
    [
        ("from toy.base import double", "double"),
        ("from toy.base import double as twice", "twice"),
        ("import os", "os"),
        ("import os as system", "system"),
        ("def twice(x): return x", "twice"),
        ("class Thing: ...", "Thing"),
        ("first, (second, *rest) = 1, (2, 3)", "rest"),
        ("if True:\n    inner = 1", "inner"),
    ],
)
def test_every_way_to_bind_a_name_in_a_package_can_be_followed_and_no_other_name(toy, bound, name):
    (toy / "stages/__init__.py").write_text(bound + "\n")
    user = toy / "user.py"
    user.write_text(f"from toy.stages import {name}\n")
    code_digest._names_in.cache_clear()
    assert "toy.stages" in code_digest.imported_modules("toy.user", toy)
    user.write_text("from toy.stages import other\n")
    code_digest._read.cache_clear()
    with pytest.raises(ValueError, match="imports other from toy.stages"):
        code_digest.imported_modules("toy.user", toy)


def test_what_runs_where_types_are_not_checked_counts(toy):
    work = toy / "stages/work.py"
    work.write_text(
        "from typing import TYPE_CHECKING\nimport typing\n"
        "if typing.TYPE_CHECKING:\n    from toy.types_only import Thing\n"
        "else:\n    from toy.alone import VALUE\n"
        "match 1:\n    case 1:\n        from toy import late\n"
    )
    code_digest._read.cache_clear()
    found = code_digest.imported_modules("toy.stages.work", toy)
    assert found == ["toy.alone", "toy.late", "toy.stages", "toy.stages.work"]
