"""Detect the discrete extrema of one n_spo at several sampling steps."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from keystab.stages import _run


@_run.stage
def main(argv: Sequence[str] | None = None) -> None:
    """Read the view, search one scale-space per step, write one table."""
    parser = _run.parser(__doc__)
    _run.views_arguments(parser)
    _run.required(parser, "n-spo", "scales per octave", type=int)
    _run.required(parser, "delta-min", "sampling steps, pixels", type=float, nargs="+")
    _run.detector_arguments(parser)
    _run.required(parser, "epsilon", "least difference to the 26 neighbours", type=float)
    _run.required(parser, "extrema", "table to write", type=Path)
    args = parser.parse_args(argv)

    import pandas as pd

    from keystab.detection.detector import extrema_table
    from keystab.detection.extrema import extrema_and_cubes
    from keystab.io.tables import write_table
    from keystab.io.view_store import read_view
    from keystab.scalespace.dog import scale_space

    view = read_view(args.views, args.views_digest)
    tables = []
    for delta_min in args.delta_min:
        space = scale_space(
            view.image,
            view.blur,
            n_spo=args.n_spo,
            delta_min=delta_min,
            sigma_min=args.sigma_min,
            kappa=args.kappa,
            oversampling=args.oversampling,
        )
        extrema = extrema_table(space, *extrema_and_cubes(space, args.epsilon, show_progress=True))
        extrema.insert(0, "n_spo", args.n_spo)
        extrema.insert(1, "delta_min", delta_min)
        tables.append(extrema)
        print(f"{len(extrema)} extrema at delta_min = {delta_min}")
    write_table(pd.concat(tables, ignore_index=True), args.extrema)


if __name__ == "__main__":
    raise SystemExit(main())
