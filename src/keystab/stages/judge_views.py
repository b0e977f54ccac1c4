"""Hold the keypoints of a set of views against the true extrema of the scene."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from keystab.stages import _run


@_run.stage
def main(argv: Sequence[str] | None = None) -> None:
    """Read the scene's extrema and the detections of sets of views; write one row per set."""
    parser = _run.parser(__doc__)
    _run.views_arguments(parser)
    _run.required(parser, "truth", "extrema of the scene in the view of --views", type=Path)
    _run.required(parser, "sets", "stores of the sets", type=Path, nargs="+")
    _run.required(parser, "sets-digest", "their seals", type=Path, nargs="+")
    _run.required(parser, "extrema", "extrema of each set", type=Path, nargs="+")
    _run.required(parser, "traces", "their refinement traces", type=Path, nargs="+")
    _run.required(parser, "sweeps", "sweep that each set is a member of", nargs="+")
    _run.required(parser, "values", "value of each set in its sweep", type=float, nargs="+")
    _run.required(parser, "n-spo", "n_spo of each", type=int, nargs="+")
    _run.required(parser, "guards", "guard band of each set, pixels", type=float, nargs="+")
    _run.required(parser, "sigma-min", "first scale in pixels", type=float)
    _run.judged_arguments(parser)
    _run.refinement_arguments(parser)
    _run.required(parser, "table", "table to write", type=Path)
    args = parser.parse_args(argv)

    from functools import cache

    import numpy as np
    import pandas as pd

    from keystab.detection.refinement import refined_keypoints
    from keystab.evaluation.recall_precision import mean_over_views
    from keystab.io.tables import read_table, write_table
    from keystab.io.view_store import read_views
    from keystab.matching.common_range import CommonRange
    from keystab.stages._compared import tolerances

    seen_from = read_views(args.views, args.views_digest).specs[0]
    scene = read_table(args.truth)
    limits = args.sigma_min * np.array([args.first_scale, args.last_scale])

    @cache  # a set is there once for every sampling
    def seen(store: Path, digest: Path, guard: float) -> tuple[CommonRange, pd.DataFrame]:
        views = read_views(store, digest)
        first = CommonRange([views.specs[0], seen_from], views.reference_shape, 0.0, 0.0)
        field = CommonRange(views.specs, views.reference_shape, max(guard, args.border), 0.0)
        return field, field.common(first.common(scene.assign(view=1)).assign(view=0))

    rows = []
    for sweep, value, n_spo, guard, store, digest, extrema, traces in zip(
        args.sweeps, args.values, args.n_spo, args.guards, args.sets, args.sets_digest,
        args.extrema, args.traces, strict=True,
    ):  # fmt: skip
        field, truth = seen(store, digest, guard)
        found = read_table(extrema)
        for detections, table, scale in (
            ("discrete", found, "step_sigma"),
            (
                "refined",
                refined_keypoints(found, read_table(traces), args.max_offset, args.max_iterations),
                "sigma",
            ),
        ):
            common = field.common(table, scale)
            judgement = mean_over_views(
                common, truth, len(field.specs), limits, scale, tolerances(args)
            )
            labels = {"sweep": sweep, "value": value, "n_spo": n_spo, "detections": detections}
            rows.append(labels | judgement)
    table = pd.DataFrame(rows)
    write_table(table, args.table)
    print(table[[*labels, "recall", "precision"]].to_string(index=False))


if __name__ == "__main__":
    raise SystemExit(main())
