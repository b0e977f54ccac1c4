"""Extrema of a quartic in (ln sigma, y/sigma, x/sigma), and those of its samples on a grid.

A quartic is given by its jet: its 35 derivatives at the origin, in the order of
`keystab.prediction.noise_covariance.ORDERS`. All loops here are compiled:
`keystab.prediction.survival` climbs some hundred quartics for each keypoint.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

__all__ = ["RADIUS", "climb", "slopes", "tops"]

RADIUS = 0.5
"""How far a returning extremum is at most, in (ln sigma, y/sigma, x/sigma)."""

_FACTORIALS = (1, 1, 2, 6, 24)


@njit(cache=True, nogil=True)
def climb(jet, sign, grid, lattice, place, work, samples):  # noqa: PLR0913
    """Climb to the extremum of a quartic nearest to the origin, and say whether it is near."""
    place[:] = 0.0
    along, third, pair = work[0], work[1], work[2, :6]  # by order: 3, 3 and 2
    h, g, step = work[3:6, :3], work[6, :3], work[7, :3]
    radius2 = RADIUS * RADIUS
    for _ in range(25):
        slopes(jet, -sign, place, along, third, pair, g, h)  # of -s w, to be minimised
        shift = 0.0
        size = abs(h[0, 0]) + abs(h[1, 1]) + abs(h[2, 2]) + 1e-300
        settled, saddle = True, False
        if not _solved(h, shift, g, step):
            settled = _stands_out(h, grid) and _stationary(h, g, step)
            saddle = settled
            while not settled and not _solved(h, shift, g, step):
                shift = max(2.0 * shift, 0.05 * size)
        length = math.sqrt(step[0] ** 2 + step[1] ** 2 + step[2] ** 2)
        factor = min(1.0, 0.2 / length) if length > 0 else 1.0
        far = 0.0
        for i in range(3):
            place[i] -= factor * step[i]
            far += place[i] ** 2
        if far > 2.25 * radius2:
            return False
        if settled and length < 1e-3:
            if saddle and not tops(jet, -sign, place, grid, lattice, samples):
                return False
            return far < radius2
    return False


@njit(cache=True, nogil=True)
def _stands_out(h, grid):
    """Whether the curvature is that of an extremum along the 13 directions of the grid."""
    for code in range(14, 27):  # one of each pair of opposite neighbours
        a = (code // 9 - 1) * grid[0]
        b = (code // 3 % 3 - 1) * grid[1]
        c = (code % 3 - 1) * grid[1]
        along = h[0, 0] * a * a + h[1, 1] * b * b + h[2, 2] * c * c
        along += 2.0 * (h[0, 1] * a * b + h[0, 2] * a * c + h[1, 2] * b * c)
        if not along > 0:
            return False
    return True


@njit(cache=True, nogil=True)
def tops(jet, factor, place, grid, lattice, value):  # noqa: PLR0913
    """Whether a sample within two steps of a place is the least of its neighbours on the grid."""
    scale, row, column = (
        (np.rint(place[0] / grid[0] - lattice[0]) + lattice[0]) * grid[0],
        (np.rint(place[1] / grid[1] - lattice[1]) + lattice[1]) * grid[1],
        (np.rint(place[2] / grid[1] - lattice[2]) + lattice[2]) * grid[1],
    )
    plane, line = np.empty(15), np.empty(5)
    for i in range(7):
        _plane(jet, scale + (i - 3) * grid[0], plane)
        for j in range(7):
            _line(plane, row + (j - 3) * grid[1], line)
            for k in range(7):
                x = column + (k - 3) * grid[1]
                values = line[0] + x * (line[1] + x * (line[2] + x * (line[3] + x * line[4])))
                value[i, j, k] = factor * values
    for i in range(1, 6):
        for j in range(1, 6):
            for k in range(1, 6):
                if _is_least(value, i, j, k):
                    return True
    return False


@njit(cache=True, nogil=True)
def _is_least(value, i, j, k):
    here = value[i, j, k]
    for a in range(i - 1, i + 2):
        for b in range(j - 1, j + 2):
            for c in range(k - 1, k + 2):
                if value[a, b, c] <= here and not (a == i and b == j and c == k):
                    return False
    return True


@njit(cache=True, nogil=True)
def _plane(jet, d, out):
    """Quartic at a scale: coefficients of y^p x^q, ordered by p + q, then by q."""
    out[:] = 0.0
    power = 1.0
    for n in range(5):
        k = 0
        for j in range(5 - n):  # of p + q; derivatives of this order begin at n + j over 3
            first = (n + j) * (n + j + 1) * (n + j + 2) // 6 + j * (j + 1) // 2
            for q in range(j + 1):
                out[k] += power * jet[first + q] / (_FACTORIALS[j - q] * _FACTORIALS[q])
                k += 1
        power *= d / (n + 1)


@njit(cache=True, nogil=True)
def _line(plane, d, out):
    """Polynomial of `_plane` in a row: coefficients of x^q."""
    for q in range(5):
        out[q] = 0.0
        for j in range(4, q - 1, -1):
            out[q] = out[q] * d + plane[j * (j + 1) // 2 + q]


@njit(cache=True, nogil=True)
def _stationary(h, g, step):
    """Solve H step = g by cofactors; False where H is singular."""
    c0 = h[1, 1] * h[2, 2] - h[1, 2] * h[1, 2]
    c1 = h[0, 2] * h[1, 2] - h[0, 1] * h[2, 2]
    c2 = h[0, 1] * h[1, 2] - h[0, 2] * h[1, 1]
    determinant = h[0, 0] * c0 + h[0, 1] * c1 + h[0, 2] * c2
    if determinant == 0:
        return False
    c11 = h[0, 0] * h[2, 2] - h[0, 2] * h[0, 2]
    c12 = h[0, 1] * h[0, 2] - h[0, 0] * h[1, 2]
    c22 = h[0, 0] * h[1, 1] - h[0, 1] * h[0, 1]
    step[0] = (c0 * g[0] + c1 * g[1] + c2 * g[2]) / determinant
    step[1] = (c1 * g[0] + c11 * g[1] + c12 * g[2]) / determinant
    step[2] = (c2 * g[0] + c12 * g[1] + c22 * g[2]) / determinant
    return True


@njit(cache=True, nogil=True)
def _solved(h, shift, g, step):
    """Solve (H + shift) step = g by Cholesky's decomposition; False where H is not definite."""
    a = h[0, 0] + shift
    if not a > 0:
        return False
    l00 = math.sqrt(a)
    l10, l20 = h[1, 0] / l00, h[2, 0] / l00
    b = h[1, 1] + shift - l10 * l10
    if not b > 0:
        return False
    l11 = math.sqrt(b)
    l21 = (h[2, 1] - l20 * l10) / l11
    c = h[2, 2] + shift - l20 * l20 - l21 * l21
    if not c > 0:
        return False
    l22 = math.sqrt(c)
    u = g[0] / l00
    v = (g[1] - l10 * u) / l11
    w = (g[2] - l20 * u - l21 * v) / l22
    step[2] = w / l22
    step[1] = (v - l21 * step[2]) / l11
    step[0] = (u - l10 * step[1] - l20 * step[2]) / l00
    return True


