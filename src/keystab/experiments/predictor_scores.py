"""How well predictors and models of them tell what can be trusted, as tables (figure predictors).

Three questions are asked. ``stability``: is the keypoint of a detection seen at most samplings, or
at few (figure 5)? ``inside``: the same of those that lie within the range of scales whose ends are
what makes many others unstable. ``truth``: does a detection stand for an extremum of the continuous
scale-space?
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from keystab.evaluation.cross_validation import block_splits, blocks, folds, picture_split, scores
from keystab.evaluation.recall_precision import causes
from keystab.evaluation.stability import label
from keystab.evaluation.stratified_roc import Detections, areas, mean_curve, rejected, with_interval
from keystab.matching.correspondence import pairs_between
from keystab.prediction.predictors import MODELS, PREDICTORS, model_inputs, predictor_table
from keystab.scalespace.continuous_dog import DogSeries

LABELS = ("stability", "inside", "truth")

FALSE = ("nothing", "twin")
"""Causes (`keystab.evaluation.recall_precision.CAUSES`) of detections that are false."""

CURVE = np.round(np.arange(0.0, 1.001, 0.02), 2)
"""Shares of good detections kept at which ROC curves are written."""


class Scored(NamedTuple):
    """Tables of figure predictors."""

    detections: pd.DataFrame
    auc: pd.DataFrame
    gain: pd.DataFrame
    roc: pd.DataFrame


Key = tuple[str, str]
"""Name of a predictor or model, and how it was validated."""


class _Evaluated(NamedTuple):
    """Scores of the labelled detections of one picture, and what follows from them."""

    among: Detections
    n_blocks: int
    scores: dict[Key, NDArray[np.float64]]
    areas: dict[Key, NDArray[np.float64]]


def described(
    detections: pd.DataFrame,
    inside: NDArray[np.bool_],
    keypoints: pd.DataFrame,
    truth: pd.DataFrame,
    series: DogSeries,
    ends: tuple[float, float],
    same: Mapping[str, Any],
) -> pd.DataFrame:
    """Predictors and both labels of the detections of one picture.

    Parameters
    ----------
    detections : DataFrame
        Discrete extrema of one or more samplings, named by ``n_spo``, all of them.
    inside : ndarray of bool, shape (n_detections,)
        Those that are compared; only they are described.
    keypoints : DataFrame
        Unique keypoints of many samplings: ``keypoint, y, x, sigma, stability``, with `match_sign`
        ``sign``.
    truth : DataFrame
        True extrema of the view, from `keystab.true_extrema`.
    series : DogSeries
        Scale-space of the view.
    ends : (float, float)
        First and last scale that are compared, in pixels.
    same : mapping
        Options of `keystab.matching.correspondence.same`.

    Returns
    -------
    DataFrame
        ``n_spo, y, x, sigma, sign``; ``keypoint`` (the unique one nearest to the detection, among
        those that are the same) with its ``stability`` and place ``keypoint_y, keypoint_x``;
        ``cause`` (`keystab.evaluation.recall_precision.causes`); the columns of
        `keystab.prediction.predictors.PREDICTORS`. Detections that are the same as no keypoint are
        left out: there are none where keypoints cover the detections of these samplings, among
        others.
    """
    tolerances = {name: same[name] for name in ("space_tolerance", "scale_ratio")}
    cause = np.empty(len(detections), dtype="<U10")
    for n_spo in detections["n_spo"].unique():
        rows = np.flatnonzero(detections["n_spo"] == n_spo)
        cause[rows] = causes(detections.iloc[rows], truth, *ends, **tolerances)
    compared = detections[inside].reset_index(drop=True)
    keypoint, row, distance = pairs_between(keypoints, compared, **same)
    order = np.lexsort((keypoint, distance, row))
    rows, first = np.unique(row[order], return_index=True)
    nearest = keypoints.iloc[keypoint[order][first]].reset_index(drop=True)
    known = compared.iloc[rows].reset_index(drop=True)
    about = known[["n_spo", "y", "x", "sigma", "sign"]].assign(
        keypoint=nearest["keypoint"],
        keypoint_y=nearest["y"],
        keypoint_x=nearest["x"],
        stability=nearest["stability"],
        cause=cause[inside][rows],
    )
    return pd.concat([about, predictor_table(known, series, ends)], axis=1)


def score_predictors(
    pictures: Mapping[str, pd.DataFrame],
    stable_above: float,
    unstable_below: float,
    side: float,
    n_folds: int,
    n_resamples: int,
) -> Scored:
    """Score predictors and models on every picture (figure predictors).

    Parameters
    ----------
    pictures : mapping from name to DataFrame
        From `described`.
    stable_above, unstable_below : float
        Limits of stability; what lies between has no label.
    side : float
        Side of the blocks of a picture that stay together, in pixels.
    n_folds : int
        Folds of a picture's blocks.
    n_resamples : int
        Bootstrap resamples of blocks behind the intervals.

    Returns
    -------
    Scored
        ``detections`` with their block, fold and the log odds that the models gave them.
        ``auc``: ``label, picture, predictor, validation``, areas and shares of the bad rejected
        where 95 % of the good are kept, with intervals; ``validation`` is none for single
        predictors, which learn nothing, "blocks" for models that learnt from other blocks of the
        picture, "pictures" for those that learnt from the other pictures. ``gain``: by how much a
        model from other pictures exceeds that of its predictors which is the best one in these.
        ``roc``: mean curves of both.
    """
    table = pd.concat(
        [part.assign(picture=name) for name, part in pictures.items()], ignore_index=True
    )
    table["block"], table["fold"] = _places_in_folds(table, side, n_folds)
    front = ["picture", "n_spo", "block", "fold"]
    table = table[[*front, *table.columns.drop(front)]]
    inputs = model_inputs(table[list(PREDICTORS)], table[["picture", "n_spo"]])
    results: list[tuple[pd.DataFrame, ...]] = []
    for what in LABELS:
        good, labelled = _labels(table, what, stable_above, unstable_below)
        given = {(name, "none"): inputs[name].to_numpy() for name in PREDICTORS}
        learnt = _model_scores(table, inputs, good, labelled)
        for (model, validation), score in learnt.items():
            table[f"{what}_{model}_{validation}"] = score
        evaluated = {
            name: _evaluated(table, given | learnt, good, labelled & (table["picture"] == name),
                          n_resamples)
            for name in pictures
        }  # fmt: skip
        results.append(tuple(part.assign(label=what) for part in _tables(evaluated)))
    auc, gain, roc = (pd.concat(parts, ignore_index=True) for parts in zip(*results, strict=True))
    return Scored(table, _label_first(auc), _label_first(gain), _label_first(roc))


def _model_scores(
    table: pd.DataFrame,
    inputs: pd.DataFrame,
    good: NDArray[np.bool_],
    labelled: NDArray[np.bool_],
) -> dict[Key, NDArray[np.float64]]:
    """Log odds that models give all detections, by what they learnt from."""
    picture, fold = table["picture"].to_numpy().astype(str), table["fold"].to_numpy()
    names = np.unique(picture)
    splits = {
        "blocks": [split for name in names for split in block_splits(fold, picture == name)],
        "pictures": [picture_split(picture, name) for name in names],
    }
    return {
        (model, validation): scores(inputs[list(used)], good, labelled, parts)
        for model, used in MODELS.items()
        for validation, parts in splits.items()
    }


def _evaluated(
    table: pd.DataFrame,
    given: Mapping[Key, NDArray[np.float64]],
    good: NDArray[np.bool_],
    here: NDArray[np.bool_] | pd.Series,
    n_resamples: int,
) -> _Evaluated:
    """Areas of all scores among the labelled detections of one picture."""
    rows = np.flatnonzero(here)
    block = table["block"].to_numpy()[rows]
    names = table["picture"].to_numpy()[rows]
    purpose = str(names[0]) if len(names) else ""
    stratum = table["n_spo"].to_numpy()[rows]
    # The same resamples for all scores: their differences have intervals, too.
    among = Detections.in_blocks(good[rows], stratum, block, n_resamples, purpose)
    own = {key: score[rows] for key, score in given.items()}
    return _Evaluated(
        among,
        len(np.unique(block)),
        own,
        {key: _of(areas, score, among) for key, score in own.items()},
    )


def _tables(evaluated: Mapping[str, _Evaluated]) -> tuple[pd.DataFrame, pd.DataFrame, pd.DataFrame]:
    """Areas, gains and curves of all pictures."""
    rows: list[dict[str, Any]] = []
    gains: list[dict[str, Any]] = []
    curves = [_no_curve()]
    for name, picture in evaluated.items():
        for (predictor, validation), area in picture.areas.items():
            score = picture.scores[predictor, validation]
            rows.append(
                {
                    "picture": name,
                    "predictor": predictor,
                    "validation": validation,
                    **with_interval(area, "auc"),
                    **with_interval(_of(rejected, score, picture.among), "rejected"),
                    "n_good": int(picture.among.good.sum()),
                    "n_bad": int((~picture.among.good).sum()),
                    "n_blocks": picture.n_blocks,
                }
            )
        others = [evaluated[other] for other in evaluated if other != name]
        drawn: dict[str, Key] = {}
        for model, used in MODELS.items():
            best = _best(others, used)
            if best is None:
                continue
            drawn |= {model: (model, "pictures"), best: (best, "none")}
            own, its = picture.areas[model, "pictures"], picture.areas[best, "none"]
            gains.append(
                {
                    "picture": name,
                    "model": model,
                    "best": best,
                    "auc": float(own[0]),
                    "best_auc": float(its[0]),
                    **with_interval(own - its, "gain"),
                }
            )
        for predictor, key in drawn.items():
            curve = _curve(picture.scores[key], picture.among)
            curves.append(curve.assign(picture=name, predictor=predictor))
    columns = ["picture", "model", "best", "auc", "best_auc", "gain", "gain_low", "gain_high"]
    return (
        pd.DataFrame(rows),
        pd.DataFrame(gains, columns=columns),
        pd.concat(curves, ignore_index=True),
    )


def _places_in_folds(
    table: pd.DataFrame, side: float, n_folds: int
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Block and fold of every detection, by the place of its keypoint.

    All detections of a keypoint are thus in one block, wherever the border between blocks runs.
    """
    block, fold = np.zeros(len(table), dtype=np.intp), np.zeros(len(table), dtype=np.intp)
    for name in table["picture"].unique():
        here = np.flatnonzero(table["picture"] == name)
        places = table.iloc[here][["keypoint_y", "keypoint_x"]].set_axis(["y", "x"], axis=1)
        block[here] = blocks(places, side)
        fold[here] = folds(block[here], n_folds, "predictors", str(name))
    return block, fold


