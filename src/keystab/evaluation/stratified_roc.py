r"""ROC curves of detections at several samplings, compared only within each sampling.

Unstable keypoints are more frequent at coarse samplings, and many features depend a little on the
sampling. Thrown together, detections of all samplings could be told apart by where they come from,
which helps nobody who has one. So every sampling s has its own curve, and what is reported is the
mean over the samplings, weighted by their number :math:`m_s` of bad detections,

.. math:: A = \sum_s m_s A_s / \sum_s m_s ,

the area under the mean of the curves.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from keystab.evaluation.intervals import bootstrap_counts, percentile_interval
from keystab.evaluation.roc import weighted_areas

Stratum = tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.int64], NDArray[np.int64]]
"""Scores of good and of bad detections, and how often each counts in every resample."""

KEPT = 0.95
"""Share of the good detections that a user wants to keep."""


@dataclass(frozen=True)
class Detections:
    """Good and bad detections of one picture, and how often each counts in every resample.

    Attributes
    ----------
    good : ndarray of bool, shape (n,)
        The label.
    stratum : ndarray, shape (n,)
        Sampling of each.
    weight : ndarray of int, shape (n_resamples, n)
        First all ones: the data. The others draw whole blocks with replacement.
    """

    good: NDArray[np.bool_]
    stratum: NDArray[np.generic]
    weight: NDArray[np.int64]

    @classmethod
    def in_blocks(
        cls,
        good: NDArray[np.bool_],
        stratum: NDArray[np.generic],
        block: NDArray[np.intp],
        n_resamples: int,
        *purpose: int | str,
    ) -> Detections:
        """Detections with bootstrap resamples of their blocks, seeded by their purpose."""
        n_blocks = int(block.max(initial=-1)) + 1
        drawn = bootstrap_counts(n_blocks, n_resamples, "predictors", *purpose)
        return cls(good, stratum, np.vstack([np.ones(len(good), dtype=np.int64), drawn[:, block]]))

    def strata(self, score: NDArray[np.float64]) -> Iterator[Stratum]:
        """Scores and weights of good and of bad ones, ascending, for each stratum."""
        for one in np.unique(self.stratum):
            here = np.flatnonzero(self.stratum == one)
            here = here[np.argsort(score[here], kind="stable")]
            good, bad = here[self.good[here]], here[~self.good[here]]
            yield score[good], score[bad], self.weight[:, good], self.weight[:, bad]


def areas(score: NDArray[np.float64], among: Detections) -> NDArray[np.float64]:
    """Area under the mean ROC curve, of the data and of every resample.

    Parameters
    ----------
    score : ndarray, shape (n,)
        Larger for what is expected to be good.
    among : Detections
        What is scored.

    Returns
    -------
    ndarray, shape (1 + n_resamples,)
        NaN where no sampling holds both kinds.

    Examples
    --------
    Perfect at each sampling, though not with one limit for both:

    >>> once = np.ones((1, 4), dtype=int)
    >>> among = Detections(np.array([True, False] * 2), np.array([3, 3, 5, 5]), once)
    >>> areas(np.array([2.0, 1.0, 12.0, 11.0]), among)
    array([1.])
    """
    return _mean_over_strata(
        (weighted_areas(*stratum), stratum[3].sum(axis=1)) for stratum in among.strata(score)
    )


def rejected(
    score: NDArray[np.float64], among: Detections, kept: float = KEPT
) -> NDArray[np.float64]:
    """Share of the bad detections that a limit removes which keeps a share of the good ones.

    Parameters
    ----------
    score, among
        See `areas`.
    kept : float
        At least this share of the good detections of each sampling is kept; 0 keeps none.

    Returns
    -------
    ndarray, shape (1 + n_resamples,)

    Examples
    --------
    >>> among = Detections(np.array([True, True, False, False]), np.zeros(4), np.ones((1, 4), int))
    >>> score = np.array([3.0, 1.0, 2.0, 0.0])
    >>> rejected(score, among, 1.0), rejected(score, among, 0.5)
    (array([0.5]), array([1.]))
    """
    return _mean_over_strata(
        (_rejected(*stratum, kept), stratum[3].sum(axis=1)) for stratum in among.strata(score)
    )


def mean_curve(score: NDArray[np.float64], among: Detections, kept: ArrayLike) -> pd.DataFrame:
    """Mean ROC curve of the data: ``kept``, share of the good, and ``rejected``, of the bad."""
    data = Detections(among.good, among.stratum, among.weight[:1])
    shares = np.asarray(kept, dtype=float)
    removed = [float(rejected(score, data, share)[0]) for share in shares]
    return pd.DataFrame({"kept": shares, "rejected": removed})


def with_interval(samples: NDArray[np.float64], name: str) -> dict[str, float]:
    """A statistic of the data and its 95 % interval over the resamples."""
    low, high = percentile_interval(samples[1:])
    return {name: float(samples[0]), f"{name}_low": float(low), f"{name}_high": float(high)}


def _rejected(
    good: NDArray[np.float64],
    bad: NDArray[np.float64],
    good_weight: NDArray[np.int64],
    bad_weight: NDArray[np.int64],
    kept: float,
) -> NDArray[np.float64]:
    if not len(good) or not len(bad):
        return np.full(len(good_weight), np.nan)
    running = np.cumsum(good_weight, axis=1)
    total = running[:, -1:]
    # The limit is the first good score below which no more than 1 - kept of the good ones lie.
    enough = running > (1 - kept) * total + 1e-9
    limit = np.argmax(enough, axis=1)
    below = np.zeros((len(bad_weight), len(bad) + 1), dtype=np.int64)
    np.cumsum(bad_weight, axis=1, out=below[:, 1:])
    places = np.where(enough.any(axis=1), np.searchsorted(bad, good, "left")[limit], len(bad))
    removed = below[np.arange(len(below)), places]
    exists = (total[:, 0] > 0) & (below[:, -1] > 0)
    shares: NDArray[np.float64] = np.full(len(below), np.nan)
    np.divide(removed, below[:, -1], out=shares, where=exists)
    return shares


def _mean_over_strata(
    parts: Iterator[tuple[NDArray[np.float64], NDArray[np.int64]]],
) -> NDArray[np.float64]:
    """Mean of values, weighted; those that do not exist have no weight."""
    values, weights = (np.array(each, dtype=float) for each in zip(*parts, strict=True))
    weights = np.where(np.isnan(values), 0.0, weights)
    total = weights.sum(axis=0)
    summed = (np.nan_to_num(values) * weights).sum(axis=0)
    means: NDArray[np.float64] = np.full(total.shape, np.nan)
    np.divide(summed, total, out=means, where=total > 0)
    return means
