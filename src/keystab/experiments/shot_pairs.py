"""Pairs of shots of views: keypoints with error bars in the first, held against the second."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, Literal, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from keystab.detection.detector import detect_keypoints
from keystab.experiments.uncertainty_calibration import (
    SHOTS,
    coverage_table,
    judged,
    noise_argument,
    reliability_table,
    separation_table,
    shot,
    strata_table,
)
from keystab.prediction.uncertainty import keypoint_uncertainty

__all__ = ["PREDICTED", "Calibration", "Detector", "calibration", "shot_pairs"]

PREDICTED = ("shot", "estimated", "view")
"""What error bars are predicted from: one shot whose noise is known, one shot alone, or the view
without noise and the noise of a shot."""


class Detector(NamedTuple):
    """How shots are searched; see `keystab.detect_keypoints`."""

    n_spo: int
    sigma_min: float
    kappa: float
    n_oct: int
    border: float
    """Pixels left out at the border of the view."""
    first_scale: float
    """Scales are judged from so many times the first scale on, to as much below the last."""

    def search(self) -> dict[str, Any]:
        """Options of a search."""
        return {name: getattr(self, name) for name in ("n_spo", "sigma_min", "kappa", "n_oct")}

    def inside(self, keypoints: pd.DataFrame, shape: tuple[int, int]) -> NDArray[np.bool_]:
        """Which keypoints are judged: those that a shift does not take out of what is searched."""
        low = self.sigma_min * self.first_scale
        high = self.sigma_min * 2**self.n_oct / self.first_scale
        within = keypoints["sigma"].between(low, high)
        for name, size in zip(("y", "x"), shape, strict=True):
            within &= keypoints[name].between(self.border, size - 1 - self.border)
        return within.to_numpy()


def shot_pairs(
    views: Sequence[tuple[NDArray[np.float64], float]],
    levels: Sequence[float],
    n_pairs: int,
    n_pairs_others: int,
    detector: Detector,
) -> pd.DataFrame:
    """Judge the error bars of pairs of shots.

    Parameters
    ----------
    views : sequence of (ndarray, float)
        Views without noise, grey values from 0 to 1, each with its camera blur. The first is seen
        with all kinds of noise, the others with additive noise.
    levels : sequence of float
        Standard deviations of the noise.
    n_pairs : int
        Pairs of the first view with additive noise.
    n_pairs_others : int
        Pairs of every other view, of the other kinds of noise, and of those predicted from one shot
        whose noise is estimated.
    detector : Detector
        How shots are searched.

    Returns
    -------
    DataFrame
        Columns of `keystab.experiments.uncertainty_calibration.judged`, and ``predicted`` (from
        what, see `PREDICTED`), ``against`` (the second ``shot``, or the ``view`` without noise),
        ``kind``, ``blur`` and ``noise``.
    """
    parts: list[pd.DataFrame] = []
    for number, (view, blur) in enumerate(views):
        kinds: tuple[Literal["additive", "signal", "jpeg"], ...]
        kinds = ("additive",) if number else SHOTS
        for kind in kinds:
            pairs = n_pairs_others if number or kind != "additive" else n_pairs
            for level in levels:
                for labels, table in _pairs(
                    view, blur, kind, level, pairs, n_pairs_others, detector
                ):
                    parts.append(table.assign(**labels, kind=kind, blur=blur, noise=level))
    return pd.concat(parts, ignore_index=True)


def _pairs(
    view: NDArray[np.float64],
    blur: float,
    kind: Literal["additive", "signal", "jpeg"],
    level: float,
    n_pairs: int,
    n_estimated: int,
    detector: Detector,
) -> Iterator[tuple[dict[str, str], pd.DataFrame]]:
    known = noise_argument(kind, level)

    search = detector.search()

    def bars(
        image: NDArray[np.float64], noise: float | tuple[float, float] | None, clean: bool
    ) -> pd.DataFrame:
        return keypoint_uncertainty(image, blur, noise, noise_free=clean, **search)

    def held(
        keypoints: pd.DataFrame, other: pd.DataFrame, image: NDArray[np.float64], shots: int
    ) -> pd.DataFrame:
        rows = detector.inside(keypoints, (view.shape[0], view.shape[1]))
        return judged(keypoints, other, image, blur, detector.kappa, shots)[rows]

    of_view = bars(view, known, True)
    for pair in range(n_pairs):
        first, second = (
            shot(view, kind, level, str(blur), str(level), pair, which) for which in range(2)
        )
        again = detect_keypoints(second, blur, **search)
        of_shot = bars(first, known, False)
        yield {"predicted": "shot", "against": "shot"}, held(of_shot, again, first, 2)
        yield {"predicted": "shot", "against": "view"}, held(of_shot, of_view, first, 1)
        yield {"predicted": "view", "against": "shot"}, held(of_view, again, view, 1)
        if pair < n_estimated:
            alone = bars(first, None, False)
            yield {"predicted": "estimated", "against": "shot"}, held(alone, again, first, 2)


class Calibration(NamedTuple):
    """What is judged of error bars; `keystab.experiments.uncertainty_calibration` has the columns.

    Attributes
    ----------
    coverage, reliability, separation : DataFrame
        By what was predicted from what, kind of noise, blur and noise; the latter two of those
        held against second shots.
    strata : DataFrame
        Of the usual case: the first view with additive noise, predicted from one shot of known
        noise and held against a second.
    """

    coverage: pd.DataFrame
    strata: pd.DataFrame
    reliability: pd.DataFrame
    separation: pd.DataFrame


def calibration(pairs: pd.DataFrame) -> Calibration:
    """Judge all pairs of shots.

    Parameters
    ----------
    pairs : DataFrame
        From `shot_pairs`, whose first view comes first.

    Returns
    -------
    Calibration
    """
    usual = {
        "predicted": "shot", "against": "shot", "kind": "additive", "blur": pairs["blur"].iloc[0]
    }  # fmt: skip
    of_usual = (pairs[list(usual)] == pd.Series(usual)).all(axis=1)
    second = pairs[pairs["against"] == "shot"]
    by = [*usual, "noise"]
    return Calibration(
        coverage_table(pairs, by),
        strata_table(pairs[of_usual]),
        reliability_table(second, by),
        separation_table(second, by),
    )
