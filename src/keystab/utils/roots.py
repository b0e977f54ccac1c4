"""Where a function of one variable is zero, to the digits that the function has."""

from __future__ import annotations

import math
from collections.abc import Callable

__all__ = ["root_between"]


def root_between(function: Callable[[float], float], low: float, high: float) -> float:
    """Root of a function between two places where its signs differ.

    The place of a maximum is asked of the derivative: near it, values differ by less than their
    rounding over some 1e-8 of the way, and which of them is largest depends on the processor.

    Parameters
    ----------
    function : callable
        A continuous function of one number.
    low, high : float
        Ends of the interval, low < high.

    Returns
    -------
    float
        To some 1e-15 of the larger of its size and of 1, if the function has so many digits.
        Where the signs at the ends are the same, the end where the function is nearer to zero.

    Examples
    --------
    >>> round(root_between(lambda x: x * x - 2, 1, 2), 12)
    1.414213562373
    >>> root_between(lambda x: x, 1, 2)
    1.0
    """
    from scipy.optimize import brentq

    ends = float(low), float(high)
    first, last = (function(end) for end in ends)
    if math.copysign(1.0, first) == math.copysign(1.0, last) or not first or not last:
        return ends[abs(last) < abs(first)]
    return float(brentq(function, *ends, xtol=1e-15, rtol=1e-15))
