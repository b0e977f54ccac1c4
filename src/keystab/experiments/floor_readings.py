"""Rates of new and lost extrema in every reading of the paper's words (section 5.2, figure floor).

How many extrema come and go from one sampling to the next, and how many are found at all
samplings, depends on what the words are taken to mean. Five of these choices need nothing but
extrema that were found before, and are crossed here; what needs another search (number type, scene,
distance and blur of the camera) is one more run of the same.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from keystab.evaluation.intervals import wilson_interval
from keystab.matching.correspondence import one_to_one, pairs_between, pairs_within
from keystab.matching.unique_keypoints import minimum_unique_set

MATCHINGS = ("any", "one-to-one")
"""Whether one detection may be the counterpart of several, or of one only."""

RANGES = ("refined", "grid", "soft")
"""Which scale decides about the common range: that of one quadratic step, or that of the grid. A
soft range is the first one with counterparts anywhere, beyond its ends and in the margin too."""

UNIQUE_SETS = ("minimum", "greedy")
"""The smallest set whose duplicates are everything; or detections in their order, from coarse to
fine samplings, each unless it is the same as one taken before."""

RATES = (0.09, 0.11)
"""New and lost extrema at fine samplings in the paper: 10 %, one per cent more or less."""

ALWAYS = (0.15, 0.20)
"""Keypoints found at all samplings in the paper: "almost 20 %"."""

ROUNDING = 1 + 1e-9
"""Limits are this much wider, as in `keystab.matching.correspondence`."""


class Reading(NamedTuple):
    """What the words are taken to mean.

    Attributes
    ----------
    matching : {"any", "one-to-one"}
        See `MATCHINGS`.
    range : {"refined", "grid", "soft"}
        See `RANGES`.
    epsilon : float
        By how much an extremum exceeds each of its 26 neighbours, of grey values in [0, 1].
    limit : float
        Largest distance of the same detection in y and in x, in pixels.
    unique_set : {"minimum", "greedy"}
        See `UNIQUE_SETS`; rates of new and lost extrema do not depend on it.
    """

    matching: str = "any"
    range: str = "refined"
    epsilon: float = 0.0
    limit: float = 1.0
    unique_set: str = "minimum"


def crossed(
    tolerances: Sequence[float], limits: Sequence[float], unique_sets: Sequence[str] = UNIQUE_SETS
) -> list[Reading]:
    """All readings, the usual values first in each of their five choices.

    Parameters
    ----------
    tolerances, limits, unique_sets : sequence
        Values of ``epsilon``, ``limit`` and ``unique_set``, the usual one first.

    Examples
    --------
    >>> len(crossed([0.0, 1e-6], [1.0]))
    24
    >>> crossed([0.0], [1.0])[0] == Reading()
    True
    """
    choices = (MATCHINGS, RANGES, tolerances, limits, unique_sets)
    return [Reading(*each) for each in itertools.product(*choices)]


def crossed_for(kind: str, epsilon: float, limit: float, asked: Mapping[str, Any]) -> list[Reading]:
    """Readings that a run of extrema is crossed with.

    Parameters
    ----------
    kind : {"all", "some", "rates"}
        All of them; or those with the usual limit and the smallest unique set, which is all that
        rates need.
    epsilon, limit : float
        The usual tolerance and limit.
    asked : mapping
        ``epsilons`` and ``limits`` besides.

    Examples
    --------
    >>> [len(crossed_for(k, 0.0, 1.0, {"epsilons": [0.0, 1e-6], "limits": [0.1]}))
    ...  for k in ("all", "some")]
    [48, 12]
    """
    tolerances = list(dict.fromkeys([epsilon, *asked["epsilons"]]))
    limits = list(dict.fromkeys([limit, *sorted(asked["limits"], reverse=True)]))
    if kind == "all":
        return crossed(tolerances, limits)
    return crossed(tolerances, limits[:1], UNIQUE_SETS[:1])


def ranges(
    extrema: pd.DataFrame, inside: Callable[[pd.DataFrame, str], NDArray[np.bool_]]
) -> dict[str, NDArray[np.bool_]]:
    """Which extrema are compared, by the scale of one quadratic step and by that of the grid.

    Parameters
    ----------
    extrema : DataFrame
        With ``sigma`` and ``step_sigma``.
    inside : callable
        Says which rows of a table lie in the range, by the scale in a column. Grid scales that lie
        at its lower end, as every third one may, are within.
    """
    own = extrema.assign(grid_sigma=extrema["sigma"] * ROUNDING)
    return {"refined": inside(extrema, "step_sigma"), "grid": inside(own, "grid_sigma")}


def reading_table(
    extrema: pd.DataFrame,
    inside: Mapping[str, NDArray[np.bool_]],
    samplings: Sequence[int],
    settles_at: int,
    readings: Sequence[Reading],
    same: Mapping[str, Any],
    with_always: bool = True,
) -> pd.DataFrame:
    """New and lost extrema, and keypoints found at all samplings, in each reading.

    Parameters
    ----------
    extrema : DataFrame
        All discrete extrema of all samplings: ``n_spo, y, x, sigma, sign, difference``.
    inside : mapping of ndarray of bool
        Which of them lie in the ``refined`` and in the ``grid`` range.
    samplings : sequence of int
        Values of ``n_spo`` from coarse to fine.
    settles_at : int
        Rates are those of the samplings with at least this `n_spo`, weighted by their detections.
    readings : sequence of Reading
        The first is the usual one, against which choices are counted.
    same : mapping
        Options of `keystab.matching.correspondence.same`; each reading has a ``space_tolerance``
        of its own.
    with_always : bool
        Whether keypoints found at all samplings are counted, which takes most of the time.

    Returns
    -------
    DataFrame
        One row per reading: its fields; ``n_choices``, in how many it differs from the first;
        ``n_common`` detections at fine samplings; ``new_rate, new_low, new_high``, ``lost_rate,
        lost_low, lost_high`` and ``share_always, low_always, high_always`` of ``n_unique``
        keypoints, shares with 95 % Wilson intervals, NaN where there is nothing to count; whether
        it ``reaches_rates`` (both within `RATES`), ``reaches_always`` (within `ALWAYS`) and both,
        ``reaches``; and whether its intervals meet all three, ``compatible``.
    """
    limits = {reading.limit for reading in readings}
    steps = steps_of(extrema, samplings, {**same, "space_tolerance": max(limits)})
    keypoints: dict[tuple[Any, ...], _Keypoints] = {}
    rows = []
    for reading in readings:
        exceeds = extrema["difference"].to_numpy() > reading.epsilon
        counted = exceeds & inside["grid" if reading.range == "grid" else "refined"]
        there = exceeds if reading.range == "soft" else counted
        row = _changes(steps, reading, counted, there, extrema["n_spo"].to_numpy(), settles_at)
        if with_always:
            key = (reading.range == "grid", reading.epsilon, reading.limit, reading.unique_set)
            if key not in keypoints:
                own = {**same, "space_tolerance": reading.limit}
                keypoints[key] = _keypoints(extrema, counted, samplings, reading, own)
            row |= keypoints[key].found_always(reading, there, len(samplings))
        else:
            row |= _share("always", 0, 0) | {"n_unique": pd.NA}
        differs = sum(a != b for a, b in zip(reading, readings[0], strict=True))
        rows.append({**reading._asdict(), "n_choices": differs, **row})
    table = pd.DataFrame(rows).astype({"n_unique": "Int64"})
    return table.assign(**_reached(table))


class Step(NamedTuple):
    """Two samplings, one after the other, and the pairs of their extrema that may be the same."""

    coarse: int
    fine: int
    row_a: NDArray[np.intp]
    """Rows in the table of all extrema, of the coarser sampling."""
    row_b: NDArray[np.intp]
    apart: NDArray[np.float64]
    """Larger of the distances in y and in x, in pixels."""
    square: NDArray[np.float64]
    """Squared distance in the plane, in pixels."""
    scale: NDArray[np.float64]
    """Squared distance in scale, in units of its limit."""

    def chosen(self, limit: float, pairs: NDArray[np.bool_]) -> NDArray[np.intp]:
        """Of some pairs those that are left where no row may be in two of them."""
        some = np.flatnonzero(pairs)
        if not some.size:
            return some
        # Numbered from 0 on, rows take no more room than there are.
        a, b = self.row_a[some], self.row_b[some]
        distance = self.square[some] / limit**2 + self.scale[some]
        return some[one_to_one(a - a.min(), b - b.min(), distance)]


def steps_of(
    extrema: pd.DataFrame, samplings: Sequence[int], same: Mapping[str, Any]
) -> list[Step]:
    """Pairs of extrema of each two samplings that follow each other, at the widest limit.

    Parameters
    ----------
    extrema : DataFrame
        ``n_spo, y, x, sigma`` (and ``sign`` where signs must match) of all samplings.
    samplings : sequence of int
        Values of ``n_spo`` from coarse to fine.
    same : mapping
        Options of `keystab.matching.correspondence.same`, with a ``space_tolerance``.
    """
    n_spo = extrema["n_spo"].to_numpy()
    y, x = (extrema[axis].to_numpy() for axis in ("y", "x"))
    steps = []
    for coarse, fine in itertools.pairwise(samplings):
        of_a, of_b = (np.flatnonzero(n_spo == each) for each in (coarse, fine))
        a, b, distance = pairs_between(extrema.iloc[of_a], extrema.iloc[of_b], **same)
        a, b = of_a[a], of_b[b]
        dy, dx = y[a] - y[b], x[a] - x[b]
        square = dy**2 + dx**2
        scale = distance**2 - square / same["space_tolerance"] ** 2
        apart = np.maximum(np.abs(dy), np.abs(dx))
        steps.append(Step(coarse, fine, a, b, apart, square, scale))
    return steps


def _changes(
    steps: Sequence[Step],
    reading: Reading,
    counted: NDArray[np.bool_],
    there: NDArray[np.bool_],
    n_spo: NDArray[np.int64],
    settles_at: int,
) -> dict[str, Any]:
    """Rates of new and lost extrema in a reading, over the fine samplings together."""
    change = {"new": [0, 0], "lost": [0, 0]}
    for step in steps:
        has = has_counterpart(step, reading, there) if step.fine >= settles_at else None
        for name, sampling in (("new", step.fine), ("lost", step.coarse)):
            if has is not None and sampling >= settles_at:
                own = counted & (n_spo == sampling)
                change[name][0] += int((own & ~has).sum())
                change[name][1] += int(own.sum())
    row: dict[str, Any] = {"n_common": int((counted & (n_spo >= settles_at)).sum())}
    for name, (k, n) in change.items():
        row |= _share(name, k, n)
    return row


def has_counterpart(step: Step, reading: Reading, there: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Say which extrema of two samplings have a counterpart in the other one.

    Parameters
    ----------
    step : pairs of extrema of the two samplings
    reading : Reading
        Whose matching and limit count.
    there : ndarray of bool
        Which extrema can be counterparts, of the table of all.

    Returns
    -------
    ndarray of bool
        For every row of the table of all; False for those of other samplings.
    """
    pairs = there[step.row_a] & there[step.row_b] & (step.apart <= reading.limit * ROUNDING)
    kept = np.flatnonzero(pairs)
    if reading.matching == "one-to-one":
        kept = step.chosen(reading.limit, pairs)
    has = np.zeros(len(there), dtype=bool)
    has[step.row_a[kept]] = has[step.row_b[kept]] = True
    return has


