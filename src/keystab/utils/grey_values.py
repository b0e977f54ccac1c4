"""Grey values of any size, brought to a size at which their squares can be computed with."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

__all__ = ["grey_unit"]


def grey_unit(image: NDArray[np.float64]) -> float:
    """Power of two next to the largest absolute grey value: dividing by it loses no digit.

    Parameters
    ----------
    image : ndarray
        Finite grey values.

    Returns
    -------
    float
        At most the largest absolute value, and more than half of it; 1 where all are 0.

    Examples
    --------
    >>> grey_unit(np.array([0.3, -0.7])), grey_unit(np.array([255.0])), grey_unit(np.zeros(3))
    (0.5, 128.0, 1.0)
    """
    largest = max(float(np.max(image)), -float(np.min(image)))
    return math.ldexp(1.0, math.frexp(largest)[1] - 1) if largest else 1.0
