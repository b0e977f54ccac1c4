"""What somebody changed in results is named, in a finished tree and in an archive."""

from __future__ import annotations

import re
import shutil
import zipfile
from pathlib import Path

import pytest
import small_study
from hostile_archives import zipped
from tamperings import (
    RECORDS,
    Tampering,
    everywhere,
    forged,
    forgeries,
    in_archives,
    in_trees,
    judged,
    with_passports,
)

from keystab.cli import main as cli
from keystab.provenance import archive
from keystab.provenance.study_folder import Study

pytestmark = pytest.mark.usefixtures("snakemake_in_forks")

IN_TREES = [*everywhere(), *in_trees()]
IN_ARCHIVES = [*everywhere(), *in_archives()]
FORGERIES = list(forgeries(small_study.CLAIMS))


@pytest.fixture(scope="session")
def members(packed: Path) -> dict[str, bytes]:
    """Members of an honest archive."""
    with zipfile.ZipFile(packed) as file:
        return {name: file.read(name) for name in file.namelist()}


@pytest.fixture
def clone(ran: Study, tmp_path: Path) -> Path:
    """A copy of the small study with its committed reference, without results."""
    folder = small_study.write(tmp_path / "clone").project
    archive.publish(ran, folder / "results/reference")
    return folder


QUICK_IN_TREES = (
    "verdicts flipped: results/claims.csv",
    "a red square: figures/fig1.png",
    "record dropped: results/final.sha256",
)
QUICK_IN_ARCHIVES = (
    "a byte changed: figures/fig1.pdf",
    "cut in half: results/tables/figS3.csv",
    "left-out.csv: digest of results/views/still",
    "other settings named",
    "forged: verdicts flipped",
    "forged: pixels exchanged",
)


def kinds(tamperings: list[Tampering], quick: tuple[str, ...]) -> list[object]:
    """Parameters of a test: all but a few are slow."""
    assert set(quick) <= {it.name for it in tamperings}
    marks = pytest.mark.slow
    return [
        pytest.param(it, id=it.name, marks=() if it.name in quick else marks) for it in tamperings
    ]


def failed(said: str) -> list[str]:
    """What stands below lines that say FAILED."""
    found, below = [], False
    for line in said.splitlines():
        if line.startswith(" "):
            if below and not line.lstrip().startswith("note: "):
                found.append(line)
        else:
            below = line.startswith("FAILED")
    return found


def check(it: Tampering, status: int, said: str, errors: str) -> None:
    """Ask whether a tampering is named."""
    assert status in (1, 2), f"{it.name} is verified"
    lines = failed(said) if status == 1 else errors.splitlines()
    assert (errors == "") == (status == 1) and "Traceback" not in said
    for name in it.named:
        assert any(re.search(name, line) for line in lines), f"{name} is not named:\n{said}{errors}"


def test_tamperings_are_many_and_have_names():
    for tamperings in (IN_TREES, IN_ARCHIVES, FORGERIES):
        names = [it.name for it in tamperings]
        assert len(names) >= 40 and len(set(names)) == len(names)


def verify(archive: Path, clone: Path, monkeypatch: pytest.MonkeyPatch) -> int:
    monkeypatch.chdir(clone)
    return cli.main(["verify", str(archive)])


def test_what_nobody_changed_is_verified_though_all_was_rewritten(
    members, clone, tmp_path, monkeypatch, capsys
):
    same = with_passports(judged(members, small_study.CLAIMS))
    assert same == members
    (tmp_path / "a.zip").write_bytes(zipped(forged(same)))
    assert verify(tmp_path / "a.zip", clone, monkeypatch) == 0
    said = capsys.readouterr().out
    assert "ok      pictures: 4 of 4 as in results/reference" in said


@pytest.mark.parametrize("it", kinds(IN_TREES, QUICK_IN_TREES))
def test_in_a_finished_tree_it_is_named(it, ran, tmp_path, monkeypatch, capsys):
    folder = tmp_path / "here"
    shutil.copytree(ran.project, folder)
    names = [path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file()]
    kept = [name for name in names if not name.startswith(".") or name.startswith(RECORDS)]
    before = {name: (folder / name).read_bytes() for name in kept}
    after = it.change(before)
    for name in before.keys() | after.keys():
        if name not in after:
            (folder / name).unlink()
        elif after[name] != before.get(name):
            (folder / name).write_bytes(after[name])
    monkeypatch.chdir(folder)
    status = cli.main(["verify"])
    check(it, status, *capsys.readouterr())


@pytest.mark.parametrize("it", kinds([*IN_ARCHIVES, *FORGERIES], QUICK_IN_ARCHIVES))
def test_in_an_archive_with_rewritten_sums_it_is_named(
    it, members, clone, tmp_path, monkeypatch, capsys
):
    (tmp_path / "a.zip").write_bytes(zipped(it.change(members)))
    status = verify(tmp_path / "a.zip", clone, monkeypatch)
    check(it, status, *capsys.readouterr())
