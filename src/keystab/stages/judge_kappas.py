"""Hold the keypoints of several ratios of the two blurs against the true extrema of each."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from keystab.stages import _run


@_run.stage
def main(argv: Sequence[str] | None = None) -> None:
    """Read truths, extrema and traces; write two rows per ratio, discrete and refined."""
    parser = _run.parser(__doc__)
    _run.views_arguments(parser)
    _run.required(parser, "truths", "true extrema of each ratio", type=Path, nargs="+")
    _run.required(parser, "kappas", "the ratios", type=float, nargs="+")
    _run.required(parser, "extrema", "extrema of all ratios", type=Path)
    _run.required(parser, "traces", "their refinement traces", type=Path)
    _run.required(parser, "sigma-min", "first scale in pixels", type=float)
    _run.judged_arguments(parser)
    _run.refinement_arguments(parser)
    _run.required(parser, "table", "table to write", type=Path)
    args = parser.parse_args(argv)

    import numpy as np
    import pandas as pd

    from keystab.detection.refinement import refined_keypoints
    from keystab.io.tables import read_table, write_table
    from keystab.io.view_store import read_view
    from keystab.stages._against_truth import judged_in_octave

    view, extrema = read_view(args.views, args.views_digest), read_table(args.extrema)
    refined = refined_keypoints(
        extrema, read_table(args.traces), args.max_offset, args.max_iterations
    )
    rows = []
    for kappa, path in zip(args.kappas, args.truths, strict=True):
        truth = read_table(path)
        for name, found, scale in (
            ("discrete", extrema, "step_sigma"),
            ("refined", refined, "sigma"),
        ):
            here = found[np.isclose(found["kappa"], kappa)].reset_index(drop=True)
            judgement = judged_in_octave(here, truth, view.shape, args, scale)
            rows.append({"kappa": kappa, "detections": name} | judgement)
    table = pd.DataFrame(rows)
    write_table(table, args.table)
    print(table[["kappa", "detections", "n_true", "recall", "precision"]].to_string(index=False))


if __name__ == "__main__":
    raise SystemExit(main())
