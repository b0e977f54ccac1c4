"""Blur a Gaussian blob many times by little and once by much (figure 1)."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from keystab.stages import _run


@_run.stage
def main(argv: Sequence[str] | None = None) -> None:
    """Compute and write the table of figure 1."""
    parser = _run.parser(__doc__)
    _run.required(parser, "blob", "standard deviation of the blob, pixels", type=float)
    _run.required(parser, "n-passes", "number of small blurs", type=int)
    _run.required(parser, "sigma-from", "smallest small blur, pixels", type=float)
    _run.required(parser, "sigma-to", "largest small blur, pixels", type=float)
    _run.required(parser, "sigma-count", "number of small blurs tried", type=int)
    _run.required(parser, "truncation", "radius of the sampled kernel, over sigma", type=float)
    _run.required(parser, "table", "table to write", type=Path)
    args = parser.parse_args(argv)

    import numpy as np

    from keystab.experiments.semigroup_table import semigroup_table
    from keystab.io.tables import write_table

    # Rounded, so that 0.7 is 0.7 and not 0.7000000000000001.
    sigmas = np.linspace(args.sigma_from, args.sigma_to, args.sigma_count).round(12)
    table = semigroup_table(args.blob, args.n_passes, sigmas, truncation=args.truncation)
    write_table(table, args.table)


if __name__ == "__main__":
    raise SystemExit(main())
