"""Compare the scales at which blobs are detected with theory (figure S4)."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from keystab.stages import _run


@_run.stage
def main(argv: Sequence[str] | None = None) -> None:
    """Read extrema and traces of blobs; write the table of figure S4."""
    parser = _run.parser(__doc__)
    _run.blob_arguments(parser)
    _run.required(parser, "extrema", "extrema of the blobs", type=Path)
    _run.required(parser, "traces", "their refinement traces", type=Path)
    _run.refinement_arguments(parser)
    _run.required(parser, "table", "table to write", type=Path)
    args = parser.parse_args(argv)

    from keystab.experiments.blob_scales import blob_table
    from keystab.io.tables import read_table, write_table

    table = blob_table(
        **_run.blobs_and_ways(args),
        max_offset=args.max_offset,
        max_iterations=args.max_iterations,
        detections=(read_table(args.extrema), read_table(args.traces)),
    )
    write_table(table, args.table)


if __name__ == "__main__":
    raise SystemExit(main())
