"""Extrema as they are found in single precision (section 5.2, "Discrete extrema").

Published detectors hold images as float32. The Gaussians of neighbouring samples then agree in most
of their digits, and the more so the finer the sampling, until a difference of Gaussians is made of
rounding. Three degrees of it are simulated:

- ``float32``: every Gaussian is computed in double precision and rounded once, to the last digit of
  float32; differences and comparisons are in float32. No program does so: it is the best that
  numbers of 32 bits allow, and a lower bound on what single precision does.
- ``float32_sums``: the same sums over the same pixels, with weights, products and sums in float32.
- ``float32_transforms``: the paper's own way, a spline on the fine grid and its cosine transforms,
  with all steps in float32. How far a transform is off depends on the prime factors of the grid's
  sides, so that these can be asked for.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from numba import njit
from numpy.typing import NDArray

from keystab.detection.extrema import Decided, discrete_extrema, extrema_of_array
from keystab.errors import InputError
from keystab.scalespace.dog import ScaleSpace, ranges
from keystab.scalespace.spline_axis import spline_rows
from keystab.utils import validation
from keystab.utils.one_thread import one_thread

# Samples a side of the blocks that are searched: all Gaussians of one are held at once.
_BLOCK = 256

# Transfer functions below this change no digit: it is a billionth of the last one.
_NOTHING = 1e-16

# Mirrored coefficients on either side, as `spline_rows` counts them.
_PADDING = 2


def single_precision_window(
    space: ScaleSpace,
    rows: tuple[int, int],
    columns: tuple[int, int],
    grey_range: float = 1.0,
    sums: bool = False,
) -> NDArray[np.float32]:
    """Difference of Gaussians of a box of samples, of Gaussians in single precision.

    Parameters
    ----------
    space : ScaleSpace
        The scale-space.
    rows, columns : tuple of int
        First and one past the last.
    grey_range : float
        What grey values are multiplied by before they are rounded, such as 255.
    sums : bool
        Whether sums are in single precision too; else a Gaussian is rounded once, when it is there.

    Returns
    -------
    ndarray of float32, shape (n_slices, n_rows, n_columns)
        In units of `grey_range`.
    """
    _, lower, upper = space.blurs
    # Sums of an image are off by more than those without its mean, which every Gaussian keeps.
    whole = ((space.source + space.image.mean()) * grey_range).astype(np.float32) if sums else None
    with one_thread():
        along, across = (
            axis.block(*part) for axis, part in zip(space.axes, (rows, columns), strict=True)
        )
        gaussians = []
        for blur in range(len(along.first)):
            left, right = along.factor(blur), across.factor(blur)
            top, first = along.first[blur], across.first[blur]
            box = np.s_[top : top + left.shape[1], first : first + right.shape[1]]
            if whole is not None:
                across_it = _product(right.astype(np.float32), np.ascontiguousarray(whole[box].T))
                gaussians.append(
                    _product(left.astype(np.float32), np.ascontiguousarray(across_it.T))
                )
                continue
            blurred = left @ space.source[box] @ right.T
            gaussians.append(((blurred + space.image.mean()) * grey_range).astype(np.float32))
    return np.stack([gaussians[b] - gaussians[a] for a, b in zip(lower, upper, strict=True)])


@njit(cache=True, nogil=True)
def _product(weights, values):
    """Product of two matrices, each sum in its order, so that it is the same on all machines."""
    result = np.zeros((weights.shape[0], values.shape[1]), dtype=np.float32)
    for i in range(weights.shape[0]):
        for k in range(weights.shape[1]):
            weight = weights[i, k]
            if weight != 0:  # rows of a block hold each other's columns
                for j in range(values.shape[1]):
                    result[i, j] += weight * values[k, j]
    return result


def single_precision_extrema(
    space: ScaleSpace, epsilon: float = 0.0, grey_range: float = 1.0
) -> NDArray[np.int64]:
    """Discrete extrema of a scale-space that is held in single precision.

    Parameters
    ----------
    space : ScaleSpace
        The octave.
    epsilon : float
        By how much an extremum differs from each of its 26 neighbours, in units of `grey_range`.
    grey_range : float
        See `single_precision_window`.

    Returns
    -------
    ndarray of int64, shape (n, 4)
        Slice s, row, column and sign, ordered by s, row, column.

    Raises
    ------
    InputError
        If `epsilon` is negative or `grey_range` not above 0.

    Examples
    --------
    >>> from keystab.scalespace.dog import scale_space
    >>> flat = scale_space(np.full((12, 12), 0.5), camera_blur=1.1, n_spo=5)
    >>> len(single_precision_extrema(flat))
    0
    """
    return _of_blocks(space, epsilon, grey_range, sums=False)[0]


def _of_blocks(space: ScaleSpace, epsilon: float, grey_range: float, sums: bool) -> Decided:
    """Extrema and their neighbourhoods, block by block, see `single_precision_window`."""
    validation.number("epsilon", epsilon, least=0)
    validation.number("grey_range", grey_range, above=0)
    n_rows, n_columns = space.shape[1:]
    found = []
    for top, bottom in ranges(1, n_rows - 1, _BLOCK):
        for left, right in ranges(1, n_columns - 1, _BLOCK):
            box = (top - 1, bottom + 1), (left - 1, right + 1)
            window = single_precision_window(space, *box, grey_range, sums)
            found.append(_with_cubes(window, epsilon, (top - 1, left - 1)))
    return _joined(found)


def _with_cubes(
    window: NDArray[np.float32], epsilon: float, offset: tuple[int, int], slice_offset: int = 0
) -> Decided:
    """Extrema of samples in single precision, and their neighbourhoods as they are there."""
    extrema = extrema_of_array(window, epsilon)
    around = np.arange(-1, 2)
    s, row, column = (extrema[:, k, None] + around for k in range(3))
    cubes = window[s[:, :, None, None], row[:, None, :, None], column[:, None, None, :]]
    return extrema + [slice_offset, *offset, 0], cubes.astype(np.float64)


def _joined(found: list[Decided]) -> Decided:
    """All of them, ordered by slice, row, column."""
    extrema = np.concatenate([np.empty((0, 4), dtype=np.int64), *(each[0] for each in found)])
    cubes = np.concatenate([np.empty((0, 3, 3, 3)), *(each[1] for each in found)])
    order = np.lexsort((extrema[:, 2], extrema[:, 1], extrema[:, 0]))
    return extrema[order], cubes[order]


def transformed_slices(
    space: ScaleSpace, grey_range: float = 1.0, sides: str = "small"
) -> Iterator[NDArray[np.float32]]:
    """Differences of Gaussians in single precision, by cosine transforms of the fine grid.

    The image and the transfer functions of the Gaussians are rounded to float32; spline
    coefficients, samples of the fine grid, its transform, the products, the inverse transforms and
    their differences are computed in float32.

    Parameters
    ----------
    space : ScaleSpace
        The octave, of a spline.
    grey_range : float
        What grey values are multiplied by, such as 255.
    sides : {"small", "large"}
        Prime factors of the sides of the grid. To have them, the grid is continued by its mirror
        image: to the next side with factors of 2, 3 and 5, or to the next prime.

    Yields
    ------
    ndarray of float32, shape (n_rows, n_columns)
        One slice after the other, on the grid of `space`, in units of `grey_range`.

    Raises
    ------
    InputError
        For a scale-space of another interpolant, other sides, or an octave beyond the first.
    """
    from scipy import fft

    sampling = space.sampling
    if space.oversampling != "spline" or sampling.stride != 1 or sides not in SIDES:
        raise InputError(
            f"transforms in single precision of a {space.oversampling}, octave "
            f"{sampling.octave}, sides {sides!r}: allowed are a spline, octave 0 and sides "
            f"{' or '.join(SIDES)}"
        )
    fine = _fine_samples(space, grey_range)
    n_rows, n_columns = fine.shape
    size = tuple(SIDES[sides](n) for n in fine.shape)
    fine = np.pad(fine, [(0, m - n) for n, m in zip(fine.shape, size, strict=True)], "symmetric")
    spectrum = fft.dctn(fine, overwrite_x=True)
    frequency = [np.pi / sampling.delta_min / m * np.arange(m) for m in size]

    def gaussian(blur: float) -> NDArray[np.float32]:
        # Rounded from double precision: exp differs in its last digit between processors.
        along, across = (np.exp(-0.5 * (blur * f) ** 2).astype(np.float32) for f in frequency)
        # Columns of factors that are below the last digit of any sum are not transformed.
        kept = np.flatnonzero(across > _NOTHING)[-1] + 1
        part = fft.idct(spectrum[:, :kept] * along[:, None] * across[:kept], axis=0)
        whole = fft.idct(part, n=size[1], axis=1, overwrite_x=True)
        return np.asarray(whole[:n_rows, :n_columns])

    blurs, *pairs = space.blurs
    lower, upper = (each.tolist() for each in pairs)
    held: dict[int, NDArray[np.float32]] = {}  # Gaussians that a later slice subtracts
    for a, b in zip(lower, upper, strict=True):
        below, above = (held[n] if n in held else gaussian(blurs[n]) for n in (a, b))
        held = {n: each for n, each in (*held.items(), (b, above)) if n > a and n in lower}
        yield above - below


def _fine_samples(space: ScaleSpace, grey_range: float) -> NDArray[np.float32]:
    """Cubic spline through the pixels on the fine grid, in single precision."""
    from scipy.linalg import solve_banded

    values = (space.image * grey_range).astype(np.float32)
    shapes = zip(space.sampling.grid_shape, space.sampling.shape, strict=True)
    for n_samples, n_pixels in shapes:
        if n_pixels > 1:
            bands = np.repeat([[1 / 6], [4 / 6], [1 / 6]], n_pixels, axis=1).astype(np.float32)
            bands[0, 1] = bands[2, -2] = 2 / 6  # as `keystab.scalespace.spline_axis` has it
            values = solve_banded((1, 1), bands, values)
        values = np.pad(values, ((_PADDING, _PADDING), (0, 0)), "symmetric")
        column, weight = spline_rows(n_samples, n_pixels, space.sampling.delta_min)
        weights = weight.astype(np.float32)[:, :, None]
        values = sum(weights[:, k] * values[column + k] for k in range(4)).T
    return np.ascontiguousarray(values, dtype=np.float32)


def _next_prime(n: int) -> int:
    """Smallest prime that is not below a number."""
    while any(n % k == 0 for k in range(2, math.isqrt(n) + 1)):
        n += 1
    return n


def _next_smooth(n: int) -> int:
    """Smallest number with factors of 2, 3 and 5 that is not below another."""
    from scipy.fft import next_fast_len

    return int(next_fast_len(n, real=True))


SIDES = {"small": _next_smooth, "large": _next_prime}
"""Prime factors of the sides of a grid that is transformed: how the next such side is found."""


def _of_transforms(space: ScaleSpace, epsilon: float, grey_range: float, sides: str) -> Decided:
    """Extrema and their neighbourhoods, of three slices at a time."""
    validation.number("epsilon", epsilon, least=0)
    validation.number("grey_range", grey_range, above=0)
    found: list[Decided] = []
    three = np.empty((3, *space.shape[1:]), dtype=np.float32)
    for number, values in enumerate(transformed_slices(space, grey_range, sides)):
        three[:-1] = three[1:]
        three[-1] = values
        if number >= 2:
            found.append(_with_cubes(three, epsilon, (0, 0), number - 2))
    return _joined(found)


def extrema_in_arithmetic(
    space: ScaleSpace,
    arithmetic: str,
    epsilon: float = 0.0,
    grey_range: float = 1.0,
    sides: str = "small",
) -> tuple[NDArray[np.int64], NDArray[np.float64] | None]:
    """Discrete extrema of a scale-space, computed in a number type (figure floor).

    Parameters
    ----------
    space : ScaleSpace
        The octave.
    arithmetic : {"float64", "float32", "float32_sums", "float32_transforms"}
        See the head of this module.
    epsilon : float
        By how much an extremum differs from each of its 26 neighbours, in units of `grey_range`.
        Not used in double precision, where the table of extrema says by how much they differ.
    grey_range : float
        What grey values are multiplied by before they are rounded, such as 255.
    sides : {"small", "large"}
        See `transformed_slices`.

    Returns
    -------
    extrema : ndarray of int64, shape (n, 4)
        Slice s, row, column and sign, ordered by s, row, column.
    cubes : ndarray, shape (n, 3, 3, 3), or None
        Their neighbourhoods as single precision has them, of grey values in [0, 1]; None where
        those of double precision describe them.
    """
    if arithmetic == "float64":
        return discrete_extrema(space), None
    if arithmetic == "float32":
        return single_precision_extrema(space, epsilon, grey_range), None
    if arithmetic == "float32_sums":
        found, cubes = _of_blocks(space, epsilon, grey_range, sums=True)
    else:
        found, cubes = _of_transforms(space, epsilon, grey_range, sides)
    return found, cubes / grey_range


def quantised(image: NDArray[np.float64], bits: int | None) -> NDArray[np.float64]:
    """Round an image to the grey values that integers of some bits can hold.

    Parameters
    ----------
    image : ndarray
        Grey values in [0, 1].
    bits : int or None
        Bits of a pixel; None leaves the image as it is.

    Returns
    -------
    ndarray of float64

    Examples
    --------
    >>> quantised(np.array([0.1, 0.5, 1.2]), 1).tolist()
    [0.0, 0.0, 1.0]
    """
    if bits is None:
        return image
    most = 2**bits - 1
    rounded: NDArray[np.float64] = np.round(np.clip(image, 0.0, 1.0) * most) / most
    return rounded
