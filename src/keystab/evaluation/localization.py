"""Precision: how far the detections of one keypoint spread over the images (section 5.5).

All locations are in one common frame, so that a perfect detector has no spread at all.
"""

from __future__ import annotations

import math
from collections.abc import Collection

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from keystab.errors import InputError
from keystab.evaluation.intervals import BOTH, Purpose, percentile_interval, table_counts
from keystab.evaluation.location_errors import quantile
from keystab.matching.unique_keypoints import gather


def localization(
    detections: pd.DataFrame, found: NDArray[np.intp], minimum_share: float = 0.5
) -> pd.DataFrame:
    r"""Spread of each keypoint over the sets in which it is detected (section 5.5).

    With m detections :math:`(y_i, x_i, \sigma_i)` in the common frame, the standard deviation of
    the location is

    .. math:: s = \sqrt{\frac1{m-1} \sum_{i=1}^m
              \bigl[(y_i - \bar y)^2 + (x_i - \bar x)^2\bigr]} = \sqrt{s_y^2 + s_x^2}

    and that of the scale is taken of :math:`\log_2 \sigma_i`, in octaves.

    Parameters
    ----------
    detections : DataFrame
        Columns ``y``, ``x``, ``sigma`` in the common frame.
    found : ndarray of int, shape (n_unique, n_sets)
        Row positions from `keystab.matching.unique_keypoints.matches`.
    minimum_share : float
        Only keypoints detected in at least this share of the sets (and twice) are kept.

    Returns
    -------
    DataFrame
        One row per kept keypoint, indexed by its row position in the unique set: ``n_sets`` (m),
        means ``y``, ``x`` and ``sigma`` (geometric), ``sd_y``, ``sd_x``, ``sd_location`` in
        pixels, ``sd_log2_sigma`` in octaves.

    Notes
    -----
    Detections farther apart than the tolerance never match, so s cannot exceed about the
    tolerance; a larger spread shows as lower stability instead.
    """
    enough = _enough(found.shape[1], minimum_share)
    rows = np.flatnonzero((found >= 0).sum(axis=1) >= enough)
    y, x, octave = _locations(detections, found[rows])
    spread = {"y": y, "x": x, "log2_sigma": octave}
    sd = {name: pd.DataFrame(v).std(axis=1, ddof=1).to_numpy() for name, v in spread.items()}
    return pd.DataFrame(
        {
            "n_sets": (found[rows] >= 0).sum(axis=1),
            "y": pd.DataFrame(y).mean(axis=1).to_numpy(),
            "x": pd.DataFrame(x).mean(axis=1).to_numpy(),
            "sigma": 2 ** pd.DataFrame(octave).mean(axis=1).to_numpy(),
            "sd_y": sd["y"],
            "sd_x": sd["x"],
            "sd_location": np.hypot(sd["y"], sd["x"]),
            "sd_log2_sigma": sd["log2_sigma"],
        },
        index=pd.Index(rows, name="keypoint"),
    )


def mean_localization(
    detections: pd.DataFrame,
    found: NDArray[np.intp],
    minimum_share: float = 0.5,
    n_resamples: int = 0,
    purpose: Purpose = (),
    resample: Collection[str] = BOTH,
    confidence: float = 0.95,
) -> pd.DataFrame:
    """Mean of `localization` over keypoints seen in at least half of the images (figures 7c, 8b).

    Parameters
    ----------
    detections, found, minimum_share
        See `localization`.
    n_resamples, purpose, resample, confidence
        See `stability_curve`.

    Returns
    -------
    DataFrame
        Rows ``location`` (pixels) and ``log2_sigma`` (octaves); columns ``n_keypoints``, ``mean``,
        ``median``, ``low``, ``high`` (of the mean; NaN without resamples), ``low_median``,
        ``high_median`` (of the median over keypoints, from order statistics).

    Notes
    -----
    Sets drawn with replacement repeat, so that the variance of a resample of a keypoint seen m
    times is on average (m - 1) / m of the variance that it came from; this is undone.
    """
    table = localization(detections, found, minimum_share)
    columns = table[["sd_location", "sd_log2_sigma"]]
    low, high = np.full(2, np.nan), np.full(2, np.nan)
    if n_resamples and len(table):
        keypoints, sets = table_counts(found.shape, n_resamples, resample, "precision", *purpose)
        often = (found >= 0) @ sets.T >= _enough(found.shape[1], minimum_share)
        weight = np.where(often, keypoints.T, 0)
        number = weight.sum(axis=0)
        seen = (found >= 0).sum(axis=1, keepdims=True)
        repeats = np.where(seen > 1, seen / np.maximum(seen - 1, 1), 1) if "sets" in resample else 1
        y, x, octave = (repeats * _variances(v, sets) for v in _locations(detections, found))
        for i, deviation in enumerate((np.sqrt(y + x), np.sqrt(octave))):
            total = (weight * np.where(often, deviation, 0.0)).sum(axis=0)
            means = np.divide(total, number, out=np.full(n_resamples, np.nan), where=number > 0)
            low[i], high[i] = percentile_interval(means, confidence)
    return pd.DataFrame(
        {
            "n_keypoints": len(table),
            "mean": columns.mean().to_numpy(),
            "median": columns.median().to_numpy(),
            "low": low,
            "high": high,
            "low_median": [quantile(columns[name], confidence=confidence).low for name in columns],
            "high_median": [
                quantile(columns[name], confidence=confidence).high for name in columns
            ],
        },
        index=pd.Index(["location", "log2_sigma"], name="quantity"),
    )


def _enough(n_sets: int, minimum_share: float) -> int:
    """Return the detections that a spread needs: the asked share of the sets, and two."""
    if not 0 <= minimum_share <= 1:
        raise InputError(f"minimum_share is {minimum_share}, allowed is 0 to 1: change it")
    return max(2, math.ceil(minimum_share * n_sets - 1e-9))


def _locations(
    detections: pd.DataFrame, found: NDArray[np.intp]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """y, x and log2 sigma of the matched detections, NaN where there is none."""
    octave = np.log2(detections["sigma"].to_numpy(dtype=float))
    return gather(detections["y"], found), gather(detections["x"], found), gather(octave, found)


def _variances(values: NDArray[np.float64], sets: NDArray[np.int64]) -> NDArray[np.float64]:
    """Variance of each row where set j counts `sets[b, j]` times, shape (n_rows, n_resamples).

    NaN with fewer than two values.
    """
    present = ~np.isnan(values)
    # Sums of squares lose digits far from zero, so the row's mean is taken out first.
    centre = np.where(present, values, 0).sum(axis=1) / np.maximum(present.sum(axis=1), 1)
    deviation = np.where(present, values - centre[:, None], 0.0)
    m = (present @ sets.T).astype(float)
    m[m < 2] = np.nan
    variance = (deviation**2 @ sets.T - (deviation @ sets.T) ** 2 / m) / (m - 1)
    bounded: NDArray[np.float64] = np.maximum(variance, 0.0)
    return bounded
