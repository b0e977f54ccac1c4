"""Detect the extrema of all balanced samplings in one variant of the arithmetic (figure floor).

In double precision no tolerance is applied: the table says by how much each extremum differs from
its neighbours, so that any is chosen afterwards.
"""

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
    _run.required(parser, "arithmetic", "type of samples", choices=("float64", "float32"))
    _run.required(parser, "epsilon", "least difference in single precision", type=float)
    _run.required(parser, "grey-range", "largest grey value in single precision", type=float)
    _run.required(parser, "bits", "bits of a pixel; None for floats", type=_run.optional(int))
    _run.required(parser, "extrema", "table of extrema to write", type=Path)
    args = parser.parse_args(argv)

    import pandas as pd

    from keystab.detection.detector import extrema_table
    from keystab.detection.extrema import discrete_extrema
    from keystab.detection.single_precision import quantised, single_precision_extrema
    from keystab.io.tables import write_table
    from keystab.io.view_store import read_view
    from keystab.scalespace.dog import scale_space
    from keystab.utils.progress import progress

    view = read_view(args.views, args.views_digest)
    image = quantised(view.image, args.bits)
    parts = []
    for n_spo in progress(args.n_spo, len(args.n_spo), "samplings"):
        space = scale_space(
            image,
            view.blur,
            n_spo=n_spo,
            sigma_min=args.sigma_min,
            kappa=args.kappa,
            oversampling=args.oversampling,
        )
        if args.arithmetic == "float32":
            found = single_precision_extrema(space, args.epsilon, args.grey_range)
        else:
            found = discrete_extrema(space)
        columns = ["y", "x", "sigma", "value", "sign", "step_sigma", "difference"]
        table = extrema_table(space, found)[columns]
        table.insert(0, "n_spo", n_spo)
        table.insert(1, "delta_min", space.sampling.delta_min)
        parts.append(table)
    extrema = pd.concat(parts, ignore_index=True)
    write_table(extrema, args.extrema)
    print(f"{len(extrema)} extrema in {len(args.n_spo)} samplings")


if __name__ == "__main__":
    raise SystemExit(main())
