"""Rows of a blurred spline, summed from kernel taps and spline weights."""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True, nogil=True)
def blurred_spline_rows(start, stride, taps, reach, splines, first, out):
    """Fill `out` (zeroed) with rows ``start, start + stride, ...`` of the blurred spline."""
    middle = taps.size // 2  # also the number of samples mirrored on each side
    # Zeros around the taps: of four rows, the outer ones do not reach all samples.
    margin = 3 * stride
    tap = np.zeros(2 * (reach + margin) + 1)
    for k in range(2 * reach + 1):
        tap[margin + k] = taps[middle - reach + k]
    for row in range(0, out.shape[0], 4):
        n_rows = min(4, out.shape[0] - row)
        sample = start + row * stride - reach + middle
        last = sample + 2 * reach + (n_rows - 1) * stride
        if n_rows == 4:
            _four_rows(sample, last, stride, tap, splines, first, out[row : row + 4])
        elif n_rows == 3:
            _three_rows(sample, last, stride, tap, splines, first, out[row : row + 3])
        else:
            for r in range(n_rows):
                begin = sample + r * stride
                end = begin + 2 * reach
                _one_row(begin, end, tap[margin:], splines, first, out[row + r])


@njit(cache=True, nogil=True, fastmath={"contract"})
def _four_rows(sample, last, stride, tap, splines, first, out):
    """Add to four rows what samples `sample` to `last` give.

    The four weights of consecutive fine samples meet the same four columns until the next knot
    is passed, so that sums stay in registers until then; and four rows meet the same weights, so
    that the processor need not wait for one sum before it adds to the next. Slices that begin at
    the first sample spare the loop all checks of its indices.
    """
    column, weight, stops = splines
    margin = 3 * stride
    begin = sample
    while sample <= last:
        stop = min(stops[sample], last + 1)
        w, here = weight[sample:stop], column[sample] - first
        at = margin + sample - begin
        tap_a, tap_b = tap[at:], tap[at - stride :]
        tap_c, tap_d = tap[at - 2 * stride :], tap[at - 3 * stride :]
        a0 = a1 = a2 = a3 = b0 = b1 = b2 = b3 = 0.0
        c0 = c1 = c2 = c3 = d0 = d1 = d2 = d3 = 0.0
        for i in range(stop - sample):
            w0, w1, w2, w3 = w[i, 0], w[i, 1], w[i, 2], w[i, 3]
            a, b, c, d = tap_a[i], tap_b[i], tap_c[i], tap_d[i]
            a0, a1, a2, a3 = a0 + a * w0, a1 + a * w1, a2 + a * w2, a3 + a * w3
            b0, b1, b2, b3 = b0 + b * w0, b1 + b * w1, b2 + b * w2, b3 + b * w3
            c0, c1, c2, c3 = c0 + c * w0, c1 + c * w1, c2 + c * w2, c3 + c * w3
            d0, d1, d2, d3 = d0 + d * w0, d1 + d * w1, d2 + d * w2, d3 + d * w3
        _add_four(out[0, here : here + 4], a0, a1, a2, a3)
        _add_four(out[1, here : here + 4], b0, b1, b2, b3)
        _add_four(out[2, here : here + 4], c0, c1, c2, c3)
        _add_four(out[3, here : here + 4], d0, d1, d2, d3)
        sample = stop


@njit(cache=True, nogil=True, fastmath={"contract"})
def _three_rows(sample, last, stride, tap, splines, first, out):
    """Add to three rows, those of a neighbourhood, what samples `sample` to `last` give."""
    column, weight, stops = splines
    margin = 3 * stride
    begin = sample
    while sample <= last:
        stop = min(stops[sample], last + 1)
        w, here = weight[sample:stop], column[sample] - first
        at = margin + sample - begin
        tap_a, tap_b, tap_c = tap[at:], tap[at - stride :], tap[at - 2 * stride :]
        a0 = a1 = a2 = a3 = b0 = b1 = b2 = b3 = c0 = c1 = c2 = c3 = 0.0
        for i in range(stop - sample):
            w0, w1, w2, w3 = w[i, 0], w[i, 1], w[i, 2], w[i, 3]
            a, b, c = tap_a[i], tap_b[i], tap_c[i]
            a0, a1, a2, a3 = a0 + a * w0, a1 + a * w1, a2 + a * w2, a3 + a * w3
            b0, b1, b2, b3 = b0 + b * w0, b1 + b * w1, b2 + b * w2, b3 + b * w3
            c0, c1, c2, c3 = c0 + c * w0, c1 + c * w1, c2 + c * w2, c3 + c * w3
        _add_four(out[0, here : here + 4], a0, a1, a2, a3)
        _add_four(out[1, here : here + 4], b0, b1, b2, b3)
        _add_four(out[2, here : here + 4], c0, c1, c2, c3)
        sample = stop


@njit(cache=True, nogil=True, fastmath={"contract"})
def _one_row(sample, last, tap, splines, first, out):
    """Add to one row what samples `sample` to `last` give; see `_four_rows`."""
    column, weight, stops = splines
    begin = sample
    while sample <= last:
        stop = min(stops[sample], last + 1)
        w, here, taps = weight[sample:stop], column[sample] - first, tap[sample - begin :]
        a0 = a1 = a2 = a3 = 0.0
        for i in range(stop - sample):
            a = taps[i]
            a0, a1, a2, a3 = a0 + a * w[i, 0], a1 + a * w[i, 1], a2 + a * w[i, 2], a3 + a * w[i, 3]
        _add_four(out[here : here + 4], a0, a1, a2, a3)
        sample = stop


@njit(cache=True, nogil=True)
def _add_four(row, a, b, c, d):
    row[0] += a
    row[1] += b
    row[2] += c
    row[3] += d
