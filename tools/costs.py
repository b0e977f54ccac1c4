"""Write what each figure costs in docs/reproduce/costs.md, from the records of the last run.

python tools/costs.py    after `make study`

The workflow says which jobs a figure needs (`snakemake --summary`), their records say what they
took. Jobs that several figures share count for each of them.
"""

from __future__ import annotations

import csv
import os
import platform
import subprocess
import sys
from pathlib import Path

import yaml

from keystab import __version__
from keystab.provenance.shielded_environment import shielded
from keystab.study.plan import FIGURES

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs/reproduce/costs.md"
BEGIN, END = "<!-- costs: begin -->\n", "<!-- costs: end -->\n"
OF_THE_PAPER = [name for name in FIGURES if name.startswith("fig")]
OF_OUR_OWN = [name for name in FIGURES if name not in OF_THE_PAPER]
TARGETS = {
    **{f"Figure {name.removeprefix('fig')}": [f"figures/{name}.pdf"] for name in OF_THE_PAPER},
    "These together": [f"figures/{name}.pdf" for name in OF_THE_PAPER],
    **{f"Figure {name}": [f"figures/{name}.pdf"] for name in OF_OUR_OWN},
    "Everything": [],
}


def jobs_and_files(targets: list[str], logs: str) -> tuple[set[Path], set[Path]]:
    """Benchmark records of the jobs that the targets need, and all files that these write."""
    command = [sys.executable, "-m", "snakemake", "--summary", *targets]
    run = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, env=shielded())
    lines = run.stdout.splitlines()
    if run.returncode or not lines:
        sys.exit(run.stderr or "error: snakemake --summary says nothing")
    records, files = set(), set()
    for row in csv.DictReader(lines, delimiter="\t"):
        log = Path(row["log-file(s)"])
        records.add(ROOT / logs / "benchmarks" / log.relative_to(logs).with_suffix(".tsv"))
        files.add(ROOT / row["output_file"])
    return records, files


def measured(record: Path) -> tuple[float, float]:
    """Seconds and largest memory (MB) of one job."""
    try:
        with record.open() as lines:
            row = next(csv.DictReader(lines, delimiter="\t"))
    except (OSError, StopIteration):
        sys.exit(f"error: {record.relative_to(ROOT)}: no such record; run the study first")
    return float(row["s"]), float(row["max_rss"])


def size(path: Path) -> int:
    """Bytes of a file, or of all files of a folder."""
    files = path.rglob("*") if path.is_dir() else [path]
    return sum(file.stat().st_size for file in files if file.is_file())


def in_words(n_bytes: float) -> str:
    """Megabytes or gigabytes, about two digits."""
    megabytes = n_bytes / 1e6
    if megabytes >= 995:
        return f"{megabytes / 1000:.1f} GB"
    return f"{megabytes:.0f} MB" if megabytes >= 9.5 else f"{megabytes:.2g} MB"


def machine() -> str:
    """The machine that this runs on."""
    memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 2**30
    return (
        f"{os.cpu_count()} cores ({platform.machine()}), {memory:.0f} GB of memory, "
        f"{platform.system()}, Python {platform.python_version()}"
    )


def table() -> str:
    """The whole table."""
    logs = yaml.safe_load((ROOT / "config/config.yaml").read_text())["logs"]
    lines = [
        f"Measured with keystab {__version__}, on {machine()}.",
        "",
        "| | command | jobs | minutes, one job at a time | largest job's memory | disk |",
        "|---|---|---:|---:|---:|---:|",
    ]
    for name, targets in TARGETS.items():
        records, files = jobs_and_files(targets, logs)
        taken = [measured(record) for record in sorted(records)]
        seconds, memory = sum(s for s, _ in taken), max(m for _, m in taken)
        command = {0: "`make study`", 1: f"`make {targets[0]}`" if targets else ""}
        disk = in_words(sum(map(size, files)))
        cells = [name, command.get(len(targets), ""), f"{len(taken)}", f"{seconds / 60:.1f}"]
        lines.append(f"| {' | '.join([*cells, f'{memory:.0f} MB', disk])} |")
    return "\n".join(lines) + "\n"


def main() -> int:
    """Write the table between its two markers."""
    text = PAGE.read_text()
    before, rest = text.split(BEGIN)
    PAGE.write_text(before + BEGIN + table() + END + rest.split(END)[1])
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
