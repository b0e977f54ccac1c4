"""Benchmarks: other detectors, image size, scales per octave, threads, truth, the study's phases.

Writes `benchmarks/results/*.csv` and `benchmarks/results/README.md`. Every measurement is a
process of its own with one thread unless said otherwise; others take turns with keystab, so that a
machine that slows down slows both. Those of `benchmarks.peers` run in .venv-audit, which
`make audit` makes.
"""

from __future__ import annotations

import argparse
import csv
import json
import os
import platform
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from benchmarks.ours import CAMERA_BLUR, SIGMA_MIN, fine_image, sampling_of, tiled, view
from benchmarks.peers import Grid, Peer, as_shipped, four_times_the_grid, same_grid

ROOT = Path(__file__).parents[1]
RESULTS = ROOT / "benchmarks/results"
PEERS_PYTHON = ROOT / ".venv-audit/bin/python"
RECORDS = ROOT / "logs/benchmarks"
ONE_THREAD = dict.fromkeys(
    ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"), "1"
)
Figures = dict[str, Any]


def ran(python: Path | str, module: str, words: Iterable[str], image: np.ndarray) -> Figures:
    """Figures of one measurement, and the size of the image."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "image.npy"
        np.save(path, image)
        command = [str(python), "-m", module, *words, "--image", str(path)]
        environment = os.environ | ONE_THREAD | {"PYTHONPATH": f"{ROOT / 'src'}:{ROOT}"}
        run = subprocess.run(
            command, env=environment, check=True, stdout=subprocess.PIPE, text=True, cwd=ROOT
        )
    figures: Figures = json.loads(run.stdout.splitlines()[-1])
    return {"height": image.shape[0], "width": image.shape[1], **figures}


def measure(
    what: str, image: np.ndarray, n_spo: int = 15, repeats: int = 3, threads: int = 1
) -> Figures:
    """Measure what `benchmarks.ours` has."""
    words = [what, "--n-spo", str(n_spo), "--repeats", str(repeats), "--threads", str(threads)]
    return {"n_spo": n_spo, **ran(sys.executable, "benchmarks.measure", words, image)}


def measure_peer(peer: Peer, image: np.ndarray, n_spo: int, repeats: int) -> Figures:
    """Measure what `benchmarks.peers` has."""
    given = {
        "view": lambda: image,
        "fine": lambda: fine_image(image, n_spo),
        "half": lambda: fine_image(image, n_spo)[::2, ::2].copy(),
    }[peer.given]()
    words = [peer.library, json.dumps(peer.options), "--repeats", str(repeats)]
    return ran(PEERS_PYTHON, "benchmarks.measure_peer", words, given)


def peers(rounds: int) -> pd.DataFrame:
    """All detectors on the 400 x 225 view, round by round."""
    image = view(225, 400)
    rows = []

    def add(turn: int, n_spo: int, detector: str, grid: str, scales: str, found: Figures) -> None:
        head = {"round": turn, "n_spo": n_spo, "detector": detector, "grid": grid, "scales": scales}
        rows.append(head | {key: found[key] for key in found if key not in ("height", "width")})
        print(f"{n_spo:3d} {detector:20s} {grid:14s} {found['seconds']:9.4f} s", flush=True)

    for turn in range(rounds):
        for n_spo in (15, 3):
            sampling = sampling_of(image, n_spo)
            delta = sampling.delta_min
            grid = Grid(n_spo, SIGMA_MIN / delta, CAMERA_BLUR / delta)
            for name in ("keystab, spline", "keystab, cosine", "textbook"):
                repeats = 1 if name == "textbook" else 3
                add(turn, n_spo, name, "same", "same", measure(name, image, n_spo, repeats))
            others = [*same_grid(grid).items(), *four_times_the_grid(grid).items()]
            for name, peer in others if PEERS_PYTHON.exists() else ():
                repeats = 1 if n_spo == 15 else 3
                found = measure_peer(peer, image, n_spo, repeats)
                add(turn, n_spo, name, peer.grid, peer.scales, found)
        for name, peer in as_shipped().items() if PEERS_PYTHON.exists() else ():
            add(turn, 0, name, peer.grid, peer.scales, measure_peer(peer, image, 3, 3))
    table = pd.DataFrame(rows)
    ours = table[table["detector"] == "keystab, spline"].set_index(["round", "n_spo"])["seconds"]
    # What ships is held against the coarse sampling, which is as dense as theirs.
    keys = zip(table["round"], table["n_spo"].replace(0, 3), strict=True)
    table["times_keystab"] = table["seconds"] / [ours[key] for key in keys]
    return table


def sizes(largest: int) -> pd.DataFrame:
    """Square pictures from 200 x 200 up."""
    rows = []
    for side in (200, 400, 800, 1600, 3200):
        if side <= largest:
            rows.append(
                measure("keystab, spline", view(side, side), repeats=3 if side < 1600 else 1)
            )
            rows[-1]["us_per_pixel"] = 1e6 * rows[-1]["seconds"] / side**2
            print(f"{side} x {side}: {rows[-1]['us_per_pixel']:.2f} us per pixel", flush=True)
    return pd.DataFrame(rows)


def scales() -> pd.DataFrame:
    """The 400 x 225 view from n_spo 3 to 19."""
    image = view(225, 400)
    rows = [measure("keystab, spline", image, n) for n in range(3, 20, 2)]
    for row in rows:
        row["million_samples"] = sampling_of(image, row["n_spo"]).n_samples / 1e6
    return pd.DataFrame(rows)


def threads(rounds: int) -> pd.DataFrame:
    """One thread against two, in turn."""
    image = view(450, 800)
    rows = [
        {"round": turn, "threads": n, **measure("keystab, spline", image, threads=n)}
        for turn in range(rounds)
        for n in (1, 2)
    ]
    return pd.DataFrame(rows)


def truth() -> pd.DataFrame:
    """True extrema of one octave of mirrored tilings of one view."""
    rows = []
    for times in range(4):
        rows.append(measure("truth", tiled(times), repeats=1))
        pixels = rows[-1]["height"] * rows[-1]["width"]
        rows[-1]["us_per_pixel"] = 1e6 * rows[-1]["seconds"] / pixels
        print(f"truth, {pixels} pixels: {rows[-1]['us_per_pixel']:.1f} us per pixel", flush=True)
    return pd.DataFrame(rows)


def phases() -> pd.DataFrame:
    """Processor seconds of the jobs of the last study, by rule."""
    rows = []
    for record in sorted(RECORDS.rglob("*.tsv")):
        rule = record.relative_to(RECORDS).parts[0].removesuffix(".tsv")
        with record.open() as lines:
            row = next(csv.DictReader(lines, delimiter="\t"))
        # Jobs of less than some seconds are over before Snakemake has asked for their CPU time.
        cpu = row["cpu_time"]
        seconds = float(row["s"])
        rows.append((rule, seconds, float(cpu) if cpu.replace(".", "").isdigit() else seconds))
    table = pd.DataFrame(rows, columns=["rule", "seconds", "cpu_seconds"])
    grouped = table.groupby("rule").agg(
        jobs=("seconds", "size"), seconds=("seconds", "sum"), cpu_seconds=("cpu_seconds", "sum")
    )
    return grouped.sort_values("seconds", ascending=False).reset_index()


def markdown(table: pd.DataFrame, columns: dict[str, tuple[str, str]]) -> list[str]:
    """Lines of a table: columns by their names, with their titles and formats."""
    titles = " | ".join(title for title, _ in columns.values())
    lines = [f"| {titles} |", "|" + " --- |" * len(columns)]
    for _, row in table.iterrows():
        cells = (format(row[name], how) if how else row[name] for name, (_, how) in columns.items())
        lines.append(f"| {' | '.join(map(str, cells))} |")
    return lines


def peers_in_words(table: pd.DataFrame) -> list[str]:
    """Three tables: as others ship, on the same grid, on a grid four times as large."""
    keys = ["n_spo", "grid", "detector", "scales"]
    middle = table.groupby(keys, sort=False)[
        ["seconds", "cpu_seconds", "times_keystab", "extra_memory_mb", "keypoints"]
    ].agg(["min", "median", "max"])
    middle.columns = [f"{name}_{how}" for name, how in middle.columns]
    middle = middle.reset_index()
    columns = {
        "detector": ("detector", ""),
        "scales": ("first scale", ""),
        "seconds_median": ("seconds", ".3f"),
        "times_keystab_median": ("times keystab, spline", ".2f"),
        "times_keystab_min": ("least", ".2f"),
        "times_keystab_max": ("most", ".2f"),
        "extra_memory_mb_median": ("extra memory (MB)", ".0f"),
        "keypoints_median": ("keypoints", ".0f"),
    }
    titles = {
        (0, "as they ship"): "As they ship, with all their octaves; keystab at n_spo = 3, one "
        "octave. Their filters are on",
        (15, "same"): "Same grid, n_spo = 15: one octave, 177 million samples, no filters",
        (3, "same"): "Same grid, n_spo = 3: 1.7 million samples",
        (15, "four times"): "OpenCV given the fine grid of n_spo = 15, which it doubles",
        (3, "four times"): "OpenCV given the fine grid of n_spo = 3",
    }
    lines = []
    for (n_spo, grid), title in titles.items():
        rows = middle[(middle["n_spo"] == n_spo) & ((middle["grid"] == grid) | (n_spo == 0))]
        if not rows.empty:
            rows = rows.sort_values("times_keystab_median")
            lines += ["", f"### {title}", "", *markdown(rows, columns)]
    return lines


def report(tables: dict[str, pd.DataFrame]) -> str:
    """The tables in words, for `benchmarks/results/README.md`."""
    lines = [
        "# Measured",
        "",
        f"On {os.cpu_count()} cores ({platform.machine()}), Python {platform.python_version()}, "
        f"numpy {np.__version__}. Made by `make bench`; the CSV files beside this page hold every "
        "measurement, and `benchmarks/peers.py` says what others were given.",
    ]
    about: dict[str, tuple[str, Callable[[pd.DataFrame], list[str]]]] = {
        "peers": (
            "Other detectors, on a view of 400 x 225 pixels, one thread each; medians, and least "
            "and most ratios within a round",
            peers_in_words,
        ),
        "sizes": ("Image size (n_spo = 15)", lambda table: ["", *markdown(table, SIZES)]),
        "scales": ("Scales per octave (400 x 225)", lambda table: ["", *markdown(table, SCALES)]),
        "threads": ("Threads", threads_in_words),
        "truth": ("True extrema of one octave", lambda table: ["", *markdown(table, TRUTH)]),
        "phases": (
            "Jobs of the study by rule, those of more than a hundredth of all",
            lambda table: [
                "",
                *markdown(table[table["seconds"] > table["seconds"].sum() / 100], PHASES),
            ],
        ),
    }
    for name, (title, words) in about.items():
        if name in tables:
            lines += ["", f"## {title}", *words(tables[name])]
    return "\n".join(lines) + "\n"


def threads_in_words(table: pd.DataFrame) -> list[str]:
    """How much two threads help."""
    by_threads = table.pivot(index="round", columns="threads", values="seconds")
    ratio = (by_threads[1] / by_threads[2]).median()
    return ["", f"Two threads are {ratio:.2f} times as fast as one (800 x 450, n_spo = 15)."]


MEMORY = {"extra_memory_mb": ("extra memory (MB)", ".0f")}
SIZES = {
    "height": ("side", ".0f"),
    "seconds": ("seconds", ".2f"),
    "us_per_pixel": ("microseconds per pixel", ".2f"),
    "keypoints": ("keypoints", ".0f"),
    **MEMORY,
}
SCALES = {
    "n_spo": ("n_spo", ".0f"),
    "million_samples": ("million samples", ".1f"),
    "seconds": ("seconds", ".3f"),
    **MEMORY,
}
TRUTH = {
    "height": ("height", ".0f"),
    "width": ("width", ".0f"),
    "seconds": ("seconds", ".1f"),
    "us_per_pixel": ("microseconds per pixel", ".1f"),
    "keypoints": ("extrema", ".0f"),
    **MEMORY,
}
PHASES = {
    "rule": ("rule", ""),
    "jobs": ("jobs", ".0f"),
    "seconds": ("seconds", ".0f"),
    "cpu_seconds": ("processor seconds", ".0f"),
}


def main() -> None:
    """Run the benchmarks that the command line names; all by default."""
    parser = argparse.ArgumentParser(description=__doc__)
    runs: dict[str, Callable[[], pd.DataFrame]] = {
        "peers": lambda: peers(args.rounds),
        "sizes": lambda: sizes(args.largest),
        "scales": scales,
        "threads": lambda: threads(args.rounds),
        "truth": truth,
        "phases": phases,
    }
    parser.add_argument("which", nargs="*", help=f"of {', '.join(runs)}; all by default")
    parser.add_argument("--rounds", type=int, default=3, help="rounds of the comparison")
    parser.add_argument("--largest", type=int, default=3200, help="largest square picture")
    args = parser.parse_args()
    if unknown := set(args.which) - set(runs):
        parser.error(f"unknown: {', '.join(sorted(unknown))}; known are {', '.join(runs)}")
    if not PEERS_PYTHON.exists():
        print(f"no {PEERS_PYTHON}: other detectors are left out; run make audit first")
    RESULTS.mkdir(parents=True, exist_ok=True)
    for name in args.which or runs:
        runs[name]().to_csv(RESULTS / f"{name}.csv", index=False, float_format="%.6g")
    tables = {name: RESULTS / f"{name}.csv" for name in runs}
    known = {name: pd.read_csv(path) for name, path in tables.items() if path.exists()}
    (RESULTS / "README.md").write_text(report(known))


if __name__ == "__main__":
    main()
