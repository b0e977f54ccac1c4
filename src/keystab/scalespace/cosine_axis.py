"""Rows of L for the finite cosine series that the half-sample symmetric image is.

The source is the array of its coefficients; blur is a multiplication, exact for the continuous
Gaussian. Rows are not local: a column is a frequency.
"""

from __future__ import annotations

import numpy as np

from keystab.scalespace import cosine_series
from keystab.scalespace.axis import Block
from keystab.scalespace.rounding import UNIT


class CosineAxis:
    """Evaluation of the input's own cosine series after a continuous Gaussian blur.

    Parameters
    ----------
    n_samples, n_pixels, delta_min, stride, blurs
        As for `keystab.scalespace.spline_axis.SplineAxis`.
    """

    def __init__(
        self, n_samples: int, n_pixels: int, delta_min: float, stride: int, blurs: np.ndarray
    ) -> None:
        self.n_pixels = n_pixels
        self.spacing = delta_min * stride
        self.gains = np.array([cosine_series.gaussian(n_pixels, blur) for blur in blurs])
        self.n_frequencies = np.array([cosine_series.significant(n_pixels, blur) for blur in blurs])

    def block(self, start: int, stop: int) -> Block:
        """See `keystab.scalespace.axis.AxisOperator.block`; columns are the lowest frequencies."""
        rows = self.basis(np.arange(start, stop))
        factors = [
            rows[:, :count] * gain[:count]
            for count, gain in zip(self.n_frequencies, self.gains, strict=True)
        ]
        return Block.of([0] * len(factors), factors)

    def basis(self, rows: np.ndarray, count: int | None = None) -> np.ndarray:
        """Cosines of the lowest frequencies at fine samples, shape rows.shape + (count,)."""
        return cosine_series.basis(np.asarray(rows) * self.spacing, self.n_pixels, count)


def cosine_source(image: np.ndarray) -> np.ndarray:
    """Cosine series coefficients of an image, without the constant term."""
    a = cosine_series.coefficients(image - image.mean())  # what is rounded does not see the mean
    a[0, 0] = 0.0
    return a


def rounding_of_gaussians(
    source: np.ndarray, amplitude: float, axes: tuple[CosineAxis, CosineAxis], blurs: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    r"""Bounds for Gaussians of a cosine series, see `keystab.scalespace.rounding.Rounding`.

    Sizes of products are summed with the frequencies damped and all cosines taken for 1. The cosine
    of frequency k is off by :math:`\pi k` units, because its angle is so large, and some more; a
    transform of N numbers by :math:`10 \log_2 N` units of the root of their sum of squares.

    Parameters
    ----------
    source : ndarray, shape (height, width)
    amplitude : float
        Largest distance of the image from its mean.
    axes : (CosineAxis, CosineAxis)
    blurs : ndarray of int, shape (n,)
        Gaussians, by their number.

    Returns
    -------
    value, sums : ndarray, shape (n,)
    """
    size, n_all = np.abs(source), sum(source.shape)
    transform = 10 * np.log2(4.0 * source.size) * 2 * amplitude
    value, sums = np.zeros(blurs.size), np.zeros(blurs.size)
    for k, blur in enumerate(blurs):
        y, x = (axis.gains[blur] for axis in axes)
        off_y, off_x = (gain * (np.pi * np.arange(gain.size) + 25) for gain in (y, x))
        along = y @ size
        total = float(along @ x)
        entries = float(off_y @ (size @ x)) + float(along @ off_x)
        sums[k] = UNIT * (n_all + 8) * total
        of_source = float(np.sqrt((y @ y) * (x @ x))) * transform
        value[k] = sums[k] + UNIT * (entries + of_source)
    return value, sums