class _Keypoints(NamedTuple):
    """Unique keypoints, and the extrema that are the same as each."""

    number: int
    keypoint: NDArray[np.intp]
    row: NDArray[np.intp]
    sampling: NDArray[np.intp]
    distance: NDArray[np.float64]

    def found_always(
        self, reading: Reading, there: NDArray[np.bool_], n_samplings: int
    ) -> dict[str, Any]:
        """Share of the keypoints that are found at all samplings."""
        kept = np.flatnonzero(there[self.row])
        place = self.keypoint * n_samplings + self.sampling
        if reading.matching == "one-to-one":
            chosen = one_to_one(place[kept], self.row[kept], self.distance[kept])
            kept = kept[chosen]
        found = np.zeros(self.number * n_samplings, dtype=bool)
        found[place[kept]] = True
        always = int(found.reshape(self.number, n_samplings).all(axis=1).sum())
        return {"n_unique": self.number} | _share("always", always, self.number)


def _keypoints(
    extrema: pd.DataFrame,
    counted: NDArray[np.bool_],
    samplings: Sequence[int],
    reading: Reading,
    same: Mapping[str, Any],
) -> _Keypoints:
    """Unique keypoints among the counted extrema, and all extrema that are the same as each."""
    own = extrema[counted]
    if reading.unique_set == "greedy":
        unique = own.iloc[first_come(len(own), pairs_within(own, **same))]
    else:
        unique = minimum_unique_set(own, **same, set_column="n_spo").keypoints
    keypoint, row, distance = pairs_between(unique, extrema, **same)
    sampling = np.searchsorted(samplings, extrema["n_spo"].to_numpy()[row])
    return _Keypoints(len(unique), keypoint, row, sampling, distance)


