"""Detect the extrema of one view in scale-spaces with different DoG ratios (figure 9)."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from keystab.stages import _run


@_run.stage
def main(argv: Sequence[str] | None = None) -> None:
    """Read the view; write extrema and traces of every kappa, each at its balanced sampling."""
    parser = _run.parser(__doc__)
    _run.views_arguments(parser)
    _run.required(parser, "n-spo", "scales per octave", type=int)
    _run.required(parser, "kappas", "ratios of the two blurs", type=float, nargs="+")
    _run.required(parser, "sigma-min", "first scale in pixels", type=float)
    _run.required(parser, "oversampling", "spline or cosine")
    _run.required(parser, "epsilon", "least difference to the 26 neighbours", type=float)
    _run.required(parser, "scale-moves", "whether a step may change the scale", type=_run.boolean)
    _run.required(parser, "move", "nearest or unit_step")
    _run.required(parser, "max-offset", "M_offset of unit steps", type=_run.optional(float))
    _run.required(parser, "extrema", "table of extrema to write", type=Path)
    _run.required(parser, "traces", "table of refinement traces to write", type=Path)
    args = parser.parse_args(argv)

    import pandas as pd

    from keystab.detection.view_detector import Detector, detect_in_view
    from keystab.io.tables import write_table
    from keystab.io.view_store import read_view
    from keystab.utils.progress import progress

    view = read_view(args.views, args.views_digest)
    extrema, traces, first = [], [], 0
    for kappa in progress(args.kappas, len(args.kappas), "kappas"):
        detector = Detector(
            view.blur,
            args.n_spo,
            sigma_min=args.sigma_min,
            kappa=kappa,
            oversampling=args.oversampling,
            epsilon=args.epsilon,
            scale_moves=args.scale_moves,
            move=args.move,
            max_offset=0.5 if args.max_offset is None else args.max_offset,
        )
        found, models = detect_in_view(view.image, detector)
        found.insert(0, "kappa", kappa)
        models["keypoint"] += first
        first += len(found)
        extrema.append(found)
        traces.append(models)
    write_table(pd.concat(extrema, ignore_index=True), args.extrema)
    write_table(pd.concat(traces, ignore_index=True), args.traces)
    print(f"{first} extrema for {len(args.kappas)} ratios")


if __name__ == "__main__":
    raise SystemExit(main())
