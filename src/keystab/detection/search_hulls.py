"""Hulls of cells: between which values differences of samples lie, from few of the samples.

Of a finely sampled scale-space every p-th sample along both axes is a *node*; four nodes bound a
*cell*. Between them stands the bicubic polynomial of Hermite, with the slopes that five nodes give.
Its derivatives have the form of Bernstein: they lie between the least and the largest of their
twelve coefficients, and so do the differences of adjacent samples, which are means of derivatives.

A *pair* holds two neighbouring columns of nodes of one slice: values, slopes along x, slopes along
y and mixed derivatives of the left column, then those of the right one, `NODES` numbers each. Rows
lie side by side in memory and all distances between them are known when loops are compiled, so that
the compiler turns them into vector instructions.
"""

from __future__ import annotations

import numpy as np
from numba import njit

# Cells of a column; nodes before the first one and after the last one that they use; all nodes.
CELLS, MARGIN = 128, 4
NODES = CELLS + 2 * MARGIN

# Where the fields of a pair begin.
_A, _P, _C, _U, _B, _Q, _D, _V = (k * NODES for k in range(8))
PAIR, COLUMN = 8 * NODES, 4 * NODES

# No image that is searched gives NaN; sums may be taken in any order, the bounds allow for it.
FAST = {"contract", "reassoc", "nnan", "nsz", "arcp"}

_THIRD, _TWELFTH = np.float32(1 / 3), np.float32(1 / 12)
_THREE, _EIGHT = np.float32(3), np.float32(8)


@njit(cache=True, nogil=True, fastmath=FAST)
def advance(pair, before2, before, column, after, after2):
    """Write `column` as the right column of a pair.

    `before2` to `after2` are values of the five columns around it, shape (NODES,). The outermost
    two nodes have no slopes along y.
    """
    for i in range(NODES):
        pair[_B + i] = column[i]
        near = after[i] - before[i]
        pair[_Q + i] = (_EIGHT * near - (after2[i] - before2[i])) * _TWELFTH
    for i in range(NODES - 4):
        b, q = _B + i, _Q + i
        near = pair[b + 3] - pair[b + 1]
        pair[_D + 2 + i] = (_EIGHT * near - (pair[b + 4] - pair[b])) * _TWELFTH
        near = pair[q + 3] - pair[q + 1]
        pair[_V + 2 + i] = (_EIGHT * near - (pair[q + 4] - pair[q])) * _TWELFTH


@njit(cache=True, nogil=True, fastmath=FAST)
def may_turn(pair, least, alive):
    """Mark the cells in which samples may both rise and fall, along y and along x.

    Parameters
    ----------
    pair : ndarray, shape (PAIR,)
        Columns of nodes left and right of the cells.
    least : ndarray, shape (2 * CELLS,)
        Derivatives of the polynomial along y, and along x, that prove the sign of a difference.
    alive : ndarray of bool, shape (CELLS,)
        Written to.
    """
    for k in range(CELLS):
        i = k + MARGIN
        j = i + 1
        a0, a1, b0, b1 = pair[_A + i], pair[_A + j], pair[_B + i], pair[_B + j]
        p0, p1, q0, q1 = pair[_P + i], pair[_P + j], pair[_Q + i], pair[_Q + j]
        c0, c1, d0, d1 = pair[_C + i], pair[_C + j], pair[_D + i], pair[_D + j]
        u0, u1, v0, v1 = pair[_U + i], pair[_U + j], pair[_V + i], pair[_V + j]
        # Along y: both ends and the coefficient between, of the left and right side and of the
        # two columns of coefficients between them.
        left, right = _THREE * (a1 - a0), _THREE * (b1 - b0)
        m0, m1 = c0 + _THIRD * u0, c1 + _THIRD * u1
        n0, n1 = d0 - _THIRD * v0, d1 - _THIRD * v1
        s0, s1 = left - (c0 + c1), right - (d0 + d1)
        s2, s3 = left + (p1 - p0) - (m0 + m1), right - (q1 - q0) - (n0 + n1)
        low = min(min(min(c0, c1), min(d0, d1)), min(min(m0, m1), min(n0, n1)))
        low = min(low, min(min(s0, s1), min(s2, s3)))
        high = max(max(max(c0, c1), max(d0, d1)), max(max(m0, m1), max(n0, n1)))
        high = max(high, max(max(s0, s1), max(s2, s3)))
        turns = (low <= least[k]) & (high >= -least[k])
        # Along x, with rows of coefficients from top to bottom.
        top, bottom = _THREE * (b0 - a0), _THREE * (b1 - a1)
        m0, m1 = p0 + _THIRD * u0, p1 - _THIRD * u1
        n0, n1 = q0 + _THIRD * v0, q1 - _THIRD * v1
        s0, s1 = top - (p0 + q0), bottom - (p1 + q1)
        s2, s3 = top + (d0 - c0) - (m0 + n0), bottom - (d1 - c1) - (m1 + n1)
        low = min(min(min(p0, p1), min(q0, q1)), min(min(m0, m1), min(n0, n1)))
        low = min(low, min(min(s0, s1), min(s2, s3)))
        high = max(max(max(p0, p1), max(q0, q1)), max(max(m0, m1), max(n0, n1)))
        high = max(high, max(max(s0, s1), max(s2, s3)))
        alive[k] = turns & (low <= least[CELLS + k]) & (high >= -least[CELLS + k])


