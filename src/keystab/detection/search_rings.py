"""How much the source of a spline scale-space varies around every block of cells.

Its largest fourth differences, within growing distances; at the ends of an axis, what the mirror
adds; and blocks around which it is flat.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from keystab.detection.search_nodes import LocalAxis

Array = NDArray[np.float64]
Indices = NDArray[np.int64]


class Places(NamedTuple):
    """Where the entries of the source along one axis lie, those beyond its ends mirrored.

    Attributes
    ----------
    entry : ndarray of int, shape (n,)
        Entries, by place.
    begin : ndarray of int, shape (n_blocks + 2 * margin + 1,)
        Where each block of cells begins in `entry`, `margin` blocks before the first one on.
    from_end : ndarray of int, shape (n_blocks,)
        Blocks between each one and the nearer mirror.
    """

    entry: Indices
    begin: Indices
    from_end: Indices

    @classmethod
    def of(
        cls, n: int, block: float, mirrors: tuple[float, float], n_blocks: int, margin: int
    ) -> Places:
        """Places of n entries at 0 .. n - 1, with one mirror image at either end."""
        place = np.arange(n)
        places = np.concatenate([2 * mirrors[0] - place, place, 2 * mirrors[1] - place])
        order = np.argsort(places, kind="stable")
        edges = block * np.arange(-margin, n_blocks + margin + 1)
        from_end = np.minimum(
            np.arange(n_blocks), int(mirrors[1] / block) - 1 - np.arange(n_blocks)
        )
        return cls(order % n, np.searchsorted(places[order], edges), np.maximum(from_end, 0))

    @classmethod
    def without_mirrors(
        cls, n: int, first: int, block: float, n_blocks: int, margin: int
    ) -> Places:
        """Places of n entries at first, first + 1, ..."""
        edges = block * np.arange(-margin, n_blocks + margin + 1)
        begin = np.searchsorted(first + np.arange(n), edges)
        return cls(np.arange(n), begin, np.full(n_blocks, n + n_blocks))

    def part(self, first: int, n: int, margin: int) -> tuple[Indices, Indices]:
        """Entries of n blocks and a margin on both sides, and where the blocks begin among them."""
        begin = self.begin[first : first + n + 2 * margin + 1]
        return self.entry[begin[0] : begin[-1]], begin - begin[0]


def places_of(axis: LocalAxis, block: float, n_blocks: int, margin: int) -> Places:
    """Places of the fourth differences of an axis, from the knot at its first sample on."""
    n, first = axis.n_columns - 4, 2 - axis.before
    if axis.mirrors:
        return Places.of(n, block, axis.mirrors, n_blocks, margin)
    return Places.without_mirrors(n, first, block, n_blocks, margin)


@njit(cache=True, nogil=True, fastmath={"nnan", "nsz", "contract", "reassoc"})
def _raise_to_fourth(a, b, c, d, e, out):
    """Raise `out` to the absolute fourth difference of five rows."""
    for x in range(out.size):
        out[x] = max(out[x], abs(a[x] + e[x] - 4 * (b[x] + d[x]) + 6 * c[x]))


@njit(cache=True, nogil=True, fastmath={"nnan", "nsz"})
def _raise_to(a, b, out):
    """Write the largest of three rows."""
    for x in range(out.size):
        out[x] = max(out[x], max(a[x], b[x]))


@njit(cache=True, nogil=True)
def _pooled(lines, begin_y, columns, begin_x, left, otherwise, out):
    """Write the largest value of every block, given the largest of its rows in every column."""
    for v in range(out.shape[0]):
        for u in range(out.shape[1]):
            largest = 0.0
            for place in range(begin_x[u], begin_x[u + 1]):
                largest = max(largest, lines[v, columns[place] - left])
            if begin_y[v] == begin_y[v + 1] or begin_x[u] == begin_x[u + 1]:
                largest = otherwise
            out[v, u] = largest


@njit(cache=True, nogil=True)
def _dilate(values, other, step):
    """Raise every value to those that are a step away along both axes; `other` is work space."""
    high, wide = values.shape
    for v in range(high):
        for u in range(wide):
            other[v, u] = values[v, u]
        _raise_to(values[max(v - step, 0)], values[min(v + step, high - 1)], other[v])
    for v in range(high):
        for u in range(wide):
            values[v, u] = other[v, u]
        # What the ends lack does not matter: they are a margin away from all that is asked.
        _raise_to(other[v, : wide - 2 * step], other[v, 2 * step :], values[v, step : wide - step])


@njit(cache=True, nogil=True)
def write_rings(source, axis, rows, begin_y, columns, begin_x, most, steps, near, rings):  # noqa: PLR0913
    """Write the largest fourth differences along an axis, within growing distances of blocks."""
    n_x, _, n_y = rings.shape
    margin = (begin_y.size - 1 - n_y) // 2
    left, size = columns.min(), columns.max() + 1 - columns.min()
    lines = np.zeros((n_y + 2 * margin, size))
    for v in range(lines.shape[0]):
        for place in range(begin_y[v], begin_y[v + 1]):
            y = rows[place]  # two rows and columns are mirrored before the first
            if axis == 0:
                begin = left + 2
                _raise_to_fourth(
                    source[y, begin:], source[y + 1, begin:], source[y + 2, begin:],
                    source[y + 3, begin:], source[y + 4, begin:], lines[v],
                )  # fmt: skip
            else:
                s = source[y + 2, left:]
                _raise_to_fourth(s, s[1:], s[2:], s[3:], s[4:], lines[v])
    pooled = np.zeros((n_y + 2 * margin, n_x + 2 * margin), dtype=np.float32)
    _pooled(lines, begin_y, columns, begin_x, left, most, pooled)
    other = np.empty_like(pooled)
    radius = 0
    for ring in range(steps.size):
        radius += steps[ring]
        _dilate(pooled, other, steps[ring])
        for u in range(n_x):
            for v in range(n_y):
                value = pooled[margin + v, margin + u]
                # Kinks and their mirror images are two combs: where a ring has both, both count.
                if near[v if axis == 0 else u] < radius:
                    value *= 2
                rings[u, ring, v] = value
    rings[:, steps.size] = 2 * most


@njit(cache=True, nogil=True)
def mark_flat(source, rows, begin_y, columns, begin_x, steps, tolerance, flat):  # noqa: PLR0913
    """Mark blocks around which the source varies by less than a tolerance."""
    n_x, n_y = flat.shape
    margin = (begin_y.size - 1 - n_y) // 2
    left, size = columns.min(), columns.max() + 1 - columns.min()
    shape = (n_y + 2 * margin, n_x + 2 * margin)
    ends = np.empty((2, *shape), dtype=np.float32)
    # Around the first entry, so that single precision does not matter where it is needed.
    level = source[rows[0] + 2, left + 2]
    for sign in range(2):
        lines = np.full((shape[0], size), -np.inf)
        for v in range(shape[0]):
            for place in range(begin_y[v], begin_y[v + 1]):
                for x in range(size):
                    value = source[rows[place] + 2, left + 2 + x] - level
                    lines[v, x] = max(lines[v, x], value if sign == 0 else -value)
        pooled = ends[sign]
        for v in range(shape[0]):
            for u in range(shape[1]):
                largest = -np.inf
                for place in range(begin_x[u], begin_x[u + 1]):
                    largest = max(largest, lines[v, columns[place] - left])
                pooled[v, u] = largest
        other = np.empty_like(pooled)
        for ring in range(steps.size):
            _dilate(pooled, other, steps[ring])
    for u in range(n_x):
        for v in range(n_y):
            spread = ends[0, margin + v, margin + u] + ends[1, margin + v, margin + u]
            flat[u, v] = spread < tolerance


def _fourth(values: Array) -> Array:
    """Fourth differences along axis 0."""
    return values[:-4] + values[4:] - 4 * (values[1:-3] + values[3:-1]) + 6 * values[2:-2]


def largest_fourth(source: Array) -> float:
    """Largest absolute fourth difference along axis 0."""
    return max(
        float(np.abs(_fourth(source[begin : begin + 132])).max())
        for begin in range(0, source.shape[0] - 4, 128)
    )


def at_ends(
    source: Array, mirrors: tuple[float, float] | None, places: Places, steps: Indices, margin: int
) -> Array:
    """Largest |a_1| and |a_3| at the ends of axis 0, per block along the other one."""
    sizes = np.zeros((2, source.shape[1]))
    many = places.from_end.size
    if not mirrors:
        return np.zeros((2, many))
    for mirror in mirrors:
        knot = int(np.floor(mirror))
        t = mirror - knot
        four = source[knot + 1 : knot + 5]  # two are mirrored before the first
        first = np.array([-((1 - t) ** 2), 3 * t**2 - 4 * t, 1 + 2 * t - 3 * t**2, t**2]) / 2
        third = np.array([-1.0, 3.0, -3.0, 1.0]) / 6
        np.maximum(sizes, np.abs(np.stack([first, third]) @ four), out=sizes)
    index, begin = places.part(0, many, margin)
    largest = _largest(sizes[:, 2:-2][:, index], begin, 1, sizes.max())
    for step in steps:
        largest = _dilated(largest, 1, step)
    return largest[:, margin : margin + many]


def _largest(values: Array, begin: Indices, axis: int, otherwise: float) -> Array:
    """Largest value in every block along an axis; `otherwise` where a block has none."""
    largest = np.maximum.reduceat(values, np.minimum(begin[:-1], values.shape[axis] - 1), axis=axis)
    empty = np.diff(begin) == 0
    if empty.any():
        np.moveaxis(largest, axis, 0)[empty] = otherwise
    return largest


def _dilated(values: Array, axis: int, step: int) -> Array:
    """Largest of each value and of the two that are a step away along an axis."""
    values = np.moveaxis(values, axis, 0)
    out = values.copy()
    if step < len(out):
        np.maximum(out[step:], values[:-step], out=out[step:])
        np.maximum(out[:-step], values[step:], out=out[:-step])
    return np.moveaxis(out, 0, axis)
