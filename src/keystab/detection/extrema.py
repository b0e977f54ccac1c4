"""Discrete extrema of a sampled scale-space.

A sample is an extremum when it lies strictly above, or strictly below, all of its 26 neighbours
(section 2.1 of the paper). The first and the last slice and the border samples of the grid have no
complete neighbourhood and are never extrema.

The search has two steps. Blocks of samples are evaluated and looked through; what may be an
extremum there is decided from its own neighbourhood, so that the result depends neither on how the
grid was cut into blocks nor on whether the values come from a store.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from functools import partial
from typing import Any

import numpy as np
from numba import njit

from keystab.detection.search_lattice import LatticeSearch, applies
from keystab.errors import InputError
from keystab.scalespace.axis import Block
from keystab.scalespace.dog import ScaleSpace, ranges
from keystab.utils import memory, validation
from keystab.utils.one_thread import one_thread
from keystab.utils.progress import progress, progress_if_watched

# Blocks in which extrema are sought: flat ones, because the number of source rows that a block
# needs grows with its height, and wide ones, because the products along x are shared by a whole
# column of blocks. All slices of a block stay in the cache of a core (22 Gaussians: 1.5 MB).
BLOCK_ROWS = 32
BLOCK_COLUMNS = 256

# Rows whose operators are held at once: bounds the memory on large images.
BAND_ROWS = 8192

# Samples that one search may meet: 40 minutes of one core for the spline at n_spo = 15, and hours
# where all samples are evaluated.
MOST_SAMPLES = 10**12

Decided = tuple[np.ndarray, np.ndarray]
"""Extrema, shape (n, 4), and their cubes of samples, shape (n, 3, 3, 3)."""


def discrete_extrema(
    space: ScaleSpace,
    epsilon: float = 0.0,
    threads: int = 1,
    show_progress: bool = False,
    window: tuple[slice, slice] | None = None,
) -> np.ndarray:
    """Find all discrete extrema of one octave, block by block.

    Parameters
    ----------
    space : ScaleSpace
        The octave; it is never held as a whole.
    epsilon : float
        An extremum differs by more than this from each of its 26 neighbours. Differences that
        rounding alone can explain (`ScaleSpace.rounding`) never count.
    threads : int
        Blocks searched at once. The result does not depend on it.
    show_progress : bool
        Whether to report progress on standard error.
    window : (slice, slice), optional
        Rows and columns whose extrema are asked for; all by default.

    Returns
    -------
    ndarray of int64, shape (n, 4)
        Slice s, row, column and sign (+1 maximum, -1 minimum), ordered by s, row, column.

    Raises
    ------
    InputError
        If `epsilon` is negative or not finite, `threads` is less than 1, the memory does not
        suffice, or there are more than 1e12 samples, which would take an hour or more.
    """
    return extrema_and_cubes(space, epsilon, threads, show_progress, window)[0]


def extrema_and_cubes(
    space: ScaleSpace,
    epsilon: float = 0.0,
    threads: int = 1,
    show_progress: bool = False,
    window: tuple[slice, slice] | None = None,
) -> Decided:
    """Discrete extrema with their neighbourhoods, which have decided that they are extrema.

    Parameters, order and errors are those of `discrete_extrema`.

    Returns
    -------
    extrema : ndarray of int64, shape (n, 4)
        As from `discrete_extrema`.
    cubes : ndarray, shape (n, 3, 3, 3)
        As from `ScaleSpace.neighbourhoods`.
    """
    validation.number("epsilon", epsilon, least=0)
    validation.integer("threads", threads, least=1)
    asked = inner_window(space, window)
    _require_an_end(space, threads, asked)
    tolerance = max(epsilon, space.rounding)
    space.source, space.axes, space.blurs  # noqa: B018  made once, before threads share them
    what = f"extrema, n_spo {space.sampling.n_spo}"
    report = progress if show_progress else progress_if_watched
    found = [decided(space, np.empty((0, 4), dtype=np.int64), tolerance)]
    with one_thread(), _workers(threads) as pool:
        for find, columns in _searches(space, tolerance, pool, threads, asked):
            candidates = pool.map(find, columns)
            # Decided once all columns are given out: short tasks for threads that have none left.
            tasks = [
                pool.submit(decided, space, some, tolerance)
                for some in report(candidates, len(columns), what)
            ]
            found += [task.result() for task in tasks]
    extrema, cubes = (np.concatenate(parts) for parts in zip(*found, strict=True))
    found.clear()
    # Blocks may overlap by the samples that have no neighbours in one of them.
    _, first = np.unique(numbered(space, extrema), return_index=True)
    first = first[within(extrema[first], window)]
    return extrema[first], cubes[first]


def numbered(space: ScaleSpace, places: np.ndarray) -> np.ndarray:
    """Numbers of samples, by slice, row and column: single ones are sorted faster than rows."""
    number: np.ndarray = np.ravel_multi_index(tuple(places[:, :3].T), space.shape)
    return number


class _Caller(Executor):
    """Calls at once what a pool of one thread would call, without the thread."""

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """The result of a call."""
        done: Future[Any] = Future()
        done.set_result(fn(*args, **kwargs))
        return done


def _workers(threads: int) -> Executor:
    return _Caller() if threads == 1 else ThreadPoolExecutor(threads)


def _require_an_end(space: ScaleSpace, threads: int, asked: tuple[slice, slice]) -> None:
    """Refuse a search that the memory, or the patience of whoever waits, does not suffice for."""
    height, width = space.sampling.shape
    what = f"a search of {height} x {width} pixels at n_spo = {space.sampling.n_spo}, delta_min = "
    what += f"{space.sampling.delta_min:.4g}"
    remedy = "crop the picture, or use fewer scales or a larger delta_min"
    n_samples = space.shape[0] * math.prod(max(part.stop - part.start, 0) for part in asked)
    if n_samples > MOST_SAMPLES:
        raise InputError(
            f"{what} meets {n_samples:.2g} samples, allowed are {MOST_SAMPLES:.0g} (an hour or "
            f"more): {remedy}"
        )
    memory.require(bytes_of_search(space, threads), what, remedy)


def inner_window(
    space: ScaleSpace, window: tuple[slice, slice] | None = None
) -> tuple[slice, slice]:
    """Rows and columns of a window, or of all, that have neighbours on both sides."""
    inner = tuple(slice(1, max(size - 1, 1)) for size in space.shape[1:])
    if window is not None:
        inner = tuple(
            slice(max(asked.start, have.start), min(asked.stop, have.stop))
            for asked, have in zip(window, inner, strict=True)
        )
    return inner[0], inner[1]


def within(extrema: np.ndarray, window: tuple[slice, slice] | None) -> np.ndarray:
    """Which extrema lie in some rows and columns; all where there is no window."""
    inside = np.ones(len(extrema), dtype=bool)
    if window is not None:
        for position, asked in zip(extrema[:, 1:3].T, window, strict=True):
            inside &= (position >= asked.start) & (position < asked.stop)
    return inside


def _searches(
    space: ScaleSpace,
    tolerance: float,
    pool: Executor,
    threads: int,
    window: tuple[slice, slice],
) -> Iterator[tuple[Callable[[Any], np.ndarray], Sequence[Any]]]:
    """What finds the candidates of parts of the samples, and the parts, band by band."""
    columns = list(ranges(window[1].start, window[1].stop, BLOCK_COLUMNS))
    for top, bottom in ranges(window[0].start, window[0].stop, BAND_ROWS):
        if applies(space):
            few = LatticeSearch(space, tolerance, (slice(top, bottom), window[1]), threads)
            yield partial(_found_by, few), few.parts
        else:
            rows = list(ranges(top, bottom, BLOCK_ROWS))
            along = list(pool.map(lambda r: space.axes[0].block(r[0] - 1, r[1] + 1), rows))
            yield partial(_evaluated, space, rows, along, tolerance), columns


def _found_by(search: LatticeSearch, part: Any) -> np.ndarray:
    """Candidates of one part, from few samples and a bound on what lies between."""
    candidates, undecided = search.candidates(part)
    rest = []
    for rows, columns in undecided:
        closer = search.closer(rows, columns)
        if closer is None:
            rest.append(_of_region(search.space, search.tolerance, rows, columns))
        else:
            rest += [_found_by(closer, again) for again in closer.parts]
    return np.concatenate([candidates, *rest])


def _of_region(space: ScaleSpace, tolerance: float, rows: slice, columns: slice) -> np.ndarray:
    """Candidates among all samples of a region, which may extend beyond the grid."""
    (top, bottom), (left, right) = (
        (max(part.start - 1, 0), min(part.stop + 1, n))
        for part, n in zip((rows, columns), space.shape[1:], strict=True)
    )
    if bottom - top < 3 or right - left < 3:
        return np.empty((0, 4), dtype=np.int64)
    blocks = list(ranges(top + 1, bottom - 1, BLOCK_ROWS))
    along = [space.axes[0].block(first - 1, last + 1) for first, last in blocks]
    parts = ranges(left + 1, right - 1, BLOCK_COLUMNS)
    return np.concatenate([_evaluated(space, blocks, along, tolerance, part) for part in parts])


def _evaluated(
    space: ScaleSpace,
    rows: list[tuple[int, int]],
    along: list[Block],
    tolerance: float,
    columns: tuple[int, int],
) -> np.ndarray:
    """Candidates of one column of blocks, from all its samples; blocks have one sample around."""
    first, last = columns[0] - 1, columns[1] + 1
    blocks = space.blocks(along, (first, last), (0, space.shape[0]))
    return np.concatenate(
        [
            extrema_of_array(dog, tolerance - space.rounding_bounds.between, (top - 1, first))
            for (top, _), dog in zip(rows, blocks, strict=True)
        ]
    )


def decided(space: ScaleSpace, candidates: np.ndarray, tolerance: float) -> Decided:
    """Decide which samples are extrema, each from its own neighbourhood.

    Parameters
    ----------
    space : ScaleSpace
        The octave.
    candidates : ndarray of int64, shape (n, 4)
        Slice, row and column of samples, each once or more often; the fourth column is not used.
    tolerance : float
        By how much an extremum differs from each of its 26 neighbours.

    Returns
    -------
    extrema : ndarray of int64, shape (m, 4)
        The extrema among them with their signs, ordered by s, row, column.
    cubes : ndarray, shape (m, 3, 3, 3)
        Their neighbourhoods.
    """
    places = np.stack(np.unravel_index(np.unique(numbered(space, candidates)), space.shape), axis=1)
    s, row, column = places.T
    cubes = space.neighbourhoods(s, row, column, tolerance)
    around = cubes.reshape(-1, 27)
    difference = np.delete(around[:, 13:14] - around, 13, axis=1)
    sign = (difference > tolerance).all(axis=1).astype(np.int64)
    sign -= (difference < -tolerance).all(axis=1)
    return np.column_stack([places, sign])[sign != 0], cubes[sign != 0]


def bytes_of_search(space: ScaleSpace, threads: int = 1) -> float:
    """Estimate the memory that `discrete_extrema` takes, in bytes.

    The image, its coefficients and what making them takes; for each blur the operators of a band
    of rows, and one strip of columns as high as the picture per thread, of all rows and columns or,
    where others are interpolated, of a third of them; candidates. Measured peaks are 0.4 to 0.9 of
    this.
    """
    sampling = space.sampling
    height, width = sampling.shape
    n_blurs = space.blurs[0].size
    reached = space.interpolant.rows_in_reach(sampling.kappa * float(sampling.sigma[-1]), height)
    band = 2.0 * n_blurs * min(BAND_ROWS, sampling.grid_shape[0]) * reached
    strips = 2.0 * n_blurs * BLOCK_COLUMNS * height * threads
    axes = 8 * sum(sampling.base_grid_shape)
    blocks = 6 * n_blurs * BLOCK_ROWS * BLOCK_COLUMNS * threads
    if applies(space):
        band, strips = band / 3, strips / 3
    return 8.0 * (6 * height * width + axes + blocks + band + strips)


def extrema_of_array(
    dog: np.ndarray, epsilon: float, offset: tuple[int, int] = (0, 0)
) -> np.ndarray:
    """Discrete extrema among the inner samples of values held in memory.

    Parameters
    ----------
    dog : ndarray, shape (n_slices, n_rows, n_columns)
        Difference-of-Gaussians values, for example a tile with one sample around it.
    epsilon : float
        See `discrete_extrema`.
    offset : tuple of int
        Row and column of the first sample of `dog`, added to the result.

    Returns
    -------
    ndarray of int64, shape (n, 4)
        Slice, row, column, sign.

    Examples
    --------
    >>> dog = np.zeros((3, 3, 3))
    >>> dog[1, 1, 1] = -2.0
    >>> extrema_of_array(dog, 0.0)
    array([[ 1,  1,  1, -1]])
    """
    capacity = 64
    while True:
        extrema = np.empty((capacity, 4), dtype=np.int64)
        count = _scan(dog, epsilon, extrema)
        if count <= capacity:
            break
        capacity = count
    extrema = extrema[:count]
    extrema[:, 1] += offset[0]
    extrema[:, 2] += offset[1]
    return extrema


@njit(cache=True, nogil=True)
def _scan(dog, epsilon, extrema):
    """Write extrema until `extrema` is full; return how many there are.

    Almost all rows hold none. Whether a row does is asked of its six nearest neighbours without a
    branch, which the compiler turns into vector instructions; only then the row is looked at
    sample by sample.
    """
    n_slices, n_rows, n_columns = dog.shape
    # Slightly tolerant, so that rounding of "value - epsilon" hides nothing that counts: the bound
    # is far above the last digit of the samples (see ScaleSpace.rounding).
    slack = epsilon * (1 - 1e-9)
    count = 0
    for s in range(1, n_slices - 1):
        for y in range(1, n_rows - 1):
            here, above, below = dog[s, y], dog[s, y - 1], dog[s, y + 1]
            finer, coarser = dog[s - 1, y], dog[s + 1, y]
            any_here = False
            for x in range(1, n_columns - 1):
                low, high = here[x] - slack, here[x] + slack
                maximum = (
                    (here[x - 1] < low)
                    & (here[x + 1] < low)
                    & (above[x] < low)
                    & (below[x] < low)
                    & (finer[x] < low)
                    & (coarser[x] < low)
                )
                minimum = (
                    (here[x - 1] > high)
                    & (here[x + 1] > high)
                    & (above[x] > high)
                    & (below[x] > high)
                    & (finer[x] > high)
                    & (coarser[x] > high)
                )
                any_here |= maximum | minimum
            if any_here:
                for x in range(1, n_columns - 1):
                    sign = _sign(dog, s, y, x, epsilon)
                    if sign != 0:
                        if count < extrema.shape[0]:
                            extrema[count, 0] = s
                            extrema[count, 1] = y
                            extrema[count, 2] = x
                            extrema[count, 3] = sign
                        count += 1
    return count


@njit(cache=True, nogil=True)
def _sign(dog, s, y, x, epsilon):
    """+1 for a maximum among 26 neighbours, -1 for a minimum, else 0."""
    value = dog[s, y, x]
    sign = 1 if value - dog[s, y, x - 1] > 0 else -1
    for ds in range(-1, 2):
        for dy in range(-1, 2):
            for dx in range(-1, 2):
                if ds == 0 and dy == 0 and dx == 0:
                    continue
                if not sign * (value - dog[s + ds, y + dy, x + dx]) > epsilon:
                    return 0
    return sign
