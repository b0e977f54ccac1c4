r"""Search of a finely sampled cosine scale-space from few of its samples.

A cosine series has no frequency above half a cycle per pixel. On the few pixels that a block of
fine samples spans, such functions form a space of few dimensions, so that their values at as many
*nodes* give all others: rows L of the axis are E N, with N the rows at the nodes and E the same
matrix for all blocks of one length. Samples are expanded from the nodes in single precision, how
far they can be off is bounded, and what may be an extremum is decided exactly by the caller.

**Bound.** With C the coefficients and R = L - E N, whose entry of frequency k is at most r_k in
any row of any block,

.. math:: |L_y C L_x^T - E_y N_y C N_x^T E_x^T|
          \le r_y^T |C| \, 1 + (1 + r_y)^T |C| \, r_x

once the gains of the Gaussian are put into C.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import scipy.linalg
from numba import njit
from numpy.typing import NDArray

from keystab.detection.search_scan import (
    LARGEST,
    ROOM,
    SINGLE_ROUNDING,
    difference,
    gathered,
    scan,
    starts_of,
)
from keystab.scalespace.cosine_axis import CosineAxis
from keystab.scalespace.dog import ScaleSpace

# Rows and columns of a block: long ones need fewer nodes per sample; all slices and the Gaussians
# of a block stay in the cache of a core.
_ROWS, _COLUMNS = 48, 192

# Waves of an interval that are weaker than this, of the strongest, are left to the bound.
_FAINT = 1e-9

# How far cosines of large angles are off, and sums of them; far below what is left to the bound.
_ANGLES = 1e-12


def applies(space: ScaleSpace) -> bool:
    """Whether the scale-space of a cosine series is sampled finely enough, and is not too small."""
    if space.shape[1] < _ROWS or space.shape[2] < _COLUMNS:
        return False
    if space.largest > LARGEST:
        return False
    return interpolation(_ROWS, space.sampling.step) is not None


@lru_cache(maxsize=16)
def interpolation(
    n_samples: int, spacing: float
) -> tuple[NDArray[np.int64], NDArray[np.float64]] | None:
    """Nodes of an interval, and the matrix from band-limited functions there to all its samples.

    Parameters
    ----------
    n_samples : int
        Samples of the interval.
    spacing : float
        Their distance in pixels.

    Returns
    -------
    nodes : ndarray of int, shape (n_nodes,)
        Samples, in ascending order.
    expand : ndarray, shape (n_samples, n_nodes)
        Interpolation by functions with a band limit of half a cycle per pixel. None, instead of
        both, where that takes about as many nodes as there are samples.

    Examples
    --------
    >>> nodes, expand = interpolation(48, 0.1)
    >>> wave = np.cos(0.4 + 0.9 * np.pi * 0.1 * np.arange(48))
    >>> bool(np.abs(expand @ wave[nodes] - wave).max() < 1e-7), len(nodes)
    (True, 16)
    """
    basis = band_limited_basis(n_samples, spacing, _FAINT)
    if basis is None:
        return None
    # Pivoting picks the samples at which the basis is best conditioned.
    pivots = scipy.linalg.qr(basis.T, mode="r", pivoting=True)[1]
    nodes = np.sort(pivots[: basis.shape[1]]).astype(np.int64)
    return nodes, np.ascontiguousarray(np.linalg.solve(basis[nodes].T, basis.T).T)


@lru_cache(maxsize=16)
def band_limited_basis(n_samples: int, spacing: float, faint: float) -> NDArray[np.float64] | None:
    """Orthonormal basis of band-limited functions on an interval.

    Parameters
    ----------
    n_samples : int
        Samples of the interval.
    spacing : float
        Their distance in pixels; the band limit is half a cycle per pixel.
    faint : float
        Singular value, of the largest, below which a direction is left out.

    Returns
    -------
    ndarray, shape (n_samples, rank), or None
        Columns that span every such function; None where that takes
        about as many as there are samples.
    """
    span = (n_samples - 1) * spacing
    # Frequencies dense enough that the waves between them add nothing new to the interval.
    frequency = np.linspace(0.0, np.pi, int(4 * span) + 64)
    phase = np.multiply.outer((np.arange(n_samples) - (n_samples - 1) / 2) * spacing, frequency)
    waves = np.hstack([np.cos(phase), np.sin(phase)])
    left, singular, _ = np.linalg.svd(waves, full_matrices=False)
    rank = int((singular > faint * singular[0] * np.sqrt(n_samples)).sum())
    return np.ascontiguousarray(left[:, :rank]) if rank < 0.7 * n_samples else None


class BandLimitedSearch:
    """Candidates for extrema; used as `keystab.detection.search_lattice.LatticeSearch`."""

    length, abreast = _ROWS, _COLUMNS

    @staticmethod
    def applies(space: ScaleSpace) -> bool:
        """See `applies`."""
        return applies(space)

    @staticmethod
    def shares_of_memory(n_blurs: int) -> tuple[float, float]:
        """What its rows and its strips take of those for all samples; all blurs share the rows."""
        return 1 / (2 * n_blurs), 1 / 3

    def __init__(
        self,
        space: ScaleSpace,
        tolerance: float,
        window: tuple[slice, slice],
        threads: int = 1,
    ) -> None:
        rows, columns = window
        self.space, self.tolerance = space, tolerance
        self.y_starts = np.array(starts_of(rows, space.shape[1], self.length), dtype=np.int64)
        self.x_starts = starts_of(columns, space.shape[2], self.abreast)
        y_axis, x_axis = space.axes
        assert isinstance(y_axis, CosineAxis) and isinstance(x_axis, CosineAxis)
        self.y_axis, self.x_axis = y_axis, x_axis
        self.y_nodes, self.y_expand = _of(space, self.length)
        self.x_nodes, self.x_expand = _of(space, self.abreast)
        count = int(y_axis.n_frequencies.max())
        self.y_rows = y_axis.basis(self.y_starts[:, None] + self.y_nodes, count)
        self.bounds = self._bounds()

    def _bounds(self) -> NDArray[np.float64]:
        """Bound of the interpolation error of every slice."""
        y_axis, x_axis, magnitude = self.y_axis, self.x_axis, np.abs(self.space.source)
        r_y = _largest_residual(y_axis, self.y_nodes, self.y_expand)
        r_x = _largest_residual(x_axis, self.x_nodes, self.x_expand)
        bound = np.array(
            [
                (r_y * g_y) @ magnitude @ g_x + ((1 + r_y) * g_y) @ magnitude @ (r_x * g_x)
                for g_y, g_x in zip(y_axis.gains, x_axis.gains, strict=True)
            ]
        )
        _, lower, upper = self.space.blurs
        return bound[lower] + bound[upper]

    @property
    def parts(self) -> range:
        """Columns of blocks."""
        return range(len(self.x_starts))

    def closer(self, rows: slice, columns: slice) -> None:  # noqa: ARG002 - as the other search
        """All samples of what is left over are evaluated."""

    def candidates(self, column: int) -> tuple[NDArray[np.int64], list[tuple[slice, slice]]]:
        """Samples of one column of blocks that may be extrema; see `gathered`."""
        _, lower, upper = self.space.blurs
        y_axis, x_axis, source = self.y_axis, self.x_axis, self.space.source
        height, width = self.y_rows.shape[2], int(x_axis.n_frequencies.max())
        left = self.x_starts[column]
        across = x_axis.basis(left + self.x_nodes, width)
        # One Gaussian beside the other: all of them are multiplied by the same rows.
        strips = np.empty((height, len(y_axis.gains), len(self.x_nodes)))
        for blur, (g_y, g_x) in enumerate(zip(y_axis.gains, x_axis.gains, strict=True)):
            np.matmul(source[:height, :width], (across * g_x[:width]).T, out=strips[:, blur])
            strips[:, blur] *= g_y[:height, None]
        found = np.empty((self.y_starts.size, ROOM, 4), dtype=np.int64)
        counts = np.empty(self.y_starts.size, dtype=np.int64)
        n_products = self.y_expand.shape[1] + self.x_expand.shape[1] + 4
        rounding = 2 * n_products * SINGLE_ROUNDING
        for expand in (self.y_expand, self.x_expand):
            rounding *= np.abs(expand).sum(axis=1).max()
        _search(
            strips,
            self.y_rows,
            self.y_starts,
            lower,
            upper,
            self.y_expand.astype(np.float32),
            np.ascontiguousarray(self.x_expand.T.astype(np.float32)),
            self.bounds + 2 * self.space.rounding_bounds.value,
            rounding,
            self.tolerance,
            left,
            found,
            counts,
        )
        candidates, undecided = gathered(found, counts, self.y_starts, left)
        inner = [
            (slice(y + 1, y + self.length - 1), slice(x + 1, x + self.abreast - 1))
            for y, x in undecided
        ]
        return candidates, inner


def _of(space: ScaleSpace, n_samples: int) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Interpolation on an interval of a scale-space that is sampled finely enough."""
    found = interpolation(n_samples, space.sampling.step)
    assert found is not None
    return found


