"""Cubes of 3 x 3 x 3 samples of a scale-space, evaluated one by one.

The refinement of an extremum looks at neighbourhoods that may lie anywhere. Each is a sum over the
few source coefficients in reach, so that none needs a tile, and its digits never depend on how the
scale-space was cut up.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from keystab.scalespace.axis import AxisOperator
from keystab.scalespace.cosine_axis import CosineAxis
from keystab.scalespace.spline_axis import SplineAxis, fill_rows
from keystab.utils.one_thread import one_thread

# Candidates handled at once in cosine mode: bounds the memory of their cosines.
_BATCH = 256


def spline_neighbourhoods(
    source: np.ndarray,
    axes: tuple[AxisOperator, AxisOperator],
    lower: np.ndarray,
    upper: np.ndarray,
    s: np.ndarray,
    row: np.ndarray,
    column: np.ndarray,
) -> np.ndarray:
    """Cubes around samples of a spline scale-space, shape (n, 3, 3, 3)."""
    y_axis, x_axis = axes
    assert isinstance(y_axis, SplineAxis) and isinstance(x_axis, SplineAxis)
    cubes = np.empty((s.size, 3, 3, 3))
    _spline_cubes(
        source,
        y_axis.rows,
        x_axis.rows,
        y_axis.stride,
        lower,
        upper,
        s,
        row,
        column,
        cubes,
    )
    return cubes


def cosine_neighbourhoods(
    source: np.ndarray,
    axes: tuple[AxisOperator, AxisOperator],
    lower: np.ndarray,
    upper: np.ndarray,
    s: np.ndarray,
    row: np.ndarray,
    column: np.ndarray,
    *,
    tolerance: float,
) -> np.ndarray:
    """Cubes around samples of a cosine scale-space, shape (n, 3, 3, 3)."""
    y_axis, x_axis = axes
    assert isinstance(y_axis, CosineAxis) and isinstance(x_axis, CosineAxis)
    cubes = np.zeros((s.size, 3, 3, 3))
    around = np.arange(-1, 2)
    # One thread: digits must not depend on the cores, and the products are too small to share.
    with one_thread():
        for start in range(0, s.size, _BATCH):
            part = slice(start, start + _BATCH)
            _cosine_cubes(
                source,
                y_axis.basis(row[part, None] + around),
                x_axis.basis(column[part, None] + around),
                y_axis.gains,
                x_axis.gains,
                lower,
                upper,
                s[part],
                tolerance,
                cubes[part],
            )
    return cubes


@njit(cache=True, nogil=True)
def _spline_cubes(source, y_axis, x_axis, stride, lower, upper, s, row, column, cubes):  # noqa: PLR0913
    y_rows = np.empty((3, source.shape[0]))
    x_rows = np.empty((3, source.shape[1]))
    lines = np.empty((3, source.shape[1]))
    blurs, values = np.empty(6, dtype=np.int64), np.empty((6, 3, 3))
    for k in range(s.size):
        top, left = (row[k] - 1) * stride, (column[k] - 1) * stride
        for a in range(3):
            blurs[2 * a], blurs[2 * a + 1] = lower[s[k] - 1 + a], upper[s[k] - 1 + a]
        for n in range(6):
            blur, known = blurs[n], 0  # the upper Gaussian of a slice may be the lower of another
            while blurs[known] != blur:
                known += 1
            if known < n:
                for b in range(3):
                    for c in range(3):
                        values[n, b, c] = values[known, b, c]
                continue
            y_first, height = fill_rows(y_axis, blur, top, stride, y_rows)
            x_first, width = fill_rows(x_axis, blur, left, stride, x_rows)
            _set_products(
                source[y_first : y_first + height, x_first : x_first + width],
                y_rows[:, :height],
                x_rows[:, :width],
                lines,
                values[n],
            )
        for a in range(3):
            for b in range(3):
                for c in range(3):
                    cubes[k, a, b, c] = values[2 * a + 1, b, c] - values[2 * a, b, c]


@njit(cache=True, nogil=True)
def _cosine_cubes(  # noqa: PLR0913
    source, y_basis, x_basis, y_gains, x_gains, lower, upper, s, tolerance, cubes
):
    """Write cubes, the slice in the middle first; of those of no extremum, perhaps no more."""
    n_y, n_x = source.shape
    rows, lines = np.empty((n_y, 6)), np.empty((6, n_x))
    for k in range(s.size):
        cubes[k] = np.nan
        for a in (1, 0, 2):
            blurs = upper[s[k] - 1 + a], lower[s[k] - 1 + a]
            for pair in range(2):
                gain = y_gains[blurs[pair]]
                for b in range(3):
                    for i in range(n_y):
                        rows[i, 3 * pair + b] = y_basis[k, b, i] * gain[i]
            _six_products(rows, source, lines)
            for b in range(3):
                for c in range(3):
                    total = 0.0
                    for pair in range(2):
                        gain, line, wave = x_gains[blurs[pair]], lines[3 * pair + b], x_basis[k, c]
                        total = _sum_of_three(line, gain, wave) - total
                    cubes[k, a, b, c] = -total
            if not _may_exceed(cubes[k, a], cubes[k, 1, 1, 1], a == 1, tolerance):
                break


@njit(cache=True, nogil=True)
def _may_exceed(values, middle, own, tolerance):
    """Whether a sample differs from those of a slice by more than the tolerance, all one way."""
    above, below = True, True
    for b in range(3):
        for c in range(3):
            if own and b == 1 and c == 1:
                continue
            above &= middle - values[b, c] > tolerance
            below &= middle - values[b, c] < -tolerance
    return above or below or tolerance < 0


@njit(cache=True, nogil=True, fastmath={"contract", "reassoc"})
def _sum_of_three(one, other, third):
    total = 0.0
    for j in range(one.size):
        total += one[j] * other[j] * third[j]
    return total


@njit(cache=True, nogil=True, fastmath={"contract"})
def _six_products(rows, source, lines):
    """Write the product of six rows, side by side, and the source, in a fixed order of sums."""
    n_y, n = source.shape
    l0, l1, l2, l3, l4, l5 = lines[0], lines[1], lines[2], lines[3], lines[4], lines[5]
    for j in range(n):
        l0[j] = l1[j] = l2[j] = l3[j] = l4[j] = l5[j] = 0.0
    i = 0
    while i + 4 <= n_y:
        s, t, u, v = source[i], source[i + 1], source[i + 2], source[i + 3]
        a, b, c, d = rows[i], rows[i + 1], rows[i + 2], rows[i + 3]
        a0, a1, a2, a3, a4, a5 = a[0], a[1], a[2], a[3], a[4], a[5]
        b0, b1, b2, b3, b4, b5 = b[0], b[1], b[2], b[3], b[4], b[5]
        c0, c1, c2, c3, c4, c5 = c[0], c[1], c[2], c[3], c[4], c[5]
        d0, d1, d2, d3, d4, d5 = d[0], d[1], d[2], d[3], d[4], d[5]
        for j in range(n):
            x, y, z, w = s[j], t[j], u[j], v[j]
            l0[j] = l0[j] + a0 * x + b0 * y + c0 * z + d0 * w
            l1[j] = l1[j] + a1 * x + b1 * y + c1 * z + d1 * w
            l2[j] = l2[j] + a2 * x + b2 * y + c2 * z + d2 * w
            l3[j] = l3[j] + a3 * x + b3 * y + c3 * z + d3 * w
            l4[j] = l4[j] + a4 * x + b4 * y + c4 * z + d4 * w
            l5[j] = l5[j] + a5 * x + b5 * y + c5 * z + d5 * w
        i += 4
    while i < n_y:
        for r in range(6):
            weight = rows[i, r]
            for j in range(n):
                lines[r, j] += weight * source[i, j]
        i += 1


@njit(cache=True, nogil=True, fastmath={"contract"})
def _set_products(source, y_rows, x_rows, lines, out):
    """Write ``y_rows @ source @ x_rows.T`` (3 x 3), in a fixed order of sums.

    `lines` is work space, shape (3, n) with at least as many columns as the source.
    """
    n_y, n_x = source.shape
    above, here, below = lines[0, :n_x], lines[1, :n_x], lines[2, :n_x]
    for j in range(n_x):
        above[j] = here[j] = below[j] = 0.0
    i = 0
    while i + 4 <= n_y:  # four rows at a time are added one after the other
        s, t, u, v = source[i], source[i + 1], source[i + 2], source[i + 3]
        y = y_rows[:, i : i + 4]
        a0, a1, a2, a3 = y[0, 0], y[0, 1], y[0, 2], y[0, 3]
        b0, b1, b2, b3 = y[1, 0], y[1, 1], y[1, 2], y[1, 3]
        c0, c1, c2, c3 = y[2, 0], y[2, 1], y[2, 2], y[2, 3]
        for j in range(n_x):
            above[j] = above[j] + a0 * s[j] + a1 * t[j] + a2 * u[j] + a3 * v[j]
            here[j] = here[j] + b0 * s[j] + b1 * t[j] + b2 * u[j] + b3 * v[j]
            below[j] = below[j] + c0 * s[j] + c1 * t[j] + c2 * u[j] + c3 * v[j]
        i += 4
    while i < n_y:
        s = source[i]
        a0, b0, c0 = y_rows[0, i], y_rows[1, i], y_rows[2, i]
        for j in range(n_x):
            above[j] += a0 * s[j]
            here[j] += b0 * s[j]
            below[j] += c0 * s[j]
        i += 1
    left, middle, right = x_rows[0], x_rows[1], x_rows[2]
    a0 = a1 = a2 = b0 = b1 = b2 = c0 = c1 = c2 = 0.0
    for j in range(n_x):
        x, y, z = left[j], middle[j], right[j]
        a, b, c = above[j], here[j], below[j]
        a0, a1, a2 = a0 + a * x, a1 + a * y, a2 + a * z
        b0, b1, b2 = b0 + b * x, b1 + b * y, b2 + b * z
        c0, c1, c2 = c0 + c * x, c1 + c * y, c2 + c * z
    out[0, 0] = a0
    out[0, 1] = a1
    out[0, 2] = a2
    out[1, 0] = b0
    out[1, 1] = b1
    out[1, 2] = b2
    out[2, 0] = c0
    out[2, 1] = c1
    out[2, 2] = c2
