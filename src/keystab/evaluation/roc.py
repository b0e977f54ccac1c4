"""How well a feature separates stable from unstable keypoints (section 5.3, figure 5).

The convention is the paper's: a filter keeps the keypoints on the good side of a threshold.
Sensitivity is the share of stable keypoints that are kept, specificity the share of unstable ones
that are removed; the curve is sensitivity against specificity, and that of a perfect feature is
always equal to 1. The direction of a feature is given, never fitted: an area below 1/2 is possible
and says that the feature points the wrong way.

Where one of the two groups is empty there is nothing to separate: areas are NaN, curves empty.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from keystab.errors import InputError
from keystab.evaluation.intervals import Purpose, bootstrap_counts, percentile_interval


def roc(stable: ArrayLike, unstable: ArrayLike, direction: int = 1) -> pd.DataFrame:
    """ROC curve: sensitivity against specificity as the threshold gets stricter (figure 5e).

    Parameters
    ----------
    stable, unstable : array
        The feature of the stable and of the unstable keypoints.
    direction : {1, -1}
        1: keypoints with a feature at or above the threshold are kept. -1: at or below.

    Returns
    -------
    DataFrame
        ``threshold``, ``specificity`` (ascending from 0 to 1), ``sensitivity`` (descending from 1
        to 0); one row per distinct value and a last row that keeps nothing. The trapezium rule on
        it gives `area_under_curve`.

    Raises
    ------
    InputError
        If a feature is NaN or `direction` is neither 1 nor -1.

    Examples
    --------
    >>> roc([3.0, 4.0], [1.0, 3.0])
       threshold  specificity  sensitivity
    0        1.0          0.0          1.0
    1        3.0          0.5          1.0
    2        4.0          1.0          0.5
    3        inf          1.0          0.0
    """
    good, bad = _sorted_groups(stable, unstable, direction)
    if not len(good) or not len(bad):
        return pd.DataFrame({"threshold": [], "specificity": [], "sensitivity": []}, dtype=float)
    threshold = np.unique(np.concatenate([good, bad]))
    return pd.DataFrame(
        {
            "threshold": np.append(threshold, np.inf) * direction,
            "specificity": np.append(np.searchsorted(bad, threshold) / len(bad), 1.0),
            "sensitivity": np.append(1 - np.searchsorted(good, threshold) / len(good), 0.0),
        }
    )


def area_under_curve(stable: ArrayLike, unstable: ArrayLike, direction: int = 1) -> float:
    r"""Area under the ROC curve, by ranks (Mann and Whitney).

    .. math:: A = P(f_{stable} > f_{unstable}) + \tfrac12 P(f_{stable} = f_{unstable})

    for a stable and an unstable keypoint drawn at random (with ``<`` where `direction` is -1).

    Parameters
    ----------
    stable, unstable, direction
        See `roc`.

    Returns
    -------
    float
        1 perfect, 0.5 useless, NaN if a group is empty.

    Raises
    ------
    InputError
        As for `roc`.

    Examples
    --------
    >>> area_under_curve([3.0, 4.0], [1.0, 3.0])
    0.875
    """
    good, bad = _sorted_groups(stable, unstable, direction)
    one = np.ones((1, 1), dtype=np.int64)
    return float(
        weighted_areas(good, bad, one.repeat(len(good), axis=1), one.repeat(len(bad), axis=1))[0]
    )


def auc_interval(
    stable: ArrayLike,
    unstable: ArrayLike,
    direction: int = 1,
    purpose: Purpose = (),
    n_resamples: int = 2000,
    confidence: float = 0.95,
) -> tuple[float, float]:
    """Bootstrap interval of the area under the ROC curve.

    Stable and unstable keypoints are drawn with replacement, each group by itself.

    Parameters
    ----------
    stable, unstable, direction
        See `roc`.
    purpose : tuple of int and str
        What the interval is for; it seeds the draws.
    n_resamples : int
        Resamples.
    confidence : float
        Between 0 and 1.

    Returns
    -------
    low, high : float
        Percentile interval, NaN if a group is empty.

    Raises
    ------
    InputError
        As for `roc`.

    Notes
    -----
    Which keypoints count as stable is held fixed. The order of the keypoints does not matter.
    """
    good, bad = _sorted_groups(stable, unstable, direction)
    if not len(good) or not len(bad):
        return float("nan"), float("nan")
    areas = weighted_areas(
        good,
        bad,
        bootstrap_counts(len(good), n_resamples, "auc", "stable", *purpose),
        bootstrap_counts(len(bad), n_resamples, "auc", "unstable", *purpose),
    )
    low, high = percentile_interval(areas, confidence)
    return float(low), float(high)


def areas_above(
    features: pd.DataFrame,
    label: ArrayLike,
    directions: Mapping[str, int],
    reference: str,
    purpose: Purpose = (),
    n_resamples: int = 2000,
) -> pd.DataFrame:
    """By how much areas under ROC curves exceed that of one feature, on the same keypoints.

    Parameters
    ----------
    features, label, directions, purpose, n_resamples
        See `auc_table`.
    reference : str
        The feature that others are compared with.

    Returns
    -------
    DataFrame
        One row per feature: ``above``, the difference of the areas, and the ends ``low_above,
        high_above`` of its 95 % interval, with the same keypoints drawn for both.

    Examples
    --------
    >>> features = pd.DataFrame({"a": [1.0, 2.0, 3.0, 4.0], "b": [4.0, 3.0, 2.0, 1.0]})
    >>> names = ["unstable", "unstable", "stable", "stable"]
    >>> areas_above(features, names, {"a": 1, "b": 1}, "a", n_resamples=9)["above"].tolist()
    [0.0, -1.0]
    """
    label = np.asarray(label)
    groups = [np.flatnonzero(label == name) for name in ("stable", "unstable")]
    counts = [
        np.vstack(
            [np.ones((1, len(group)), np.int64),
             bootstrap_counts(len(group), n_resamples, "areas above", name, *purpose)]
        )
        for name, group in zip(("stable", "unstable"), groups, strict=True)
    ]  # fmt: skip
    areas = {}
    for name, direction in directions.items():
        values = direction * features[name].to_numpy(dtype=float)
        orders = [np.argsort(values[group], kind="stable") for group in groups]
        (good, bad) = (values[group][order] for group, order in zip(groups, orders, strict=True))
        weights = (each[:, order] for each, order in zip(counts, orders, strict=True))
        areas[name] = weighted_areas(good, bad, *weights)
    above = np.stack([area - areas[reference] for area in areas.values()], axis=1)
    low, high = percentile_interval(above[1:])
    return pd.DataFrame({"above": above[0], "low_above": low, "high_above": high})


def auc_table(
    features: pd.DataFrame,
    label: ArrayLike,
    directions: Mapping[str, int],
    purpose: Purpose = (),
    n_resamples: int = 2000,
) -> pd.DataFrame:
    """Area under the ROC curve of several features, with 95 % intervals.

    Parameters
    ----------
    features : DataFrame
        One row per keypoint, one column per feature (at least those in `directions`).
    label : array of str
        ``"stable"``, ``"unstable"`` or anything else, one per keypoint; see
        `keystab.evaluation.stability.label`.
    directions : mapping of str to int
        Direction of each feature, chosen beforehand; see `keystab.prediction.features.DIRECTIONS`.
    purpose : tuple of int and str
        What the intervals are for.
    n_resamples : int
        Resamples of the bootstrap.

    Returns
    -------
    DataFrame
        ``feature``, ``auc``, ``low``, ``high``, ``n_stable``, ``n_unstable``, ``direction``.

    Raises
    ------
    InputError
        As for `roc`.
    """
    label = np.asarray(label)
    rows = []
    for name, direction in directions.items():
        values = features[name].to_numpy(dtype=float)
        good, bad = values[label == "stable"], values[label == "unstable"]
        low, high = auc_interval(good, bad, direction, (*purpose, name), n_resamples)
        rows.append(
            {
                "feature": name,
                "auc": area_under_curve(good, bad, direction),
                "low": low,
                "high": high,
                "n_stable": len(good),
                "n_unstable": len(bad),
                "direction": direction,
            }
        )
    return pd.DataFrame(rows)


def threshold_curve(
    stable: ArrayLike, unstable: ArrayLike, thresholds: ArrayLike | None = None
) -> pd.DataFrame:
    """Share of stable and of unstable keypoints with a feature below a threshold (figure 5a-d).

    Parameters
    ----------
    stable, unstable : array
        The feature of the stable and of the unstable keypoints.
    thresholds : array, optional
        All distinct finite values by default.

    Returns
    -------
    DataFrame
        ``threshold`` (ascending), ``stable_below``, ``unstable_below`` (shares strictly below the
        threshold, 0 to 1; NaN for an empty group).

    Raises
    ------
    InputError
        If a feature is NaN.

    Examples
    --------
    >>> threshold_curve([3.0, 4.0], [1.0, 3.0], thresholds=[3.0, 5.0])
       threshold  stable_below  unstable_below
    0        3.0           0.0             0.5
    1        5.0           1.0             1.0
    """
    groups = _sorted_groups(stable, unstable, 1)
    if thresholds is None:
        values = np.unique(np.concatenate(groups))
        thresholds = values[np.isfinite(values)]
    threshold = np.sort(np.asarray(thresholds, dtype=float))
    below = [
        np.searchsorted(group, threshold) / (len(group) if len(group) else np.nan)
        for group in groups
    ]
    return pd.DataFrame(
        {"threshold": threshold, "stable_below": below[0], "unstable_below": below[1]}
    )


def _sorted_groups(
    stable: ArrayLike, unstable: ArrayLike, direction: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Both groups ascending, turned so that larger means more stable."""
    if direction not in (1, -1):
        raise InputError(f"direction is {direction!r}, allowed are 1 and -1: change it")
    good, bad = (np.sort(direction * np.asarray(g, dtype=float)) for g in (stable, unstable))
    for name, group in (("stable", good), ("unstable", bad)):
        if np.isnan(group).any():
            raise InputError(
                f"{int(np.isnan(group).sum())} of {len(group)} {name} keypoints have no feature "
                "(NaN), allowed are numbers: leave those keypoints out"
            )
    return good, bad


