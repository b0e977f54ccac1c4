r"""How far rounding may take the values of a scale-space from what they stand for.

With u half the distance of 1 to the next double, a sum of n products that are added up in any order
differs from the exact one by at most :math:`n u` times the sum of the products' sizes, but for
terms of the order of :math:`u^2`. A value is two such sums, over the rows and over the columns of
the source C:

.. math:: |fl(y C x^T) - y C x^T| \le (n_y + n_x + 2) \, u \; |y| \, |C| \, |x|^T.

What the entries of y and x are off, and the source, is added in the same way. An exact value is
here what exact arithmetic makes of the image, at the positions of the samples as doubles hold
them.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

UNIT = 2.0**-53
"""Relative error of one operation in double precision."""


class RowRounding(NamedTuple):
    """What is known of the rows of an axis whose columns are local, for every blur.

    Attributes
    ----------
    norm : ndarray, shape (n_blurs,)
        Largest sum of absolute entries of a row.
    columns : ndarray, shape (n_blurs,)
        Most columns that a row has.
    off : ndarray, shape (n_blurs,)
        Largest sum over a row of how far its entries are off.
    """

    norm: NDArray[np.float64]
    columns: NDArray[np.float64]
    off: NDArray[np.float64]


class Rounding(NamedTuple):
    """How far the values of a scale-space are off, at most.

    Attributes
    ----------
    value : float
        From what exact arithmetic makes of the image.
    sums : float
        By the sums alone: what may change when a value is summed in another order.
    """

    value: float
    sums: float

    @property
    def between(self) -> float:
        """By how much a difference of two values changes with the order of the sums."""
        return 4 * self.sums

    @property
    def counts(self) -> float:
        """Smallest computed difference that shows in whatever order the sums are taken.

        Of two values that are exactly equal, computed ones differ by up to ``2 * value``.
        """
        return 2 * self.value + self.between


def largest_of_slices(
    value: NDArray[np.float64],
    sums: NDArray[np.float64],
    lower: NDArray[np.int64],
    upper: NDArray[np.int64],
) -> Rounding:
    """Bounds of the Gaussians put together, for differences of two of them.

    Examples
    --------
    >>> off = np.array([1.0, 2.0, 4.0])
    >>> largest_of_slices(off, off / 2, np.array([0, 1]), np.array([1, 2]))
    Rounding(value=6.0, sums=3.0)
    """
    # What subtracting rounds is among the sums of either.
    return Rounding(
        float((value[lower] + value[upper]).max(initial=0.0)),
        float((sums[lower] + sums[upper]).max(initial=0.0)),
    )


def of_local_rows(
    amplitude: float, of_source: float, y: RowRounding, x: RowRounding
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Bounds for Gaussians of a source with values of at most `amplitude`, of local rows.

    Parameters
    ----------
    amplitude : float
        Largest absolute value of the source.
    of_source : float
        How far any value of it is off, in units of `amplitude`.
    y, x : RowRounding
        Of both axes.

    Returns
    -------
    value, sums : ndarray, shape (n_blurs,)
        See `Rounding`.
    """
    norm = y.norm * x.norm
    sums = (y.columns + x.columns + 4) * UNIT * norm
    entries = y.off * x.norm + (y.norm + y.off) * x.off
    return amplitude * (sums + entries + of_source * norm), amplitude * sums
