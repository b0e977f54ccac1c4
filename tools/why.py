"""Say what would run, why, and for how long, and whose results it would overwrite.

python tools/why.py [targets and arguments of snakemake]

Snakemake plans the jobs and gives its reasons; here they are put together and into words
(tools/causes.py). Times are those of an earlier run (tools/durations.csv).
"""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

from keystab.provenance.code_digest import PACKAGE_FOLDER
from keystab.provenance.shielded_environment import shielded
from keystab.provenance.snakemake_records import read_records
from keystab.study.overlays import noted, on_command_line, seen_from
from keystab.study.result_folders import normal_folder

sys.path.insert(0, str(Path(__file__).parent))
from causes import DERIVED, FOLLOWS, Cause, Causes, jobs_of_plan  # noqa: E402
from study import (  # noqa: E402
    Clock,
    config_files,
    in_words,
    kind_of,
    read_durations,
    settings_of,
    wrong_file,
)

MOST = 8
"""Lines that one reason may take."""


def in_lines(jobs: Sequence[tuple[str, str]], clock: Clock) -> Iterator[str]:
    """The answer, a few lines long: reasons, and the jobs that run for each.

    Parameters
    ----------
    jobs : sequence of (str, str)
        What each says about itself, and why it runs.
    clock : Clock
        Knows how long jobs take.
    """
    total = sum(clock.weight(job) for job, _ in jobs)
    number = "1 job" if len(jobs) == 1 else f"{len(jobs)} jobs"
    yield f"{number} would run, about {in_words(total)} one at a time."
    reasons: dict[str, dict[str, list[str]]] = {}
    for job, reason in jobs:
        reasons.setdefault(reason, {}).setdefault(kind_of(job), []).append(job)
    for reason in sorted(reasons, key=lambda it: (it == FOLLOWS, it == DERIVED)):
        yield "After these:" if reason == FOLLOWS else f"Because {reason}:"
        kinds = list(reasons[reason].values())
        for same in kinds[: MOST if len(kinds) > MOST + 1 else None]:
            taken = in_words(sum(clock.weight(job) for job in same))
            more = f", and {len(same) - 1} like it" if len(same) > 1 else ""
            yield f"  {same[0]}{more} ({taken})"
        if len(kinds) > MOST + 1:
            rest = [job for same in kinds[MOST:] for job in same]
            taken = in_words(sum(clock.weight(job) for job in rest))
            yield f"  and {len(rest)} other jobs ({taken})"


def overwritten(
    outputs: Sequence[str],
    causes: Sequence[Cause],
    folders: Sequence[str],
    before: Sequence[str] | None,
    now: Sequence[str],
) -> Iterator[str]:
    r"""Whose results are lost; nothing where they are of the same settings and picture.

    Parameters
    ----------
    outputs : sequence of str
        Files that are there and would be made again.
    causes : sequence of Cause
        Why.
    folders : sequence of str
        Folders of results and figures.
    before, now : sequence of str
        Files of settings of the last run there, where it is known, and of this one.

    Examples
    --------
    >>> causes, files = [Cause("another picture", True, "roof.png")], ["my.yaml"]
    >>> print("\n".join(overwritten(["r/a"], causes, ["r", "f"], [], files)))
    In r and f are results of roof.png (make study): 1 file would be overwritten.
    To keep it, write folders of their own into my.yaml: results, figures and logs.
    """
    if not outputs or not any(cause.overwrites for cause in causes):
        return
    pictures = sorted({cause.picture for cause in causes if cause.picture})
    whose = f"results of {' and '.join(pictures)}" if pictures else "results of other settings"
    if before is not None and list(before) != list(now):
        whose += f" (make study{on_command_line(before, make=True)})"
    count, it = (f"{len(outputs)} files", "them") if len(outputs) > 1 else ("1 file", "it")
    yield f"In {' and '.join(folders)} are {whose}: {count} would be overwritten."
    place = now[-1] if now else "a file of settings (WITH=)"
    yield f"To keep {it}, write folders of their own into {place}: results, figures and logs."


def answer(
    plan: str, arguments: list[str], clock: Clock, package: Path = PACKAGE_FOLDER
) -> list[str]:
    """What a dry run in this folder says that prints commands, in lines for a person."""
    jobs = jobs_of_plan(plan)
    if not jobs:
        return ["Nothing would run: everything is up to date."]
    settings, project = settings_of(arguments), Path.cwd()
    causes = Causes(settings, read_records(project), package=package)
    found = causes.of_all(jobs)
    texts = ["; ".join(cause.text for cause in each) for each in found]
    said = [job.said for job in jobs]
    lines = list(in_lines(list(zip(said, texts, strict=True)), clock))
    folders = [normal_folder(str(settings[key])) for key in ("results", "figures")]
    outputs = {name for job in jobs for name in causes.outputs_of(job) if Path(name).exists()}
    now = seen_from(project, config_files(arguments))
    every = [cause for each in found for cause in each]
    return [*lines, *overwritten(sorted(outputs), every, folders, noted(project, folders[0]), now)]


def main(arguments: list[str]) -> int:
    """Plan, and explain the plan."""
    wrong = wrong_file(arguments)
    if wrong:
        print(f"error: {wrong}", file=sys.stderr)
        return 2
    command = [sys.executable, "-m", "snakemake", "--dry-run", "--printshellcmds", *arguments]
    run = subprocess.run(
        command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, env=shielded()
    )
    if run.returncode:
        lines = run.stdout.splitlines()
        told = [line for line in lines if line.startswith(("error: ", "config: "))]
        print("\n".join(told or lines), file=sys.stderr)
        return run.returncode
    print("\n".join(answer(run.stdout, arguments, Clock([], read_durations()))))
    return 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
