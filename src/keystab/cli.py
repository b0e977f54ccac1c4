"""The command `keystab`: simulate, detect, find true extrema, measure a blur, look into files.

Of the study it says where a figure comes from, packs a finished run and verifies one. Bad input
ends with status 2 and one line on standard error.
"""

from __future__ import annotations

import argparse
import dataclasses
import math
import os
import sys
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, NoReturn

from keystab import __version__
from keystab.errors import InputError

if TYPE_CHECKING:
    import pandas as pd

    from keystab.unpacking import Unpacked

__all__ = ["main"]

_BAD_INPUT = 2


class _Parser(argparse.ArgumentParser):
    """A parser that reports an error in one line, without its usage."""

    def error(self, message: str) -> NoReturn:
        self.exit(_BAD_INPUT, f"{self.prog}: {message}; see {self.prog} --help\n")


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
    args = _parser().parse_args(argv)
    status = None
    try:
        status = args.run(args)
        sys.stdout.flush()
    except InputError as error:
        return _refuse(args, str(error))
    except RuntimeError as error:
        if "no locator available" not in str(error):  # how numba says it
            raise
        return _refuse(
            args,
            f"compiled code can be kept neither in {Path(__file__).parent} nor in the home folder; "
            "set the environment variable NUMBA_CACHE_DIR to a folder that can be written to",
        )
    except MemoryError:
        return _refuse(args, "the memory does not suffice; use a smaller picture or coarser steps")
    except BrokenPipeError:  # whoever read the output has seen enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    except OSError as error:
        return _refuse(args, f"{error.filename or 'output'}: {error.strerror or error}")
    except KeyboardInterrupt:
        return 130
    return status or 0


def _refuse(args: argparse.Namespace, message: str) -> int:
    print(f"keystab {args.command}: {message}", file=sys.stderr)
    return _BAD_INPUT


def simulate(args: argparse.Namespace) -> None:
    """Take a view of a picture with the simulated camera and write it."""
    from keystab.camera import Scene, ViewSpec
    from keystab.camera import simulate as take
    from keystab.checks import number
    from keystab.files import check_writable
    from keystab.pictures import FORMATS, read_picture, write_picture

    check_writable(args.out, FORMATS)
    if args.picture.exists() and args.out.exists() and args.out.samefile(args.picture):
        raise InputError(f"{args.out} is the picture itself; give another name to the view")
    # Bad values are refused before the picture is read, which also decides the default shape.
    spec = ViewSpec(
        args.blur,
        args.step,
        tuple(args.shape or (1, 1)),
        tuple(args.shift),
        math.radians(number("rotation", args.rotation)),
        args.noise,
        args.seed,
    )
    scene = Scene(read_picture(args.picture))
    if args.shape is None:
        height, width = (int(n / args.step) for n in scene.shape)
        if height < 1 or width < 1:
            raise InputError(
                f"step is {args.step:g}, more than a side of the picture of {scene.shape[0]} x "
                f"{scene.shape[1]} pixels; give a smaller step or a shape"
            )
        spec = dataclasses.replace(spec, shape=(height, width))
    view = take(scene, spec)
    write_picture(view, args.out)
    outside = int(((view < 0) | (view > 1)).sum())
    pixels = f"{outside} pixel{'s' * (outside != 1)}"
    clipped = f"; {pixels} clipped to [0, 1]" if outside and _is_png(args.out) else ""
    print(
        f"{args.out}: {view.shape[0]} x {view.shape[1]} pixels, camera blur {args.blur:g}{clipped}",
        file=sys.stderr,
    )


def detect(args: argparse.Namespace) -> None:
    """Detect the keypoints of a picture and write them as a table."""
    from keystab.detection import detect_keypoints

    _tabulate(args, detect_keypoints, ("keypoint", "keypoints"))


