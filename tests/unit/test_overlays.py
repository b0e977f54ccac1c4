"""Files of settings of a run are found again by the folders that it wrote to."""

from __future__ import annotations

import json

import pytest

from keystab.study import overlays
from keystab.study.overlays import NOTE, note, noted, overlays_of


@pytest.fixture
def project(tmp_path):
    """A project with settings of its own, a draft and a person's file, each with its folders."""
    files = {
        "config/config.yaml": "results", "config/quick.yaml": "results/quick",
        "config/deep/lake.yaml": "results/lake", "my.yaml": "mine",
    }  # fmt: skip
    for name, folder in files.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(f"results: {folder}\nfigures: drawn_{folder}\n")
    (tmp_path / "config/nothing.yaml").write_text("detector: {n_spo: 3}\n")
    (tmp_path / "config/broken.yaml").write_text("results: [\n")
    (tmp_path / ".snakemake").mkdir()
    return tmp_path


@pytest.mark.parametrize(
    ("folder", "files"),
    [
        ("results", []),
        ("results/quick", ["config/quick.yaml"]),
        ("results/lake", ["config/deep/lake.yaml"]),
        ("mine", ["my.yaml"]),
        ("nobody's", None),
    ],
)
def test_a_folder_belongs_to_the_file_that_names_it(project, folder, files):
    assert overlays_of(project, folder, "results") == files
    assert overlays_of(project, f"drawn_{folder}") == files
    assert overlays_of(project, folder) is None  # it is no folder of figures


def test_a_run_is_known_by_what_it_was_started_with_as_long_as_that_still_writes_there(project):
    settings = {"results": "results/lake", "figures": "drawn_results/lake"}
    asked = ["config/nothing.yaml", "config/deep/lake.yaml"]
    note(project, settings, [project / it for it in asked])
    assert noted(project, "results/lake") == noted(project, "drawn_results/lake") == asked
    assert overlays_of(project, "results/lake", "results") == asked
    (project / "config/deep/lake.yaml").write_text("results: elsewhere\n")
    assert noted(project, "results/lake") == asked
    assert overlays_of(project, "results/lake", "results") is None
    # The next run adds what it is, and what others said stays.
    note(project, {"results": "mine", "figures": "drawn_mine"}, ["my.yaml"])
    assert noted(project, "mine") == ["my.yaml"] and noted(project, "results/lake") == asked
    assert noted(project, "results") is None


@pytest.mark.parametrize(
    ("said", "known"),
    [
        ('{"a": ["x.yaml"]}', ["x.yaml"]),
        ('{"a": []}', []),
        ('{"a": "x.yaml"}', None),
        ('{"a": [3]}', None),
        ('{"a": ["x.yaml", null]}', None),
        ('["a"]', None),
        ("{", None),
        ("", None),
        ("[" * 100_000, None),
    ],
)
def test_what_is_no_list_of_names_is_left_out(project, said, known):
    (project / NOTE).write_text(said)
    assert noted(project, "a") == known


def test_notes_are_read_below_a_size(project, monkeypatch):
    text = json.dumps({"a": ["x.yaml"]})
    (project / NOTE).write_text(text)
    for most, known in ((len(text), None), (len(text) + 1, ["x.yaml"])):
        monkeypatch.setattr(overlays, "_MOST_BYTES", most)
        assert noted(project, "a") == known
