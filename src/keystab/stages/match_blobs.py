"""Compare the scales at which blobs are detected with theory (figure S4)."""

from pathlib import Path

from keystab.parameters import Acceptance, Blobs
from keystab.utils.stage_command import command


@command
def main(blobs: Blobs, extrema: Path, traces: Path, accepted: Acceptance, *, table: Path) -> None:
    """Read extrema and traces of blobs; write the table of figure S4."""
    from keystab.experiments.blob_scales import blob_table, sizes
    from keystab.io.tables import read_table, write_table

    how = {**vars(blobs), **vars(accepted)}
    ends = [how.pop(name) for name in ("size_from", "size_to", "size_count")]
    found = (read_table(extrema), read_table(traces))
    write_table(blob_table(sizes(*ends), **how, detections=found), table)
