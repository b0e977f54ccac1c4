"""Commands on pictures and files: simulate, detect, uncertainty, truth, blur, inspect."""

from __future__ import annotations

import argparse
import math
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from keystab.errors import InputError

if TYPE_CHECKING:
    import numpy as np
    import pandas as pd


def simulate(args: argparse.Namespace) -> None:
    """Take a view of a picture with the simulated camera and write it."""
    import keystab
    from keystab.io.pictures import FORMATS, read_picture, write_picture
    from keystab.utils.files import check_writable
    from keystab.utils.validation import number

    check_writable(args.out, FORMATS)
    if args.picture.exists() and args.out.exists() and args.out.samefile(args.picture):
        raise InputError(f"{args.out} is the picture itself; give another name to the view")
    view = keystab.simulate_view(
        read_picture(args.picture),
        args.blur,
        args.step,
        args.shape and tuple(args.shape),
        tuple(args.shift),
        math.radians(number("rotation", args.rotation)),
        args.noise,
        args.seed,
    )
    write_picture(view, args.out)
    outside = int(((view < 0) | (view > 1)).sum())
    pixels = f"{outside} pixel{'s' * (outside != 1)}"
    clipped = f"; {pixels} clipped to [0, 1]" if outside and _is_png(args.out) else ""
    print(
        f"{args.out}: {view.shape[0]} x {view.shape[1]} pixels, camera blur {args.blur:g}{clipped}",
        file=sys.stderr,
    )


def scene(args: argparse.Namespace) -> None:
    """Make a scene and write it."""
    import keystab
    from keystab.io.pictures import FORMATS, write_picture
    from keystab.utils.files import check_writable

    check_writable(args.output, FORMATS)
    height, width = args.shape
    made = keystab.make_scene(
        args.kind, (height, width), args.seed, exponent=args.exponent, angle=args.angle
    )
    write_picture(made, args.output)
    print(
        f"{args.output}: {height} x {width} pixels, {args.kind}, seed {args.seed}", file=sys.stderr
    )


def detect(args: argparse.Namespace) -> None:
    """Detect the keypoints of a picture and write them as a table."""
    import keystab

    _tabulate(args, keystab.detect_keypoints, ("keypoint", "keypoints"))


def uncertainty(args: argparse.Namespace) -> None:
    """Detect keypoints, with error bars and the chance that each is found again."""
    import keystab

    _tabulate(args, keystab.keypoint_uncertainty, ("keypoint", "keypoints"))


def truth(args: argparse.Namespace) -> None:
    """Find the true extrema of a picture and write them as a table."""
    import keystab

    _tabulate(args, keystab.true_extrema, ("extremum", "extrema"))


def blur(args: argparse.Namespace) -> None:
    """Fit a Gaussian to the picture of a point spread function and say how wide it is."""
    import keystab
    from keystab.io.pictures import read_picture

    picture = read_picture(args.picture)
    try:
        fit = keystab.fit_psf(picture, args.oversampling, args.background)
    except InputError as error:
        raise InputError(f"{args.picture}: {error}") from None
    print(
        f"camera blur c    {fit.blur:.4g} pixels\n"
        f"centre           y {fit.y:.2f}, x {fit.x:.2f} in the picture's samples\n"
        f"principal axes   {fit.major:.4g} and {fit.minor:.4g} pixels, "
        f"the longer at {math.degrees(fit.angle):.0f} degrees from x towards y\n"
        f"residual         {fit.residual:.1%} of the picture's root mean square; "
        f"{fit.general_residual:.1%} with two axes\n"
        f"background       {fit.background:.4g}"
    )


def _tabulate(
    args: argparse.Namespace, find: Callable[..., pd.DataFrame], nouns: tuple[str, str]
) -> None:
    """Write what a function finds in a picture; say how many they are and how long it took."""
    from keystab.io.pictures import read_picture
    from keystab.io.tables import to_csv, write_table
    from keystab.utils.progress import watched

    _check_outputs(args)
    image = read_picture(args.picture)
    if args.draw is not None:
        from keystab.figures.overlay import check_drawing, draw_keypoints

        check_drawing(image.shape, args.part, args.enlarge)
    options = {name: getattr(args, name) for name in args.parameters}
    if options["camera_blur"] == "auto":
        options["camera_blur"] = _blur_of_edges(args, image)
    _warn_of_coarse_sampling(args)
    if options.get("noise", 0) is None:
        _warn_of_compression(args.picture)
    start = time.monotonic()
    with watched():
        found = find(image, **options)
    seconds = time.monotonic() - start
    if args.output is not None:
        write_table(found, args.output)
    elif args.draw is None and not sys.stdout.isatty():
        sys.stdout.write(to_csv(found))
    noun = nouns[len(found) != 1]
    octaves = f" in {_octaves(options['n_oct'])}" if "n_oct" in options else ""
    print(f"{args.picture}: {len(found)} {noun}{octaves}, {seconds:.1f} s", file=sys.stderr)
    if args.draw is not None or args.output is not None or sys.stdout.isatty():
        # Where nobody looks, standard output is for rows: a program that reads it finds none.
        print(_summary(args, found), file=None if sys.stdout.isatty() else sys.stderr)
    if args.draw is not None:
        said = draw_keypoints(image, found, args.draw, args.colour, args.part, args.enlarge)
        print(f"{args.draw}: {said}", file=sys.stderr)


