"""What a report of an error says of the machine, and what it must not say."""

from __future__ import annotations

import importlib.metadata
import sys

import pytest

from keystab import __version__
from keystab.cli import main as cli


def test_environment_says_versions_and_no_folder_of_the_person(capsys, monkeypatch):
    home = sys.prefix.rpartition("/")[0]
    monkeypatch.setenv("HOME", home)
    monkeypatch.setenv("NUMBA_CACHE_DIR", f"{home}/loops")
    assert cli.main(["inspect", "--environment"]) == 0
    said = " ".join(capsys.readouterr().out.split())
    for text in (
        f"keystab {__version__}",
        f"Python {sys.version.split()[0]}, ~/",
        f"numpy {importlib.metadata.version('numpy')}",
        "NUMBA_CACHE_DIR=~/loops",
        "GB free",
    ):
        assert text in said
    assert f"{home}/" not in said


def test_environment_says_what_is_missing(capsys, monkeypatch):
    def version(package: str) -> str:
        if package == "snakemake":
            raise importlib.metadata.PackageNotFoundError
        return "1.0"

    monkeypatch.setattr(importlib.metadata, "version", version)
    assert cli.main(["inspect", "--environment"]) == 0
    assert "not installed    snakemake\n" in capsys.readouterr().out


@pytest.mark.parametrize("more", [[], ["nowhere.png"]])
def test_inspect_needs_something_to_look_into(capsys, more):
    assert cli.main(["inspect", *more]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1 and "give a picture, a store or a table" in said
