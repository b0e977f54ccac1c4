"""What the detector finds of Gaussian blobs, beside what theory says: the table of figure S4."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import pandas as pd

from keystab.detection.refinement import refined_keypoints
from keystab.detection.view_detector import Detector, detect_in_view
from keystab.errors import InputError
from keystab.scalespace import cosine_series
from keystab.scalespace.gaussian_blobs import (
    blob_image,
    dog_extremum_scale,
    laplacian_extremum_scale,
)
from keystab.utils import validation
from keystab.utils.roots import root_between

_HALF_WIDTH = 5.0
"""Half width of an image in standard deviations of its blob. At the scale of the extremum the
mirror image beyond the border is then below 1e-9 of the blob."""

_LOWER, _UPPER = 1 / 3, 3.0
"""The extremum of the Laplacian is sought between these multiples of the theoretical scale."""

_PLACES = 41
"""Scales at which the Laplacian is looked at first, 5 % apart."""


class _Way(NamedTuple):
    """One way to find the scale of a blob."""

    experiment: str
    kappa: float
    n_spo: int
    detection: str
    assumed_blur: float


def sizes(size_from: float, size_to: float, size_count: int) -> list[float]:
    """Sizes of blobs, evenly spaced in their logarithm; rounded, so that they can be read.

    Examples
    --------
    >>> sizes(1.2, 3.6, 3)
    [1.2, 2.078461, 3.6]
    """
    spaced: list[float] = np.geomspace(size_from, size_to, size_count).round(6).tolist()
    return spaced


def detect_blobs(
    blobs: Sequence[float],
    kappa: float = 2 ** (1 / 3),
    kappas: Sequence[float] = (2 ** (1 / 30), 2 ** (1 / 3), 2 ** (1 / 2)),
    n_spo: Sequence[int] = (3, 15),
    camera_blur: float = 0.8,
    assumed_blurs: Sequence[float] = (0.5, 1.1),
    sigma_min: float = 1.1,
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Detect blobs of many sizes in all ways that `blob_table` compares.

    Parameters
    ----------
    blobs, kappa, kappas, n_spo, camera_blur, assumed_blurs, sigma_min
        See `blob_table`.

    Returns
    -------
    extrema, traces : pandas.DataFrame
        See `keystab.detection.view_detector.detect_in_view`; extrema also say of which ``blob``
        they are and how it was searched, ``kappa``, ``n_spo`` and ``assumed_blur``. ``keypoint`` in
        `traces` is the row in `extrema`.

    Raises
    ------
    InputError
        If a parameter is out of range.

    Examples
    --------
    >>> extrema, traces = detect_blobs([3.0], kappas=[1.2], n_spo=[3], assumed_blurs=[])
    >>> extrema["kappa"].unique().round(2).tolist()
    [1.2, 1.26]
    """
    if len(blobs) == 0:
        raise InputError("blobs: none were given; give standard deviations in pixels")
    for blob in blobs:
        validation.number("blobs", blob, above=0)
    first = max(sigma_min, camera_blur, *assumed_blurs)
    found, followed, n_found = [], [], 0
    for blob in map(float, blobs):
        image, _ = _image(blob, camera_blur)
        ways = _ways(kappa, kappas, n_spo, camera_blur, assumed_blurs)
        for ratio, n, assumed in dict.fromkeys(
            (way.kappa, way.n_spo, way.assumed_blur) for way in ways if way.detection != "series"
        ):
            scale = float(dog_extremum_scale(blob, ratio, float(camera_blur), assumed))
            detector = Detector(
                assumed, n, sigma_min=first, kappa=ratio, n_oct=_octaves(scale, first, n)
            )
            extrema, traces = detect_in_view(image, detector)
            found.append(extrema.assign(blob=blob, kappa=ratio, n_spo=n, assumed_blur=assumed))
            followed.append(traces.assign(keypoint=traces["keypoint"] + n_found))
            n_found += len(extrema)
    return pd.concat(found, ignore_index=True), pd.concat(followed, ignore_index=True)


