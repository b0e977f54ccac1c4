"""Whatever stops a run, the same command takes it up, and nothing wrong or half-written stays."""

from __future__ import annotations

import contextlib
import os
import random
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import psutil
import pytest
from project import QUICK, ROOT, Project, copy_of_project

STUDY = [sys.executable, str(ROOT / "tools/study.py"), "--cores", "2"]  # what `make study` runs
TINY = """
sets: {still: {step: 40}}
samplings: {n_spo: [3, 4]}
floor: {settles_at: 4}
keep_scale_spaces: [3]
results: results/tiny
figures: figures/tiny
logs: logs/tiny
"""
FIGURE = "figures/tiny/fig4.png"
ONE_FIGURE = ("--configfile", "config/tiny.yaml", "--", FIGURE)
EXTREMA = "results/tiny/keypoints/sampling_n3.parquet"
ONE_TABLE = ("--configfile", "config/tiny.yaml", "--", EXTREMA)


def new_project(folder: Path) -> Project:
    project = copy_of_project(folder, own_library=False)
    (project.folder / "config/tiny.yaml").write_text(TINY)
    return project


class Run:
    """A run of the study in the background; nothing of it outlives the block, unless it is let."""

    def __init__(self, project: Project, *arguments: str) -> None:
        self.left = False
        self.output = project.folder / f"said-{time.monotonic_ns()}.txt"
        with self.output.open("w") as output:
            self.process = subprocess.Popen(
                [*STUDY, *arguments],
                cwd=project.folder,
                env=project.environment,
                stdout=output,
                stderr=subprocess.STDOUT,
                start_new_session=True,
            )

    def __enter__(self) -> Run:
        return self

    def __exit__(self, *_: object) -> None:
        if not self.left:
            self.kill()

    def wait_for_jobs(self) -> None:
        """Wait until the first job has started, or the run has ended."""
        while self.process.poll() is None and "\nJob " not in self.said:
            time.sleep(0.05)

    def kill(self) -> None:
        """End everything at once, as a power cut does."""
        with contextlib.suppress(ProcessLookupError):
            os.killpg(self.process.pid, signal.SIGKILL)
        self.process.wait()

    def kill_snakemake(self) -> None:
        """End Snakemake and what started it, but not the jobs."""
        with contextlib.suppress(psutil.NoSuchProcess):
            study = psutil.Process(self.process.pid)
            children = [one for one in study.children() if "snakemake" in one.cmdline()]
            for process in (study, *children):
                process.kill()
        self.process.wait()
        self.left = True

    @property
    def said(self) -> str:
        return self.output.read_text()


def study(project: Project, *arguments: str) -> tuple[int, str]:
    """Run the study to its end; exit status and what it said."""
    with Run(project, *arguments) as run:
        status = run.process.wait()
        return status, run.said


def results(project: Project) -> dict[str, bytes]:
    """Contents of all files that a run made for people, and of none that it left by accident."""
    files = [path for name in ("results", "figures") for path in (project.folder / name).rglob("*")]
    return {
        str(path.relative_to(project.folder)): path.read_bytes()
        for path in files
        if path.is_file() and path.name != ".snakemake_timestamp"
    }


def jobs_in(said: str) -> int:
    return said.count("Finished jobid: ")


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory: pytest.TempPathFactory) -> Project:
    project = new_project(tmp_path_factory.mktemp("undisturbed") / "project")
    status, said = study(project, *ONE_FIGURE)
    assert status == 0, said
    return project


@pytest.fixture
def again(undisturbed: Project, tmp_path: Path) -> Project:
    """A copy of the finished project, to be damaged."""
    shutil.copytree(undisturbed.folder, tmp_path / "again")
    return Project(tmp_path / "again", own_library=False)


def kill_and_take_up(
    folder: Path, arguments: tuple[str, ...], expected: dict[str, bytes], kills: int, longest: float
) -> None:
    """Kill a run at random moments, taking it up each time; start over when it comes to its end.

    Every other kill leaves the jobs that are at work, which then run on without Snakemake. Every
    fourth may come before there is a job.
    """
    moment = random.Random(4)
    copies = 0
    project = new_project(folder / "0")
    while kills:
        with Run(project, *arguments) as run:
            if kills % 4:
                run.wait_for_jobs()
            try:
                status = run.process.wait(timeout=moment.uniform(0, longest))
            except subprocess.TimeoutExpired:
                kills -= 1
                run.kill() if kills % 2 else run.kill_snakemake()
                continue
        assert status == 0, run.said
        assert results(project) == expected
        shutil.rmtree(project.folder)
        copies += 1
        project = new_project(folder / str(copies))
    status, said = study(project, *arguments)
    assert status == 0, said
    assert "The last run here was killed: removed its lock." in said
    assert results(project) == expected


def test_two_kills(undisturbed, tmp_path):
    kill_and_take_up(tmp_path, ONE_FIGURE, results(undisturbed), kills=2, longest=3)


