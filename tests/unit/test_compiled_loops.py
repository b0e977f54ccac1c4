"""Loops that were compiled from other code are not used again."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys

import pytest

from keystab.utils.compiled_loops import PACKAGE_FOLDER, STAMP, forget_outdated

ROOMS = (".", "near", "far/away")


@pytest.fixture
def package(tmp_path):
    """A package with two modules in each of two rooms and beside them, and their compiled loops."""
    for room in ROOMS:
        (tmp_path / room / "__pycache__").mkdir(parents=True)
        for name in ("caller.py", "called.py"):
            (tmp_path / room / name).write_text("LIMIT = 3\n")
    forget_outdated(tmp_path)
    for room in ROOMS:
        for name in ("caller.loop.nbi", "caller.loop.1.nbc", "caller.pyc"):
            (tmp_path / room / "__pycache__" / name).touch()
    return tmp_path


def kept(package):
    """What lies beside the modules of each room, without the stamp."""
    folders = {room: package / room / "__pycache__" for room in ROOMS}
    return {
        room: {path.name for path in folder.iterdir()} - {STAMP} for room, folder in folders.items()
    }


@pytest.mark.parametrize("room", ROOMS)  # where the edited module is
@pytest.mark.parametrize("seconds", [-1e6, 0, 1e9])  # before, with and after the compiled loops
def test_a_changed_module_outdates_the_loops_of_all_whatever_its_time(package, seconds, room):
    assert not forget_outdated(package)
    assert all(len(names) == 3 for names in kept(package).values())
    module = package / room / "called.py"
    time = module.stat().st_mtime + seconds
    module.write_text("LIMIT = 30\n")
    os.utime(module, (time, time))
    assert forget_outdated(package)
    assert kept(package) == {room: {"caller.pyc"} for room in ROOMS}
    assert not forget_outdated(package)


def test_a_removal_that_another_process_was_faster_at_goes_on(package, monkeypatch):
    (package / "called.py").write_text("LIMIT = 30\n")
    glob = type(package).glob
    monkeypatch.setattr(
        type(package), "glob", lambda folder, of: [folder / "gone.nbi", *glob(folder, of)]
    )
    assert forget_outdated(package)
    assert kept(package) == {room: {"caller.pyc"} for room in ROOMS}


CLAIMS = ", ".join(f"'--{name}=x'" for name in ("claims", "tables", "csv", "json", "markdown"))


@pytest.mark.parametrize(
    ("code", "forgotten"),
    [
        ("import keystab; keystab.__version__", False),
        ("from keystab.stages import check_claims", False),
        ("import keystab; keystab.balanced_delta", True),
        ("from keystab import InputError", True),
        ("from keystab.cli.main import main; main(['inspect', 'nothing'])", True),
        (f"from keystab.stages.check_claims import main; main([{CLAIMS}])", True),
    ],
)
def test_the_library_forgets_when_it_is_used_and_not_when_it_is_imported(code, forgotten, tmp_path):
    shutil.copytree(
        PACKAGE_FOLDER, tmp_path / "keystab", ignore=shutil.ignore_patterns("__pycache__")
    )
    old = tmp_path / "keystab" / "detection" / "__pycache__" / "extrema.old.nbi"
    old.parent.mkdir()
    old.touch()
    command = [sys.executable, "-c", f"{code}\nimport keystab; print(keystab.__file__)"]
    others = os.environ.keys() - {"NUMBA_CACHE_DIR", "PYTHONSAFEPATH"}
    variables = {name: os.environ[name] for name in others}
    run = subprocess.run(
        command, cwd=tmp_path, env=variables, capture_output=True, text=True, check=True
    )
    assert str(tmp_path) in run.stdout
    assert old.exists() is not forgotten


def test_whoever_waits_for_the_compiler_is_told_once_and_nobody_else(tmp_path):
    code = (
        "import numpy as np, keystab; space = keystab.scale_space(np.eye(12), 1.1, 3); space.source"
    )
    variables = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)}
    told = [
        subprocess.run(
            [sys.executable, "-c", code], env=variables, capture_output=True, text=True, check=True
        ).stderr
        for _ in range(2)
    ]
    assert told[0].count("compiles its loops") == 1 and told[0].count("\n") == 1
    assert told[1] == ""
