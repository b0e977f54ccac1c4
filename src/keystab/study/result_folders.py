"""Folders that results may go to, and files that settings may name, as people write them."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

__all__ = ["FOLDERS", "folder_problem", "normal_folder", "path_problems", "with_normal_paths"]

FOLDERS = ("results", "figures", "logs")

_OWN = {
    "snakefile", "makefile", "audit.lock", "docs.lock", "environment.lock", "pyproject.toml",
    "archive.md", "license", "benchmarks", "config", "docs", "profiles", "settings", "src", "tests",
    "tools", "workflow",
}  # fmt: skip
"""Names, in small letters, that no folder of results can have: they are the project's own."""

_PART = re.compile(r"\w[\w .+-]*(?<![ .])")
_NOT_IN_NAMES = re.compile(r"[{},\"'\\*?\[\]|<>;&$`]")


def folder_problem(text: str) -> str:
    """Say why a folder cannot be one that a run wrote to; nothing where it can.

    Examples
    --------
    >>> folder_problem("results/quick"), folder_problem("a/../workflow")
    ('', 'is no folder within the project; give names with / between them')
    >>> folder_problem("Workflow/rules")
    "is one of the project's own; give another"
    """
    parts = text.split("/")
    if len(text) > 200 or not (text.isprintable() and all(map(_PART.fullmatch, parts))):
        return "is no folder within the project; give names with / between them"
    if parts[0].casefold() in _OWN or f"{text.casefold()}/".startswith("results/reference/"):
        return "is one of the project's own; give another"
    return ""


def normal_folder(text: str, project: Path | str = ".") -> str:
    """The one way in which a folder is written: no ./ and final /, ~ as the home folder.

    Parameters
    ----------
    text : str
        As a person writes it.
    project : path
        What lies in it is written relative to it.

    Examples
    --------
    >>> normal_folder("results/t1/"), normal_folder("./results//t2"), normal_folder("a/../b")
    ('results/t1', 'results/t2', 'b')
    """
    path = os.path.normpath(os.path.expanduser(text))
    here = os.path.abspath(project)
    return (
        os.path.relpath(path, here) if os.path.isabs(path) and path.startswith(f"{here}/") else path
    )


def with_normal_paths(settings: Mapping[str, Any]) -> dict[str, Any]:
    """Settings in which folders are written in one way, and ~ is the home folder."""
    normal = dict(settings)
    for key in FOLDERS:
        if isinstance(normal.get(key), str):
            normal[key] = normal_folder(normal[key])
    if isinstance(normal.get("reference"), str):
        normal["reference"] = os.path.expanduser(normal["reference"])
    for about in normal.get("predictors", {}).get("pictures", {}).values():
        about["path"] = os.path.expanduser(about["path"])
    return normal


def path_problems(settings: Mapping[str, Any], project: Path) -> list[str]:
    """One line for every folder or file of the settings that rules cannot work with."""
    problems = [
        f"{key} is {settings[key]!r}, which {why}"
        for key in FOLDERS
        if (why := _why_not(settings[key], project))
    ]
    folders = [settings[key] for key in FOLDERS]
    if len(set(folders)) < len(folders):
        problems.append("results, figures and logs name the same folder; give three")
    problems += [
        f"{place} is {path!r}, allowed is a name without control characters and {{ }}; "
        "give the file another"
        for place, path in _files(settings)
        if not path.isprintable() or "{" in path or "}" in path
    ]
    return problems


def _why_not(text: str, project: Path) -> str:
    """Say why results cannot go to a folder; nothing where they can."""
    path = os.path.normpath(os.path.join(os.path.abspath(project), text))
    if not text.isprintable() or _NOT_IN_NAMES.search(text):
        return "has characters that folders cannot have; give letters, digits, blanks, _ . + -"
    if os.path.exists(path) and not os.path.isdir(path):
        return "is a file; give a folder"
    if os.path.isabs(text) or text.split("/")[0] == "..":
        own = os.path.abspath(project)
        around = f"{own}/".startswith(f"{path.rstrip('/')}/")
        return "holds the project itself; give a folder of its own" if around else ""
    return folder_problem(text)


def _files(settings: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    yield "reference", settings["reference"]
    for name, about in settings["predictors"]["pictures"].items():
        yield f"predictors.pictures.{name}.path", about["path"]
    for path in settings["pictures"]:
        yield "pictures", path
