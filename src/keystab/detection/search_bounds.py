r"""How far polynomials between the nodes of a spline scale-space are from its samples, at most.

`keystab.detection.search_norms` says what holds along one axis. Along both, with L the rows of the
samples, E N those of the polynomial and R = L - E N,

.. math:: L_y C L_x^T - E_y N_y C N_x^T E_x^T = R_y C L_x^T + E_y N_y C R_x^T,

a difference of Gaussians being :math:`(R_y^+ - R_y^-) C L_x^{+T} + R_y^- C (L_x^+ - L_x^-)^T`
and so forth, and a difference of slices likewise by the differences of neighbouring Gaussians: the
norms of differences of kernels are a fraction of those of the kernels. The sum over the source of
two such rows is bounded by the largest :math:`|\Delta^4 C|` within rings of growing distance, times
what the two rows hold in each ring.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from keystab.detection.search_field import Field
from keystab.detection.search_functionals import functionals
from keystab.detection.search_hulls import CELLS
from keystab.detection.search_norms import REACH, Ends, Mixes, Norms, spline_ends, spline_norms
from keystab.detection.search_records import BLOCK, SINGLE_ROUNDING, STENCIL, Bounds
from keystab.detection.search_rings import (
    at_ends,
    largest_fourth,
    mark_flat,
    places_of,
    write_rings,
)

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

# Rows of bounds, what `Mixes` they take, and the two Gaussians whose difference that is, if any.
Pairs = list[tuple[Indices, Indices, Indices | None, Indices | None]]

# Steps from ring to ring, in blocks; each at most twice the radius so far, and one more.
_STEPS = (1, 1, 1, 1, 2, 2, 4, 4, 8, 8, 16, 16, 32, 32, 64, 64)


class Products(NamedTuple):
    """What fourth differences and mirror images of the source are multiplied by, for all bounds.

    Attributes
    ----------
    rings : ndarray, shape (n, 2, n_rings + 1)
        Bounds in the order of `keystab.detection.search_cells.search_cells`; fourth differences
        along y and along x; the largest within the first radius, within the second, ..., anywhere.
    ends_y, ends_x : ndarray, shape (n, 2, n_blocks)
        |z| and |z|^3 at the ends of either axis, per block of cells along it.
    """

    rings: Array
    ends_y: Array
    ends_x: Array


def products(
    norms: tuple[Norms, Norms],
    ends: tuple[Ends, Ends],
    lower: Indices,
    upper: Indices,
    p: int,
    n_kinked: int,
) -> Products:
    """Norms of two axes multiplied as the bounds need them.

    Parameters
    ----------
    norms : (Norms, Norms)
        Of the y axis and of the x axis.
    ends : (Ends, Ends)
    lower, upper : ndarray of int, shape (n_slices,)
        Blurs of each slice.
    p : int
        Samples from one node to the next.
    n_kinked : int
        First slices whose lower Gaussian is not interpolated at a second look.
    """
    n_slices = lower.size
    n_blurs = norms[0].row.shape[0] - n_slices - 2 * (n_slices - 1)
    n = 6 * n_slices + (3 * (n_kinked + 1) if n_kinked else 0)
    rings = np.zeros((n, 2, norms[0].row.shape[1]))
    both = [np.zeros((n, 2, end.value.shape[2])) for end in ends]
    both_of = n_blurs + np.arange(n_slices)
    later = n_blurs + n_slices + np.arange(n_slices - 1)
    # Rows of bounds, and of which Gaussians they bound the difference.
    slices: Pairs = [(np.arange(n_slices), both_of, upper, lower)]
    steps: Pairs = [
        (np.arange(n_slices - 1), later, upper[1:], upper[:-1]),
        (np.arange(n_slices - 1), later + n_slices - 1, lower[1:], lower[:-1]),
    ]
    # At a second look: slices without their lower Gaussians, and the slice after these.
    sharp, rest_of = np.arange(n_kinked), np.arange(n_kinked, n_kinked + 1)
    sharp_slices: Pairs = [
        (sharp, upper[:n_kinked], None, None),
        (rest_of, both_of[rest_of], upper[rest_of], lower[rest_of]),
    ]
    sharp_steps: Pairs = [
        (np.arange(n_kinked + 1), later[: n_kinked + 1], upper[1:], upper[:-1]),
        (rest_of - 1, lower[rest_of], None, None),
        (rest_of, later[rest_of] + n_slices - 1, lower[1:][rest_of], lower[rest_of]),
    ]
    for axis in range(2):
        (along, across), end = (norms[axis], norms[1 - axis]), ends[axis]
        # Rows of samples along x go with the functional along y; those of polynomials along y
        # with the functional along x.
        plain = (across.row, across.row) if axis == 0 else (across.by_value, across.by_wide)
        kinds = [
            # A difference of samples, per node p times as much: the functional of it along its own
            # axis, and that of samples along the other one.
            (axis, along.step, end.step, across.row, slices, p),
            (1 - axis, along.value, end.value, across.by_step, slices, p),
            (2, along.value, end.value, plain[0], steps, 1),
            (3 + axis, along.wide_step, end.wide_step, across.row, slices, 1),
            (4 - axis, along.wide, end.wide, across.by_wide_step, slices, 1),
            (5, along.wide, end.wide, plain[1], steps, 1),
        ]
        first = [kind[0] * n_slices for kind in kinds]
        if n_kinked:
            kinds += [
                (axis, along.wide_step, end.wide_step, across.row, sharp_slices, 1),
                (1 - axis, along.wide, end.wide, across.by_wide_step, sharp_slices, 1),
                (2, along.wide, end.wide, plain[1], sharp_steps, 1),
            ]
            first += [6 * n_slices + kind[0] * (n_kinked + 1) for kind in kinds[6:]]
        for begin, (_, functional, edge, rest, pairs, factor) in zip(first, kinds, strict=True):
            for which, mixed, high, low in pairs:
                at = begin + which
                if high is None or low is None:
                    rings[at, axis] += factor * _outer(functional[mixed], rest[mixed])
                    both[axis][at] += factor * np.moveaxis(edge[:, mixed] * rest[mixed, :1], 0, 1)
                    continue
                high, low = high[: which.size], low[: which.size]
                rings[at, axis] += factor * _outer(functional[mixed], rest[high])
                rings[at, axis] += factor * _outer(functional[low], rest[mixed])
                both[axis][at] += factor * np.moveaxis(
                    edge[:, mixed] * rest[high, :1] + edge[:, low] * rest[mixed, :1], 0, 1
                )
    # From what lies anywhere, and beyond, to what lies within.
    rings = np.minimum.accumulate(rings, axis=-1)
    rings[..., :-1] -= rings[..., 1:].copy()
    return Products(rings, *both)


def _outer(one: Array, other: Array) -> Array:
    """Norms of outer products of rows: in all, and outside of growing squares."""
    product = one[:, :1] * other + one * other[:, :1]
    product[:, 0] = one[:, 0] * other[:, 0]
    return product


def off_at_nodes(field: Field) -> Array:
    """How far nodes may be from samples, per unit of the source, shape (n_slices,).

    Rows of nodes lack what rings. Sums along x are of products in single precision: of terms that
    are rounded twice, four at a time, which are added up.
    """
    y_axis, x_axis = field.axes
    columns = 2 * x_axis.rows.reach * field.delta + 8
    rounding = (8 + np.ceil(columns / 4)) * SINGLE_ROUNDING
    off = 1.1 * (y_axis.lacking + x_axis.lacking) + rounding
    return off[field.lower] + off[field.upper]


def _of_slices(
    sizes: Array, n_kinked: int, hermite: tuple[float, float], wide: tuple[float, float]
) -> Array:
    """What the sizes of slices add to all bounds.

    Parameters
    ----------
    sizes : ndarray, shape (n_slices,)
    n_kinked : int
        See `products`.
    hermite, wide : (float, float)
        Factors of differences within a slice, and of those to the next one.
    """
    steps = np.append(sizes[:-1] + sizes[1:], 0.0)
    many = sizes.size
    parts = [(hermite, many), (wide, many)] + ([(wide, n_kinked + 1)] if n_kinked else [])
    return np.concatenate(
        [
            factor * each[:n]
            for (within, to_next), n in parts
            for factor, each in ((within, sizes), (within, sizes), (to_next, steps))
        ]
    )


class SplineBounds:
    """Bounds for cells of what is searched.

    Parameters
    ----------
    field : Field
    p : int
        Samples from one node to the next.
    n_cells : (int, int)
        Cells along y and along x.
    n_kinked : int
        See `products`.
    """

    def __init__(
        self,
        field: Field,
        p: int,
        n_cells: tuple[int, int],
        n_kinked: int,
    ) -> None:
        self.source, axes, delta = field.source, field.axes, field.delta
        blurs, lower, upper = field.blurs, field.lower, field.upper
        spacing = p * field.step
        block = BLOCK * spacing
        # Beyond this lies what rings, bounded by the largest of all.
        widest = 9.0 * blurs[-1] + STENCIL * spacing + 2 * REACH
        radii = np.cumsum(_STEPS)
        radii = radii[: int(np.searchsorted(radii, widest / block)) + 1]
        self.steps, self.margin = np.array(_STEPS[: radii.size]), int(radii[-1])
        self.radii = radii
        mixes = Mixes.of(blurs.size, lower, upper)
        n_blocks = [-(-n // BLOCK) for n in n_cells]
        norms = [spline_norms(axes[0], delta, p, mixes, block * radii)]
        same = axes[0].rows.taps.shape == axes[1].rows.taps.shape
        if same and (axes[0].rows.taps == axes[1].rows.taps).all():
            norms.append(norms[0])
        else:
            norms.append(spline_norms(axes[1], delta, p, mixes, block * radii))
        ends = [
            spline_ends(axis, delta, p, mixes, n) for axis, n in zip(axes, n_blocks, strict=True)
        ]
        rings, ends_y, ends_x = products(
            (norms[0], norms[1]), (ends[0], ends[1]), lower, upper, p, n_kinked
        )
        padded = np.zeros((len(rings), 2, -(-rings.shape[2] // 2) * 2), dtype=np.float32)
        padded[:, :, : rings.shape[2]] = rings
        self.weights = padded.reshape(len(rings), -1)
        self.ends_y, self.ends_x = (each.astype(np.float32) for each in (ends_y, ends_x))
        self.places = [
            places_of(axis, block, many, self.margin)
            for axis, many in zip(axes, n_blocks, strict=True)
        ]
        # Polynomials add some nodes up.
        off = off_at_nodes(field)
        self.least_off = float(off.min())  # nodes are rounded in double precision too
        of_value, of_step, of_wide, of_wide_step = (
            float(each.sum(axis=1).max()) for each in functionals(p).nodes
        )
        wide = (2 * of_wide_step * of_wide, of_wide**2)
        self.of_node = _of_slices(off, n_kinked, (13.5, of_value**2), wide)
        self.of_sample = _of_slices(field.missed, n_kinked, (2.0 * p, 1.0), (2.0, 1.0))
        self.rounding = field.rounding
        self.missed = float(field.missed.max()) - field.rounding
        self.most = [largest_fourth(source) for source in (self.source, self.source.T)]
        self.ends = [
            at_ends(source, axis.mirrors, places, self.steps, self.margin).astype(np.float32)
            for source, axis, places in zip(
                (self.source, self.source.T), axes, self.places[::-1], strict=True
            )
        ]

    def of(
        self, first_y: int, first_x: int, n_x: int, amplitude: float, tolerance: float
    ) -> Bounds:
        """Bounds of some blocks of cells, see `keystab.detection.search_cells.search_cells`.

        Parameters
        ----------
        first_y, first_x, n_x : int
            First row of blocks, first column, and how many columns.
        amplitude : float
            Largest absolute value of the source as the nodes see it.
        tolerance : float
            Where the source varies by less than an eighth of this, less what samples of two slices
            may be off, blocks are flat.
        """
        margin, n_y = self.margin, CELLS // BLOCK
        rows, begin_y = self.places[0].part(first_y, n_y, margin)
        columns, begin_x = self.places[1].part(first_x, n_x, margin)
        weights = self.weights
        near = [
            place.from_end[first : first + n]
            for place, first, n in zip(self.places, (first_y, first_x), (n_y, n_x), strict=True)
        ]
        n_rings = weights.shape[1] // 2
        rings = np.zeros((n_x, weights.shape[1], n_y), dtype=np.float32)
        flat = np.zeros((n_x, n_y), dtype=np.bool_)
        for axis in range(2):
            write_rings(
                self.source,
                axis,
                rows,
                begin_y,
                columns,
                begin_x,
                self.most[axis],
                self.steps,
                near[axis],
                rings[:, axis * n_rings : (axis + 1) * n_rings],
            )
        flat_below = (tolerance - 2 * self.missed) / 8
        mark_flat(self.source, rows, begin_y, columns, begin_x, self.steps, flat_below, flat)
        off = (amplitude + self.rounding / self.least_off) * self.of_node + self.of_sample
        return Bounds(
            off.astype(np.float32),
            weights,
            rings,
            np.ascontiguousarray(self.ends_y[:, :, first_y : first_y + n_y]),
            np.ascontiguousarray(self.ends[0][:, first_x : first_x + n_x]),
            np.ascontiguousarray(self.ends_x[:, :, first_x : first_x + n_x].transpose(2, 0, 1)),
            np.ascontiguousarray(self.ends[1][:, first_y : first_y + n_y]),
            flat,
        )
