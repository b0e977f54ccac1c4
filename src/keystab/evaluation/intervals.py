"""Confidence intervals of shares (Wilson) and of anything else (bootstrap).

Random draws are seeded by what they are for, so that an interval does not depend on what was
computed before it.

A table of keypoints against sets (images, samplings) can be resampled over keypoints (what another
piece of the scene would give), over sets (what other views would give), or over both at once,
which is the widest. The unique set itself is held fixed.
"""

from __future__ import annotations

from collections.abc import Collection
from statistics import NormalDist
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from keystab.errors import InputError

if TYPE_CHECKING:
    import pandas as pd

Purpose = tuple[int | str, ...]

BOTH = ("keypoints", "sets")
"""What a table of keypoints (rows) against sets (columns) is resampled over."""


def wilson_interval(
    successes: ArrayLike, trials: ArrayLike, confidence: float = 0.95
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    r"""Wilson score interval of a share k / n.

    .. math:: \frac{k + z^2/2}{n + z^2} \pm \frac{z}{n + z^2} \sqrt{\frac{k (n - k)}{n}
              + \frac{z^2}{4}}

    with z the normal quantile of `confidence`. Unlike the interval of the textbook it stays within
    0 and 1 and does not collapse at k = 0 or k = n.

    Parameters
    ----------
    successes, trials : int or array
        k and n, with 0 <= k <= n.
    confidence : float
        Between 0 and 1.

    Returns
    -------
    low, high : ndarray
        NaN where there are no trials.

    Raises
    ------
    InputError
        If k is not between 0 and n, or `confidence` not between 0 and 1.

    Notes
    -----
    The trials are taken as independent. Extrema of one picture are only nearly so.

    Examples
    --------
    >>> low, high = wilson_interval(10, 100)
    >>> print(f"{low:.4f} {high:.4f}")
    0.0552 0.1744
    """
    _require_confidence(confidence)
    k, n = np.asarray(successes, dtype=float), np.asarray(trials, dtype=float)
    if not np.all((k >= 0) & (k <= n)):
        raise InputError(
            f"{np.min(k):g} to {np.max(k):g} successes in {np.min(n):g} trials, allowed are 0 up "
            "to the number of trials: check the counts"
        )
    z2 = NormalDist().inv_cdf((1 + confidence) / 2) ** 2
    some = np.where(n > 0, n, np.nan)
    centre = (k + z2 / 2) / (some + z2)
    half = np.sqrt(z2 * (k * (some - k) / some + z2 / 4)) / (some + z2)
    # Exact ends where rounding would leave 1e-17: k = 0 gives 0, k = n gives 1.
    low = np.where((k == 0) & (n > 0), 0.0, centre - half)
    high = np.where((k == n) & (n > 0), 1.0, centre + half)
    return low, high


def normal_half_width(values: NDArray[Any] | pd.Series) -> float:
    """Half the width of the 95 % interval of a mean: 1.96 standard errors.

    Parameters
    ----------
    values : ndarray or Series, shape (n,)
        One number per view. Of a Series, NaN does not count in the spread.

    Returns
    -------
    float
        NaN for a single value.

    Examples
    --------
    >>> round(normal_half_width(np.array([1.0, 3.0])), 2)
    1.96
    """
    return float(1.96 * values.std(ddof=1) / np.sqrt(len(values))) if len(values) > 1 else np.nan


def bootstrap_counts(n: int, n_resamples: int, *purpose: int | str) -> NDArray[np.int64]:
    """How often each of n items is drawn in samples of n with replacement.

    Parameters
    ----------
    n : int
        Items.
    n_resamples : int
        Samples.
    *purpose : int or str
        What the draw is for, see `keystab.utils.random.random_generator`.

    Returns
    -------
    ndarray of int, shape (n_resamples, n)
        Every row sums to n.

    Examples
    --------
    >>> bootstrap_counts(5, 3, "example").sum(axis=1)
    array([5, 5, 5])
    """
    from keystab.utils.random import random_generator

    drawn = random_generator("bootstrap", *purpose).integers(0, max(n, 1), size=(n_resamples, n))
    drawn += n * np.arange(n_resamples)[:, None]
    return np.bincount(drawn.ravel(), minlength=n_resamples * n).reshape(n_resamples, n)


def table_counts(
    shape: tuple[int, ...], n_resamples: int, resample: Collection[str], *purpose: int | str
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """How often every keypoint and every set counts in each resample of a table.

    Parameters
    ----------
    shape : tuple of int
        Keypoints and sets.
    n_resamples : int
        Resamples.
    resample : collection of {"keypoints", "sets"}
        What is drawn with replacement; the other counts once.
    *purpose : int or str
        What the draws are for.

    Returns
    -------
    keypoints, sets : ndarray of int, shapes (n_resamples, n_keypoints), (n_resamples, n_sets)

    Raises
    ------
    InputError
        If `resample` names something else.
    """
    unknown = sorted(set(resample) - set(BOTH))
    if unknown:
        raise InputError(
            f"resample has {unknown[0]!r}, allowed are 'keypoints' and 'sets': change it"
        )
    keypoints, sets = (
        bootstrap_counts(n, n_resamples, *purpose, name)
        if name in resample
        else np.ones((n_resamples, n), dtype=np.int64)
        for n, name in zip(shape, BOTH, strict=True)
    )
    return keypoints, sets


def percentile_interval(
    samples: NDArray[np.float64], confidence: float = 0.95
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Percentile interval along the first axis of bootstrap samples.

    Parameters
    ----------
    samples : ndarray, shape (n_resamples, ...)
        A statistic of each resample; NaN where it does not exist.
    confidence : float
        Between 0 and 1.

    Returns
    -------
    low, high : ndarray, shape (...)
        NaN where no sample exists.

    Raises
    ------
    InputError
        If `confidence` is not between 0 and 1.

    Notes
    -----
    A statistic at its bound (a share of 1, an area of 1) gives an interval of no width, which says
    that the resamples agree and not that the truth is known.
    """
    import warnings

    _require_confidence(confidence)
    tail = (1 - confidence) / 2
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "All-NaN slice", RuntimeWarning)
        low, high = np.nanquantile(samples, [tail, 1 - tail], axis=0)
    return low, high


def centred_interval(
    samples: NDArray[np.float64],
    estimate: NDArray[np.float64],
    confidence: float = 0.95,
    limits: tuple[float, float] = (-np.inf, np.inf),
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Percentile interval of bootstrap samples that are shifted onto the estimate.

    For statistics that a draw with replacement shifts, because it holds fewer different items than
    the data: the spread of the samples is used, and not where they lie.

    Parameters
    ----------
    samples, confidence
        See `percentile_interval`, also for what is returned and raised.
    estimate : ndarray, shape (...)
        The statistic of the data, onto which the mean of the samples is shifted.
    limits : tuple of float
        Smallest and largest value that the statistic can have.

    Examples
    --------
    >>> low, high = centred_interval(np.linspace(6, 8, 101), np.array(5.0))
    >>> print(f"{low:.2f} {high:.2f}")
    4.05 5.95
    """
    known = ~np.isnan(samples)
    total = np.where(known, samples, 0.0).sum(axis=0)
    mean = total / np.where(known.any(axis=0), known.sum(axis=0), np.nan)
    low, high = percentile_interval(samples, confidence)
    return np.clip(low - mean + estimate, *limits), np.clip(high - mean + estimate, *limits)


def _require_confidence(confidence: float) -> None:
    if not 0 < confidence < 1:
        raise InputError(f"confidence is {confidence}, allowed is between 0 and 1: change it")
