"""Checksums of all files of a folder, to find what was damaged, lost or added."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterable
from pathlib import Path

from keystab.errors import InputError
from keystab.utils.files import written_whole

__all__ = ["checksums", "list_of_files", "read_sums", "verify", "write_checksums"]


def checksums(path: str | os.PathLike[str]) -> str:
    """List the digests of all files of a folder, one line each, in the format of ``sha256sum``.

    The same contents give the same text, wherever the folder lies. Hidden files do not count: they
    belong to the workflow engine.

    Parameters
    ----------
    path : path
        A folder.

    Returns
    -------
    str
        Lines of 64 hexadecimal digits, two spaces and the file's path within the folder, in the
        order of the paths. ``sha256sum -c`` run inside the folder checks it.

    Raises
    ------
    InputError
        If there is no such folder, or no file in it.
    """
    lines = [f"{digest}  {name}\n" for name, digest in _digests(Path(path)).items()]
    if not lines:
        raise InputError(f"{path}: no folder with files to take checksums of")
    return "".join(lines)


def list_of_files(paths: Iterable[str | os.PathLike[str]]) -> str:
    """List the digests of files, one line each, in the format of ``sha256sum``.

    The same files give the same text, in whatever order they come.

    Parameters
    ----------
    paths : iterable of path
        Files; they are named as given.

    Returns
    -------
    str
        Lines of 64 hexadecimal digits, two spaces and a path, in the order of the paths.
    """
    return "".join(f"{_digest(path)}  {path.as_posix()}\n" for path in sorted(map(Path, paths)))


def read_sums(text: str) -> dict[str, str]:
    r"""Digests by file name, from a list as ``sha256sum`` writes it.

    Examples
    --------
    >>> read_sums("ab  one.csv\n")
    {'one.csv': 'ab'}
    """
    lines = (line.partition("  ") for line in text.split("\n"))
    return {name: digest for digest, _, name in lines if name}


def write_checksums(path: str | os.PathLike[str], checksum_file: str | os.PathLike[str]) -> None:
    """Write the `checksums` of a folder to a file beside it.

    Parameters
    ----------
    path : path
        The folder.
    checksum_file : path
        The file, by custom the folder's name with ``.sha256`` appended.

    Raises
    ------
    InputError
        If there is no such folder, or no file in it.
    """
    text = checksums(path)
    with written_whole(checksum_file) as part:
        part.write_text(text, encoding="utf-8", newline="")


def verify(path: str | os.PathLike[str], checksum_file: str | os.PathLike[str]) -> None:
    """Check a folder against its checksums.

    Parameters
    ----------
    path : path
        The folder.
    checksum_file : path
        The file that `write_checksums` wrote.

    Raises
    ------
    InputError
        If files are damaged, missing or new; the first of them is named. Also if there are
        no checksums.
    """
    try:
        noted = read_sums(Path(checksum_file).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        raise InputError(f"{checksum_file}: no readable checksums; make the store again") from None
    found = _digests(Path(path))
    problems = [f"{name} is missing" for name in noted if name not in found]
    problems += [
        f"{name} is damaged" for name in noted if name in found and found[name] != noted[name]
    ]
    problems += [
        f"{name} was not there when checksums were taken" for name in found if name not in noted
    ]
    if problems:
        more = f", and {len(problems) - 1} more" if len(problems) > 1 else ""
        raise InputError(f"{path}: {problems[0]}{more}; delete the store and make it again")


def _digests(folder: Path) -> dict[str, str]:
    """SHA-256 of every file that is not hidden, by path within the folder, sorted."""
    names = sorted(
        file.relative_to(folder).as_posix() for file in folder.rglob("*") if file.is_file()
    )
    digests = {}
    for name in names:
        if not any(part.startswith(".") for part in name.split("/")):
            digests[name] = _digest(folder / name)
    return digests


def _digest(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
