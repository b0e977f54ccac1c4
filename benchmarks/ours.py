"""What is measured in this project's own environment: its detector, its truth, the textbook way."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

import keystab
from keystab.camera.simulation import simulate_view
from keystab.detection import search_cosine, search_lattice, search_nodes
from keystab.io.pictures import read_picture
from keystab.scalespace import dog
from keystab.scalespace.sampling import Sampling, balanced_delta

PICTURE = "config/images/coldwarm.png"
CAMERA_BLUR = 1.1
SIGMA_MIN = 1.1
KAPPA = 2 ** (1 / 3)


def view(height: int, width: int) -> np.ndarray:
    """A view of the reference picture, float32 like those of the study."""
    reference = read_picture(PICTURE)
    step = min(reference.shape[0] / height, reference.shape[1] / width)
    image = simulate_view(reference, CAMERA_BLUR, step, (height, width))
    return image.astype(np.float32).astype(np.float64)


def tiled(times: int) -> np.ndarray:
    """A view of 112 x 200 pixels and its mirror images: as many extrema per pixel at any size."""
    image = view(112, 200)
    for _ in range(times):
        image = np.block([[image, image[:, ::-1]], [image[::-1], image[::-1, ::-1]]])
    return np.ascontiguousarray(image)


def sampling_of(image: np.ndarray, n_spo: int) -> Sampling:
    """The fine grid that is searched."""
    delta = balanced_delta(n_spo, KAPPA, SIGMA_MIN)
    return Sampling(image.shape, CAMERA_BLUR, n_spo, delta, SIGMA_MIN, KAPPA)


def fine_image(image: np.ndarray, n_spo: int) -> np.ndarray:
    """The image on the fine grid, made before the clock starts."""
    from scipy.ndimage import map_coordinates

    sampling = sampling_of(image, n_spo)
    rows, columns = (np.arange(m) * sampling.delta_min for m in sampling.grid_shape)
    grid = np.meshgrid(rows, columns, indexing="ij")
    return np.clip(map_coordinates(image, grid, order=3, mode="reflect"), 0, 1)


def forget_operators() -> None:
    """Forget what keystab keeps for further images of one size: building it counts here."""
    for kept in (
        dog._axis,
        search_nodes.local_axis,
        search_lattice._nodes,
        search_lattice._kinked,
        search_cosine.continued_axis,
    ):
        kept.cache_clear()


def spline(
    image: np.ndarray, n_spo: int, threads: int = 1, oversampling: str = "spline"
) -> Callable[[], int]:
    """Oversampling, operators, search and refinement."""

    def detect() -> int:
        forget_operators()
        found = keystab.detect_keypoints(
            image, CAMERA_BLUR, n_spo, oversampling=oversampling, threads=threads
        )
        return len(found)

    return detect


def cosine(image: np.ndarray, n_spo: int, threads: int = 1) -> Callable[[], int]:
    """The same with the cosine series of the image."""
    return spline(image, n_spo, threads, oversampling="cosine")


def truth(image: np.ndarray, n_spo: int, threads: int = 1) -> Callable[[], int]:
    """All extrema of the continuous scale-space in one octave; has no sampling."""
    return lambda: len(keystab.true_extrema(image, CAMERA_BLUR, 1.1, 2.2, threads=threads))


def textbook(image: np.ndarray, n_spo: int, threads: int = 1) -> Callable[[], int]:
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
        return idctn(transform * gain[0][:, None] * gain[1], workers=threads)

    def detect() -> int:
        transform = dctn(fine, workers=threads)
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


OURS = {
    "keystab, spline": spline,
    "keystab, cosine": cosine,
    "textbook": textbook,
    "truth": truth,
}
