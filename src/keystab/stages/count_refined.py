"""Count the keypoints that the quadratic refinement keeps at every balanced sampling."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from keystab.stages import _run


@_run.stage
def main(argv: Sequence[str] | None = None) -> None:
    """Read extrema and refinement traces; write one row per sampling."""
    parser = _run.parser(__doc__)
    _run.views_arguments(parser)
    _run.required(parser, "samplings", "extrema of the samplings", type=Path, nargs="+")
    _run.required(parser, "traces", "refinement traces of the samplings", type=Path, nargs="+")
    _run.required(parser, "n-spo", "n_spo of --samplings", type=int, nargs="+")
    _run.scale_arguments(parser)
    _run.range_arguments(parser)
    _run.refinement_arguments(parser)
    _run.required(parser, "table", "table to write", type=Path)
    args = parser.parse_args(argv)

    import pandas as pd

    from keystab.detection.refinement import accepted, positions
    from keystab.io.tables import read_table, write_table
    from keystab.io.view_store import read_view
    from keystab.scalespace.sampling import Sampling, balanced_delta
    from keystab.stages._compared import comparable_only

    view = read_view(args.views, args.views_digest)
    octave = argparse.Namespace(**(vars(args) | {"last_scale": 2.0}))
    rows = []
    for n_spo, extrema_path, traces_path in zip(
        args.n_spo, args.samplings, args.traces, strict=True
    ):
        extrema = read_table(extrema_path, ["y", "x", "step_sigma"])
        step = balanced_delta(n_spo, args.kappa, args.sigma_min)
        sampling = Sampling(view.shape, view.blur, n_spo, step, args.sigma_min, args.kappa)
        models = accepted(read_table(traces_path), args.max_offset, args.max_iterations)
        refined = positions(models, sampling)
        rows.append(
            {
                "n_spo": n_spo,
                "delta_min": step,
                "n_extrema": len(extrema),
                "n_refined": len(refined),
                "n_common": len(comparable_only(extrema, view.shape, args)),
                "n_refined_common": len(comparable_only(refined, view.shape, args, "sigma")),
                "n_refined_octave": len(comparable_only(refined, view.shape, octave, "sigma")),
            }
        )
    write_table(pd.DataFrame(rows), args.table)


if __name__ == "__main__":
    raise SystemExit(main())
