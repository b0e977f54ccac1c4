r"""Models that combine predictors, scored on detections that they have not seen.

Detections of one picture are not independent. The difference of Gaussians at a scale of 2 px is a
mean over some 10 px, so that neighbours look at the same pixels; an extremum and the saddle that
takes it away share one structure; and one keypoint is detected at several samplings. A model that
had seen a detection's neighbour would partly know the answer. Folds are therefore made of whole
square blocks of the picture, bootstrap samples draw whole blocks, and the hardest test leaves out a
whole picture.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from keystab.errors import InputError
from keystab.utils.random import random_generator

Split = tuple[NDArray[np.bool_], NDArray[np.bool_]]


def blocks(places: pd.DataFrame, side: float) -> NDArray[np.intp]:
    """Number of the square block that each place lies in.

    Parameters
    ----------
    places : DataFrame
        Columns ``y`` and ``x``, in pixels.
    side : float
        Side of the blocks in pixels, above 0.

    Returns
    -------
    ndarray of int, shape (n,)
        Numbered from 0 in the order of rows and columns; empty blocks have no number.

    Raises
    ------
    InputError
        If `side` is not above 0.

    Examples
    --------
    >>> blocks(pd.DataFrame({"y": [1.0, 1.0, 40.0], "x": [1.0, 99.0, 3.0]}), 32.0).tolist()
    [0, 1, 2]
    """
    if not side > 0:
        raise InputError(f"the side of blocks is {side}, allowed is above 0: raise it")
    cells = np.floor(places[["y", "x"]].to_numpy(dtype=float) / side).astype(np.int64)
    if not len(cells):
        return np.zeros(0, dtype=np.intp)
    number: NDArray[np.intp] = np.unique(cells, axis=0, return_inverse=True)[1].reshape(-1)
    return number


def folds(block: NDArray[np.intp], n_folds: int, *purpose: int | str) -> NDArray[np.intp]:
    """Fold of each detection: whole blocks, in an order drawn by lot.

    Parameters
    ----------
    block : ndarray of int, shape (n,)
        From `blocks`.
    n_folds : int
        At least 2.
    *purpose : int or str
        What the folds are for; nothing else decides (`keystab.utils.random.random_generator`).

    Returns
    -------
    ndarray of int, shape (n,)
        0 to ``n_folds - 1``; folds differ by at most one block.

    Raises
    ------
    InputError
        If `n_folds` is below 2.

    Examples
    --------
    >>> folds(np.array([0, 0, 1, 2, 3]), 2, "example").tolist()
    [0, 0, 1, 0, 1]
    """
    if n_folds < 2:
        raise InputError(f"n_folds is {n_folds}, allowed is at least 2: raise it")
    n_blocks = int(block.max(initial=-1)) + 1
    order = random_generator("folds", *purpose).permutation(n_blocks)
    return (order % n_folds)[block]


def block_splits(fold: NDArray[np.intp], within: NDArray[np.bool_]) -> Iterator[Split]:
    """Detections to learn from and to be scored, for each fold of one picture.

    Parameters
    ----------
    fold : ndarray of int, shape (n,)
        From `folds`.
    within : ndarray of bool, shape (n,)
        Detections of the picture.
    """
    for number in np.unique(fold[within]):
        yield within & (fold != number), within & (fold == number)


def picture_split(picture: NDArray[np.str_], left_out: str) -> Split:
    """Detections of all other pictures, to learn from, and of one, to be scored."""
    return picture != left_out, picture == left_out


def scores(
    inputs: pd.DataFrame,
    good: NDArray[np.bool_],
    labelled: NDArray[np.bool_],
    splits: Iterator[Split] | list[Split],
) -> NDArray[np.float64]:
    """Log odds of being good, by logistic regressions that have not seen the detection.

    Parameters
    ----------
    inputs : DataFrame
        One row per detection, one column per predictor; see
        `keystab.prediction.predictors.model_inputs`.
    good : ndarray of bool, shape (n,)
        The label.
    labelled : ndarray of bool, shape (n,)
        Detections that have one; models learn from no others.
    splits : iterable of pairs of ndarray of bool
        What to learn from, and what to score.

    Returns
    -------
    ndarray, shape (n,)
        NaN where nothing was scored, or where what there was to learn from holds only one of the
        two kinds.

    Notes
    -----
    Inputs are scaled by the standard deviation of what is learnt from, both kinds weigh the same,
    and the penalty is scikit-learn's default (C = 1): there is nothing to tune.
    """
    from sklearn.linear_model import LogisticRegression
    from sklearn.pipeline import make_pipeline
    from sklearn.preprocessing import StandardScaler

    values = inputs.to_numpy(dtype=float)
    score = np.full(len(values), np.nan)
    for learnt, scored in splits:
        known = learnt & labelled
        if len(np.unique(good[known])) < 2 or not scored.any():
            continue
        model = make_pipeline(
            StandardScaler(), LogisticRegression(class_weight="balanced", max_iter=1000)
        )
        model.fit(values[known], good[known])
        score[scored] = model.decision_function(values[scored])
    return score
