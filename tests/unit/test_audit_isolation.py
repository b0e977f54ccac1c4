"""Limits of what detectors may take, and detectors that are not there."""

from __future__ import annotations

import os
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from keystab.audit import isolation
from keystab.audit.detectors import Detector, own_detector
from keystab.audit.isolation import Limits, detections, why_not_there
from keystab.cli.main import main

IMAGE = np.random.default_rng(1).random((24, 32))
SMALL = IMAGE[:20, :20]
LINUX = pytest.mark.skipif(not os.path.isdir("/proc/self"), reason="processor time is not known")

MINE = """
import subprocess, sys, time

def slow(image, blur):
    time.sleep(0.5)
    return [[1.0, 2.0, 3.0]]

def busy(image, blur):
    end = time.process_time() + 100
    while time.process_time() < end: pass

def late(image, blur):
    end = time.process_time() + 0.4
    while len(image) == 20 and time.process_time() < end: pass
    return [[1.0, 2.0, 3.0]]

def family(image, blur):
    subprocess.run([sys.executable, "-c", "while True: pass"])

def nothing(image, blur): return None
def wrong(image, blur): raise ValueError("too small")
def left(image, blur): sys.exit(3)
"""


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("mine.py").write_text(MINE)
    Path("broken.py").write_text("import numpy\nnumpy.no_such_name\ndef detect(image): pass\n")
    Path("gone.py").write_text("import os\nos._exit(5)\n")
    Path("script").write_text("no program\n")
    Path("script").chmod(0o755)
    Path("text").write_text("no program\n")
    return tmp_path


def problem_of(name: str, limits: Limits) -> str:
    (found,) = detections(own_detector(f"mine:{name}"), [IMAGE], [0.5], limits)
    return found.problem


# Time


@LINUX
def test_time_of_which_a_detector_has_nothing_is_not_counted(here):
    assert problem_of("slow", Limits(0.2, patience=50.0)) == ""
    assert problem_of("slow", Limits(0.2, patience=1.0)).startswith("it took more than 0.2 s")


@LINUX
@pytest.mark.parametrize("name", ["busy", "family"])
def test_time_of_the_processor_is_counted_in_all_processes(name, here):
    said = problem_of(name, Limits(0.3, patience=100.0))
    assert said == "it took more than 0.3 s for a picture (--time-limit)"


@LINUX
def test_a_library_may_compile_with_a_later_picture(here):
    pictures, limits = ([IMAGE, SMALL], [0.5, 0.5]), Limits(0.15, 5.0, patience=50.0)
    own = own_detector("mine:late")
    said = [each.problem for each in detections(own, *pictures, limits)]
    assert said == ["", "it took more than 0.15 s for a picture (--time-limit)"]
    library = Library(own.name, own.setting, "library", own.runs)
    assert [each.problem for each in detections(library, *pictures, limits)] == ["", ""]


class Library(Detector):
    """A function that counts as a library."""

    @property
    def job(self):
        return {**super().job, "kind": "function"}


def test_what_waits_is_ended_by_the_clock(here):
    said = problem_of("slow", Limits(0.05))
    assert said == "it took more than 0.25 s by the clock for a picture (--time-limit)"


def test_a_message_is_the_same_for_pictures_of_all_shapes(here):
    found = list(detections(own_detector("mine:nothing"), [IMAGE, SMALL], [0.5, 0.5]))
    (said,) = {each.problem for each in found}
    assert said.startswith("TypeError: it returned None") and "shape (24, 32)" in said


# What is not there


@pytest.mark.parametrize(
    ("detector", "said"),
    [
        ("nowhere:detect", "nowhere:detect: there is no module nowhere in "),
        ("mine:nowhere", "mine:nowhere: AttributeError: module 'mine' has no attribute 'nowhere'"),
        ("broken:detect", "broken:detect: AttributeError: module 'numpy' has no attribute"),
        ("gone:detect", "gone:detect: it ended with status 5 before it was done"),
        ("./nowhere {picture} {table}", "./nowhere cannot be started: No such file or directory"),
        ("./text {picture} {table}", "./text cannot be started: Permission denied"),
        ("./script {picture} {table}", "./script cannot be started: Exec format error"),
    ],
)
def test_what_is_not_there_ends_an_audit_before_anything_is_computed(
    detector, said, here, capsys, monkeypatch
):
    monkeypatch.setattr("keystab.cli.audit._scene", lambda *_: pytest.fail("truth was computed"))
    assert main(["audit", detector, "-o", "out"]) == 2
    error = capsys.readouterr().err
    assert said in error and error.startswith("keystab audit: ") and error.count("\n") == 1
    assert not Path("out").exists()


