"""Detections against the true extrema: which are right, what is missing, and how far off they lie.

Stability asks whether detections agree with each other; here they are held against what is there.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from keystab.evaluation.intervals import normal_half_width, wilson_interval
from keystab.matching.correspondence import (
    SCALE_RATIO,
    SPACE_TOLERANCE,
    one_to_one,
    pairs_between,
)

DEGENERATE = 0.03
"""Conditioning (see `keystab.true_extrema`) below which a true extremum counts as nearly
degenerate: a small change of the image may merge it with a saddle."""

CAUSES = ("true", "degenerate", "edge", "twin", "nothing")
"""What a detection can be: a well-conditioned true extremum, a nearly degenerate one, one that lies
beyond the range of scales that is compared, a second detection of a true extremum, or no extremum
at all."""


def partners(
    detections: pd.DataFrame,
    truth: pd.DataFrame,
    space_tolerance: float = SPACE_TOLERANCE,
    scale_ratio: float = SCALE_RATIO,
) -> NDArray[np.intp]:
    """True extremum that each detection stands for, one to one.

    Parameters
    ----------
    detections, truth : DataFrame
        Columns ``y, x, sigma, sign``.
    space_tolerance, scale_ratio : float
        How far apart they may be, as in `keystab.matching.correspondence.same`; signs must agree.

    Returns
    -------
    ndarray of int, shape (n_detections,)
        Row positions in `truth`, -1 where there is none. The nearest pairs are formed first.

    Raises
    ------
    InputError
        As for `keystab.matching.correspondence.same`.

    Examples
    --------
    Two detections of one blob, and one of nothing:

    >>> truth = pd.DataFrame({"y": [5.0], "x": [5.0], "sigma": [1.5], "sign": [1]})
    >>> found = pd.DataFrame({"y": [5.3, 5.1, 9.0], "x": [5.0, 5.0, 5.0], "sigma": [1.5] * 3,
    ...                       "sign": [1] * 3})
    >>> partners(found, truth).tolist()
    [-1, 0, -1]
    """
    return partners_and_near(detections, truth, space_tolerance, scale_ratio)[0]


def partners_and_near(
    detections: pd.DataFrame,
    truth: pd.DataFrame,
    space_tolerance: float = SPACE_TOLERANCE,
    scale_ratio: float = SCALE_RATIO,
) -> tuple[NDArray[np.intp], NDArray[np.bool_]]:
    """`partners`, and whether each detection is near any true extremum, taken or not.

    Parameters
    ----------
    detections, truth, space_tolerance, scale_ratio
        See `partners`.

    Returns
    -------
    partner : ndarray of int, shape (n_detections,)
        See `partners`.
    near : ndarray of bool, shape (n_detections,)
        True with -1 for a partner where the extremum stands for a nearer detection.
    """
    a, b, distance = pairs_between(detections, truth, space_tolerance, scale_ratio, True)
    partner = np.full(len(detections), -1, dtype=np.intp)
    chosen = one_to_one(a, b, distance)
    partner[a[chosen]] = b[chosen]
    near = np.zeros(len(detections), dtype=bool)
    near[a] = True
    return partner, near


def recall_and_precision(
    detections: pd.DataFrame,
    truth: pd.DataFrame,
    counted: NDArray[np.bool_],
    wanted: NDArray[np.bool_],
    space_tolerance: float = SPACE_TOLERANCE,
    scale_ratio: float = SCALE_RATIO,
) -> dict[str, Any]:
    """Recall, precision and errors of detections.

    Parameters
    ----------
    detections, truth : DataFrame
        Columns ``y, x, sigma, sign``; both with what lies around the range that is compared, so
        that nothing at its ends is without a partner.
    counted : ndarray of bool, shape (n_detections,)
        Detections of the compared range, whose precision is asked for.
    wanted : ndarray of bool, shape (n_truth,)
        True extrema of the compared range, whose recall is asked for.
    space_tolerance, scale_ratio : float
        See `partners`.

    Returns
    -------
    dict
        ``n_true, n_found, recall, recall_low, recall_high``; ``n_detections, n_right, precision,
        precision_low, precision_high`` (Wilson intervals, 95 %); ``n_twin``, second detections of
        a true extremum, which are among the wrong ones; over the found ones the errors
        ``median_location, p90_location`` in pixels and ``median_scale, p90_scale``, of
        ``|log2(sigma / sigma_true)|`` in octaves, and their root mean squares ``rms_location,
        rms_scale``. NaN where there are none.
    """
    partner, near = partners_and_near(detections, truth, space_tolerance, scale_ratio)
    paired = np.flatnonzero(partner >= 0)
    found = np.zeros(len(truth), dtype=bool)
    found[partner[paired]] = True
    result = {
        **_share("true", "found", "recall", int((found & wanted).sum()), int(wanted.sum())),
        **_share(
            "detections", "right", "precision", int((counted & (partner >= 0)).sum()),
            int(counted.sum()),
        ),
    }  # fmt: skip
    result["n_twin"] = int((counted & near & (partner < 0)).sum())
    sure = paired[wanted[partner[paired]]]
    here, there = detections.iloc[sure], truth.iloc[partner[sure]]
    away = {
        "location": np.hypot(
            here["y"].to_numpy() - there["y"].to_numpy(),
            here["x"].to_numpy() - there["x"].to_numpy(),
        ),
        "scale": np.abs(np.log2(here["sigma"].to_numpy() / there["sigma"].to_numpy())),
    }
    for quantity, values in away.items():
        for name, share in (("median", 0.5), ("p90", 0.9)):
            result[f"{name}_{quantity}"] = (
                float(np.quantile(values, share)) if len(values) else np.nan
            )
    for quantity, values in away.items():
        root = float(np.sqrt(np.mean(values**2))) if len(values) else np.nan
        result[f"rms_{quantity}"] = root
    return result


def _share(all_of: str, some: str, name: str, n_some: int, n_all: int) -> dict[str, Any]:
    low, high = wilson_interval(n_some, n_all)
    return {
        f"n_{all_of}": n_all,
        f"n_{some}": n_some,
        name: n_some / n_all if n_all else np.nan,
        f"{name}_low": float(low),
        f"{name}_high": float(high),
    }


def mean_over_views(
    detections: pd.DataFrame,
    truth: pd.DataFrame,
    n_views: int,
    limits: Sequence[float],
    scale_column: str = "sigma",
    tolerances: Mapping[str, float] | None = None,
) -> dict[str, Any]:
    """Recall, precision and errors of the detections in the views of a set, on average.

    Parameters
    ----------
    detections : DataFrame
        Columns ``view, y, x, sigma, sign`` and `scale_column`, in the frame of `truth`.
    truth : DataFrame
        Columns ``y, x, sigma, sign``: what all views should see.
    n_views : int
        Views of the set, whether or not anything is detected in them.
    limits : (float, float)
        Scales that are compared, in pixels.
    scale_column : str
        Scale of the detections that decides.
    tolerances : mapping, optional
        ``space_tolerance, scale_ratio`` of `partners`.

    Returns
    -------
    dict
        ``n_views``; means over the views of `recall_and_precision`'s numbers, with the intervals of
        recall and precision from the spread of the views (mean and 1.96 standard errors), and
        those of the root mean square distance, ``low_rms, high_rms``.
    """
    low, high = limits
    wanted = truth["sigma"].between(low, high).to_numpy()
    rows = []
    for view in range(n_views):
        here = detections[detections["view"] == view].reset_index(drop=True)
        counted = here[scale_column].between(low, high).to_numpy()
        rows.append(recall_and_precision(here, truth, counted, wanted, **(tolerances or {})))
    each = pd.DataFrame(rows)
    result: dict[str, Any] = {"n_views": n_views}
    result |= {str(name): float(value) for name, value in each.mean().items()}
    for name in ("recall", "precision"):
        error = normal_half_width(each[name])
        result |= {f"{name}_low": result[name] - error, f"{name}_high": result[name] + error}
    error = normal_half_width(each["rms_location"])
    result |= {
        "low_rms": result["rms_location"] - error,
        "high_rms": result["rms_location"] + error,
    }
    return result


def causes(
    detections: pd.DataFrame,
    truth: pd.DataFrame,
    low: float,
    high: float,
    space_tolerance: float = SPACE_TOLERANCE,
    scale_ratio: float = SCALE_RATIO,
) -> NDArray[np.str_]:
    """Say of each detection which of `CAUSES` it is.

    Parameters
    ----------
    detections : DataFrame
        Columns ``y, x, sigma, sign``.
    truth : DataFrame
        The same and ``conditioning``, also beyond the range of scales.
    low, high : float
        Scales that are compared, in pixels: true extrema outside are at the edge of the range, and
        some samplings see them and others do not.
    space_tolerance, scale_ratio : float
        See `partners`.

    Examples
    --------
    >>> truth = pd.DataFrame({"y": [5.0, 9.0], "x": [5.0, 5.0], "sigma": [1.5, 1.2], "sign": [1, 1],
    ...                       "conditioning": [0.5, 0.5]})
    >>> found = pd.DataFrame({"y": [5.1, 5.3, 9.0, 2.0], "x": [5.0] * 4, "sign": [1] * 4,
    ...                       "sigma": [1.5, 1.5, 1.4, 2.0]})
    >>> causes(found, truth, 1.386, 2.2).tolist()
    ['true', 'twin', 'edge', 'nothing']
    """
    partner, near = partners_and_near(detections, truth, space_tolerance, scale_ratio)
    cause = np.where(near, "twin", "nothing").astype("<U10")
    paired = partner >= 0
    own = truth.iloc[partner[paired]]
    weak = own["conditioning"].to_numpy() < DEGENERATE
    outside = (own["sigma"].to_numpy() < low) | (own["sigma"].to_numpy() > high)
    cause[paired] = np.where(outside, "edge", np.where(weak, "degenerate", "true"))
    return cause


def with_positions(detections: pd.DataFrame) -> pd.DataFrame:
    """Detections that are somewhere: models without a stationary point are nowhere."""
    place = detections[["y", "x", "sigma"]].to_numpy(dtype=float)
    is_somewhere = np.isfinite(place).all(axis=1) & (place[:, 2] > 0)
    kept: pd.DataFrame = detections[is_somewhere].reset_index(drop=True)
    return kept
