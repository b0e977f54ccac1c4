"""Cubes of 3 x 3 x 3 samples of a scale-space, evaluated one by one.

The refinement of an extremum looks at neighbourhoods that may lie anywhere. Each is a sum over the
few source coefficients in reach, so that none needs a tile, and its digits never depend on how the
scale-space was cut up.
"""

from __future__ import annotations

import numpy as np
import threadpoolctl
from numba import njit

from keystab.scalespace.axis import AxisOperator
from keystab.scalespace.cosine_axis import CosineAxis
from keystab.scalespace.spline_axis import SplineAxis, fill_rows

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
    cubes = np.zeros((s.size, 3, 3, 3))
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
    with threadpoolctl.threadpool_limits(1):
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
    for k in range(s.size):
        top, left = (row[k] - 1) * stride, (column[k] - 1) * stride
        for a in range(3):
            for pair in range(2):
                blur = upper[s[k] - 1 + a] if pair == 0 else lower[s[k] - 1 + a]
                y_first, height = fill_rows(y_axis, blur, top, stride, y_rows)
                x_first, width = fill_rows(x_axis, blur, left, stride, x_rows)
                _add_products(
                    source[y_first : y_first + height, x_first : x_first + width],
                    y_rows[:, :height],
                    x_rows[:, :width],
                    1.0 if pair == 0 else -1.0,
                    cubes[k, a],
                )


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
def _add_products(source, y_rows, x_rows, sign, out):
    """Add ``sign * y_rows @ source @ x_rows.T`` (3 x 3) to `out`, in a fixed order of sums."""
    n_y, n_x = source.shape
    lines = np.zeros((3, n_x))
    for i in range(n_y):
        before, here, after = y_rows[0, i], y_rows[1, i], y_rows[2, i]
        for j in range(n_x):
            value = source[i, j]
            lines[0, j] += before * value
            lines[1, j] += here * value
            lines[2, j] += after * value
    for b in range(3):
        for e in range(3):
            total = 0.0
            for j in range(n_x):
                total += lines[b, j] * x_rows[e, j]
            out[b, e] += sign * total
