"""Detectors of others, each on a grid that is said beside it.

What they need is in audit.lock, not in environment.lock: `benchmarks.measure_peer` runs with the
Python of .venv-audit, where `make audit` has made one, and there imports nothing of keystab but the
module that calls these libraries, which needs numpy only.
"""

from __future__ import annotations

from typing import Any, NamedTuple

NO_FILTERS = {"contrastThreshold": 0.0, "edgeThreshold": 1e9}


class Grid(NamedTuple):
    """The fine grid that keystab searches, as others are told of it."""

    n_spo: int
    sigma_min: float
    """First scale, in fine samples."""
    camera_blur: float
    """Blur of the image, in fine samples."""


class Peer(NamedTuple):
    """A detector with its settings, and what it is given."""

    library: str
    """A name in `keystab.audit.worker.LIBRARIES`."""
    grid: str
    """Which samples it searches, in words."""
    scales: str
    """At which scales."""
    options: dict[str, Any]
    given: str = "view"
    """The ``view``, the ``fine`` grid, or ``half`` of it: every second sample both ways."""


def same_grid(grid: Grid) -> dict[str, Peer]:
    """Peers that search as many samples as keystab, and as many layers, without filters.

    OpenCV doubles what it is given, and so gets every second fine sample. It cannot be kept from
    coarser octaves, a third of the first, nor any of them from finding orientations, nor COLMAP
    from computing descriptors. COLMAP and VLFeat share their code and begin at 1.6 samples.
    """
    n = grid.n_spo
    opencv = {"nOctaveLayers": n, **NO_FILTERS}
    return {
        "OpenCV": Peer("opencv", "same", "same", opencv | {"sigma": grid.sigma_min}, "half"),
        "OpenCV, its scales": Peer(
            "opencv", "same", "1.6 samples", opencv | {"sigma": 1.6}, "half"
        ),
        "VLFeat": Peer(
            *("vlfeat", "same", "1.6 samples"),
            {"n_levels": n, "n_octaves": 1, "first_octave": 0, "peak_thresh": 0.0}
            | {"edge_thresh": 1e9},
            "fine",
        ),
        "COLMAP": Peer(
            *("colmap", "same", "1.6 samples"),
            {"octave_resolution": n, "num_octaves": 1, "first_octave": 0, "peak_threshold": 1e-5}
            | {"edge_threshold": 1e9, "max_num_features": 2**20},
            "fine",
        ),
        "scikit-image": Peer(
            *("skimage", "same", "same"),
            {"upsampling": 1, "n_octaves": 1, "n_scales": n, "sigma_min": grid.sigma_min}
            | {"sigma_in": grid.camera_blur * (1 - 1e-9), "c_dog": 0, "c_edge": 1e9},
            "fine",
        ),
    }


def four_times_the_grid(grid: Grid) -> dict[str, Peer]:
    """OpenCV given all fine samples, which it doubles."""
    options = {"nOctaveLayers": grid.n_spo, **NO_FILTERS, "sigma": 1.6}
    return {"OpenCV": Peer("opencv", "four times", "1.6 samples", options, "fine")}


def as_shipped() -> dict[str, Peer]:
    """Peers with their own settings on the view: all octaves, few samples, filters."""
    return {
        "OpenCV": Peer("opencv", "view, doubled", "its own", {}),
        "VLFeat": Peer("vlfeat", "view", "its own", {}),
        "COLMAP": Peer("colmap", "view, doubled", "its own", {}),
        "scikit-image": Peer("skimage", "view, doubled", "its own", {}),
    }
