"""Say what share of the time of the study's jobs starts them, from a run that timed its imports.

PYTHONPROFILEIMPORTTIME=1 make study && python tools/overheads.py

Python then writes into the log of every job how long each import took. What a job takes in all
is in its benchmark record.
"""

from __future__ import annotations

import csv
import re
import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]
LOGS = ROOT / "logs"
IMPORT = re.compile(r"^import time:\s+(\d+) \|\s+\d+ \|", re.MULTILINE)  # microseconds of its own
INTERPRETER = 0.015  # seconds until the first import, `python -I -S -c pass`


def main() -> int:
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
    for share, name in sorted(shares, reverse=True)[:5]:
        print(f"  {name}: {share:.0%}")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
