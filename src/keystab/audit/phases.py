"""Places between pixels, met evenly: what rounds to samples is to have no bias from them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["PERIOD", "even_phases", "spread_points"]

PERIOD = 4
"""Pixels after which phases come again: the distance of samples in the third octave."""

_GOLDEN = 1.32471795724474602596  # the plastic number: its powers spread points evenly


def even_phases(n: int, number: int) -> NDArray[np.float64]:
    """Places within four pixels in y and x, as many in every part of a pixel.

    Parameters
    ----------
    n : int
        They belong to n rows of n blobs.
    number : int
        0, 1 or 2: three sets, of which each fills the gaps of the others.

    Returns
    -------
    ndarray of float64, shape (n * n, 2)
        In [0, 4), row by row. Sorted, the fractions are regular, and with each one comes its
        opposite; so a detector that rounds to samples half a pixel, 1, 2 or 4 pixels apart has no
        bias. Neither y and x nor phases and rows or columns go together (a lattice).

    Examples
    --------
    >>> places = even_phases(10, 1)
    >>> np.histogram(places[:, 0] % 1, 5, (0, 1))[0].tolist()
    [20, 20, 20, 20, 20]
    >>> print(np.abs((places - np.round(places)).mean(axis=0)).round(9))
    [0. 0.]
    """
    count, odd = n * n, n % 2
    # A row moves them by some n-th of a pixel, a column by another: steps of u n + 1 or u n - 1,
    # which have no divisor in common with n * n.
    steps = ((4 * n + 1, 3 * n - 1), (2 * n + 1, 4 * n + 1), (4 * n + 1, 4 * n - 1))[number % 3]
    ranks = np.arange(count)[:, None] * np.array(steps) % count
    # Fractions rank / count, or those in the middle between: none is half of a pixel, from which
    # rounding goes either way. Those of two sets are moved by a third, outwards or inwards.
    twice = 2 * ranks + 1 - odd
    outwards = np.where(twice < count, 1, -1) * (twice > 0)
    fractions = (twice / 2 + (number % 3 - 1) / 3 * outwards) / count
    # Each whole pixel of the four comes as often in y as in x, and with each of the other.
    first = ranks[:, 0]
    second = first + (first + 3 * odd) // 4
    found: NDArray[np.float64] = np.stack([first, second], axis=1) % PERIOD + fractions
    return found


def spread_points(n: int) -> NDArray[np.float64]:
    """Points in the unit square, spread more evenly than by chance: an additive recurrence.

    Examples
    --------
    >>> spread_points(1000).mean(axis=0).round(2).tolist()
    [0.5, 0.5]
    """
    steps = np.array([1 / _GOLDEN, 1 / _GOLDEN**2])
    points: NDArray[np.float64] = (0.5 + np.arange(1, n + 1)[:, None] * steps) % 1.0
    return points
