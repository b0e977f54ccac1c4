"""Hold one detector, with all of its settings, against what is there in one condition."""

import os
import sys
from pathlib import Path

from keystab.parameters import AuditPlan
from keystab.utils.stage_command import command


@command
def main(
    scene: Path,
    truth: Path,
    plan: AuditPlan,
    detector: str,
    condition: str,
    durations: Path,
    *,
    audit: Path,
    octaves: Path,
    phases: Path,
) -> None:
    """Take the views; run the detector in processes of its own; write what was measured."""
    from keystab.audit.conditions import condition_of, stage_of
    from keystab.audit.detectors import chosen
    from keystab.audit.run import CONTROL, Audit, audited, joined
    from keystab.io.pictures import read_picture
    from keystab.io.tables import read_table, write_table

    stage = stage_of(read_picture(scene), truth=read_table(truth))
    shown = Audit([condition_of(condition.replace("_", " "), plan, stage)])
    if detector == CONTROL:
        found = shown.controls()
    else:
        python = os.environ.get("KEYSTAB_AUDIT_PYTHON", sys.executable)
        asked = chosen([detector], default=False)
        found = joined(list(audited(shown, asked, python=python, told=print, controls=False)))
    for table, path in zip(found, (audit, octaves, phases, durations), strict=True):
        write_table(table, path)
