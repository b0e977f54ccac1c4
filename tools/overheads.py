"""Say what share of the time of the study's jobs starts them, reads and writes.

PYTHONPROFILEIMPORTTIME=1 make study && python tools/overheads.py
PYTHONPATH=tools/profiled PROFILES=logs/profiles snakemake -j2 && python tools/overheads.py

After the first, Python has written into the log of every job how long each import took; what a job
takes in all is in its benchmark record. After the second, every job has left a profile, in which
the packages and modules that read and write are found. A profile slows what is written in Python,
so that its share is rather too large than too small.
"""

from __future__ import annotations

import csv
import pstats
import re
import sys
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[1]
LOGS = ROOT / "logs"
IMPORT = re.compile(r"^import time:\s+(\d+) \|\s+\d+ \|", re.MULTILINE)  # microseconds of its own
INTERPRETER = 0.015  # seconds until the first import, `python -I -S -c pass`
# What reads and writes: libraries, modules of keystab, calls of the system.
STORES = re.compile(
    r"/site-packages/(zarr|numcodecs|xarray|pyarrow|PIL|tifffile)/"
    r"|/keystab/(utils/files|io/(tables|checksums|pictures|zarr_groups))\.py"
    r"|^~.*(posix\.|_io\.|hashlib)"
)
IMPORTING = re.compile(r"importlib|<module>|^~.*(__import__|exec)")

Call = tuple[str, int, str]


def main() -> int:
    """Print the shares that the last run has measured."""
    profiles = sorted((LOGS / "profiles").glob("*.prof"))
    if profiles:
        print_reading_and_writing(profiles)
    else:
        print_imports()
    return 0


def print_reading_and_writing(profiles: list[Path]) -> None:
    """Print what share of the time in all profiles is spent in reading and writing."""
    within = total = 0.0
    by_job: dict[str, float] = {}
    for path in profiles:
        profile: Any = pstats.Stats(str(path))  # its stub lacks the table of calls
        seconds = sum(outermost(call, callers) for call, (*_, callers) in profile.stats.items())
        within += seconds
        total += profile.total_tt
        job = path.name.split(".")[0]
        by_job[job] = by_job.get(job, 0.0) + seconds
    print(f"{len(profiles)} jobs, {total:.0f} s in all, {within / total:.1%} reading and writing")
    for job, spent in sorted(by_job.items(), key=lambda item: -item[1])[:5]:
        print(f"  {job}: {spent:.1f} s")


def outermost(call: Call, callers: dict[Call, tuple[int, int, float, float]]) -> float:
    """Seconds in a function that reads or writes, called by one that does neither nor imports.

    What such functions import on their way is taken off again.

    >>> job = ("/x/keystab/stages/semigroup.py", 3, "main")
    >>> table = ("/x/keystab/io/tables.py", 9, "write")
    >>> outermost(table, {job: (1, 1, 0.1, 2.0)})
    2.0
    >>> outermost(("/x/site-packages/pyarrow/csv.py", 1, "write"), {table: (1, 1, 0.1, 1.5)})
    0.0
    >>> outermost(("<frozen importlib._bootstrap>", 1, "_find_and_load"), {table: (1, 1, 0.1, 0.4)})
    -0.4
    """
    by_kind = {True: 0.0, False: 0.0}
    for caller, (_, _, _, cumulative) in callers.items():
        if not IMPORTING.search(text(caller)):
            by_kind[bool(STORES.search(text(caller)))] += cumulative
    if IMPORTING.search(text(call)):
        return -by_kind[True] if call[2] == "_find_and_load" else 0.0
    return by_kind[False] if STORES.search(text(call)) else 0.0


def text(call: Call) -> str:
    """Where a function is, and its name."""
    return f"{call[0]} {call[2]}"


def print_imports() -> None:
    """Print the share of imports in the time of all jobs, and the jobs where it is largest."""
    start = total = 0.0
    shares = []
    for record in sorted((LOGS / "benchmarks").rglob("*.tsv")):
        name = record.relative_to(LOGS / "benchmarks").with_suffix("")
        log = LOGS / name.parent / f"{name.name}.log"
        own = [int(time) / 1e6 for time in IMPORT.findall(log.read_text(encoding="utf-8"))]
        if not own:
            sys.exit(
                f"error: {log.relative_to(ROOT)} times no imports: run the study again, after "
                "`make clean`, with PYTHONPROFILEIMPORTTIME=1"
            )
        with record.open() as lines:
            row = next(csv.DictReader(lines, delimiter="\t"))
        seconds = float(row["s"])
        start += sum(own) + INTERPRETER
        total += seconds
        shares.append((sum(own) / seconds, str(name)))
    print(f"{len(shares)} jobs, {total:.0f} s in all, {start / total:.1%} of it imports")
    for share, job in sorted(shares, reverse=True)[:5]:
        print(f"  {job}: {share:.0%}")


if __name__ == "__main__":
    raise SystemExit(main())
