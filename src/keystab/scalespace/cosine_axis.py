"""Rows of L for the finite cosine series that the half-sample symmetric image is.

The source is the array of its coefficients; blur is a multiplication, exact for the continuous
Gaussian. Rows are not local: a column is a frequency.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from keystab.scalespace import cosine_series
from keystab.scalespace.axis import Block


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
        """See `keystab.scalespace.axis.AxisOperator.block`; the columns are the lowest frequencies.

        On a short interval, functions with a band limit of half a cycle per pixel span a space
        of few dimensions, about one per pixel and a dozen more. Its basis is the same for all
        blocks of one length.
        """
        expand = band_limited_basis(stop - start, self.spacing)
        rows = self.basis(np.arange(start, stop))
        common = rows if expand is None else expand.T @ rows
        factors = [
            common[:, :count] * gain[:count]
            for count, gain in zip(self.n_frequencies, self.gains, strict=True)
        ]
        return Block.of(expand, [0] * len(factors), factors)

    def basis(self, rows: np.ndarray, count: int | None = None) -> np.ndarray:
        """Cosines of the lowest frequencies at fine samples, shape rows.shape + (count,)."""
        return cosine_series.basis(np.asarray(rows) * self.spacing, self.n_pixels, count)


def cosine_source(image: np.ndarray) -> np.ndarray:
    """Cosine series coefficients of an image, without the constant term."""
    a = cosine_series.coefficients(image)
    a[0, 0] = 0.0
    return a


@lru_cache(maxsize=16)
def band_limited_basis(n_samples: int, spacing: float, faint: float = 1e-16) -> np.ndarray | None:
    """Orthonormal basis of band-limited functions on an interval.

    Parameters
    ----------
    n_samples : int
        Samples of the interval.
    spacing : float
        Their distance in pixels; the band limit is half a cycle per pixel.
    faint : float
        Singular value, of the largest, below which a direction is left out.

    Returns
    -------
    ndarray, shape (n_samples, rank), or None
        Columns that span every such function, by default to the last digit; None where that takes
        about as many as there are samples.
    """
    span = (n_samples - 1) * spacing
    # Frequencies dense enough that the waves between them add nothing new to the interval.
    frequency = np.linspace(0.0, np.pi, int(4 * span) + 64)
    phase = np.multiply.outer((np.arange(n_samples) - (n_samples - 1) / 2) * spacing, frequency)
    waves = np.hstack([np.cos(phase), np.sin(phase)])
    left, singular, _ = np.linalg.svd(waves, full_matrices=False)
    rank = int((singular > faint * singular[0] * np.sqrt(n_samples)).sum())
    return np.ascontiguousarray(left[:, :rank]) if rank < 0.7 * n_samples else None
