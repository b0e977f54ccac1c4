"""How far a long job has come: a bar on terminals, a line now and then in log files."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import TypeVar

__all__ = ["progress", "progress_if_watched", "watched"]

T = TypeVar("T")

#: Seconds between lines in a log file. Jobs that take less write none.
LOG_INTERVAL = 10.0

#: Seconds before a terminal gets a bar.
DELAY = 2.0

_watched: ContextVar[bool] = ContextVar("watched", default=False)


@contextmanager
def watched() -> Iterator[None]:
    """Let long computations of a block report their progress.

    A library is silent, and a command is not: what a command calls asks `progress_if_watched`.
    """
    token = _watched.set(True)
    try:
        yield
    finally:
        _watched.reset(token)


def progress_if_watched(iterable: Iterable[T], total: int, what: str) -> Iterable[T]:
    """Report as `progress` does inside of `watched`, and nothing elsewhere.

    Examples
    --------
    >>> list(progress_if_watched("abc", total=3, what="letters"))
    ['a', 'b', 'c']
    """
    return progress(iterable, total, what) if _watched.get() else iterable


def progress(iterable: Iterable[T], total: int, what: str) -> Iterator[T]:
    """Hand on the items of an iterable and report progress on standard error.

    A terminal gets a bar after two seconds that disappears when done. Anything else, such as the
    log file of a workflow, gets a line of text at most every `LOG_INTERVAL` seconds, and a last one
    if there was any.

    Parameters
    ----------
    iterable : iterable
        What to hand on, unchanged and in order.
    total : int
        How many items there are.
    what : str
        What is being done, to be read before "12 of 40".

    Yields
    ------
    object
        The items of `iterable`.

    Examples
    --------
    >>> list(progress("abc", total=3, what="letters"))
    ['a', 'b', 'c']
    """
    if sys.stderr.isatty():
        from tqdm import tqdm

        yield from tqdm(iterable, desc=what, total=total, leave=False, delay=DELAY)
        return
    start = last = time.monotonic()
    done = 0
    for item in iterable:
        yield item
        done += 1
        now = time.monotonic()
        if now - last >= LOG_INTERVAL and done < total:
            last = now
            left = (now - start) * (total - done) / done
            _line(f"{what}: {done} of {total}, {now - start:.0f} s, about {left:.0f} s left")
    if last > start:
        _line(f"{what}: {done} of {total}, done in {time.monotonic() - start:.0f} s")


def _line(text: str) -> None:
    print(text, file=sys.stderr, flush=True)
