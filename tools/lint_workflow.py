"""Run `snakemake --lint` and print what it finds, except advice that this project does not take.

Snakemake advises a conda environment or a container for each rule. Here one hash-pinned file,
environment.lock, says what software all rules run with, and every rule carries its digest.
"""

from __future__ import annotations

import subprocess
import sys

from keystab.provenance.shielded_environment import shielded

NOT_TAKEN = "Specify a conda environment or container for each rule."


def advice(report: str) -> list[str]:
    """Headlines of a report, each after the rule or file that it is about."""
    found, about = [], ""
    for line in report.splitlines():
        if line.startswith("Lints for "):
            about = line.removeprefix("Lints for ")
        elif line.startswith("    * "):
            found.append(f"{about} {line.removeprefix('    * ').rstrip(':')}")
    return found


def main() -> int:
    """Return 0 where nothing is left, else 1."""
    command = [sys.executable, "-m", "snakemake", "--lint"]
    run = subprocess.run(command, capture_output=True, text=True, env=shielded())
    report = run.stdout + run.stderr
    found = advice(report)
    if run.returncode and not found:  # not a report but an error
        sys.stderr.write(report)
        return 1
    left = [line for line in found if not line.endswith(NOT_TAKEN)]
    print("\n".join(left) or "snakemake --lint: nothing found")
    return 1 if left else 0


if __name__ == "__main__":
    raise SystemExit(main())
