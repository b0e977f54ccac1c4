"""Detect the extrema of one view at all balanced samplings, one after the other."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from keystab.stages import _run


@_run.stage
def main(argv: Sequence[str] | None = None) -> None:
    """Read the view; write one table of the extrema of all samplings."""
    parser = _run.parser(__doc__)
    _run.views_arguments(parser)
    _run.required(parser, "n-spo", "scales per octave of the samplings", type=int, nargs="+")
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
    from keystab.utils.progress import progress

    view = read_view(args.views, args.views_digest)
    tables = []
    for n_spo in progress(args.n_spo, len(args.n_spo), "samplings"):
        space = scale_space(
            view.image,
            view.blur,
            n_spo=n_spo,
            sigma_min=args.sigma_min,
            kappa=args.kappa,
            oversampling=args.oversampling,
        )
        extrema = extrema_table(space, *extrema_and_cubes(space, args.epsilon))
        extrema.insert(0, "n_spo", n_spo)
        extrema.insert(1, "delta_min", space.sampling.delta_min)
        tables.append(extrema)
    write_table(pd.concat(tables, ignore_index=True), args.extrema)
    print(f"{sum(map(len, tables))} extrema in {len(tables)} samplings")


if __name__ == "__main__":
    raise SystemExit(main())
