"""Jobs ask for time and memory by their work; on a real Slurm of one node they give its bytes."""

from __future__ import annotations

import importlib.util
import os
import re
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest
from project import QUICK, ROOT, Project, copy_of_project

from keystab.io import checksums

ONE_NODE = ROOT / "tests/slurm/one_node.sh"
STORE = "results/quick/scale_space/n3"
SEAL = f"{STORE}.sha256"
EXTREMA = "results/quick/keypoints/sampling_n3.parquet"
TARGETS = [
    SEAL,
    EXTREMA,
    "results/quick/keypoints/traces_n3.parquet",
    "results/quick/keypoints/grid_n10.parquet",
    "results/quick/tables/fig1.csv",
    "figures/quick/fig1.png",
]
IMPATIENT = [
    "--slurm-no-account",  # nobody counts
    *("--slurm-status-command", "squeue"),
    *("--slurm-init-seconds-before-status-checks", "2"),
    *("--seconds-between-status-checks", "2"),
]


def obstacle() -> str | None:
    """Why there can be no Slurm here."""
    if importlib.util.find_spec("snakemake_executor_plugin_slurm") is None:
        return "no executor plugin: pip install --no-deps -r profiles/slurm/plugin.lock"
    if not all(map(shutil.which, ("slurmctld", "slurmd", "munged"))):
        return "no Slurm: as root, tests/slurm/one_node.sh install"
    if os.getuid() != 0:
        return "a Slurm of its own needs root"
    return None


@pytest.fixture
def slurm(tmp_path: Path) -> Iterator[None]:
    if reason := obstacle():
        pytest.skip(reason)
    state = tmp_path / "slurm"
    run = subprocess.run([ONE_NODE, "start", state], capture_output=True, text=True)
    try:
        if run.returncode:
            pytest.skip(run.stderr.strip())
        yield
    finally:
        subprocess.run([ONE_NODE, "stop", state], check=True)


def files(project: Project) -> list[bytes]:
    return [(project.folder / target).read_bytes() for target in TARGETS]


def test_what_store_jobs_ask_for_grows_with_the_picture(tmp_path):
    project = copy_of_project(tmp_path / "project", own_library=False)
    project.edit("config/quick.yaml", "still: { step: 25 }", "still: { step: 2 }")
    asked = "asks for {resources.runtime} min, {resources.mem_mb} MB"
    project.edit("workflow/rules/scale_space.smk", "Storing the balanced", f"Writing {asked}")
    project.edit("workflow/rules/detect.smk", "Detecting extrema at the", f"Reading {asked}")
    status, said = project.dry_run(*QUICK, "--", EXTREMA)
    assert status == 0, said
    # 1125 x 2000 pixels, 3 scales per octave, 15 microseconds each: 101 s, 2 minutes and 5 more;
    # three copies of 128 rows of 5 slices of 2000 x 3 doubles, 92.2 MB, and 600
    assert "Writing asks for 7 min, 693 MB" in said
    assert "Reading asks for 7 min, 693 MB" in said


@pytest.mark.slow
def test_jobs_through_slurm(slurm, tmp_path):
    project = copy_of_project(tmp_path / "submitted", own_library=False)
    logs = ("--slurm-logdir", str(tmp_path / "logs"))
    arguments = ["--profile", "profiles/slurm", *IMPATIENT, *logs, *QUICK, "--", *TARGETS]
    run = project.snakemake(*arguments)
    assert run.returncode == 0, run.stdout
    assert run.stdout.count("has been submitted with SLURM jobid") == 6

    shown = subprocess.run(
        ["scontrol", "--oneliner", "show", "jobs"], capture_output=True, text=True
    ).stdout
    asked = {
        re.search(r"Comment=rule_(\w+?)(?:_wildcards_\w+)?\s", job)[1]: re.findall(
            r"(?:TimeLimit|MinMemoryNode|NumCPUs)=(\S+)", job
        )
        for job in shown.splitlines()
    }
    assert asked["semigroup"] == ["00:15:00", "1", "1000M"]  # the defaults of the profile
    assert asked["simulate"] == ["00:15:00", "1", "1320M"]  # ten copies of 2250 x 4000 doubles more
    # 3 steps of the grid, 90 x 160 pixels, 10 scales per octave, 15 microseconds each: 7 s
    assert asked["detect_grid"] == ["00:06:00", "1", "1000M"]
    # one step, 3 scales per octave: 0.6 s; and three copies of 128 rows of 5 slices of 160 x 3
    # doubles, 7.4 MB, above 600 of Python
    assert asked["scale_space"] == ["00:06:00", "1", "608M"]
    assert asked["detect"] == ["00:06:00", "1", "608M"]

    local = copy_of_project(tmp_path / "local", own_library=False)
    run = local.snakemake(*QUICK, "--", *TARGETS)
    assert run.returncode == 0, run.stdout
    assert files(project) == files(local)
    # The checksums are equal; each holds for the chunks of its own store.
    for one in (project, local):
        checksums.verify(one.folder / STORE, one.folder / SEAL)
