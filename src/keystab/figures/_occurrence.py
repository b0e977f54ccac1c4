"""Occurrence matrices: which unique keypoint is detected where (figures 4 and 9)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from keystab.errors import InputError
from keystab.figures import palette, style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.image import AxesImage
    from pandas import DataFrame


class Occurrence(NamedTuple):
    """Which unique keypoint is detected in which set of detections.

    ``detected[i, j]`` says whether keypoint j is seen in set ``sets[i]``; ``stability[j]`` is the
    share of sets that see it; ``order`` lists the keypoints from least to most stable.
    """

    sets: NDArray[Any]
    detected: NDArray[np.bool_]
    stability: NDArray[np.float64]
    order: NDArray[np.int64]

    def coloured(self) -> NDArray[np.float64]:
        """Stability of each keypoint where it is detected, else NaN; columns in `order`."""
        return np.where(self.detected, self.stability, np.nan)[:, self.order]


class Share(NamedTuple):
    """A share of the unique keypoints, between 0 and 1, and what is counted."""

    value: float
    note: str

    @property
    def percent(self) -> str:
        """The share in per cent, as written on the figure."""
        return f"{100 * self.value:.0f} %"

    def __str__(self) -> str:
        """Return what is counted and the share, as written on the figure."""
        return f"{self.note}: {self.percent}"


def occurrence(
    detections: DataFrame, keypoints: DataFrame, set_column: str, figure: str
) -> Occurrence:
    """Turn the tidy tables into a matrix, and order its columns.

    Parameters
    ----------
    detections : DataFrame
        ``keypoint``, `set_column`, ``detected`` (0 or 1): a row for every pair.
    keypoints : DataFrame
        ``keypoint, stability``.
    set_column : str
        What the sets differ in, a number.
    figure : str
        Name of the figure, for messages.

    Returns
    -------
    Occurrence
        Sets in increasing order. Keypoints of the same stability are ordered by the mean of the
        sets that see them.

    Raises
    ------
    InputError
        If a pair is missing.
    """
    matrix = detections.pivot_table(index=set_column, columns="keypoint", values="detected")
    matrix = matrix.reindex(columns=keypoints["keypoint"])
    if matrix.isna().any(axis=None):
        raise InputError(
            f"{figure}_occurrence.csv: lacks some pairs of a keypoint of {figure}_keypoints.csv "
            f"and a value of {set_column}; remake both tables"
        )
    detected = matrix.to_numpy() > 0
    sets = matrix.index.to_numpy()
    stability = keypoints["stability"].to_numpy(dtype=np.float64)
    mean_set = (sets[:, None] * detected).sum(axis=0) / np.maximum(detected.sum(axis=0), 1)
    return Occurrence(sets, detected, stability, np.lexsort((mean_set, stability)))


def draw_matrix(ax: Axes, values: NDArray[np.float64], colours: Any) -> AxesImage:
    """Draw an occurrence matrix, the first set on top; NaN is left white."""
    image = ax.imshow(
        values, cmap=colours, vmin=0.0, vmax=1.0, aspect="auto", interpolation="nearest"
    )
    ax.tick_params(length=2)
    return image


def mark_groups(ax: Axes, n: int, groups: Mapping[str, tuple[Share, str]]) -> None:
    """Underline the least and the most stable ones of `n` columns, and say what they are.

    Parameters
    ----------
    ax : matplotlib Axes
        Panel of a matrix whose columns are in increasing order of stability.
    n : int
        Number of columns.
    groups : mapping
        For ``"unstable"`` and ``"stable"``, or one of them, its share and the text below its line.
    """
    ax.set_xticks([])
    below = ax.get_xaxis_transform()
    for group, (share, text) in groups.items():
        number = round(n * share.value)
        start, stop = (0, number) if group == "unstable" else (n - number, n)
        colour = palette.LABEL_COLOURS[group]
        span = (start - 0.5, stop - 0.5)
        line: dict[str, Any] = {"linewidth": 2.5, "solid_capstyle": "butt", "clip_on": False}
        ax.plot(span, (-0.05, -0.05), transform=below, color=colour, label=group, **line)
        side = "left" if group == "unstable" else "right"
        place: dict[str, Any] = {"ha": side, "va": "top", "fontsize": style.SMALL}
        edge = span[0] if side == "left" else span[1]
        ax.text(edge, -0.1, text, transform=below, color=colour, **place)
