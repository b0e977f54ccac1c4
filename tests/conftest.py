"""What all tests share."""

import gc
import os
from pathlib import Path

from keystab.provenance.code_digest import folder_of_loops

# Loops that numba has compiled are kept where the study keeps them.
os.environ.setdefault("NUMBA_CACHE_DIR", str(folder_of_loops(Path(__file__).parents[1])))
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# What is imported and collected stays to the end: looking for garbage in it takes a tenth of the time.
gc.disable()


def pytest_collection_finish() -> None:
    """Begin to collect garbage, of what the tests make."""
    gc.freeze()
    gc.enable()