def blur(args: argparse.Namespace) -> None:
    """Fit a Gaussian to the picture of a point spread function and say how wide it is."""
    from keystab.pictures import read_picture
    from keystab.psf import border_level, fit_psf

    picture = read_picture(args.picture)
    try:
        background = border_level(picture) if args.background == "border" else args.background
        fit = fit_psf(picture, args.oversampling, background)
    except InputError as error:
        raise InputError(f"{args.picture}: {error}") from None
    print(
        f"camera blur c    {fit.blur:.4g} pixels\n"
        f"centre           y {fit.y:.2f}, x {fit.x:.2f} in the picture's samples\n"
        f"principal axes   {fit.major:.4g} and {fit.minor:.4g} pixels, "
        f"the longer at {math.degrees(fit.angle):.0f} degrees from x towards y\n"
        f"residual         {fit.residual:.1%} of the picture's root mean square; "
        f"{fit.general_residual:.1%} with two axes\n"
        f"background       {background:.4g}"
    )


def truth(args: argparse.Namespace) -> None:
    """Find the true extrema of a picture and write them as a table."""
    from keystab.truth import true_extrema

    _tabulate(args, true_extrema, ("extremum", "extrema"))


def _tabulate(
    args: argparse.Namespace, find: Callable[..., pd.DataFrame], nouns: tuple[str, str]
) -> None:
    """Write what a function finds in a picture; say how many they are and how long it took."""
    from keystab.pictures import read_picture
    from keystab.tables import to_csv, write_table

    _check_table(args.output)
    image = read_picture(args.picture)
    options = {name: getattr(args, name) for name in args.parameters}
    start = time.monotonic()
    found = find(image, **options)
    seconds = time.monotonic() - start
    if args.output is None:
        sys.stdout.write(to_csv(found))
    else:
        write_table(found, args.output)
    noun = nouns[len(found) != 1]
    print(f"{args.picture}: {len(found)} {noun} in {seconds:.1f} s", file=sys.stderr)


def inspect(args: argparse.Namespace) -> None:
    """Say in words what a store or a table holds."""
    from keystab.inspection import describe

    print(describe(args.path))


def whence(args: argparse.Namespace) -> None:
    """Say where a figure comes from."""
    from keystab.provenance import whence as of
    from keystab.workflow import find_project

    print(of(args.figure, find_project()))


def archive(args: argparse.Namespace) -> None:
    """Pack a finished run into one file."""
    from keystab.archive import pack
    from keystab.memory import in_words
    from keystab.provenance import file_digest
    from keystab.workflow import Study, find_project

    path = pack(Study(find_project(), args.configfile))
    print(f"{path}: {in_words(path.stat().st_size)}, sha256 {file_digest(path)}")


def reference(args: argparse.Namespace) -> None:
    """Copy the small results of a finished run to where they can be committed."""
    from keystab.archive import publish
    from keystab.memory import in_words
    from keystab.workflow import Study, find_project

    folder = publish(Study(find_project(), args.configfile))
    sizes = [path.stat().st_size for path in folder.rglob("*") if path.is_file()]
    print(f"{folder}: {len(sizes)} files, {in_words(sum(sizes))}")


def verify(args: argparse.Namespace) -> int:
    """Check an archive, or the results that are here; recompute figures on request."""
    from keystab import verification
    from keystab.checks import integer, number
    from keystab.unpacking import committed, unpacked
    from keystab.workflow import Study, find_project

    integer("cores", args.cores, least=1)  # Snakemake waits for ever for the first of none
    for name in ("rtol", "atol"):
        number(name, getattr(args, name), least=0)
    project = find_project()
    start = time.monotonic()
    if args.archive is None:
        print(f"results of {project}")
        checks, sound = verification.check_here(Study(project, args.configfile))
        print(verification.report(checks), flush=True)
        if args.recompute:  # the committed reference is compared with, whatever else is here
            reference = project / "results/reference"
            own = verification.check_reference_itself(reference)
            if own.problems:
                print(verification.report([own]))
            sound = not own.problems and _recompute(args, committed(reference), project) and sound
    else:
        # Taken apart once: what is recomputed is what was checked.
        with unpacked(args.archive) as held:
            try:
                checks, sound = verification.check_archive(held, project)
            except InputError as error:
                raise InputError(f"{args.archive}: {error}") from None
            print(
                f"{args.archive}: sha256 {held.digest}\n{verification.report(checks)}", flush=True
            )
            if args.recompute and sound:
                sound = _recompute(args, held, project)
            elif args.recompute:
                print("nothing is recomputed: the archive is not what a run of the study packs")
    verdict = "verified" if sound else "NOT verified: see the lines marked FAILED"
    print(f"{verdict} ({time.monotonic() - start:.0f} s)")
    return 0 if sound else 1


