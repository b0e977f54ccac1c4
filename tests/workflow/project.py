"""Copies of the project in which the workflow can be tried, and a way to run it there."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]
PARTS = ["Snakefile", "workflow", "profiles", "config", "src", "environment.lock"]
QUICK = ("--configfile", "config/quick.yaml")


class Project:
    """A copy of the project, run with its own library or, to save compiling, with the original's."""

    def __init__(self, folder: Path, own_library: bool = True) -> None:
        self.folder = folder
        self.library = (folder if own_library else ROOT) / "src"

    def snakemake(self, *arguments: str) -> subprocess.CompletedProcess[str]:
        """Run Snakemake on the copy."""
        environment = {
            **os.environ,
            "PYTHONPATH": str(self.library),
            "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}",
        }
        return subprocess.run(
            [sys.executable, "-m", "snakemake", "--cores", "1", *arguments],
            cwd=self.folder,
            env=environment,
            text=True,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
        )

    def would_run(self, *arguments: str) -> dict[str, int]:
        """Rules that would run, with their numbers of jobs."""
        run = self.snakemake("--dry-run", *arguments)
        assert run.returncode == 0, run.stdout
        if "Nothing to be done" in run.stdout:
            return {}
        table = run.stdout.split("Job stats:")[1].split("total")[0]
        return {rule: int(n) for rule, n in re.findall(r"^(\w+) +(\d+)$", table, re.MULTILINE)}

    def edit(self, name: str, old: str, new: str) -> None:
        """Replace a text in a file, once."""
        path = self.folder / name
        text = path.read_text()
        assert old in text, f"{old!r} is not in {name}: adapt the test"
        path.write_text(text.replace(old, new, 1))


def copy_of_project(folder: Path, own_library: bool = True) -> Project:
    for part in PARTS:
        source = ROOT / part
        if source.is_dir():
            ignored = shutil.ignore_patterns("__pycache__")
            shutil.copytree(source, folder / part, ignore=ignored)
        else:
            folder.mkdir(parents=True, exist_ok=True)
            shutil.copy2(source, folder / part)
    return Project(folder, own_library)
