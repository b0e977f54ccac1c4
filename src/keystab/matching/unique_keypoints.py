"""Minimum unique set, matches and occurrence of keypoints (sections 5.1 and 5.2 of the paper).

Tables of detections are those of `keystab.matching.correspondence`, with one more column that says
to which set (image or sampling) a detection belongs.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from keystab.errors import InputError
from keystab.matching.correspondence import (
    SCALE_RATIO,
    SPACE_TOLERANCE,
    pairs_between,
    pairs_within,
)
from keystab.matching.dominating_set import minimum_dominating_set


class UniqueSet(NamedTuple):
    """A unique set and what is known about it.

    Attributes
    ----------
    keypoints : DataFrame
        Its members, see `unique_keypoints`.
    gap : int
        Members minus the proven lower bound; 0: a proven minimum set.
    canonical : bool
        Whether it is proven to be the first minimum set.
    n_components, largest_component : int
        Connected components of the graph of duplicates, and detections in the largest one.
    n_milp : int
        Integer programs that were solved.
    """

    keypoints: pd.DataFrame
    gap: int
    canonical: bool
    n_components: int
    largest_component: int
    n_milp: int


def unique_keypoints(
    detections: pd.DataFrame,
    space_tolerance: float = SPACE_TOLERANCE,
    scale_ratio: float = SCALE_RATIO,
    match_sign: bool = False,
    set_column: str | None = "set",
    reverse_order: bool = False,
    size_limit: int = 5000,
    time_limit: float = 60.0,
) -> pd.DataFrame:
    """Minimum unique set: fewest detections whose duplicates are all the detections (section 5.1).

    The duplicates of a detection are those that are the `same`, itself included. A smallest set of
    detections whose duplicates together are everything is a minimum dominating set of the graph
    of duplicates. It is found exactly, one connected component at a time. Being the same is
    not transitive, and a component can be a long chain that needs many keypoints.

    Minimum sets are not unique, and the paper does not say which it takes. Here detections are
    put in order: first those whose duplicates come from most sets, then by ``y``, ``x``, ``sigma``
    (then ``sign`` and set). Of all minimum sets, the one whose sorted members come first
    is returned. It does not depend on the order of the rows.

    Parameters
    ----------
    detections : DataFrame
        Columns ``y``, ``x``, ``sigma``, ``sign`` with `match_sign`, and `set_column`.
    space_tolerance, scale_ratio, match_sign
        See `same`.
    set_column : str or None
        Column that names the set of a detection; None if all belong to one set.
    reverse_order : bool
        Reverse the order, so that detections with duplicates in the fewest sets come first. The
        difference shows how much a result depends on the choice among minimum sets.
    size_limit : int
        Components with more detections than this are covered greedily.
    time_limit : float
        Seconds for one component, after which the best known cover is taken.

    Returns
    -------
    DataFrame
        Rows of `detections` with their index and all columns, sorted by y, x, sigma. What is proven
        about them says `minimum_unique_set`.

    Raises
    ------
    InputError
        If a column is missing, a value is no finite number, sets have no common order, a limit
        is out of range, or the limits are so wide that nearly everything is the same.

    Notes
    -----
    Rows equal in y, x, sigma, sign and set are interchangeable; the first of them is taken.

    Examples
    --------
    A chain of three, 0.8 px apart: the middle one is the same as both others.

    >>> chain = pd.DataFrame({"y": [0.0, 0.0, 0.0], "x": [0.0, 0.8, 1.6], "sigma": 1.1})
    >>> unique_keypoints(chain, set_column=None)
         y    x  sigma
    1  0.0  0.8    1.1
    """
    return minimum_unique_set(
        detections,
        space_tolerance,
        scale_ratio,
        match_sign,
        set_column,
        reverse_order,
        size_limit,
        time_limit,
    ).keypoints


def minimum_unique_set(
    detections: pd.DataFrame,
    space_tolerance: float = SPACE_TOLERANCE,
    scale_ratio: float = SCALE_RATIO,
    match_sign: bool = False,
    set_column: str | None = "set",
    reverse_order: bool = False,
    size_limit: int = 5000,
    time_limit: float = 60.0,
) -> UniqueSet:
    """Minimum unique set, and what is known about it: whether it is proven to be minimum.

    Parameters
    ----------
    detections, space_tolerance, scale_ratio, match_sign, set_column, reverse_order, size_limit, \
    time_limit
        See `unique_keypoints`.

    Returns
    -------
    UniqueSet

    Raises
    ------
    InputError
        As for `unique_keypoints`.

    Examples
    --------
    >>> chain = pd.DataFrame({"y": [0.0, 0.0, 0.0], "x": [0.0, 0.8, 1.6], "sigma": 1.1})
    >>> unique = minimum_unique_set(chain, set_column=None)
    >>> list(unique.keypoints.index), unique.gap
    ([1], 0)
    """
    pairs = pairs_within(detections, space_tolerance, scale_ratio, match_sign)
    codes = set_codes(detections, set_column, set_names(detections, set_column))
    place = _places(detections, codes)
    preference = np.lexsort((place, -_count_sets(pairs, codes)))
    if reverse_order:
        preference = preference[::-1]
    found = minimum_dominating_set(pairs, preference, size_limit, time_limit)
    return UniqueSet(
        detections.iloc[found.members[np.argsort(place[found.members])]].copy(),
        len(found.members) - found.lower_bound,
        found.canonical,
        found.n_components,
        found.largest_component,
        found.n_milp,
    )


def matches(
    unique: pd.DataFrame,
    detections: pd.DataFrame,
    space_tolerance: float = SPACE_TOLERANCE,
    scale_ratio: float = SCALE_RATIO,
    match_sign: bool = False,
    set_column: str | None = "set",
    sets: Sequence[Any] | None = None,
) -> NDArray[np.intp]:
    r"""Nearest same detection of every unique keypoint in every set.

    Where several detections of one set are the same as a keypoint, the nearest counts, with the
    distance in units of the limits

    .. math:: d^2 = \frac{(\Delta y)^2 + (\Delta x)^2}{\epsilon^2}
                    + \Bigl(\frac{\ln(\sigma_1/\sigma_0)}{\ln R}\Bigr)^2 ,

    and, at equal distance, the first by y, x, sigma. One detection may match several keypoints.

    Parameters
    ----------
    unique : DataFrame
        Keypoints, from `unique_keypoints`.
    detections : DataFrame
        Detections of all sets.
    space_tolerance, scale_ratio, match_sign
        See `same`.
    set_column : str or None
        Column that names the set of a detection; None if all belong to one set.
    sets : sequence, optional
        Sets and their order; sorted values of `set_column` by default. Give it when a set may be
        without any detection, since the table cannot tell of that one.

    Returns
    -------
    ndarray of int, shape (n_unique, n_sets)
        Row position in `detections`, -1 where there is none.

    Raises
    ------
    InputError
        As for `unique_keypoints`, or if `detections` has a set that `sets` lacks.
    """
    names = set_names(detections, set_column, sets)
    codes = set_codes(detections, set_column, names)
    keypoint, detection, distance = pairs_between(
        unique, detections, space_tolerance, scale_ratio, match_sign
    )
    nearest = np.lexsort((_places(detections, codes)[detection], distance))
    place = keypoint[nearest] * len(names) + codes[detection[nearest]]
    place, first = np.unique(place, return_index=True)
    found = np.full(len(unique) * len(names), -1, dtype=np.intp)
    found[place] = detection[nearest[first]]
    return found.reshape(len(unique), len(names))


def occurrence(
    unique: pd.DataFrame,
    detections: pd.DataFrame,
    space_tolerance: float = SPACE_TOLERANCE,
    scale_ratio: float = SCALE_RATIO,
    match_sign: bool = False,
    set_column: str = "set",
    sets: Sequence[Any] | None = None,
) -> pd.DataFrame:
    """Occurrence matrix: which unique keypoint is detected in which set (figure 4c).

    Parameters
    ----------
    unique, detections, space_tolerance, scale_ratio, match_sign, set_column, sets
        See `matches`.

    Returns
    -------
    DataFrame of bool
        One row per keypoint, with the index of `unique`, one column per set.

    Raises
    ------
    InputError
        As for `matches`.

    Examples
    --------
    >>> table = pd.DataFrame({"y": 0.0, "x": [0.0, 0.8, 9.0], "sigma": 1.1, "set": ["a", "b", "b"]})
    >>> occurrence(unique_keypoints(table), table).to_numpy().tolist()
    [[True, True], [False, True]]
    """
    names = set_names(detections, set_column, sets)
    found = matches(unique, detections, space_tolerance, scale_ratio, match_sign, set_column, names)
    return pd.DataFrame(found >= 0, index=unique.index, columns=pd.Index(names, name=set_column))


def gather(values: ArrayLike, found: NDArray[np.intp]) -> NDArray[np.float64]:
    """Values of the matched detections, NaN where a keypoint is not detected.

    Parameters
    ----------
    values : array, shape (n_detections,)
        One number per detection.
    found : ndarray of int, shape (n_unique, n_sets)
        Row positions from `matches`.

    Returns
    -------
    ndarray, shape (n_unique, n_sets)

    Examples
    --------
    >>> gather([5.0, 7.0], np.array([[1, -1], [0, 1]]))
    array([[ 7., nan],
           [ 5.,  7.]])
    """
    return np.append(np.asarray(values, dtype=float), np.nan)[found]


def set_names(
    detections: pd.DataFrame, set_column: str | None, sets: Sequence[Any] | None = None
) -> list[Any]:
    """Return the sets in their order: those given, or the sorted values of the column."""
    if sets is not None:
        names = list(sets)
        if len(pd.Index(names).unique()) < len(names):
            raise InputError("`sets` names a set more than once: give each set once")
        return names
    if set_column is None:
        return [0]
    if set_column not in detections:
        raise InputError(
            f"the detections have no column {set_column!r} that names their sets: add it, or name "
            "another one with set_column"
        )
    try:
        return sorted(detections[set_column].unique())
    except TypeError:
        raise InputError(
            f"column {set_column!r} names sets by values that have no common order, such as "
            "numbers beside text: make them all numbers or all text"
        ) from None


def set_codes(
    detections: pd.DataFrame, set_column: str | None, names: list[Any]
) -> NDArray[np.intp]:
    """Position of the set of each detection among `names`."""
    if set_column is None:
        return np.zeros(len(detections), dtype=np.intp)
    if set_column not in detections:
        set_names(detections, set_column)  # says what is missing
    codes: NDArray[np.intp] = pd.Index(names).get_indexer(pd.Index(detections[set_column]))
    if (codes < 0).any():
        unknown = detections[set_column].iloc[int(np.argmin(codes))]
        raise InputError(
            f"column {set_column!r} holds {unknown!r}, which is none of the sets given "
            f"({len(names)}): add it to `sets` or leave those rows out"
        )
    return codes


def _places(detections: pd.DataFrame, codes: NDArray[np.intp]) -> NDArray[np.intp]:
    """Place of each row when sorted by y, x, sigma, sign and set."""
    sign = detections["sign"] if "sign" in detections else np.zeros(len(detections))
    order = np.lexsort((codes, sign, detections["sigma"], detections["x"], detections["y"]))
    return np.argsort(order)


def _count_sets(pairs: NDArray[np.intp], codes: NDArray[np.intp]) -> NDArray[np.intp]:
    """Count the distinct sets among the duplicates of each row, itself included."""
    present = np.zeros((len(codes), codes.max(initial=0) + 1), dtype=bool)
    present[np.arange(len(codes)), codes] = True
    present[pairs[:, 0], codes[pairs[:, 1]]] = True
    present[pairs[:, 1], codes[pairs[:, 0]]] = True
    counts: NDArray[np.intp] = present.sum(axis=1)
    return counts
