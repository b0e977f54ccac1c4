"""Stability of unique keypoints: shares, curves, rates of change (sections 5.2 and 5.5).

Occurrence matrices have one row per unique keypoint and one column per set (image or sampling),
see `keystab.matching.unique_keypoints.occurrence`.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from keystab.errors import InputError
from keystab.evaluation.intervals import (
    BOTH,
    Purpose,
    centred_interval,
    table_counts,
    wilson_interval,
)
from keystab.matching.common_range import compared
from keystab.matching.correspondence import SCALE_RATIO, SPACE_TOLERANCE, matched
from keystab.matching.unique_keypoints import gather, set_codes, set_names

STABLE = 0.8
"""A keypoint is stable if detected in more than this share of the sets."""

UNSTABLE = 0.2
"""A keypoint is unstable if detected in less than this share of the sets."""


def stability(occurrence: pd.DataFrame) -> pd.Series:
    """Stability of every unique keypoint: share of the sets in which it is detected (section 5.2).

    Parameters
    ----------
    occurrence : DataFrame of bool
        One row per keypoint, one column per set.

    Returns
    -------
    Series
        Between 0 and 1, with the index of `occurrence`.

    Examples
    --------
    >>> stability(pd.DataFrame([[True, True], [False, True]])).tolist()
    [1.0, 0.5]
    """
    return occurrence.mean(axis=1).rename("stability")


def label(
    stability: ArrayLike, stable: float = STABLE, unstable: float = UNSTABLE
) -> NDArray[np.str_]:
    """Name each keypoint ``"stable"``, ``"unstable"`` or ``"between"`` (section 5.3).

    Parameters
    ----------
    stability : array
        Share of the sets in which each keypoint is detected.
    stable, unstable : float
        Stable is above `stable`, unstable below `unstable`; neither includes the limit.

    Returns
    -------
    ndarray of str

    Raises
    ------
    InputError
        Unless 0 <= unstable <= stable <= 1.

    Examples
    --------
    >>> label([1.0, 0.8, 0.2, 0.1]).tolist()
    ['stable', 'between', 'between', 'unstable']
    """
    if not 0 <= unstable <= stable <= 1:
        raise InputError(
            f"unstable is {unstable} and stable is {stable}, allowed is 0 <= unstable <= stable "
            "<= 1: change them"
        )
    share = np.asarray(stability, dtype=float)
    return np.select([share > stable, share < unstable], ["stable", "unstable"], "between")


def stability_curve(
    occurrence: pd.DataFrame | NDArray[np.bool_],
    percentages: ArrayLike | None = None,
    n_resamples: int = 0,
    purpose: Purpose = (),
    resample: Collection[str] = BOTH,
    confidence: float = 0.95,
) -> pd.DataFrame:
    """Percentage of unique keypoints seen in at least p % of the images (figures 7 to 12).

    Parameters
    ----------
    occurrence : DataFrame or ndarray of bool, shape (n_unique, n_sets)
        Occurrence matrix.
    percentages : array, optional
        The values of p, 0 to 100. By default one per number of images, 100 k / n_sets for
        k = 1 .. n_sets, which is where the curve steps.
    n_resamples : int
        Resamples of the bootstrap; 0 for no interval.
    purpose : tuple of int and str
        What the interval is for; it seeds the draws.
    resample : collection of {"keypoints", "sets"}
        What is drawn with replacement.
    confidence : float
        Of the interval.

    Returns
    -------
    DataFrame
        ``percentage_of_images`` (p), ``n_unique`` (keypoints seen in at least p % of the images),
        ``percentage_of_unique``, ``low``, ``high`` (of the percentage; NaN without resamples).
        Percentages refer to the keypoints seen at least once.

    Raises
    ------
    InputError
        If a percentage is not between 0 and 100, or `resample` names something else.

    Notes
    -----
    A resample of the sets holds some of them twice and about 37 % not at all: keypoints seen only
    in the missing ones drop out, and the others are seen in all the sooner. The samples therefore
    lie above the data; they are shifted back, see `keystab.evaluation.intervals.centred_interval`.

    Examples
    --------
    >>> seen = np.array([[1, 1, 1, 1], [1, 1, 0, 0], [0, 0, 1, 0]], dtype=bool)
    >>> stability_curve(seen, [25, 50, 100])["n_unique"].tolist()
    [3, 2, 1]
    """
    seen = np.asarray(occurrence, dtype=np.int64)
    n_sets = seen.shape[1]
    if percentages is None:
        percentages = 100 * np.arange(1, n_sets + 1) / n_sets
    level = np.atleast_1d(np.asarray(percentages, dtype=float))
    if not np.all((level >= 0) & (level <= 100)):
        raise InputError("a percentage of images lies outside 0 to 100: give values in that range")
    # Rounding must not turn "at least 30 % of 10 images" into 4.
    needed = np.maximum(1, np.ceil(level / 100 * n_sets - 1e-9)).astype(int)
    ones = np.ones((1, 1), dtype=np.int64)
    everything = _seen_at_least(seen, ones.repeat(len(seen), 1), ones.repeat(n_sets, 1))[0]
    curve = pd.DataFrame(
        {
            "percentage_of_images": level,
            "n_unique": everything[needed],
            "percentage_of_unique": _percentage(everything, needed),
            "low": np.nan,
            "high": np.nan,
        }
    )
    if n_resamples:
        counts = table_counts(seen.shape, n_resamples, resample, "curve", *purpose)
        samples = _percentage(_seen_at_least(seen, *counts), needed)
        estimate = curve["percentage_of_unique"].to_numpy()
        interval = centred_interval(samples, estimate, confidence, limits=(0.0, 100.0))
        curve["low"], curve["high"] = interval
    return curve


def new_and_lost(
    detections: pd.DataFrame,
    space_tolerance: float = SPACE_TOLERANCE,
    scale_ratio: float = SCALE_RATIO,
    match_sign: bool = False,
    set_column: str = "set",
    sets: Sequence[Any] | None = None,
) -> pd.DataFrame:
    """Rates of new and of lost detections from each set to the next (section 5.2, figure 4b).

    A detection is new if the previous set holds no same one, lost if the next set holds none. Both
    rates refer to the number of detections of the set that the detection belongs to.

    Parameters
    ----------
    detections : DataFrame
        Detections of all sets; those beyond the range that is compared are counterparts only
        (`keystab.matching.common_range.compared`).
    space_tolerance, scale_ratio, match_sign
        See `keystab.matching.correspondence.same`.
    set_column : str
        Column that names the set of a detection.
    sets : sequence, optional
        Sets in their order, from coarse to fine; sorted values of `set_column` by default.

    Returns
    -------
    DataFrame
        One row per set: `set_column`, ``n_detections``, ``n_new``, ``new_rate``, ``new_low``,
        ``new_high``, ``n_lost``, ``lost_rate``, ``lost_low``, ``lost_high``. Rates and their 95 %
        Wilson intervals are shares; the first set has nothing new and the last nothing lost
        (missing values).

    Raises
    ------
    InputError
        As for `keystab.matching.unique_keypoints.matches`.
    """
    names = set_names(detections, set_column, sets)
    codes = set_codes(detections, set_column, names)
    tables = [detections[codes == i] for i in range(len(names))]
    asked = [table[compared(table)] for table in tables]
    total = np.array([len(table) for table in asked])
    counts = {"new": np.full(len(names), np.nan), "lost": np.full(len(names), np.nan)}
    for i in range(1, len(names)):
        pair = (space_tolerance, scale_ratio, match_sign)
        counts["new"][i] = np.sum(~matched(asked[i], tables[i - 1], *pair))
        counts["lost"][i - 1] = np.sum(~matched(asked[i - 1], tables[i], *pair))
    result: dict[str, Any] = {set_column: names, "n_detections": total}
    for name, count in counts.items():
        known = ~np.isnan(count)
        low, high = wilson_interval(np.where(known, count, 0), np.where(known, total, 0))
        result[f"n_{name}"] = pd.array(count, dtype="Int64")
        result[f"{name}_rate"] = np.divide(
            count, total, out=np.full(len(names), np.nan), where=total > 0
        )
        result[f"{name}_low"], result[f"{name}_high"] = low, high
    return pd.DataFrame(result)


def keypoint_features(features: pd.DataFrame, found: NDArray[np.intp]) -> pd.DataFrame:
    """Median of each feature over the detections of each unique keypoint (figure 5).

    Parameters
    ----------
    features : DataFrame
        One row per detection, numbers only; see `keystab.prediction.features.feature_table`.
    found : ndarray of int, shape (n_unique, n_sets)
        Row positions from `keystab.matching.unique_keypoints.matches`.

    Returns
    -------
    DataFrame
        One row per unique keypoint, the columns of `features`.
    """
    return pd.DataFrame(
        {name: pd.DataFrame(gather(features[name], found)).median(axis=1) for name in features}
    )


def _seen_at_least(
    seen: NDArray[np.int64], keypoints: NDArray[np.int64], sets: NDArray[np.int64]
) -> NDArray[np.int64]:
    """Keypoints seen in at least k = 0 .. n_sets sets, shape (n_resamples, n_sets + 1)."""
    n_resamples, n_sets = sets.shape
    number = sets @ seen.T
    number += (n_sets + 1) * np.arange(n_resamples)[:, None]
    exactly = np.bincount(number.ravel(), keypoints.ravel(), n_resamples * (n_sets + 1))
    at_least = exactly.reshape(n_resamples, -1)[:, ::-1].cumsum(axis=1)[:, ::-1]
    return at_least.astype(np.int64)


def _percentage(at_least: NDArray[np.int64], needed: NDArray[np.int64]) -> NDArray[np.float64]:
    """Share in per cent of the keypoints seen at least once; NaN if there are none."""
    some = at_least[..., 1:2]
    return 100 * at_least[..., needed] / np.where(some > 0, some, np.nan)
