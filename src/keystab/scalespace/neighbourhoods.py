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
def _cosine_cubes(source, y_basis, x_basis, y_gains, x_gains, lower, upper, s, cubes):  # noqa: PLR0913
    n_y, n_x = source.shape
    # Rows of all six Gaussians of a cube: upper and lower of three slices, three rows each.
    rows = np.empty((18, n_y))
    for k in range(s.size):
        for a in range(3):
            for pair in range(2):
                blur = upper[s[k] - 1 + a] if pair == 0 else lower[s[k] - 1 + a]
                for b in range(3):
                    for i in range(n_y):
                        rows[6 * a + 3 * pair + b, i] = y_basis[k, b, i] * y_gains[blur, i]
        lines = np.dot(rows, source)
        for a in range(3):
            for pair in range(2):
                blur = upper[s[k] - 1 + a] if pair == 0 else lower[s[k] - 1 + a]
                for b in range(3):
                    for j in range(n_x):
                        lines[6 * a + 3 * pair + b, j] *= x_gains[blur, j]
        values = np.dot(lines, x_basis[k].T)
        for a in range(3):
            for b in range(3):
                for e in range(3):
                    cubes[k, a, b, e] = values[6 * a + b, e] - values[6 * a + 3 + b, e]


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
