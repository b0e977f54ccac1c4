"""The settings of the study: complete, checked, and explained in one line each when wrong.

The schema in ``workflow/schemas`` says which settings there are, of what type, in what range, and
what they are when not given. What no schema can say, whether settings fit each other, the picture
and the disk, is the business of `keystab.study.feasibility`.
"""

from __future__ import annotations

import copy
import difflib
import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import jsonschema
import yaml

from keystab.errors import InputError
from keystab.study.plain_yaml import read_plain_yaml
from keystab.study.result_folders import with_normal_paths

Settings = dict[str, Any]
Schema = Mapping[str, Any]


def read_yaml(*paths: Path | str) -> Settings:
    """Read a file of settings and lay others over it.

    Parameters
    ----------
    *paths : path
        YAML files. Later ones win; blocks are merged, lists and values are replaced.

    Returns
    -------
    dict

    Raises
    ------
    InputError
        If a file is missing, is not plain YAML in UTF-8, or is not a block of settings.
    """
    merged: Settings = {}
    for path in paths:
        given = read_plain_yaml(path) or {}
        if not isinstance(given, dict):
            raise InputError(f"{path}: holds no settings; write lines such as 'draft: true'")
        merge(merged, given)
    return merged


def checked(given: Settings, schema: Schema) -> Settings:
    """Complete settings, or all that the schema finds wrong with them.

    Parameters
    ----------
    given : dict
        Settings as read; anything left out takes its default. Of settings whose entries have names
        of the reader's own, entries that are null are left out.
    schema : dict
        What is allowed, as read from ``workflow/schemas/config.schema.yaml``.

    Returns
    -------
    dict
        All settings of the schema, folders written in one way (`normal_folder`).

    Raises
    ------
    InputError
        With one line per problem.
    """
    kept = without_null_entries(given, schema)
    refuse(schema_problems(kept, schema))
    return with_normal_paths(completed(kept, schema))


def refuse(problems: Sequence[str]) -> None:
    """Raise an `InputError` of one line per problem, if there is any."""
    if problems:
        raise InputError("\n".join(f"config: {problem}" for problem in problems))


def without_null_entries(given: Any, schema: Schema) -> Any:
    """Settings without the null entries of blocks in which the reader chooses the names.

    An overlay cannot take away what another file gives; null takes its place.

    Examples
    --------
    >>> schema = {"type": "object", "additionalProperties": {"type": "object"}}
    >>> without_null_entries({"a": {}, "b": None}, schema)
    {'a': {}}
    """
    if schema.get("type") != "object" or not isinstance(given, Mapping):
        return given
    known, others = schema.get("properties", {}), schema.get("additionalProperties", False)
    return {
        key: without_null_entries(value, known.get(key, others or {}))
        for key, value in given.items()
        if key in known or value is not None or not isinstance(others, Mapping)
    }


def completed(given: Any, schema: Schema) -> Any:
    """Settings with the schema's default for everything that was not given.

    Examples
    --------
    >>> schema = {"type": "object", "properties": {"a": {"default": 1}, "b": {"default": 2}}}
    >>> completed({"b": 5}, schema)
    {'a': 1, 'b': 5}

    Entries with names of the reader's own come in the order of the default, then as given:

    >>> named = {"type": "object", "default": {"x": 1, "y": 2}, "additionalProperties": {}}
    >>> completed({"z": 6, "y": 5, "x": 4}, named)
    {'x': 4, 'y': 5, 'z': 6}
    """
    if schema.get("type") != "object":
        return copy.deepcopy(given)
    filled = {
        key: completed(given.get(key, _default(part)), part)
        for key, part in schema.get("properties", {}).items()
    }
    others = schema.get("additionalProperties", False)
    # Snakemake puts what an overlay names first; the order must not depend on who names it.
    for key in [*(key for key in schema.get("default", {}) if key in given), *given]:
        if key not in filled and isinstance(others, Mapping):
            filled[key] = completed(given[key], others)
    return filled


def _default(schema: Schema) -> Any:
    return schema.get("default", {} if schema.get("type") == "object" else None)


