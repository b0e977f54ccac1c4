"""The command ``keystab audit``: detectors of others, or one's own, against what is there."""

from __future__ import annotations

import argparse
import shlex
import shutil
import sys
import time
from typing import TYPE_CHECKING

from keystab.errors import InputError

if TYPE_CHECKING:
    from keystab.audit.conditions import Stage
    from keystab.io.keypoint_conventions import Convention
    from keystab.parameters import AuditPlan

TABLES = ("audit.csv", "audit_octaves.csv", "audit_phases.csv", "durations.csv")
"""Tables in the folder that an audit writes."""


def audit(args: argparse.Namespace) -> None:
    """Audit detectors, and write tables, a figure and a page."""
    from keystab.audit.conditions import CONDITIONS, PLAN, QUICK, condition_of
    from keystab.audit.detectors import chosen
    from keystab.audit.isolation import Limits, why_not_there
    from keystab.audit.page import are_axes_swapped, page
    from keystab.audit.run import Audit, audited, joined, with_conventions
    from keystab.figures import audit as figure
    from keystab.figures._render import save
    from keystab.io.tables import write_table
    from keystab.utils.files import check_writable, written_whole

    start = time.monotonic()
    for name in TABLES:
        check_writable(args.output / name)
    python = args.python or sys.executable
    if shutil.which(python) is None:
        raise InputError(f"--python {python}: no such program; give the path of a Python")
    detectors = chosen(args.detectors, _convention(args.convention))
    plan = QUICK if args.quick else PLAN
    limits = Limits(args.time_limit)
    for detector in detectors:
        if detector.kind != "library" and (why := why_not_there(detector, limits, python)):
            raise InputError(f"{detector.name}: {why}")
    _say(start, f"{len(detectors)} settings of detectors; finding what there is to be found")
    stage, scene = _scene(args, plan)
    _say(start, f"{len(stage.truth)} true extrema of {scene}")
    conditions = [condition_of(name, plan, stage) for name in CONDITIONS]
    views = sum(len(condition.views) for condition in conditions)
    _say(start, f"{len(conditions)} conditions, {views} pictures")
    problems: list[str] = []
    found = []
    for tables in audited(Audit(conditions), detectors, limits, python, problems.append):
        found.append(tables)
        first = tables.audit.iloc[0]
        bias = first["bias_y"], first["bias_x"]
        known = first["bias_y_low"] == first["bias_y_low"]
        said = f"bias on blobs {bias[0]:+.3f}, {bias[1]:+.3f} px" if known else ""
        if are_axes_swapped(first["convention_declared"], first["convention_found"]):
            said = "its axes are swapped"
        named = (
            "controls" if len(found) == 1 else f"{first['detector']}, {first['setting']}: {said}"
        )
        for problem in problems:
            print(f"keystab audit: {problem}", file=sys.stderr, flush=True)
        if len(found) == 1 or (said and not problems):
            _say(start, f"{named} ({len(found)} of {len(detectors) + 1})")
        problems.clear()
    whole = joined(found)
    whole = whole._replace(audit=with_conventions(whole.audit))
    args.output.mkdir(parents=True, exist_ok=True)
    for name, table in zip(TABLES, whole, strict=True):
        write_table(table, args.output / name)
    drawn = figure.draw({"audit": whole.audit, "audit_octaves": whole.octaves})
    for name in ("audit.png", "audit.pdf"):
        save(drawn, args.output / name)
    command = shlex.join(["keystab", "audit", *args.typed])
    with written_whole(args.output / "audit.md") as part:
        part.write_text(page(whole.audit, command, scene), encoding="utf-8", newline="")
    _say(start, f"{args.output / 'audit.md'} says what was found, audit.csv has all numbers")


def _scene(args: argparse.Namespace, plan: AuditPlan) -> tuple[Stage, str]:
    """The scene that views show, and what to call it."""
    from keystab.audit.conditions import made_picture, scene_of, stage_of
    from keystab.io.pictures import read_picture

    if args.scene is None:
        return stage_of(scene_of(made_picture(), plan), args.threads), "a made scene of dead leaves"
    picture = read_picture(args.scene)
    try:
        return stage_of(scene_of(picture, plan), args.threads), str(args.scene)
    except InputError as error:
        raise InputError(f"{args.scene}: {error}") from None


def _convention(text: str | None) -> Convention:
    """Convention of a person's own detectors, such as ``0.5,xy,diameter``."""
    from keystab.io.keypoint_conventions import KEYSTAB, SCALES, Convention

    if text is None:
        return KEYSTAB
    words = text.split(",")
    if len(words) != 3:
        raise InputError(f"--convention {text}: give origin, order and scale, such as 0.5,xy,sigma")
    try:
        origin, scale = float(words[0]), words[2] if words[2] in SCALES else float(words[2])
    except ValueError:
        raise InputError(
            f"--convention {text}: give numbers of pixels and one of {', '.join(SCALES)}, such as "
            "0.5,xy,sigma"
        ) from None
    return Convention(origin, words[1], scale)


def _say(start: float, text: str) -> None:
    print(f"{time.monotonic() - start:4.0f} s  {text}", file=sys.stderr, flush=True)