def _octaves(n_oct: int | str) -> str:
    if n_oct == "all":
        return "all octaves"
    return "1 octave (--n-oct all for more)" if n_oct == 1 else f"{n_oct} octaves"


def _summary(args: argparse.Namespace, found: pd.DataFrame) -> str:
    """What a person wants to know of a table before its rows."""
    lines = []
    if len(found):
        maxima = int((found["sign"] > 0).sum())
        lines += [
            f"maxima, minima   {maxima}, {len(found) - maxima}",
            f"sigma            {found['sigma'].min():.3g} to {found['sigma'].max():.3g} px, "
            f"half of them below {found['sigma'].median():.3g}",
        ]
    if len(found) and "survival" in found:
        off = found[["std_y", "std_x"]].max(axis=1)
        scale = math.expm1(found["std_log_sigma"].median())
        lines += [
            f"position         half have a standard deviation below {off.median():.2g} px, nine "
            f"tenths below {off.quantile(0.9):.2g}",
            f"scale            half have one below {scale:.1%}",
            f"survival         {(found['survival'] > 0.9).mean():.0%} above 0.9, "
            f"{(found['survival'] < 0.5).mean():.0%} below 0.5",
            f"noise            {found['noise'].median():.3g}, "
            + ("estimated from the picture" if args.noise is None else "as given"),
        ]
    if args.output is None and args.draw is None:
        lines.append("-o TABLE.csv writes the rows, --draw FILE.png draws them")
    return "\n".join(lines)


def _blur_of_edges(args: argparse.Namespace, image: np.ndarray) -> float:
    """Camera blur from the picture's edges; says what was found and what a wrong one does."""
    import keystab

    try:
        found = keystab.edge_blur(image)
    except InputError as error:
        raise InputError(f"{args.picture}: {error}") from None
    # An extremum at sigma of a picture of blur c lies at the same sigma^2 - c^2, whatever c is.
    off = math.sqrt(args.sigma_min**2 + found.high**2 - found.blur**2) / args.sigma_min - 1
    print(
        f"{args.picture}: camera blur {found.blur:.2f} px ({found.low:.2f} to {found.high:.2f}), "
        f"from {found.n_edges} pixels on edges; if it were {found.high:.2f}, scales near "
        f"{args.sigma_min:g} px would be {off:.0%} larger",
        file=sys.stderr,
    )
    if found.blur > args.sigma_min:
        raise InputError(
            f"{args.picture}: its blur of {found.blur:.2f} px is above sigma_min, "
            f"{args.sigma_min:g}: give --sigma-min {math.ceil(10 * found.blur) / 10:g}"
        )
    return found.blur


def _warn_of_coarse_sampling(args: argparse.Namespace) -> None:
    """Say where samples lie too far apart to see the first scale."""
    step = getattr(args, "delta_min", None)
    if step is not None and math.isfinite(step) and step > args.sigma_min > 0:
        print(
            f"warning: samples {step:g} px apart do not resolve a blur of {args.sigma_min:g} px: "
            "most of what is found will be chance; give a smaller --delta-min",
            file=sys.stderr,
        )


def _warn_of_compression(picture: Path) -> None:
    """Say where noise cannot be told from the picture."""
    with picture.open("rb") as file:
        jpeg = file.read(3) == b"\xff\xd8\xff"
    if jpeg:
        print(
            f"warning: {picture} is a JPEG, which loses the finest noise, so that too little is "
            "estimated and error bars are too short; give --noise",
            file=sys.stderr,
        )


def inspect(args: argparse.Namespace) -> None:
    """Say in words what a picture, a store or a table holds, or what keystab runs with."""
    if args.environment:
        from keystab.cli.environment import environment

        print(environment())
    elif args.path is None:
        raise InputError("nothing to look into: give a picture, a store or a table")
    if args.path is not None:
        from keystab.io.describe import describe

        print(describe(args.path))


def _check_outputs(args: argparse.Namespace) -> None:
    """Refuse what cannot be written, or drawn, before anything is computed."""
    from keystab.io.tables import FORMATS
    from keystab.utils.files import check_writable

    if args.output is not None:
        check_writable(args.output, FORMATS)
    if args.draw is not None:
        check_writable(args.draw, (".png", ".svg"))
        if args.draw.exists() and args.picture.exists() and args.draw.samefile(args.picture):
            raise InputError(f"{args.draw} is the picture itself; give another name to the drawing")
    elif args.part is not None or args.colour is not None or args.enlarge is not None:
        raise InputError("--part, --colour and --enlarge are about a drawing: give --draw FILE.png")


def _is_png(path: Path) -> bool:
    return path.suffix.lower() == ".png"
