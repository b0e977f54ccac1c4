"""Loops that were compiled from other code are not used again."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys

import pytest

from keystab.outdated_loops import PACKAGE_FOLDER, STAMP, forget_outdated


@pytest.fixture
def package(tmp_path):
    """A package with two modules and their compiled loops."""
    (tmp_path / "__pycache__").mkdir()
    for name in ("caller.py", "called.py"):
        (tmp_path / name).write_text("LIMIT = 3\n")
    forget_outdated(tmp_path)
    for name in ("caller.loop.nbi", "caller.loop.1.nbc", "caller.pyc"):
        (tmp_path / "__pycache__" / name).touch()
    return tmp_path


def kept(package):
    return {path.name for path in (package / "__pycache__").iterdir()} - {STAMP}


@pytest.mark.parametrize("seconds", [-1e6, 0, 1e9])  # before, with and after the compiled loops
def test_a_changed_module_outdates_the_loops_of_all_whatever_its_time(package, seconds):
    assert not forget_outdated(package)
    assert len(kept(package)) == 3
    module = package / "called.py"
    time = module.stat().st_mtime + seconds
    module.write_text("LIMIT = 30\n")
    os.utime(module, (time, time))
    assert forget_outdated(package)
    assert kept(package) == {"caller.pyc"}
    assert not forget_outdated(package)


def test_a_removal_that_another_process_was_faster_at_goes_on(package, monkeypatch):
    (package / "called.py").write_text("LIMIT = 30\n")
    glob = type(package).glob
    monkeypatch.setattr(
        type(package), "glob", lambda folder, of: [folder / f"gone{of[1:]}", *glob(folder, of)]
    )
    assert forget_outdated(package)
    assert kept(package) == {"caller.pyc"}


def test_the_library_does_so_when_it_is_imported(tmp_path):
    shutil.copytree(
        PACKAGE_FOLDER, tmp_path / "keystab", ignore=shutil.ignore_patterns("__pycache__")
    )
    old = tmp_path / "keystab" / "__pycache__" / "extrema.old.nbi"
    old.parent.mkdir()
    old.touch()
    command = [sys.executable, "-c", "import keystab; print(keystab.__file__)"]
    run = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=True)
    assert str(tmp_path) in run.stdout
    assert not old.exists()
