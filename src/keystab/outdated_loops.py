"""Compiled loops that no longer belong to the code, and how they are forgotten.

numba keeps a compiled loop beside its module and compiles it again when that file changes, but not
when a loop that it calls in another file does. A checkout that was updated or edited would go on
with the old one. The workflow and the tests keep theirs apart, see
`keystab.fingerprint.folder_of_loops`; this serves whoever imports the library.
"""

from __future__ import annotations

import contextlib
import os
from pathlib import Path

PACKAGE_FOLDER = Path(__file__).parent


def forget_outdated(package_folder: Path = PACKAGE_FOLDER) -> int:
    """Remove the indices of compiled loops that are older than a module of the package.

    Nothing is done where the environment variable NUMBA_CACHE_DIR names another folder.

    Parameters
    ----------
    package_folder : Path
        Folder whose modules count, with the compiled loops in its ``__pycache__``.

    Returns
    -------
    int
        How many were removed. A loop without its index is compiled again.

    Examples
    --------
    >>> import tempfile
    >>> forget_outdated(Path(tempfile.mkdtemp()))
    0
    """
    if os.environ.get("NUMBA_CACHE_DIR"):
        return 0
    removed = 0
    # Another process may remove them too, and a package that is only readable keeps its own.
    with contextlib.suppress(OSError), os.scandir(package_folder) as modules:
        newest = max((m.stat().st_mtime for m in modules if m.name.endswith(".py")), default=0.0)
        for index in (package_folder / "__pycache__").glob("*.nbi"):
            if index.stat().st_mtime < newest:
                index.unlink()
                removed += 1
    return removed
