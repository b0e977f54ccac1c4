"""Find the true extrema of the scene, as a view of the whole of it sees them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from keystab.stages import _run


@_run.stage
def main(argv: Sequence[str] | None = None) -> None:
    """Read the picture and how the view was taken; write the extrema of the picture's series."""
    parser = _run.parser(__doc__)
    _run.required(parser, "reference", "picture", type=Path)
    _run.required(parser, "reference-blur", "blur of the picture itself, pixels", type=float)
    _run.views_arguments(parser)
    _run.scale_arguments(parser)
    _run.required(parser, "sigma-max", "last scale in pixels", type=float)
    _run.required(parser, "table", "table to write", type=Path)
    args = parser.parse_args(argv)

    from keystab.io.pictures import read_picture
    from keystab.io.tables import write_table
    from keystab.io.view_store import read_views
    from keystab.truth.scene_extrema import scene_extrema

    spec = read_views(args.views, args.views_digest).specs[0]
    extrema = scene_extrema(
        read_picture(args.reference),
        spec,
        args.sigma_min,
        args.sigma_max,
        args.kappa,
        args.reference_blur,
    )
    write_table(extrema, args.table)
    print(f"{len(extrema)} true extrema of the scene")


if __name__ == "__main__":
    raise SystemExit(main())
