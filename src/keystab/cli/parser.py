"""The command line of `keystab`: commands, their arguments, and what runs each."""

from __future__ import annotations

import argparse
import math
from contextlib import suppress
from pathlib import Path
from typing import Any

from keystab._version import __version__
from keystab.cli.audit import audit
from keystab.cli.completion import SHELLS, completion
from keystab.cli.known_parser import BAD_INPUT, Parser
from keystab.cli.library import blur, detect, inspect, scene, simulate, truth, uncertainty
from keystab.cli.study_parser import add_study_commands

__all__ = ["BAD_INPUT", "build_parser"]

_PICTURE = "PNG, TIFF, JPEG, PNM or npy; turned upright as its EXIF orientation asks"


def build_parser() -> Parser:
    """Parser of all commands."""
    parser = Parser(
        prog="keystab",
        description="Simulated views, scale-space keypoints, and what files hold.",
    )
    parser.add_argument("--version", action="version", version=f"keystab {__version__}")
    parser.begin_commands()
    _simulate_arguments(
        parser.add_command(
            "simulate",
            help="take a view of a picture with a simulated camera",
            description="Blur a picture and sample it, as a camera that sees it would: exactly, "
            "at any zoom, shift and rotation. The view is centred on the picture, which goes on "
            "beyond its border as its mirror image.",
        )
    )
    _scene_arguments(
        parser.add_command(
            "scene",
            help="make a scene: leaves, a random field, edges, strokes or text",
            description="Make a picture of a kind whose properties are known, to be seen by a "
            "simulated camera or studied as any photograph. The same seed gives the same pixels.",
            formatter_class=argparse.ArgumentDefaultsHelpFormatter,
        )
    )
    _detect_arguments(
        parser.add_command(
            "detect",
            help="detect the keypoints of a picture",
            description="Detect the extrema of the difference-of-Gaussians scale-space of a "
            "picture, without any filter of contrast or edges.",
            formatter_class=argparse.ArgumentDefaultsHelpFormatter,
        )
    )
    _uncertainty_arguments(
        parser.add_command(
            "uncertainty",
            help="detect keypoints, with error bars and the chance that each is found again",
            description="Detect the keypoints of a photograph, and say of each how far off it is "
            "and how likely a second shot of the same scene has it again.",
            formatter_class=argparse.ArgumentDefaultsHelpFormatter,
        )
    )
    _blur_arguments(
        parser.add_command(
            "blur",
            help="fit a Gaussian to a picture of a point spread function",
            description="Say what camera blur a measured point spread function has: the standard "
            "deviation of the Gaussian that fits its picture best in least squares, for "
            "--camera-blur of keystab detect.",
        )
    )
    _truth_arguments(
        parser.add_command(
            "truth",
            help="find the true extrema of a picture",
            description="Find all extrema of the continuous difference-of-Gaussians scale-space "
            "of a picture, to some twelve digits: what a detector at any sampling should find.",
            formatter_class=argparse.ArgumentDefaultsHelpFormatter,
        )
    )
    _audit_arguments(
        parser.add_command(
            "audit",
            help="hold detectors of others, or one of your own, against what is there",
            description="Show detectors views of a scene and isolated blobs whose extrema are "
            "known, and write what they find of these, how far off it is and what two views "
            "share: audit.csv, a figure, and audit.md, which says it in words. Of libraries: "
            "opencv, skimage, vlfeat, colmap, kaze, akaze, kornia, keystab, where they are "
            "installed; make audit installs all but kornia in .venv-audit (--python).",
        )
    )
    _inspect_arguments(
        parser.add_command(
            "inspect",
            help="say what a picture, a store or a table holds, or what keystab runs with here",
            description="Say in words what a picture, a stored scale-space, a stored set of views "
            "or a table of keypoints holds; with --environment, what keystab runs with here, for "
            "reports of errors.",
        )
    )
    add_study_commands(parser.add_command)
    to = parser.add_command(
        "completion",
        help="print what makes a shell complete this command",
        description="Print a script that makes the Tab key of a shell complete commands, options "
        "and their words. For bash: keystab completion bash > "
        "~/.local/share/bash-completion/completions/keystab; for zsh, _keystab in a folder of "
        "$fpath; for fish, ~/.config/fish/completions/keystab.fish.",
    )
    to.add_argument("shell", metavar="SHELL", choices=SHELLS, help=", ".join(SHELLS))
    to.set_defaults(run=completion, parser=parser)
    return parser


