r"""The difference of Gaussians of a cosine series, and its derivatives, from samples nearby.

The full sums of `keystab.scalespace.continuous_dog` take all coefficients for every point. A
Gaussian is local, and so the sum over a fine grid of samples of the series ends some standard
deviations away: a point then costs the same in any picture.

**Which samples.** For a Gaussian of standard deviation s in an image of blur c, the variance that
is missing, :math:`s^2 - c^2`, may be as little as 0, where no local kernel would do. Therefore the
series is first multiplied by :math:`e^{-(\sigma_j^2 - c^2 - \tau^2) f^2 / 2}`, which may amplify,
sampled at a distance h, and then summed with a Gaussian of variance
:math:`B = s^2 - \sigma_j^2 + \tau^2 \ge \tau^2`, whose derivatives are closed forms too. The sum
over samples differs from the convolution by aliases of the Gaussian's spectrum: for a frequency f,

.. math:: e^{-(\sigma_j^2 - c^2 - \tau^2) f^2 / 2} \, e^{-B (2\pi/h - f)^2 / 2}.

With :math:`\tau^2 = \tfrac12 (\sigma_j^2 - c^2)` this is largest at :math:`f = \pi / h`, and at
most :math:`e^{-\tau^2 \pi^2 / h^2}`, so that the distance h may grow with the scale: each `Level`
serves from its own :math:`\sigma_j` on, up to the next one. Below the first of these the series is
sampled three times a pixel: no frequency is above half a cycle per pixel, and the alias of one is
smaller than itself by :math:`e^{-12 \pi^2 \tau^2}` at least.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from keystab.scalespace import cosine_series
from keystab.scalespace.continuous_dog import FOURTH, MOST_AMPLIFIED, DogSeries, Jets, jets_of

__all__ = ["LocalDog"]

Array = NDArray[np.float64]

#: Aliases may be so small a part of what they are added to: the exponent of e.
_ALIASES = 36.0

#: Standard deviations at which a Gaussian ends, where 2e-17 of its height is left.
_REACH = 8.8

#: Samples per pixel of the first level, where the kernel may be as narrow as the image's own blur.
_FINEST = 3.0

#: Distance of samples from one level to the next.
_COARSER = 1.5


class Level(NamedTuple):
    """Samples of the series, blurred in advance.

    Attributes
    ----------
    samples : ndarray, shape (m, n)
        Blurred in advance to `variance`, mirrored at half a sample beyond its ends.
    distance : (float, float)
        Pixels from one sample to the next along y and along x.
    variance : float
        Blur squared that samples have, the image's own counted, pixels squared.
    least : float
        Standard deviation of Gaussians from which this level serves, pixels.
    """

    samples: Array
    distance: tuple[float, float]
    variance: float
    least: float


@dataclass(frozen=True, eq=False)
class LocalDog:
    """A difference of Gaussians whose value, gradient and Hessian are local sums.

    Attributes
    ----------
    levels : tuple of Level
        From fine to coarse.
    shape : (int, int)
        Height and width of the image in pixels.
    blur : float
        Gaussian blur that the image already has, in its pixels.
    kappa : float
        Ratio of the two Gaussians.
    contrast : float
        Root mean square of the image about its mean.
    sharpened : DogSeries, optional
        Full sums for scales below the image's blur, where that blur is so large that samples
        which serve them would be made of rounding.
    """

    levels: tuple[Level, ...]
    shape: tuple[int, int]
    blur: float
    kappa: float
    contrast: float
    sharpened: DogSeries | None = None

    @classmethod
    def of_series(cls, series: DogSeries, low: float, high: float) -> LocalDog:
        """Samples for all scales from `low` to `high`, in pixels of the series.

        Parameters
        ----------
        series : DogSeries
            `low` may lie below its blur; what that amplifies is in its coefficients already.
        low, high : float
            Range of scales, pixels.
        """
        wanted = []
        own = series.blur**2
        sharpened = series if (own - low**2) * math.pi**2 > MOST_AMPLIFIED else None
        if sharpened:
            low = series.blur
        distance = 1 / _FINEST
        # On this distance, samples may serve from a variance of so many squared distances on.
        step = 2 * _ALIASES / math.pi**2
        if low**2 - own < step * distance**2:
            tau = _ALIASES / (12 * math.pi**2)
            wanted.append((distance, low**2 - tau, low))
        else:
            distance = math.sqrt((low**2 - own) / step) / _COARSER
        while True:
            distance *= _COARSER
            least = math.sqrt(own + step * distance**2)
            if least > series.kappa * high:
                break
            wanted.append((distance, own + step * distance**2 / 2, least))
        levels = tuple(_level(series, *each) for each in wanted)
        seen = (series.shape, series.blur, series.kappa, series.contrast)
        return cls(levels, *seen, sharpened)

    def jets(self, sigma: Array, y: Array, x: Array, within_slices: bool = False) -> Jets:
        """Value, gradient and Hessian at scattered points, see `DogSeries.jets`.

        Parameters
        ----------
        sigma, y, x : ndarray, shape (n,)
            Scales in the range that samples were made for, and positions in pixels.
        within_slices : bool
            Leave out the derivatives along scale, which are then 0.

        Returns
        -------
        Jets
            As from the full sums, up to some 1e-14 of the contrast.

        Examples
        --------
        >>> noise = np.random.default_rng(1).standard_normal((40, 50))
        >>> series = DogSeries.of_image(noise, 0.5, 1.26)
        >>> at = np.array([1.1, 1.7, 2.2]), np.array([0.3, 20.0, 39.0]), np.array([7.0, 49.4, 30.0])
        >>> local, full = LocalDog.of_series(series, 1.1, 2.2).jets(*at), series.jets(*at)
        >>> bool(np.abs(local.hessian - full.hessian).max() < 1e-12)
        True
        """
        sigma = np.asarray(sigma, dtype=np.float64)
        if self.sharpened is not None and (below := sigma < self.blur).any():
            n = sigma.size
            jets = Jets(np.empty(n), np.empty((n, 3)), np.empty((n, 3, 3)))
            at = np.stack([sigma, y, x])
            for series, part in ((self.sharpened, below), (self, ~below)):
                jets.put(part, series.jets(at[0, part], at[1, part], at[2, part], within_slices))
            return jets
        n = sigma.size
        moments = np.zeros((2, n, len(FOURTH)))
        for number, ratio in enumerate((self.kappa, 1.0)):
            s = ratio * sigma
            which = np.searchsorted([level.least for level in self.levels[1:]], s, side="right")
            for k, level in enumerate(self.levels):
                rows = np.flatnonzero(which == k)
                variance = s[rows] ** 2 - level.variance
                reach = _REACH * np.sqrt(variance)
                moments[number, rows] = _sums(
                    level.samples,
                    level.distance[0],
                    level.distance[1],
                    y[rows],
                    x[rows],
                    variance,
                    reach,
                    2 if within_slices else 4,
                )
        upper, lower = (dict(zip(FOURTH, each.T, strict=True)) for each in moments)
        return jets_of(upper, lower, sigma, self.kappa, within_slices)


def _level(series: DogSeries, distance: float, variance: float, least: float) -> Level:
    """Samples of a series at about a distance, blurred to a variance."""
    from scipy import fft

    shape = series.shape
    n = [fft.next_fast_len(math.ceil(m / distance), True) for m in shape]
    more = variance - series.blur**2
    samples = cosine_series.sampled(series.coefficients, shape, (n[0], n[1]), more)
    return Level(samples, (shape[0] / n[0], shape[1] / n[1]), variance, least)


@njit(cache=True, nogil=True)
def _kernel(position, distance, n, variance, reach, highest, rows, index):
    """Write a Gaussian and its derivatives at the samples around a position of one axis.

    Parameters
    ----------
    position, distance : float
        Pixels; sample i lies at ``(i + 1/2) * distance - 1/2``.
    n : int
        Samples of the axis; beyond its ends lie mirror images.
    variance, reach : float
        Of the Gaussian, and where it ends.
    highest : int
        Order of the last derivative.
    rows : ndarray, shape (5, most)
    index : ndarray of int, shape (most,)
        Both are written to.

    Returns
    -------
    first, count : int
        First sample, before it is mirrored, and how many.
    """
    place = (position + 0.5) / distance - 0.5
    first = int(math.ceil(place - reach / distance))
    count = int(math.floor(place + reach / distance)) - first + 1
    scale = distance / math.sqrt(2 * math.pi * variance)
    for k in range(count):
        t = (place - (first + k)) * distance
        u = -t / variance
        g = scale * math.exp(-0.5 * t * t / variance)
        rows[0, k] = g
        rows[1, k] = u * g
        for order in range(2, highest + 1):
            # Hermite's recursion.
            rows[order, k] = u * rows[order - 1, k] - (order - 1) / variance * rows[order - 2, k]
        i = (first + k) % (2 * n)
        index[k] = i if i < n else 2 * n - 1 - i
    return first, count


@njit(cache=True, nogil=True, fastmath={"reassoc", "contract"})
def _five(line, columns, out):
    """Write five sums of products with a row of samples."""
    c0, c1, c2, c3, c4 = columns[0], columns[1], columns[2], columns[3], columns[4]
    a0 = a1 = a2 = a3 = a4 = 0.0
    for k in range(line.size):
        value = line[k]
        a0 += value * c0[k]
        a1 += value * c1[k]
        a2 += value * c2[k]
        a3 += value * c3[k]
        a4 += value * c4[k]
    out[0], out[1], out[2], out[3], out[4] = a0, a1, a2, a3, a4


@njit(cache=True, nogil=True, fastmath={"reassoc", "contract"})
def _three(line, columns, out):
    """As `_five`, for derivatives up to the second."""
    c0, c1, c2 = columns[0], columns[1], columns[2]
    a0 = a1 = a2 = 0.0
    for k in range(line.size):
        value = line[k]
        a0 += value * c0[k]
        a1 += value * c1[k]
        a2 += value * c2[k]
    out[0], out[1], out[2] = a0, a1, a2


@njit(cache=True, nogil=True)
def _sums(samples, distance_y, distance_x, y, x, variance, reach, highest):  # noqa: PLR0913
    """Derivatives of a blurred image at points, shape (n, 13): see `FOURTH`."""
    height, width = samples.shape
    n = y.size
    out = np.zeros((n, 13))
    largest = 0.0
    for p in range(n):
        largest = max(largest, reach[p])
    most = int(2 * largest / min(distance_y, distance_x)) + 4
    rows, columns = np.zeros((5, most)), np.zeros((5, most))
    at_y, at_x = np.zeros(most, dtype=np.int64), np.zeros(most, dtype=np.int64)
    line, five = np.zeros(most), np.zeros(5)
    for p in range(n):
        _, n_y = _kernel(y[p], distance_y, height, variance[p], reach[p], highest, rows, at_y)
        left, n_x = _kernel(x[p], distance_x, width, variance[p], reach[p], highest, columns, at_x)
        inside = left >= 0 and left + n_x <= width
        v = out[p]
        for r in range(n_y):
            source = samples[at_y[r]]
            if inside:
                part = source[left : left + n_x]
            else:
                for k in range(n_x):
                    line[k] = source[at_x[k]]
                part = line[:n_x]
            if highest == 2:
                _three(part, columns[:, :n_x], five)
            else:
                _five(part, columns[:, :n_x], five)
            r0, r1, r2 = rows[0, r], rows[1, r], rows[2, r]
            v[0] += r0 * five[0]
            v[1] += r1 * five[0]
            v[2] += r0 * five[1]
            v[3] += r2 * five[0]
            v[4] += r1 * five[1]
            v[5] += r0 * five[2]
            if highest > 2:
                r3, r4 = rows[3, r], rows[4, r]
                v[6] += r3 * five[0]
                v[7] += r1 * five[2]
                v[8] += r2 * five[1]
                v[9] += r0 * five[3]
                v[10] += r4 * five[0]
                v[11] += r2 * five[2]
                v[12] += r0 * five[4]
    return out
