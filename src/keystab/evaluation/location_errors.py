r"""Where detections lie beside what they stand for: bias, spread, and what these depend on.

All functions take positions in pixels, detection minus truth, and know no detector. A detector may
be wrong by the same amount everywhere (a bias), by an amount that depends on where between two
pixels a keypoint lies (its sub-pixel phase), or on where in the picture (a drift). The mean of the
errors sees only the first.
"""

from __future__ import annotations

import math
from statistics import NormalDist
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from keystab.errors import InputError
from keystab.evaluation.intervals import wilson_interval

__all__ = [
    "Estimate",
    "Phases",
    "coverage",
    "drift",
    "phase_pattern",
    "phase_regression",
    "quantile",
    "share",
    "spread",
    "strongest_phase",
]

FEWEST = 6
"""Values that an interval of a median needs: of fewer, even all hold it in less than 95 %."""

FEWEST_SAME = 30
"""Different extrema that an interval of a drift needs."""

_MAD = 1.482602218505602  # of a normal distribution, standard deviation over median deviation


class Estimate(NamedTuple):
    """A number and the ends of its interval; NaN where it does not exist."""

    value: float
    low: float = math.nan
    high: float = math.nan

    def named(self, name: str) -> dict[str, float]:
        """The three as columns ``name, name_low, name_high``."""
        return {name: self.value, f"{name}_low": self.low, f"{name}_high": self.high}


NOTHING = Estimate(math.nan)
"""What is not known."""


def quantile(values: ArrayLike, at: float = 0.5, confidence: float = 0.95) -> Estimate:
    r"""Quantile of some values, with an interval from their order alone.

    Parameters
    ----------
    values : array_like, shape (n,)
        Finite numbers.
    at : float
        Which quantile, between 0 and 1; the median by default.
    confidence : float
        Between 0 and 1.

    Returns
    -------
    Estimate
        The interval runs from one of the sorted values to another, whose ranks are
        :math:`n q \pm z \sqrt{n q (1 - q)}`, rounded outwards. NaN ends with fewer than `FEWEST`
        values, or where a rank lies beyond the last value.

    Notes
    -----
    No distribution is assumed, but that values are independent: keypoints seen in several views
    are only nearly so.

    Examples
    --------
    >>> quantile(range(101))
    Estimate(value=50.0, low=39.0, high=60.0)
    """
    if not 0 < at < 1 or not 0 < confidence < 1:
        raise InputError(f"quantile {at} at confidence {confidence}; give numbers between 0 and 1")
    ordered = np.sort(np.asarray(values, dtype=np.float64))
    n = len(ordered)
    if n == 0:
        return NOTHING
    half = NormalDist().inv_cdf((1 + confidence) / 2) * math.sqrt(n * at * (1 - at))
    first, last = math.floor(n * at - half), math.ceil(n * at + half)
    known = n >= FEWEST
    return Estimate(
        float(np.quantile(ordered, at)),
        float(ordered[first - 1]) if known and first >= 1 else math.nan,
        float(ordered[last - 1]) if known and last <= n else math.nan,
    )


def spread(values: ArrayLike, confidence: float = 0.95) -> Estimate:
    """Standard deviation of a normal distribution with the median deviation of some values.

    Parameters
    ----------
    values, confidence
        See `quantile`.

    Returns
    -------
    Estimate
        1.4826 times the median absolute deviation from the median, which few outliers do not move.
        The interval takes the median of the values for known.

    Examples
    --------
    >>> print(f"{spread(np.random.default_rng(0).normal(5.0, 2.0, 10000)).value:.1f}")
    2.0
    """
    numbers = np.asarray(values, dtype=np.float64)
    if not len(numbers):
        return NOTHING
    found = quantile(np.abs(numbers - np.median(numbers)), 0.5, confidence)
    return Estimate(*(_MAD * each for each in found))


def share(some: int, of_all: int) -> Estimate:
    """Share of some among all, with its Wilson interval; NaN of none.

    Examples
    --------
    >>> print("{:.2f} {:.4f} {:.4f}".format(*share(10, 100)))
    0.10 0.0552 0.1744
    """
    if of_all == 0:
        return NOTHING
    low, high = wilson_interval(some, of_all)
    return Estimate(some / of_all, float(low), float(high))


class Phases(NamedTuple):
    """How errors follow the sub-pixel phase; see `phase_regression`.

    Attributes
    ----------
    step : float
        Distance of the samples that phases are counted from, pixels.
    matrix : ndarray, shape (2, 2)
        Rows: error in y, in x; columns: phase in y, in x.
    half_width : ndarray, shape (2, 2)
        Half of the 95 % interval of each.
    explained : float
        Share of the variance of the errors that follows the phase.
    n : int
        Detections.
    """

    step: float
    matrix: NDArray[np.float64]
    half_width: NDArray[np.float64]
    explained: float
    n: int


