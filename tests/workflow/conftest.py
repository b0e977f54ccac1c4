"""Copies of the project, untouched and finished."""

from __future__ import annotations

import shutil
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


@pytest.fixture(scope="session")
def ran(tmp_path_factory: pytest.TempPathFactory) -> Study:
    """A small study that has been run."""
    study = small_study.write(tmp_path_factory.mktemp("small") / "study")
    study.run(1)
    return study


@pytest.fixture(scope="session")
def packed(ran: Study) -> Path:
    """Its archive."""
    return archive.pack(ran)


@pytest.fixture
def project(tmp_path: Path) -> Project:
    """A copy in which nothing has been run."""
    return copy_of_project(tmp_path / "project", own_library=False)


@pytest.fixture(scope="session")
def touched(tmp_path_factory: pytest.TempPathFactory) -> Project:
    """A copy that Snakemake takes for finished: empty outputs, with all that it remembers."""
    project = copy_of_project(tmp_path_factory.mktemp("touched") / "project")
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
    return project


@pytest.fixture
def finished(touched: Project, tmp_path: Path) -> Project:
    """A fresh copy of the finished project, to be edited."""
    shutil.copytree(touched.folder, tmp_path / "project")
    return Project(tmp_path / "project")
