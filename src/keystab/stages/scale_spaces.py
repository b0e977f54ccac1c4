"""Store the scale-spaces of all views of a set at one sampling."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from keystab.stages import _run


@_run.stage
def main(argv: Sequence[str] | None = None) -> None:
    """Read the views, write one store per view and octave, seal them together."""
    parser = _run.parser(__doc__)
    _run.views_arguments(parser)
    _run.view_detector_arguments(parser)
    _run.required(parser, "store", "folder of stores to write", type=Path)
    _run.required(parser, "digest", "seal of the stores to write", type=Path)
    args = parser.parse_args(argv)

    from keystab.io.checksums import write_seal
    from keystab.io.scale_space_store import write_scale_space
    from keystab.io.view_store import read_views
    from keystab.stages._scale_spaces import store_of, view_detector

    views = read_views(args.views, args.views_digest)
    for number, view in enumerate(views):
        for octave, space in enumerate(view_detector(args, view).octaves(view.image)):
            write_scale_space(space, store_of(args.store, number, octave))
    write_seal(args.store, args.digest)
    print(f"the scale-spaces of {len(views)} views")


if __name__ == "__main__":
    raise SystemExit(main())
