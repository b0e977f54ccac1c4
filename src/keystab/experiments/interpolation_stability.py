"""How stable the interpolation of extrema is, against the sampling of the scale-space (figure 3).

The caption of figure 3 says that unbalanced samplings, whose Hessians are badly conditioned, make
the interpolation unstable. Two things can be asked of translated views: how many extrema the
refinement accepts, and how far the refined positions of one keypoint spread over the views.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from keystab.detection.refinement import refined_keypoints
from keystab.evaluation.intervals import wilson_interval
from keystab.evaluation.localization import localization
from keystab.experiments.view_stability import Labels, keypoints_of_views, labelled
from keystab.matching.common_range import CommonRange
from keystab.prediction.features import condition_numbers, hessians


def interpolation_table(
    extrema: pd.DataFrame,
    traces: pd.DataFrame,
    everywhere: CommonRange,
    limits: Mapping[str, float],
    same: Mapping[str, Any],
    labels: Labels,
) -> pd.DataFrame:
    """One row of numbers on the interpolations of a set of views at one sampling.

    Parameters
    ----------
    extrema, traces : DataFrame
        Discrete extrema of all views and their refinement traces.
    everywhere : CommonRange
        Field of view and range of scales; the scale after one unbounded quadratic step decides.
    limits : mapping
        ``max_offset`` and ``max_iterations``.
    same : mapping
        Options of `keystab.matching.correspondence.same`.
    labels : mapping
        Columns to put before the others.

    Returns
    -------
    DataFrame
        `labels`; ``n_extrema`` of all views in the range; median ``condition`` number of their
        Hessians in grid steps; of the extrema the share ``share_accepted`` whose refinement is
        accepted, with its 95 % Wilson interval ``low_accepted, high_accepted``; ``n_keypoints``
        refined ones that are seen in at least half of the views, and over them the median spread of
        location ``spread`` in pixels and of scale ``spread_scale`` in octaves
        (`keystab.evaluation.localization.localization`), each with a 95 % interval
        ``low_spread, high_spread, low_scale, high_scale`` by ranks.

    Notes
    -----
    Extrema of one structure in several views are not independent, which the Wilson interval takes
    them for: it is too narrow where views agree.
    """
    inside = everywhere.common(extrema.assign(keypoint=np.arange(len(extrema))), "step_sigma")
    condition = pd.Series(condition_numbers(hessians(inside)))
    found = refined_keypoints(extrema.assign(keypoint=np.arange(len(extrema))), traces, **limits)
    n_accepted = int(inside["keypoint"].isin(found["keypoint"]).sum())
    low, high = wilson_interval(n_accepted, len(inside))
    matched = keypoints_of_views(everywhere.common(found), len(everywhere.specs), same)
    spread = localization(matched.common, matched.found)
    location = rank_interval(spread["sd_location"].to_numpy())
    scale = rank_interval(spread["sd_log2_sigma"].to_numpy())
    row = {
        "n_extrema": len(inside),
        "condition": float(condition.median()) if len(condition) else np.nan,
        "n_accepted": n_accepted,
        "share_accepted": n_accepted / len(inside) if len(inside) else np.nan,
        "low_accepted": float(low),
        "high_accepted": float(high),
        "n_keypoints": len(spread),
        **dict(zip(("spread", "low_spread", "high_spread"), location, strict=True)),
        **dict(zip(("spread_scale", "low_scale", "high_scale"), scale, strict=True)),
    }
    return labelled(pd.DataFrame([row]), labels)


def rank_interval(values: NDArray[np.float64], share: float = 0.5) -> tuple[float, float, float]:
    """Quantile, and its 95 % interval from the ranks that a binomial distribution gives.

    Parameters
    ----------
    values : ndarray, shape (n,)
        Independent draws from any continuous distribution.
    share : float
        Which quantile; by default the median.

    Returns
    -------
    quantile, low, high : float
        NaN without values; the ends are the extremes of the values where there are too few.

    Examples
    --------
    >>> [round(end, 6) for end in rank_interval(np.arange(1.0, 101.0))]
    [50.5, 40.0, 61.0]
    """
    from scipy.stats import binom

    n = len(values)
    if not n:
        return np.nan, np.nan, np.nan
    ordered = np.sort(values)
    # The value of rank k lies below the quantile unless fewer than k draws do, and so on above.
    low = max(int(binom.ppf(0.025, n, share)) - 1, 0)
    high = min(int(binom.ppf(0.975, n, share)), n - 1)
    return float(np.quantile(ordered, share)), float(ordered[low]), float(ordered[high])
