"""Importing the package and its stages changes nothing, and scans no folder."""

from __future__ import annotations

import os
import subprocess
import sys

# Run by a fresh Python: what is imported there, and what came of it.
TRIAL = """
import gc, os, pkgutil, re, sys, threading
from importlib import import_module

changes = []
CHANGES = (
    "os.remove", "os.rename", "os.mkdir", "os.rmdir", "os.truncate", "os.link", "os.symlink",
    "os.utime", "os.chmod", "os.scandir", "shutil.rmtree", "os.putenv", "os.unsetenv", "subprocess.Popen",
)

# numba tries whether the folder that keeps its compiled loops can be written, with a file of no name.
probe = re.compile(r"/__pycache__(/tmp\\w+)?$").search

def watch(event, arguments):
    if event == "open":
        path, _, flags = arguments
        written = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_APPEND
        if flags & written and path != os.devnull and not probe(str(path)):
            changes.append(f"{event} {path}")
    elif event in CHANGES and not probe(str(arguments[0])):
        changes.append(f"{event} {arguments}")

def state():
    return (
        gc.isenabled(), gc.get_threshold(), gc.get_freeze_count(), dict(os.environ), os.getcwd(),
        threading.active_count(),
    )

# What other packages do when they are imported is theirs: threadpoolctl sets a variable of OpenMP.
import numba, numpy, pandas, threadpoolctl

before = state()
sys.addaudithook(watch)
import keystab
import keystab.stages

names = [module.name for module in pkgutil.iter_modules(keystab.stages.__path__)]
for name in names:
    import_module(f"keystab.stages.{name}")
assert state() == before, (before, state())
assert not changes, changes
print(len(names))

gc.disable()  # the watch is awake
assert state() != before
os.environ["OMP_NUM_THREADS"] = "1"
assert len(changes) == 1, changes
"""


def test_importing_the_package_and_all_stages_changes_nothing():
    # Without bytecode, which Python itself would write, and without what this process has set.
    given = {name: os.environ[name] for name in ("PATH", "PYTHONPATH") if name in os.environ}
    run = subprocess.run(
        [sys.executable, "-B", "-c", TRIAL], env=given, capture_output=True, text=True
    )
    assert run.returncode == 0, run.stderr
    assert int(run.stdout) > 30
