r"""Search of a finely sampled cosine scale-space from few of its samples.

A cosine series has no frequency above half a cycle per pixel. On the few pixels that a block of
fine samples spans, such functions form a space of few dimensions, so that their values at as many
*nodes* give all others: rows L of the axis are E N, with N the rows at the nodes and E the same
matrix for all blocks of one length. As in `keystab.detection.search_spline`, samples are expanded
from the nodes in single precision, how far they can be off is bounded, and what may be an extremum
is decided exactly by the caller.

**Bound.** With C the coefficients and R = L - E N, whose entry of frequency k is at most r_k in
any row of any block,

.. math:: |L_y C L_x^T - E_y N_y C N_x^T E_x^T|
          \le r_y^T |C| \, 1 + (1 + r_y)^T |C| \, r_x

once the gains of the Gaussian are put into C.
"""

from __future__ import annotations

from collections.abc import Iterable
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
from keystab.scalespace.cosine_axis import CosineAxis, band_limited_basis
from keystab.scalespace.dog import ScaleSpace

# Rows and columns of a block: long ones need fewer nodes per sample; all slices and the Gaussians
# of a block stay in the cache of a core.
_ROWS, _COLUMNS = 48, 192

# Waves of an interval that are weaker than this, of the strongest, are left to the bound.
_FAINT = 1e-9


def applies(space: ScaleSpace) -> bool:
    """Whether a scale-space is sampled finely enough to gain by it, and larger than one block."""
    if space.oversampling != "cosine":
        return False
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


class BandLimitedSearch:
    """Candidates for extrema; used as `keystab.detection.search_spline.InterpolatedSearch`."""

    length, abreast = _ROWS, _COLUMNS

    def __init__(self, space: ScaleSpace, tolerance: float, rows: slice, columns: slice) -> None:
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
        r_y = _largest_residual(y_axis, self.y_starts, self.y_nodes, self.y_expand)
        r_x = _largest_residual(x_axis, self.x_starts, self.x_nodes, self.x_expand)
        bound = np.array(
            [
                (r_y * g_y) @ magnitude @ g_x + ((1 + r_y) * g_y) @ magnitude @ (r_x * g_x)
                for g_y, g_x in zip(y_axis.gains, x_axis.gains, strict=True)
            ]
        )
        _, lower, upper = self.space.blurs
        return bound[lower] + bound[upper]

    @property
    def n_columns(self) -> int:
        """Columns of blocks."""
        return len(self.x_starts)

    def candidates(self, column: int) -> tuple[NDArray[np.int64], list[tuple[int, int]]]:
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
            self.bounds + self.space.rounding,
            rounding,
            self.tolerance,
            left,
            found,
            counts,
        )
        return gathered(found, counts, self.y_starts, left)


def _of(space: ScaleSpace, n_samples: int) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Interpolation on an interval of a scale-space that is sampled finely enough."""
    found = interpolation(n_samples, space.sampling.step)
    assert found is not None
    return found


def _largest_residual(
    axis: CosineAxis,
    starts: Iterable[int],
    nodes: NDArray[np.int64],
    expand: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Largest entry of L - E N of each frequency, for all blocks of an axis."""
    largest = np.zeros(axis.n_pixels)
    for start in starts:
        rows = axis.basis(start + np.arange(len(expand)))
        np.maximum(largest, np.abs(rows - expand @ rows[nodes]).max(axis=0), out=largest)
    return largest


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
    error = np.empty((n_slices, 1))
    for i in range(starts.size):
        np.dot(y_rows[i], side_by_side, gaussians)
        each = gaussians.reshape(n_along, n_blurs, n_across)
        for s in range(n_slices):
            largest = difference(each[:, upper[s]], each[:, lower[s]], nodes)
            error[s, 0] = bounds[s] + rounding * largest
            np.dot(nodes, x_expand_t, half)
            np.dot(y_expand, half, dog[s])
        counts[i] = scan(dog, error, tolerance, starts[i], left, found[i])