@njit(cache=True, nogil=True)
def slopes(jet, factor, d, along, third, pair, g, h):  # noqa: PLR0913
    """Gradient and Hessian of a quartic at a displacement, times a factor."""
    _contracted(jet[20:], 3, d, along)
    # H + (T + Q d / 2) d
    for k in range(10):
        third[k] = jet[10 + k] + along[k] / 2.0
    _contracted(third, 2, d, pair)
    k = 0
    for i in range(3):
        for j in range(i, 3):
            h[i, j] = h[j, i] = factor * (jet[4 + k] + pair[k])
            k += 1
    # g + (H + (T / 2 + Q d / 6) d) d
    for k in range(10):
        third[k] = jet[10 + k] / 2.0 + along[k] / 6.0
    _contracted(third, 2, d, pair)
    for k in range(6):
        pair[k] += jet[4 + k]
    _contracted(pair, 1, d, g)
    for i in range(3):
        g[i] = factor * (jet[1 + i] + g[i])


@njit(cache=True, nogil=True, inline="always")  # its loops are unrolled then: three times as fast
def _contracted(tensor, order, d, out):
    """Symmetric tensor times a vector: a tensor of the order that is left, ordered as `ORDERS`.

    With j of its indices not the scale, those with one more index of scale, y and x lie 0, j + 1
    and j + 2 places on.
    """
    k = 0
    for j in range(order + 1):
        for _ in range(j + 1):
            out[k] = d[0] * tensor[k] + d[1] * tensor[k + j + 1] + d[2] * tensor[k + j + 2]
            k += 1
