"""What colour things have: the same one in every figure.

Colours of lines are the Okabe-Ito set or darker shades of it, which stay distinct for the common
colour blindnesses; stability is cividis (blue: detected once, yellow: always detected), which is
perceptually uniform and nearly the same for every reader.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from matplotlib.colors import Colormap

INK, GREY, PALE = "#222222", "#6e6e6e", "#d9d9d9"
"""Text, secondary text and guide lines, backgrounds."""

FRAME = "#F0A000"
"""Frames on photographs."""

STABILITY_MAP = "cividis"
"""Colour map of a keypoint's stability, from 0 (blue) to 1 (yellow)."""

LABEL_COLOURS = {"stable": "#a67c00", "unstable": "#1f3f77", "between": "#8c8c8c"}
"""Stable and unstable keypoints: the ends of `STABILITY_MAP`, the yellow darkened for lines."""

SURFACE_COLOURS = {"stable": "#EBC94F", "unstable": "#6F8FCB"}
"""The same two groups as shaded surfaces, lighter so that shadows show."""

OTHERS_COLOUR = "#ececec"
"""Surfaces that are there and not the subject."""

DETECTION_COLOURS = {"discrete": "#D55E00", "refined": "#0072B2"}
"""Extrema on the grid, and after refinement by the quadratic model."""

_OFFSETS = ("#04121f", "#00437a", "#0072B2", "#5AAEE0")
"""From no limit on the offset to the tightest; the third is that of "refined"."""

SIFT_COLOURS = {"unfiltered": "#A8458A", "filtered": "#5b1f57"}
"""SIFT with its own refinement, without and with its filters of contrast and edges (figure 7)."""

SIGN_COLOURS = {"maximum": "#F0A000", "minimum": "#3DA5E0"}
"""Maxima and minima of the difference of Gaussians, on a photograph."""

METHOD_COLOURS = {"sampled": "#D55E00", "dct": "#0072B2", "discrete_analogue": "#009E73"}
"""Ways to blur (figure 1)."""

FEATURE_COLOURS = {
    "dog": "#D55E00",
    "difference": "#0072B2",
    "laplacian": "#009E73",
    "condition": "#A8458A",
}
"""Predictors of stability (figure 5)."""

CHANGE_COLOURS = {"new": "#009E73", "lost": "#D55E00"}
"""Detections that a change of the sampling adds and removes (figure 4)."""

TOLERANCE_COLOURS = {
    "usual": INK,
    "epsilon_1e7": "#0072B2",
    "epsilon_1e6": "#A8216B",
    "epsilon_1e5": "#D55E00",
}
"""Tolerances of the comparison with neighbours (figure floor)."""


CAUSE_COLOURS = {
    "true": "#009E73",
    "degenerate": "#8fd4bb",
    "edge": "#d9d9d9",
    "twin": "#F0B060",
    "nothing": "#D55E00",
}
"""What a keypoint is, from right to wrong (figure truth)."""

CHANGE_CAUSE_COLOURS = {
    "edge": "#bdbdbd",
    "degenerate": CAUSE_COLOURS["degenerate"],
    "second": CAUSE_COLOURS["twin"],
    "merged": "#A8458A",
    "missed": "#0072B2",
    "false": CAUSE_COLOURS["nothing"],
}
"""Why extrema come and go (figure floor); what figure truth has too has its colour there."""

PICTURE_COLOURS = ("#0072B2", "#D55E00", "#009E73", "#A8458A", "#8a6d00")
"""Pictures, in their order; the first one is the study's (figure predictors)."""

MODEL_COLOURS = {"best": GREY, "combined": INK, "combined_end": "#D55E00"}
"""The best single predictor, and models of several (figure predictors)."""

COMPARED_COLOURS = {"found": CHANGE_COLOURS["lost"], "right": CHANGE_COLOURS["new"]}
"""Shares of keypoints that are not lost, and that are not new (figure S2)."""

THEORY_COLOURS = {"blob": "#0072B2", "dilation": "#A8458A"}
"""What closed forms predict (figures 12 and S2)."""

BALANCED_COLOUR = INK
"""The balanced sampling curve."""

CONDITION_COLOUR = "#A8216B"
"""The condition number of the Hessian along the balanced curve: a shade of its heat map."""


GAUSSIAN_COLOUR = "#D55E00"
"""A Gaussian beside what it is fitted to (figure S3)."""

OPERATOR_COLOURS = {"dog": "#0072B2", "laplacian": "#009E73"}
"""Differences of Gaussians, and their limit (figure S4)."""