def _largest_residual(
    axis: CosineAxis, nodes: NDArray[np.int64], expand: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Largest entry of L - E N of each frequency, wherever a block begins.

    A block further on sees another phase: a mixture of the cosine and the sine.
    """
    angle = np.pi / axis.n_pixels * axis.spacing
    phase = np.multiply.outer(np.arange(len(expand)), angle * np.arange(axis.n_pixels))
    waves = (np.cos(phase), np.sin(phase))
    residual = np.hypot(*(wave - expand @ wave[nodes] for wave in waves))
    return residual.max(axis=0) + _ANGLES


@njit(cache=True, nogil=True)
def _search(  # noqa: PLR0913
    strips,
    y_rows,
    starts,
    lower,
    upper,
    y_expand,
    x_expand_t,
    bounds,
    rounding,
    tolerance,
    left,
    found,
    counts,
):
    """Search one column of blocks from top to bottom."""
    n_frequencies, n_blurs, n_across = strips.shape
    n_rows, n_along = y_expand.shape
    n_slices = lower.size
    side_by_side = strips.reshape(n_frequencies, n_blurs * n_across)
    gaussians = np.empty((n_along, n_blurs * n_across))
    nodes = np.empty((n_along, n_across), dtype=np.float32)
    half = np.empty((n_along, x_expand_t.shape[1]), dtype=np.float32)
    dog = np.empty((n_slices, n_rows, x_expand_t.shape[1]), dtype=np.float32)
    error = np.empty(n_slices)
    for i in range(starts.size):
        np.dot(y_rows[i], side_by_side, gaussians)
        each = gaussians.reshape(n_along, n_blurs, n_across)
        for s in range(n_slices):
            largest = difference(each[:, upper[s]], each[:, lower[s]], nodes)
            error[s] = bounds[s] + rounding * largest
            np.dot(nodes, x_expand_t, half)
            np.dot(y_expand, half, dog[s])
        counts[i] = scan(dog, error, tolerance, starts[i], left, found[i])
