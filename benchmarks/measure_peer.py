"""One measurement of a detector of others, in a process of its own; prints one line of JSON.

    python -m benchmarks.measure_peer LIBRARY OPTIONS --image view.npy

with OPTIONS as JSON. Seconds and processor seconds are medians of the repeats after a first run,
which loads what libraries load late; memory is what all runs took beyond what was there before.
"""

from __future__ import annotations

import argparse
import json

import numpy as np

from benchmarks.timing import measured, report
from keystab.audit.worker import LIBRARIES


def main() -> None:
    """Measure what the command line names."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("library", choices=LIBRARIES)
    parser.add_argument("options", type=json.loads)
    parser.add_argument("--image", required=True, help="a .npy file")
    parser.add_argument("--repeats", type=int, default=3)
    args = parser.parse_args()
    image = np.load(args.image)
    function, _ = LIBRARIES[args.library]
    small = image[:64, :64].copy()

    def detect(pixels: np.ndarray = image) -> int:
        return len(function(pixels, 0.0, **args.options)["y"])

    detect(small)
    report(measured(detect, args.repeats))


if __name__ == "__main__":
    main()
