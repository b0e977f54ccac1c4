"""The two interpolants of the input image, each with all that depends on the choice.

Section 2.3 of the paper oversamples by cubic B-splines; the cosine series of the image is exact and
band-limited. Whoever works with a scale-space asks its interpolant and does not ask which it is.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np

from keystab.errors import InputError
from keystab.scalespace.axis import AxisOperator
from keystab.scalespace.cosine_axis import CosineAxis, cosine_source, rounding_of_gaussians
from keystab.scalespace.neighbourhoods import cosine_neighbourhoods, spline_neighbourhoods
from keystab.scalespace.rounding import UNIT, Rounding, largest_of_slices, of_local_rows
from keystab.scalespace.spline_axis import SOURCE_ROUNDING, SplineAxis, spline_source

__all__ = ["INTERPOLANTS", "CosineInterpolant", "Interpolant", "SplineInterpolant", "interpolant"]

Axes = tuple[AxisOperator, AxisOperator]


class Interpolant(Protocol):
    """What a scale-space needs to know of the interpolant of its image."""

    def source(self, image: np.ndarray) -> np.ndarray:
        """What the operators of the axes act on, C-contiguous."""

    def axis(
        self, n_samples: int, n_pixels: int, delta_min: float, stride: int, blurs: np.ndarray
    ) -> AxisOperator:
        """Operator of one axis."""

    def neighbourhoods(
        self,
        source: np.ndarray,
        axes: Axes,
        lower: np.ndarray,
        upper: np.ndarray,
        *centres: np.ndarray,
        tolerance: float,
    ) -> np.ndarray:
        """Cubes of 3 x 3 x 3 samples around samples, shape (n, 3, 3, 3)."""

    def rounding(
        self,
        image: np.ndarray,
        source: np.ndarray,
        axes: Axes,
        lower: np.ndarray,
        upper: np.ndarray,
    ) -> Rounding:
        """How far rounding may take values, given the two Gaussians of every slice."""

    def rows_in_reach(self, sigma: float, height: int) -> float:
        """Rows of the source that count for one row of a slice blurred by sigma, in pixels."""


class SplineInterpolant:
    """Cubic B-splines with the mirror extension of the image (section 2.3)."""

    def source(self, image: np.ndarray) -> np.ndarray:
        """Spline coefficients."""
        return np.ascontiguousarray(spline_source(image))

    def axis(
        self, n_samples: int, n_pixels: int, delta_min: float, stride: int, blurs: np.ndarray
    ) -> AxisOperator:
        """Rows of few columns: splines are local, and so are Gaussians."""
        return SplineAxis(n_samples, n_pixels, delta_min, stride, blurs)

    def neighbourhoods(
        self,
        source: np.ndarray,
        axes: Axes,
        lower: np.ndarray,
        upper: np.ndarray,
        *centres: np.ndarray,
        tolerance: float,  # noqa: ARG002 - a cube takes less than to look at its parts
    ) -> np.ndarray:
        """Sums over the few coefficients in reach."""
        return spline_neighbourhoods(source, axes, lower, upper, *centres)

    def rounding(
        self,
        image: np.ndarray,
        source: np.ndarray,
        axes: Axes,
        lower: np.ndarray,
        upper: np.ndarray,
    ) -> Rounding:
        """From the largest coefficient, the rows of both axes and their columns."""
        y, x = axes
        assert isinstance(y, SplineAxis) and isinstance(x, SplineAxis)
        amplitude = float(np.abs(source).max())
        off = of_local_rows(amplitude, SOURCE_ROUNDING * UNIT, y.rounding, x.rounding)
        return largest_of_slices(*off, lower, upper)

    def rows_in_reach(self, sigma: float, height: int) -> float:
        """Rows within some standard deviations on either side."""
        return min(float(height), 17 * sigma + 12)


class CosineInterpolant:
    """The cosine series of the image itself: exact, with the mirror axis half a pixel outside."""

    def source(self, image: np.ndarray) -> np.ndarray:
        """Coefficients of the series."""
        return np.ascontiguousarray(cosine_source(image))

    def axis(
        self, n_samples: int, n_pixels: int, delta_min: float, stride: int, blurs: np.ndarray
    ) -> AxisOperator:
        """Cosines, damped by the Gaussians."""
        return CosineAxis(n_samples, n_pixels, delta_min, stride, blurs)

    def neighbourhoods(
        self,
        source: np.ndarray,
        axes: Axes,
        lower: np.ndarray,
        upper: np.ndarray,
        *centres: np.ndarray,
        tolerance: float,
    ) -> np.ndarray:
        """Sums over all coefficients that the Gaussians leave."""
        return cosine_neighbourhoods(source, axes, lower, upper, *centres, tolerance=tolerance)

    def rounding(
        self,
        image: np.ndarray,
        source: np.ndarray,
        axes: Axes,
        lower: np.ndarray,
        upper: np.ndarray,
    ) -> Rounding:
        """From the sizes of all coefficients; the smallest blurs leave most of them."""
        y, x = axes
        assert isinstance(y, CosineAxis) and isinstance(x, CosineAxis)
        amplitude = float(np.abs(image - image.mean()).max())
        blurs = np.array([lower.min(), upper.min()])
        off = rounding_of_gaussians(source, amplitude, (y, x), blurs)
        return largest_of_slices(*off, np.array([0]), np.array([1]))

    def rows_in_reach(self, sigma: float, height: int) -> float:
        """All rows: a sharp band limit rings."""
        return float(height)


INTERPOLANTS: dict[str, Interpolant] = {
    "spline": SplineInterpolant(),
    "cosine": CosineInterpolant(),
}
"""Interpolants by the names that settings and arguments give them (``oversampling``)."""


def interpolant(oversampling: str) -> Interpolant:
    """Interpolant by its name.

    Raises
    ------
    InputError
        If there is none of this name.

    Examples
    --------
    >>> interpolant("linear")  # doctest: +ELLIPSIS
    Traceback (most recent call last):
    keystab.errors.InputError: oversampling is 'linear', allowed are spline and cosine: change ...
    """
    if oversampling not in INTERPOLANTS:
        raise InputError(
            f"oversampling is {oversampling!r}, allowed are {' and '.join(INTERPOLANTS)}: "
            "change oversampling"
        )
    return INTERPOLANTS[oversampling]
