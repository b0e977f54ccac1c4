"""Say what would run, why, and for how long.

python tools/why.py [targets and arguments of snakemake]

Snakemake plans the jobs and gives its reasons; here they are put together and into words. Times are
those of an earlier run (tools/durations.csv).
"""

from __future__ import annotations

import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

from keystab.provenance.shielded_environment import shielded
from keystab.provenance.study_folder import jobs_and_reasons

sys.path.insert(0, str(Path(__file__).parent))
from study import Clock, in_words, kind_of, read_durations, wrong_file  # noqa: E402

PARAMS = re.compile(r"Union of exclusive params .*?: before: (?P<before>.*?) now: (?P<now>.*)$")
PARAM = re.compile(
    r"'?(?P<name>[\w.]+|code of [\w.]+) = (?P<value>.*?)'?(?=,'?[\w.]+ = |,'?code of |$)"
)
FOLLOWS = "Input files updated by another job"
MOST = 8
"""Lines that one reason may take."""


def in_short(reason: str) -> str:
    """Put a reason of Snakemake's into words.

    Examples
    --------
    >>> in_short("Missing output files: a.csv, b.csv, c.csv, d.csv")
    'files are missing: a.csv, b.csv and 2 more'
    >>> both = "Params have changed since last execution: Union of exclusive params before and now "
    >>> both += "across all output: before: a.b = 1,c = x y now: c = x,a.b = 2 "
    >>> in_short(both)
    'a.b was 1 and is 2; c was x y and is x'
    """
    if FOLLOWS in reason:
        return FOLLOWS
    parts: list[str] = []
    head, _, files = reason.partition(": ")
    if found := PARAMS.search(reason):
        parts += changes(found["before"].strip(), found["now"].strip())
    elif head == "Missing output files":
        parts.append(f"files are missing: {_some(files)}")
    elif head == "Updated input files":
        parts.append(f"files have other content: {_some(files)}")
    if "Code has changed" in reason:
        parts.append("the rule has another command")
    if "Set of input files has changed" in reason:
        parts.append("the list of its inputs is another one")
    return "; ".join(parts) or reason


def changes(before: str, now: str) -> Iterator[str]:
    """What changed between two lists of parameters, in alphabetical order."""
    old, new = (
        {one["name"]: one["value"] for one in PARAM.finditer(text)} for text in (before, now)
    )
    for name in sorted(old.keys() | new.keys()):
        values = [_short(side.get(name, "")) for side in (old, new)]
        if re.fullmatch("[0-9a-f]{64}", old.get(name, new.get(name, ""))):
            yield f"{name} changed"
        else:
            yield f"{name} was {values[0]} and is {values[1]}"
    if not old and not new:
        yield f"parameters changed from {before} to {now}"


def _short(value: str) -> str:
    return value if 0 < len(value) <= 60 else f"{value[:50]} ..." if value else "nothing"


def _some(files: str) -> str:
    names = sorted(files.split(", "))
    more = f" and {len(names) - 2} more" if len(names) > 3 else ""
    return ", ".join(names[:2] if more else names) + more


def in_lines(jobs: list[tuple[str, str]], clock: Clock) -> Iterator[str]:
    """The answer, a few lines long: reasons, and the jobs that run for each."""
    total = sum(clock.weight(job) for job, _ in jobs)
    number = "1 job" if len(jobs) == 1 else f"{len(jobs)} jobs"
    yield f"{number} would run, about {in_words(total)} one at a time."
    reasons: dict[str, dict[str, list[str]]] = {}
    for job, reason in jobs:
        reasons.setdefault(in_short(reason), {}).setdefault(kind_of(job), []).append(job)
    for reason in sorted(reasons, key=FOLLOWS.__eq__):
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


def main(arguments: list[str]) -> int:
    """Plan, and explain the plan."""
    wrong = wrong_file(arguments)
    if wrong:
        print(f"error: {wrong}", file=sys.stderr)
        return 2
    command = [sys.executable, "-m", "snakemake", "--dry-run", *arguments]
    run = subprocess.run(
        command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, env=shielded()
    )
    if run.returncode:
        print(run.stdout, end="")
        return run.returncode
    jobs = jobs_and_reasons(run.stdout)
    if jobs:
        print("\n".join(in_lines(jobs, Clock([], read_durations()))))
    else:
        print("Nothing would run: everything is up to date.")
    return 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
