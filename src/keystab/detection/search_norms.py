r"""How far samples along one axis of a spline scale-space are from polynomials between nodes.

A fine sample is a sum of kernel taps and samples of a cubic spline, and the
spline a sum of its kinks, :math:`\sum_k \Delta^4 C_k |x - k|^3 / 12`, up to a cubic polynomial. A
functional is therefore a sum :math:`\sum_k F(x - k) \, \Delta^4 C_k`, with F the same functional of
:math:`|x|^3 / 12` convolved with the taps, a cubic polynomial between fine samples. The sum of
:math:`|F(x - k)|` over all k has the period of one pixel; it is evaluated at some phases, and
between these it gains at most half their distance times

.. math:: \sum_k |F'(x - k)| \le \int |F'| + V(F'),

since a number is at most the mean over an interval plus the variation V in it. What is farther than
some distance is bounded by integral and variation of F in the same way. At its ends the grid is
mirrored half a sample beyond the last: the kinks have mirror images, a second comb beside the
first, and the spline itself has one more kink at the mirror, :math:`a_1 |z| + a_3 |z|^3`, from its
first and third derivatives there.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from keystab.detection.search_functionals import functionals
from keystab.detection.search_nodes import LocalAxis
from keystab.detection.search_records import BLOCK, STENCIL

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

# Largest sum of absolute derivatives of cubic B-splines, per pixel, and how far they reach.
STEEPEST, REACH = 1.5, 2.0

# Phases of a pixel at which sums are evaluated.
_PHASES = 32


class Mixes(NamedTuple):
    """Gaussians and differences of Gaussians that bounds are made of.

    First all Gaussians, then the two of each slice, then those of adjacent slices: upper ones,
    then lower ones.

    Attributes
    ----------
    plus, minus : ndarray of int, shape (n,)
        Blurs; -1 for none.
    n_slices : int
    """

    plus: Indices
    minus: Indices
    n_slices: int

    @classmethod
    def of(cls, n_blurs: int, lower: Indices, upper: Indices) -> Mixes:
        """All that the slices of a scale-space need."""
        plus = np.concatenate([np.arange(n_blurs), upper, upper[1:], lower[1:]])
        minus = np.concatenate([np.full(n_blurs, -1), lower, upper[:-1], lower[:-1]])
        return cls(plus, minus, lower.size)

    @property
    def without_steps(self) -> int:
        """How many there are before those of adjacent slices."""
        return self.plus.size - 2 * (self.n_slices - 1)

    def taps(self, each: Array) -> Array:
        """Kernels of all, from those of the blurs."""
        return each[self.plus] - np.where(self.minus[:, None] < 0, 0.0, each[self.minus])


class Norms(NamedTuple):
    """Norms of rows of an axis, in all and beyond growing distances.

    Axis 0 has what `Mixes` has; axis 1 what lies anywhere, then what lies beyond each radius.

    Attributes
    ----------
    row : ndarray
        Sums of absolute entries of a row of a sample.
    by_value, by_step, by_wide, by_wide_step : ndarray
        The same of what polynomials make of the rows of the nodes.
    value, step, wide, wide_step : ndarray
        Sums of |F| of the functionals of that name.
    """

    row: Array
    by_value: Array
    by_step: Array
    by_wide: Array
    by_wide_step: Array
    value: Array
    step: Array
    wide: Array
    wide_step: Array


class Ends(NamedTuple):
    """What functionals make of |z| and |z|^3 at the ends of an axis, shape (2, n, n_blocks)."""

    value: Array
    step: Array
    wide: Array
    wide_step: Array


def spline_norms(axis: LocalAxis, delta: float, p: int, mixes: Mixes, radii: Array) -> Norms:
    """Norms of a spline axis.

    Parameters
    ----------
    axis : LocalAxis
    delta : float
        Distance of samples of the first octave, in pixels.
    p : int
        Samples from one node to the next.
    mixes : Mixes
    radii : ndarray, shape (n_rings,)
        Distances in pixels.
    """
    parts, taps, stride = functionals(p), axis.rows.taps, axis.stride
    between = p * stride  # samples of the first octave from node to node
    spacing = between * delta
    mixed = mixes.taps(taps)
    zeros = np.zeros((len(mixed), between))
    later = np.abs(np.hstack([mixed, zeros]) - np.hstack([zeros, mixed]))
    distance = np.abs(np.arange(-(taps.shape[1] // 2), taps.shape[1] // 2 + 1)) * delta
    sums = _Tails(np.abs(mixed), distance)
    step_distance = np.abs(np.arange(later.shape[1]) - (later.shape[1] - 1) / 2) * delta
    step_sums = _Tails(later, step_distance - spacing / 2)
    # Between one sample and the next a row of splines changes little, however small the blur.
    steepest = STEEPEST * spacing * sums.beyond(0.0)
    place = np.arange(1 - STENCIL // 2, STENCIL // 2 + 1)
    each = parts.nodes
    by = []
    for weights, nodes, tails, most in (
        (each[0], place[1:-1], sums, None),
        (each[1], place[1:-2], step_sums, steepest),
        (each[2], place, sums, None),
        (each[3], place[:-1], step_sums, steepest),
    ):
        total = tails.beyond(0.0) if most is None else np.minimum(tails.beyond(0.0), most)
        beyond = [weights.sum(axis=1).max() * total]
        for radius in radii:
            far = np.zeros(len(mixed))
            for weight, node in zip(weights.max(axis=0), nodes, strict=True):
                reach = REACH + abs(node) * spacing + (spacing if tails is step_sums else 0.0)
                far += weight * tails.beyond(radius - reach)
            beyond.append(np.minimum(far, beyond[0]) if most is None else far)
        by.append(np.stack(beyond, axis=1))
    row = [sums.beyond(0.0)]
    row += [sums.beyond(radius - REACH - spacing * (1 + 1 / p)) for radius in radii]
    responses = []
    for weights, n in (
        (parts.value, mixes.plus.size),
        (parts.step, mixes.without_steps),
        (parts.wide, mixes.plus.size),
        (parts.wide_step, mixes.without_steps),
    ):
        found = np.zeros((n, radii.size + 1))
        _responses(
            weights,
            parts.begin,
            stride,
            delta,
            taps,
            mixes.plus,
            mixes.minus,
            radii,
            between,
            found,
        )
        responses.append(found)
    return Norms(np.stack(row, axis=1), *by, *responses)


class _Tails:
    """Sums of sizes beyond a distance."""

    def __init__(self, sizes: Array, distance: Array) -> None:
        order = np.argsort(distance, kind="stable")
        self.distance = distance[order]
        self.sums = np.zeros((len(sizes), distance.size + 1))
        self.sums[:, :-1] = np.cumsum(sizes[:, order[::-1]], axis=1)[:, ::-1]

    def beyond(self, radius: float) -> Array:
        """Of every row, the sum of what is at least this far away."""
        return self.sums[:, np.searchsorted(self.distance, radius)]


def spline_ends(axis: LocalAxis, delta: float, p: int, mixes: Mixes, n_blocks: int) -> Ends:
    """What functionals make of the mirror images at the ends of a spline axis."""
    if not axis.mirrors:
        return Ends(*[np.zeros((2, mixes.plus.size, n_blocks))] * 4)
    parts, m, between = functionals(p), axis.rows.n_samples, p * axis.stride
    start = between * np.arange(BLOCK * n_blocks)
    ends = np.concatenate([start + 0.5, m - 0.5 - start - between]).reshape(2, n_blocks, BLOCK)
    made = []
    for weights in (parts.value, parts.step, parts.wide, parts.wide_step):
        edge = np.zeros((2, mixes.plus.size, n_blocks))
        _ends(
            weights, parts.begin, axis.stride, delta, axis.rows.taps, mixes.plus, mixes.minus,
            between, ends, edge,
        )  # fmt: skip
        made.append(edge)
    return Ends(*made)


@njit(cache=True, nogil=True, fastmath={"reassoc", "contract", "nnan", "nsz"})
def _convolve(taps, values, out):
    """Write the convolution of two rows."""
    for x in range(out.size):
        out[x] = 0.0
    for k in range(values.size):
        value, o = values[k], out[k:]
        for x in range(taps.size):
            o[x] += value * taps[x]


@njit(cache=True, nogil=True, fastmath={"reassoc", "contract", "nnan", "nsz"})
def _integral_and_variation(f, slope, g, slope_g, begin, end, step):
    """Integral and variation of f - g, cubic polynomials between samples `begin` .. `end`.

    And the variation of its derivative, in samples.
    """
    integral = variation = turning = 0.0
    third = step / 3
    for x in range(begin, end):
        b0, b3 = f[x] - g[x], f[x + 1] - g[x + 1]
        b1 = b0 + third * (slope[x] - slope_g[x])
        b2 = b3 - third * (slope[x + 1] - slope_g[x + 1])
        integral += abs(b0) + abs(b1) + abs(b2) + abs(b3)
        variation += abs(b1 - b0) + abs(b2 - b1) + abs(b3 - b2)
        turning += abs(b2 - 2 * b1 + b0) + abs(b3 - 2 * b2 + b1)
    return step / 4 * integral, variation, 3 * turning


@njit(cache=True, nogil=True, fastmath={"reassoc", "contract", "nnan", "nsz"})
def _distance(one, other):
    """Sum of absolute differences of two rows."""
    total = 0.0
    for x in range(one.size):
        total += abs(one[x] - other[x])
    return total


@njit(cache=True, nogil=True)
def _responses(weights, begin, stride, delta, taps, plus, minus, radii, between, sums):  # noqa: PLR0913
    """Write sums of |F| over the entries of the source: all, and beyond each radius.

    A functional and its mirror image differ by where the cell begins: what is beyond a distance of
    one is so of the other, a node further.
    """
    n_blurs, n_taps = taps.shape
    size = weights.shape[1]
    last = stride * (begin + size - 1)
    kink, kink_slope = np.empty(stride * (size - 1) + 3), np.empty(stride * (size - 1) + 3)
    f = np.zeros((n_blurs + 1, n_taps + kink.size - 1))
    slope = np.zeros_like(f)
    # Sample number `origin` of the responses is the first one of the cell.
    origin = last + 1 + n_taps // 2
    n_places = int((f.shape[1] - 1) * delta) + 1
    at_phase = np.zeros((n_blurs + 1, n_places))
    gain, largest = np.zeros(sums.shape[0]), np.zeros(sums.shape[0])
    for w in weights:
        for x in range(kink.size):
            value = derivative = 0.0
            for k in range(size):
                z = (x - last - 1 + stride * (begin + k)) * delta
                value += w[k] * abs(z) ** 3
                derivative += w[k] * z * abs(z)
            kink[x], kink_slope[x] = value / 12, derivative / 4
        for blur in range(n_blurs):
            _convolve(taps[blur], kink, f[blur])
            _convolve(taps[blur], kink_slope, slope[blur])
        for q in range(sums.shape[0]):
            a, b = plus[q], minus[q]  # the last row, -1, is zero
            integral = variation = turning = 0.0
            left, right = 0, f.shape[1] - 1
            for k in range(radii.size, -1, -1):
                inner = max(int(radii[k - 1] / delta) - between - 1, 0) if k > 0 else 0
                low, high = max(origin - inner, left), min(origin + inner, right)
                for first, end in ((left, low), (high, right)):
                    if first < end:
                        i, v, t = _integral_and_variation(
                            f[a], slope[a], f[b], slope[b], first, end, delta
                        )
                        integral, variation, turning = integral + i, variation + v, turning + t
                left, right = low, high
                if k > 0:
                    sums[q, k] = max(sums[q, k], integral + variation)
            gain[q] = (variation + turning / delta) / (2 * _PHASES)
            largest[q] = 0.0
        for phase in range(_PHASES):
            for place in range(n_places):
                x = (place + (phase + 0.5) / _PHASES) / delta
                i = min(int(x), f.shape[1] - 2)
                t = x - i
                h1, h2, h3 = t * t * (3 - 2 * t), t * (1 - t) * (1 - t), t * t * (1 - t)
                for blur in range(n_blurs):
                    value = (1 - h1) * f[blur, i] + h1 * f[blur, i + 1]
                    value += delta * (h2 * slope[blur, i] - h3 * slope[blur, i + 1])
                    at_phase[blur, place] = value
            for q in range(sums.shape[0]):
                largest[q] = max(largest[q], _distance(at_phase[plus[q]], at_phase[minus[q]]))
        for q in range(sums.shape[0]):
            sums[q, 0] = max(sums[q, 0], largest[q] + gain[q])


@njit(cache=True, nogil=True)
def _ends(weights, begin, stride, delta, taps, plus, minus, between, ends, edge):  # noqa: PLR0913
    """Write what functionals make of the mirror images at the ends of an axis.

    Both ends are seen by a functional and by its mirror image.
    """
    n_blurs, n_taps = taps.shape
    middle = n_taps // 2
    low, high = stride * begin, stride * (begin + weights.shape[1] - 1)
    one, three = np.empty(high - low + 1), np.empty(high - low + 1)
    made = np.zeros((2, n_blurs + 1))
    for w in weights:
        # The functional seen from every half sample; it vanishes where the mirror is not among
        # its samples.
        for x in range(one.size):
            one[x] = three[x] = 0.0
            for k in range(w.size):
                z = abs(x - high + 0.5 + stride * (begin + k)) * delta
                one[x] += w[k] * z
                three[x] += w[k] * z**3
        for side in range(2):
            for v in range(ends.shape[1]):
                for i in range(ends.shape[2]):
                    for at in (ends[side, v, i], -ends[side, v, i] - between):
                        # Taps j for which at - j lies between -high and -low.
                        first = int(np.floor(at)) + low
                        begin_tap = max(first, -middle)
                        end_tap = min(first + one.size - 1, middle) + 1
                        if begin_tap >= end_tap:
                            continue
                        for blur in range(n_blurs):
                            total_one = total_three = 0.0
                            for j in range(begin_tap, end_tap):
                                tap, x = taps[blur, j + middle], first + one.size - 1 - j
                                total_one += tap * one[x]
                                total_three += tap * three[x]
                            made[0, blur], made[1, blur] = total_one, total_three
                        for kind in range(2):
                            for q in range(edge.shape[1]):
                                value = abs(made[kind, plus[q]] - made[kind, minus[q]])
                                edge[kind, q, v] = max(edge[kind, q, v], value)
