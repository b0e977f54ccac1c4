"""Products of matrices by one thread: their digits must not depend on the number of cores."""

from __future__ import annotations

import sys
from contextlib import AbstractContextManager
from functools import lru_cache
from typing import Any

import threadpoolctl


def one_thread() -> AbstractContextManager[Any]:
    """Context in which the libraries that multiply matrices use one thread.

    `threadpoolctl.threadpool_limits` looks for these libraries each time, which takes as long as a
    search of a small picture.

    Examples
    --------
    >>> import numpy as np
    >>> with one_thread():
    ...     {library["num_threads"] for library in threadpoolctl.threadpool_info()}
    {1}
    """
    limited: AbstractContextManager[Any] = _libraries(len(sys.modules)).limit(limits=1)
    return limited


@lru_cache(maxsize=1)
def _libraries(n_modules: int) -> threadpoolctl.ThreadpoolController:  # noqa: ARG001
    """Libraries that are loaded; a module that is imported may bring another one."""
    return threadpoolctl.ThreadpoolController()
