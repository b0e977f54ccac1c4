"""Variables and profiles of a person do not change what the study says and does."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

from keystab.provenance.shielded_environment import shielded

ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize(
    "name",
    ["SNAKEMAKE_PROFILE", "SNAKEMAKE_OUTPUT_CACHE", "PYTHONHOME", "PYTHONUSERBASE", "PYTHONWARNINGS"],
)  # fmt: skip
def test_what_is_for_other_projects_is_left_out(name):
    assert name not in shielded({name: "mine", "PATH": "/bin"})


def test_modules_come_from_this_library_and_its_python():
    own = shielded({"PYTHONPATH": "/opt/cluster", "PYTHONSAFEPATH": "", "PATH": "/bin"})
    assert own["PYTHONPATH"] == str(ROOT / "src")
    assert own["PYTHONSAFEPATH"] == own["PYTHONNOUSERSITE"] == "1"
    assert own["PATH"].split(os.pathsep) == [str(Path(sys.executable).parent), "/bin"]


def test_a_user_without_name_and_home_gets_both(monkeypatch, tmp_path):
    def nobody() -> str:
        raise KeyError("uid not found")

    monkeypatch.setattr("getpass.getuser", nobody)
    file = tmp_path / "no folder"
    file.touch()
    own = shielded({"XDG_CACHE_HOME": str(file / "cache")})
    assert own["USER"] == str(os.getuid())
    assert Path(own["XDG_CACHE_HOME"]).parent.is_dir() and own["MPLCONFIGDIR"]
    assert "XDG_CACHE_HOME" not in shielded({"HOME": str(tmp_path)}) or os.getuid() != 0


def test_the_profile_of_the_study_wins_over_one_of_a_person():
    # Snakemake lays profiles/default over all others, key by key.
    profile = yaml.safe_load((ROOT / "profiles/default/config.yaml").read_text())
    assert set(profile["rerun-triggers"]) == {"mtime", "params", "input", "software-env", "code"}
    assert profile["quiet"] == "host"


def test_why_says_what_would_run_under_a_profile_that_hides_it(tmp_path):
    mine = tmp_path / "mine"
    mine.mkdir()
    (mine / "config.yaml").write_text(
        "rerun-triggers: [mtime]\nquiet: [all]\nconfigfile: [config/what_if/cosine.yaml]\n"
    )
    (tmp_path / "own.yaml").write_text("figures: figures/never\nresults: results/never\n")
    target = ["figures/never/fig1.pdf", "--configfile", str(tmp_path / "own.yaml")]
    run = subprocess.run(
        [sys.executable, "tools/why.py", *target],
        cwd=ROOT,
        env={**os.environ, "SNAKEMAKE_PROFILE": str(mine), "PYTHONPATH": str(ROOT / "src")},
        capture_output=True,
        text=True,
    )
    assert run.returncode == 0, run.stdout
    assert (
        run.stdout.startswith("2 jobs would run") and "Drawing figures/never/fig1.pdf" in run.stdout
    )
