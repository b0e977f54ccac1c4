"""A stage is a typed function; its command line follows from its signature.

    @command
    def main(views: Store, n_spo: int, detection: Detection, *, extrema: Path) -> None:
        \"\"\"Detect the extrema of one view.\"\"\"

reads ``--views --views-digest --n-spo``, an option for each field of the block `Detection`, and
``--extrema``. What stands after the star is written. Options have to be given unless the function
has a default for them: the rules of the workflow know all defaults.
"""

from __future__ import annotations

import atexit
import errno
import functools
import gc
import os
import sys
from collections.abc import Callable, Sequence
from importlib import import_module
from pathlib import Path
from typing import NamedTuple

from keystab.errors import InputError
from keystab.utils.command_line import read_arguments
from keystab.utils.memory import require_start, too_little

_OF_THE_SYSTEM = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EROFS, errno.EACCES)


class Store(NamedTuple):
    """A folder of arrays, and the file of its checksums."""

    path: Path
    digest: Path


def command(function: Callable[..., None]) -> Callable[..., int]:
    """Turn a typed function into a command that explains its failures.

    Parameters
    ----------
    function : callable
        Its arguments have types that `keystab.utils.command_line.read_arguments` knows.

    Returns
    -------
    callable
        Takes the words of a command line, those of the process by default, and returns 0, or 2
        after one line on standard error about its input, its disk or its memory. Any other failure
        is a defect of this program: its traceback is shown, last line last.

    Raises
    ------
    SystemExit
        With what that returns, where the module is run and not imported: a stage is the last thing
        in its module and needs no lines there that call it.
    """

    @functools.wraps(function)
    def run(argv: Sequence[str] | None = None) -> int:
        if argv is None:
            settle_process()
        arguments = read_arguments(function, argv, meanings(function))
        try:
            require_start()
            if "NUMBA_CACHE_DIR" not in os.environ:
                # No plain import: it changes no result, and what a stage imports is in its digest.
                import_module("keystab.utils.compiled_loops").forget_outdated()
            function(**arguments)
        except InputError as error:
            print(f"error: {error}", file=sys.stderr)
            return 2
        except (MemoryError, ImportError, RuntimeError) as error:
            if not (told := too_little(error)):
                raise
            print(f"error: {told}: {error}", file=sys.stderr)
            return 2
        except OSError as error:
            if error.errno not in _OF_THE_SYSTEM:
                raise
            print(f"error: {error.filename or 'output'}: {error.strerror}", file=sys.stderr)
            return 2
        return 0

    if function.__module__ == "__main__":
        raise SystemExit(run())
    return run


def settle_process() -> None:
    """Settle how this process computes, before a stage imports numpy.

    One thread for matrix products, which differ in the last bits between numbers of threads;
    Snakemake sets the same from a rule's threads. Less garbage collection: most stages take a
    second, a third of which it would take while the libraries are imported, and at the end of all
    that they hold, which the system takes back faster.
    """
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(name, "1")
    gc.set_threshold(10_000, 10, 10)
    atexit.register(gc.freeze)


def meanings(function: Callable[..., None]) -> dict[str, str]:
    """What the arguments of a stage mean, from the docstring of its package."""
    package = sys.modules.get(sys.modules[function.__module__].__package__ or "")
    lines = (getattr(package, "__doc__", None) or "").splitlines()
    pairs = (line.split(" : ", 1) for line in lines if " : " in line)
    return {name.strip(): meaning for name, meaning in pairs}