def blob_table(
    blobs: Sequence[float],
    kappa: float = 2 ** (1 / 3),
    kappas: Sequence[float] = (2 ** (1 / 30), 2 ** (1 / 3), 2 ** (1 / 2)),
    n_spo: Sequence[int] = (3, 15),
    camera_blur: float = 0.8,
    assumed_blurs: Sequence[float] = (0.5, 1.1),
    sigma_min: float = 1.1,
    max_offset: float = 0.6,
    max_iterations: int = 2,
    detections: tuple[pd.DataFrame, pd.DataFrame] | None = None,
) -> pd.DataFrame:
    """Detect blobs of many sizes, and compare the scales with the closed forms.

    Three experiments: ``operator``, every ratio in `kappas` at the finest sampling and the
    normalised Laplacian; ``sampling``, `kappa` at every sampling, discrete and refined;
    ``assumed_blur``, `kappa` at the finest sampling while the blur of the camera is taken for
    another one.

    Parameters
    ----------
    blobs : sequence of float
        Standard deviations of the blobs before the camera in pixels, > 0.
    kappa : float, default 2 ** (1 / 3)
        Ratio of the two blurs of the difference of Gaussians.
    kappas : sequence of float
        Ratios that are compared.
    n_spo : sequence of int, default (3, 15)
        Scales per octave; the sampling in space is balanced with each.
    camera_blur : float, default 0.8
        Blur of the camera in pixels.
    assumed_blurs : sequence of float
        Blurs for which the detector takes it; the right one is added.
    sigma_min : float, default 1.1
        First scale in pixels, or the largest of the blurs where that is more.
    max_offset, max_iterations
        Of the refinement; see `keystab.detect_keypoints`.
    detections : (pandas.DataFrame, pandas.DataFrame), optional
        What `detect_blobs` returns for the same blobs and ways; found anew when omitted.

    Returns
    -------
    pandas.DataFrame
        One row per experiment, blob and way to detect: ``experiment``; ``operator``, ``dog`` or
        ``laplacian``; ``kappa``, 1 for the Laplacian; ``n_spo``, 0 where nothing is sampled;
        ``detection``, ``discrete``, ``refined`` or ``series``, the maximum along the scale of the
        exact cosine series at the centre; ``blob``, ``camera_blur``, ``assumed_blur``,
        ``sigma_min``; ``theory`` and ``detected``, scales in pixels; ``error``, detected over
        theory less 1. ``theory`` is NaN where there is no extremum at any scale, ``detected`` where
        none was found.

    Raises
    ------
    InputError
        If a parameter is out of range.

    Examples
    --------
    >>> table = blob_table([3.0], kappas=[1.2], n_spo=[3], assumed_blurs=[])
    >>> table.loc[:2, ["operator", "detection", "theory", "detected"]].round(2)
        operator detection  theory  detected
    0        dog   refined    2.74      2.71
    1  laplacian    series    3.00      3.00
    2        dog  discrete    2.67      2.77
    """
    if detections is None:
        detections = detect_blobs(
            blobs, kappa, kappas, n_spo, camera_blur, assumed_blurs, sigma_min
        )
    found = {
        "discrete": detections[0],
        "refined": refined_keypoints(*detections, max_offset, max_iterations),
    }
    right = float(camera_blur)
    first = max(sigma_min, right, *assumed_blurs)
    rows = []
    for blob in map(float, blobs):
        image, centre = _image(blob, camera_blur)
        for way in _ways(kappa, kappas, n_spo, camera_blur, assumed_blurs):
            series = way.detection == "series"
            theory = float(
                laplacian_extremum_scale(blob, right)
                if series
                else dog_extremum_scale(blob, way.kappa, right, way.assumed_blur)
            )
            if series:
                scale = laplacian_scale(image, (centre, centre), camera_blur, blob)
            else:
                table = found[way.detection]
                own = (
                    (table["blob"] == blob)
                    & (table["kappa"] == way.kappa)
                    & (table["n_spo"] == way.n_spo)
                    & (table["assumed_blur"] == way.assumed_blur)
                )
                scale = _scale_of_blob(table[own], centre)
            rows.append(
                {
                    "experiment": way.experiment,
                    "operator": "laplacian" if series else "dog",
                    "kappa": float(way.kappa),
                    "n_spo": int(way.n_spo),
                    "detection": way.detection,
                    "blob": blob,
                    "camera_blur": right,
                    "assumed_blur": float(way.assumed_blur),
                    "sigma_min": float(first),
                    "theory": theory,
                    "detected": scale,
                }
            )
    table = pd.DataFrame(rows)
    table["error"] = table["detected"] / table["theory"] - 1
    return table


