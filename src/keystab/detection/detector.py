"""Keypoint detection: discrete extrema, their refinement, and the seams between octaves."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import pandas as pd

from keystab.detection.extrema import extrema_and_cubes
from keystab.detection.refinement import (
    GRADIENT_COLUMNS,
    HESSIAN_COLUMNS,
    MOST_MODELS,
    MOVES,
    Columns,
    positions_of,
    quadratic_model,
    refined,
    stationary_point,
    traced,
)
from keystab.errors import InputError
from keystab.scalespace.dog import ScaleSpace, checked_image, scale_space
from keystab.utils import validation


def detect_keypoints(
    image: np.ndarray,
    camera_blur: float,
    n_spo: int = 3,
    delta_min: float | None = None,
    sigma_min: float = 1.1,
    kappa: float = 2 ** (1 / 3),
    oversampling: str = "spline",
    epsilon: float = 0.0,
    refine: bool = True,
    max_offset: float = 0.6,
    max_iterations: float = 2,
    scale_moves: bool = True,
    move: str = "nearest",
    n_oct: int | str = 1,
    threads: int = 1,
) -> pd.DataFrame:
    """Detect the keypoints of an image, without any filter of contrast or edges.

    Implements the detector of sections 2 and 4 of the paper.

    Parameters
    ----------
    image : array_like, shape (height, width)
        Grey image; pixel centres at whole numbers, (0, 0) top left. The study uses values in
        [0, 1]; positions do not depend on the range when `epsilon` is 0.
    camera_blur : float
        Gaussian blur c that the image already has, in pixels, 0 <= c <= sigma_min.
    n_spo : int
        Scales per octave.
    delta_min : float, optional
        Distance of fine samples in pixels; balanced with `n_spo` (equation 23) when omitted.
    sigma_min : float
        First scale in pixels.
    kappa : float
        Ratio of the two blurs of the difference of Gaussians, above 1.
    oversampling : {"spline", "cosine"}
        Interpolant of the image: the paper's cubic spline or the exact cosine series.
    epsilon : float
        By how much an extremum exceeds each of its 26 neighbours, in units of the image.
    refine : bool
        Whether extrema are refined, and discarded where that fails. False gives the discrete
        extrema at their grid positions.
    max_offset : float
        M_offset, largest accepted offset of the quadratic model in grid steps.
    max_iterations : float
        N_interp, most quadratic models for one extremum; ``math.inf`` for no limit.
    scale_moves : bool
        Whether a further model may be made at another scale index.
    move : {"nearest", "unit_step"}
        Where a further model is made, see `keystab.detection.refinement.trace`.
    n_oct : int or "all"
        Octaves; scales and sampling step double with each. All are those up to a quarter of the
        picture's shorter side.
    threads : int
        Threads of the search. The result does not depend on it.

    Returns
    -------
    DataFrame
        One row per keypoint: ``y, x, sigma`` in pixels, DoG ``value``, ``sign`` (+1 maximum, -1
        minimum), ``octave``; the discrete extremum's ``s, row, column`` in the grid of its octave
        and its smallest absolute ``difference`` to a neighbour; with `refine` also the number of
        ``models`` made. A constant image gives no rows.

    Raises
    ------
    InputError
        For an image that is not a finite two-dimensional array or of which a part is masked, a
        parameter out of its range, or a search that takes more memory than there is or meets more
        than 1e12 samples.

    Notes
    -----
    The grid has samples at 0, step, 2 step, ... below the height, as in the paper, so that it
    begins at the centre of the first row of pixels and ends beyond that of the last, at
    ``height - 1``. With `refine`,
    ``(1 - max_offset) step < y < height - delta_min - (1 - max_offset) step``, where the step of an
    octave is ``delta_min * 2**octave``; likewise ``x``. What lies beyond ``height - 0.5`` is found
    in the mirror image by which the picture is continued. Where that matters keep the rows with
    ``y <= height - 1`` and ``x <= width - 1``.

    Slices s = 1 .. n_spo of each octave are reported, so that octaves meet without overlap. Where
    they meet, an extremum may be seen from both sides or from none, because the two grids differ.
    Therefore, with more than one octave, both are searched one slice beyond the seam; detections of
    one extremum on both grids are recognised (same sign, within 1.5 samples of the coarser grid and
    one scale step) and the refined scale on the finer grid decides which octave reports it. The
    first of several octaves can thus differ from a single one at its upper end.

    Examples
    --------
    A Gaussian blob of standard deviation s before the camera is found at s / sqrt(kappa):

    >>> y, x = np.mgrid[:41, :41]
    >>> blob = np.exp(-((y - 20) ** 2 + (x - 20) ** 2) / (2 * (2.0**2 + 0.8**2)))
    >>> found = detect_keypoints(blob, camera_blur=0.8, n_spo=15)
    >>> found.loc[found["value"].idxmin(), ["y", "x", "sigma"]].round(2).tolist()
    [20.0, 20.0, 1.78]
    """
    array = checked_image(image)
    n_oct = number_of_octaves(n_oct, array.shape, sigma_min)
    if refine:
        _require_grey_values(array)
    validation.count("max_iterations", max_iterations, least=1)
    validation.limit("max_offset", max_offset, above=0)
    validation.integer("n_spo", n_spo, least=1)
    validation.boolean("refine", refine)
    validation.boolean("scale_moves", scale_moves)
    if move not in MOVES:
        raise InputError(f"move is {move!r}, allowed are {' and '.join(MOVES)}: change move")
    octaves = []
    for octave in range(n_oct):
        # One slice more on the side of each neighbouring octave.
        slices = (-1 if octave else 0, n_spo + (3 if octave < n_oct - 1 else 2))
        space = scale_space(
            image, camera_blur, n_spo, delta_min, sigma_min, kappa, oversampling, octave, slices
        )
        table = described(space, *extrema_and_cubes(space, epsilon, threads))
        scale = table["step_sigma"]
        if refine:
            most = int(min(max_iterations, MOST_MODELS))
            models = traced(space, table, max_offset, move, scale_moves, most)
            table = refined(space.sampling, table, models, max_offset, max_iterations)
            scale = table["sigma"]
        table |= {"octave": np.full(scale.size, octave), "scale": scale}
        table |= {"s": table["s"] + slices[0], "step": np.full(scale.size, space.sampling.step)}
        octaves.append(table)
    keep = without_seams(octaves, n_spo, sigma_min)
    names = ["y", "x", "sigma", "value", "sign", "octave", "s", "row", "column", "difference"]
    names += ["models"] if refine else []
    kept = {
        name: np.concatenate([table[name][mask] for table, mask in zip(octaves, keep, strict=True)])
        for name in names
    }
    return pd.DataFrame(kept)


def _require_grey_values(image: np.ndarray) -> None:
    """Refuse values of which products of three do not exist, as the refinement needs them."""
    largest = max(float(image.max()), -float(image.min()))
    if largest and not 1e-90 <= largest <= 1e90:
        raise InputError(
            f"the image has grey values up to {largest:g}, allowed are 1e-90 to 1e90: divide it by "
            f"{largest:g}"
        )


def number_of_octaves(n_oct: int | str, shape: tuple[int, ...], sigma_min: float) -> int:
    """Octaves that are asked for; all are those up to a quarter of the picture's shorter side.

    Beyond, a scale sees more of the mirror images of a picture than of itself.

    Examples
    --------
    >>> number_of_octaves("all", (225, 400), 1.1)
    5
    """
    if n_oct == "all":
        validation.number("sigma_min", sigma_min, above=0)
        return max(1, int(math.log2(max(min(shape) / (4 * sigma_min), 1.0))))
    if isinstance(n_oct, str):
        raise InputError(f"n_oct is {n_oct!r}, allowed are whole numbers from 1 and 'all'")
    return validation.integer("n_oct", n_oct, least=1, most=40)


def extrema_table(
    space: ScaleSpace, extrema: np.ndarray, cubes: np.ndarray | None = None
) -> pd.DataFrame:
    """Describe discrete extrema by their neighbourhoods.

    Parameters
    ----------
    space : ScaleSpace
        Where they were found.
    extrema : ndarray of int, shape (n, 4)
        From `keystab.detection.extrema.discrete_extrema`.
    cubes : ndarray, shape (n, 3, 3, 3), optional
        Their neighbourhoods, from `keystab.detection.extrema.extrema_and_cubes`; evaluated when
        omitted.

    Returns
    -------
    DataFrame
        One row per extremum: grid position ``y, x, sigma`` in input pixels, DoG ``value``,
        ``sign``; indices ``s`` (0 for the first slice held), ``row, column``; smallest absolute
        ``difference`` to the 26 neighbours; gradient ``g_s, g_y, g_x`` and Hessian ``h_ss, h_yy,
        h_xx, h_sy, h_sx, h_yx`` by central differences per grid step; and where one unbounded
        quadratic step leads: ``step_y, step_x, step_sigma, step_value`` (NaN for a singular
        Hessian).
    """
    return pd.DataFrame(described(space, extrema, cubes))


def described(
    space: ScaleSpace, extrema: np.ndarray, cubes: np.ndarray | None = None
) -> dict[str, np.ndarray]:
    """As `extrema_table`, as columns."""
    s, row, column, sign = extrema.T
    if cubes is None:
        cubes = space.neighbourhoods(s, row, column)
    value = cubes[:, 1, 1, 1]
    difference = np.full(value.size, np.inf)
    for neighbour in np.delete(np.arange(27), 13):  # one by one, for the memory's sake
        around = cubes.reshape(-1, 27)[:, neighbour]
        np.minimum(difference, np.abs(around - value), out=difference)
    gradient, hessian = quadratic_model(cubes)
    alpha = stationary_point(gradient, hessian)
    step = positions_of((s, row, column), alpha.T, space.sampling)
    return {
        "y": row * space.sampling.step,
        "x": column * space.sampling.step,
        "sigma": space.sigma[s],
        "value": value,
        "sign": sign,
        "s": s,
        "row": row,
        "column": column,
        "difference": difference,
        **{name: gradient[:, i] for name, i in GRADIENT_COLUMNS.items()},
        **{name: hessian[:, i, j] for name, (i, j) in HESSIAN_COLUMNS.items()},
        **{f"step_{name}": place for name, place in step.items()},
        "step_value": value + 0.5 * np.einsum("ni,ni->n", gradient, alpha),
    }


def without_seams(octaves: Sequence[Columns], n_spo: int, sigma_min: float) -> list[np.ndarray]:
    """Decide which detections each octave reports, see the notes of `detect_keypoints`.

    Parameters
    ----------
    octaves : list of dict
        Columns ``y, x, sign, s`` (0 for the first slice of the octave), ``scale`` in pixels and
        ``step``, the sampling step of the octave.
    n_spo, sigma_min
        See `detect_keypoints`.

    Returns
    -------
    list of ndarray of bool
        For each octave, which of its rows it reports.
    """
    keep = []
    for octave, table in enumerate(octaves):
        s = table["s"]
        first, last = octave == 0, octave == len(octaves) - 1
        keep.append(((s >= 1) | first) & ((s <= n_spo) | last))
    for octave in range(len(octaves) - 1):
        finer, coarser = octaves[octave], octaves[octave + 1]
        seam = sigma_min * 2.0 ** (octave + 1 + 0.5 / n_spo)
        for i, j in _same_extremum(finer, coarser, n_spo):
            below = bool(finer["scale"][i] < seam)
            keep[octave][i], keep[octave + 1][j] = below, not below
    return keep


def _same_extremum(finer: Columns, coarser: Columns, n_spo: int) -> list[tuple[int, int]]:
    """Pairs of detections at the seam of two octaves that are one extremum, each nearest."""
    from scipy.spatial import cKDTree  # costs a third of the import, and one octave has no seam

    i = np.flatnonzero(finer["s"] >= n_spo)
    j = np.flatnonzero(coarser["s"] <= 1)
    if not (i.size and j.size):
        return []
    # Positions in units of the match: 1.5 coarse samples, one scale step; signs kept apart.
    step = coarser["step"][0]
    points = [
        np.stack(
            [
                table["y"][k] / (1.5 * step),
                table["x"][k] / (1.5 * step),
                np.log2(table["scale"][k]) * n_spo,
                10.0 * table["sign"][k],
            ],
            axis=1,
        )
        for table, k in ((finer, i), (coarser, j))
    ]
    points = [np.nan_to_num(p, nan=1e9, posinf=1e9, neginf=-1e9) for p in points]
    near, nearest = cKDTree(points[1]).query(points[0], p=math.inf)
    _, back = cKDTree(points[0]).query(points[1], p=math.inf)
    return [
        (int(i[a]), int(j[b]))
        for a, (b, gap) in enumerate(zip(nearest, near, strict=True))
        if gap <= 1 and back[b] == a
    ]
