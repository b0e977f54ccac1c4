"""Find out whether a keypoint can be trusted.

A simulated camera, the Gaussian scale-space and its extrema, and the statistics of what stays of
them when sampling, view, blur or noise change. All lengths are in pixels of the image at hand.

The public names below are loaded when first used, so that importing the package costs nothing.

Examples
--------
>>> import numpy as np, keystab
>>> y, x = np.mgrid[:31, :31]
>>> blob = np.exp(-((y - 15) ** 2 + (x - 15) ** 2) / (2 * 2.0**2))
>>> found = keystab.detect_keypoints(blob, camera_blur=0.5, n_spo=9)
>>> found.loc[found["value"].idxmin(), ["y", "x", "sign"]].round(2).tolist()
[15.0, 15.0, -1.0]
"""

from functools import cache
from importlib import import_module

from keystab._version import __version__

# Where each public name lives.
_HOME = {
    "Convention": "io.keypoint_conventions",
    "InputError": "errors",
    "balanced_delta": "scalespace.sampling",
    "detect_keypoints": "detection.detector",
    "edge_blur": "camera.edge_blur",
    "fit_psf": "camera.psf_fit",
    "from_lafs": "io.keypoint_conventions",
    "from_opencv": "io.keypoint_conventions",
    "keypoint_uncertainty": "prediction.uncertainty",
    "make_scene": "camera.made_scenes",
    "minimum_unique_set": "matching.unique_keypoints",
    "occurrence": "matching.unique_keypoints",
    "open_scale_space": "io.scale_space_store",
    "open_views": "io.view_store",
    "read_keypoints": "io.keypoint_files",
    "read_picture": "io.pictures",
    "scale_space": "scalespace.dog",
    "scene_extrema": "truth.scene_extrema",
    "simulate_view": "camera.simulation",
    "to_lafs": "io.keypoint_conventions",
    "to_opencv": "io.keypoint_conventions",
    "true_extrema": "truth.true_extrema",
    "unique_keypoints": "matching.unique_keypoints",
    "write_keypoints": "io.keypoint_files",
}

__all__ = ["__version__", *sorted(_HOME)]


def __getattr__(name: str) -> object:
    if name in _HOME:
        _forget_outdated_loops()
        return getattr(import_module(f"keystab.{_HOME[name]}"), name)
    raise AttributeError(f"module 'keystab' has no attribute {name!r}")


def __dir__() -> list[str]:
    return __all__


@cache
def _forget_outdated_loops() -> None:
    import_module("keystab.utils.compiled_loops").forget_outdated()
