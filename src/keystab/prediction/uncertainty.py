r"""Error bars of every keypoint of a picture, and whether it can be expected to come back.

White noise of variance :math:`s^2` moves an extremum of the difference of Gaussians w with the
Hessian H by :math:`\delta = -H^{-1} g`, g the gradient of the noise's own difference of Gaussians,
as long as the shift is small. Where it is not, extrema appear and vanish. Both are had from one
model of all derivatives up to the fourth order: `keystab.prediction.survival`.
"""

from __future__ import annotations

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from keystab.detection.detector import detect_keypoints
from keystab.errors import InputError
from keystab.prediction.detector_error import detector_error
from keystab.prediction.local_jets import local_image, local_jets
from keystab.prediction.noise_covariance import noise_jets
from keystab.prediction.noise_level import estimated_noise
from keystab.prediction.survival import after_noise, among_scenes
from keystab.scalespace.dog import checked_image
from keystab.scalespace.sampling import balanced_delta
from keystab.utils import validation
from keystab.utils.grey_values import grey_unit
from keystab.utils.one_thread import one_thread
from keystab.utils.progress import progress_if_watched

__all__ = ["keypoint_uncertainty"]

#: Keypoints handled at once: bounds the memory of their covariances to some 50 MB.
_BATCH = 2048

#: Largest standard deviation of the noise, over the largest grey value.
_MOST_NOISE = 1e6