def phase_regression(errors: ArrayLike, positions: ArrayLike, step: float = 1.0) -> Phases:
    r"""Regress errors on the sub-pixel phase of the true position.

    With :math:`\phi = p - \delta\,\mathrm{round}(p / \delta)` for samples at multiples of
    :math:`\delta`, least squares gives M and b in :math:`e = M \phi + b`. A sound detector has
    M = 0. One that finds the sample and not the place between samples has M = -1. One that gives y
    the offset of x, and x that of y, has :math:`\begin{pmatrix}-1 & 1\\1 & -1\end{pmatrix}`; its
    mean error is 0.

    Parameters
    ----------
    errors : array_like, shape (n, 2)
        Detected minus true position in y and x, pixels.
    positions : array_like, shape (n, 2)
        True positions in y and x, pixels.
    step : float
        Distance of the samples in pixels, > 0. Detectors double it with each octave.

    Returns
    -------
    Phases
        NaN with fewer than `FEWEST` detections, or where all have the same phase.

    Examples
    --------
    >>> p = np.random.default_rng(0).uniform(0, 50, (200, 2))
    >>> offset = p - np.round(p)
    >>> phase_regression(offset[:, ::-1] - offset, p).matrix.round(6).tolist()
    [[-1.0, 1.0], [1.0, -1.0]]
    """
    e, p = (np.asarray(values, dtype=np.float64).reshape(-1, 2) for values in (errors, positions))
    phase = p - step * np.round(p / step)
    unknown = Phases(step, np.full((2, 2), math.nan), np.full((2, 2), math.nan), math.nan, len(e))
    if len(e) < FEWEST:
        return unknown
    a, b = phase - phase.mean(axis=0), e - e.mean(axis=0)
    gram = a.T @ a
    if np.linalg.det(gram) < 1e-9 * (len(e) * step**2) ** 2:
        return unknown
    inverse = np.linalg.inv(gram)
    matrix = (inverse @ (a.T @ b)).T
    left = b - a @ matrix.T
    variance = (left**2).sum(axis=0) / (len(e) - 3)
    deviation = np.sqrt(variance[:, None] * np.diag(inverse)[None, :])
    total = float((b**2).sum())
    explained = 1 - float((left**2).sum()) / total if total > 0 else 0.0
    return Phases(step, matrix, 1.96 * deviation, explained, len(e))


def strongest_phase(
    errors: ArrayLike, positions: ArrayLike, steps: tuple[float, ...] = (0.5, 1.0, 2.0, 4.0)
) -> Phases:
    """`phase_regression` at that distance of samples which explains most of the errors.

    Examples
    --------
    >>> p = np.random.default_rng(0).uniform(0, 50, (200, 2))
    >>> found = strongest_phase(2 * np.round(p / 2) - p, p)
    >>> found.step, found.matrix.round(6).tolist()
    (2.0, [[-1.0, 0.0], [0.0, -1.0]])
    """
    found = [phase_regression(errors, positions, step) for step in steps]
    return max(found, key=lambda each: -1.0 if math.isnan(each.explained) else each.explained)


def phase_pattern(phases: Phases, tolerance: float = 0.25) -> str:
    """What a dependence on the phase looks like.

    Parameters
    ----------
    phases : Phases
    tolerance : float
        How far each of the four numbers may be from those of a pattern.

    Returns
    -------
    {"none", "swapped offsets", "no offsets", "some", ""}
        The patterns of `phase_regression`; "some" for a dependence that is none of them: a number
        farther from 0 than `tolerance` and than twice its interval. Empty where nothing is known.

    Examples
    --------
    >>> p = np.random.default_rng(0).uniform(0, 50, (200, 2))
    >>> [phase_pattern(phase_regression(error, p)) for error in (np.round(p) - p, 0 * p)]
    ['no offsets', 'none']
    """
    m = phases.matrix
    if np.isnan(m).any():
        return ""
    patterns = {"swapped offsets": ((-1, 1), (1, -1)), "no offsets": ((-1, 0), (0, -1))}
    for name, pattern in patterns.items():
        if (np.abs(m - np.array(pattern)) <= tolerance).all():
            return name
    return "some" if (np.abs(m) > np.maximum(tolerance, 2 * phases.half_width)).any() else "none"


