"""Match the keypoints of scale-spaces with different DoG ratios (figure 9)."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from keystab.stages import _run


@_run.stage
def main(argv: Sequence[str] | None = None) -> None:
    """Read extrema and traces of all ratios; write the tables of figure 9."""
    parser = _run.parser(__doc__)
    _run.views_arguments(parser)
    _run.required(parser, "extrema", "extrema of all ratios", type=Path)
    _run.required(parser, "traces", "their refinement traces", type=Path)
    _run.required(parser, "n-spo", "scales per octave", type=int)
    _run.required(parser, "kappas", "ratios of the two blurs", type=float, nargs="+")
    _run.required(parser, "sigma-min", "first scale in pixels", type=float)
    _run.required(parser, "border", "pixels left out at the border of the view", type=float)
    _run.same_arguments(parser)
    _run.refinement_arguments(parser)
    _run.required(parser, "counts", "table of counts to write", type=Path)
    _run.required(parser, "keypoints", "table of unique keypoints to write", type=Path)
    _run.required(parser, "occurrence", "occurrence matrix to write", type=Path)
    args = parser.parse_args(argv)

    from keystab.detection.refinement import refined_keypoints
    from keystab.experiments.kappa_stability import kappa_tables
    from keystab.io.tables import read_table, write_table
    from keystab.io.view_store import read_view
    from keystab.stages._compared import same_options

    view = read_view(args.views, args.views_digest)
    keypoints = refined_keypoints(
        read_table(args.extrema), read_table(args.traces), args.max_offset, args.max_iterations
    )
    tables = kappa_tables(
        keypoints,
        args.kappas,
        args.n_spo,
        args.sigma_min,
        view.shape,
        args.border,
        same_options(args),
    )
    write_table(tables.counts, args.counts)
    write_table(tables.keypoints, args.keypoints)
    write_table(tables.occurrence, args.occurrence)
    print(tables.counts.to_string(index=False))


if __name__ == "__main__":
    raise SystemExit(main())
