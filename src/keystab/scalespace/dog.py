"""The difference-of-Gaussians scale-space of an image as a lazy grid of tiles.

Section 2 of the paper. A slice at scale sigma is the image blurred to ``kappa * sigma`` minus the
image blurred to ``sigma``, both straight from the input. Nothing is computed before it is asked
for: a tile, a slice, a window or single neighbourhoods cost what they hold and not what the whole
octave holds, so that memory does not grow with the image nor with ``n_spo``.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from functools import cached_property, lru_cache

import numpy as np
from numba import njit

from keystab.errors import InputError
from keystab.scalespace.axis import AxisOperator, Block
from keystab.scalespace.interpolants import Interpolant, interpolant
from keystab.scalespace.rounding import Rounding
from keystab.scalespace.sampling import Sampling, balanced_delta
from keystab.utils import memory
from keystab.utils.compiled_loops import tell_of_compilation
from keystab.utils.masks import unmasked
from keystab.utils.one_thread import one_thread

# A tile of the store; searching for extrema uses flatter blocks (see `keystab.detection.extrema`).
TILE = 128


@dataclass(frozen=True, eq=False)
class ScaleSpace:
    """A sampled difference-of-Gaussians scale-space, evaluated on request.

    Made by `scale_space`. Axes are always (scale, y, x).

    Attributes
    ----------
    image : ndarray, shape (height, width)
        The input image, float64.
    sampling : Sampling
        Scales, sampling step, grid and blurs.
    oversampling : {"spline", "cosine"}
        Interpolant of the input image.
    """

    image: np.ndarray
    sampling: Sampling
    oversampling: str = "spline"

    @property
    def shape(self) -> tuple[int, int, int]:
        """Number of slices, rows and columns."""
        return (self.sampling.n_slices, *self.sampling.grid_shape)

    @property
    def sigma(self) -> np.ndarray:
        """Scale of every slice in input pixels."""
        return self.sampling.sigma

    @property
    def y(self) -> np.ndarray:
        """Position of every row in input pixels."""
        return np.arange(self.shape[1]) * self.sampling.step

    @property
    def x(self) -> np.ndarray:
        """Position of every column in input pixels."""
        return np.arange(self.shape[2]) * self.sampling.step

    @property
    def n_tiles(self) -> tuple[int, int]:
        """Tiles in y and in x."""
        return (-(-self.shape[1] // TILE), -(-self.shape[2] // TILE))

    @property
    def interpolant(self) -> Interpolant:
        """Interpolant of the input image."""
        return interpolant(self.oversampling)

    @cached_property
    def source(self) -> np.ndarray:
        """What the axis operators act on: spline coefficients or cosine coefficients."""
        return self.interpolant.source(self.image)

    @cached_property
    def blurs(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Distinct blurs and, for each slice, the index of its lower and upper one."""
        return self.sampling.blurs()

    @cached_property
    def axes(self) -> tuple[AxisOperator, AxisOperator]:
        """Operators of the y axis and of the x axis."""
        blurs = tuple(self.blurs[0].tolist())
        y_axis, x_axis = (
            _axis(self.oversampling, m, n, self.sampling.delta_min, self.sampling.stride, blurs)
            for m, n in zip(self.sampling.base_grid_shape, self.sampling.shape, strict=True)
        )
        return (y_axis, x_axis)

    def window(
        self,
        slices: slice = slice(None),
        rows: slice = slice(None),
        columns: slice = slice(None),
    ) -> np.ndarray:
        """Difference-of-Gaussians values of a box of samples.

        Parameters
        ----------
        slices, rows, columns : slice
            Ranges of indices with step 1; the whole axis by default.

        Returns
        -------
        ndarray, shape (n_slices, n_rows, n_columns)
            Values as float64.

        Raises
        ------
        InputError
            If a range is empty or the box would take more memory than there is.
        """
        (s0, s1), (y0, y1), (x0, x1) = (
            _bounds(part, size, name)
            for part, size, name in zip(
                (slices, rows, columns), self.shape, ("slices", "rows", "columns"), strict=True
            )
        )
        n_bytes = 8 * (s1 - s0) * (y1 - y0) * (x1 - x0)
        memory.require(
            n_bytes,
            f"a window of {s1 - s0} x {y1 - y0} x {x1 - x0} samples",
            "ask for a smaller window or go tile by tile",
        )
        box = np.empty((s1 - s0, y1 - y0, x1 - x0))
        tile_rows = list(ranges(y0, y1, TILE))
        with one_thread():
            along = [self.axes[0].block(*part) for part in tile_rows]
            for left, right in ranges(x0, x1, TILE):
                blocks = self.blocks(along, (left, right), (s0, s1))
                for (top, bottom), dog in zip(tile_rows, blocks, strict=True):
                    box[:, top - y0 : bottom - y0, left - x0 : right - x0] = dog
        return box

    def blocks(
        self,
        along: list[Block],
        columns: tuple[int, int],
        slices: tuple[int, int],
    ) -> Iterator[np.ndarray]:
        """One column of blocks, from top to bottom.

        This is where all samples come from, except for single neighbourhoods.

        Parameters
        ----------
        along : list of Block
            Operators of the y axis for the rows of each block.
        columns : tuple of int
            First column and one past the last.
        slices : tuple of int
            First slice and one past the last.

        Yields
        ------
        ndarray, shape (n_slices, n_rows, n_columns)
            Values of a block. The array is used again for the next one.
        """
        lower, upper = (index[slice(*slices)] for index in self.blurs[1:])
        needed = np.unique([lower, upper])
        lower, upper = np.searchsorted(needed, lower), np.searchsorted(needed, upper)
        across = self.axes[1].block(*columns)
        # Products along x with every source row that some block needs, shared by all blocks.
        first = min(block.first[needed].min() for block in along)
        last = max(
            (block.first + np.diff(block.offset) // block.rank)[needed].max() for block in along
        )
        strips = np.empty((needed.size, last - first, across.rank))
        for blur, strip in zip(needed, strips, strict=True):
            matrix = across.factor(blur)
            left = across.first[blur]
            np.dot(self.source[first:last, left : left + matrix.shape[1]], matrix.T, out=strip)
        tallest = max(block.rank for block in along)
        blurred = np.empty((needed.size, tallest, across.rank))
        dog = np.empty((lower.size, tallest, across.rank))
        for block in along:
            multiply(
                needed,
                block.rank,
                block.first - first,
                block.offset,
                block.entries,
                strips,
                blurred,
            )
            subtract(blurred, lower, upper, block.rank, dog)
            yield dog[:, : block.rank]

    def scale_slice(self, index: int) -> np.ndarray:
        """One slice, shape (rows, columns)."""
        return self.window(slice(index, index + 1))[0]

    def tile(self, row: int, column: int) -> np.ndarray:
        """All scales of one tile, shape (n_slices, <= TILE, <= TILE)."""
        return self.window(
            slice(None),
            slice(row * TILE, min((row + 1) * TILE, self.shape[1])),
            slice(column * TILE, min((column + 1) * TILE, self.shape[2])),
        )

    def tiles(self) -> Iterator[tuple[int, int, np.ndarray]]:
        """All tiles with their row and column in the grid of tiles, row by row."""
        for row in range(self.n_tiles[0]):
            for column in range(self.n_tiles[1]):
                yield row, column, self.tile(row, column)

    def neighbourhoods(
        self, s: np.ndarray, row: np.ndarray, column: np.ndarray, tolerance: float = -1.0
    ) -> np.ndarray:
        """Cubes of 3 x 3 x 3 samples around given samples.

        Each cube is evaluated by itself, so that its digits depend on the image and the sampling
        only, not on tiles or on what else is asked for.

        Parameters
        ----------
        s, row, column : ndarray of int, shape (n,)
            Indices of the centres, at least one sample away from every end.
        tolerance : float
            From 0 on, cubes whose centre does not differ by more from all others, one way, may
            lack slices: these are NaN.

        Returns
        -------
        ndarray, shape (n, 3, 3, 3)
            Values, axes (sample, scale, y, x).
        """
        indices = [np.ascontiguousarray(i, dtype=np.int64) for i in (s, row, column)]
        _, lower, upper = self.blurs
        return self.interpolant.neighbourhoods(
            self.source, self.axes, lower, upper, *indices, tolerance=tolerance
        )

    @cached_property
    def largest(self) -> float:
        """Largest absolute value of the image."""
        return max(float(self.image.max()), -float(self.image.min()))

    @cached_property
    def rounding_bounds(self) -> Rounding:
        """How far rounding may take values from what exact arithmetic would give."""
        _, lower, upper = self.blurs
        return self.interpolant.rounding(self.image, self.source, self.axes, lower, upper)

    @property
    def rounding(self) -> float:
        """Smallest difference of two values that carries information.

        Where exact values are equal, as in flat areas or along straight edges, computed ones may
        differ by up to this, and would be extrema of nothing. The bound is proven from the sums
        that are formed (`keystab.scalespace.rounding`); what is seen is 30 to 2000 times smaller
        with splines, to 3000 with cosine series, whose terms cancel.
        """
        return self.rounding_bounds.counts

    def attributes(self) -> dict[str, object]:
        """Everything needed to build this scale-space again from its image."""
        return {**asdict(self.sampling), "oversampling": self.oversampling}


def scale_space(
    image: np.ndarray,
    camera_blur: float,
    n_spo: int = 3,
    delta_min: float | None = None,
    sigma_min: float = 1.1,
    kappa: float = 2 ** (1 / 3),
    oversampling: str = "spline",
    octave: int = 0,
    slices: tuple[int, int] | None = None,
) -> ScaleSpace:
    r"""Difference-of-Gaussians scale-space of an image (section 2 of the paper).

    .. math:: w(\sigma, x) = G_{\sqrt{\kappa^2\sigma^2 - c^2}} u (x)
              - G_{\sqrt{\sigma^2 - c^2}} u (x)

    at :math:`\sigma_s = \sigma_{min} 2^{s / n_{spo}}`, s = 0 .. n_spo + 1, and positions
    :math:`x = i \, \delta_{min}`.

    Parameters
    ----------
    image : array_like, shape (height, width)
        Grey image; the study uses values in [0, 1]. Pixel centres are at whole numbers.
    camera_blur : float
        Blur c that the image already has, in pixels, 0 <= c <= sigma_min.
    n_spo : int
        Scales per octave.
    delta_min : float, optional
        Sampling step of the fine grid in pixels; balanced (equation 23) when omitted.
    sigma_min : float
        Scale of the first slice.
    kappa : float
        Ratio of the two Gaussians.
    oversampling : {"spline", "cosine"}
        Interpolant: the cubic spline of the paper, or the exact cosine series.
    octave : int
        Octave to build; scales and sampling step double with each.
    slices : tuple of int, optional
        First slice and one past the last, for a window in scale that is not one octave.

    Returns
    -------
    ScaleSpace
        Lazy: nothing has been computed yet.

    Raises
    ------
    InputError
        If the image is not a finite two-dimensional array or a parameter is out of its range.

    Notes
    -----
    Borders: the image is continued by its half-sample mirror. In the spline mode the mirror lies
    half a fine sample beyond the last fine sample and hence moves with `delta_min`; keypoints
    within some blurs of the right and lower border are not comparable across samplings.

    Examples
    --------
    >>> space = scale_space(np.eye(12), camera_blur=0.5, n_spo=3)
    >>> space.shape
    (5, 23, 23)
    >>> space.tile(0, 0).shape
    (5, 23, 23)
    """
    interpolant(oversampling)
    array = checked_image(image)
    tell_of_compilation()
    if delta_min is None:
        delta_min = balanced_delta(n_spo, kappa, sigma_min)
    sampling = Sampling(
        (array.shape[0], array.shape[1]),
        camera_blur,
        n_spo,
        delta_min,
        sigma_min,
        kappa,
        octave,
        slices,
    )
    return ScaleSpace(array, sampling, oversampling)


@lru_cache(maxsize=8)
def _axis(
    oversampling: str,
    n_samples: int,
    n_pixels: int,
    delta_min: float,
    stride: int,
    blurs: tuple[float, ...],
) -> AxisOperator:
    """Operator of one axis, shared by all images of one size that are sampled alike."""
    return interpolant(oversampling).axis(n_samples, n_pixels, delta_min, stride, np.array(blurs))


def checked_image(image: np.ndarray) -> np.ndarray:
    """A finite two-dimensional float64 array, or an `InputError` that says what is wrong."""
    if isinstance(image, (str, os.PathLike)):
        raise InputError(
            f"the image is the path {os.fspath(image)!r}: give its pixels, "
            "keystab.read_picture(path)"
        )
    array = np.asarray(unmasked("the image", image))
    if array.dtype == bool or not (
        np.issubdtype(array.dtype, np.integer) or np.issubdtype(array.dtype, np.floating)
    ):
        raise InputError(f"the image holds {array.dtype} values: give real numbers")
    if array.ndim == 3 and array.shape[2] in (3, 4):
        raise InputError(
            f"the image has shape {array.shape}, which is colour: give one grey value per pixel, "
            "(height, width), as keystab.read_picture does, or "
            "image[..., :3] @ (0.299, 0.587, 0.114)"
        )
    if array.ndim != 2 or array.size == 0:
        raise InputError(
            f"the image has shape {array.shape}: give one grey value per pixel, (height, width)"
        )
    array = np.ascontiguousarray(array, dtype=np.float64)
    if not np.isfinite(array).all():
        bad = np.argwhere(~np.isfinite(array))
        raise InputError(
            f"the image has {len(bad)} NaN or infinite pixels, the first at (y, x) = "
            f"({bad[0][0]}, {bad[0][1]}): replace them by finite values"
        )
    return array


def _bounds(part: slice, size: int, name: str) -> tuple[int, int]:
    start, stop, step = part.indices(size)
    if step != 1 or stop <= start:
        raise InputError(
            f"{name} are {part}, allowed is a non-empty range with step 1 within 0 .. {size}: "
            f"change {name}"
        )
    return start, stop


def ranges(start: int, stop: int, length: int) -> Iterator[tuple[int, int]]:
    """Cut start .. stop into parts of `length`, the last one shorter."""
    for first in range(start, stop, length):
        yield first, min(first + length, stop)


@njit(cache=True, nogil=True)
def multiply(needed, rank, first, offset, entries, strips, blurred):
    """Products along y of one block, for every needed blur.

    Compiled, so that threads need not take turns between one small product and the next.
    """
    for k in range(needed.size):
        blur = needed[k]
        here = entries[offset[blur] : offset[blur + 1]]
        width = here.size // rank
        source = strips[k, first[blur] : first[blur] + width]
        np.dot(here.reshape(rank, width), source, out=blurred[k, :rank])


@njit(cache=True, nogil=True)
def subtract(blurred, lower, upper, height, dog):
    """Difference of the two Gaussians of every slice, for the first `height` rows."""
    for s in range(lower.size):
        for y in range(height):
            high, low, out = blurred[upper[s], y], blurred[lower[s], y], dog[s, y]
            for x in range(out.size):
                out[x] = high[x] - low[x]