def _labels(
    table: pd.DataFrame, what: str, stable_above: float, unstable_below: float
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Which detections are good, and which have a label at all."""
    if what == "truth":
        return ~table["cause"].isin(FALSE).to_numpy(), np.ones(len(table), dtype=bool)
    names = label(table["stability"], stable_above, unstable_below)
    inside = (table["end"] >= 0).to_numpy() if what == "inside" else True
    return names == "stable", (names != "between") & inside


def _of(statistic: Any, score: NDArray[np.float64], among: Detections) -> NDArray[np.float64]:
    """A statistic of all resamples; NaN where nothing could be learnt, or nothing is there."""
    if not len(score) or np.isnan(score).any():
        return np.full(len(among.weight), np.nan)
    samples: NDArray[np.float64] = statistic(score, among)
    return samples


def _best(pictures: Sequence[_Evaluated], used: Sequence[str]) -> str | None:
    """Single predictor with the largest mean area over some pictures."""
    if not pictures:
        return None
    means = {
        name: float(np.mean([picture.areas[name, "none"][0] for picture in pictures]))
        for name in used
    }
    known = {name: area for name, area in means.items() if not np.isnan(area)}
    return max(known, key=known.__getitem__) if known else None


def _curve(score: NDArray[np.float64], among: Detections) -> pd.DataFrame:
    if not len(score) or np.isnan(score).any():
        return pd.DataFrame({"kept": CURVE, "rejected": np.nan})
    return mean_curve(score, among, CURVE)


def _no_curve() -> pd.DataFrame:
    """Columns of curves, for where there are none."""
    empty = pd.DataFrame({"kept": [], "rejected": []}, dtype=float)
    return empty.assign(picture=pd.Series(dtype=str), predictor=pd.Series(dtype=str))


def _label_first(table: pd.DataFrame) -> pd.DataFrame:
    front = [name for name in ("label", "picture", "predictor", "model") if name in table]
    return table[[*front, *table.columns.drop(front)]]
