"""Find the true extrema of the scene that detectors of others are shown."""

from pathlib import Path

from keystab.parameters import AuditPlan
from keystab.stages._command import command


@command
def main(reference: Path, plan: AuditPlan, *, table: Path) -> None:
    """Read the picture; write the extrema of the scene that is made of it, in its pixels."""
    from keystab.audit.conditions import stage_of
    from keystab.io.pictures import read_picture
    from keystab.io.tables import write_table

    truth = stage_of(read_picture(reference), plan).truth
    write_table(truth, table)
    print(f"{len(truth)} true extrema of the scene")


if __name__ == "__main__":
    raise SystemExit(main())
