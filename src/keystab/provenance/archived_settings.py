"""Settings of an archive, taken as data: what a stranger may say, and what is put in its place.

Nothing of them becomes an option, a profile or a folder of this machine. They are read as plain
values, checked against the schema that is here, and written again; names of folders are replaced by
those of the archive's own record, which were checked, and paths must stay within the project.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path, PurePosixPath
from typing import Any

import yaml

from keystab.errors import InputError
from keystab.provenance.unpacking import Unpacked
from keystab.study.settings import Settings, checked, merge, read_yaml

__all__ = ["FILE", "plain_settings", "place_settings"]

FILE = "archived_settings.yaml"
"""Where the settings of an archive are put in a copy of the project, below its folder."""

_MOST_BYTES, _MOST_DEPTH = 100_000, 20
_OVERLAY = re.compile(r"settings/[0-9]+-[^/]+")
_TEXT = re.compile(r"[\w./+-][\w ./+-]*")
_OPTION = re.compile(r"(^| )-")


def place_settings(archive: Unpacked, project: Path, scratch: Path) -> list[str]:
    """Put the settings of an archive, and pictures that they name, into a copy of the project.

    Parameters
    ----------
    archive : Unpacked
    project : path
        The project that is here, whose schema and settings the archive's are laid over.
    scratch : path
        The copy, in which all files are written.

    Returns
    -------
    list of str
        Overlays of the run in the copy: none, or `FILE`.

    Raises
    ------
    InputError
        In one line, if the settings are not what `keystab.provenance.archive.pack` packs.
    """
    given: Settings = {}
    for name in archive.about.overlays:
        if not _OVERLAY.fullmatch(name) or name not in archive.digests:
            raise InputError(f"{name[:80]!a}: no file of settings of this archive")
        merge(given, plain_settings((archive.folder / name).read_bytes(), name))
    own = read_yaml(project / "config/config.yaml")
    schema = yaml.safe_load(
        (project / "workflow/schemas/config.schema.yaml").read_text(encoding="utf-8")
    )
    folders = {key: getattr(archive.about, key) for key in ("results", "figures", "logs")}
    needed = bool(given) or any(own.get(key, key) != folder for key, folder in folders.items())
    merge(given, folders)
    merge(own, given)
    complete = checked(own, schema)
    for place, path in _paths(complete):
        _check_path(place, path)
        source, target = archive.folder / path, scratch / path
        if source.is_file() and not target.exists() and path.startswith("config/images/"):
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_bytes(source.read_bytes())
    if not needed:
        return []
    (scratch / FILE).write_text(yaml.safe_dump(given, sort_keys=False), encoding="utf-8")
    return [FILE]


def plain_settings(data: bytes, name: str) -> Settings:
    """Read settings that a stranger wrote.

    Parameters
    ----------
    data : bytes
        YAML in UTF-8.
    name : str
        What errors call it.

    Raises
    ------
    InputError
        In one line, if it is too long or too deep, refers to parts of itself, says a name twice,
        is no block of settings, or holds text that settings never hold.

    Examples
    --------
    >>> plain_settings(b"detector: {epsilon: 1.0e-6}", "mine.yaml")
    {'detector': {'epsilon': 1e-06}}
    >>> plain_settings(b"results: '; rm -rf .'", "mine.yaml")
    Traceback (most recent call last):
    keystab.errors.InputError: mine.yaml: '; rm -rf .' is no text of a setting
    """
    if len(data) > _MOST_BYTES:
        raise InputError(f"{name}: more than {_MOST_BYTES} bytes are no settings of this study")
    loader = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
    try:
        text = data.decode("utf-8")
        depth = 0
        for event in yaml.parse(text, Loader=loader):
            if isinstance(event, yaml.AliasEvent):
                raise InputError(f"{name}: refers to parts of itself; settings are written out")
            depth += isinstance(event, yaml.CollectionStartEvent)
            depth -= isinstance(event, yaml.CollectionEndEvent)
            if depth > _MOST_DEPTH:
                raise InputError(f"{name}: is nested too deeply for settings")
        given = yaml.load(text, Loader=loader) or {}
    except (ValueError, RecursionError, yaml.YAMLError):
        raise InputError(f"{name}: is not YAML in UTF-8") from None
    if not isinstance(given, dict):
        raise InputError(f"{name}: holds no settings")
    for text in _texts(given):
        if not _TEXT.fullmatch(text) or _OPTION.search(text):
            raise InputError(f"{name}: {text[:40]!a} is no text of a setting")
    return given


def _texts(given: Any) -> Iterator[str]:
    """All names and values of settings that are text."""
    if isinstance(given, dict):
        for key, value in given.items():
            yield str(key)
            yield from _texts(value)
    elif isinstance(given, list):
        for value in given:
            yield from _texts(value)
    elif isinstance(given, str):
        yield given


def _paths(settings: Settings) -> Iterator[tuple[str, str]]:
    """Paths of files that settings name, each with its place."""
    if "reference" in settings:
        yield "reference", settings["reference"]
    for name, picture in settings.get("predictors", {}).get("pictures", {}).items():
        yield f"predictors.pictures.{name}.path", picture["path"]
    for path in settings.get("pictures", ()):
        yield "pictures", path


def _check_path(place: str, path: str) -> None:
    parts = PurePosixPath(path).parts
    if path.startswith(("/", "~", "-")) or ".." in parts or any(it.startswith(".") for it in parts):
        raise InputError(
            f"{place} is {path[:80]!a}, a file outside the archive: what was made from it cannot "
            "be checked; the picture belongs into config/images before the run is packed"
        )