def merge(below: Settings, above: Mapping[Any, Any]) -> None:
    """Lay settings over others, in place: blocks are merged, lists and values are replaced.

    Examples
    --------
    >>> below = {"detector": {"epsilon": 0.0, "kappa": 1.26}}
    >>> merge(below, {"detector": {"epsilon": 1e-6}})
    >>> below
    {'detector': {'epsilon': 1e-06, 'kappa': 1.26}}
    """
    for key, value in above.items():
        if isinstance(value, dict) and isinstance(below.get(key), dict):
            merge(below[key], value)
        else:
            below[key] = copy.deepcopy(value)


# ---------------------------------------------------------------------------------------------
# What the schema says


def schema_problems(given: Settings, schema: Schema) -> list[str]:
    """One line for every setting that the schema does not allow.

    Each line names the setting, what was given, what is allowed and, where it can be guessed,
    what to type.

    Examples
    --------
    >>> schema = {"type": "object", "additionalProperties": False,
    ...           "properties": {"epsilon": {"type": "number", "minimum": 0, "default": 0.0}}}
    >>> schema_problems({"epsilon": "1e-6"}, schema)
    ["epsilon is the text '1e-6', allowed is a number of at least 0: write 1.0e-06"]
    >>> schema_problems({"epsilonn": 0}, schema)
    ['epsilonn is no setting; did you mean epsilon?']
    """
    problems: dict[str, str] = {}
    errors = sorted(_VALIDATOR(schema).iter_errors(given), key=lambda error: str(error.path))
    for error in errors:
        for place, text in _explain(error):
            problems.setdefault(place, text)  # one line per setting is enough
    return list(problems.values())


def _explain(error: jsonschema.ValidationError) -> Iterator[tuple[str, str]]:
    place = _name(error.absolute_path)
    schema: Any = error.schema
    value: Any = error.instance
    if error.validator == "additionalProperties":
        known = [str(key) for key in schema.get("properties", {})]
        for key in value:
            if key not in schema.get("properties", {}):
                yield _join(place, key), _unknown(place, key, known)
    elif error.validator in ("minProperties", "maxProperties"):
        known = list(schema["properties"])
        if set(value) <= set(known):  # else they are named as unknown settings
            given = " and ".join(value) or "nothing"
            yield place, f"{place} has {given}, allowed is one of {', '.join(known)}"
    elif error.validator == "propertyNames" or "propertyNames" in error.absolute_schema_path:
        yield (
            f"{place}:{value}",
            f"{place} has {value!r}, allowed are names of small letters, digits and _ "
            "that start with a letter",
        )
    else:
        text = f"{place} is {_given(value)}, allowed is {allowed(schema)}"
        yield place, text + _what_to_type(value, schema)


def _unknown(place: str, key: object, known: Sequence[str]) -> str:
    close = difflib.get_close_matches(str(key), known, n=1)
    if close:
        return f"{_join(place, key)} is no setting; did you mean {_join(place, close[0])}?"
    inside = f" of {place}" if place else ""
    return f"{_join(place, key)} is no setting; the settings{inside} are {', '.join(known)}"


def _name(path: Sequence[str | int] | Any) -> str:
    name = ""
    for part in path:
        name = f"{name}[{part}]" if isinstance(part, int) else _join(name, part)
    return name


def _join(place: str, key: object) -> str:
    return f"{place}.{key}" if place else str(key)


def _given(value: Any) -> str:
    if value is None:
        return "empty"
    if isinstance(value, str):
        return f"the text {value!r}"
    if isinstance(value, dict):
        return "a block of settings"
    if isinstance(value, bool):
        return str(value).lower()
    text = repr(value)
    return text if len(text) <= 60 else f"{text[:57]}..."


def allowed(schema: Schema) -> str:
    """What a setting may be, in words.

    Examples
    --------
    >>> allowed({"type": ["integer", "null"], "minimum": 1})
    'a whole number of at least 1 or null'
    """
    if "enum" in schema:
        return " or ".join("null" if value is None else str(value) for value in schema["enum"])
    types = schema.get("type", [])
    return " or ".join(
        _allowed_type(kind, schema) for kind in ([types] if isinstance(types, str) else types)
    )