def first_come(n_rows: int, pairs: NDArray[np.intp]) -> NDArray[np.intp]:
    """Rows in their order, each unless it is the same as one taken before.

    Parameters
    ----------
    n_rows : int
        Number of rows.
    pairs : ndarray of int, shape (n_pairs, 2)
        Rows that are the same, from `keystab.matching.correspondence.pairs_within`.

    Examples
    --------
    Of a chain of three the ends are taken, where one in the middle would do:

    >>> first_come(3, np.array([[0, 1], [1, 2]])).tolist()
    [0, 2]
    """
    low, high = np.sort(pairs, axis=1).T
    order = np.argsort(low, kind="stable")
    later = high[order]
    starts = np.searchsorted(low[order], np.arange(n_rows + 1))
    taken = np.ones(n_rows, dtype=bool)
    for row in range(n_rows):
        if taken[row]:
            taken[later[starts[row] : starts[row + 1]]] = False
    return np.flatnonzero(taken)


def _share(name: str, k: int, n: int) -> dict[str, Any]:
    """Share with its interval, under the names of the other tables of the floor."""
    low, high = wilson_interval(k, n)
    share = k / n if n else np.nan
    if name == "always":
        return {"share_always": share, "low_always": float(low), "high_always": float(high)}
    return {f"{name}_rate": share, f"{name}_low": float(low), f"{name}_high": float(high)}


