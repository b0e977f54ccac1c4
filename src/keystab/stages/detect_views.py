"""Detect the discrete extrema of all views of a set at one sampling, and trace their refinement."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from keystab.stages import _run


@_run.stage
def main(argv: Sequence[str] | None = None) -> None:
    """Read the views and, where they are kept, their scale-spaces; write two tables."""
    parser = _run.parser(__doc__)
    _run.views_arguments(parser)
    _run.view_detector_arguments(parser)
    _run.required(parser, "guard", "guard band of the views, pixels", type=float)
    _run.required(parser, "epsilon", "least difference to the 26 neighbours", type=float)
    _run.required(parser, "scale-moves", "whether a step may change the scale", type=_run.boolean)
    _run.required(parser, "move", "nearest or unit_step")
    _run.required(parser, "max-offset", "M_offset of unit steps", type=_run.optional(float))
    _run.store_arguments(parser)
    _run.required(parser, "extrema", "table of extrema to write", type=Path)
    _run.required(parser, "traces", "table of refinement traces to write", type=Path)
    args = parser.parse_args(argv)
    _run.require_both_or_neither(parser, args)

    import pandas as pd

    from keystab.detection.view_detector import detect_in_view
    from keystab.io.checksums import verify
    from keystab.io.tables import write_table
    from keystab.io.view_store import read_views
    from keystab.stages._scale_spaces import search_of_stores, searched_windows, view_detector
    from keystab.utils.progress import progress

    views = read_views(args.views, args.views_digest)
    if args.store is not None:
        verify(args.store, args.store_digest)
    windows = searched_windows(views, args.guard)
    extrema, traces, first = [], [], 0
    for number, view in enumerate(progress(views, len(views), f"views, n_spo {args.n_spo}")):
        found, models = detect_in_view(
            view.image,
            view_detector(args, view),
            None if args.store is None else search_of_stores(args.store, number, args.epsilon),
            windows[number],
        )
        found.insert(0, "view", number)
        models["keypoint"] += first
        first += len(found)
        extrema.append(found)
        traces.append(models)
    write_table(pd.concat(extrema, ignore_index=True), args.extrema)
    write_table(pd.concat(traces, ignore_index=True), args.traces)
    print(f"{first} extrema in {len(views)} views")


if __name__ == "__main__":
    raise SystemExit(main())
