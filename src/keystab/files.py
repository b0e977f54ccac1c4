"""Files that are either whole or absent."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

__all__ = ["written_whole"]


@contextmanager
def written_whole(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Let a block write a file or a folder that appears at `path` only once it is complete.

    The block receives a temporary sibling of `path`, with the same suffix, hidden by a leading
    dot. When the block ends normally the sibling replaces `path` in one rename; when it raises, or
    is interrupted, the sibling is deleted and `path` is left as it was. A process killed outright
    leaves the hidden sibling behind, never a half-written `path`.

    Parameters
    ----------
    path : path
        Where the result belongs. Missing parent folders are made.

    Yields
    ------
    pathlib.Path
        The temporary sibling. It does not exist yet.

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
    target = Path(path)
    target.parent.mkdir(parents=True, exist_ok=True)
    part = target.with_name(f".part-{os.getpid()}-{target.name}")
    _remove(part)
    try:
        yield part
        if target.is_dir():  # a folder cannot be renamed onto a folder that holds files
            old = target.with_name(f".old-{os.getpid()}-{target.name}")
            _remove(old)
            target.rename(old)
            part.rename(target)
            _remove(old)
        else:
            part.replace(target)
    finally:
        _remove(part)


def _remove(path: Path) -> None:
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)