@pytest.mark.parametrize("name", ["wrong", "left", "nothing"])
def test_what_fails_with_a_small_picture_may_be_audited(name, here):
    assert why_not_there(own_detector(f"mine:{name}")) == ""


def test_a_command_that_fails_with_a_small_picture_may_be_audited(here):
    assert why_not_there(own_detector(f"{sys.executable} none.py {{picture}} {{table}}")) == ""


@pytest.fixture
def clock(monkeypatch):
    """A clock by the wall and one of the processor, which pass when told to."""
    times = {"wall": 0.0, "processor": 0.0}
    monkeypatch.setattr(isolation.time, "monotonic", lambda: times["wall"])
    monkeypatch.setattr(isolation, "_processor_seconds", lambda pid: times["processor"])
    return times


@pytest.mark.parametrize(
    ("wall", "processor", "problem"),
    [
        (10.0, 10.0, ""),  # on the limit
        (10.1, 10.1, "it took more than 10 s"),
        (49.9, 9.9, ""),  # it waited, or had no processor
        (50.0, 0.0, ""),
        (50.1, 0.0, "it took more than 50 s by the clock"),
        (9.0, 30.0, ""),  # several threads within the time of one
        (20.0, 30.0, "it took more than 10 s"),
    ],
)
def test_time_is_that_of_the_processor_and_by_the_clock_at_most_five_times_as_much(
    clock, wall, processor, problem
):
    taken = isolation._Time(1, 5.0)
    taken.restart(10.0)
    clock["wall"], clock["processor"] = wall, processor
    assert taken.problem() == problem


def test_where_the_processor_is_not_known_the_clock_counts(clock):
    clock["processor"] = None
    taken = isolation._Time(1, 5.0)
    taken.restart(10.0)
    clock["wall"] = 10.1
    assert taken.problem() == "it took more than 10 s" and taken.taken() == 10.1


def test_time_counts_from_the_last_restart(clock):
    taken = isolation._Time(1, 5.0)
    clock["wall"] = clock["processor"] = 100.0
    taken.restart(10.0)
    assert taken.problem() == "" and taken.taken() == 0
    clock["wall"] = clock["processor"] = 110.5
    assert taken.problem() == "it took more than 10 s"


GOOD = {name: np.arange(1.0, 4.0) for name in ("y", "x", "scale")}


@pytest.mark.parametrize(
    ("change", "problem"),
    [
        ({}, ""),
        ({name: np.zeros(0) for name in GOOD}, "it found nothing"),
        ({"y": np.array([1.0, np.nan, 2.0])}, "1 of 3 keypoints are at NaN or infinity"),
        ({"x": np.array([1.0, np.inf, np.nan])}, "2 of 3 keypoints are at NaN or infinity"),
        ({"scale": np.array([1.0, 0.0, 2.0])}, "1 of 3 keypoints have no scale above 0"),
        ({"scale": np.array([-1.0, 0.0, 2.0])}, "2 of 3 keypoints have no scale above 0"),
        ({"value": np.zeros(2)}, "its columns have different lengths"),
        ({"value": np.zeros((3, 1))}, "its columns are no lists of numbers"),
        ({"y": np.zeros((3, 1))}, "its columns are no lists of numbers"),
    ],
)
def test_what_a_process_wrote_is_looked_at(change, problem, tmp_path):
    np.savez(tmp_path / "found.npz", **(GOOD | change))
    found, _, said = isolation._checked(tmp_path / "found.npz", (4, 5))
    assert said == problem and (found is None) == (problem not in ("", "it found nothing"))


def test_a_picture_has_as_many_keypoints_as_pixels_and_no_more(tmp_path):
    for n in (6, 7):
        np.savez(tmp_path / "found.npz", **{name: np.ones(n) for name in GOOD}, seconds=0.5)
        found, seconds, said = isolation._checked(tmp_path / "found.npz", (2, 3))
        assert (found is None, seconds) == (n == 7, 0.5)
        assert ("more than the picture has pixels" in said) == (n == 7)


def test_seconds_are_those_that_a_detector_took(here):
    since = time.monotonic()
    (found,) = detections(own_detector("mine:slow"), [IMAGE], [0.5], Limits())
    assert found.problem == "" and 0.5 <= found.seconds < time.monotonic() - since
