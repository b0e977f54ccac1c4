"""Detect Gaussian blobs of many sizes and compare their scales with theory (figure S4)."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from keystab.stages import _run


@_run.stage
def main(argv: Sequence[str] | None = None) -> None:
    """Compute and write the table of figure S4."""
    parser = _run.parser(__doc__)
    _run.required(parser, "size-from", "smallest blob, pixels", type=float)
    _run.required(parser, "size-to", "largest blob, pixels", type=float)
    _run.required(parser, "size-count", "number of blobs", type=int)
    _run.required(parser, "kappas", "ratios that are compared", type=float, nargs="+")
    _run.required(parser, "n-spo", "scales per octave", type=int, nargs="+")
    _run.required(parser, "camera-blur", "blur of the camera, pixels", type=float)
    _run.required(parser, "assumed-blurs", "blurs assumed instead", type=float, nargs="+")
    _run.scale_arguments(parser)
    _run.required(parser, "max-offset", "largest accepted offset, samples", type=float)
    _run.required(parser, "max-iterations", "largest number of models", type=int)
    _run.required(parser, "table", "table to write", type=Path)
    args = parser.parse_args(argv)

    import numpy as np

    from keystab.blob_tables import blob_table
    from keystab.tables import write_table

    # Rounded, so that the numbers can be read.
    sizes = np.geomspace(args.size_from, args.size_to, args.size_count).round(6).tolist()
    table = blob_table(
        sizes,
        args.kappa,
        args.kappas,
        args.n_spo,
        args.camera_blur,
        args.assumed_blurs,
        args.sigma_min,
        args.max_offset,
        args.max_iterations,
    )
    write_table(table, args.table)


if __name__ == "__main__":
    raise SystemExit(main())
