"""Count the extrema of every sampling of a grid: all, comparable and unique ones (figure 3)."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from keystab.stages import _run


@_run.stage
def main(argv: Sequence[str] | None = None) -> None:
    """Read the extrema of all samplings; write one row per sampling."""
    parser = _run.parser(__doc__)
    _run.views_arguments(parser)
    _run.required(parser, "grid", "extrema of the grid", type=Path, nargs="+")
    _run.required(parser, "samplings", "extrema of balanced samplings", type=Path, nargs="+")
    _run.required(parser, "n-spo", "scales per octave of the grid", type=int, nargs="+")
    _run.required(parser, "delta-min", "sampling steps of the grid", type=float, nargs="+")
    _run.required(parser, "balanced-n-spo", "n_spo of --samplings", type=int, nargs="+")
    _run.scale_arguments(parser)
    _run.same_arguments(parser)
    _run.range_arguments(parser)
    _run.required(parser, "table", "table to write", type=Path)
    args = parser.parse_args(argv)

    from itertools import product

    import pandas as pd

    from keystab.experiments.sampling_stability import sampling_counts
    from keystab.io.tables import write_table
    from keystab.io.view_store import read_view
    from keystab.scalespace.sampling import Sampling, balanced_delta
    from keystab.stages._compared import comparable_only, same_options
    from keystab.stages._inputs import read_extrema

    view = read_view(args.views, args.views_digest)
    grid, balanced = read_extrema(args.grid), read_extrema(args.samplings)
    samplings = [(grid, False, n_spo, step) for n_spo, step in product(args.n_spo, args.delta_min)]
    samplings += [
        (balanced, True, n_spo, balanced_delta(n_spo, args.kappa, args.sigma_min))
        for n_spo in args.balanced_n_spo
    ]
    rows = []
    for table, is_balanced, n_spo, step in samplings:
        extrema = table[(table["n_spo"] == n_spo) & (table["delta_min"] == step)]
        sampling = Sampling(view.shape, view.blur, n_spo, step, args.sigma_min, args.kappa)
        rows.append(
            {
                "n_spo": n_spo,
                "delta_min": step,
                "balanced": is_balanced,
                "n_samples": sampling.n_samples,
                **sampling_counts(
                    extrema, comparable_only(extrema, view.shape, args), same_options(args)
                ),
            }
        )
    write_table(pd.DataFrame(rows), args.table)


if __name__ == "__main__":
    raise SystemExit(main())