def keypoint_uncertainty(
    image: np.ndarray,
    camera_blur: float,
    noise: float | tuple[float, float] | None = None,
    n_spo: int = 15,
    delta_min: float | None = None,
    sigma_min: float = 1.1,
    kappa: float = 2 ** (1 / 3),
    oversampling: str = "spline",
    epsilon: float = 0.0,
    refine: bool = True,
    max_offset: float = 0.6,
    max_iterations: float = 2,
    scale_moves: bool = True,
    move: str = "nearest",
    n_oct: int | str = 1,
    threads: int = 1,
    noise_free: bool = False,
) -> pd.DataFrame:
    r"""Detect the keypoints of a picture, and say how far off each is and whether it stays.

    Parameters
    ----------
    image : array_like, shape (height, width)
        Grey image; pixel centres at whole numbers, (0, 0) top left.
    camera_blur : float
        Gaussian blur c that the image already has, in pixels, 0 <= c <= sigma_min.
    noise : float or (float, float), optional
        Noise of a pixel in the units of the image, independent from pixel to pixel: its standard
        deviation; or (a, b), at least 0, for a variance of a + b times the grey value (readout: a,
        photons: b), which is taken at the scale of each keypoint. None estimates one standard
        deviation from the image; `keystab.prediction.noise_level.estimated_noise` says what that
        cannot see.
    n_spo, delta_min, sigma_min, kappa, oversampling, epsilon, refine, max_offset, max_iterations,
    scale_moves, move, n_oct, threads
        See `keystab.detect_keypoints`; ``n_spo`` is 15 here, where the detector's own error is
        small.
    noise_free : bool
        Whether the image holds no noise itself, as a simulated view does not. A photograph does.

    Returns
    -------
    DataFrame
        The table of `keystab.detect_keypoints` and

        ``std_y, std_x``
            Standard deviation of the position in pixels, of a keypoint that survives.
        ``std_log_sigma``
            That of :math:`\ln\sigma`.
        ``cov_yx, cov_y_log_sigma, cov_x_log_sigma``
            Covariances of the same.
        ``survival``
            Probability that an independent second shot of the scene with the same blur and noise
            has an extremum of the same sign within a Euclidean distance of 0.5 in
            :math:`(\ln\sigma, y/\sigma, x/\sigma)`.
        ``conditioning``
            Smallest over largest absolute eigenvalue of the Hessian in the same units, as
            `keystab.true_extrema` has it; 0 where it has not the signature of an extremum.
        ``noise``
            Standard deviation of the noise that was assumed there.

    Raises
    ------
    InputError
        As `keystab.detect_keypoints`; for noise that is negative or out of all proportion to the
        image, and for an image too small to estimate noise from.

    Notes
    -----
    Two shots of one scene differ by the noise of both. The covariance is the half of what is
    expected of the difference of a keypoint's positions in two such shots, given that it is in
    both: the part of one shot. So the difference of two shots has twice the covariance; that from
    the scene's own extremum has about once. With `noise_free` it is that of the shift from the
    extremum of the image to that of a shot. The detector's own error at this sampling, measured on
    one picture (`keystab.prediction.detector_error`), is added to it, and `survival` is multiplied
    by the share of true extrema that the detector finds there.

    ``docs/uncertainty.md`` says what they were held against, on four photographs that did not steer
    the model, and where they fail.

    Against the scene's own extremum ellipses are too short where noise is large, because two shots
    that agree may err alike.

    A keypoint of the second shot may serve several of the first: a detector reports some nearly
    degenerate extrema twice or three times. Matched one to one, fewer return than is said where
    these are many.

    JPEG hides noise from the estimate, more so the less there is, and moves keypoints itself. Give
    `noise` for compressed pictures.

    The shift of an extremum whose survival is low is not normal: it is limited by the distance at
    which it would not count as the same. Near the ends of the range of scales that is searched, a
    keypoint may leave it; ``survival`` does not count that. Where ``sigma`` is close to
    `camera_blur` little blur is added, and the noise's covariance rests on the band of the pixel
    grid. Derivatives are those of the cubic spline through the pixels, whichever the oversampling.

    The wrong camera blur shifts scales; no error bar holds that.

    Examples
    --------
    >>> y, x = np.mgrid[:41, :41]
    >>> blob = np.exp(-((y - 20) ** 2 + (x - 20) ** 2) / (2 * (2.0**2 + 0.8**2)))
    >>> noise = 0.01 * np.random.default_rng(0).standard_normal(blob.shape)
    >>> found = keypoint_uncertainty(blob + noise, camera_blur=0.8, noise=0.01)
    >>> found.loc[found["value"].idxmin(), ["std_y", "std_x", "survival"]].round(3).tolist()
    [0.013, 0.013, 0.995]
    """
    array = checked_image(image)
    validation.boolean("noise_free", noise_free)
    unit = grey_unit(array)
    model = _noise_model(array, noise, unit)
    keypoints = detect_keypoints(
        array,
        camera_blur,
        n_spo,
        delta_min,
        sigma_min,
        kappa,
        oversampling,
        epsilon,
        refine,
        max_offset,
        max_iterations,
        scale_moves,
        move,
        n_oct,
        threads,
    )
    columns: dict[str, NDArray[np.float64]] = {name: np.empty(len(keypoints)) for name in _COLUMNS}
    sampling = (n_spo, delta_min or balanced_delta(n_spo, kappa, sigma_min), sigma_min, refine)
    jets, level = _at_keypoints(array / unit, keypoints, camera_blur, kappa, model)
    batches = range(0, len(keypoints), _BATCH)
    with one_thread():  # of matrices of 35 x 35: more threads took four times the processor's time
        for start in progress_if_watched(batches, len(batches), "error bars"):
            rows = slice(start, start + _BATCH)
            seen = keypoints.iloc[rows], jets[rows], level[rows]
            part = _error_bars(*seen, camera_blur, kappa, sampling, noise_free)
            for name, values in part.items():
                columns[name][rows] = values
    columns["noise"] *= unit
    return keypoints.assign(**columns)


_COLUMNS = (
    "std_y",
    "std_x",
    "std_log_sigma",
    "cov_yx",
    "cov_y_log_sigma",
    "cov_x_log_sigma",
    "survival",
    "conditioning",
    "noise",
)


def _noise_model(
    image: NDArray[np.float64], noise: float | tuple[float, float] | None, unit: float
) -> tuple[float, float]:
    """Variance of the noise at grey value 0, and what it gains per grey value; grey in units."""
    if noise is None:
        return (estimated_noise(image) / unit) ** 2, 0.0
    if isinstance(noise, (tuple, list, np.ndarray)):
        if len(noise) != 2:
            raise InputError(
                f"noise has {len(noise)} numbers, allowed are one standard deviation or (a, b) for "
                "a variance of a + b times the grey value: change noise"
            )
        offset, slope = (validation.number("noise", part, least=0) for part in noise)
        level = np.sqrt(offset) / unit
        slope /= unit
    else:
        level, slope = validation.number("noise", noise, least=0) / unit, 0.0
    if max(level, np.sqrt(slope)) > _MOST_NOISE:
        raise InputError(
            f"noise is {noise}, more than {_MOST_NOISE:g} times the picture's largest grey value: "
            "give noise in the units of the picture"
        )
    return float(level) ** 2, slope


