"""Settings: complete when right, one line each when wrong."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import jsonschema
import pytest
import yaml

from keystab.errors import InputError
from keystab.study import settings
from keystab.study.plain_yaml import read_plain_yaml

ROOT = Path(__file__).parents[2]
SCHEMA = read_plain_yaml(ROOT / "workflow/schemas/config.schema.yaml")


def leaves(schema: dict, name: str = ""):
    """Every setting of a schema with its place."""
    if schema.get("type") != "object":
        yield name, schema
        return
    for key, part in schema.get("properties", {}).items():
        yield from leaves(part, f"{name}.{key}" if name else key)
    others = schema.get("additionalProperties")
    if isinstance(others, dict):
        yield from leaves(others, f"{name}.NAME")


def test_schema_is_a_schema():
    jsonschema.Draft202012Validator.check_schema(SCHEMA)


@pytest.mark.parametrize(("place", "part"), list(leaves(SCHEMA)))
def test_every_setting_has_description_default_and_type(place, part):
    assert part["description"].endswith(".")
    assert "default" in part
    assert "type" in part or "enum" in part


def test_config_yaml_shows_every_default():
    # What is wrong with config/config.yaml: make it say what the schema says.
    given = settings.read_yaml(ROOT / "config/config.yaml")
    defaults = settings.completed({}, SCHEMA)
    assert settings.completed(given, SCHEMA) == defaults
    assert given.keys() == defaults.keys()
    for key, value in defaults.items():
        if isinstance(value, dict) and key != "sets":
            assert given[key].keys() == value.keys(), key


@pytest.mark.parametrize("path", ["quick.yaml", *(f"{p.parent.name}/{p.name}" for folder in ("what_if", "pictures") for p in sorted((ROOT / "config" / folder).glob("*.yaml")))])  # fmt: skip
def test_overlays_are_valid_and_keep_to_their_own_folders(path):
    given = settings.read_yaml(ROOT / "config/config.yaml", ROOT / "config" / path)
    complete = settings.checked(given, SCHEMA)
    name = path.removesuffix(".yaml").removeprefix("pictures/")
    for key in ("results", "figures", "logs"):
        assert complete[key] == f"{key}/{name}"


WRONG = [
    # unknown settings, with the nearest known one
    ({"referense": "x"}, "referense is no setting; did you mean reference?"),
    ({"detector": {"sigma_mim": 1}}, "detector.sigma_mim is no setting; did you mean detector.sigma_min?"),
    ({"sets": {"still": {"blurr": 1}}}, "sets.still.blurr is no setting; did you mean sets.still.blur?"),
    ({"predictors": {"zzz": 1}}, "predictors.zzz is no setting; the settings of predictors are n_resamples"),
    # types
    ({"detector": {"epsilon": "1e-6"}}, "detector.epsilon is the text '1e-6', allowed is a number of at least 0: write 1.0e-06"),
    ({"detector": {"sigma_min": "1.1"}}, "detector.sigma_min is the text '1.1', allowed is a number above 0: write 1.1"),
    ({"refinement": {"max_offset": "inf"}}, "refinement.max_offset is the text 'inf', allowed is a number above 0: write .inf"),
    ({"refinement": {"max_iterations": 2.0}}, "refinement.max_iterations is 2.0, allowed is a whole number of at least 1 and at most 100 (default 2)"),
    ({"refinement": {"scale_moves": "False"}}, "refinement.scale_moves is the text 'False', allowed is true or false: write false without quotes"),
    ({"refinement": {"scale_moves": 1}}, "refinement.scale_moves is 1, allowed is true or false (default true)"),
    ({"detector": None}, "detector is empty, allowed is a block of settings"),
    ({"grid": {"n_spo": 3}}, "grid.n_spo is 3, allowed is a list with at least 2 items, each a whole number of at least 1 and at most 100, smallest first, none twice (default [3, 5, 7, 9, 11, 13, 15, 17, 19])"),
    ({"grid": {"n_spo": [3, "5"]}}, "grid.n_spo[1] is the text '5', allowed is a whole number of at least 1 and at most 100: write 5"),
    ({"results": 3}, "results is 3, allowed is a text that is not empty (default results)"),
    ({"draft": "yes"}, "draft is the text 'yes', allowed is true or false (default false)"),
    # ranges
    ({"detector": {"kappa": 1}}, "detector.kappa is 1, allowed is a number above 1 (default 1.2599210498948732)"),
    ({"detector": {"epsilon": float("nan")}}, "detector.epsilon is nan, allowed is a number of at least 0 (default 0.0)"),
    ({"detector": {"sigma_min": float("inf")}}, "detector.sigma_min is inf, allowed is a number above 0 (default 1.1)"),
    ({"samplings": {"n_spo": [3, 3]}}, "samplings.n_spo is [3, 3], allowed is a list with at least 2 items, each a whole number of at least 1 and at most 100, smallest first, none twice"),
    ({"samplings": {"n_spo": [5, 3]}}, "samplings.n_spo is [5, 3], allowed is a list with at least 2 items"),
    ({"comparison": {"stable_above": 1.2}}, "comparison.stable_above is 1.2, allowed is a number of at least 0 and at most 1 (default 0.8)"),
    ({"grid": {"n_spo": [3]}}, "grid.n_spo is [3], allowed is a list with at least 2 items, each a whole number"),
    ({"grid": {"delta_min": [0.5]}}, "grid.delta_min is [0.5], allowed is a list with at least 2 items, each a number above 0"),
    ({"refinement": {"max_iterations": 101}}, "refinement.max_iterations is 101, allowed is a whole number of at least 1 and at most 100 (default 2)"),
    ({"comparison": {"last_scale": 1}}, "comparison.last_scale is 1, allowed is a number above 1 or null"),
    # choices
    ({"refinement": {"move": "neerest"}}, "refinement.move is the text 'neerest', allowed is nearest or unit_step: did you mean nearest?"),
    ({"views_dtype": "float16"}, "views_dtype is the text 'float16', allowed is float32 or float64: did you mean float"),
    ({"sets": {"My set": {}}}, "sets has 'My set', allowed are names of small letters, digits and _ that start with a letter"),
    ({"reference_sha256": "abc"}, "reference_sha256 is the text 'abc', allowed is 64 hexadecimal digits or null"),
]  # fmt: skip


@pytest.mark.parametrize(("given", "line"), WRONG, ids=[str(given)[:50] for given, _ in WRONG])
def test_wrong_settings_get_one_line_each(given, line):
    with pytest.raises(InputError) as caught:
        settings.checked(given, SCHEMA)
    (said,) = str(caught.value).splitlines()
    assert said.startswith(f"config: {line}")


def test_all_problems_are_listed():
    given = {"detector": {"kappa": 0.5, "epsilon": -1}, "drafft": True}
    lines = settings.schema_problems(given, SCHEMA)
    assert len(lines) == 3


def test_as_many_models_are_allowed_as_paths_have():
    from keystab.detection.refinement import MOST_MODELS

    given = {"refinement": {"max_iterations": MOST_MODELS}}
    assert settings.checked(given, SCHEMA)["refinement"]["max_iterations"] == MOST_MODELS


def test_infinity_is_allowed_where_the_paper_uses_it():
    given = {"refinement": {"max_offset": float("inf")}}
    assert settings.checked(given, SCHEMA)["refinement"]["max_offset"] == float("inf")


@pytest.mark.parametrize("value", [1e-6, 1.1, 3.0, 1e300, 2.5e-12, float("inf"), -4.0])
def test_suggested_numbers_are_numbers_in_yaml(value):
    read = yaml.safe_load(settings._yaml_number(value))
    assert isinstance(read, (int, float)) and read == value


def test_overlays_replace_lists_and_merge_blocks(tmp_path):
    (tmp_path / "a.yaml").write_text("grid: {n_spo: [3, 5], delta_min: [0.5]}\ndraft: false\n")
    (tmp_path / "b.yaml").write_text("grid: {n_spo: [4]}\n")
    merged = settings.read_yaml(tmp_path / "a.yaml", tmp_path / "b.yaml")
    assert merged == {"grid": {"n_spo": [4], "delta_min": [0.5]}, "draft": False}


@pytest.mark.parametrize(
    ("text", "line"),
    [
        (None, "cannot be read (No such file or directory)"),
        ("a: [1, 2", "is not YAML in line"),
        ("- 1\n- 2\n", "holds no settings"),
    ],
)
def test_unreadable_files_get_one_line(tmp_path, text, line):
    path = tmp_path / "given.yaml"
    if text is not None:
        path.write_text(text)
    with pytest.raises(InputError) as caught:
        settings.read_yaml(path)
    assert line in str(caught.value) and "\n" not in str(caught.value)


def test_table_of_settings_in_the_readme_is_up_to_date():
    # Otherwise: python tools/settings_table.py
    command = [sys.executable, str(ROOT / "tools/settings_table.py"), "--check"]
    assert subprocess.run(command).returncode == 0
