"""Detect Gaussian blobs of many sizes in all ways that figure S4 compares."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from keystab.stages import _run


@_run.stage
def main(argv: Sequence[str] | None = None) -> None:
    """Write the extrema of all blobs and their refinement traces."""
    parser = _run.parser(__doc__)
    _run.blob_arguments(parser)
    _run.required(parser, "extrema", "table of extrema to write", type=Path)
    _run.required(parser, "traces", "table of refinement traces to write", type=Path)
    args = parser.parse_args(argv)

    from keystab.experiments.blob_scales import detect_blobs
    from keystab.io.tables import write_table

    extrema, traces = detect_blobs(**_run.blobs_and_ways(args))
    write_table(extrema, args.extrema)
    write_table(traces, args.traces)
    print(f"{len(extrema)} extrema")


if __name__ == "__main__":
    raise SystemExit(main())
