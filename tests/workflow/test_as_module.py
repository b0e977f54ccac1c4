"""Other workflows use this one by `module`, in a folder of their own, with a picture of their own."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from project import ROOT, in_fork

from keystab.study.workflow_files import WorkflowFiles

SNAKEFILE = """
configfile: "mine.yaml"

module keystab:
    snakefile: "SNAKEFILE"
    config: config["keystab"]
    PREFIX

use rule * from keystab as keystab_*

rule mine:
    default_target: True
    input: "BEFORE/figures/fig1.pdf", "BEFORE/figures/fig2.png"
    output: "list.txt"
    shell: "ls {input} > {output}"
"""

SETTINGS = """
samples: [one, two]
keystab:
  reference: mine.png
  reference_sha256: null
  semigroup: {sigma_count: 29}
  sets: {unbalanced: {height: null, width: null}}
  results: out/results
  figures: out/figures
  logs: out/logs
"""


def write_outsider(folder: Path, snakefile: Path | str, prefix: str = "") -> Path:
    """A workflow of somebody else, with settings and a picture, in a folder of its own."""
    text = SNAKEFILE.replace("SNAKEFILE", str(snakefile))
    text = text.replace("PREFIX", f'prefix: "{prefix}"' if prefix else "")
    folder.mkdir()
    (folder / "Snakefile").write_text(text.replace("BEFORE", f"{prefix}/out" if prefix else "out"))
    (folder / "mine.yaml").write_text(SETTINGS)
    waves = 128 + 50 * np.sin(np.arange(900) / 9.0)[:, None] + 40 * np.cos(np.arange(1600) / 7.0)
    Image.fromarray(waves.astype(np.uint8)).save(folder / "mine.png", compress_level=1)
    return folder


def planned_in(folder: Path, *arguments: str) -> tuple[int, str]:
    status, output, errors = in_fork(
        lambda: os.chdir(folder), ["--cores", "1", "--dry-run", *arguments]
    )
    return status, output + errors


def test_a_figure_of_ones_own_picture_is_planned_by_module(tmp_path):
    folder = write_outsider(tmp_path / "own", ROOT / "workflow/Snakefile", "far")
    status, said = planned_in(folder, "--printshellcmds")
    assert status == 0, said
    table = said.split("Job stats:")[1].split("total")[0]
    jobs = set(re.findall(r"^(\w+) +\d+$", table, re.MULTILINE))
    figures = {f"keystab_{name}" for name in ("simulate", "describe_views", "fig2", "semigroup", "fig1")}  # fmt: skip
    assert jobs == {"mine", *figures}
    # The picture is the person's, and what is written lies where they say.
    assert "--reference mine.png" in said and "--views far/out/results/views/examples" in said


def test_the_workflow_folder_lends_what_the_working_folder_lacks(tmp_path, monkeypatch):
    class Place(os.PathLike[str]):
        """A folder as Snakemake knows it."""

        def __fspath__(self) -> str:
            return str(self.path)

        def __init__(self, path: Path) -> None:
            self.path = path

        def join(self, name: str) -> Place:
            return Place(self.path / name)

    files = WorkflowFiles(Place(tmp_path / "clone/workflow/rules"), lambda file: pytest.fail())
    (tmp_path / "clone/config").mkdir(parents=True)
    (tmp_path / "clone/config/a.png").touch()
    (tmp_path / "own").mkdir()
    monkeypatch.chdir(tmp_path / "own")
    assert files.found("config/a.png") == str(tmp_path / "clone/config/a.png")
    assert files.found("nowhere.png") == "nowhere.png"
    (tmp_path / "own/config").mkdir()
    (tmp_path / "own/config/a.png").touch()
    assert files.found("config/a.png") == "config/a.png"
    assert files.own("config/a.png") == str(tmp_path / "clone/config/a.png")
    monkeypatch.chdir(tmp_path / "clone")
    assert files.own("config/a.png") == "config/a.png"  # as records of older runs have it


@pytest.mark.slow
@pytest.mark.parametrize("prefix", ["", "far"])
def test_figures_of_ones_own_picture_are_drawn_by_module(tmp_path, prefix):
    folder = write_outsider(tmp_path / "own", ROOT / "workflow/Snakefile", prefix)
    command = [sys.executable, "-m", "snakemake", "--cores", "1"]
    environment = {**os.environ, "PYTHONPATH": str(ROOT / "src")}

    def run() -> str:
        done = subprocess.run(
            command, cwd=folder, env=environment, capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, done.stdout + done.stderr
        return done.stdout + done.stderr

    run()
    drawn = folder / prefix / "out/figures"
    assert (drawn / "fig1.pdf").read_bytes().startswith(b"%PDF")
    assert (drawn / "fig2.png").stat().st_size > 10_000
    assert {path.name for path in folder.iterdir()} - {".snakemake"} == {
        "Snakefile", "mine.yaml", "mine.png", "list.txt", prefix or "out",
    }  # fmt: skip
    assert "Nothing to be done" in run()
    shutil.rmtree(drawn)
    assert "keystab_simulate" not in run()


@pytest.mark.slow
def test_the_catalogue_can_draw_the_rules(tmp_path):
    shutil.copytree(ROOT / ".test", tmp_path / "test", ignore=shutil.ignore_patterns(".snakemake"))
    asked = ["--snakefile", str(ROOT / "workflow/Snakefile"), "--directory", str(tmp_path / "test")]
    status, output, errors = in_fork(lambda: None, [*asked, "-c1", "--forceall", "--rulegraph"])
    assert status == 0, errors
    assert "match_samplings" in output and not (tmp_path / "test/results").exists()
