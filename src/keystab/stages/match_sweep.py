"""Match the detections of several sets of views that differ in one value (figures 10 to 12)."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from keystab.stages import _run


@_run.stage
def main(argv: Sequence[str] | None = None) -> None:
    """Read extrema and traces of several sets at one sampling; write tables of all."""
    parser = _run.parser(__doc__)
    _run.required(parser, "views", "stores of the sets", type=Path, nargs="+")
    _run.required(parser, "views-digest", "their seals", type=Path, nargs="+")
    _run.required(parser, "extrema", "extrema of each set", type=Path, nargs="+")
    _run.required(parser, "traces", "their refinement traces", type=Path, nargs="+")
    _run.required(parser, "name", "name of the value in which the sets differ")
    _run.required(parser, "values", "the value of each set", type=float, nargs="+")
    _run.view_range_arguments(parser)
    _run.same_arguments(parser)
    _run.refinement_arguments(parser)
    parser.add_argument("--starts", help="first scales of octaves", type=float, nargs="*")
    parser.add_argument("--seen-by", help="share of the views that see a keypoint", type=float)
    _run.required(parser, "n-resamples", "bootstrap resamples", type=int)
    _run.required(parser, "curves", "table of curves to write", type=Path)
    _run.required(parser, "counts", "table of counts to write", type=Path)
    parser.add_argument("--scales", help="table against scale to write", type=Path)
    args = parser.parse_args(argv)
    if not bool(args.starts) == (args.scales is not None) == (args.seen_by is not None):
        parser.error("--starts, --seen-by and --scales go together: give all or none")

    import pandas as pd

    from keystab.detection.refinement import refined_keypoints
    from keystab.experiments.view_stability import (
        count_table,
        curve_table,
        match_views,
        scale_table,
    )
    from keystab.io.tables import read_table, write_table
    from keystab.io.view_store import read_views
    from keystab.stages._compared import common_range, same_options

    same = same_options(args)
    curves, counts, scales = [], [], []
    for value, store, digest, extrema, traces in zip(
        args.values, args.views, args.views_digest, args.extrema, args.traces, strict=True
    ):
        views = read_views(store, digest)
        everywhere = common_range(views, args)
        keypoints = refined_keypoints(
            read_table(extrema), read_table(traces), args.max_offset, args.max_iterations
        )
        labels = {args.name: value}
        matched = match_views(everywhere.common(keypoints), len(views), same)
        curves.append(curve_table(matched, labels, args.n_resamples))
        counts.append(count_table(matched, labels))
        if args.scales:
            scales.append(
                scale_table(
                    keypoints, everywhere, args.starts, same, args.seen_by, labels, args.n_resamples
                )
            )
    write_table(pd.concat(curves, ignore_index=True), args.curves)
    write_table(pd.concat(counts, ignore_index=True), args.counts)
    if args.scales:
        write_table(pd.concat(scales, ignore_index=True), args.scales)
    print(pd.concat(counts, ignore_index=True).to_string(index=False))


if __name__ == "__main__":
    raise SystemExit(main())
