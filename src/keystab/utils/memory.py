"""Refusing what does not fit into memory, before the machine finds out."""

from __future__ import annotations

import errno
import os
from pathlib import Path

from keystab.errors import InputError

__all__ = ["available", "in_words", "require", "require_start", "reserved", "too_little"]

LEAST = 2_000_000_000
"""Bytes of addresses that a process takes which detects or draws, most of them the libraries' and
never used: 1.9 GB were measured. With less, matrix products wait for ever, the compiler ends
the process, and libraries are not found."""


def available() -> int:
    """Bytes of memory that a process can still take without swapping.

    The kernel's estimate of available memory, or what a container's limit or that of the shell
    (``ulimit -v``) leaves if that is less. Where none is known, the physical memory of the machine,
    or a plain 2**62.
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
    addresses = reserved()
    if addresses is not None:
        candidates.append(max(0, addresses - _taken()))
    return min(candidates)


def reserved() -> int | None:
    """Bytes of addresses that this process may take (``ulimit -v``); None where there is no end."""
    try:
        import resource
    except ImportError:  # Windows
        return None
    limit = resource.getrlimit(resource.RLIMIT_AS)[0]
    return None if limit == resource.RLIM_INFINITY else limit


def _taken() -> int:
    """Bytes of addresses that this process has; 0 where the system does not say."""
    try:
        pages = int(Path("/proc/self/statm").read_text().split()[0])
        return pages * os.sysconf("SC_PAGE_SIZE")
    except (OSError, ValueError):
        return 0


def require_start() -> None:
    """Raise where the libraries would not start; to be asked before numpy is imported.

    Raises
    ------
    InputError
        If a limit of the shell leaves less than `LEAST`.
    """
    limit = reserved()
    if limit is not None and limit < LEAST:
        raise InputError(
            f"this shell limits memory to {in_words(limit)} (ulimit -v), the libraries alone "
            f"take {in_words(LEAST)}: raise the limit, such as by ulimit -v unlimited"
        )


def too_little(error: Exception) -> str | None:
    """What to say of a failure that a limit of memory explains; None where it is another one.

    Under a limit, libraries fail to load and threads to start before anything raises MemoryError.
    """
    limit = reserved()
    if limit is None or not isinstance(error, MemoryError | ImportError | OSError | RuntimeError):
        return "the memory does not suffice" if isinstance(error, MemoryError) else None
    if isinstance(error, OSError) and error.errno != errno.ENOMEM:
        return None
    return f"the memory that this shell allows, {in_words(limit)} (ulimit -v), does not suffice"


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
