"""Where labels of a figure lie on what is drawn, or on each other."""

from __future__ import annotations

import itertools

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.text import Text
from matplotlib.transforms import Bbox


def collisions(figure: Figure) -> list[tuple[str, str]]:
    """Return labels that lie on points or curves, with these, and labels that lie on labels.

    They are where the figure was drawn last, which must have been at its own resolution, as by
    `style.settle`.

    Guide lines, whose names begin with "_", may be crossed, and labels with a ground of their own
    may lie on anything.
    """
    drawn = [(name, points) for ax in figure.axes for name, points in _points(ax)]
    found = []
    labels = [(text.get_text(), box) for ax in figure.axes for text, box in _labels(ax)]
    for text, box in labels:
        found += [(text, name) for name, points in drawn if box.count_contains(points)]
    pairs = itertools.combinations(labels, 2)
    return found + [(one, other) for (one, a), (other, b) in pairs if a.overlaps(b)]


def _labels(ax: Axes) -> list[tuple[Text, Bbox]]:
    """Titles and texts in and beside a panel, and the boxes of their letters."""
    titles = (ax.title, ax._left_title, ax._right_title)
    texts = [*titles, *ax.texts, *(ax.get_legend().get_texts() if ax.get_legend() else ())]
    shown = [text for text in texts if text.get_text().strip() and text.get_bbox_patch() is None]
    # Boxes are as high as the font; letters are not.
    return [(text, Text.get_window_extent(text).padded(-1.5)) for text in shown]


def _points(ax: Axes) -> list[tuple[str, np.ndarray]]:
    """Points of lines, some pixels apart, and of clouds, in pixels."""
    found = []
    if ax.name == "3d":
        return found
    for line in ax.get_lines():
        if line.get_label().startswith("_"):
            continue
        data = np.column_stack([np.asarray(part, float) for part in line.get_data()])
        points = line.get_transform().transform(data)
        if line.get_linestyle() != "None" and len(points) > 1:
            points = np.concatenate([_between(*pair) for pair in itertools.pairwise(points)])
        found.append((line.get_label(), points))
    for cloud in ax.collections:
        if len(cloud.get_offsets()) and not cloud.get_label().startswith("_"):
            places = np.ma.filled(np.ma.asarray(cloud.get_offsets(), float), np.nan)
            found.append((cloud.get_label(), cloud.get_offset_transform().transform(places)))
    box = ax.bbox.padded(1.0)
    visible = [
        (name, points[((box.min <= points) & (points <= box.max)).all(axis=1)])
        for name, points in found
    ]
    return [(name, points) for name, points in visible if len(points)]


def _between(start: np.ndarray, end: np.ndarray) -> np.ndarray:
    steps = np.hypot(*(end - start)) // 2
    n = 2 if not np.isfinite(steps) else int(min(steps, 1000)) + 2
    return np.linspace(start, end, n)
