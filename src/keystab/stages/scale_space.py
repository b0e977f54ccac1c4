"""Store one balanced scale-space of a view."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from keystab.stages import _run


@_run.stage
def main(argv: Sequence[str] | None = None) -> None:
    """Read the view, evaluate its scale-space into a store, seal it."""
    parser = _run.parser(__doc__)
    _run.views_arguments(parser)
    _run.required(parser, "n-spo", "scales per octave", type=int)
    _run.detector_arguments(parser)
    _run.required(parser, "store", "store to write", type=Path)
    _run.required(parser, "digest", "seal of the store to write", type=Path)
    args = parser.parse_args(argv)

    from keystab.io.checksums import write_seal
    from keystab.io.scale_space_store import write_scale_space
    from keystab.io.view_store import read_view
    from keystab.scalespace.dog import scale_space

    view = read_view(args.views, args.views_digest)
    space = scale_space(
        view.image,
        view.blur,
        n_spo=args.n_spo,
        sigma_min=args.sigma_min,
        kappa=args.kappa,
        oversampling=args.oversampling,
    )
    write_scale_space(space, args.store)
    write_seal(args.store, args.digest)
    print("x".join(map(str, space.shape)), "samples")


if __name__ == "__main__":
    raise SystemExit(main())
