"""Checksums name what was damaged, lost or added."""

import hashlib
import shutil
import subprocess

import pytest

from keystab.errors import InputError
from keystab.io.checksums import checksums, verify, write_checksums


@pytest.fixture
def folder(tmp_path):
    folder = tmp_path / "store"
    (folder / "b").mkdir(parents=True)
    (folder / "b" / "two").write_bytes(b"2")
    (folder / "a one").write_bytes(b"1")
    (folder / ".snakemake_timestamp").write_bytes(b"")
    write_checksums(folder, tmp_path / "store.sha256")
    return folder


def test_text_has_the_format_of_sha256sum(folder, tmp_path):
    one, two = (hashlib.sha256(b).hexdigest() for b in (b"1", b"2"))
    assert checksums(folder) == f"{one}  a one\n{two}  b/two\n"
    assert (tmp_path / "store.sha256").read_bytes() == checksums(folder).encode()


@pytest.mark.skipif(shutil.which("sha256sum") is None, reason="needs the command sha256sum")
def test_sha256sum_checks_it(folder):
    subprocess.run(["sha256sum", "-c", "--quiet", "../store.sha256"], cwd=folder, check=True)


def test_copies_have_the_same_checksums(folder, tmp_path):
    shutil.copytree(folder, tmp_path / "copy")
    (tmp_path / "copy" / ".snakemake_timestamp").write_bytes(b"later")
    assert checksums(tmp_path / "copy") == checksums(folder)
    verify(tmp_path / "copy", tmp_path / "store.sha256")


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda f: (f / "b" / "two").write_bytes(b"3"), "b/two is damaged"),
        (lambda f: (f / "a one").unlink(), "a one is missing"),
        (lambda f: (f / "c").write_bytes(b""), "c was not there when checksums were taken"),
        (lambda f: shutil.rmtree(f), "a one is missing, and 1 more"),
        (lambda f: f.with_suffix(".sha256").unlink(), "no readable checksums"),
        (lambda f: f.with_suffix(".sha256").write_bytes(b"\xff\xfe"), "no readable checksums"),
    ],
)
def test_changes_are_named(folder, tmp_path, change, words):
    verify(folder, tmp_path / "store.sha256")
    change(folder)
    with pytest.raises(InputError) as raised:
        verify(folder, tmp_path / "store.sha256")
    assert words in str(raised.value) and "\n" not in str(raised.value)


def test_nothing_has_no_checksums(tmp_path):
    with pytest.raises(InputError, match="no folder with files"):
        checksums(tmp_path / "gone")
