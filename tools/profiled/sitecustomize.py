"""Profile every job of a run: on PYTHONPATH, Python imports this when it starts.

See `tools/overheads.py`, which reads the profiles from the folder that PROFILES names.
"""

import atexit
import cProfile
import os
import sys
from pathlib import Path


def write(profile: cProfile.Profile, folder: Path) -> None:
    """Write the profile of a job at its end; other Python processes have none."""
    profile.disable()
    job = Path(sys.argv[0])
    if job.parent.name in ("stages", "figures"):
        folder.mkdir(parents=True, exist_ok=True)
        profile.dump_stats(folder / f"{job.stem}.{os.getpid()}.prof")


if "PROFILES" in os.environ:
    running = cProfile.Profile()
    atexit.register(write, running, Path(os.environ["PROFILES"]).absolute())
    running.enable()
