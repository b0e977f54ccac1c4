"""Nothing of an archive runs, nothing is written elsewhere, and none that harms is verified."""

from __future__ import annotations

import hashlib
import json
import os
import pickle
import re
import shutil
import subprocess
import sys
import tempfile
import zipfile
from pathlib import Path

import pytest
import small_study
from hostile_archives import KINDS, PYTHON, SHELL, Hostile, Pickled, sealed, zipped
from project import ROOT

from keystab.cli import main as cli
from keystab.provenance import archive
from keystab.provenance.study_folder import Study

MOST_SECONDS, MOST_MEGABYTES = 10, 500

MEASURED = """
import json, resource, subprocess, sys
run = subprocess.run(sys.argv[2:], capture_output=True, timeout=300)
used = resource.getrusage(resource.RUSAGE_CHILDREN)
said = [text.decode("utf-8", "backslashreplace") for text in (run.stdout, run.stderr)]
seconds, megabytes = used.ru_utime + used.ru_stime, used.ru_maxrss / 1000
with open(sys.argv[1], "w") as file:
    json.dump([run.returncode, *said, seconds, megabytes], file)
"""
"""A small process that runs another: of its children's memory it adds none of pytest's."""


class Place:
    """A folder with all that somebody who verifies an archive has: nothing in it may change."""

    def __init__(self, folder: Path, reference: Path) -> None:
        self.folder, self.clone = folder, folder / "clone"
        small_study.write(self.clone)
        shutil.copytree(reference, self.clone / "results/reference")
        for name in ("home", "tmp", "outside"):
            (folder / name).mkdir()
        for name in ("victim.txt", "scene.txt"):
            (folder / "outside" / name).write_text("mine\n")
        self.archive = folder / "hostile.zip"
        self.environment = {
            "HOME": f"{folder}/home",
            "XDG_CACHE_HOME": f"{folder}/home/.cache",
            "TMPDIR": f"{folder}/tmp",
            "HOSTILE_MARKER": f"{folder}/marker",
        }

    def tree(self) -> dict[str, tuple[int, int, str]]:
        """Kind, time and content of all files and folders; of two, times change with use."""
        found = {}
        for path in sorted(self.folder.rglob("*")):
            about = path.lstat()
            time = 0 if path.parent == self.folder and path.is_dir() else about.st_mtime_ns
            content = hashlib.sha256(path.read_bytes()).hexdigest() if path.is_file() else ""
            found[path.relative_to(self.folder).as_posix()] = (about.st_mode, time, content)
        return found


@pytest.fixture(scope="session")
def members(packed: Path) -> dict[str, bytes]:
    """Members of an honest archive."""
    with zipfile.ZipFile(packed) as file:
        return {name: file.read(name) for name in file.namelist()}


@pytest.fixture(scope="session")
def reference(ran: Study, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The committed reference of the small study."""
    return archive.publish(ran, tmp_path_factory.mktemp("published") / "reference")


@pytest.fixture
def place(tmp_path: Path, reference: Path) -> Place:
    return Place(tmp_path / "place", reference)


def check(kind: Hostile, status: int, said: str, errors: str) -> None:
    """Ask whether what was said is what has to be said, and no more."""
    assert status in (1, 2), f"{kind.name} is verified"
    assert "Traceback" not in said + errors
    assert not re.search(r"[\x00-\x09\x0b-\x1f\x7f-\x9f]", said + errors), "obeyed by a terminal"
    if status == 2:
        assert said == "" and errors.startswith("keystab verify: ")
        assert errors.count("\n") == 1 and len(errors) < 1000
        assert re.search(kind.said, errors), errors
    else:
        assert errors == ""
        assert "\nFAILED  " in said and "NOT verified" in said
        assert re.search(kind.said, said), said


def by_name(kind: Hostile) -> str:
    return kind.name


def test_kinds_are_many_and_have_names():
    names = [kind.name for kind in KINDS]
    assert len(names) > 400 and len(set(names)) == len(names)


def test_the_code_in_them_leaves_a_mark_where_it_runs(tmp_path):
    (tmp_path / "utf7.py").write_bytes(b"# coding: utf-7\n# +AAo-" + PYTHON.replace(b"'", b"+ACc-"))
    loading = f"import pickle; pickle.loads({pickle.dumps(Pickled())!r})"
    for command in (
        [sys.executable, "-c", PYTHON.decode()],
        [sys.executable, "-c", loading],
        [sys.executable, "utf7.py"],
        ["sh", "-c", SHELL],
    ):
        marker = tmp_path / "marker"
        environment = {
            **os.environ,
            "HOSTILE_MARKER": str(marker),
            "PYTHONPATH": str(Path(__file__).parent),
        }
        subprocess.run(command, cwd=tmp_path, env=environment, check=True)
        marker.unlink()


def test_an_archive_put_together_in_the_same_way_is_verified(
    members, place, monkeypatch, capsys, snakemake_in_forks
):
    place.archive.write_bytes(zipped(members, compress=True))
    assert verified_here(place, monkeypatch) == 0
    assert "\nverified (" in capsys.readouterr().out


def verified_here(place: Place, monkeypatch: pytest.MonkeyPatch, *more: str) -> int:
    """Verify in this process; its exit status."""
    for name, value in place.environment.items():
        monkeypatch.setenv(name, value)
    monkeypatch.setattr(tempfile, "tempdir", place.environment["TMPDIR"])
    monkeypatch.chdir(place.clone)
    before = place.tree()
    status = cli.main(["verify", str(place.archive), *more])
    assert place.tree() == before
    return status


@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind.quick], ids=by_name)
def test_some_are_not_verified(kind, members, place, monkeypatch, capsys, snakemake_in_forks):
    place.archive.write_bytes(kind.make(members))
    status = verified_here(place, monkeypatch)
    check(kind, status, *capsys.readouterr())


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS, ids=by_name)
def test_none_is_verified_or_recomputed(kind, members, place, tmp_path):
    place.archive.write_bytes(kind.make(members))
    before = place.tree()
    command = [sys.executable, "-m", "keystab.cli", "verify", "../hostile.zip"]
    subprocess.run(
        [sys.executable, "-S", "-c", MEASURED, tmp_path / "said", *command, "--recompute", "fig1"],
        cwd=place.clone,
        env={**os.environ, **place.environment, "PYTHONPATH": f"{ROOT}/src"},
        check=True,
    )
    status, said, errors, seconds, megabytes = json.loads((tmp_path / "said").read_text())
    assert place.tree() == before
    check(kind, status, said, errors)
    assert "recomputing" not in said
    assert status == 2 or "\nnothing is recomputed: " in said
    assert seconds < MOST_SECONDS and megabytes < MOST_MEGABYTES


def test_lists_of_digests_are_rewritten_as_they_were(members):
    assert sealed(members) == members
