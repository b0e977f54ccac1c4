"""Commands on pictures and files: simulate, detect, blur, truth, inspect."""

from __future__ import annotations

import argparse
import dataclasses
import math
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from keystab.errors import InputError

if TYPE_CHECKING:
    import pandas as pd


def simulate(args: argparse.Namespace) -> None:
    """Take a view of a picture with the simulated camera and write it."""
    from keystab.camera.simulation import Scene
    from keystab.camera.simulation import simulate as take
    from keystab.camera.views import ViewSpec
    from keystab.io.pictures import FORMATS, read_picture, write_picture
    from keystab.utils.files import check_writable
    from keystab.utils.validation import number

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
    from keystab.detection.detector import detect_keypoints

    _tabulate(args, detect_keypoints, ("keypoint", "keypoints"))


def blur(args: argparse.Namespace) -> None:
    """Fit a Gaussian to the picture of a point spread function and say how wide it is."""
    from keystab.camera.psf_fit import border_level, fit_psf
    from keystab.io.pictures import read_picture

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
    from keystab.truth.true_extrema import true_extrema

    _tabulate(args, true_extrema, ("extremum", "extrema"))


def _tabulate(
    args: argparse.Namespace, find: Callable[..., pd.DataFrame], nouns: tuple[str, str]
) -> None:
    """Write what a function finds in a picture; say how many they are and how long it took."""
    from keystab.io.pictures import read_picture
    from keystab.io.tables import to_csv, write_table

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
    from keystab.io.describe import describe

    print(describe(args.path))


def _check_table(path: Path | None) -> None:
    """Refuse a table that cannot be written before anything is computed."""
    from keystab.io.tables import FORMATS
    from keystab.utils.files import check_writable

    if path is not None:
        check_writable(path, FORMATS)


def _is_png(path: Path) -> bool:
    return path.suffix.lower() == ".png"
