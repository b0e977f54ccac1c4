"""Match the detections of all views of a set, sampling by sampling (figures 7, 8 and S1)."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from keystab.stages import _run


@_run.stage
def main(argv: Sequence[str] | None = None) -> None:
    """Read extrema and traces of a set at several samplings; write curves, precision and counts."""
    parser = _run.parser(__doc__)
    _run.views_arguments(parser)
    _run.required(parser, "extrema", "extrema at each sampling", type=Path, nargs="+")
    _run.required(parser, "traces", "their refinement traces", type=Path, nargs="+")
    _run.required(parser, "n-spo", "n_spo of each sampling", type=int, nargs="+")
    _run.required(parser, "curve-n-spo", "n_spo to draw curves of", type=int, nargs="+")
    _run.view_range_arguments(parser)
    _run.same_arguments(parser)
    _run.refinement_arguments(parser)
    _run.required(parser, "max-offsets", "further M_offset of curves", type=float, nargs="*")
    _run.required(parser, "iterations", "further N_interp of curves", type=int, nargs="*")
    _run.required(parser, "minimum-share", "views that precision needs", type=float)
    _run.required(parser, "n-resamples", "bootstrap resamples", type=int)
    _run.required(parser, "curves", "table of curves to write", type=Path)
    _run.required(parser, "precision", "table of precisions to write", type=Path)
    _run.required(parser, "counts", "table of counts to write", type=Path)
    args = parser.parse_args(argv)

    import math

    import pandas as pd

    from keystab.detection.refinement import MOST_MODELS, refined_keypoints
    from keystab.experiments.view_stability import (
        count_table,
        curve_table,
        match_views,
        precision_table,
    )
    from keystab.io.tables import read_table, write_table
    from keystab.io.view_store import read_views
    from keystab.stages._compared import common_range, same_options

    views = read_views(args.views, args.views_digest)
    everywhere, same = common_range(views, args), same_options(args)
    usual = (args.max_offset, args.max_iterations)
    further = [(m, n) for n in args.iterations for m in args.max_offsets]
    curves, precision, counts = [], [], []
    for n_spo, extrema_path, traces_path in zip(args.n_spo, args.extrema, args.traces, strict=True):
        extrema, traces = read_table(extrema_path), read_table(traces_path)
        drawn = n_spo in args.curve_n_spo
        for choice in [None, *dict.fromkeys([usual, *(further if drawn else [])])]:
            if choice is None:
                common = everywhere.common(extrema, "step_sigma")
                labels = {"n_spo": n_spo, "detections": "discrete"}
                labels |= {"max_offset": math.nan, "max_iterations": math.nan}
            else:
                common = everywhere.common(refined_keypoints(extrema, traces, *choice))
                n_interp = math.inf if choice[1] >= MOST_MODELS else choice[1]
                labels = {"n_spo": n_spo, "detections": "refined"}
                labels |= {"max_offset": choice[0], "max_iterations": n_interp}
            matched = match_views(common, len(views), same)
            counts.append(count_table(matched, labels))
            if drawn:
                curves.append(curve_table(matched, labels, args.n_resamples))
            if choice in (None, usual):
                precision.append(
                    precision_table(matched, labels, args.minimum_share, args.n_resamples)
                )
    write_table(pd.concat(curves, ignore_index=True), args.curves)
    write_table(pd.concat(precision, ignore_index=True), args.precision)
    write_table(pd.concat(counts, ignore_index=True), args.counts)
    print(pd.concat(counts, ignore_index=True).to_string(index=False))


if __name__ == "__main__":
    raise SystemExit(main())