def _reached(table: pd.DataFrame) -> dict[str, pd.Series]:
    """Say which of the paper's numbers each row has."""
    rates = table["new_rate"].between(*RATES) & table["lost_rate"].between(*RATES)
    always = table["share_always"].between(*ALWAYS)
    ends = (("new_low", "new_high"), ("lost_low", "lost_high"), ("low_always", "high_always"))
    meets = [
        (table[a] <= most) & (table[b] >= least)
        for (a, b), (least, most) in zip(ends, (RATES, RATES, ALWAYS), strict=True)
    ]
    return {
        "reaches_rates": rates,
        "reaches_always": always,
        "reaches": rates & always,
        "compatible": meets[0] & meets[1] & meets[2],
    }


def fewest_choices(table: pd.DataFrame) -> pd.DataFrame:
    """Readings that reach all of the paper's numbers with the fewest changes of the usual one.

    Parameters
    ----------
    table : DataFrame
        From `reading_table`.

    Returns
    -------
    DataFrame
        Some of its rows; none where no reading reaches them.

    Examples
    --------
    >>> table = pd.DataFrame({"n_choices": [1, 2, 2], "reaches": [False, True, True]})
    >>> fewest_choices(table).index.tolist()
    [1, 2]
    """
    reach = table[table["reaches"]]
    fewest: pd.DataFrame = reach[reach["n_choices"] == reach["n_choices"].min()]
    return fewest
