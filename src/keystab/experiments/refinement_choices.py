"""What a refinement does to discrete extrema that are right, and to those that are not."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from keystab.detection.refinement import MOST_MODELS, refined_table, trace
from keystab.evaluation.recall_precision import partners, recall_and_precision, with_positions

if TYPE_CHECKING:
    from keystab.scalespace.dog import ScaleSpace
    from keystab.scalespace.sampling import Sampling


def choice_table(
    space: ScaleSpace,
    extrema: pd.DataFrame,
    truth: pd.DataFrame,
    inside: Callable[[pd.DataFrame, str], NDArray[np.bool_]],
    max_offsets: Sequence[float],
    most_iterations: int,
    tolerances: Mapping[str, float] | None = None,
) -> pd.DataFrame:
    """What every way to refine, and every limit of it, keeps and loses (figure refinement).

    Ways differ in how a step goes, ``nearest`` or ``unit_step``, and in whether it may change the
    scale; limits are M_offset and N_interp. Paths of nearest moves serve every M_offset.

    Parameters
    ----------
    space : ScaleSpace
        Where the extrema were found.
    extrema, truth, inside, tolerances
        See `kept_and_lost`.
    max_offsets : sequence of float
        Values of M_offset.
    most_iterations : int
        Largest finite N_interp; all from 1, and no limit, are tried.

    Returns
    -------
    DataFrame
        ``n_spo, move, scale_moves, max_offset, max_iterations``, and what `kept_and_lost` says.
    """
    paths = {}
    for scale_moves in (True, False):
        nearest = trace(space, extrema, min(max_offsets), "nearest", scale_moves)
        for max_offset in max_offsets:
            paths["nearest", scale_moves, max_offset] = nearest
            paths["unit_step", scale_moves, max_offset] = trace(
                space, extrema, max_offset, "unit_step", scale_moves
            )
    rows = []
    for (move, scale_moves, max_offset), models in paths.items():
        for n in (*range(1, most_iterations + 1), MOST_MODELS):
            choice = {"move": move, "scale_moves": scale_moves, "max_offset": max_offset}
            result = kept_and_lost(
                extrema, models, space.sampling, truth, inside, max_offset, n, tolerances
            )
            rows.append({"n_spo": space.sampling.n_spo, **choice, "max_iterations": n, **result})
    return pd.DataFrame(rows)


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
        precision of the refined ones as `recall_and_precision` has them, and their
        ``median_location``.
    """
    options = dict(tolerances or {})
    counted = inside(extrema, "step_sigma")
    right = partners(extrema, truth, **options) >= 0
    refined = refined_table(sampling, extrema, models, max_offset, max_iterations)
    kept = np.zeros(len(extrema), dtype=bool)
    kept[refined["keypoint"]] = True
    refined = with_positions(refined)
    scores = recall_and_precision(
        refined, truth, inside(refined, "sigma"), inside(truth, "sigma"), **options
    )
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
        **{name: scores[name] for name in names},
    }
