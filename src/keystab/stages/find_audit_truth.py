"""Find the true extrema of the scene that detectors of others are shown."""

from pathlib import Path

from keystab.parameters import AuditPlan
from keystab.utils.stage_command import command


@command
def main(reference: Path, plan: AuditPlan, *, scene: Path, truth: Path) -> None:
    """Read the picture; write the scene that is made of it, and its extrema in its pixels."""
    from keystab.audit.conditions import scene_of, stage_of
    from keystab.io.pictures import read_picture, write_picture
    from keystab.io.tables import write_table

    pixels = scene_of(read_picture(reference), plan)
    write_picture(pixels, scene)
    extrema = stage_of(pixels).truth
    write_table(extrema, truth)
    print(f"{len(extrema)} true extrema of the scene")
