"""Compile the library's loops once, where the study and the tests keep them.

Compiling takes as long as a draft of all figures; the set-up does it so that no job waits for it,
nor the command `keystab`, nor an import of the library: these look for loops beside the modules.
"""

import os
import shutil
from pathlib import Path

from keystab.fingerprint import PACKAGE_FOLDER, folder_of_loops

LOOPS = folder_of_loops(Path(__file__).parents[1])
os.environ["NUMBA_CACHE_DIR"] = str(LOOPS)

import numpy as np  # noqa: E402

from keystab.detection import detect_keypoints  # noqa: E402
from keystab.extrema import extrema_of_array  # noqa: E402

if __name__ == "__main__":
    picture = np.random.default_rng(0).random((40, 40))
    for oversampling in ("spline", "cosine"):
        detect_keypoints(picture, 0.5, n_spo=4, oversampling=oversampling)
        detect_keypoints(picture, 1.1, n_spo=12, oversampling=oversampling)  # from few samples
    extrema_of_array(np.zeros((3, 3, 3)), 0.0)
    for kind in ("nbc", "nbi"):  # an index comes after what it names
        for path in LOOPS.glob(f"*/*.{kind}"):
            shutil.copy2(path, PACKAGE_FOLDER / "__pycache__" / path.name)
