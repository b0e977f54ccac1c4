"""Blocks of parameters are settings of the study, and stages explain all that they take."""

from __future__ import annotations

import importlib
import inspect
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import get_args, get_type_hints

import pytest

from keystab import parameters, stages
from keystab.study.plain_yaml import read_plain_yaml
from keystab.utils.stage_command import meanings

ROOT = Path(__file__).parents[2]
SCHEMA = read_plain_yaml(ROOT / "workflow/schemas/config.schema.yaml")
BLOCKS = [
    block
    for block in vars(parameters).values()
    if is_dataclass(block) and block.__module__ == parameters.__name__
]
STAGES = sorted(
    path.stem for path in Path(stages.__file__).parent.glob("*.py") if not path.stem.startswith("_")
)


def schema_of(place: str) -> dict:
    """What the schema says of a setting; any name will do where there is a wildcard."""
    part = SCHEMA
    for key in place.split("."):
        part = part["additionalProperties"] if "{" in key else part["properties"][key]
    return part


@pytest.mark.parametrize("block", BLOCKS, ids=lambda block: block.__name__)
def test_every_field_is_a_setting_of_its_type(block):
    kinds = get_type_hints(block, include_extras=True)
    for field in fields(block):
        kind, about = get_args(kinds[field.name])
        assert about.meaning
        known = schema_of(about.place)
        types = known.get("type", "string")
        allowed = {types} if isinstance(types, str) else set(types)
        # One number for all views, or one for each; what null stands for is resolved before.
        several = "list[" in str(kind)
        assert several <= ("array" in allowed), about.place
        if type(None) in get_args(kind):
            assert "null" in allowed, about.place
        if "enum" in known:
            choices = {value for value in known["enum"] if value is not None}
            assert choices == set(get_args(kind)), about.place


@pytest.mark.parametrize("name", STAGES)
def test_every_argument_of_a_stage_is_explained(name):
    main = importlib.import_module(f"keystab.stages.{name}").main.__wrapped__
    known = meanings(main)
    kinds = get_type_hints(main)
    assert inspect.getdoc(main)
    for argument in inspect.signature(main).parameters:
        block = any(map(is_dataclass, (kinds[argument], *get_args(kinds[argument]))))
        assert block or known.get(argument), argument


def test_nothing_is_explained_that_no_stage_takes():
    taken, known = set(), set()
    for name in STAGES:
        main = importlib.import_module(f"keystab.stages.{name}").main
        taken |= set(inspect.signature(main).parameters)
        known |= set(meanings(main))
    further = {f"{name}_digest" for name in ("views", "moved", "store", "sets")}
    assert known == (taken & known) | further
