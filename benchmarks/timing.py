"""Seconds, processor seconds and memory of a function; needs numpy only."""

from __future__ import annotations

import json
import re
import resource
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np


def peak_memory() -> int:
    """Peak resident memory of this process so far, in bytes.

    On Linux from its status: `getrusage` also counts the peak of the process that started it.
    """
    status = Path("/proc/self/status")
    if status.exists():
        found = re.search(r"VmHWM:\s+(\d+) kB", status.read_text())
        if found:
            return int(found[1]) * 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024


def measured(function: Callable[[], int], repeats: int) -> dict[str, float]:
    """Medians over some runs, and what they found."""
    before = peak_memory()
    seconds, processor, count = [], [], 0
    for _ in range(repeats):
        wall, cpu = time.perf_counter(), time.process_time()
        count = function()
        seconds.append(time.perf_counter() - wall)
        processor.append(time.process_time() - cpu)
    return {
        "seconds": float(np.median(seconds)),
        "cpu_seconds": float(np.median(processor)),
        "extra_memory_mb": (peak_memory() - before) / 1e6,
        "keypoints": count,
    }


def report(figures: dict[str, float]) -> None:
    """Print the figures as one line of JSON, the last of the process."""
    print(json.dumps(figures), flush=True)
