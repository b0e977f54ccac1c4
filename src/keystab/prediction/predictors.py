r"""What a single detection at a single sampling offers to tell whether it can be trusted.

The features of figure 5 are medians over all detections of a keypoint, which nobody has who detects
once. Here everything is computed from one detection: from its 27 samples, or from the series of the
view around it (`keystab.prediction.local_structure`). All but ``end`` are properties of the place,
not of the range of scales that a study compares; that one is a control.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from keystab.prediction.features import feature_table, hessians, normalised
from keystab.prediction.local_structure import (
    WINDOW,
    annulus,
    degeneracy,
    persistence,
    refined_places,
    saddle_distance,
)
from keystab.scalespace.continuous_dog import DogSeries


class Predictor(NamedTuple):
    """How a predictor is used.

    Attributes
    ----------
    direction : {1, -1}
        Which values are expected of what can be trusted, large or small; chosen before seeing any
        result.
    logarithmic : bool
        Whether models see its logarithm. Then a change of contrast adds the same number to all.
    """

    direction: int
    logarithmic: bool


PREDICTORS = {
    "dog": Predictor(1, True),
    "difference": Predictor(1, True),
    "laplacian": Predictor(1, True),
    "condition": Predictor(-1, True),
    "eigenvalue": Predictor(1, True),
    "edge": Predictor(1, False),
    "degeneracy": Predictor(1, False),
    "saddle": Predictor(1, False),
    "persistence": Predictor(1, False),
    "annulus": Predictor(1, False),
    "end": Predictor(1, False),
}
"""All predictors; the first four are those of figure 5."""

FIGURE_5 = ("dog", "difference", "laplacian", "condition")

MODELS = {
    "figure_5": FIGURE_5,
    "combined": tuple(name for name in PREDICTORS if name != "end"),
    "combined_end": tuple(PREDICTORS),
}
"""Combinations of predictors that are fitted. ``combined`` goes without ``end``, which is about the
range of scales that is compared and not about the keypoint."""

_FLOOR = 1e-12


def predictor_table(
    detections: pd.DataFrame, series: DogSeries, ends: tuple[float, float]
) -> pd.DataFrame:
    r"""All predictors of discrete extrema.

    Parameters
    ----------
    detections : DataFrame
        Discrete extrema as `keystab.detection.detector.extrema_table` makes them, with the columns
        ``n_spo`` and ``delta_min`` that say at which sampling each was found.
    series : DogSeries
        Scale-space of the view in which they were found.
    ends : (float, float)
        First and last scale that are compared, in pixels.

    Returns
    -------
    DataFrame
        With the index of `detections` and the columns of `PREDICTORS`:

        ``dog, difference, laplacian, condition``
            See `keystab.prediction.features.feature_table`.
        ``eigenvalue``
            Smallest absolute eigenvalue of the scale-normalised Hessian, from the same samples.
        ``edge``
            Ratio of the smaller to the larger principal curvature of the slice: 1 on round blobs, 0
            on straight edges, negative on saddles. Where it is positive, its inverse is what SIFT
            limits (its r).
        ``degeneracy, saddle, persistence, annulus``
            See `keystab.prediction.local_structure`.
        ``end``
            :math:`\min(\ln(\sigma / \sigma_{first}), \ln(\sigma_{last} / \sigma))` of the scale
            after one quadratic step; negative outside, and cut at a third of an octave either
            way, since the step knows no bounds.

    Raises
    ------
    keystab.errors.InputError
        If a column is missing.
    """
    n_spo, delta_min = (detections[name].to_numpy() for name in ("n_spo", "delta_min"))
    simple = feature_table(detections, n_spo, delta_min)
    grid = hessians(detections)
    sigma = detections["sigma"].to_numpy(dtype=float)
    own = normalised(grid, sigma, n_spo, delta_min)
    places, sign = refined_places(detections), detections["sign"].to_numpy(dtype=float)
    refined = detections["step_sigma"].to_numpy(dtype=float)
    first, last = ends
    return pd.DataFrame(
        {
            **{name: simple[name].to_numpy() for name in FIGURE_5},
            "eigenvalue": np.abs(np.linalg.eigvalsh(own)).min(axis=1, initial=np.inf),
            "edge": _edge(own[:, 1:, 1:]),
            "degeneracy": degeneracy(series, places, sign),
            "saddle": saddle_distance(series, places, sign),
            "persistence": persistence(series, places, sign),
            "annulus": annulus(series, places, sign),
            "end": np.clip(
                np.minimum(np.log(refined / first), np.log(last / refined)), -WINDOW, WINDOW
            ),
        },
        index=detections.index,
    )


def _edge(hessian: NDArray[np.float64]) -> NDArray[np.float64]:
    """Ratio of the principal curvatures smaller and larger in size, with its sign."""
    values = np.linalg.eigvalsh(hessian)
    order = np.argsort(np.abs(values), axis=1)
    small, large = np.take_along_axis(values, order, axis=1).T
    ratio: NDArray[np.float64] = np.divide(
        small, large, out=np.zeros(len(values)), where=large != 0
    )
    return ratio


def model_inputs(table: pd.DataFrame, groups: pd.DataFrame) -> pd.DataFrame:
    """What models see of the predictors: logarithms where that is said, centred.

    Parameters
    ----------
    table : DataFrame
        From `predictor_table`.
    groups : DataFrame
        One row per row of `table`; rows equal in all columns are detections of one picture at one
        sampling. Their median is subtracted. That needs no labels, so that anybody can do it with
        a picture of their own, and it takes away contrast and what depends on the sampling alone.

    Returns
    -------
    DataFrame
        Turned so that larger values are expected of what can be trusted.
    """
    seen = {}
    for name, (direction, logarithmic) in PREDICTORS.items():
        values = table[name].to_numpy(dtype=float)
        if logarithmic:
            values = np.log(np.clip(values, _FLOOR, 1 / _FLOOR))
        seen[name] = direction * values
    inputs = pd.DataFrame(seen, index=table.index)
    keys = [groups[name].to_numpy() for name in groups]
    return inputs - inputs.groupby(keys).transform("median")
