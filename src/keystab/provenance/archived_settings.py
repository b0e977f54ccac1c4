"""Settings of an archive, taken as data: what a stranger may say, and what is put in its place.

Nothing of them becomes an option, a profile or a folder of this machine. They are read as plain
values, checked against the schema that is here, and written again; names of folders are replaced by
those of the archive's own record, which were checked, and paths must stay within the project.
"""

from __future__ import annotations

import re
import shutil
import struct
from collections.abc import Iterator
from pathlib import Path, PurePosixPath
from typing import IO, Any, NamedTuple

import yaml

from keystab.errors import InputError
from keystab.provenance.study_folder import settings_digest
from keystab.provenance.unpacking import Unpacked
from keystab.study.feasibility import every_set
from keystab.study.plain_yaml import plain_yaml, read_plain_yaml
from keystab.study.settings import Settings, checked, merge, read_yaml

__all__ = [
    "FILE",
    "ArchivedSettings",
    "differing",
    "place_settings",
    "plain_settings",
    "settings_of",
]

FILE = "archived_settings.yaml"
"""Where the settings of an archive are put in a copy of the project, below its folder."""

_MOST_BYTES, _MOST_DEPTH, _MOST_VALUES = 100_000, 20, 2000
_MOST_SETS, _MOST_VIEWS, _MOST_PAGES = 200, 20_000, 20
"""The study's own settings have 500 values, and 1000 views in 40 sets."""

_MOST_BYTES_OF_TIFF = 1 << 40
_TIFF = {b"II*\0": ("<L", "<H", 12), b"MM\0*": (">L", ">H", 12)}
_TIFF |= {b"II+\0": ("<Q", "<Q", 20), b"MM\0+": (">Q", ">Q", 20)}
"""First bytes of a TIFF: how it writes a place, a number of entries, and the size of an entry."""

_OVERLAY = re.compile(r"settings/[0-9]+-\w[^/]*")
_TEXT = re.compile(r"[\w./+-][\w ./+-]*")
_OPTION = re.compile(r"(^| )-")


class ArchivedSettings(NamedTuple):
    """Settings of an archive.

    Parameters
    ----------
    given : dict
        What is laid over the project's own; folders are those of the archive.
    complete : dict
        All settings.
    pictures : list of str
        Paths of files that they name.
    """

    given: Settings
    complete: Settings
    pictures: list[str]

    @property
    def digest(self) -> str:
        """That of all settings, see `keystab.provenance.study_folder.settings_digest`."""
        return settings_digest(self.complete)


