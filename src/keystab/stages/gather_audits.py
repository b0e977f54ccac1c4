"""Put what was found of all detectors in all conditions under one another."""

from collections.abc import Sequence
from pathlib import Path

from keystab.utils.stage_command import command


@command
def main(
    audits: Sequence[Path],
    audits_by_octave: Sequence[Path],
    audits_by_phase: Sequence[Path],
    *,
    audit: Path,
    octaves: Path,
    phases: Path,
) -> None:
    """Read the tables of all jobs; write three."""
    import pandas as pd

    from keystab.audit.run import with_conventions
    from keystab.io.tables import read_table, write_table

    for own, path in ((audits, audit), (audits_by_octave, octaves), (audits_by_phase, phases)):
        whole = pd.concat([read_table(each) for each in own], ignore_index=True)
        write_table(with_conventions(whole) if path == audit else whole, path)