@njit(cache=True, nogil=True, fastmath=FAST)
def range_of_difference(finer, coarser, span):
    """Least and largest coefficient of the difference of two slices, for every cell.

    Parameters
    ----------
    finer, coarser : ndarray, shape (PAIR,)
        The same pair of columns in two slices.
    span : ndarray, shape (2 * CELLS,)
        Written to: the least ones, then the largest ones.
    """
    for k in range(CELLS):
        i = k + MARGIN
        j = i + 1
        a0, a1 = coarser[_A + i] - finer[_A + i], coarser[_A + j] - finer[_A + j]
        b0, b1 = coarser[_B + i] - finer[_B + i], coarser[_B + j] - finer[_B + j]
        c0, c1 = coarser[_C + i] - finer[_C + i], coarser[_C + j] - finer[_C + j]
        d0, d1 = coarser[_D + i] - finer[_D + i], coarser[_D + j] - finer[_D + j]
        p0, p1 = coarser[_P + i] - finer[_P + i], coarser[_P + j] - finer[_P + j]
        q0, q1 = coarser[_Q + i] - finer[_Q + i], coarser[_Q + j] - finer[_Q + j]
        u0, u1 = coarser[_U + i] - finer[_U + i], coarser[_U + j] - finer[_U + j]
        v0, v1 = coarser[_V + i] - finer[_V + i], coarser[_V + j] - finer[_V + j]
        # Corners; a third of the way along x; and each a third of the way along y.
        m0, m1 = a0 + _THIRD * p0, a1 + _THIRD * p1
        n0, n1 = b0 - _THIRD * q0, b1 - _THIRD * q1
        e0, e1 = a0 + _THIRD * c0, a1 - _THIRD * c1
        f0, f1 = b0 + _THIRD * d0, b1 - _THIRD * d1
        g0, g1 = m0 + _THIRD * (c0 + _THIRD * u0), m1 - _THIRD * (c1 + _THIRD * u1)
        h0, h1 = n0 + _THIRD * (d0 - _THIRD * v0), n1 - _THIRD * (d1 - _THIRD * v1)
        one = min(min(min(a0, a1), min(b0, b1)), min(min(m0, m1), min(n0, n1)))
        two = min(min(min(e0, e1), min(f0, f1)), min(min(g0, g1), min(h0, h1)))
        span[k] = min(one, two)
        one = max(max(max(a0, a1), max(b0, b1)), max(max(m0, m1), max(n0, n1)))
        two = max(max(max(e0, e1), max(f0, f1)), max(max(g0, g1), max(h0, h1)))
        span[CELLS + k] = max(one, two)
