"""One measurement in this environment, in a process of its own; prints one line of JSON."""

from __future__ import annotations

import argparse

import numpy as np

from benchmarks.ours import OURS
from benchmarks.timing import measured, report


def main() -> None:
    """Measure what the command line names."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("what", choices=OURS)
    parser.add_argument("--image", required=True, help="a .npy file")
    parser.add_argument("--n-spo", type=int, default=15)
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--threads", type=int, default=1)
    args = parser.parse_args()
    image = np.load(args.image)
    make = OURS[args.what]
    if args.what != "textbook":
        # Compiled code is loaded before the clock starts: all of it, so as many samples are
        # searched as make a search of few of them worth while.
        make(image[:200, :200].copy(), args.n_spo, args.threads)()
    report(measured(make(image, args.n_spo, args.threads), args.repeats))


if __name__ == "__main__":
    main()
