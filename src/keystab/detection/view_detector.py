"""Detections in the views of a set: all octaves of every view, with their refinement traces.

Nothing is accepted or discarded here. The traces hold the positions of all models, so that
``M_offset`` and ``N_interp``, the range of scales and the field of view are decided afterwards.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from keystab.detection.detector import extrema_table, without_seams
from keystab.detection.extrema import extrema_and_cubes, within
from keystab.detection.refinement import columns_of, positions, trace
from keystab.scalespace.dog import ScaleSpace, scale_space

Window = tuple[float, float, float, float]
"""First and last row, first and last column, in pixels."""

Search = Callable[[ScaleSpace, int], NDArray[np.int64]]
"""Finds the discrete extrema of an octave, given its scale-space and its number."""


@dataclass(frozen=True)
class Detector:
    """How the views of a set are searched.

    Attributes
    ----------
    camera_blur : float
        Blur that the views are assumed to have, in pixels; their own may be another.
    n_spo, delta_min, sigma_min, kappa, oversampling, epsilon, n_oct
        See `keystab.detect_keypoints`.
    scale_moves, move, max_offset
        See `keystab.detection.refinement.trace`.
    """

    camera_blur: float
    n_spo: int
    delta_min: float | None = None
    sigma_min: float = 1.1
    kappa: float = 2 ** (1 / 3)
    oversampling: str = "spline"
    epsilon: float = 0.0
    n_oct: int = 1
    scale_moves: bool = True
    move: str = "nearest"
    max_offset: float = 0.5

    def octaves(self, image: NDArray[np.float64]) -> list[ScaleSpace]:
        """Scale-space of every octave of a view, one slice longer at seams between octaves."""
        return [
            scale_space(
                image,
                self.camera_blur,
                self.n_spo,
                self.delta_min,
                self.sigma_min,
                self.kappa,
                self.oversampling,
                octave,
                (-1 if octave else 0, self.n_spo + (3 if octave < self.n_oct - 1 else 2)),
            )
            for octave in range(self.n_oct)
        ]


def detect_in_view(
    image: NDArray[np.float64],
    detector: Detector,
    search: Search | None = None,
    window: Window | None = None,
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Discrete extrema of all octaves of one view, and their refinement traces.

    Parameters
    ----------
    image : ndarray, shape (height, width)
        The view.
    detector : Detector
        How to search it.
    search : callable, optional
        What finds the extrema of an octave; `keystab.detection.extrema.discrete_extrema` by
        default.
    window : (float, float, float, float), optional
        First and last row, first and last column, in pixels, between which extrema are asked for.

    Returns
    -------
    extrema : DataFrame
        Columns of `keystab.detection.detector.extrema_table` and ``octave``.
    traces : DataFrame
        One row per model: ``keypoint`` (row in `extrema`), ``model``, ``alpha_s, alpha_y,
        alpha_x``, and where the model's extremum lies: ``y, x, sigma`` in pixels, ``value``.

    Notes
    -----
    Where octaves meet, an extremum may be seen from both sides or from none. Both are searched one
    slice beyond the seam, and the scale after one unbounded quadratic step decides which reports
    it, whatever the refinement does later. See `keystab.detect_keypoints`.
    """
    octaves, traces = [], []
    for octave, space in enumerate(detector.octaves(image)):
        asked = None if window is None else samples_of(window, space)
        if search:
            found = search(space, octave)
            table = extrema_table(space, found[within(found, asked)])
        else:
            table = extrema_table(space, *extrema_and_cubes(space, detector.epsilon, window=asked))
        models = trace(space, table, detector.max_offset, detector.move, detector.scale_moves)
        models[["y", "x", "sigma"]] = positions(models, space.sampling)
        traces.append(models.drop(columns=["s", "row", "column"]))
        table["s"] += space.sampling.first_slice
        octaves.append(
            table.assign(octave=octave, scale=table["step_sigma"], step=space.sampling.step)
        )
    keep = without_seams(
        [columns_of(table) for table in octaves], detector.n_spo, detector.sigma_min
    )
    kept, followed, first = [], [], 0
    for table, models, mask in zip(octaves, traces, keep, strict=True):
        number = first + np.cumsum(mask) - 1
        keypoint = models["keypoint"].to_numpy()
        kept.append(table.drop(columns=["scale", "step"])[mask])
        followed.append(models.assign(keypoint=number[keypoint])[mask[keypoint]])
        first += int(mask.sum())
    return pd.concat(kept, ignore_index=True), pd.concat(followed, ignore_index=True)


def joined(
    label: str, values: Iterable[float], found: Iterable[tuple[pd.DataFrame, pd.DataFrame]]
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Detections of several views or scale-spaces below each other.

    Parameters
    ----------
    label : str
        First column of the extrema, in which the parts differ.
    values : iterable of float
        Its value for each part.
    found : iterable of (DataFrame, DataFrame)
        What `detect_in_view` returned for each.

    Returns
    -------
    extrema, traces : DataFrame
        ``keypoint`` of the traces is the row in all extrema.

    Examples
    --------
    >>> parts = [(pd.DataFrame({"y": [1, 2]}), pd.DataFrame({"keypoint": [0, 1]}))] * 2
    >>> extrema, traces = joined("view", [0, 1], parts)
    >>> extrema["view"].tolist(), traces["keypoint"].tolist()
    ([0, 0, 1, 1], [0, 1, 2, 3])
    """
    extrema, traces, first = [], [], 0
    for value, (table, models) in zip(values, found, strict=True):
        labelled = table.copy(deep=False)
        labelled.insert(0, label, value)
        extrema.append(labelled)
        traces.append(models.assign(keypoint=models["keypoint"] + first))
        first += len(table)
    return pd.concat(extrema, ignore_index=True), pd.concat(traces, ignore_index=True)


def samples_of(window: Window, space: ScaleSpace) -> tuple[slice, slice]:
    """Rows and columns of a scale-space that lie in a window given in pixels."""
    step = space.sampling.step
    top, bottom, left, right = window
    return (
        slice(math.ceil(top / step), math.floor(bottom / step) + 1),
        slice(math.ceil(left / step), math.floor(right / step) + 1),
    )
