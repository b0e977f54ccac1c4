"""What a run says about itself in ``archive.json``; it is read with distrust."""

from __future__ import annotations

import dataclasses
import json
import platform
import re
from pathlib import Path
from typing import Any, TypeGuard

from keystab._version import __version__
from keystab.errors import InputError
from keystab.study.result_folders import folder_problem

__all__ = [
    "ABOUT",
    "AUDIT_TABLES",
    "FIGURES_BESIDE",
    "LEFT_OUT",
    "LEFT_OUT_COLUMNS",
    "SUMS",
    "About",
    "about_of",
    "arithmetic",
    "folder_problem",
    "read_about",
]

ABOUT = "archive.json"
SUMS = "SHA256SUMS"
LEFT_OUT = "left-out.csv"
LEFT_OUT_COLUMNS = ["path", "bytes", "sha256", "rule"]
AUDIT_TABLES = ("audit.csv", "audit_octaves.csv", "audit_phases.csv")
FIGURES_BESIDE = ("audit.pdf", "audit.png", "scenes.pdf", "scenes.png")
"""What an audit and the corpus of scenes leave beside the tables and figures of a study, of which
they are no part."""
MOST_BYTES_OF_ABOUT = 1_000_000

_DIGEST = re.compile("[0-9a-f]{64}")
_VERSION = re.compile(r"[\w.+-]{1,30}", re.ASCII)
_MOST_LETTERS, _MOST_OVERLAYS = 1000, 50


@dataclasses.dataclass(frozen=True)
class About:
    """What a run says about itself, in ``archive.json``.

    Parameters
    ----------
    keystab : str
        Version that wrote it.
    lock, settings : str
        SHA-256 of the lock file and of the settings.
    overlays : tuple of str
        Files of settings, laid over the project's own, by their places in the archive.
    results, figures, logs : str
        Folders, relative to the project.
    arithmetic : str
        See `arithmetic`.
    zlib : str
        Version of the library that compressed what PDF figures hold.
    """

    keystab: str
    lock: str
    settings: str
    overlays: tuple[str, ...]
    results: str
    figures: str
    logs: str
    arithmetic: str
    zlib: str


def read_about(folder: Path) -> About:
    """Read what a run says about itself, in a folder that was checked or is the project's own.

    The committed reference may be of an earlier version: it is compared with until it is renewed.

    Raises
    ------
    InputError
        If it does not say it.
    """
    path = folder / ABOUT
    if not path.is_file() or path.stat().st_size > MOST_BYTES_OF_ABOUT:
        raise InputError(f"{path}: no such file; make reference or make archive writes it")
    try:
        return about_of(path.read_bytes(), any_version=True)
    except InputError as error:
        raise InputError(f"{path} {error}") from None


def about_of(data: bytes, any_version: bool = False) -> About:
    """Check what a run says about itself.

    Parameters
    ----------
    data : bytes
        The file.
    any_version : bool, optional
        Whether another version may have written it.

    Raises
    ------
    InputError
        If another version wrote it, something is missing or of another type, or a folder could lie
        outside or be one of the project's own. The name of the file is to be put before the text.

    Examples
    --------
    >>> about_of(b'{"keystab": "0.0.1"}')  # doctest: +ELLIPSIS
    Traceback (most recent call last):
    keystab.errors.InputError: was written by keystab 0.0.1, and this is ...
    """
    try:
        said: Any = json.loads(data.decode("utf-8"))
    except (ValueError, RecursionError):
        raise InputError("is not JSON; make archive writes it") from None
    said = said if isinstance(said, dict) else {}
    if not _is_text(version := said.get("keystab")) or not _VERSION.fullmatch(version):
        raise InputError("says nothing about a run; make archive writes it")
    if any_version:
        said = {"zlib": "not said", **said}  # 0.1.0 did not
    elif version != __version__:
        raise InputError(
            f"was written by keystab {version}, and this is {__version__}: check it with that "
            "version"
        )
    texts = ("lock", "settings", "results", "figures", "logs", "arithmetic", "zlib")
    overlays = said.get("overlays")
    if (
        not all(_is_text(said.get(key)) for key in texts)
        or not all(_DIGEST.fullmatch(said[key]) for key in ("lock", "settings"))
        or not isinstance(overlays, list)
        or not all(map(_is_text, overlays))
        or len(overlays) > _MOST_OVERLAYS
        or len(set(overlays)) < len(overlays)
    ):
        raise InputError("says nothing about a run; make archive writes it")
    for key in ("results", "figures", "logs"):
        if problem := folder_problem(said[key]):
            raise InputError(f"names as {key} {said[key][:80]!a}, which {problem}")
    about = {key: said[key] for key in texts}
    return About(version, overlays=tuple(overlays), **about)


def _is_text(value: Any) -> TypeGuard[str]:
    """Whether something is text as a run says it: short, without what a terminal would obey."""
    return isinstance(value, str) and len(value) <= _MOST_LETTERS and value.isprintable()


def arithmetic() -> str:
    """What the last digits of results depend on: the processor as numpy and its BLAS see it.

    Two machines of which this is the same run the same instructions.
    """
    import numpy as np
    import threadpoolctl

    blas = {
        str(library.get("architecture"))
        for library in threadpoolctl.threadpool_info()
        if library["user_api"] == "blas"
    }
    simd = np.show_config(mode="dicts").get("SIMD Extensions", {}).get("found", [])
    return " ".join([platform.system(), platform.machine(), *sorted(blas), *sorted(simd)])