def _allowed_type(kind: str, schema: Schema) -> str:
    if kind in ("number", "integer"):
        name = "a number" if kind == "number" else "a whole number"
        bounds = [
            f"{word} {schema[key]}"
            for key, word in (
                ("minimum", "of at least"),
                ("exclusiveMinimum", "above"),
                ("maximum", "at most"),
                ("exclusiveMaximum", "below"),
            )
            if key in schema
        ]
        return " ".join([name, " and ".join(bounds)]).strip()
    if kind == "array":
        order = ", smallest first, none twice" if schema.get("increasing") else ""
        least, most = schema.get("minItems", 0), schema.get("maxItems")
        count = f" with at least {least} items" if least > 1 else " [a, b, ...]"
        if most is not None:
            count = f" of {most} items"
        return f"a list{count}, each {allowed(schema['items'])}{order}"
    if kind == "string" and "pattern" in schema:
        return "64 hexadecimal digits" if "0-9a-f" in schema["pattern"] else "a name"
    names = {
        "string": "a text that is not empty",
        "boolean": "true or false",
        "null": "null",
        "object": "a block of settings",
    }
    return names[kind]


def _what_to_type(value: Any, schema: Schema) -> str:
    """Ending of a line that guesses what was meant, or names the default."""
    types = schema.get("type", [])
    types = [types] if isinstance(types, str) else types
    if _is_number(value) and not _computable(value) and value - value == 0:
        return f", between {_LEAST:g} and {_MOST:g} in size"
    if isinstance(value, bool) and not {"boolean", "null"} & set(types):
        said = "yes, on and true" if value else "no, off and false"
        return f" (YAML reads {said} alike; put text into quotes)"
    if isinstance(value, str) and {"number", "integer"} & set(types):
        try:
            return f": write {_yaml_number(float(value))}"
        except ValueError:
            pass
    if isinstance(value, str) and "boolean" in types and value.lower() in ("true", "false"):
        return f": write {value.lower()} without quotes"
    if "enum" in schema and isinstance(value, str):
        close = difflib.get_close_matches(value, [str(v) for v in schema["enum"]], n=1)
        if close:
            return f": did you mean {close[0]}?"
    if "default" in schema and not isinstance(schema["default"], dict):
        default = schema["default"]
        shown = yaml.safe_dump(default, default_flow_style=True, width=10**6).splitlines()[0]
        return f" (default {shown})"
    return ""


def _yaml_number(value: float) -> str:
    """A number as YAML reads it: 1e-6 needs a point, infinity is .inf."""
    if math.isinf(value):
        return ".inf" if value > 0 else "-.inf"
    if value.is_integer() and abs(value) < 1e15:
        return str(int(value))
    mantissa, e, exponent = repr(value).partition("e")
    if e and "." not in mantissa:
        mantissa += ".0"
    return mantissa + e + exponent


_LEAST, _MOST = 1e-30, 1e30
"""Sizes of numbers: beyond them, squares and ratios leave what floats can hold."""


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _computable(value: float) -> bool:
    return value == 0 or _LEAST <= abs(value) <= _MOST


def _check_type(validator: Any, types: Any, value: Any, schema: Schema) -> Iterator[Any]:
    """The standard check, and numbers must be finite unless the schema says ``infinite``."""
    if isinstance(value, float) and (
        math.isnan(value) or (math.isinf(value) and not schema.get("infinite"))
    ):
        yield jsonschema.ValidationError("not finite")
        return
    if _is_number(value) and not _computable(value) and value - value == 0:  # finite
        yield jsonschema.ValidationError("not computable")
        return
    yield from jsonschema.Draft202012Validator.VALIDATORS["type"](validator, types, value, schema)


def _check_increasing(_validator: Any, wanted: bool, value: Any, _schema: Schema) -> Iterator[Any]:
    if wanted and isinstance(value, list):
        pairs = zip(value, value[1:], strict=False)
        try:
            in_order = all(a < b for a, b in pairs)
        except TypeError:
            in_order = True  # the items' own types are wrong, which is said elsewhere
        if not in_order:
            yield jsonschema.ValidationError("not increasing")


_VALIDATOR = jsonschema.validators.extend(  # type: ignore[no-untyped-call]  # its stub has no types
    jsonschema.Draft202012Validator,
    {"type": _check_type, "increasing": _check_increasing},
    # 15.0 is an integer to JSON schema; in the name of a file it would be another sampling.
    type_checker=jsonschema.Draft202012Validator.TYPE_CHECKER.redefine(
        "integer", lambda _, value: isinstance(value, int) and not isinstance(value, bool)
    ),
)
