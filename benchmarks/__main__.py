"""Benchmarks: rivals, image size, scales per octave, threads.

Writes `benchmarks/results/*.csv` and `benchmarks/results/README.md`. Every measurement is a
process of its own with one thread per library unless said otherwise; rivals take turns with
keystab so that a machine that slows down slows both.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import pandas as pd

from benchmarks.detectors import DETECTORS, sampling_of
from benchmarks.measure import view

RESULTS = Path("benchmarks/results")
ONE_THREAD = dict.fromkeys(
    ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"), "1"
)


def measure(
    detector: str, image: np.ndarray, n_spo: int = 15, repeats: int = 3, threads: int = 1
) -> dict[str, float]:
    """Run one measurement and return its figures with the time per sample."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "image.npy"
        np.save(path, image)
        command = [sys.executable, "-m", "benchmarks.measure", detector, "--image", str(path)]
        command += ["--n-spo", str(n_spo), "--repeats", str(repeats), "--threads", str(threads)]
        run = subprocess.run(
            command, env=os.environ | ONE_THREAD, check=True, capture_output=True, text=True
        )
    figures = json.loads(run.stdout)
    samples = sampling_of(image, n_spo).n_samples
    figures["ns_per_sample"] = 1e9 * figures["seconds"] / samples
    return {"height": image.shape[0], "width": image.shape[1], "n_spo": n_spo, **figures}


def rivals(rounds: int) -> pd.DataFrame:
    """All detectors on the 400 x 225 view at n_spo = 15, round by round."""
    image = view(225, 400)
    rows = []
    for turn in range(rounds):
        for name in DETECTORS:
            figures = measure(name, image, repeats=3 if name.startswith("keystab") else 1)
            rows.append({"round": turn, "detector": name, **figures})
            print(f"{name:28s} {figures['seconds']:8.2f} s", flush=True)
    table = pd.DataFrame(rows)
    ours = table[table["detector"] == "keystab, spline"].set_index("round")["seconds"]
    table["times_keystab"] = table["seconds"] / table["round"].map(ours)
    return table


def sizes(largest: int) -> pd.DataFrame:
    """Square pictures from 200 x 200 up."""
    rows = []
    for side in (200, 400, 800, 1600, 3200):
        if side <= largest:
            repeats = 3 if side < 1600 else 1
            rows.append(measure("keystab, spline", view(side, side), repeats=repeats))
            print(f"{side} x {side}: {rows[-1]['ns_per_sample']:.2f} ns/sample", flush=True)
    return pd.DataFrame(rows)


def scales() -> pd.DataFrame:
    """The 400 x 225 view from n_spo 3 to 19."""
    image = view(225, 400)
    return pd.DataFrame([measure("keystab, spline", image, n) for n in range(3, 20, 2)])


def threads() -> pd.DataFrame:
    """One thread against two, in turn."""
    image = view(450, 800)
    rows = [
        {"round": turn, "threads": n, **measure("keystab, spline", image, threads=n)}
        for turn in range(3)
        for n in (1, 2)
    ]
    return pd.DataFrame(rows)


def report(tables: dict[str, pd.DataFrame]) -> str:
    """The tables in words, for `benchmarks/results/README.md`."""
    lines = [
        "# Measured",
        "",
        f"On {os.cpu_count()} cores ({platform.machine()}), Python {platform.python_version()}, "
        f"numpy {np.__version__}. Made by `make bench`; the CSV files beside this page hold every "
        "measurement.",
    ]
    if "rivals" in tables:
        middle = tables["rivals"].groupby("detector", sort=False).median(numeric_only=True)
        lines += [
            "",
            "## Rivals",
            "",
            "One octave, n_spo = 15, of a 400 x 225 view: 177 million samples. One thread, median "
            "of the rounds, ratios within each round. What each does is said in "
            "`benchmarks/detectors.py`; OpenCV doubles its input, so that given the fine grid it "
            "searches four times as many samples.",
            "",
            "| detector | seconds | times keystab | extra memory (MB) | keypoints |",
            "| --- | ---: | ---: | ---: | ---: |",
        ]
        lines += [
            f"| {name} | {row['seconds']:.2f} | {row['times_keystab']:.1f} | "
            f"{row['extra_memory_mb']:.0f} | {row['keypoints']:.0f} |"
            for name, row in middle.iterrows()
        ]
    for name, title, column in (
        ("sizes", "Image size (n_spo = 15)", "height"),
        ("scales", "Scales per octave (400 x 225)", "n_spo"),
    ):
        if name in tables:
            lines += ["", f"## {title}", ""]
            lines += [f"| {column} | seconds | ns per sample | extra memory (MB) |"]
            lines += ["| ---: | ---: | ---: | ---: |"]
            lines += [
                f"| {row[column]:.0f} | {row['seconds']:.2f} | {row['ns_per_sample']:.2f} | "
                f"{row['extra_memory_mb']:.0f} |"
                for _, row in tables[name].iterrows()
            ]
    if "threads" in tables:
        by_threads = tables["threads"].pivot(index="round", columns="threads", values="seconds")
        ratio = (by_threads[1] / by_threads[2]).median()
        lines += ["", "## Threads", "", f"Two threads are {ratio:.2f} times as fast as one."]
    return "\n".join(lines) + "\n"


def main() -> None:
    """Run the benchmarks that the command line names; all by default."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("which", nargs="*", default=["rivals", "sizes", "scales", "threads"])
    parser.add_argument("--rounds", type=int, default=3, help="rounds of the comparison")
    parser.add_argument("--largest", type=int, default=3200, help="largest square picture")
    args = parser.parse_args()
    RESULTS.mkdir(parents=True, exist_ok=True)
    runs = {
        "rivals": lambda: rivals(args.rounds),
        "sizes": lambda: sizes(args.largest),
        "scales": scales,
        "threads": threads,
    }
    for name in args.which:
        runs[name]().to_csv(RESULTS / f"{name}.csv", index=False, float_format="%.6g")
    present = {name: RESULTS / f"{name}.csv" for name in runs}
    tables = {name: pd.read_csv(path) for name, path in present.items() if path.exists()}
    (RESULTS / "README.md").write_text(report(tables))


if __name__ == "__main__":
    main()
