"""Gaussians at the nodes of a search, summed from the source along y and then along x."""

from __future__ import annotations

import numpy as np
from numba import njit

from keystab.detection.search_hulls import FAST, NODES
from keystab.detection.search_records import GROUP


@njit(cache=True, nogil=True, fastmath={"contract", "reassoc"})
def _four_rows(weights, width, source, first, out):
    """Four sums of `width` rows of the source, shape (4, n), with weights (width, 4)."""
    out0, out1, out2, out3 = out[0], out[1], out[2], out[3]
    n = out0.size
    for x in range(n):
        out0[x] = 0.0
        out1[x] = 0.0
        out2[x] = 0.0
        out3[x] = 0.0
    k = 0
    while k + 4 <= width:
        s, t = source[first + k], source[first + k + 1]
        u, v = source[first + k + 2], source[first + k + 3]
        w = weights[4 * k :]
        s0, s1, s2, s3, t0, t1, t2, t3 = w[0], w[1], w[2], w[3], w[4], w[5], w[6], w[7]
        u0, u1, u2, u3, v0, v1, v2, v3 = w[8], w[9], w[10], w[11], w[12], w[13], w[14], w[15]
        for x in range(n):
            out0[x] += s0 * s[x] + t0 * t[x] + u0 * u[x] + v0 * v[x]
            out1[x] += s1 * s[x] + t1 * t[x] + u1 * u[x] + v1 * v[x]
            out2[x] += s2 * s[x] + t2 * t[x] + u2 * u[x] + v2 * v[x]
            out3[x] += s3 * s[x] + t3 * t[x] + u3 * u[x] + v3 * v[x]
        k += 4
    while k < width:
        s = source[first + k]
        s0, s1, s2, s3 = weights[4 * k], weights[4 * k + 1], weights[4 * k + 2], weights[4 * k + 3]
        for x in range(n):
            out0[x] += s0 * s[x]
            out1[x] += s1 * s[x]
            out2[x] += s2 * s[x]
            out3[x] += s3 * s[x]
        k += 1


@njit(cache=True, nogil=True, fastmath={"contract", "reassoc"})
def four_columns(weights, width, source, first, out):
    """Four sums of `width` rows of the source, shape (4, NODES), with weights (width, 4)."""
    out0, out1, out2, out3 = out[0], out[1], out[2], out[3]
    n = NODES
    for x in range(n):
        out0[x] = 0.0
        out1[x] = 0.0
        out2[x] = 0.0
        out3[x] = 0.0
    k = 0
    while k + 4 <= width:
        s, t = source[first + k], source[first + k + 1]
        u, v = source[first + k + 2], source[first + k + 3]
        w = weights[4 * k :]
        s0, s1, s2, s3, t0, t1, t2, t3 = w[0], w[1], w[2], w[3], w[4], w[5], w[6], w[7]
        u0, u1, u2, u3, v0, v1, v2, v3 = w[8], w[9], w[10], w[11], w[12], w[13], w[14], w[15]
        for x in range(n):
            out0[x] += s0 * s[x] + t0 * t[x] + u0 * u[x] + v0 * v[x]
            out1[x] += s1 * s[x] + t1 * t[x] + u1 * u[x] + v1 * v[x]
            out2[x] += s2 * s[x] + t2 * t[x] + u2 * u[x] + v2 * v[x]
            out3[x] += s3 * s[x] + t3 * t[x] + u3 * u[x] + v3 * v[x]
        k += 4
    while k < width:
        s = source[first + k]
        s0, s1, s2, s3 = weights[4 * k], weights[4 * k + 1], weights[4 * k + 2], weights[4 * k + 3]
        for x in range(n):
            out0[x] += s0 * s[x]
            out1[x] += s1 * s[x]
            out2[x] += s2 * s[x]
            out3[x] += s3 * s[x]
        k += 1


@njit(cache=True, nogil=True)
def rows_of_nodes(rows, source, out):
    """Blur along y: a band of rows of nodes from every row of the source that they see.

    Parameters
    ----------
    rows : NodeRows
        Of ``NODES / GROUP`` groups.
    source : ndarray, shape (n_rows, n_columns)
    out : ndarray of float32, shape (n_blurs, n_columns, NODES)
        Written to, a column of nodes side by side.
    """
    four = np.empty((GROUP, source.shape[1]))
    for blur in range(out.shape[0]):
        for g in range(NODES // GROUP):
            begin, n = rows.offset[blur, g], rows.width[blur, g]
            _four_rows(rows.entries[begin:], n, source, rows.first[blur, g], four)
            for x in range(source.shape[1]):
                for k in range(GROUP):
                    out[blur, x, GROUP * g + k] = four[k, x]


@njit(cache=True, nogil=True)
def largest_of(values):
    """Largest of some numbers; `max` of an array compiles all that it might be asked for."""
    largest = values[0]
    for value in values:
        largest = max(largest, value)
    return largest


@njit(cache=True, nogil=True, fastmath=FAST)
def subtract(high, low, out, room):
    """Write differences of `GROUP` columns of two Gaussians; return the largest size."""
    for i in range(GROUP * NODES):
        out[i] = high[i] - low[i]
    # Pairs first: a single running maximum takes no vector instructions.
    for i in range(NODES):
        one = max(abs(out[i]), abs(out[i + NODES]))
        room[i] = max(one, max(abs(out[i + 2 * NODES]), abs(out[i + 3 * NODES])))
    for i in range(NODES // 2):
        room[i] = max(room[i], room[i + NODES // 2])
    for i in range(NODES // 4):
        room[i] = max(room[i], room[i + NODES // 4])
    largest = room[0]
    for i in range(NODES // 4):
        largest = max(largest, room[i])
    return largest