ASSUMED_COLOURS = {"below": "#D55E00", "right": INK, "above": "#0072B2"}
"""An assumed blur below, equal to and above that of the camera (figure S4)."""

AXIS_COLOURS = {"y": "#D55E00", "x": "#0072B2"}
"""Down and right (figure audit)."""

OCTAVE_COLOURS = (INK, "#009E73")
"""First and second octave (figure audit)."""

NOISY_COLOUR = "#A8458A"
"""Views with noise beside those without (figure audit)."""

_SHADES = (
    "#60ceac", "#40b7ad", "#359eaa", "#3485a5", "#366ca0", "#3d5195", "#403a76", "#36274d",
    "#251729",
)  # fmt: skip
"""Ordered quantities, from light to dark: seaborn's "mako", which takes seconds to import."""


def shade(share: float) -> tuple[float, float, float]:
    """Return the colour of an ordered quantity: light at 0, dark at 1.

    Examples
    --------
    >>> bool(sum(shade(0.0)) > sum(shade(0.5)) > sum(shade(1.0)))
    True
    """
    return _between(_SHADES, np.linspace(0.0, 1.0, len(_SHADES)), share)


def offset_colour(max_offset: float) -> tuple[float, float, float]:
    """Return the colour of keypoints by ``M_offset``: light for a tight limit, dark for none.

    Parameters
    ----------
    max_offset : float
        Largest offset accepted, in samples; > 0, or infinite. 0.6 has the colour of "refined".

    Examples
    --------
    >>> from matplotlib.colors import to_rgb
    >>> offset_colour(0.6) == to_rgb(DETECTION_COLOURS["refined"])
    True
    """
    stops = (0.0, 0.5 / 1.0, 0.5 / 0.6, 1.0)  # of 0.5 / max_offset
    return _between(_OFFSETS, stops, 0.5 / max_offset)


def _between(
    colours: Sequence[str], stops: Sequence[float] | NDArray[np.float64], place: float
) -> tuple[float, float, float]:
    """Return the colour at a place between colours at given stops."""
    from matplotlib.colors import to_rgb

    channels = zip(*map(to_rgb, colours), strict=True)
    red, green, blue = (float(np.interp(place, stops, channel)) for channel in channels)
    return red, green, blue


def sweep_colours(values: Iterable[float]) -> dict[float, tuple[float, float, float]]:
    """Return a colour for each value of a sweep: dark blue for the lowest, orange for the highest.

    Parameters
    ----------
    values : iterable of float
        Values of the sweep, in any order and repeated at will; their ranks decide.

    Examples
    --------
    >>> list(sweep_colours([0.8, 0.25, 0.8]))
    [0.25, 0.8]
    """
    import matplotlib

    steps = sorted({float(value) for value in values})
    shades = matplotlib.colormaps["plasma"](np.linspace(0.0, 0.74, len(steps)))
    return {
        value: (float(red), float(green), float(blue))
        for value, (red, green, blue, _) in zip(steps, shades, strict=True)
    }


def stability_map() -> Colormap:
    """Return the colour map of stability; "not detected" (masked, NaN) is white."""
    import matplotlib

    return matplotlib.colormaps[STABILITY_MAP].with_extremes(bad="white")


def count_map() -> Colormap:
    """Return the colour map of counts: pale to dark blue, perceptually uniform."""
    return _middle("mako_r", 0.06, 0.82)


def condition_map() -> Colormap:
    """Return the colour map of condition numbers: pale to dark red, perceptually uniform."""
    return _middle("rocket_r", 0.04, 0.80)


def _middle(name: str, start: float, stop: float) -> Colormap:
    """Return the part of one of seaborn's colour maps on which black or white text can be read."""
    import seaborn
    from matplotlib.colors import ListedColormap

    return ListedColormap(seaborn.color_palette(name, as_cmap=True)(np.linspace(start, stop, 256)))


def readable_on(colour: Sequence[float]) -> str:
    """Return the colour of text that stands out on a background: dark or white.

    Parameters
    ----------
    colour : sequence of float
        Red, green and blue of the background in [0, 1]; more values are ignored.

    Examples
    --------
    >>> readable_on((0.0, 0.0, 0.4)), readable_on((0.9, 0.9, 0.2)) == INK
    ('white', True)
    """
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in colour[:3]]
    luminance = 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]
    # Contrast is (lighter + 0.05) / (darker + 0.05), and INK has a luminance of 0.016.
    return "white" if 1.05 / (luminance + 0.05) > (luminance + 0.05) / 0.066 else INK
