"""The study on a real Slurm of one node: jobs get time and memory for their work, and its bytes."""

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

ONE_NODE = ROOT / "tests/slurm/one_node.sh"
TARGETS = [
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

pytestmark = pytest.mark.slow


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


def test_jobs_of_every_kind_through_slurm(slurm, tmp_path):
    project = copy_of_project(tmp_path / "submitted", own_library=False)
    logs = ("--slurm-logdir", str(tmp_path / "logs"))
    arguments = ["--profile", "profiles/slurm", *IMPATIENT, *logs, *QUICK, "--", *TARGETS]
    run = project.snakemake(*arguments)
    assert run.returncode == 0, run.stdout
    assert run.stdout.count("has been submitted with SLURM jobid") == 4

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

    local = copy_of_project(tmp_path / "local", own_library=False)
    run = local.snakemake(*QUICK, "--", *TARGETS)
    assert run.returncode == 0, run.stdout
    assert files(project) == files(local)
