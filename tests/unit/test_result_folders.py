"""Folders as people write them: one way of writing each, or one line that says why not."""

from __future__ import annotations

import copy
import re
from pathlib import Path

import pytest

from keystab.errors import InputError
from keystab.study import feasibility, settings
from keystab.study.plain_yaml import read_plain_yaml
from keystab.study.result_folders import normal_folder, path_problems

ROOT = Path(__file__).parents[2]
SCHEMA = read_plain_yaml(ROOT / "workflow/schemas/config.schema.yaml")
GIVEN = settings.read_yaml(ROOT / "config/config.yaml")


def under(overlay: dict[str, object]) -> settings.Settings:
    """Complete settings with others laid over them."""
    given = copy.deepcopy(GIVEN)
    settings.merge(given, overlay)
    return settings.checked(given, SCHEMA)


@pytest.mark.parametrize(
    ("written", "folder"),
    [
        ("results/t1/", "results/t1"),
        ("./results/t2", "results/t2"),
        ("results//t3/.", "results/t3"),
        ("~/keystab", "/home/ada/keystab"),
        ("results/my roof", "results/my roof"),
        ("../elsewhere/", "../elsewhere"),
    ],
)
def test_a_folder_is_written_in_one_way(written, folder, monkeypatch):
    monkeypatch.setenv("HOME", "/home/ada")
    complete = under({"results": written})
    assert complete["results"] == folder
    assert path_problems(complete, ROOT) == []


def test_a_folder_of_the_project_is_relative_to_it(tmp_path):
    assert normal_folder(f"{tmp_path}/results/t/", tmp_path) == "results/t"


@pytest.mark.parametrize("key", ["results", "figures", "logs"])
@pytest.mark.parametrize(
    "folder",
    ["src", ".git", "config/mine", "workflow", "Tests", ".snakemake", ".venv", ".", "..", "/", "README.md",
     "results/reference", "a{b}", "a{b", "a,b", "a\nb", "a\n", "a'b", 'a"b', "-rf", "a; b", "$(id)", "a*",
     "~nobody-of-this-name/a", " ", "a ", "a\\b", "\x1b[2J", "a\x00b"],
)  # fmt: skip
def test_a_folder_that_cannot_be_is_refused_in_one_line(key, folder):
    (line,) = path_problems(under({key: folder}), ROOT)
    assert line.startswith(f"{key} is ") and "\n" not in line and "; give " in line


@pytest.mark.parametrize(
    "overlay",
    [{"reference": "my{n}.png"}, {"reference": "a.png\n"}, {"pictures": ["a.yaml", "b{c}.yaml"]}],
)
def test_a_file_that_rules_cannot_name_is_refused_in_one_line(overlay):
    (line,) = path_problems(under(overlay), ROOT)
    assert re.search("is .*, allowed is a name without control characters", line)


@pytest.mark.parametrize(
    "overlay",
    [
        {"sets": {"mine\n": {"step": 2}}},
        {"predictors": {"pictures": {"roof\n": {}}}},
        {"reference_sha256": "0" * 64 + "\n"},
    ],
)
def test_a_name_does_not_end_in_a_newline(overlay):
    with pytest.raises(InputError, match=r"allowed (are names|is 64 hexadecimal digits)"):
        under(overlay)


@pytest.mark.parametrize("value", [1e308, 1e-308, 1e31, 1e-31, 10**400, -(10**400)])
@pytest.mark.parametrize("place", ["detector.sigma_min", "sets.still.step", "sets.still.blur"])
def test_numbers_that_nothing_can_be_computed_with_are_refused(place, value):
    overlay: object = value
    for key in reversed(place.split(".")):
        overlay = {key: overlay}
    with pytest.raises(InputError) as caught:
        feasibility.require(under(overlay), ROOT)
    assert f"config: {place} is " in str(caught.value) and "\n" not in str(caught.value)
