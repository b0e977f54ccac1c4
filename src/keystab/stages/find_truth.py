"""Find the true extrema of the octave of a view that the samplings sample."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from keystab.stages import _run


@_run.stage
def main(argv: Sequence[str] | None = None) -> None:
    """Read the view; write its true extrema."""
    parser = _run.parser(__doc__)
    _run.views_arguments(parser)
    _run.scale_arguments(parser)
    _run.required(parser, "sigma-max", "last scale in pixels", type=float)
    _run.required(parser, "table", "table to write", type=Path)
    args = parser.parse_args(argv)

    from keystab.io.tables import write_table
    from keystab.io.view_store import read_view
    from keystab.truth.true_extrema import true_extrema

    view = read_view(args.views, args.views_digest)
    extrema = true_extrema(view.image, view.blur, args.sigma_min, args.sigma_max, args.kappa)
    write_table(extrema, args.table)
    print(f"{len(extrema)} true extrema")


if __name__ == "__main__":
    raise SystemExit(main())
