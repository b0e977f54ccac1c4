"""Limits that a shell or a queue sets end every command in one line, at once."""

from __future__ import annotations

import resource
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from keystab.io.tables import write_table
from keystab.utils import memory

ROOT = Path(__file__).parents[2]
SEMIGROUP = (
    "keystab.stages.semigroup --blob 1.1 --n-passes 2 --sigma-from 0.5 --sigma-to 1.5 "
    "--sigma-count 2 --truncation 4 --table t.csv"
)
FIGURE = "keystab.figures.fig12 --tables . --pdf f.pdf --png f.png"


def limited(folder: Path, command: str, **limits: int) -> tuple[int, str, list[str]]:
    """Exit status, last words and files left of a command under limits of the system."""

    def limit() -> None:
        for name, most in limits.items():
            resource.setrlimit(getattr(resource, name), (most, most))

    module, *arguments = command.split()
    done = subprocess.run(
        [sys.executable, "-m", module, *arguments],
        cwd=folder,
        preexec_fn=limit,
        capture_output=True,
        text=True,
        timeout=60,
    )
    return done.returncode, done.stderr, sorted(path.name for path in folder.iterdir())


@pytest.mark.parametrize("megabytes", [700, 900])
@pytest.mark.parametrize(
    "command", ["keystab.cli detect p.png --camera-blur 0.8", SEMIGROUP, FIGURE]
)
def test_too_little_memory_to_start_is_said_before_anything_is_loaded(command, megabytes, tmp_path):
    since = time.monotonic()
    status, said, files = limited(tmp_path, command, RLIMIT_AS=megabytes * 10**6)
    assert (status, files, said.count("\n")) == (2, [], 1), said
    assert f"limits memory to {megabytes} MB (ulimit -v)" in said and "raise the limit" in said
    assert time.monotonic() - since < 30  # 0.3 s; it waited for ever


def test_the_study_says_so_before_it_plans(tmp_path):
    def limit() -> None:
        resource.setrlimit(resource.RLIMIT_AS, (700 * 10**6,) * 2)

    done = subprocess.run(
        [sys.executable, str(ROOT / "tools/study.py"), "--cores", "1"],
        cwd=tmp_path, preexec_fn=limit, capture_output=True, text=True, timeout=60,
    )  # fmt: skip
    assert (done.returncode, done.stdout, done.stderr.count("\n")) == (2, "", 1)
    assert done.stderr.startswith("error: this shell limits memory to 700 MB")


def test_what_a_limit_leaves_is_available(monkeypatch):
    monkeypatch.setattr(memory, "reserved", lambda: 10**9)
    monkeypatch.setattr(memory, "_taken", lambda: 4 * 10**8)
    assert memory.available() <= 6 * 10**8
    monkeypatch.setattr(memory, "_taken", lambda: 2 * 10**9)
    assert memory.available() == 0


@pytest.mark.parametrize(
    ("error", "limit", "told"),
    [
        (MemoryError(), None, "the memory does not suffice"),
        (ImportError("failed to map segment"), 10**9, "the memory that this shell allows, 1 GB"),
        (RuntimeError("can't start new thread"), 10**9, "the memory that this shell allows, 1 GB"),
        (ImportError("no such module"), None, None),
        (OSError(2, "no such file"), 10**9, None),
    ],
)
def test_failures_under_a_limit_are_put_down_to_it(error, limit, told, monkeypatch):
    monkeypatch.setattr(memory, "reserved", lambda: limit)
    said = memory.too_little(error)
    assert said is None if told is None else said and said.startswith(told)


@pytest.mark.parametrize(
    ("command", "said"),
    [
        ("keystab.cli simulate p.npy o.png --blur 1 --step 1", "o.png: File too large"),
        ("keystab.cli simulate p.npy o.npy --blur 1 --step 1", "o.npy: "),
        (SEMIGROUP, "t.csv: File too large"),
        ("keystab.figures.fig1 --tables . --pdf f.pdf", "f.pdf: cannot be written (File too large"),
    ],
)
def test_a_limit_of_file_size_leaves_one_line_and_no_file(command, said, tmp_path):
    np.save(tmp_path / "p.npy", np.random.default_rng(1).random((60, 80)))
    if "fig1" in command:
        from figure_tables import tables

        write_table(tables(1)["fig1"], tmp_path / "fig1.csv")
    before = sorted(path.name for path in tmp_path.iterdir())
    most = 100 if "semigroup" in command else 3000
    status, told, files = limited(tmp_path, command, RLIMIT_FSIZE=most)
    assert (status, told.count("\n")) == (2, 1), told
    assert said in told and files == before
