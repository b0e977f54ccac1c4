"""What is imported here, held against ``environment.lock``.

The lock says what the set-up installs. What Python imports can be another thing: ``PYTHONPATH``,
the modules of a cluster, a user's own packages or a later ``pip install`` change it.
"""

from __future__ import annotations

import hashlib
import importlib.metadata
import importlib.util
import re
from pathlib import Path

__all__ = ["MODULES", "software_digest", "software_problems"]

MODULES = {
    "contourpy": "contourpy",
    "imageio": "imageio",
    "jsonschema": "jsonschema",
    "llvmlite": "llvmlite",
    "matplotlib": "matplotlib",
    "numba": "numba",
    "numcodecs": "numcodecs",
    "numpy": "numpy",
    "pandas": "pandas",
    "pillow": "PIL",
    "pyarrow": "pyarrow",
    "pypdf": "pypdf",
    "pyyaml": "yaml",
    "scikit-image": "skimage",
    "scikit-learn": "sklearn",
    "scipy": "scipy",
    "seaborn": "seaborn",
    "threadpoolctl": "threadpoolctl",
    "tifffile": "tifffile",
    "tqdm": "tqdm",
    "xarray": "xarray",
    "zarr": "zarr",
}
"""Packages that the library computes, reads, writes and draws with, and their modules."""

_LOCKED = re.compile(r"^([a-z0-9._-]+)==([^\s;]+)(?: ;[^\\\n]*)? \\$", re.MULTILINE)  # with hashes


def software_problems(lock: Path, modules: dict[str, str] | None = None) -> list[str]:
    """One line for every package whose import gives another thing than the lock says.

    Parameters
    ----------
    lock : path
        ``environment.lock``. Of packages that it does not name with a hash nothing is said.
    modules : dict of str to str, optional
        Modules by their packages; `MODULES` by default.

    Returns
    -------
    list of str
        Nothing is imported: of a module, Python says where it would come from. It must lie where
        the package of the locked version was installed.
    """
    locked: dict[str, set[str]] = {}
    for name, version in _LOCKED.findall(lock.read_text(encoding="utf-8")):
        locked.setdefault(name, set()).add(version)
    return [
        f"{module} {found}, and environment.lock says {' or '.join(sorted(locked[package]))}"
        for package, module in (MODULES if modules is None else modules).items()
        if package in locked and (found := _other(package, module, locked[package]))
    ]


def _other(package: str, module: str, wanted: set[str]) -> str:
    """Version and place of what is imported, where these are others than wanted."""
    try:
        spec = importlib.util.find_spec(module)
    except (ImportError, ValueError):
        spec = None
    if spec is None:
        return "cannot be imported"
    place = Path(spec.origin or next(iter(spec.submodule_search_locations or ["nowhere"])))
    try:
        installed = importlib.metadata.distribution(package)
    except importlib.metadata.PackageNotFoundError:
        return f"of no known version is imported from {place}"
    root = Path(str(installed.locate_file(""))).resolve()
    if not place.resolve().is_relative_to(root):
        return f"is imported from {place}, where its version is not said"
    if installed.version not in wanted:
        return f"{installed.version} is imported from {place}"
    return ""


def software_digest(lock: Path) -> str:
    """SHA-256 of the lock; where another thing is imported, of the lock and of what that is."""
    problems = software_problems(lock)
    return hashlib.sha256(lock.read_bytes() + "\n".join(problems).encode()).hexdigest()
