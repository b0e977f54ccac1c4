"""Noise of the difference of Gaussians against scale, in closed form (figure 12)."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from keystab.stages import _run


@_run.stage
def main(argv: Sequence[str] | None = None) -> None:
    """Write a table of the noise at many scales, and of its ratio from octave to octave."""
    parser = _run.parser(__doc__)
    _run.required(parser, "camera-blur", "camera blur, pixels", type=float)
    _run.scale_arguments(parser)
    _run.required(parser, "n-oct", "octaves", type=int)
    _run.required(parser, "table", "table to write", type=Path)
    args = parser.parse_args(argv)

    import numpy as np
    import pandas as pd

    from keystab.io.tables import write_table
    from keystab.scalespace.white_noise import dog_noise

    sigma = args.sigma_min * 2.0 ** np.linspace(0, args.n_oct, 20 * args.n_oct + 1)
    here, above = (dog_noise(scale, args.camera_blur, args.kappa) for scale in (sigma, 2 * sigma))
    table = pd.DataFrame({"sigma": sigma, "dog_noise": here, "octave_ratio": here / above})
    write_table(table, args.table)


if __name__ == "__main__":
    raise SystemExit(main())
