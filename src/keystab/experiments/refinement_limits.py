"""Keypoints of a set of views, before refinement and under limits of it (figure 7)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import pandas as pd

from keystab.detection.refinement import MOST_MODELS, refined_keypoints


class Choice(NamedTuple):
    """Keypoints of a set of views, discrete ones or those that limits of the refinement accept."""

    limits: tuple[float, int] | None
    """M_offset and N_interp; none for discrete extrema."""
    keypoints: pd.DataFrame
    scale_column: str
    labels: dict[str, Any]


def choices(
    extrema: pd.DataFrame, traces: pd.DataFrame, limits: Sequence[tuple[float, int]]
) -> list[Choice]:
    """Discrete extrema, and the keypoints that each pair of limits accepts.

    Parameters
    ----------
    extrema, traces : DataFrame
        See `keystab.detection.refinement.refined_keypoints`.
    limits : sequence of (float, int)
        M_offset and N_interp; the same twice counts once.

    Returns
    -------
    list of Choice
        With the labels ``detections, max_offset, max_iterations``.
    """
    nothing = {"detections": "discrete", "max_offset": math.nan, "max_iterations": math.nan}
    found = [Choice(None, extrema, "step_sigma", nothing)]
    for max_offset, max_iterations in dict.fromkeys(limits):
        keypoints = refined_keypoints(extrema, traces, max_offset, max_iterations)
        n_interp = math.inf if max_iterations >= MOST_MODELS else max_iterations
        labels = {"detections": "refined", "max_offset": max_offset, "max_iterations": n_interp}
        found.append(Choice((max_offset, max_iterations), keypoints, "sigma", labels))
    return found
