"""When two detections are the same, and which are (section 5.1, equation (22), of the paper).

Detections are tables with the columns ``y``, ``x`` (pixels) and ``sigma`` (pixels), all in one
common frame, and ``sign`` (+1 maximum, -1 minimum) where signs must match. Other columns do not
matter.

Two detections are the same when they differ by at most `space_tolerance` pixels in both axes and
their scales by a factor of at most `scale_ratio`, both inclusive. Scales such as
``sigma_min * 2**(s/n_spo)`` often sit exactly on that limit, where rounding would decide; so both
limits are widened by one part in 10**9.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from keystab.errors import InputError

Detections = Mapping[Any, Any] | pd.DataFrame

SPACE_TOLERANCE = 1.0
"""Largest difference of the same detection in y and in x, in pixels (epsilon of the paper)."""

SCALE_RATIO = 2**0.5
"""Largest ratio of the scales of the same detection (R of the paper)."""

_ROUNDING = 1e-9
# Pairs of detections that are held in memory at once: 16 bytes each, so 3.2 GB.
_MOST_PAIRS = 200_000_000


def same(
    a: Detections,
    b: Detections,
    space_tolerance: float = SPACE_TOLERANCE,
    scale_ratio: float = SCALE_RATIO,
    match_sign: bool = False,
) -> NDArray[np.bool_]:
    r"""Whether two detections are the same, element by element, equation (22).

    .. math:: \|x_0 - x_1\|_\infty \le \epsilon \quad\text{and}\quad
              R^{-1} \le \sigma_1 / \sigma_0 \le R

    Parameters
    ----------
    a, b : table or mapping
        With ``y``, ``x``, ``sigma`` (and ``sign`` with `match_sign`); scalars or arrays of equal
        length, compared by position.
    space_tolerance : float
        Limit for the difference in y and in x, in pixels, above 0.
    scale_ratio : float
        Limit R for the ratio of the scales, above 1.
    match_sign : bool
        Whether a maximum and a minimum are always different. The paper does not ask for it.

    Returns
    -------
    ndarray of bool

    Raises
    ------
    InputError
        If a column is missing, a value is no finite number, or a limit is out of range.

    Examples
    --------
    >>> one = {"y": 5.0, "x": 3.0, "sigma": 1.1}
    >>> bool(same(one, {"y": 6.0, "x": 2.0, "sigma": 1.1 * 2**0.5}))
    True
    >>> bool(same(one, {"y": 6.1, "x": 3.0, "sigma": 1.1}))
    False
    """
    first, second = (_coordinates(d, space_tolerance, scale_ratio, match_sign) for d in (a, b))
    close = np.all(np.abs(first - second) <= 1 + _ROUNDING, axis=-1)
    return np.reshape(close, np.shape(a["y"]))


def matched(
    a: pd.DataFrame,
    b: pd.DataFrame,
    space_tolerance: float = SPACE_TOLERANCE,
    scale_ratio: float = SCALE_RATIO,
    match_sign: bool = False,
) -> NDArray[np.bool_]:
    """Whether each detection of one table has the same detection in another.

    Parameters
    ----------
    a, b : DataFrame
        Detections; what is asked of each row of `a` is whether `b` holds a `same` one.
    space_tolerance, scale_ratio, match_sign
        See `same`.

    Returns
    -------
    ndarray of bool, shape (len(a),)

    Raises
    ------
    InputError
        As for `same`.
    """
    rows, _, _ = pairs_between(a, b, space_tolerance, scale_ratio, match_sign)
    found = np.zeros(len(a), dtype=bool)
    found[rows] = True
    return found


def pairs_within(
    detections: pd.DataFrame,
    space_tolerance: float = SPACE_TOLERANCE,
    scale_ratio: float = SCALE_RATIO,
    match_sign: bool = False,
) -> NDArray[np.intp]:
    """Pairs of rows of one table that are the same.

    Parameters
    ----------
    detections, space_tolerance, scale_ratio, match_sign
        See `same`.

    Returns
    -------
    ndarray of int, shape (n_pairs, 2)
        Row positions; each pair once, no row with itself.

    Raises
    ------
    InputError
        As for `same`, or if the limits are so wide that the pairs would not fit in memory.
    """
    from scipy.spatial import cKDTree

    points = _coordinates(detections, space_tolerance, scale_ratio, match_sign)
    if len(points) < 2:
        return np.zeros((0, 2), dtype=np.intp)
    tree = cKDTree(points)
    n_pairs = (tree.count_neighbors(tree, 1 + _ROUNDING, p=np.inf) - len(points)) // 2
    if n_pairs > _MOST_PAIRS:
        raise InputError(
            f"{len(points)} detections have {n_pairs} pairs that are the same, allowed are "
            f"{_MOST_PAIRS}: lower space_tolerance or scale_ratio, or compare fewer detections"
        )
    pairs: NDArray[np.intp] = tree.query_pairs(1 + _ROUNDING, p=np.inf, output_type="ndarray")
    return pairs


def pairs_between(
    a: pd.DataFrame,
    b: pd.DataFrame,
    space_tolerance: float = SPACE_TOLERANCE,
    scale_ratio: float = SCALE_RATIO,
    match_sign: bool = False,
) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.float64]]:
    r"""Pairs of rows of two tables that are the same, and how far apart they are.

    Parameters
    ----------
    a, b, space_tolerance, scale_ratio, match_sign
        See `same`.

    Returns
    -------
    row_a, row_b : ndarray of int, shape (n_pairs,)
        Row positions.
    distance : ndarray, shape (n_pairs,)
        In units of the limits,
        :math:`d^2 = ((\Delta y)^2 + (\Delta x)^2) / \epsilon^2
        + (\ln(\sigma_1/\sigma_0) / \ln R)^2`.

    Raises
    ------
    InputError
        As for `same`.
    """
    from scipy.spatial import cKDTree

    first, second = (_coordinates(d, space_tolerance, scale_ratio, match_sign) for d in (a, b))
    if not len(first) or not len(second):
        nothing = np.zeros(0, dtype=np.intp)
        return nothing, nothing, np.zeros(0)
    near = cKDTree(first).sparse_distance_matrix(
        cKDTree(second), 1 + _ROUNDING, p=np.inf, output_type="ndarray"
    )
    apart = first[near["i"]] - second[near["j"]]
    return near["i"], near["j"], np.sqrt((apart**2).sum(axis=1))


def one_to_one(
    row_a: NDArray[np.intp], row_b: NDArray[np.intp], distance: NDArray[np.float64]
) -> NDArray[np.intp]:
    """Choose among pairs so that no row is in two of them, the nearest pairs first.

    Parameters
    ----------
    row_a, row_b : ndarray of int, shape (n_pairs,)
        Rows of two tables, as from `pairs_between`.
    distance : ndarray, shape (n_pairs,)
        How far apart each pair is. Equal ones are taken by `row_a`, then `row_b`.

    Returns
    -------
    ndarray of int
        Positions of the chosen pairs. What is left out shares a row with a chosen pair that is not
        farther apart.

    Examples
    --------
    >>> one_to_one(np.array([0, 0, 1]), np.array([0, 1, 0]), np.array([0.1, 0.3, 0.2])).tolist()
    [0]
    """
    left = np.lexsort((row_b, row_a, distance))
    free_a = np.ones(row_a.max(initial=-1) + 1, dtype=bool)
    free_b = np.ones(row_b.max(initial=-1) + 1, dtype=bool)
    chosen = [left[:0]]
    while left.size:
        # A pair that comes first among those of both its rows is chosen whatever comes after.
        first_a, first_b = (np.unique(row[left], return_index=True)[1] for row in (row_a, row_b))
        best = left[np.intersect1d(first_a, first_b)]
        free_a[row_a[best]] = free_b[row_b[best]] = False
        left = left[free_a[row_a[left]] & free_b[row_b[left]]]
        chosen.append(best)
    return np.concatenate(chosen)


def _coordinates(
    detections: Detections,
    space_tolerance: float,
    scale_ratio: float,
    match_sign: bool,
) -> NDArray[np.float64]:
    """Coordinates in units of the limits: same means no farther than 1 apart along every axis."""
    _require_above("space_tolerance", space_tolerance, 0)
    _require_above("scale_ratio", scale_ratio, 1)
    columns = {}
    for name in ("y", "x", "sigma", "sign") if match_sign else ("y", "x", "sigma"):
        try:
            columns[name] = np.atleast_1d(_real_numbers(detections[name], name))
        except KeyError:
            raise InputError(
                f"the detections have no column {name!r}, needed are y, x, sigma (and sign where "
                "signs must match): add it"
            ) from None
        if not np.isfinite(columns[name]).all():
            row = int(np.argmin(np.isfinite(columns[name])))
            raise InputError(
                f"column {name!r} holds {columns[name][row]} in row {row}, allowed are finite "
                "numbers: drop that row"
            )
    if (columns["sigma"] <= 0).any():
        raise InputError(
            f"column 'sigma' holds {columns['sigma'].min():g}, allowed are scales above 0: drop it"
        )
    axes = [
        columns["y"] / space_tolerance,
        columns["x"] / space_tolerance,
        np.log(columns["sigma"]) / np.log(scale_ratio),
    ]
    if match_sign:
        axes.append(2 * np.sign(columns["sign"]))
    return np.stack(axes, axis=-1)


def _require_above(name: str, value: float, limit: float) -> None:
    try:
        good = bool(value > limit)
    except (TypeError, ValueError):  # text, arrays
        good = False
    if not good:
        raise InputError(f"{name} is {value!r}, allowed are numbers above {limit}: raise it")


def _real_numbers(column: Any, name: str) -> NDArray[np.float64]:
    """Values of a column; text that looks like a number is refused, since it sorts as text."""
    values = np.asarray(column)
    kind = f"values of type {values.dtype}"
    objects = values.flat if values.dtype.kind == "O" else ()
    if values.dtype.kind in "US" or any(isinstance(v, (str, bytes)) for v in objects):
        kind = "text"
    elif values.dtype.kind in "biufO":  # objects: columns of pandas with missing values
        try:
            return values.astype(np.float64)
        except (TypeError, ValueError):
            pass
    raise InputError(
        f"column {name!r} holds {kind}, allowed are finite numbers: convert it or drop those rows"
    )
