r"""The difference of Gaussians of a cosine series, and its derivatives, as finite sums.

An image that already has a blur of c is a finite cosine series
(`keystab.scalespace.cosine_series`), and so is its difference of Gaussians at every scale,

.. math:: w(\sigma, y, x) = \sum_{kl} a_{kl} \cos(f_k (y + \tfrac12)) \cos(g_l (x + \tfrac12))
          \left( e^{-(\kappa^2\sigma^2 - c^2)(f_k^2 + g_l^2)/2}
          - e^{-(\sigma^2 - c^2)(f_k^2 + g_l^2)/2} \right),

with :math:`f_k = \pi k / H`, :math:`g_l = \pi l / W`. Nothing is sampled here: value, gradient and
Hessian at any point are sums of H W terms. Gaussians separate into an axis each, and derivatives
with respect to scale are spatial ones, because a Gaussian of variance b solves the heat equation
:math:`\partial_b v = \tfrac12 \Delta v`. With :math:`\lambda = \ln\sigma` and the two blurred
images :math:`v_1` (at :math:`\kappa\sigma`) and :math:`v_0` (at :math:`\sigma`),

.. math:: \partial_\lambda w = \kappa^2\sigma^2 \Delta v_1 - \sigma^2 \Delta v_0, \qquad
          \partial_\lambda^2 w = 2 \partial_\lambda w
          + \kappa^4\sigma^4 \Delta^2 v_1 - \sigma^4 \Delta^2 v_0 .

A batch of P points thus costs ten products of a P x H by an H x W matrix.

Derivatives are with respect to :math:`(\lambda, y / \sigma, x / \sigma)`, sigma held at the
point: the units of length of the scale-space itself, which a zoom leaves alone
(`keystab.prediction.features`).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from keystab.scalespace import cosine_series

__all__ = [
    "BELOW_BLUR",
    "FOURTH",
    "MOST_AMPLIFIED",
    "ContinuousDog",
    "DogSeries",
    "Jets",
    "jets_of",
]

BELOW_BLUR = 0.92
"""Part of an image's own blur below which no scale is looked at: sums may go below that blur, and
then undo it."""

MOST_AMPLIFIED = 5.0
"""Samples of an image whose blur is undone may amplify a frequency by e to this power at most."""

#: Entries of the largest array that a block of points needs; bounds the memory to some 100 MB.
_MOST_ENTRIES = 2**21

#: Pairs of orders of derivatives along y and x that a Hessian needs, through the heat equation.
_SECOND = ((0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2))
FOURTH = (*_SECOND, (3, 0), (1, 2), (2, 1), (0, 3), (4, 0), (2, 2), (0, 4))
"""Orders of derivatives along y and x from which all jets follow."""


Derivatives = Mapping[tuple[int, int], NDArray[np.float64]]


@dataclass(frozen=True)
class Jets:
    r"""Value, gradient and Hessian of a difference of Gaussians at some points.

    Attributes
    ----------
    value : ndarray, shape (n,)
        w, in the units of the image.
    gradient : ndarray, shape (n, 3)
        :math:`(\partial_\lambda w, \sigma\partial_y w, \sigma\partial_x w)`.
    hessian : ndarray, shape (n, 3, 3)
        Symmetric; :math:`\partial_\lambda^2 w`, :math:`\sigma\partial_\lambda\partial_y w`,
        :math:`\sigma^2\partial_y^2 w` and so on, axes in the order scale, y, x.
    """

    value: NDArray[np.float64]
    gradient: NDArray[np.float64]
    hessian: NDArray[np.float64]

    def __getitem__(self, rows: NDArray[np.bool_] | NDArray[np.intp]) -> Jets:
        """Jets of some of the points."""
        return Jets(self.value[rows], self.gradient[rows], self.hessian[rows])

    @classmethod
    def joined(cls, parts: Sequence[Jets]) -> Jets:
        """Jets of several sets of points, one after the other."""
        names = ("value", "gradient", "hessian")
        return cls(*(np.concatenate([getattr(part, name) for part in parts]) for name in names))

    def put(self, rows: NDArray[np.bool_] | NDArray[np.intp], other: Jets) -> None:
        """Write the jets of some of the points."""
        self.value[rows] = other.value
        self.gradient[rows] = other.gradient
        self.hessian[rows] = other.hessian


def jets_of(
    upper: Derivatives,
    lower: Derivatives,
    sigma: NDArray[np.float64],
    kappa: float,
    within_slices: bool = False,
) -> Jets:
    """Jets of a difference of two Gaussians from the spatial derivatives of each.

    Parameters
    ----------
    upper, lower : mapping from (int, int) to ndarray, shape (n,)
        Derivatives along y and x of the image blurred to kappa sigma and to sigma, of the orders
        `FOURTH`; of those up to the second, `within_slices`.
    sigma : ndarray, shape (n,)
        Scales in pixels.
    kappa : float
        Ratio of the two blurs.
    within_slices : bool
        Leave out the derivatives along scale, which are then 0.
    """
    w = {pair: upper[pair] - lower[pair] for pair in _SECOND}
    n = sigma.size
    first, second, along = np.zeros(n), np.zeros(n), np.zeros((n, 2))
    if not within_slices:
        for v, weight, ratio in ((upper, 1.0, kappa), (lower, -1.0, 1.0)):
            s2 = (ratio * sigma) ** 2
            first += weight * s2 * (v[2, 0] + v[0, 2])
            second += weight * s2**2 * (v[4, 0] + 2 * v[2, 2] + v[0, 4])
            along[:, 0] += weight * s2 * (v[3, 0] + v[1, 2])
            along[:, 1] += weight * s2 * (v[2, 1] + v[0, 3])
    hessian = np.empty((n, 3, 3))
    hessian[:, 0, 0] = 2 * first + second
    hessian[:, 0, 1:] = hessian[:, 1:, 0] = sigma[:, None] * along
    hessian[:, 1, 1] = sigma**2 * w[2, 0]
    hessian[:, 2, 2] = sigma**2 * w[0, 2]
    hessian[:, 1, 2] = hessian[:, 2, 1] = sigma**2 * w[1, 1]
    return Jets(w[0, 0], np.stack([first, sigma * w[1, 0], sigma * w[0, 1]], axis=1), hessian)


class ContinuousDog(Protocol):
    """A difference of Gaussians that is known everywhere, however its sums are taken."""

    @property
    def shape(self) -> tuple[int, int]:
        """Height and width of the image in pixels."""

    @property
    def blur(self) -> float:
        """Gaussian blur that the image already has, in its pixels."""

    @property
    def contrast(self) -> float:
        """Root mean square of the image about its mean."""

    def jets(
        self,
        sigma: NDArray[np.float64],
        y: NDArray[np.float64],
        x: NDArray[np.float64],
        within_slices: bool = False,
    ) -> Jets:
        """Value, gradient and Hessian at scattered points, see `DogSeries.jets`."""


@dataclass(frozen=True, eq=False)
class DogSeries:
    """The continuous difference-of-Gaussians scale-space of a cosine series.

    Attributes
    ----------
    coefficients : ndarray, shape (K, L)
        Leading coefficients of the series (`keystab.scalespace.cosine_series.coefficients`).
    shape : (int, int)
        Height and width of the image in pixels, at least K and L.
    blur : float
        Gaussian blur c that the image already has, in its pixels. Scales may go below it: the sum
        is finite, though it then undoes blur that the image has and amplifies what noise there is.
    kappa : float
        Ratio of the two Gaussians.
    """

    coefficients: NDArray[np.float64]
    shape: tuple[int, int]
    blur: float
    kappa: float

    @classmethod
    def of_image(cls, image: NDArray[np.float64], blur: float, kappa: float) -> DogSeries:
        """Scale-space of an image, shape (height, width), with all its coefficients."""
        coefs = cosine_series.coefficients(image)
        coefs[0, 0] = 0.0  # no difference of Gaussians has a mean
        return cls(coefs, (coefs.shape[0], coefs.shape[1]), blur, kappa)

    @cached_property
    def contrast(self) -> float:
        """Root mean square of the image about its mean: the unit of what rounding can do."""
        weights = [np.where(np.arange(n) == 0, 1.0, 0.5) for n in self.coefficients.shape]
        power = weights[0] @ self.coefficients**2 @ weights[1]
        return math.sqrt(power - self.coefficients[0, 0] ** 2)

    def jets(
        self,
        sigma: NDArray[np.float64],
        y: NDArray[np.float64],
        x: NDArray[np.float64],
        within_slices: bool = False,
    ) -> Jets:
        """Value, gradient and Hessian at scattered points, by the full sums.

        Parameters
        ----------
        sigma, y, x : ndarray, shape (n,)
            Scales above 0 and positions in pixels; positions may lie anywhere.
        within_slices : bool
            Leave out the derivatives along scale, which are then 0: half the cost.

        Returns
        -------
        Jets
            Exact but for rounding, some 1e-16 of the image's range.

        Examples
        --------
        >>> wave = np.cos(np.pi * 2 * (np.arange(8.0) + 0.5) / 8)  # one coefficient, k = 2
        >>> jets = DogSeries.of_image(wave[:, None], 0.0, 2**0.5).jets(*np.full((3, 1), 1.5))
        >>> f2 = (np.pi / 4) ** 2
        >>> value = np.cos(np.pi / 2) * (np.exp(-2.25 * f2) - np.exp(-2.25 * f2 / 2))
        >>> bool(abs(jets.value[0] - value) < 1e-15)
        True
        """
        n = sigma.size
        jets = Jets(np.empty(n), np.empty((n, 3)), np.empty((n, 3, 3)))
        longest = max(self.coefficients.shape)
        size = max(1, _MOST_ENTRIES // (10 * longest))
        # Coarse scales need fewer frequencies: points of about one scale go together.
        order = np.argsort(sigma, kind="stable")
        for start in range(0, n, size):
            rows = order[start : start + size]
            jets.put(rows, self._block(sigma[rows], y[rows], x[rows], within_slices))
        return jets

    def grid(
        self, sigma: float, y: NDArray[np.float64], x: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Values at one scale on a grid of rows and columns, shape (len(y), len(x))."""
        values = np.zeros((len(y), len(x)))
        bases = self._bases(y, x, self._counts(sigma**2 - self.blur**2))
        for weight, ratio in ((1.0, self.kappa), (-1.0, 1.0)):
            variance = np.atleast_1d((ratio * sigma) ** 2 - self.blur**2)
            rows, columns = (
                basis[0][:, : gains.shape[1]] * gains
                for basis, gains in zip(bases, self._gains(variance), strict=True)
            )
            values += weight * (
                rows @ self.coefficients[: rows.shape[1], : columns.shape[1]] @ columns.T
            )
        return values

    def _block(
        self,
        sigma: NDArray[np.float64],
        y: NDArray[np.float64],
        x: NDArray[np.float64],
        within_slices: bool,
    ) -> Jets:
        # Of the two Gaussians the narrower one keeps more frequencies.
        bases = self._bases(y, x, self._counts(float(sigma.min()) ** 2 - self.blur**2))
        pairs = _SECOND if within_slices else FOURTH
        upper, lower = (
            self._derivatives((ratio * sigma) ** 2 - self.blur**2, bases, pairs)
            for ratio in (self.kappa, 1.0)
        )
        return jets_of(upper, lower, sigma, self.kappa, within_slices)

    def _counts(self, variance: float) -> list[int]:
        """Frequencies of both axes that are held and that count after a Gaussian blur."""
        blur = math.sqrt(max(variance, 0.0))
        return [
            min(held, cosine_series.significant(n, blur))
            for n, held in zip(self.shape, self.coefficients.shape, strict=True)
        ]

    def _bases(
        self, y: NDArray[np.float64], x: NDArray[np.float64], counts: list[int]
    ) -> list[tuple[NDArray[np.float64], NDArray[np.float64]]]:
        """Cosines of both axes and their first derivatives, each of shape (n, K) or (n, L)."""
        return [
            (cosine_series.basis(p, n, count), cosine_series.basis(p, n, count, derivative=1))
            for p, n, count in zip((y, x), self.shape, counts, strict=True)
        ]

    def _gains(self, variance: NDArray[np.float64]) -> list[NDArray[np.float64]]:
        """Factors of both axes of the frequencies that count for some of the variances."""
        gains = []
        for n, count in zip(self.shape, self._counts(float(variance.min())), strict=True):
            gains.append(np.exp(-0.5 * variance[:, None] * (np.pi / n * np.arange(count)) ** 2))
        return gains

    def _derivatives(
        self,
        variance: NDArray[np.float64],
        bases: list[tuple[NDArray[np.float64], NDArray[np.float64]]],
        pairs: tuple[tuple[int, int], ...],
    ) -> dict[tuple[int, int], NDArray[np.float64]]:
        """Derivatives of the image blurred by `variance`, at a block of points."""
        highest = max(p for p, _ in pairs)
        rows, columns = (
            _orders(gains, cosines, slopes, n, highest)
            for gains, (cosines, slopes), n in zip(
                self._gains(variance), bases, self.shape, strict=True
            )
        )
        a = self.coefficients[: rows.shape[2], : columns.shape[2]]
        products = (rows.reshape(-1, rows.shape[2]) @ a).reshape(highest + 1, variance.size, -1)
        return {(p, q): np.einsum("nl,nl->n", products[p], columns[q]) for p, q in pairs}


def _orders(
    gains: NDArray[np.float64],
    cosines: NDArray[np.float64],
    slopes: NDArray[np.float64],
    n: int,
    highest: int,
) -> NDArray[np.float64]:
    """Blurred cosines of one axis and their derivatives, shape (highest + 1, points, count)."""
    count = gains.shape[1]
    curvature = -((np.pi / n * np.arange(count)) ** 2)
    rows = np.empty((highest + 1, *gains.shape))
    np.multiply(gains, cosines[:, :count], out=rows[0])
    np.multiply(gains, slopes[:, :count], out=rows[1])
    for order in range(2, highest + 1):
        np.multiply(rows[order - 2], curvature, out=rows[order])
    return rows
