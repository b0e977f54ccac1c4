"""Extrema as they are found in single precision (section 5.2, "Discrete extrema").

Published detectors hold images as float32. The Gaussians of neighbouring samples then agree in most
of their digits, and the more so the finer the sampling, until a difference of Gaussians is made of
rounding. What is simulated here is the best that single precision allows: every Gaussian correct to
its last digit, differences and comparisons in float32.
"""

from __future__ import annotations

import numpy as np
import threadpoolctl
from numpy.typing import NDArray

from keystab.detection.extrema import extrema_of_array
from keystab.scalespace.dog import ScaleSpace, ranges
from keystab.utils import validation

# Samples a side of the blocks that are searched: all Gaussians of one are held at once.
_BLOCK = 256


def single_precision_window(
    space: ScaleSpace, rows: tuple[int, int], columns: tuple[int, int], grey_range: float = 1.0
) -> NDArray[np.float32]:
    """Difference of Gaussians of a box of samples in single precision.

    Parameters
    ----------
    space : ScaleSpace
        The scale-space.
    rows, columns : tuple of int
        First and one past the last.
    grey_range : float
        What grey values are multiplied by before they are rounded, such as 255.

    Returns
    -------
    ndarray of float32, shape (n_slices, n_rows, n_columns)
        In units of `grey_range`.
    """
    _, lower, upper = space.blurs
    with threadpoolctl.threadpool_limits(1):
        along, across = (
            axis.block(*part) for axis, part in zip(space.axes, (rows, columns), strict=True)
        )
        gaussians = []
        for blur in range(len(along.first)):
            left, right = along.factor(blur), across.factor(blur)
            top, first = along.first[blur], across.first[blur]
            source = space.source[top : top + left.shape[1], first : first + right.shape[1]]
            blurred = left @ source @ right.T
            # The source is without the mean, which every Gaussian keeps.
            gaussians.append(((blurred + space.image.mean()) * grey_range).astype(np.float32))
    return np.stack([gaussians[b] - gaussians[a] for a, b in zip(lower, upper, strict=True)])


def single_precision_extrema(
    space: ScaleSpace, epsilon: float = 0.0, grey_range: float = 1.0
) -> NDArray[np.int64]:
    """Discrete extrema of a scale-space that is held in single precision.

    Parameters
    ----------
    space : ScaleSpace
        The octave.
    epsilon : float
        By how much an extremum differs from each of its 26 neighbours, in units of `grey_range`.
    grey_range : float
        See `single_precision_window`.

    Returns
    -------
    ndarray of int64, shape (n, 4)
        Slice s, row, column and sign, ordered by s, row, column.

    Raises
    ------
    InputError
        If `epsilon` is negative or `grey_range` not above 0.

    Examples
    --------
    >>> from keystab.scalespace.dog import scale_space
    >>> flat = scale_space(np.full((12, 12), 0.5), camera_blur=1.1, n_spo=5)
    >>> len(single_precision_extrema(flat))
    0
    """
    validation.number("epsilon", epsilon, least=0)
    validation.number("grey_range", grey_range, above=0)
    n_rows, n_columns = space.shape[1:]
    found = [np.empty((0, 4), dtype=np.int64)]
    for top, bottom in ranges(1, n_rows - 1, _BLOCK):
        for left, right in ranges(1, n_columns - 1, _BLOCK):
            window = single_precision_window(
                space, (top - 1, bottom + 1), (left - 1, right + 1), grey_range
            )
            found.append(extrema_of_array(window, epsilon, (top - 1, left - 1)))
    extrema = np.concatenate(found)
    return extrema[np.lexsort((extrema[:, 2], extrema[:, 1], extrema[:, 0]))]


def quantised(image: NDArray[np.float64], bits: int | None) -> NDArray[np.float64]:
    """Round an image to the grey values that integers of some bits can hold.

    Parameters
    ----------
    image : ndarray
        Grey values in [0, 1].
    bits : int or None
        Bits of a pixel; None leaves the image as it is.

    Returns
    -------
    ndarray of float64

    Examples
    --------
    >>> quantised(np.array([0.1, 0.5, 1.2]), 1).tolist()
    [0.0, 0.0, 1.0]
    """
    if bits is None:
        return image
    most = 2**bits - 1
    rounded: NDArray[np.float64] = np.round(np.clip(image, 0.0, 1.0) * most) / most
    return rounded
