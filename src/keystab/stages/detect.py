"""Detect the discrete extrema of one balanced sampling and trace their refinement."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from keystab.stages import _run


@_run.stage
def main(argv: Sequence[str] | None = None) -> None:
    """Read the view and, where there is one, its stored scale-space; write two tables."""
    parser = _run.parser(__doc__)
    _run.views_arguments(parser)
    _run.required(parser, "n-spo", "scales per octave", type=int)
    _run.detector_arguments(parser)
    _run.required(parser, "epsilon", "least difference to the 26 neighbours", type=float)
    _run.required(parser, "scale-moves", "whether a step may change the scale", type=_run.boolean)
    _run.required(parser, "move", "nearest or unit_step")
    _run.required(parser, "max-offset", "M_offset of unit steps", type=_run.optional(float))
    _run.store_arguments(parser)
    _run.required(parser, "extrema", "table of extrema to write", type=Path)
    _run.required(parser, "traces", "table of refinement traces to write", type=Path)
    args = parser.parse_args(argv)
    _run.require_both_or_neither(parser, args)

    from keystab.detection.detector import extrema_table
    from keystab.detection.extrema import discrete_extrema
    from keystab.detection.refinement import trace
    from keystab.detection.stored_extrema import stored_extrema
    from keystab.io.checksums import verify
    from keystab.io.scale_space_store import StoredScaleSpace
    from keystab.io.tables import write_table
    from keystab.io.view_store import read_view
    from keystab.scalespace.dog import scale_space

    view = read_view(args.views, args.views_digest)
    space = scale_space(
        view.image,
        view.blur,
        n_spo=args.n_spo,
        sigma_min=args.sigma_min,
        kappa=args.kappa,
        oversampling=args.oversampling,
    )
    if args.store is None:
        found = discrete_extrema(space, args.epsilon, show_progress=True)
    else:
        verify(args.store, args.store_digest)
        found = stored_extrema(StoredScaleSpace(args.store), space, args.epsilon)
    extrema = extrema_table(space, found)
    extrema.insert(0, "n_spo", args.n_spo)
    extrema.insert(1, "delta_min", space.sampling.delta_min)
    traces = trace(
        space,
        extrema,
        # Paths of nearest moves serve every M_offset; below 1/2 they do not move on anyway.
        max_offset=0.5 if args.max_offset is None else args.max_offset,
        move=args.move,
        scale_moves=args.scale_moves,
    )
    write_table(extrema, args.extrema)
    write_table(traces, args.traces)
    print(f"{len(extrema)} extrema among {space.sampling.n_samples:,} samples")


if __name__ == "__main__":
    raise SystemExit(main())
