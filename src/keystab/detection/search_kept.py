"""Results that are kept for the next time, as long as they are small together."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Hashable
from threading import Lock
from typing import Generic, TypeVar

__all__ = ["Kept"]

Result = TypeVar("Result")


class Kept(Generic[Result]):
    """The results that were asked for last, up to a number of bytes.

    `functools.lru_cache` counts results, however large: those of a photograph filled gigabytes.
    Threads may share it; two that ask for the same at once may both make it.

    Parameters
    ----------
    make : callable
        Makes a result from arguments that can be hashed.
    n_bytes : callable
        Size of a result in bytes.
    most : int
        Bytes that are kept; a result that is larger alone is not kept.

    Examples
    --------
    >>> made = []
    >>> line = Kept(lambda n: made.append(n) or "x" * n, len, most=5)
    >>> [line(n) for n in (2, 3, 2, 4, 2)]
    ['xx', 'xxx', 'xx', 'xxxx', 'xx']
    >>> made
    [2, 3, 4, 2]
    """

    def __init__(
        self, make: Callable[..., Result], n_bytes: Callable[[Result], int], most: int
    ) -> None:
        self._make, self._n_bytes, self._most = make, n_bytes, most
        self._results: OrderedDict[Hashable, Result] = OrderedDict()
        self._total, self._lock = 0, Lock()

    def __call__(self, *arguments: Hashable) -> Result:
        """Result for these arguments, made where it is not kept."""
        with self._lock:
            if arguments in self._results:
                self._results.move_to_end(arguments)
                return self._results[arguments]
        result = self._make(*arguments)
        size = self._n_bytes(result)
        with self._lock:
            if size <= self._most and arguments not in self._results:
                self._results[arguments] = result
                self._total += size
            while self._total > self._most:
                _, oldest = self._results.popitem(last=False)
                self._total -= self._n_bytes(oldest)
        return result

    def cache_clear(self) -> None:
        """Forget all, as `functools.lru_cache` does."""
        with self._lock:
            self._results.clear()
            self._total = 0
