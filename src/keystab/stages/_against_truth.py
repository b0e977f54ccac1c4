"""Detections of one view against its true extrema."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import pandas as pd

from keystab.evaluation.recall_precision import recall_and_precision, with_positions
from keystab.parameters import Tolerance
from keystab.stages._compared import Inside


def detections(
    discrete: pd.DataFrame, refined: pd.DataFrame
) -> Iterator[tuple[str, pd.DataFrame, str]]:
    """What is evaluated: a name, detections, and the column of their scale."""
    yield "discrete", discrete, "step_sigma"
    yield "refined", refined, "sigma"


def evaluation(
    truth: pd.DataFrame, inside: Inside, tolerance: Tolerance
) -> Callable[[pd.DataFrame, str], dict[str, Any]]:
    """Recall, precision and errors of detections, by the scale in one of their columns."""
    wanted = inside(truth, "sigma")

    def evaluated(found: pd.DataFrame, scale_column: str) -> dict[str, Any]:
        finite = with_positions(found)
        counted = inside(finite, scale_column)
        return recall_and_precision(finite, truth, counted, wanted, **vars(tolerance))

    return evaluated
