"""Whatever stops a run, the same command takes it up, and nothing wrong or half-written stays.

All is tried on the small study, and kills, when there is time, on the real one too.
"""

from __future__ import annotations

import contextlib
import os
import random
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import psutil
import pytest
import small_study
from project import QUICK, ROOT, Project, copy_of_project

from keystab.provenance.study_folder import Study

STUDY = [sys.executable, str(ROOT / "tools/study.py"), "--cores", "2"]  # what `make study` runs
TINY = """
sets: {still: {step: 40}}
samplings: {n_spo: [3, 4]}
floor: {settles_at: 4}
keep_scale_spaces: false
results: results/tiny
figures: figures/tiny
logs: logs/tiny
"""
MATCHES = ("--configfile", "config/tiny.yaml", "--", "results/tiny/matches/samplings.parquet")
EXTREMA = "results/tiny/keypoints/sampling_n3.parquet"
ONE_TABLE = ("--configfile", "config/tiny.yaml", "--", EXTREMA)
SMALL_TABLE = "results/tables/fig1.csv"  # of the small study


def new_project(folder: Path) -> Project:
    project = copy_of_project(folder, own_library=False)
    (project.folder / "config/tiny.yaml").write_text(TINY)
    return project


@pytest.fixture
def small(tmp_path: Path) -> Project:
    """The small study, of which nothing has been run."""
    return new_small(tmp_path / "small")


def new_small(folder: Path) -> Project:
    return with_settings_of_the_study(small_study.write(folder).project)


@pytest.fixture
def small_finished(ran: Study, tmp_path: Path) -> Project:
    """The small study, finished, to be damaged."""
    return with_settings_of_the_study(shutil.copytree(ran.project, tmp_path / "finished"))


def with_settings_of_the_study(folder: Path) -> Project:
    """Give the small study what `make study` reads besides its rules."""
    with (folder / "config/config.yaml").open("a") as settings:
        settings.write("results: results\nlogs: logs\n")
    shutil.copytree(ROOT / "profiles/default", folder / "profiles/default", dirs_exist_ok=True)
    return Project(folder, own_library=False)


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
    run = project.snakemake(*MATCHES)
    assert run.returncode == 0, run.stdout
    return project


@pytest.fixture
def again(undisturbed: Project, tmp_path: Path) -> Project:
    """A copy of the finished project, to be damaged."""
    shutil.copytree(undisturbed.folder, tmp_path / "again")
    return Project(tmp_path / "again", own_library=False)


def kill_and_take_up(
    folder: Path,
    new: Callable[[Path], Project],
    arguments: tuple[str, ...],
    expected: dict[str, bytes],
    kills: int,
    longest: float,
) -> None:
    """Kill a run at random moments, taking it up each time; start over when it comes to its end.

    Every other kill leaves the jobs that are at work, which then run on without Snakemake. Every
    fourth may come before there is a job.
    """
    moment = random.Random(4)
    copies = 0
    project = new(folder / "0")
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
        project = new(folder / str(copies))
    status, said = study(project, *arguments)
    assert status == 0, said
    assert "The last run here was killed: removed its lock." in said
    assert results(project) == expected


def test_two_kills(ran, tmp_path):
    expected = results(Project(ran.project, own_library=False))
    expected = {name: data for name, data in expected.items() if "/archive/" not in name}
    kill_and_take_up(tmp_path, new_small, (), expected, kills=2, longest=2)


@pytest.mark.slow
def test_two_kills_of_the_real_study(undisturbed, tmp_path):
    kill_and_take_up(tmp_path, new_project, MATCHES, results(undisturbed), kills=2, longest=3)


@pytest.mark.slow
def test_twenty_kills_of_every_figure_in_draft_form(tmp_path):
    project = new_project(tmp_path / "undisturbed")
    start = time.monotonic()
    status, said = study(project, *QUICK)
    assert status == 0, said
    longest = (time.monotonic() - start) / 4
    kill_and_take_up(tmp_path, new_project, QUICK, results(project), kills=20, longest=longest)


def test_two_runs_at_once(small):
    wait = "until [ -e go ]; do sleep 0.05; done; "
    small.edit("Snakefile", 'shell: "python workflow/jobs.py views', f'shell: "{wait}python workflow/jobs.py views')  # fmt: skip
    with Run(small, "--", SMALL_TABLE) as first:
        first.wait_for_jobs()
        assert list(small.folder.glob(".snakemake/locks/*output.lock")), first.said
        status, said = study(small, "--", SMALL_TABLE)
        assert status != 0
        last = said.splitlines()[-1]
        assert last.startswith("error: another run is at work here (process "), said
        (small.folder / "go").touch()
        assert first.process.wait() == 0, first.said
    assert (small.folder / SMALL_TABLE).is_file()


def test_a_run_on_another_machine_keeps_its_lock(small_finished):
    folder = small_finished.folder
    (folder / SMALL_TABLE).unlink()
    locks = folder / ".snakemake/locks"
    locks.mkdir(exist_ok=True)
    (locks / "0.output.lock").write_text(f"{SMALL_TABLE}\n")
    (folder / ".snakemake/host").write_text("elsewhere")
    status, said = study(small_finished, "--", SMALL_TABLE)
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


@pytest.mark.slow
def test_a_full_disk_is_named_and_the_rest_is_done_when_there_is_room(small_finished):
    folder = small_finished.folder
    expected = results(small_finished)
    for name in ("figures/fig1.pdf", "results/claims.csv", "results/final.sha256"):
        (folder / name).unlink()
    run = in_own_mounts(
        small_finished,
        """
        mv results before
        mkdir results
        mount -t tmpfs -o size=1m tmpfs results
        cp -a before/. results
        cat /dev/zero >results/filler 2>/dev/null || true
        "$@" --keep-going && exit 3
        find results -name '.part-*'
        echo ROOM
        rm results/filler
        "$@"
        cp -r results kept
        """,
    )
    assert run.returncode == 0, run.stdout
    full, room = run.stdout.split("ROOM\n")
    (line,) = full.split("Stopped by\n")[1].splitlines()[:1]
    assert re.fullmatch(r"error: results/claims\.\w+: No space left on device", line), full
    assert "Traceback" not in full and "results/.part" not in full
    # A figure; then the verdicts, the list of digests, and the rule of all.
    assert [jobs_in(said) for said in (full, room)] == [1, 3]
    for name in ("claims.csv", "claims.json", "final.sha256"):
        assert (folder / "kept" / name).read_bytes() == expected[f"results/{name}"]


def test_a_read_only_folder_of_results_is_named(small_finished):
    (small_finished.folder / SMALL_TABLE).unlink()
    before = results(small_finished)
    run = in_own_mounts(
        small_finished,
        """
        mount --bind results results
        mount -o remount,bind,ro results
        ! "$@"
        """,
        *("--", SMALL_TABLE),
    )
    assert run.returncode == 0, run.stdout
    (line,) = run.stdout.splitlines()
    assert line.startswith("error: results cannot be written to: mend that")
    assert results(small_finished) == before
