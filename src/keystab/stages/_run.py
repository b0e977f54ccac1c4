"""What all stages share: arguments, logging of results, and errors in one line."""

from __future__ import annotations

import argparse
import atexit
import errno
import functools
import gc
import os
import sys
from collections.abc import Callable, Sequence
from importlib import import_module
from pathlib import Path
from typing import Any, TypeVar

# Matrix products differ in the last bits between numbers of threads. To be set before numpy is
# imported; Snakemake sets the same from a rule's threads.
for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

# Most stages take a second, a third of it for garbage collection: while the libraries are imported,
# and of all that they hold at the end, which the system takes back faster.
gc.set_threshold(10_000, 10, 10)
atexit.register(gc.freeze)

from keystab.errors import InputError  # noqa: E402

T = TypeVar("T")
Main = Callable[[Sequence[str] | None], None]


def stage(main: Main) -> Callable[..., int]:
    """Turn a function of the command line into a command that explains its failures.

    The command returns 0, or 2 after one line on standard error about its input, its disk or its
    memory. Any other failure is a defect of this program: its traceback is shown, last line last.
    """

    @functools.wraps(main)
    def command(argv: Sequence[str] | None = None) -> int:
        if "NUMBA_CACHE_DIR" not in os.environ:
            # Not a plain import: it changes no result, and what a stage imports is part of its
            # fingerprint.
            import_module("keystab.provenance.compiled_loops").forget_outdated()
        try:
            main(argv)
        except InputError as error:
            print(f"error: {error}", file=sys.stderr)
            return 2
        except MemoryError as error:
            print(f"error: the memory does not suffice: {error}", file=sys.stderr)
            return 2
        except OSError as error:
            if error.errno not in (errno.ENOSPC, errno.EDQUOT, errno.EROFS, errno.EACCES):
                raise
            print(f"error: {error.filename or 'output'}: {error.strerror}", file=sys.stderr)
            return 2
        return 0

    return command


def parser(description: str | None) -> argparse.ArgumentParser:
    """Parser of a stage's command line, described by the module's docstring."""
    return argparse.ArgumentParser(
        description=description, formatter_class=argparse.RawDescriptionHelpFormatter
    )


def required(to: argparse.ArgumentParser, name: str, what: str, **options: object) -> None:
    """Add an argument that must be given; the rules of the workflow know all defaults."""
    to.add_argument(f"--{name}", required=True, help=what, **options)  # type: ignore[arg-type]


def views_arguments(to: argparse.ArgumentParser) -> None:
    """Add the store of views and its seal."""
    required(to, "views", "store of the views", type=Path)
    required(to, "views-digest", "seal of the store", type=Path)


def detector_arguments(to: argparse.ArgumentParser) -> None:
    """Add what defines the difference-of-Gaussians scale-space."""
    scale_arguments(to)
    required(to, "oversampling", "spline or cosine")


def view_detector_arguments(to: argparse.ArgumentParser) -> None:
    """Add what defines the scale-spaces of the views of a set."""
    required(to, "n-spo", "scales per octave", type=int)
    own = "; None for each view's own"
    required(to, "assumed-blur", f"camera blur to assume, pixels{own}", type=optional(float))
    required(to, "n-oct", "octaves", type=int)
    balanced = "; None for the balanced one"
    required(to, "delta-min", f"sampling step, pixels{balanced}", type=optional(float))
    detector_arguments(to)


def store_arguments(to: argparse.ArgumentParser) -> None:
    """Add where scale-spaces are stored; without them they are streamed."""
    to.add_argument("--store", type=Path, help="stored scale-space to search")
    to.add_argument("--store-digest", type=Path, help="seal of --store")


def require_both_or_neither(parser: argparse.ArgumentParser, args: argparse.Namespace) -> None:
    """Stop where a store is given without its seal, or a seal without its store."""
    if (args.store is None) != (args.store_digest is None):
        parser.error("--store and --store-digest go together: give both or neither")


