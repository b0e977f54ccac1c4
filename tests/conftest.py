"""What all tests share."""

import os
from pathlib import Path

# Loops that numba has compiled are kept where the study keeps them.
os.environ.setdefault("NUMBA_CACHE_DIR", str(Path(__file__).parents[1] / ".snakemake" / "numba"))
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
