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

from importlib import import_module

__version__ = "0.2.0"

# Where each public name lives.
_HOME = {
    "InputError": "errors",
    "balanced_delta": "sampling",
    "detect_keypoints": "detection",
    "fit_psf": "psf",
    "occurrence": "matching",
    "open_scale_space": "stores",
    "open_views": "stores",
    "read_picture": "pictures",
    "scale_space": "dog_space",
    "scene_extrema": "scene_truth",
    "simulate_view": "camera",
    "true_extrema": "truth",
    "unique_keypoints": "matching",
}

__all__ = ["__version__", *sorted(_HOME)]


def __getattr__(name: str) -> object:
    if name in _HOME:
        return getattr(import_module(f"keystab.{_HOME[name]}"), name)
    raise AttributeError(f"module 'keystab' has no attribute {name!r}")


def __dir__() -> list[str]:
    return __all__


# Not a plain import: it changes no result, and what a stage imports is part of its fingerprint.
import_module("keystab.outdated_loops").forget_outdated()
