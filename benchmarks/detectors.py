"""The detectors that are compared, each a function of one image and of the same fine grid.

All search the grid of `keystab.detect_keypoints` with the same number of layers, and none filters
what it finds. What differs is said beside each. The rivals receive what they need ready-made, so
that only detection is timed.
"""

from __future__ import annotations

import numpy as np

import keystab
from keystab.detection import search_cosine, search_lattice, search_nodes
from keystab.scalespace import dog
from keystab.scalespace.sampling import Sampling, balanced_delta

CAMERA_BLUR = 1.1
SIGMA_MIN = 1.1
KAPPA = 2 ** (1 / 3)


def sampling_of(image: np.ndarray, n_spo: int) -> Sampling:
    """The fine grid that all detectors search."""
    delta = balanced_delta(n_spo, KAPPA, SIGMA_MIN)
    return Sampling(image.shape, CAMERA_BLUR, n_spo, delta, SIGMA_MIN, KAPPA)


def fine_image(image: np.ndarray, n_spo: int) -> np.ndarray:
    """The image on the fine grid, made before the clock starts."""
    from scipy.ndimage import map_coordinates

    sampling = sampling_of(image, n_spo)
    rows, columns = (np.arange(m) * sampling.delta_min for m in sampling.grid_shape)
    grid = np.meshgrid(rows, columns, indexing="ij")
    return np.clip(map_coordinates(image, grid, order=3, mode="reflect"), 0, 1)


def keystab_spline(image: np.ndarray, n_spo: int, threads: int = 1, oversampling: str = "spline"):
    """Oversampling, operators, search and refinement."""

    def detect() -> int:
        forget_operators()
        found = keystab.detect_keypoints(
            image, CAMERA_BLUR, n_spo, oversampling=oversampling, threads=threads
        )
        return len(found)

    return detect


def keystab_cosine(image: np.ndarray, n_spo: int):
    """The same with the cosine series of the image."""
    return keystab_spline(image, n_spo, oversampling="cosine")


def forget_operators() -> None:
    """Forget what keystab keeps for further images of one size: building it counts here."""
    for kept in (
        dog._axis,
        search_nodes.local_axis,
        search_lattice._nodes,
        search_lattice._kinked,
        search_cosine.interpolation,
        search_cosine.band_limited_basis,
    ):
        kept.cache_clear()


def textbook(image: np.ndarray, n_spo: int):
    """Two inverse cosine transforms per slice, maximum and minimum filters of 3 x 3 x 3.

    Oversampling is not timed and extrema are not refined. Three slices are held at a time.
    """
    from scipy.fft import dctn, idctn
    from scipy.ndimage import maximum_filter, minimum_filter

    sampling = sampling_of(image, n_spo)
    fine = fine_image(image, n_spo)
    omega = [np.pi * np.arange(m) / m for m in fine.shape]

    def blurred(transform: np.ndarray, sigma: float) -> np.ndarray:
        variance = max(sigma**2 - CAMERA_BLUR**2, 0) / sampling.delta_min**2
        gain = [np.exp(-0.5 * variance * w**2) for w in omega]
        return idctn(transform * gain[0][:, None] * gain[1], workers=1)

    def detect() -> int:
        transform = dctn(fine, workers=1)
        count = 0
        slices: list[np.ndarray] = []
        for sigma in sampling.sigma:
            slices.append(blurred(transform, KAPPA * sigma) - blurred(transform, sigma))
            if len(slices) == 3:
                box = np.stack(slices)
                inner = np.s_[1, 1:-1, 1:-1]
                top = maximum_filter(box, 3)[inner] == box[inner]
                bottom = minimum_filter(box, 3)[inner] == box[inner]
                count += int(top.sum() + bottom.sum())
                slices.pop(0)
        return count

    return detect


def opencv(image: np.ndarray, n_spo: int, every: int = 2, sigma: float = 1.6):
    """cv2.SIFT on the fine grid: 8 bits in, float32 inside, filters off.

    It doubles what it is given, so that it gets every second fine sample. It goes on to coarser
    octaves, which cannot be turned off and cost a third of the first, and finds orientations.
    """
    import cv2

    cv2.setNumThreads(1)
    given = fine_image(image, n_spo)[::every, ::every]
    pixels = np.ascontiguousarray(np.round(255 * given).astype(np.uint8))
    sift = cv2.SIFT_create(nOctaveLayers=n_spo, contrastThreshold=0, edgeThreshold=1e9, sigma=sigma)
    return lambda: len(sift.detect(pixels, None))


def opencv_same_scales(image: np.ndarray, n_spo: int):
    """As `opencv`, with its first scale at our sigma_min instead of 1.6 fine samples."""
    return opencv(image, n_spo, sigma=SIGMA_MIN / sampling_of(image, n_spo).delta_min)


def opencv_given_the_fine_grid(image: np.ndarray, n_spo: int):
    """As `opencv`, given all fine samples: it searches a grid of four times as many."""
    return opencv(image, n_spo, every=1)


def scikit_image(image: np.ndarray, n_spo: int):
    """skimage.feature.SIFT, one octave on the fine grid, filters off, orientations included."""
    from skimage.feature import SIFT

    sampling = sampling_of(image, n_spo)
    fine = fine_image(image, n_spo)
    sift = SIFT(
        upsampling=1,
        n_octaves=1,
        n_scales=n_spo,
        sigma_min=SIGMA_MIN / sampling.delta_min,
        sigma_in=CAMERA_BLUR / sampling.delta_min * (1 - 1e-9),
        c_dog=0,
        c_edge=1e9,
    )

    def detect() -> int:
        sift.detect(fine)
        return len(sift.keypoints)

    return detect


DETECTORS = {
    "keystab, spline": keystab_spline,
    "keystab, cosine": keystab_cosine,
    "textbook": textbook,
    "OpenCV": opencv,
    "OpenCV, same scales": opencv_same_scales,
    "OpenCV, given the fine grid": opencv_given_the_fine_grid,
    "scikit-image": scikit_image,
}
