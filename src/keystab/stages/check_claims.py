"""Check the claims of the paper against the tables of the study."""

from collections.abc import Sequence
from pathlib import Path

from keystab.utils.stage_command import command


@command
def main(
    claims: Path, tables: list[Path], reference: str = "", draft: bool = False,
    settings: Sequence[str] = (), *, csv: Path, json: Path, markdown: Path,
) -> None:  # fmt: skip
    """Read claims and tables; write the verdicts as CSV, JSON and Markdown; print the tally."""
    from keystab.study.claims_report import heading, judged, write_report
    from keystab.study.verdicts import tally

    found = judged(claims, tables)
    head = heading(reference, settings, draft) if reference else ""
    write_report(found, csv, json, markdown, head=head)
    for verdict, number in tally(found).items():
        print(f"{number:3d} {verdict}")
