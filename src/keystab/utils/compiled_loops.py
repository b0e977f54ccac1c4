"""Compiled loops that no longer belong to the code, and how they are forgotten.

numba keeps a compiled loop beside its module and compiles it again when that file changes, but not
when a loop that it calls in another file does. A checkout that was updated would go on with the old
one. The workflow and the tests keep theirs apart, see
`keystab.provenance.code_digest.folder_of_loops`; this serves whoever uses the library in a
folder that can be written to: its public names, the command and stages forget when they are first
used; an import alone changes nothing. Loops kept elsewhere, in NUMBA_CACHE_DIR or in numba's folder
for packages that are only readable, are left alone, and an edit between the first use and that of a
loop is seen only if another one follows.
"""

from __future__ import annotations

import contextlib
import os
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path

PACKAGE_FOLDER = Path(__file__).parents[1]
STAMP = "compiled_from.txt"


def forget_outdated(package_folder: Path = PACKAGE_FOLDER) -> bool:
    """Remove the compiled loops of a package if its modules are not those of the last time.

    Names, sizes and times of the modules are compared with a stamp beside the loops: equal or not,
    whatever the clock says.

    Parameters
    ----------
    package_folder : Path
        Folder whose modules count, those of subpackages too, with their compiled loops in
        ``__pycache__`` beside them.

    Returns
    -------
    bool
        Whether the modules had changed.

    Examples
    --------
    >>> import tempfile
    >>> folder = Path(tempfile.mkdtemp())
    >>> forget_outdated(folder), forget_outdated(folder)
    (True, False)
    """
    kept = package_folder / "__pycache__"
    try:
        stamp = "".join(sorted(_modules(package_folder, "")))
        if (kept / STAMP).is_file() and (kept / STAMP).read_text() == stamp:
            return False
        # Indices first: data without one are never read, but a new index could find old data.
        for pattern in ("**/__pycache__/*.nbi", "**/__pycache__/*.nbc"):
            for path in package_folder.glob(pattern):
                with contextlib.suppress(FileNotFoundError):  # another process removes them too
                    path.unlink()
        kept.mkdir(exist_ok=True)
        (kept / STAMP).write_text(stamp)
    except OSError:  # only readable: numba keeps nothing here either
        return False
    return True


@cache
def tell_of_compilation() -> None:
    """Say on standard error, once, that loops of this package are compiled, if none were kept."""
    from numba.core import event

    class Teller(event.Listener):
        told = False

        def on_start(self, event: event.Event) -> None:
            module = event.data["dispatcher"].py_func.__module__
            if not self.told and module.startswith("keystab."):
                self.told = True
                print("keystab compiles its loops, which takes some seconds once", file=sys.stderr)

        def on_end(self, event: event.Event) -> None:
            pass

    event.register("numba:compile", Teller())  # type: ignore[no-untyped-call]


def _modules(folder: str | os.PathLike[str], within: str) -> Iterator[str]:
    """Name, size and time of each module in a folder and in those below it."""
    with os.scandir(folder) as entries:
        for entry in entries:
            if entry.name.endswith(".py"):
                about = entry.stat()
                yield f"{within}{entry.name} {about.st_size} {about.st_mtime_ns}\n"
            elif entry.name != "__pycache__" and entry.is_dir():
                yield from _modules(entry.path, f"{within}{entry.name}/")
