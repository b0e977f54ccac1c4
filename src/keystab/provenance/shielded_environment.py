"""Variables under which Snakemake and its jobs do the same, whatever a person's own ones hold."""

from __future__ import annotations

import getpass
import os
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path

from keystab.provenance.code_digest import folder_of_loops

__all__ = ["shielded"]

_OF_PYTHON_KEPT = {
    "PYTHONDONTWRITEBYTECODE",
    "PYTHONHASHSEED",
    "PYTHONPROFILEIMPORTTIME",
    "PYTHONPYCACHEPREFIX",
    "PYTHONUNBUFFERED",
}
"""Of the variables that Python reads, those that change neither what is imported nor results."""


def shielded(
    variables: Mapping[str, str] | None = None, home: Path | None = None
) -> dict[str, str]:
    """Variables for a Snakemake that answers to the study's own settings alone.

    Snakemake reads profiles that ``SNAKEMAKE_PROFILE`` names, in the home folder or elsewhere: they
    can say that nothing reruns, that nothing is printed, or what the study's settings are. Python
    imports other modules where ``PYTHONPATH`` and its like say so. Who wants a profile, such as one
    for a cluster, names it on the command line.

    Parameters
    ----------
    variables : mapping of str to str, optional
        Those of a person; those of this process by default.
    home : path, optional
        Folder for what Snakemake keeps of its own; the user's by default.

    Returns
    -------
    dict of str to str
        Without those of Snakemake, and with Python's set such that this library is imported, and
        the packages that lie beside the running Python. In containers, where a user may have no
        name and no folder to write to, with a name and folders for caches.

    Examples
    --------
    >>> own = shielded({"SNAKEMAKE_PROFILE": "mine", "PYTHONHOME": "/opt/py", "LANG": "C"})
    >>> [name in own for name in ("SNAKEMAKE_PROFILE", "PYTHONHOME", "LANG")]
    [False, False, True]
    """
    given = os.environ if variables is None else variables
    kept = {
        name: value
        for name, value in given.items()
        if not name.startswith(("SNAKEMAKE_", "PYTHON")) or name in _OF_PYTHON_KEPT
    }
    of_user = {} if home is None else {"HOME": str(home), "XDG_CACHE_HOME": str(home / ".cache")}
    library = Path(__file__).parents[2]
    paths = [str(Path(sys.executable).parent), given.get("PATH", os.defpath)]
    return {
        "NUMBA_CACHE_DIR": str(folder_of_loops(library.parent)),
        **kept,
        **_of_nobody(given),
        **of_user,
        "PYTHONSAFEPATH": "1",  # no module is taken from the folder in which Snakemake runs
        "PYTHONNOUSERSITE": "1",
        "PYTHONPATH": str(library),
        "PATH": os.pathsep.join(paths),
    }


def _of_nobody(given: Mapping[str, str]) -> dict[str, str]:
    """Names and folders that Snakemake and matplotlib miss where the system gives a user none."""
    missing = {}
    try:
        getpass.getuser()
    except (KeyError, OSError):  # no entry in the list of users
        missing["USER"] = str(os.getuid())
    caches = Path(given.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache"))
    if not _can_be_written(caches):
        own = Path(tempfile.gettempdir(), f"keystab-{os.getuid()}")
        missing |= {"XDG_CACHE_HOME": str(own), "MPLCONFIGDIR": str(own / "matplotlib")}
    return missing


def _can_be_written(folder: Path) -> bool:
    """Whether a folder, or where it does not exist the one it would be made in, takes files."""
    while not folder.exists() and folder != folder.parent:
        folder = folder.parent
    return folder.is_dir() and os.access(folder, os.W_OK | os.X_OK)
