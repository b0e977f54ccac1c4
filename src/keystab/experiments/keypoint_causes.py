"""What stable and unstable keypoints are, and what predicts it (figure truth)."""

from __future__ import annotations

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from keystab.evaluation.intervals import wilson_interval
from keystab.evaluation.recall_precision import CAUSES
from keystab.evaluation.roc import auc_table
from keystab.prediction.features import DIRECTIONS


def cause_table(group: NDArray[np.str_], cause: NDArray[np.str_]) -> pd.DataFrame:
    """Count the causes within each group of keypoints.

    Parameters
    ----------
    group : ndarray of str
        ``stable``, ``between`` or ``unstable``, from `keystab.evaluation.stability.label`.
    cause : ndarray of str
        Of the same keypoints, from `keystab.evaluation.recall_precision.causes`.

    Returns
    -------
    DataFrame
        ``group, cause, n, n_group, share``, and the Wilson interval of the share, ``low, high``;
        NaN where a group is empty.

    Examples
    --------
    >>> table = cause_table(np.array(["stable", "stable"]), np.array(["right", "nothing"]))
    >>> table.loc[table["group"] == "stable", "n"].sum()
    np.int64(1)
    """
    rows = []
    for name in ("stable", "between", "unstable"):
        total = int((group == name).sum())
        for one in CAUSES:
            count = int(((group == name) & (cause == one)).sum())
            lower, upper = wilson_interval(count, total)
            rows.append(
                {
                    "group": name,
                    "cause": one,
                    "n": count,
                    "n_group": total,
                    "share": count / total if total else np.nan,
                    "low": float(lower),
                    "high": float(upper),
                }
            )
    return pd.DataFrame(rows)


def areas_of_labels(
    features: pd.DataFrame, group: NDArray[np.str_], cause: NDArray[np.str_], n_resamples: int
) -> pd.DataFrame:
    """Areas under ROC curves of the same features, once asked for stability and once for truth.

    Parameters
    ----------
    features : DataFrame
        One row per keypoint, from `keystab.prediction.features.feature_table`.
    group, cause : ndarray of str
        See `cause_table`. A keypoint is good where it is stable; or where it is a true extremum,
        and not a second detection of one.
    n_resamples : int
        Bootstrap resamples of the intervals.

    Returns
    -------
    DataFrame
        Rows of `keystab.evaluation.roc.auc_table` for each ``label``.
    """
    right = np.where(np.isin(cause, ("nothing", "twin")), "unstable", "stable")
    each = [
        auc_table(features, names, DIRECTIONS, ("truth", what), n_resamples).assign(label=what)
        for what, names in (("stability", group), ("truth", right))
    ]
    areas = pd.concat(each, ignore_index=True)
    return areas.rename(columns={"n_stable": "n_good", "n_unstable": "n_bad"})
