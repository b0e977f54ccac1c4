"""What keystab runs with: versions and machine, for a report of an error.

Folders of the person are written from ``~`` on, since reports are public.
"""

from __future__ import annotations

import importlib.metadata
import os
import platform
import sys
from pathlib import Path

from keystab._version import __version__

__all__ = ["environment"]

_MORE = {"snakemake": "snakemake"}
"""Packages that are named besides those of `keystab.provenance.imported_software`."""

_VARIABLES = (
    *("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"),
    *("NUMBA_CACHE_DIR", "NUMBA_DISABLE_JIT", "PYTHONPATH", "PYTHONOPTIMIZE", "MPLBACKEND"),
)
"""Variables that change what is imported, how fast it is, or what is drawn."""

_WIDTH, _HEAD = 92, 17


def environment() -> str:
    """Versions of keystab, Python and the libraries, and what the machine is.

    Returns
    -------
    str
        Some lines of text, without a line end.
    """
    from keystab.provenance.code_digest import PACKAGE_FOLDER
    from keystab.provenance.imported_software import MODULES, software_problems
    from keystab.utils.memory import available, in_words

    versions, missing = [], []
    for package in sorted({**MODULES, **_MORE}):
        try:
            versions.append(f"{package} {importlib.metadata.version(package)}")
        except importlib.metadata.PackageNotFoundError:
            missing.append(package)
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    lock = PACKAGE_FOLDER.parents[1] / "environment.lock"
    lines = [
        ("keystab", f"{__version__}, {_from_home(PACKAGE_FOLDER)}"),
        ("Python", f"{platform.python_version()}, {_from_home(Path(sys.executable))}"),
        ("system", f"{platform.platform()}, {cores} cores, {_processor()}"),
        ("memory", f"{in_words(available())} free"),
        ("packages", ", ".join(versions)),
        ("not installed", ", ".join(missing)),
    ]
    if lock.is_file():
        problems = software_problems(lock)
        lines.append(("lock", "; ".join(map(_from_home, problems)) or "as environment.lock says"))
    set_here = [
        f"{name}={_from_home(os.environ[name])}" for name in _VARIABLES if name in os.environ
    ]
    lines.append(("variables", ", ".join(set_here)))
    return "\n".join(_folded(head, text) for head, text in lines if text)


def _from_home(text: str | Path) -> str:
    """Text in which the person's folder is ``~``."""
    home = os.path.expanduser("~")
    return str(text).replace(home, "~") if len(home) > 1 else str(text)


def _processor() -> str:
    """Name of the processor."""
    try:
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    except (OSError, ValueError):
        pass
    return platform.processor() or platform.machine()


def _folded(head: str, text: str) -> str:
    """A line with its head, folded where it is long."""
    import textwrap

    return textwrap.fill(
        text, _WIDTH, initial_indent=f"{head:{_HEAD}}", subsequent_indent=" " * _HEAD,
        break_long_words=False, break_on_hyphens=False,
    )  # fmt: skip