def drift(
    errors: ArrayLike,
    positions: ArrayLike,
    extent: tuple[float, float],
    same: ArrayLike | None = None,
    near: float = math.inf,
) -> list[Estimate]:
    r"""By how much the error in y changes from the top to the bottom, and in x from left to right.

    Parameters
    ----------
    errors, positions
        See `phase_regression`.
    extent : (float, float)
        Height and width of the picture in pixels.
    same : array_like of int, shape (n,), optional
        Which extremum each row is a detection of. One that is seen in several views has nearly the
        same error in all of them, and counts once. All are different where it is not given.
    near : float
        Rows whose error is farther than this from the median in y or x are left out, pixels: many
        of them are false matches, and few of these at the border pull a line.

    Returns
    -------
    list of Estimate
        For y and for x, pixels, from least squares, with 95 % intervals. A wrong zoom of 1 % over
        100 pixels is a drift of 1. NaN ends with fewer than `FEWEST_SAME` different extrema.

    Notes
    -----
    With :math:`p` the position less its mean, and :math:`r` what the line leaves, the variance of
    the slope is :math:`\sum_k (\sum_{i \in k} p_i r_i)^2 / (\sum_i p_i^2)^2` over the extrema k,
    which does not ask that errors are as large everywhere (cluster-robust); times
    :math:`K / (K - 1) \cdot (n - 1) / (n - 2)`, with the t-distribution of K - 1.

    Examples
    --------
    >>> p = np.random.default_rng(0).uniform(0, 100, (50, 2))
    >>> [round(each.value, 6) for each in drift(0.01 * p * [1, 0], p, (100, 100))]
    [1.0, 0.0]
    """
    from scipy.special import stdtrit

    e, p = (np.asarray(values, dtype=np.float64).reshape(-1, 2) for values in (errors, positions))
    labels = np.arange(len(e)) if same is None else np.asarray(same)
    if len(e):
        kept = (np.abs(e - np.median(e, axis=0)) <= near).all(axis=1)
        e, p, labels = e[kept], p[kept], labels[kept]
    clusters, labels = np.unique(labels, return_inverse=True)
    k, n = len(clusters), len(e)
    found = []
    for axis in range(2):
        at = p[:, axis] - p[:, axis].mean() if len(p) else p[:, axis]
        power = float(at @ at)
        if len(e) < FEWEST or power == 0:
            found.append(NOTHING)
            continue
        error = e[:, axis] - e[:, axis].mean()
        slope = float(at @ error) / power
        half = math.nan
        if k >= FEWEST_SAME:
            sums = np.bincount(labels, weights=at * (error - slope * at), minlength=k)
            variance = float(sums @ sums) / power**2 * k / (k - 1) * (n - 1) / (n - 2)
            half = float(stdtrit(k - 1, 0.975)) * math.sqrt(variance)
        found.append(
            Estimate(*(extent[axis] * each for each in (slope, slope - half, slope + half)))
        )
    return found


def coverage(
    errors: ArrayLike,
    std_y: ArrayLike,
    std_x: ArrayLike,
    cov_yx: ArrayLike = 0.0,
    level: float = 0.9,
) -> Estimate:
    r"""Share of true positions within the ellipses that error bars promise.

    Parameters
    ----------
    errors : array_like, shape (n, 2)
        Detected minus true position in y and x, pixels.
    std_y, std_x : array_like, shape (n,)
        Standard deviations that the detector reports, pixels, > 0.
    cov_yx : array_like, shape (n,)
        Covariances, pixels squared.
    level : float
        Share that the ellipses should hold.

    Returns
    -------
    Estimate
        Share with :math:`e^T C^{-1} e \le -2 \ln(1 - p)`, with its Wilson interval. What has no
        finite, positive definite covariance holds nothing.

    Examples
    --------
    >>> e = np.random.default_rng(0).normal(size=(2000, 2))
    >>> bool(abs(coverage(e, np.ones(2000), np.ones(2000)).value - 0.9) < 0.02)
    True
    """
    e = np.asarray(errors, dtype=np.float64).reshape(-1, 2)
    sy, sx, c = (
        np.broadcast_to(np.asarray(v, dtype=np.float64), len(e)) for v in (std_y, std_x, cov_yx)
    )
    determinant = sy**2 * sx**2 - c**2
    with np.errstate(divide="ignore", invalid="ignore"):
        distance = sx**2 * e[:, 0] ** 2 - 2 * c * e[:, 0] * e[:, 1] + sy**2 * e[:, 1] ** 2
        held = (determinant > 0) & (distance / determinant <= -2 * math.log(1 - level))
    return share(int(held.sum()), len(e))
