"""Files that are either whole or absent."""

from __future__ import annotations

import os
import re
import shutil
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from keystab.errors import InputError

__all__ = ["check_writable", "written_whole"]


def check_writable(path: str | os.PathLike[str], suffixes: Sequence[str] = ()) -> None:
    """Raise unless a file can be written; to be asked before anything expensive is done.

    Parameters
    ----------
    path : path
        File to be written later. It and its folder need not exist.
    suffixes : sequence of str, optional
        Formats to choose from, such as ``.csv``, in lower case; any by default.

    Raises
    ------
    InputError
        If the suffix is none of `suffixes`, a folder or a device is in the place of the file, its
        folder cannot be made or written to, or `path` is a link that leads nowhere.

    Examples
    --------
    >>> check_writable("keypoints.csv", (".csv", ".parquet"))
    """
    path = Path(path)
    if suffixes and path.suffix.lower() not in suffixes:
        allowed = " or ".join(filter(None, (", ".join(suffixes[:-1]), suffixes[-1])))
        raise InputError(f"{path}: cannot write '{path.suffix}'; use {allowed}")
    place = _place(path)
    if os.path.isdir(place):
        raise InputError(f"{path} is a folder; give a file name")
    _check_folder(place)


@contextmanager
def written_whole(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Let a block write a file or a folder that appears at `path` only once it is complete.

    The block receives a temporary sibling of `path`, with the same suffix, hidden by a leading
    dot. When the block ends normally the sibling replaces `path` by renaming; when it raises, or
    is interrupted, the sibling is deleted and `path` is left as it was. A process killed outright
    leaves hidden siblings behind, never a half-written `path`; the next one that writes `path`
    removes them. A file replaces only a file, and a
    folder only a folder. Where `path` is a symbolic link, all this happens where it leads to, and
    the link stays.

    Parameters
    ----------
    path : path
        Where the result belongs. Missing parent folders are made.

    Yields
    ------
    pathlib.Path
        The temporary sibling. It does not exist yet.

    Raises
    ------
    InputError
        If the folder of `path` cannot be made or written to, the block wrote a file where there
        is a folder, or the other way round, there is a device, or `path` is a link in a circle.
    OSError
        As the block raised it, but naming `path` instead of the temporary sibling.

    Examples
    --------
    >>> import tempfile
    >>> target = Path(tempfile.mkdtemp()) / "answer.txt"
    >>> with written_whole(target) as part:
    ...     _ = part.write_text("42")
    ...     target.exists()
    False
    >>> target.read_text()
    '42'
    """
    path = Path(path)
    target = _place(path)
    _check_folder(target)
    target.parent.mkdir(parents=True, exist_ok=True)
    _remove_leftovers(target)
    # Writers go by the suffix, which may differ from that of the file that a link leads to.
    suffix = path.suffix if path.suffix != target.suffix else ""
    part = target.with_name(f".part-{os.getpid()}-{target.name}{suffix}")
    try:
        try:
            _remove(part)
            yield part
            _put(part, target, path)
        finally:
            _remove(part)
    except OSError as error:
        _name(path, part, error)
        raise


def _place(path: Path) -> Path:
    """Where a path leads to: itself, or what it points to where it is a symbolic link."""
    place = Path(os.path.realpath(path)) if os.path.islink(path) else path
    if os.path.islink(place):
        raise InputError(f"{path} is a link that leads in a circle; give a file name")
    if os.path.exists(place) and not (os.path.isfile(place) or os.path.isdir(place)):
        raise InputError(f"{path} is neither a file nor a folder; give another name")
    return place


def _put(part: Path, target: Path, path: Path) -> None:
    """Rename a complete file or folder to where it belongs; `path` is what that is called."""
    if not target.is_dir():
        if part.is_dir() and target.exists():
            raise InputError(f"{path} is a file; give the name of a folder")
        part.replace(target)
        return
    part.stat()  # raises if the block wrote nothing
    if not part.is_dir():
        raise InputError(f"{path} is a folder; give a file name")
    # A folder cannot be renamed onto a folder that holds files.
    old = target.with_name(f".old-{os.getpid()}-{target.name}")
    _remove(old)
    target.rename(old)
    try:
        part.rename(target)
    except BaseException:
        old.rename(target)
        raise
    _remove(old)


def _remove_leftovers(target: Path) -> None:
    """Remove the hidden siblings of a path that killed processes left."""
    # After the name there may be the suffix of a link to it.
    pattern = re.compile(rf"\.(?:part|old)-(\d+)-{re.escape(target.name)}(?:\.[^.]*)?")
    for sibling in target.parent.iterdir():
        if (found := pattern.fullmatch(sibling.name)) and not _runs(int(found[1])):
            _remove(sibling)


def _runs(pid: int) -> bool:
    """Whether there is a process of this number, as far as that can be asked."""
    if os.name != "posix":  # where signal 0 is a real one
        return True
    try:
        os.kill(pid, 0)
    except (ProcessLookupError, OverflowError):
        return False
    except OSError:  # somebody else's
        return True
    return True


def _check_folder(path: Path) -> None:
    """Raise unless the folder of a path can be written to, or made where it does not exist."""
    folder = path.absolute().parent
    while not os.path.lexists(folder):
        folder = folder.parent
    if not os.path.isdir(folder):
        raise InputError(f"{path}: {folder} is no folder; give another place")
    if not os.access(folder, os.W_OK | os.X_OK):
        raise InputError(f"{path}: the folder {folder} cannot be written to; give another place")


def _name(target: Path, part: Path, error: OSError) -> None:
    """Make an error speak of the file that was asked for; of a full disk it names no file."""

    def named(text: object) -> str:
        return str(text).replace(str(part), str(target))

    if error.errno is None:  # how numpy says that less was written than it had
        error.args = tuple(map(named, error.args))
        error.strerror, error.filename = ", ".join(error.args), str(target)
    else:
        error.strerror = named(error.strerror)
        error.filename = str(target) if error.filename is None else named(error.filename)


def _remove(path: Path) -> None:
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)