def _at_keypoints(
    image: NDArray[np.float64],
    keypoints: pd.DataFrame,
    camera_blur: float,
    kappa: float,
    noise: tuple[float, float],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Derivatives at the keypoints, and the standard deviation of the noise there."""
    sigma, y, x = (keypoints[name].to_numpy(dtype=np.float64) for name in ("sigma", "y", "x"))
    scale = np.maximum(sigma, camera_blur)  # a refined scale may lie below
    offset, slope = noise
    variance = np.full(len(keypoints), offset)
    if slope:
        variance += slope * local_image(image, scale, y, x, camera_blur)
    jets = local_jets(image, scale, y, x, camera_blur, kappa)
    return jets, np.sqrt(np.maximum(variance, 0.0))


def _error_bars(
    keypoints: pd.DataFrame,
    jets: NDArray[np.float64],
    level: NDArray[np.float64],
    camera_blur: float,
    kappa: float,
    sampling: tuple[int, float, float, bool],
    noise_free: bool,
) -> dict[str, NDArray[np.float64]]:
    """Columns that keypoints get from what is known at each: no row depends on another."""
    sigma, sign = (keypoints[name].to_numpy(dtype=np.float64) for name in ("sigma", "sign"))
    scale = np.maximum(sigma, camera_blur)
    covariance = noise_jets(scale, camera_blur, kappa) * level[:, None, None] ** 2
    n_spo, delta_min, sigma_min, refined = sampling
    octave = keypoints["octave"].to_numpy(dtype=np.int64)
    step = delta_min * 2.0**octave
    grid = np.column_stack(
        [
            np.full(sigma.size, np.log(2) / n_spo),
            step / sigma,
            keypoints["s"] - n_spo * (np.log2(sigma / sigma_min) - octave),
            keypoints["row"] - keypoints["y"] / step,
            keypoints["column"] - keypoints["x"] / step,
        ]
    )
    survival = np.empty(len(keypoints))
    moments = np.empty((len(keypoints), 3, 3))
    quiet = (level == 0) | noise_free
    for rows, known in ((quiet, True), (~quiet, False)):
        if not rows.any():
            continue
        seen = jets[rows], sign[rows], covariance[rows], grid[rows]
        outcome = after_noise(*seen) if known else among_scenes(*seen, level[rows], kappa)
        survival[rows] = outcome.survival
        moments[rows] = outcome.moments * (1.0 if known else 0.5)
    own = detector_error(octave, n_spo, delta_min, sigma_min, refined)
    return {
        "std_y": np.sqrt(sigma**2 * moments[:, 1, 1] + own.location**2),
        "std_x": np.sqrt(sigma**2 * moments[:, 2, 2] + own.location**2),
        "std_log_sigma": np.sqrt(moments[:, 0, 0] + own.log_sigma**2),
        "cov_yx": sigma**2 * moments[:, 1, 2],
        "cov_y_log_sigma": sigma * moments[:, 0, 1],
        "cov_x_log_sigma": sigma * moments[:, 0, 2],
        "survival": survival * own.recall,
        "conditioning": _conditioning(jets, sign),
        "noise": level,
    }


def _conditioning(jets: NDArray[np.float64], sign: NDArray[np.float64]) -> NDArray[np.float64]:
    """Smallest over largest eigenvalue of the Hessian, 0 where it is not definite."""
    hessian = jets[:, [[4, 5, 6], [5, 7, 8], [6, 8, 9]]]
    values = np.linalg.eigvalsh(-sign[:, None, None] * hessian)
    with np.errstate(divide="ignore", invalid="ignore"):
        share: NDArray[np.float64] = np.where(values[:, 0] > 0, values[:, 0] / values[:, 2], 0.0)
    return share