def _inspect_arguments(to: Parser) -> None:
    to.set_defaults(run=inspect)
    to.add_argument(
        "path", metavar="PATH", type=Path, nargs="?", help="picture, store, .csv or .parquet table"
    )
    to.add_argument(
        "--environment", action="store_true",
        help="say the versions of keystab, Python and the libraries, and what the machine is",
    )  # fmt: skip


def _simulate_arguments(to: Parser) -> None:
    to.set_defaults(run=simulate)
    to.add_argument("picture", metavar="PICTURE", type=Path, help=f"the scene: {_PICTURE}")
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


def _scene_arguments(to: Parser) -> None:
    to.set_defaults(run=scene)
    to.add_argument("kind", metavar="KIND", help="dead-leaves, fractal, edges, line-art or text")
    to.add_argument(
        "-o", "--output", metavar="OUT", type=Path, required=True,
        help="picture to write: .png (16 bits), .tiff (float32) or .npy (float64)",
    )  # fmt: skip
    to.add_argument(
        "--shape", type=int, nargs=2, metavar=("H", "W"), default=(1600, 2400),
        help="height and width in pixels",
    )  # fmt: skip
    to.add_argument("--seed", type=int, default=0, metavar="N", help="which one")
    to.add_argument(
        "--exponent", type=float, default=2.4, metavar="E",
        help="of fractal: how fast the power spectrum falls, 0 to 4",
    )  # fmt: skip
    to.add_argument(
        "--angle", type=float, default=0.0, metavar="DEG",
        help="of edges and line-art: direction of their sides, 0 to 90 degrees from the rows",
    )  # fmt: skip


def _detect_arguments(to: Parser) -> None:
    to.set_defaults(run=detect)
    flags = _search_flags(to, "sign", n_spo=3, n_oct=1)
    to.set_defaults(parameters=[flag.dest for flag in flags])


def _uncertainty_arguments(to: Parser) -> None:
    to.set_defaults(run=uncertainty)
    colours = ("survival", "sign", "conditioning")
    flags = _search_flags(to, *colours, n_spo=15, n_oct="all")
    flags.append(
        to.add_argument(
            "--noise", type=float, nargs="+", action=_Noise, metavar="SD",
            help="noise of a pixel, its standard deviation in units of the range [0, 1]; or two "
            "numbers, A B, for a variance of A + B times the grey value; estimated from the "
            "picture if not given",
        )
    )  # fmt: skip
    to.set_defaults(parameters=[flag.dest for flag in flags])


class _Noise(argparse.Action):
    """One number, or two."""

    def __call__(
        self,
        parser: argparse.ArgumentParser,
        namespace: argparse.Namespace,
        values: Any,
        option_string: str | None = None,
    ) -> None:
        if len(values) > 2:
            parser.error(f"argument {option_string}: {len(values)} numbers; give one or two")
        setattr(namespace, self.dest, values[0] if len(values) == 1 else tuple(values))


def _table_arguments(to: Parser, *colours: str) -> argparse.Action:
    """Add picture, table, drawing and camera blur; returns the last."""
    to.add_argument("picture", metavar="PICTURE", type=Path, help=_PICTURE)
    to.add_argument(
        "-o", "--output", metavar="OUT", type=Path, default=argparse.SUPPRESS,
        help="table to write, .csv or .parquet; if not given, a terminal gets a summary, and a "
        "pipe the table as CSV",
    )  # fmt: skip
    drawing = to.add_group("drawing")
    drawing(
        "--draw", metavar="FILE", type=Path, default=argparse.SUPPRESS,
        help="draw the keypoints on the picture, .png or .svg: circles of radius sigma, 95 %% "
        "ellipses where there are error bars",
    )  # fmt: skip
    drawing(
        "--colour", choices=colours, default=argparse.SUPPRESS,
        help=f"what colours tell; {colours[0]} if not given",
    )  # fmt: skip
    drawing(
        "--part", type=int, nargs=4, metavar=("Y", "X", "H", "W"), default=argparse.SUPPRESS,
        help="draw a part: first row, first column, height and width in pixels",
    )  # fmt: skip
    drawing(
        "--enlarge", type=float, metavar="F", default=argparse.SUPPRESS,
        help="enlarge ellipses so many times; if not given, so that half of them fit their circles",
    )  # fmt: skip
    to.set_defaults(output=None, draw=None, colour=None, part=None, enlarge=None)
    return to.add_argument(
        "--camera-blur", type=_blur, required=True, metavar="C", default=argparse.SUPPRESS,
        help="Gaussian blur that the picture already has, pixels: 0.5 to 1 for an ordinary camera "
        "at full resolution; auto estimates it from edges",
    )  # fmt: skip


