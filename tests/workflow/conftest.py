"""Copies of the project, untouched and finished."""

from __future__ import annotations

import fcntl
import importlib
import os
import shutil
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import pytest
import small_study
from project import QUICK, Project, copy_of_project, forked

from keystab.provenance import archive
from keystab.provenance.study_folder import Study


@pytest.fixture
def snakemake_in_forks(monkeypatch: pytest.MonkeyPatch) -> None:
    """Run Snakemake in forks of this process, which spares its import every time."""
    monkeypatch.setattr("keystab.provenance.study_folder.subprocess", SimpleNamespace(run=forked))


def made_once(
    tmp_path_factory: pytest.TempPathFactory, name: str, make: Callable[[Path], object]
) -> Path:
    """A folder that the first process of this test run that asks for it makes for all."""
    shared = tmp_path_factory.getbasetemp()
    if "PYTEST_XDIST_WORKER" in os.environ:
        shared = shared.parent
    folder, done = shared / name, shared / f"{name}.done"
    with (shared / f"{name}.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not done.exists():
            shutil.rmtree(folder, ignore_errors=True)
            make(folder)
            done.touch()
    return folder


@pytest.fixture(scope="session")
def ran(tmp_path_factory: pytest.TempPathFactory) -> Study:
    """A small study that has been run and packed; tests change copies of it."""

    def make(folder: Path) -> None:
        study = small_study.write(folder)
        study.run(1)
        archive.pack(study)

    return Study(made_once(tmp_path_factory, "small-study", make))


@pytest.fixture(scope="session")
def packed(ran: Study) -> Path:
    """Its archive."""
    (path,) = (ran.project / "results/archive").iterdir()
    return path


@pytest.fixture
def project(tmp_path: Path) -> Project:
    """A copy in which nothing has been run."""
    return copy_of_project(tmp_path / "project", own_library=False)


@pytest.fixture(scope="session")
def planned(tmp_path_factory: pytest.TempPathFactory) -> Project:
    """A copy in which nothing is ever run or edited."""
    return copy_of_project(tmp_path_factory.mktemp("planned") / "project", own_library=False)


@pytest.fixture(scope="session")
def touched(tmp_path_factory: pytest.TempPathFactory) -> Project:
    """A copy that Snakemake takes for finished: empty outputs, with all that it remembers."""
    return Project(made_once(tmp_path_factory, "touched", touch_all))


def touch_all(folder: Path) -> None:
    # Snakemake waits a tenth of a second before each file, for file systems that count in such.
    importlib.import_module("snakemake.executors.touch").Executor.SLEEPING_TIME = 0.01
    project = copy_of_project(folder, own_library=False)
    summary = project.snakemake(*QUICK, "--summary").stdout
    outputs = [line.split("\t")[0] for line in summary.splitlines() if line.count("\t") == 5][1:]
    assert len(outputs) > 40
    for name in outputs:
        path = project.folder / name
        if path.suffix:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.touch()
        else:  # a store
            path.mkdir(parents=True)
            (path / ".snakemake_timestamp").touch()
    run = project.snakemake(*QUICK, "--touch", "--forceall")
    assert run.returncode == 0, run.stdout


@pytest.fixture
def finished(touched: Project, tmp_path: Path) -> Project:
    """A fresh copy of the finished project, to be edited; its code is the original's.

    Where code is edited, `Project(finished.folder)` runs with the copy's.
    """
    shutil.copytree(touched.folder, tmp_path / "project")
    return Project(tmp_path / "project", own_library=False)
