"""Simulate a set of views of the reference picture and store it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from keystab.stages import _run


@_run.stage
def main(argv: Sequence[str] | None = None) -> None:
    """Read the picture, take the views, write and seal the store."""
    parser = _run.parser(__doc__)
    required = _run.required
    required(parser, "reference", "picture", type=Path)
    required(parser, "reference-sha256", "SHA-256 of its pixels", type=_run.optional(str))
    required(parser, "reference-blur", "blur of the picture itself, pixels", type=float)
    required(parser, "set", "name of the set of views")
    required(parser, "blur", "camera blur, one or one per view", type=float, nargs="+")
    required(parser, "step", "subsampling step", type=float, nargs="+")
    required(parser, "shift-y", "shift down, pixels of the view", type=float, nargs="+")
    required(parser, "shift-x", "shift right, pixels of the view", type=float, nargs="+")
    required(parser, "rotation", "rotation in radians", type=float, nargs="+")
    required(parser, "noise", "standard deviation of the noise", type=float, nargs="+")
    required(parser, "height", "height of the views, pixels", type=_run.optional(int))
    required(parser, "width", "width of the views, pixels", type=_run.optional(int))
    whole = "whether every view shows the whole reference"
    required(parser, "whole", whole, type=_run.boolean)
    required(parser, "guard", "width of the guard band, pixels", type=int)
    required(parser, "dtype", "number type in the store", choices=("float32", "float64"))
    required(parser, "store", "store to write", type=Path)
    required(parser, "digest", "seal of the store to write", type=Path)
    args = parser.parse_args(argv)

    from keystab.camera.simulation import Scene, simulate
    from keystab.camera.view_sets import view_specs
    from keystab.errors import InputError
    from keystab.io.checksums import write_seal
    from keystab.io.pictures import read_with_digest
    from keystab.io.view_store import write_views

    picture, digest = read_with_digest(args.reference)
    if args.reference_sha256 not in (None, digest):
        raise InputError(
            f"{args.reference} is not the picture that the config means: its pixels have the "
            f"SHA-256 {digest}; for this picture write reference_sha256: {digest} or null"
        )
    scene = Scene(picture)
    specs = view_specs(args.set, vars(args), scene.shape)
    attributes = {
        "set": args.set,
        "reference_sha256": digest,
        "reference_blur": args.reference_blur,
        "reference_shape": list(scene.shape),
    }
    images = (simulate(scene, spec) for spec in specs)
    write_views(images, specs, args.store, attributes, args.dtype)
    write_seal(args.store, args.digest)
    print(f"{len(specs)} view(s), the first of {specs[0].shape[0]} x {specs[0].shape[1]} px")


if __name__ == "__main__":
    raise SystemExit(main())