def _search_flags(to: Parser, *colours: str, n_spo: int, n_oct: int | str) -> list[argparse.Action]:
    """Add the parameters of a detection; returns them."""
    return [
        _table_arguments(to, *colours),
        to.add_argument("--n-spo", type=int, default=n_spo, metavar="N", help="scales per octave"),
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
        to.add_argument(
            "--n-oct", type=_n_oct, default=n_oct, metavar="N",
            help="octaves; all for those up to a quarter of the picture's shorter side",
        ),
        to.add_argument("--threads", type=int, default=1, metavar="N", help="threads"),
    ]  # fmt: skip


def _blur_arguments(to: Parser) -> None:
    to.set_defaults(run=blur)
    to.add_argument(
        "picture", metavar="PSF", type=Path,
        help=f"{_PICTURE}; its values are proportional to light (no gamma)",
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


def _truth_arguments(to: Parser) -> None:
    to.set_defaults(run=truth)
    flags = [
        _table_arguments(to, "sign", "conditioning"),
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
    to.set_defaults(parameters=[flag.dest for flag in flags])


def _audit_arguments(to: Parser) -> None:
    to.set_defaults(run=audit)
    to.add_argument(
        "detectors", metavar="DETECTOR", nargs="+",
        help="a library's name; module:function, a function of a grey image in [0, 1] and its "
        "camera blur that returns a table with y, x, sigma, rows of them, or a list of "
        "cv2.KeyPoint; or a command in quotes, \"my_detector {picture} {table}\", that reads a PNG "
        "and writes a CSV with y, x, sigma in its first line; {camera_blur} may stand in it too",
    )  # fmt: skip
    to.add_argument(
        "-o", "--output", metavar="FOLDER", type=Path, required=True, help="folder to write to"
    )
    to.add_argument(
        "--scene", metavar="PICTURE", type=Path,
        help=f"what views show: {_PICTURE}; dead leaves if not given",
    )  # fmt: skip
    to.add_argument("--quick", action="store_true", help="fewer and smaller views")
    to.add_argument(
        "--convention", metavar="ORIGIN,ORDER,SCALE",
        help="what your own detector means, such as 0.5,xy,diameter: coordinate of the centre of "
        "the first pixel; yx or xy, the order of rows without names; sigma, radius, diameter or "
        "how many times sigma; 0,yx,sigma if not given",
    )  # fmt: skip
    to.add_argument(
        "--python", metavar="PATH",
        help="Python that runs the detectors, of an environment that has them and numpy; this one "
        "if not given",
    )  # fmt: skip
    to.add_argument(
        "--time-limit", type=_seconds, default=20.0, metavar="S",
        help="seconds that a detector may take for a picture (default 20): of the processor, where "
        "that is known, and five times as many by the clock",
    )  # fmt: skip
    to.add_argument(
        "--threads", type=int, default=2, metavar="N", help="threads of the truth (default 2)"
    )


def _seconds(text: str) -> float:
    with suppress(ValueError):
        if 0 < float(text) < math.inf:
            return float(text)
    raise argparse.ArgumentTypeError(f"{text!r} is no time; give a number of seconds above 0")


def _blur(text: str) -> float | str:
    if text == "auto":
        return text
    try:
        return float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is no blur; give a number or auto") from None


def _n_oct(text: str) -> int | str:
    if text == "all":
        return text
    try:
        return int(text)
    except ValueError:
        raise argparse.ArgumentTypeError(
            f"{text!r} is no number of octaves; give a whole number or all"
        ) from None


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