def weighted_areas(
    good: NDArray[np.float64],
    bad: NDArray[np.float64],
    good_counts: NDArray[np.int64],
    bad_counts: NDArray[np.int64],
) -> NDArray[np.float64]:
    """Areas for many weightings of the sorted groups at once.

    Parameters
    ----------
    good, bad : ndarray
        Both groups, ascending, turned so that larger values are expected of the good ones.
    good_counts, bad_counts : ndarray of int, shapes (n, len(good)), (n, len(bad))
        How often each counts, in every weighting.

    Returns
    -------
    ndarray, shape (n,)
        NaN where a group is empty or counts for nothing.

    Notes
    -----
    With C the running sum of the weights of `bad`, a member of `good` beats C(first place where
    it could be inserted) of them and ties with C(last) - C(first). All sums are whole numbers and
    hence exact.

    Examples
    --------
    >>> good, bad, one = np.array([3.0, 4.0]), np.array([3.5]), np.array([[1], [1]])
    >>> weighted_areas(good, bad, np.array([[1, 1], [0, 2]]), one)
    array([0.5, 1. ])
    """
    if not len(good) or not len(bad):
        return np.full(len(good_counts), np.nan)
    running = np.zeros((len(bad_counts), len(bad) + 1), dtype=np.int64)
    np.cumsum(bad_counts, axis=1, out=running[:, 1:])
    beaten = running[:, np.searchsorted(bad, good, "left")]
    beaten = beaten + running[:, np.searchsorted(bad, good, "right")]
    total = good_counts.sum(axis=1) * bad_counts.sum(axis=1)
    won = (good_counts * beaten).sum(axis=1)
    areas: NDArray[np.float64] = np.divide(
        won, 2 * total, out=np.full(len(total), np.nan), where=total > 0
    )
    return areas
