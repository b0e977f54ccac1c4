"""Match the keypoints of SIFT as shipped, with and without its filters (figure 7)."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from keystab.stages import _run


@_run.stage
def main(argv: Sequence[str] | None = None) -> None:
    """Read extrema and traces of a set; write curves and counts, filtered and not."""
    parser = _run.parser(__doc__)
    _run.views_arguments(parser)
    _run.required(parser, "extrema", "extrema", type=Path)
    _run.required(parser, "traces", "their refinement traces", type=Path)
    _run.view_range_arguments(parser)
    _run.same_arguments(parser)
    _run.refinement_arguments(parser)
    _run.required(parser, "contrast", "least absolute DoG value", type=float)
    _run.required(parser, "edge-ratio", "largest ratio of principal curvatures", type=float)
    _run.required(parser, "n-resamples", "bootstrap resamples", type=int)
    _run.required(parser, "curves", "table of curves to write", type=Path)
    _run.required(parser, "counts", "table of counts to write", type=Path)
    args = parser.parse_args(argv)

    import pandas as pd

    from keystab.detection.refinement import refined_keypoints
    from keystab.detection.sift_filters import passes_filters
    from keystab.experiments.view_stability import count_table, curve_table, match_views
    from keystab.io.tables import read_table, write_table
    from keystab.io.view_store import read_views
    from keystab.stages._compared import common_range, same_options

    views = read_views(args.views, args.views_digest)
    everywhere, same = common_range(views, args), same_options(args)
    keypoints = refined_keypoints(
        read_table(args.extrema), read_table(args.traces), args.max_offset, args.max_iterations
    )
    filtered = keypoints[passes_filters(keypoints, args.contrast, args.edge_ratio)]
    curves, counts = [], []
    for name, table in (("unfiltered", keypoints), ("filtered", filtered)):
        matched = match_views(everywhere.common(table), len(views), same)
        curves.append(curve_table(matched, {"shipped": name}, args.n_resamples))
        counts.append(count_table(matched, {"shipped": name}))
    write_table(pd.concat(curves, ignore_index=True), args.curves)
    write_table(pd.concat(counts, ignore_index=True), args.counts)
    print(pd.concat(counts, ignore_index=True).to_string(index=False))


if __name__ == "__main__":
    raise SystemExit(main())
