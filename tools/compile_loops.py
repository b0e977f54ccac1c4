"""Compile the library's loops once, where the study and the tests keep them.

Compiling takes as long as a draft of all figures; the set-up does it so that no job waits for it,
nor the command `keystab`, nor an import of the library: these look for loops beside the modules.
"""

import os
import shutil
from pathlib import Path
from unittest import mock

from keystab.provenance.code_digest import PACKAGE_FOLDER, folder_of_loops, modules_of_loops
from keystab.utils.compiled_loops import forget_outdated


def copy_beside_modules(loops: Path, package_folder: Path) -> None:
    """Copy compiled loops to where numba looks for them when it is told nothing.

    Where it is told a folder, numba keeps those of a module in one below it whose name starts with
    that of the module's own folder.

    Parameters
    ----------
    loops : Path
        Folder that numba was told.
    package_folder : Path
        Folder of the package, whose modules get their loops in a ``__pycache__`` beside them.
    """
    forget_outdated(package_folder)  # and not those that come now, when the library is used first
    for module in modules_of_loops(package_folder):
        path = package_folder.joinpath(*module.split(".")[1:])
        for kind in ("nbc", "nbi"):  # an index comes after what it names
            for made in loops.glob(f"{path.parent.name}_*/{path.name}.*.{kind}"):
                kept = path.parent / "__pycache__"
                kept.mkdir(exist_ok=True)
                shutil.copy2(made, kept / made.name)


if __name__ == "__main__":
    folder = folder_of_loops(Path(__file__).parents[1])
    os.environ["NUMBA_CACHE_DIR"] = str(folder)

    import numpy as np

    from keystab.camera.views import ViewSpec
    from keystab.detection.detector import detect_keypoints
    from keystab.detection.extrema import extrema_of_array
    from keystab.prediction.uncertainty import keypoint_uncertainty
    from keystab.truth.scene_extrema import scene_extrema
    from keystab.truth.true_extrema import true_extrema

    # Who waits for this has been told so by the set-up.
    mock.patch("keystab.scalespace.dog.tell_of_compilation").start()
    picture, large = (np.random.default_rng(0).random((side, side)) for side in (40, 88))
    for oversampling in ("spline", "cosine"):
        detect_keypoints(picture, 0.5, n_spo=4, oversampling=oversampling)
        detect_keypoints(picture, 1.1, n_spo=12, oversampling=oversampling)
        detect_keypoints(large, 1.1, n_spo=18, oversampling=oversampling)  # from few samples
    true_extrema(picture, 0.5, n_spo=[4])
    scene_extrema(picture, ViewSpec(1.1, 2.0, (20, 20)), n_spo=[4])
    extrema_of_array(np.zeros((3, 3, 3)), 0.0)
    keypoint_uncertainty(picture, 0.5, (0.01, 0.01), n_spo=4)
    copy_beside_modules(folder, PACKAGE_FOLDER)
