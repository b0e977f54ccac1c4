"""One measurement in a process of its own: seconds, processor seconds, peak memory.

Run by `benchmarks.__main__`; prints one line of JSON.
"""

from __future__ import annotations

import argparse
import json
import re
import resource
import time
from pathlib import Path

import numpy as np

from benchmarks.detectors import DETECTORS, keystab_spline
from keystab.camera.simulation import simulate_view
from keystab.io.pictures import read_picture

PICTURE = "config/images/coldwarm.png"


def view(height: int, width: int) -> np.ndarray:
    """A view of the reference picture, float32 like those of the study."""
    reference = read_picture(PICTURE)
    step = min(reference.shape[0] / height, reference.shape[1] / width)
    image = simulate_view(reference, 1.1, step, (height, width))
    return image.astype(np.float32).astype(np.float64)


def peak_memory() -> int:
    """Peak resident memory of this process so far, in bytes.

    On Linux from its status: `getrusage` also counts the peak of the process that started it.
    """
    status = Path("/proc/self/status")
    if status.exists():
        return int(re.search(r"VmHWM:\s+(\d+) kB", status.read_text())[1]) * 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024


def main() -> None:
    """Measure what the command line names."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("detector", choices=DETECTORS)
    parser.add_argument("--image", required=True, help="a .npy file")
    parser.add_argument("--n-spo", type=int, default=15)
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--threads", type=int, default=1)
    args = parser.parse_args()
    image = np.load(args.image)
    make = DETECTORS[args.detector]
    # Compiled code is loaded before the clock starts: all of it, so as many samples are searched as
    # make a search of few of them worth while.
    small = image[:200, :200].copy()
    if make is keystab_spline:
        keystab_spline(small, args.n_spo, args.threads)()
        detect = keystab_spline(image, args.n_spo, args.threads)
    else:
        if args.detector.startswith("keystab"):
            make(small, args.n_spo)()
        detect = make(image, args.n_spo)
    before = peak_memory()
    seconds, processor, count = [], [], 0
    for _ in range(args.repeats):
        wall, cpu = time.perf_counter(), time.process_time()
        count = detect()
        seconds.append(time.perf_counter() - wall)
        processor.append(time.process_time() - cpu)
    print(
        json.dumps(
            {
                "seconds": float(np.median(seconds)),
                "cpu_seconds": float(np.median(processor)),
                "extra_memory_mb": (peak_memory() - before) / 1e6,
                "keypoints": count,
            }
        )
    )


if __name__ == "__main__":
    main()
