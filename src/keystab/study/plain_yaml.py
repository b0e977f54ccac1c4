"""YAML that a person and the program read alike; what they would not is refused in one line.

YAML 1.1 drops the first of two equal keys, reads 010 as 8, 1:30 as 90, 2024-01-31 as a date and,
where a name stands, no as false. None of this is an error to its parser, and all of it would change
settings without a word.
"""

from __future__ import annotations

import datetime
import os
import re
from pathlib import Path
from typing import Any

import yaml

from keystab.errors import InputError

__all__ = ["plain_yaml", "read_plain_yaml"]

MOST_DEPTH, MOST_VALUES, MOST_SHOWN = 50, 100_000, 40
_LOADER: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)  # ten times as fast
_OCTAL = re.compile(r"[-+]?0[0-7_]+")
_MERGE = "tag:yaml.org,2002:merge"


def read_plain_yaml(path: str | os.PathLike[str]) -> Any:
    """Read a file of plain YAML in UTF-8.

    Raises
    ------
    InputError
        As `plain_yaml`, and if the file cannot be read or is not UTF-8.
    """
    try:
        data = Path(path).read_bytes()
    except (OSError, ValueError) as error:
        why = getattr(error, "strerror", None) or "no name of a file"
        raise InputError(f"{path}: cannot be read ({why})") from None
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise InputError(
            f"{path}: is not UTF-8 (line {line}); save it again as UTF-8, which editors offer"
        ) from None
    return plain_yaml(text, str(path))


def plain_yaml(text: str, name: str) -> Any:
    """Read plain YAML.

    Parameters
    ----------
    text : str
        The text.
    name : str
        What errors call it.

    Returns
    -------
    dict, list, str, number, bool or None

    Raises
    ------
    InputError
        In one line, if it is not YAML, too long or too deep, or is read otherwise than it looks.

    Examples
    --------
    >>> plain_yaml("step: 10", "mine.yaml")
    {'step': 10}
    >>> plain_yaml("step: 010", "mine.yaml")
    Traceback (most recent call last):
    keystab.errors.InputError: mine.yaml: line 1: YAML reads 010 as 8; write 8 or 10
    """
    try:
        _limit(text, name)
        loader = _LOADER(text)
        try:
            node = loader.get_single_node()
            if node is None:
                return None
            _Reader(loader, name).check(node, 0)
            return loader.construct_document(node)
        finally:
            loader.dispose()
    except InputError:  # is a ValueError, too
        raise
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        where = f" in line {mark.line + 1}" if mark else ""
        why = getattr(error, "problem", None) or getattr(error, "reason", None) or "not readable"
        raise InputError(f"{name}: is not YAML{where}: {' '.join(str(why).split())}") from None
    except (ValueError, ArithmeticError, TypeError, RecursionError) as error:
        raise InputError(
            f"{name}: is not plain YAML: {' '.join(str(error).split())[:80]}"
        ) from None


def _limit(text: str, name: str) -> None:
    """Refuse what would exhaust the stack or the memory, before anything is built from it."""
    depth = values = 0
    for event in yaml.parse(text, Loader=_LOADER):
        values += isinstance(event, yaml.NodeEvent)
        depth += isinstance(event, yaml.CollectionStartEvent)
        depth -= isinstance(event, yaml.CollectionEndEvent)
        if depth > MOST_DEPTH or values > MOST_VALUES:
            raise InputError(f"{name}: {_TOO_MUCH}")


_TOO_MUCH = (
    f"more than {MOST_VALUES} values, or more than {MOST_DEPTH} levels of brackets or blocks"
)


class _Reader:
    """Asks of every value whether it is what it looks like."""

    def __init__(self, loader: Any, name: str) -> None:
        self.loader = loader
        self.name = name
        self.left = MOST_VALUES  # also of those that aliases repeat

    def check(self, node: yaml.Node, depth: int) -> None:
        self.left -= 1
        if depth > MOST_DEPTH or self.left < 0:
            raise InputError(f"{self.name}: {_TOO_MUCH}")
        if isinstance(node, yaml.MappingNode):
            self._names(node)
            for _, value in node.value:
                self.check(value, depth + 1)
        elif isinstance(node, yaml.SequenceNode):
            for value in node.value:
                self.check(value, depth + 1)
        elif isinstance(node, yaml.ScalarNode):
            self._value(node)

    def _names(self, node: yaml.MappingNode) -> None:
        lines: dict[str, int] = {}
        for key, _ in node.value:
            line = key.start_mark.line + 1
            if key.tag == _MERGE:
                continue
            if not isinstance(key, yaml.ScalarNode):
                raise self._wrong(line, "a list or block stands where a name is expected")
            read = self.loader.construct_object(key, deep=True)
            name = _shown(key.value) or "(empty)"
            if not isinstance(read, str):
                why = f"the name {name} is read as {_word(read)}; names are words"
                raise self._wrong(line, f"{why}: put it into quotes")
            if read in lines:
                why = f"{name} stands in line {lines[read]} already, and one of the two"
                raise self._wrong(line, f"{why} would be dropped; put them together")
            lines[read] = line

    def _value(self, node: yaml.ScalarNode) -> None:
        if node.style in ("'", '"', "|", ">"):
            return
        line, text = node.start_mark.line + 1, node.value[:MOST_SHOWN]
        kind = node.tag.rpartition(":")[2]
        if kind == "timestamp":
            raise self._wrong(line, f"YAML reads {text} as a date; put it into quotes")
        if kind in ("int", "float") and ":" in text:
            read = self.loader.construct_object(node)
            raise self._wrong(
                line, f"YAML reads {text} as {read}, in sixties; write {read}, or '{text}' for text"
            )
        if kind == "int" and _OCTAL.fullmatch(node.value):
            read = self.loader.construct_object(node)
            meant = int(text.replace("_", ""))
            if read != meant:
                raise self._wrong(line, f"YAML reads {text} as {read}; write {read} or {meant}")

    def _wrong(self, line: int, why: str) -> InputError:
        return InputError(f"{self.name}: line {line}: {why}")


def _shown(text: str) -> str:
    """Start of a text, without what a terminal would obey."""
    return "".join(it if it.isprintable() else "?" for it in text[:MOST_SHOWN])


def _word(value: Any) -> str:
    if value is None:
        return "nothing"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, datetime.date):
        return "a date"
    return f"the number {str(value)[:MOST_SHOWN]}"
