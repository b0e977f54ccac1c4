"""What a refinement does to discrete extrema that are right, and to those that are not."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from keystab.detection.refinement import refined_table
from keystab.evaluation.recall_precision import judged, partners, with_positions

if TYPE_CHECKING:
    from keystab.scalespace.sampling import Sampling


def kept_and_lost(
    extrema: pd.DataFrame,
    models: pd.DataFrame,
    sampling: Sampling,
    truth: pd.DataFrame,
    inside: Callable[[pd.DataFrame, str], NDArray[np.bool_]],
    max_offset: float,
    max_iterations: int,
    tolerances: Mapping[str, float] | None = None,
) -> dict[str, Any]:
    """What a refinement does to discrete extrema that are right, and to those that are not.

    Parameters
    ----------
    extrema : DataFrame
        Discrete extrema with ``y, x, sigma, sign, step_sigma``.
    models : DataFrame
        Their traces, from `keystab.detection.refinement.trace`.
    sampling : Sampling
        Where they were found.
    truth : DataFrame
        True extrema.
    inside : callable
        Says which rows of a table, by the scale in one of its columns, are compared.
    max_offset, max_iterations
        M_offset and N_interp.
    tolerances : mapping, optional
        ``space_tolerance, scale_ratio`` of `partners`.

    Returns
    -------
    dict
        ``kept_true``, ``lost_true``: discrete extrema with a true partner that are
        accepted or not; ``kept_false, lost_false``: those without; ``moved_wrong``: of the kept
        true ones, those whose refined place has no true partner any more; ``n_true``, recall and
        precision of the refined ones as `judged` has them, and their ``median_location``.
    """
    options = dict(tolerances or {})
    counted = inside(extrema, "step_sigma")
    right = partners(extrema, truth, **options) >= 0
    refined = refined_table(sampling, extrema, models, max_offset, max_iterations)
    kept = np.zeros(len(extrema), dtype=bool)
    kept[refined["keypoint"]] = True
    refined = with_positions(refined)
    judgement = judged(refined, truth, inside(refined, "sigma"), inside(truth, "sigma"), **options)
    wrong = refined["keypoint"].to_numpy()[partners(refined, truth, **options) < 0]
    astray = np.zeros(len(extrema), dtype=bool)
    astray[wrong] = True
    names = ("n_true", "recall", "precision", "median_location")
    return {
        "kept_true": int((counted & right & kept).sum()),
        "lost_true": int((counted & right & ~kept).sum()),
        "kept_false": int((counted & ~right & kept).sum()),
        "lost_false": int((counted & ~right & ~kept).sum()),
        "moved_wrong": int((counted & right & kept & astray).sum()),
        **{name: judgement[name] for name in names},
    }