def scale_arguments(to: argparse.ArgumentParser) -> None:
    """Add first scale and ratio of the difference of Gaussians."""
    required(to, "sigma-min", "first scale in pixels", type=float)
    required(to, "kappa", "ratio of the two blurs", type=float)


def range_arguments(to: argparse.ArgumentParser) -> None:
    """Add what decides which detections are compared."""
    required(to, "border", "pixels left out at the border of the view", type=float)
    required(to, "first-scale", "lower end of the scale range, over sigma-min", type=float)
    last = "upper end of the scale range, over sigma-min; None for none"
    required(to, "last-scale", last, type=optional(float))


def judged_arguments(to: argparse.ArgumentParser) -> None:
    """Add what decides which detections are held against true extrema, and when they agree."""
    required(to, "border", "pixels left out at the border of the view", type=float)
    required(to, "first-scale", "lower end of the scale range, over sigma-min", type=float)
    required(to, "last-scale", "upper end of the scale range, over sigma-min", type=float)
    tolerance_arguments(to)


def view_range_arguments(to: argparse.ArgumentParser) -> None:
    """Add what decides which detections of the views of a set are compared."""
    required(to, "sigma-min", "first scale in pixels", type=float)
    required(to, "n-oct", "octaves", type=int)
    required(to, "guard", "guard band of the views, pixels", type=float)
    range_arguments(to)


def refinement_arguments(to: argparse.ArgumentParser) -> None:
    """Add what decides which refined keypoints are accepted."""
    required(to, "max-offset", "M_offset", type=float)
    required(to, "max-iterations", "N_interp", type=int)


def blob_arguments(to: argparse.ArgumentParser) -> None:
    """Add which blobs are detected and in which ways."""
    required(to, "size-from", "smallest blob, pixels", type=float)
    required(to, "size-to", "largest blob, pixels", type=float)
    required(to, "size-count", "number of blobs", type=int)
    required(to, "kappas", "ratios that are compared", type=float, nargs="+")
    required(to, "n-spo", "scales per octave", type=int, nargs="+")
    required(to, "camera-blur", "blur of the camera, pixels", type=float)
    required(to, "assumed-blurs", "blurs assumed instead", type=float, nargs="+")
    scale_arguments(to)


def blobs_and_ways(args: argparse.Namespace) -> dict[str, Any]:
    """Return the blobs, and the ways to detect them, of `keystab.experiments.blob_scales`."""
    import numpy as np

    # Rounded, so that the numbers can be read.
    sizes = np.geomspace(args.size_from, args.size_to, args.size_count).round(6).tolist()
    names = ("kappa", "kappas", "n_spo", "camera_blur", "assumed_blurs", "sigma_min")
    return {"blobs": sizes, **{name: getattr(args, name) for name in names}}


def same_arguments(to: argparse.ArgumentParser) -> None:
    """Add what decides when two detections are the same."""
    tolerance_arguments(to)
    required(to, "match-sign", "whether the signs must agree", type=boolean)


def tolerance_arguments(to: argparse.ArgumentParser) -> None:
    """Add how far apart two detections may be."""
    required(to, "space-tolerance", "largest distance in y and in x, pixels", type=float)
    required(to, "scale-ratio", "largest ratio of scales", type=float)


def label_arguments(to: argparse.ArgumentParser) -> None:
    """Add what decides which keypoints are stable."""
    required(to, "stable-above", "share of samplings above which a keypoint is stable", type=float)
    required(to, "unstable-below", "share of samplings below which it is unstable", type=float)


def boolean(text: str) -> bool:
    """Read true or false.

    Examples
    --------
    >>> boolean("True"), boolean("false")
    (True, False)
    """
    if text.lower() not in ("true", "false"):
        raise argparse.ArgumentTypeError(f"{text!r}, allowed is true or false")
    return text.lower() == "true"


def optional(kind: Callable[[str], T]) -> Callable[[str], T | None]:
    """Read a value that may be None."""

    def read(text: str) -> T | None:
        return None if text == "None" else kind(text)

    return read
