"""Take up a study after a run of it was killed.

`kill -9` and power cuts leave Snakemake's lock behind, and may leave jobs that run on without it.
A lock is stale when no Snakemake works in the folder: then its last jobs may end, and it is
removed. The host that a run is on stands in `.snakemake/host` (see workflow/rules/common.smk), so
that a folder that several machines share is not taken from a run on another one.
"""

from __future__ import annotations

import platform
from collections.abc import Callable
from pathlib import Path

import psutil

JOBS = ("keystab.stages.", "keystab.figures.")


def take_up(folder: Path, say: Callable[[str], object]) -> None:
    """Wait for jobs that a killed run left in a folder, and remove its lock.

    Does nothing where another run is at work; Snakemake then says whether the two can go together.

    Parameters
    ----------
    folder : Path
        Where the study is run.
    say : callable
        Receives what is to be told, in lines.
    """
    locks = [*folder.glob(".snakemake/locks/*.lock")]
    if not locks or snakemakes(folder):
        return
    host = folder / ".snakemake/host"
    if host.is_file() and host.read_text() != platform.node():
        return
    # Unfinished jobs are done again; at the same time, two would write the same files.
    while left := at_work(folder, is_job):
        say(f"waiting for jobs that a killed run left: processes {numbers(left)}")
        psutil.wait_procs(left, timeout=60)
    for lock in locks:
        lock.unlink(missing_ok=True)
    say("The last run here was killed: removed its lock. What it finished stays.")


def why_locked(folder: Path) -> str:
    """One line for a run that Snakemake refused because of a lock."""
    again = "then type the same command again"
    if others := snakemakes(folder):
        return f"another run is at work here (process {numbers(others)}): let it end, {again}"
    host = folder / ".snakemake/host"
    name = host.read_text() if host.is_file() else "another machine"
    return (
        f"a run on {name} holds the lock of this folder: let it end, {again}; "
        "if it was killed: .venv/bin/snakemake --unlock"
    )


def snakemakes(folder: Path) -> list[psutil.Process]:
    """Snakemakes that run jobs in a folder."""
    return at_work(folder, is_snakemake)


def is_snakemake(command: list[str]) -> bool:
    """Whether a command line is a Snakemake that may run jobs.

    Examples
    --------
    >>> is_snakemake(["python", "/x/.venv/bin/snakemake", "-c2"])
    True
    >>> is_snakemake(["python", "-m", "snakemake", "--dry-run"])
    False
    """
    named = any(Path(word).name == "snakemake" for word in command[:3])
    return named and not {"-n", "--dry-run", "--dryrun", "--unlock"} & set(command)


def is_job(command: list[str]) -> bool:
    """Whether a command line is a job of the study.

    Examples
    --------
    >>> is_job(["python", "-m", "keystab.stages.detect", "--n-spo", "3"])
    True
    """
    return command[1:2] == ["-m"] and any(word.startswith(JOBS) for word in command[2:3])


def at_work(folder: Path, wanted: Callable[[list[str]], bool]) -> list[psutil.Process]:
    """Processes in a folder whose command line is wanted."""
    found = []
    for process in psutil.process_iter():
        try:
            if wanted(process.cmdline()) and Path(process.cwd()) == folder.resolve():
                found.append(process)
        except (psutil.Error, OSError):  # ended meanwhile, or another user's
            continue
    return found


def numbers(processes: list[psutil.Process]) -> str:
    """Process numbers for people."""
    return ", ".join(str(process.pid) for process in processes)
