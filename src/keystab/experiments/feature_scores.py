"""How well features of extrema tell stable from unstable keypoints, as tables (section 5.3)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from keystab.evaluation.roc import areas_above, auc_table, roc, threshold_curve
from keystab.evaluation.stability import keypoint_features, label
from keystab.prediction.features import DIRECTIONS, feature_table


class Scores(NamedTuple):
    """Tables of figure 5."""

    features: pd.DataFrame
    thresholds: pd.DataFrame
    roc: pd.DataFrame
    auc: pd.DataFrame


def score_features(
    keypoints: pd.DataFrame,
    extrema: pd.DataFrame,
    found: NDArray[np.intp],
    stable_above: float,
    unstable_below: float,
    n_resamples: int,
) -> Scores:
    """Score each feature by how well it tells stable from unstable keypoints (figure 5).

    Parameters
    ----------
    keypoints : DataFrame
        ``keypoint, stability``.
    extrema : DataFrame
        Discrete extrema of all samplings.
    found : ndarray of int, shape (n_keypoints, n_samplings)
        Row positions in `extrema`, -1 where there is none.
    stable_above, unstable_below : float
        Limits of stability.
    n_resamples : int
        Bootstrap resamples behind the intervals.

    Returns
    -------
    Scores
        A keypoint's feature is the median over its detections. Areas also say by how much they are
        ``above_dog``, that of the value of the difference of Gaussians, with ``low_above,
        high_above``.
    """
    values = feature_table(extrema, extrema["n_spo"], extrema["delta_min"])
    features = keypoint_features(values, found)
    names = label(keypoints["stability"], stable_above, unstable_below)
    thresholds, curves = [], []
    for feature, direction in DIRECTIONS.items():
        stable, unstable = (features.loc[names == each, feature] for each in ("stable", "unstable"))
        thresholds.append(threshold_curve(stable, unstable).assign(feature=feature))
        curves.append(roc(stable, unstable, direction).assign(feature=feature))
    described = keypoints[["keypoint", "stability"]].assign(label=names)
    return Scores(
        pd.concat([described, features], axis=1),
        _feature_first(thresholds),
        _feature_first(curves),
        auc_table(features, names, DIRECTIONS, ("figure 5",), n_resamples).join(
            areas_above(features, names, DIRECTIONS, "dog", ("figure 5",), n_resamples).rename(
                columns={"above": "above_dog"}
            )
        ),
    )


def _feature_first(tables: list[pd.DataFrame]) -> pd.DataFrame:
    table = pd.concat(tables, ignore_index=True)
    return table[["feature", *table.columns.drop("feature")]]