@pytest.mark.slow
def test_twenty_kills_of_every_figure_in_draft_form(tmp_path):
    project = new_project(tmp_path / "undisturbed")
    start = time.monotonic()
    status, said = study(project, *QUICK)
    assert status == 0, said
    longest = (time.monotonic() - start) / 4
    kill_and_take_up(tmp_path, QUICK, results(project), kills=20, longest=longest)


def test_two_runs_at_once(tmp_path):
    project = new_project(tmp_path / "project")
    with Run(project, *ONE_FIGURE) as first:
        while not list(project.folder.glob(".snakemake/locks/*output.lock")):
            assert first.process.poll() is None, first.said
            time.sleep(0.05)
        status, said = study(project, *ONE_FIGURE)
        assert status != 0
        last = said.splitlines()[-1]
        assert last.startswith("error: another run is at work here (process "), said
        assert first.process.wait() == 0, first.said
    assert (project.folder / FIGURE).is_file()


def test_a_run_on_another_machine_keeps_its_lock(again):
    (again.folder / EXTREMA).unlink()
    locks = again.folder / ".snakemake/locks"
    locks.mkdir(exist_ok=True)
    (locks / "0.output.lock").write_text(f"{EXTREMA}\n")
    (again.folder / ".snakemake/host").write_text("elsewhere")
    status, said = study(again, *ONE_TABLE)
    assert status != 0
    assert "error: a run on elsewhere holds the lock of this folder" in said.splitlines()[-1]
    assert list(locks.iterdir())


def flip(file: Path) -> None:
    data = bytearray(file.read_bytes())
    data[len(data) // 2] ^= 1
    file.write_bytes(data)


def truncate(file: Path) -> None:
    os.truncate(file, file.stat().st_size // 2)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("damage", "line"),
    [(flip, "is damaged"), (truncate, "is damaged"), (Path.unlink, "is missing")],
)
def test_a_damaged_store_is_named_and_remade_when_deleted(again, damage, line):
    expected = results(again)
    store = again.folder / "results/tiny/views/still"
    damage(store / "data.zarr/image/c/0/0/0")
    (again.folder / EXTREMA).unlink()
    status, said = study(again, *ONE_TABLE)
    assert status != 0
    named = f"error: results/tiny/views/still: data.zarr/image/c/0/0/0 {line}"
    assert named in said.split("Stopped by\n")[1]
    assert "delete the store and make it again" in said
    assert not (again.folder / EXTREMA).exists()

    shutil.rmtree(store)
    status, said = study(again, *ONE_TABLE)
    assert status == 0, said
    assert results(again) == expected


def in_own_mounts(
    project: Project, script: str, *arguments: str
) -> subprocess.CompletedProcess[str]:
    """Run a shell script that may mount file systems, seen by nobody else and gone afterwards."""
    private = ["unshare", "--mount", "--map-root-user"]
    try:
        subprocess.run([*private, "true"], check=True, capture_output=True)
    except (OSError, subprocess.CalledProcessError):
        pytest.skip("no mount of its own for the test: unshare --mount --map-root-user fails")
    run = subprocess.run(
        [*private, "bash", "-euc", script, "study", *STUDY, *arguments],
        cwd=project.folder,
        env=project.environment,
        text=True,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
    )
    return run


def test_a_full_disk_is_named_and_the_rest_is_done_when_there_is_room(undisturbed, tmp_path):
    project = new_project(tmp_path / "project")
    project.edit("config/tiny.yaml", "keep_scale_spaces: [3]", "keep_scale_spaces: false")
    run = in_own_mounts(
        project,
        """
        mkdir results
        mount -t tmpfs -o size=160k tmpfs results
        "$@" && exit 3
        echo ROOM
        find results -name '.part-*'
        mount -o remount,size=20m results
        "$@"
        cp -r results kept
        """,
        *ONE_FIGURE,
    )
    assert run.returncode == 0, run.stdout
    full, room = run.stdout.split("ROOM\n")
    assert "No space left on device" in full.split("Stopped by\n")[1]
    assert "Traceback" not in full
    n_jobs = 5  # of the figure, without a stored scale-space
    assert jobs_in(full) >= 1 and jobs_in(full) + jobs_in(room) == n_jobs
    assert not room.startswith("results/")
    for name in ("tables/fig4_counts.csv", "matches/samplings.parquet"):
        kept, expected = project.folder / "kept/tiny", undisturbed.folder / "results/tiny"
        assert (kept / name).read_bytes() == (expected / name).read_bytes()


def test_a_read_only_folder_of_results_is_named(again):
    expected = results(again)
    (again.folder / EXTREMA).unlink()
    run = in_own_mounts(
        again,
        """
        mount --bind results results
        mount -o remount,bind,ro results
        "$@" && exit 3
        echo WRITABLE
        mount -o remount,bind,rw results
        "$@"
        """,
        *ONE_TABLE,
    )
    assert run.returncode == 0, run.stdout
    (line,) = run.stdout.split("WRITABLE\n")[0].splitlines()
    assert line.startswith("error: results/tiny cannot be written to: mend that")
    assert results(again) == expected
