"""The command `keystab`: simulate, detect, find true extrema, measure a blur, look into files.

Of the study it says where a figure comes from, packs a finished run and verifies one. Bad input
ends with status 2 and one line on standard error.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from pathlib import Path

from keystab.cli.parser import BAD_INPUT, build_parser
from keystab.errors import InputError
from keystab.utils.compiled_loops import forget_outdated
from keystab.utils.memory import require_start, too_little

__all__ = ["main"]

_LIGHT = ("inspect", "simulate", "scene", "blur", "whence", "completion")
"""Commands that compile nothing and draw nothing."""


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command.

    Parameters
    ----------
    argv : sequence of str, optional
        Arguments; those of the process by default.

    Returns
    -------
    int
        Exit status: 0, 1 where a verification found something, 2 for input that cannot be worked
        with, 130 when interrupted.
    """
    args = build_parser().parse_args(argv)
    args.typed = (sys.argv[1:] if argv is None else list(argv))[1:]
    forget_outdated()
    status = None
    try:
        if args.command not in _LIGHT:
            require_start()
        status = args.run(args)
        sys.stdout.flush()
    except InputError as error:
        return _refuse(args, str(error))
    except (MemoryError, ImportError, RuntimeError) as error:
        if told := too_little(error):
            return _refuse(args, f"{told}; use a smaller picture or coarser steps")
        if "no locator available" not in str(error):  # how numba says it
            raise
        return _refuse(
            args,
            f"compiled code can be kept neither in {Path(__file__).parents[1]} nor in the home "
            "folder; set the environment variable NUMBA_CACHE_DIR to a folder that can be written "
            "to",
        )
    except BrokenPipeError:  # whoever read the output has seen enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    except OSError as error:
        return _refuse(args, f"{error.filename or 'output'}: {error.strerror or error}")
    except KeyboardInterrupt:
        return 130
    return status or 0


def _refuse(args: argparse.Namespace, message: str) -> int:
    print(f"keystab {args.command}: {message}", file=sys.stderr)
    return BAD_INPUT
