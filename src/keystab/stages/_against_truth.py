"""Detections of one view against its true extrema."""

from __future__ import annotations

import argparse
from typing import Any

import pandas as pd

from keystab.evaluation.recall_precision import judged, with_positions
from keystab.stages._compared import compared, tolerances


def judged_in_octave(
    found: pd.DataFrame,
    truth: pd.DataFrame,
    shape: tuple[int, int],
    args: argparse.Namespace,
    scale_column: str,
) -> dict[str, Any]:
    """Hold detections against true extrema in the range that is compared."""
    inside = compared(args, shape)
    finite = with_positions(found)
    return judged(
        finite, truth, inside(finite, scale_column), inside(truth, "sigma"), **tolerances(args)
    )
