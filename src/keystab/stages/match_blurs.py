"""Compare views of wrongly assumed blur with the view of the assumed blur (figure S2)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from keystab.stages import _run


@_run.stage
def main(argv: Sequence[str] | None = None) -> None:
    """Read extrema and traces of the set; write one row per view and range of scales."""
    parser = _run.parser(__doc__)
    _run.views_arguments(parser)
    _run.required(parser, "extrema", "extrema", type=Path)
    _run.required(parser, "traces", "their refinement traces", type=Path)
    _run.required(parser, "assumed-blur", "camera blur that was assumed, pixels", type=float)
    _run.required(parser, "kappa", "ratio of the two blurs", type=float)
    _run.view_range_arguments(parser)
    _run.same_arguments(parser)
    _run.refinement_arguments(parser)
    _run.required(parser, "table", "table to write", type=Path)
    args = parser.parse_args(argv)

    from keystab.detection.refinement import refined_keypoints
    from keystab.errors import InputError
    from keystab.experiments.blur_errors import blur_error_table
    from keystab.io.tables import read_table, write_table
    from keystab.io.view_store import read_views
    from keystab.stages._compared import common_range, same_options

    views = read_views(args.views, args.views_digest)
    blurs = [spec.blur for spec in views.specs]
    if blurs[0] != args.assumed_blur:
        raise InputError(
            f"the first view has blur {blurs[0]:g}, wanted is the assumed {args.assumed_blur:g}: "
            "put it first in the list of blurs"
        )
    everywhere = common_range(views, args)
    keypoints = refined_keypoints(
        read_table(args.extrema), read_table(args.traces), args.max_offset, args.max_iterations
    )
    low = everywhere.low
    # Keypoints move across the ends of the ranges: those beyond are needed as counterparts.
    searched = replace(everywhere, low=0.0)
    table = blur_error_table(
        searched.common(keypoints),
        blurs,
        args.assumed_blur,
        args.kappa,
        {"first octave": (low, 2 * low), "second octave": (2 * low, 4 * low)},
        same_options(args),
    )
    write_table(table, args.table)
    print(table.to_string(index=False))


if __name__ == "__main__":
    raise SystemExit(main())