def _recompute(args: argparse.Namespace, held: Unpacked, project: Path) -> bool:
    """Compute figures again with the code that is here; whether the numbers are the same."""
    from keystab import recomputation, verification

    print(f"recomputing {' '.join(args.recompute)} with the code of {project}", flush=True)
    checks, same = recomputation.recompute(
        held, project, args.recompute, args.cores, args.rtol, args.atol
    )
    print(f"recomputed {' '.join(args.recompute)}\n{verification.report(checks)}")
    return same


def _check_table(path: Path | None) -> None:
    """Refuse a table that cannot be written before anything is computed."""
    from keystab.files import check_writable
    from keystab.tables import FORMATS

    if path is not None:
        check_writable(path, FORMATS)


def _is_png(path: Path) -> bool:
    return path.suffix.lower() == ".png"


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(
        prog="keystab",
        description="Simulated views, scale-space keypoints, and what files hold.",
    )
    parser.add_argument("--version", action="version", version=f"keystab {__version__}")
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    _simulate_arguments(
        commands.add_parser(
            "simulate",
            help="take a view of a picture with a simulated camera",
            description="Blur a picture and sample it, as a camera that sees it would: exactly, "
            "at any zoom, shift and rotation. The view is centred on the picture, which goes on "
            "beyond its border as its mirror image.",
        )
    )
    _detect_arguments(
        commands.add_parser(
            "detect",
            help="detect the keypoints of a picture",
            description="Detect the extrema of the difference-of-Gaussians scale-space of a "
            "picture, without any filter of contrast or edges.",
            formatter_class=argparse.ArgumentDefaultsHelpFormatter,
        )
    )
    _blur_arguments(
        commands.add_parser(
            "blur",
            help="fit a Gaussian to a picture of a point spread function",
            description="Say what camera blur a measured point spread function has: the standard "
            "deviation of the Gaussian that fits its picture best in least squares, for "
            "--camera-blur of keystab detect.",
        )
    )
    _truth_arguments(
        commands.add_parser(
            "truth",
            help="find the true extrema of a picture",
            description="Find all extrema of the continuous difference-of-Gaussians scale-space "
            "of a picture, to some twelve digits: what a detector at any sampling should find.",
            formatter_class=argparse.ArgumentDefaultsHelpFormatter,
        )
    )
    to = commands.add_parser(
        "inspect",
        help="say what a store or a table holds",
        description="Say in words what a stored scale-space, a stored set of views or a table of "
        "keypoints holds.",
    )
    to.add_argument("path", metavar="PATH", type=Path, help="store, .csv or .parquet table")
    to.set_defaults(run=inspect)
    _study_commands(commands)
    return parser