def _ways(
    kappa: float,
    kappas: Sequence[float],
    n_spo: Sequence[int],
    camera_blur: float,
    assumed_blurs: Sequence[float],
) -> list[_Way]:
    """Return all ways to find the scale of a blob; a detector takes part in several experiments."""
    finest, right = max(n_spo), float(camera_blur)
    ways = [_Way("operator", float(ratio), finest, "refined", right) for ratio in kappas]
    ways += [_Way("operator", 1.0, 0, "series", right)]
    ways += [
        _Way("sampling", float(kappa), n, detection, right)
        for n in n_spo
        for detection in ("discrete", "refined")
    ]
    return ways + [
        _Way("assumed_blur", float(kappa), finest, "refined", float(assumed))
        for assumed in sorted({right, *assumed_blurs})
    ]


def laplacian_scale(
    image: np.ndarray, at: tuple[float, float], camera_blur: float, near: float
) -> float:
    """Return the scale at which the normalised Laplacian of an image has its extremum at a point.

    The Laplacian is that of the cosine series of the image, blurred from the camera's blur to each
    scale: exact but for rounding, and sampled neither in space nor in scale.

    Parameters
    ----------
    image : ndarray, shape (height, width)
        The image.
    at : (float, float)
        Row and column of the point in pixels.
    camera_blur : float
        Blur of the image in pixels.
    near : float
        Scale near which the extremum is sought in pixels: from a third of it, or from the camera
        blur, to three times.

    Returns
    -------
    float
        Scale in pixels where the absolute value is greatest, found as the root of its derivative:
        as exact as the series, while the maximum itself is flat and would give away half of the
        digits to rounding. NaN where that is an end of the range.

    Examples
    --------
    >>> image = blob_image(2.0, 0.8, (41, 41), (20.0, 20.0))
    >>> round(laplacian_scale(image, (20.0, 20.0), camera_blur=0.8, near=1.5), 6)
    2.0
    """
    coefs = cosine_series.coefficients(image)
    low, high = math.log(max(_LOWER * near, camera_blur)), math.log(_UPPER * near)

    def sums(log_scale: float) -> tuple[float, float]:
        """Scale squared times the Laplacian, and to the fourth times the Laplacian's."""
        scale2 = math.exp(2 * log_scale)
        blur = math.sqrt(max(scale2 - camera_blur**2, 0.0))
        yy, xx, yyyy, yyxx, xxxx = (
            float(cosine_series.evaluate(coefs, [at[0]], [at[1]], blur, orders)[0, 0])
            for orders in ((2, 0), (0, 2), (4, 0), (2, 2), (0, 4))
        )
        return scale2 * (yy + xx), scale2**2 * (yyyy + 2 * yyxx + xxxx)

    def slope(log_scale: float) -> float:
        """Derivative by ln sigma; blur obeys d / d ln sigma = sigma^2 times the Laplacian."""
        once, twice = sums(log_scale)
        return 2 * once + twice

    grid = np.linspace(low, high, _PLACES)
    best = int(np.argmax([abs(sums(log_scale)[0]) for log_scale in grid]))
    if best in (0, _PLACES - 1):
        return math.nan
    return math.exp(root_between(slope, grid[best - 1], grid[best + 1]))


def _image(blob: float, camera_blur: float) -> tuple[np.ndarray, float]:
    """Return an image of a blob and the row and column of its centre."""
    half = math.ceil(_HALF_WIDTH * math.hypot(blob, camera_blur)) + 1
    return blob_image(blob, camera_blur, (2 * half + 1, 2 * half + 1), (half, half)), float(half)


def _octaves(scale: float, sigma_min: float, n_spo: int) -> int:
    """Return the number of octaves that hold a scale with one scale step to spare."""
    if math.isnan(scale):
        return 1
    return max(1, math.ceil(math.log2(scale / sigma_min) + 1 / n_spo))


def _scale_of_blob(found: pd.DataFrame, centre: float) -> float:
    """Return the scale of the deepest minimum within 1 px of the centre; NaN if there is none."""
    near = (found[["y", "x"]] - centre).abs().max(axis=1) <= 1.0
    own = found[near & (found["sign"] == -1)]
    if len(own) == 0:
        return math.nan
    return float(own["sigma"].to_numpy()[own["value"].to_numpy().argmin()])
