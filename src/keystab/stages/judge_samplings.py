"""Hold the detections of balanced samplings against the true extrema of the view."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from keystab.stages import _run


@_run.stage
def main(argv: Sequence[str] | None = None) -> None:
    """Read truth, extrema and traces; write two rows per sampling, discrete and refined."""
    parser = _run.parser(__doc__)
    _run.views_arguments(parser)
    _run.required(parser, "truth", "table of true extrema", type=Path)
    _run.required(parser, "samplings", "extrema of the samplings", type=Path, nargs="+")
    _run.required(parser, "traces", "refinement traces of the samplings", type=Path, nargs="+")
    _run.required(parser, "n-spo", "n_spo of --samplings", type=int, nargs="+")
    _run.detector_arguments(parser)
    _run.judged_arguments(parser)
    _run.refinement_arguments(parser)
    _run.required(parser, "table", "table to write", type=Path)
    args = parser.parse_args(argv)

    import pandas as pd

    from keystab.detection.refinement import refined_table
    from keystab.io.tables import read_table, write_table
    from keystab.io.view_store import read_view
    from keystab.scalespace.sampling import Sampling, balanced_delta
    from keystab.stages._against_truth import judged_in_octave

    view, truth = read_view(args.views, args.views_digest), read_table(args.truth)
    rows = []
    for n_spo, extrema_path, traces_path in zip(
        args.n_spo, args.samplings, args.traces, strict=True
    ):
        extrema = read_table(extrema_path)
        step = balanced_delta(n_spo, args.kappa, args.sigma_min)
        sampling = Sampling(view.shape, view.blur, n_spo, step, args.sigma_min, args.kappa)
        refined = refined_table(
            sampling, extrema, read_table(traces_path), args.max_offset, args.max_iterations
        )
        labels = {"oversampling": args.oversampling, "n_spo": n_spo, "delta_min": step}
        for name, found, scale in (
            ("discrete", extrema, "step_sigma"),
            ("refined", refined, "sigma"),
        ):
            judgement = judged_in_octave(found, truth, view.shape, args, scale)
            rows.append(labels | {"detections": name} | judgement)
    table = pd.DataFrame(rows)
    write_table(table, args.table)
    print(table[["n_spo", "detections", "recall", "precision"]].to_string(index=False))


if __name__ == "__main__":
    raise SystemExit(main())