def _study_commands(commands: argparse._SubParsersAction[_Parser]) -> None:
    """Add the commands that are about the study; they are given in the project's folder."""
    to = commands.add_parser(
        "whence",
        help="say where a figure of the study comes from",
        description="Say what drew a figure, from which tables, what these were made from, and how "
        "to make it again; and whether files and code are still the same here.",
    )
    to.add_argument("figure", metavar="FIGURE", type=Path, help="figure of the study, PDF or PNG")
    to.set_defaults(run=whence)
    to = commands.add_parser(
        "archive",
        help="pack a finished run of the study into one file",
        description="Write {results}/archive/keystab-VERSION.zip: figures, tables, verdicts, code, "
        "settings, environment.lock, Snakemake's records, costs and an RO-Crate.",
    )
    _configfile_argument(to)
    to.set_defaults(run=archive)
    to = commands.add_parser(
        "reference",
        help="copy the small results of a finished run to results/reference",
        description="Copy tables, verdicts and PNG figures, with their digests and what they were "
        "made by, to results/reference, to be committed.",
    )
    _configfile_argument(to)
    to.set_defaults(run=reference)
    to = commands.add_parser(
        "verify",
        help="check an archive of the study, or the results that are here",
        description="Check an archive against the code, settings and lock file here, without "
        "computing anything; without an archive, the results that are here, and compare them with "
        "results/reference. With --recompute, compute figures again and compare all numbers.",
    )
    to.add_argument("archive", metavar="ARCHIVE", type=Path, nargs="?", help="zip file to check")
    _configfile_argument(to)
    to.add_argument(
        "--recompute", nargs="+", metavar="FIGURE",
        help="figures to compute again, such as fig5, or all; needs the time and disk of the study",
    )  # fmt: skip
    to.add_argument("--cores", type=int, default=1, metavar="N", help="jobs at a time (default 1)")
    for name, value, what in (("rtol", 1e-6, "relative"), ("atol", 1e-9, "absolute")):
        to.add_argument(
            f"--{name}", type=float, default=value, metavar="T",
            help=f"{what} tolerance for numbers where software or processor differ "
            f"(default {value:g}); where both are the same, every bit counts",
        )  # fmt: skip
    to.set_defaults(run=verify)


def _configfile_argument(to: argparse.ArgumentParser) -> None:
    to.add_argument(
        "--configfile", nargs="+", default=[], metavar="FILE",
        help="settings of the run, laid over config/config.yaml as for snakemake",
    )  # fmt: skip


def _simulate_arguments(to: argparse.ArgumentParser) -> None:
    to.set_defaults(run=simulate)
    to.add_argument("picture", metavar="PICTURE", type=Path, help="the scene: PNG, TIFF, JPEG, npy")
    to.add_argument(
        "out", metavar="OUT", type=Path,
        help="view to write: .png (16 bits, clipped), .tiff (float32) or .npy (float64)",
    )  # fmt: skip
    to.add_argument(
        "--blur", type=float, required=True, metavar="C",
        help="camera blur: standard deviation of its Gaussian in view pixels",
    )  # fmt: skip
    to.add_argument(
        "--step", type=float, required=True, metavar="S",
        help="picture pixels per view pixel; the larger, the further away the camera",
    )  # fmt: skip
    to.add_argument(
        "--shape", type=int, nargs=2, metavar=("H", "W"),
        help="height and width of the view in pixels; by default all of the picture",
    )  # fmt: skip
    to.add_argument(
        "--shift", type=float, nargs=2, default=(0.0, 0.0), metavar=("Y", "X"),
        help="move the camera down and right by so many view pixels",
    )  # fmt: skip
    to.add_argument(
        "--rotation", type=float, default=0.0, metavar="DEG",
        help="turn the camera counter-clockwise about its centre, degrees",
    )  # fmt: skip
    to.add_argument(
        "--noise", type=float, default=0.0, metavar="SD",
        help="standard deviation of white noise, in units of the range [0, 1]",
    )  # fmt: skip
    to.add_argument(
        "--seed", type=_seed, help="number or word that decides the noise; needed with --noise"
    )


