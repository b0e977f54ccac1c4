"""Detect Gaussian blobs of many sizes in all ways that figure S4 compares."""

from pathlib import Path

from keystab.parameters import Blobs
from keystab.utils.stage_command import command


@command
def main(blobs: Blobs, *, extrema: Path, traces: Path) -> None:
    """Write the extrema of all blobs and their refinement traces."""
    from keystab.experiments.blob_scales import detect_blobs, sizes
    from keystab.io.tables import write_table

    how = dict(vars(blobs))
    ends = [how.pop(name) for name in ("size_from", "size_to", "size_count")]
    found, models = detect_blobs(sizes(*ends), **how)
    write_table(found, extrema)
    write_table(models, traces)
    print(f"{len(found)} extrema")