def settings_of(archive: Unpacked, project: Path) -> ArchivedSettings:
    """Read what the settings of an archive say, and what follows for all settings.

    Parameters
    ----------
    archive : Unpacked
    project : path
        The project that is here, whose schema and settings the archive's are laid over.

    Returns
    -------
    ArchivedSettings

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
    schema = read_plain_yaml(project / "workflow/schemas/config.schema.yaml")
    for key in ("results", "figures", "logs"):
        folder = getattr(archive.about, key)
        if given.get(key, folder) != folder:
            raise InputError(f"settings say {key}: {str(given[key])[:80]!a}, archive.json another")
        if own.get(key, key) != folder:
            given[key] = folder
    merge(own, given)
    try:
        complete = checked(own, schema)
    except InputError as error:
        first, *more = str(error).split("\n")
        told = f", and {len(more)} more" if more else ""
        raise InputError(f"settings: {first[:200]}{told}") from None
    sets = every_set(complete)
    views = sum(it.get("n_views", 1) for it in sets.values())
    if len(sets) > _MOST_SETS or views > _MOST_VIEWS:
        raise InputError(
            f"settings: {len(sets)} sets of {views} views, those of an archive have at most "
            f"{_MOST_SETS} of {_MOST_VIEWS}"
        )
    paths = list(_paths(complete))
    for place, path in paths:
        _check_path(place, path)
    return ArchivedSettings(given, complete, [path for _, path in paths])


def differing(one: Any, other: Any, place: str = "") -> Iterator[str]:
    """Names of settings that are not the same in two blocks of them.

    Examples
    --------
    >>> list(differing({"a": {"b": 1, "c": 2}}, {"a": {"b": 1}, "d": 3}))
    ['a.c', 'd']
    """
    if not (isinstance(one, dict) and isinstance(other, dict)):
        if one != other:
            yield place
        return
    for key in sorted({*one, *other}, key=str):
        yield from differing(one.get(key), other.get(key), f"{place}.{key}" if place else str(key))


def place_settings(archive: Unpacked, project: Path, scratch: Path) -> list[str]:
    """Put the settings of an archive, and pictures that they name, into a copy of the project.

    Parameters
    ----------
    archive : Unpacked
    project : path
        The project that is here.
    scratch : path
        The copy, in which all files are written.

    Returns
    -------
    list of str
        Overlays of the run in the copy: none, or `FILE`.

    Raises
    ------
    InputError
        As `settings_of`.
    """
    given, _, pictures = settings_of(archive, project)
    for path in pictures:
        source, target = archive.folder / path, scratch / path
        if source.is_file() and not target.exists() and path.startswith("config/images/"):
            _check_picture(source, path)
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(source, target)
    if not given:
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
        In one line, if it is too long or too deep, has tags, refers to parts of itself, is no
        block of settings, or holds text that settings never hold.

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
        depth, values = 0, 0
        for event in yaml.parse(text, Loader=loader):
            if isinstance(event, yaml.AliasEvent) or getattr(event, "anchor", None):
                raise InputError(f"{name}: refers to parts of itself; settings are written out")
            if getattr(event, "tag", None):
                raise InputError(f"{name}: has tags; settings are not plain YAML with them")
            values += isinstance(event, yaml.ScalarEvent)
            depth += isinstance(event, yaml.CollectionStartEvent)
            depth -= isinstance(event, yaml.CollectionEndEvent)
            if depth > _MOST_DEPTH or values > _MOST_VALUES:
                raise InputError(f"{name}: too many values, or nested too deeply for settings")
        given = plain_yaml(text, name) or {}
    except InputError:
        raise
    except (ValueError, ArithmeticError, RecursionError, yaml.YAMLError):
        raise InputError(f"{name}: is not plain YAML in UTF-8") from None
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
    for block in ("predictors", "floor"):
        for name, picture in settings.get(block, {}).get("pictures", {}).items():
            yield f"{block}.pictures.{name}.path", picture["path"]
    for path in settings.get("pictures", ()):
        yield "pictures", path


def _check_path(place: str, path: str) -> None:
    parts = PurePosixPath(path).parts
    if path.startswith(("/", "~", "-")) or ".." in parts or any(it.startswith(".") for it in parts):
        raise InputError(
            f"{place} is {path[:80]!a}, a file outside the archive: what was made from it cannot "
            "be checked; the picture belongs into config/images before the run is packed"
        )


def _check_picture(source: Path, path: str) -> None:
    """Refuse what a decoder would run or read for long: programs, and endless lists of pages."""
    with source.open("rb") as file:
        start = file.read(8)
        if start.startswith((b"\x89PNG\r\n\x1a\n", b"\xff\xd8\xff")):
            return
        if start[:4] in _TIFF and _pages(file, *_TIFF[start[:4]]) <= _MOST_PAGES:
            return
    raise InputError(f"{path}: no PNG, JPEG or TIFF that holds one picture")


def _pages(file: IO[bytes], place: str, number: str, size: int) -> int:
    """Count the pages of a TIFF, up to one more than are allowed."""

    def read(kind: str) -> int:
        data = file.read(struct.calcsize(kind))
        return struct.unpack(kind, data)[0] if len(data) == struct.calcsize(kind) else 0

    file.seek(struct.calcsize(place))  # behind the first bytes, which are as long as a place
    found, page = 0, read(place)
    while page and found <= _MOST_PAGES:
        file.seek(min(page, _MOST_BYTES_OF_TIFF))
        entries = read(number)
        file.seek(min(size * entries, _MOST_BYTES_OF_TIFF), 1)
        page = read(place)
        found += 1
    return found