def _detect_arguments(to: argparse.ArgumentParser) -> None:
    to.set_defaults(run=detect)
    to.add_argument("picture", metavar="PICTURE", type=Path, help="PNG, TIFF, JPEG or npy")
    to.add_argument(
        "-o", "--output", metavar="OUT", type=Path, default=argparse.SUPPRESS,
        help="table to write, .csv or .parquet; standard output if not given",
    )  # fmt: skip
    flags = [
        to.add_argument(
            "--camera-blur", type=float, required=True, metavar="C", default=argparse.SUPPRESS,
            help="Gaussian blur that the picture already has, pixels",
        ),
        to.add_argument("--n-spo", type=int, default=3, metavar="N", help="scales per octave"),
        to.add_argument(
            "--delta-min", type=float, metavar="D",
            help="distance of fine samples, pixels; balanced with the scales if not given",
        ),
        to.add_argument("--sigma-min", type=float, default=1.1, metavar="S", help="first scale"),
        to.add_argument(
            "--kappa", type=float, default=2 ** (1 / 3), metavar="K",
            help="ratio of the two blurs of the difference of Gaussians",
        ),
        to.add_argument(
            "--oversampling", choices=("spline", "cosine"), default="spline",
            help="interpolant of the picture",
        ),
        to.add_argument(
            "--epsilon", type=float, default=0.0, metavar="E",
            help="least difference of an extremum to each of its 26 neighbours",
        ),
        to.add_argument(
            "--refine", action=argparse.BooleanOptionalAction, default=True,
            help="refine extrema by quadratic models, and discard those where that fails",
        ),
        to.add_argument(
            "--max-offset", type=float, default=0.6, metavar="M",
            help="largest accepted offset of a model, grid steps; inf for no limit",
        ),
        to.add_argument(
            "--max-iterations", type=_count, default=2, metavar="N",
            help="most models for one extremum; inf for no limit",
        ),
        to.add_argument(
            "--scale-moves", action=argparse.BooleanOptionalAction, default=True,
            help="let a further model be made at another scale",
        ),
        to.add_argument(
            "--move", choices=("nearest", "unit_step"), default="nearest",
            help="where a further model is made",
        ),
        to.add_argument("--n-oct", type=int, default=1, metavar="N", help="octaves"),
        to.add_argument("--threads", type=int, default=1, metavar="N", help="threads"),
    ]  # fmt: skip
    to.set_defaults(parameters=[flag.dest for flag in flags], output=None)


def _blur_arguments(to: argparse.ArgumentParser) -> None:
    to.set_defaults(run=blur)
    to.add_argument(
        "picture", metavar="PSF", type=Path,
        help="PNG, TIFF, JPEG or npy whose values are proportional to light (no gamma)",
    )  # fmt: skip
    to.add_argument(
        "--oversampling", type=float, default=1.0, metavar="K",
        help="samples of the picture per pixel of the camera",
    )  # fmt: skip
    to.add_argument(
        "--background", type=_background, default=0.0, metavar="B",
        help="level to subtract first, in units of the picture (PNG: 0 to 1), or border for the "
        "median of its outermost samples; 0 if not given",
    )  # fmt: skip


def _background(text: str) -> float | str:
    if text == "border":
        return text
    try:
        return float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is no level; give a number or border") from None


def _truth_arguments(to: argparse.ArgumentParser) -> None:
    to.set_defaults(run=truth)
    to.add_argument("picture", metavar="PICTURE", type=Path, help="PNG, TIFF, JPEG or npy")
    to.add_argument(
        "-o", "--output", metavar="OUT", type=Path, default=argparse.SUPPRESS,
        help="table to write, .csv or .parquet; standard output if not given",
    )  # fmt: skip
    flags = [
        to.add_argument(
            "--camera-blur", type=float, required=True, metavar="C", default=argparse.SUPPRESS,
            help="Gaussian blur that the picture already has, pixels",
        ),
        to.add_argument("--sigma-min", type=float, default=1.1, metavar="S", help="first scale"),
        to.add_argument("--sigma-max", type=float, default=2.2, metavar="S", help="last scale"),
        to.add_argument(
            "--kappa", type=float, default=2 ** (1 / 3), metavar="K",
            help="ratio of the two blurs of the difference of Gaussians",
        ),
        to.add_argument(
            "--n-spo", type=int, nargs="+", default=(5, 10, 15), metavar="N",
            help="scales per octave of the samplings that the search starts from",
        ),
        to.add_argument("--threads", type=int, default=1, metavar="N", help="threads"),
    ]  # fmt: skip
    to.set_defaults(parameters=[flag.dest for flag in flags], output=None)


def _count(text: str) -> float:
    with suppress(ValueError):
        value = float(text)
        if value.is_integer() or not math.isfinite(value):  # the library judges these
            return value
    raise argparse.ArgumentTypeError(f"{text!r} is no whole number; give one, or inf for no limit")


def _seed(text: str) -> int | str:
    try:
        return int(text)
    except ValueError:
        return text


if __name__ == "__main__":
    sys.exit(main())
