"""Hold what ways to refine keep and lose against the true extrema of the view."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from keystab.stages import _run


@_run.stage
def main(argv: Sequence[str] | None = None) -> None:
    """Read truth and extrema; follow every path; write one row per way, limits and sampling."""
    parser = _run.parser(__doc__)
    _run.views_arguments(parser)
    _run.required(parser, "truth", "table of true extrema", type=Path)
    _run.required(parser, "samplings", "extrema of the samplings", type=Path, nargs="+")
    _run.required(parser, "n-spo", "n_spo of --samplings", type=int, nargs="+")
    _run.detector_arguments(parser)
    _run.judged_arguments(parser)
    _run.required(parser, "max-offsets", "values of M_offset", type=float, nargs="+")
    _run.required(parser, "most-iterations", "largest finite N_interp", type=int)
    _run.required(parser, "table", "table to write", type=Path)
    args = parser.parse_args(argv)

    import pandas as pd

    from keystab.detection.refinement import MOST_MODELS, trace
    from keystab.experiments.refinement_choices import kept_and_lost
    from keystab.io.tables import read_table, write_table
    from keystab.io.view_store import read_view
    from keystab.scalespace.dog import scale_space
    from keystab.stages._compared import compared, tolerances

    view, truth = read_view(args.views, args.views_digest), read_table(args.truth)
    iterations = [*range(1, args.most_iterations + 1), MOST_MODELS]
    rows = []
    for n_spo, path in zip(args.n_spo, args.samplings, strict=True):
        space = scale_space(
            view.image, view.blur, n_spo, None, args.sigma_min, args.kappa, args.oversampling
        )
        extrema = read_table(path)
        inside = compared(args, view.shape)
        paths = {}
        for scale_moves in (True, False):
            nearest = trace(space, extrema, min(args.max_offsets), "nearest", scale_moves)
            for max_offset in args.max_offsets:
                paths["nearest", scale_moves, max_offset] = nearest
                paths["unit_step", scale_moves, max_offset] = trace(
                    space, extrema, max_offset, "unit_step", scale_moves
                )
        for (move, scale_moves, max_offset), models in paths.items():
            for n in iterations:
                rows.append(
                    {
                        "n_spo": n_spo,
                        "move": move,
                        "scale_moves": scale_moves,
                        "max_offset": max_offset,
                        "max_iterations": n,
                        **kept_and_lost(
                            extrema,
                            models,
                            space.sampling,
                            truth,
                            inside,
                            max_offset,
                            n,
                            tolerances(args),
                        ),
                    }
                )
    write_table(pd.DataFrame(rows), args.table)


if __name__ == "__main__":
    raise SystemExit(main())
