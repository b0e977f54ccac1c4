"""Refusing what does not fit into memory, before the machine finds out."""

from __future__ import annotations

import os
from pathlib import Path

from keystab.errors import InputError

__all__ = ["available", "in_words", "require"]


def available() -> int:
    """Bytes of memory that a process can still take without swapping.

    The kernel's estimate of available memory, or what a container's limit leaves if that is less.
    Where neither is known, the physical memory of the machine, or a plain 2**62.
    """
    candidates = []
    try:
        for line in Path("/proc/meminfo").read_text().splitlines():
            if line.startswith("MemAvailable:"):
                candidates.append(int(line.split()[1]) * 1024)
        limit = Path("/sys/fs/cgroup/memory.max").read_text().strip()
        if limit != "max":
            used = int(Path("/sys/fs/cgroup/memory.current").read_text())
            candidates.append(max(0, int(limit) - used))
    except (OSError, ValueError):
        pass
    if not candidates:
        try:
            candidates.append(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"))
        except (AttributeError, OSError, ValueError):
            candidates.append(2**62)
    return min(candidates)


def in_words(n_bytes: float) -> str:
    """Write a number of bytes for people, in decimal units with three digits.

    Examples
    --------
    >>> in_words(1.4e9), in_words(2048), in_words(512)
    ('1.4 GB', '2.05 kB', '512 bytes')
    """
    for unit, size in (("TB", 1e12), ("GB", 1e9), ("MB", 1e6), ("kB", 1e3)):
        if n_bytes >= size:
            return f"{n_bytes / size:.3g} {unit}"
    return f"{n_bytes:.0f} bytes"


def require(n_bytes: float, what: str, remedy: str) -> None:
    """Raise unless `n_bytes` of memory are available.

    Parameters
    ----------
    n_bytes : float
        Estimate of the memory needed.
    what : str
        What needs it, as the subject of a sentence.
    remedy : str
        What to ask for instead, as an imperative.

    Raises
    ------
    InputError
        If less is available.
    """
    free = available()
    if n_bytes > free:
        raise InputError(
            f"{what} needs about {in_words(n_bytes)} of memory, {in_words(free)} are available: "
            f"{remedy}"
        )
