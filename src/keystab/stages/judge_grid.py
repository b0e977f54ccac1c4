"""Hold the discrete extrema of a grid of samplings against the true extrema of the view."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from keystab.stages import _run


@_run.stage
def main(argv: Sequence[str] | None = None) -> None:
    """Read truth and extrema; write one row per node of the grid."""
    parser = _run.parser(__doc__)
    _run.views_arguments(parser)
    _run.required(parser, "truth", "table of true extrema", type=Path)
    _run.required(parser, "extrema", "extrema of the nodes, per n_spo", type=Path, nargs="+")
    _run.required(parser, "sigma-min", "first scale in pixels", type=float)
    _run.judged_arguments(parser)
    _run.required(parser, "table", "table to write", type=Path)
    args = parser.parse_args(argv)

    import pandas as pd

    from keystab.io.tables import read_table, write_table
    from keystab.io.view_store import read_view
    from keystab.stages._against_truth import judged_in_octave

    view, truth = read_view(args.views, args.views_digest), read_table(args.truth)
    rows = [
        {"n_spo": n_spo, "delta_min": delta_min}
        | judged_in_octave(found.reset_index(drop=True), truth, view.shape, args, "step_sigma")
        for path in args.extrema
        for (n_spo, delta_min), found in read_table(path).groupby(["n_spo", "delta_min"])
    ]
    write_table(pd.DataFrame(rows), args.table)


if __name__ == "__main__":
    raise SystemExit(main())
