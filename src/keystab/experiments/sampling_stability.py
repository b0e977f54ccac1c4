"""What detections at different samplings have in common, as tables (sections 5.1 and 5.2).

Detections are discrete extrema of `keystab.detection.detector.extrema_table` with the columns
``n_spo`` and ``delta_min`` that say at which sampling each was found, reduced to the comparable
ones (`keystab.matching.common_range`) where that is said.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from keystab.evaluation.intervals import percentile_interval, wilson_interval
from keystab.evaluation.location_errors import quantile
from keystab.evaluation.scene_pieces import count_ratios
from keystab.evaluation.stability import new_and_lost
from keystab.matching.common_range import compared
from keystab.matching.unique_keypoints import matches, minimum_unique_set
from keystab.prediction.features import condition_numbers, hessians

Same = Mapping[str, Any]
"""What `keystab.matching.correspondence.same` takes besides two tables, by name."""


class Counted(NamedTuple):
    """What was counted at one sampling, and where it lies.

    Attributes
    ----------
    numbers : dict
        See `sampling_counts`.
    extrema, common, unique : DataFrame
        All extrema, the comparable ones, and their unique set, with ``y, x`` in pixels.
    """

    numbers: dict[str, Any]
    extrema: pd.DataFrame
    common: pd.DataFrame
    unique: pd.DataFrame


SIFT = (3, 0.5)
"""SIFT's default sampling (section 2.2): n_spo and delta_min in pixels."""


def ratio_columns(counted: Sequence[Counted]) -> pd.DataFrame:
    """Numbers of all samplings over those of SIFT's, with intervals over pieces of the scene.

    Parameters
    ----------
    counted : sequence of Counted
        Their numbers also say ``n_spo, delta_min, balanced``.

    Returns
    -------
    DataFrame
        In their order: ``extrema_ratio, common_ratio, unique_ratio`` with ``low_extrema,
        high_extrema`` and so on; ``ratio_drop``, by how much the ratio of unique ones is lower than
        that of all comparable ones, with ``low_drop, high_drop``; ``share_duplicates`` of the
        comparable ones with its Wilson interval ``low_duplicates, high_duplicates``;
        ``low_condition, high_condition``, the interval of the median condition number from order
        statistics; and ``range_drop``, by how much the ratio of the comparable ones is lower than
        that of all, with ``low_range, high_range``. All 95 %; ratios are NaN without SIFT's
        sampling.
    """
    named = [
        (one.numbers["n_spo"], one.numbers["delta_min"], one.numbers["balanced"]) for one in counted
    ]
    default = named.index((*SIFT, False)) if (*SIFT, False) in named else None
    parts: dict[str, Any] = {}
    drawn: dict[str, NDArray[np.float64]] = {}
    for kind in ("extrema", "common", "unique"):
        tables = [getattr(one, kind)[["y", "x"]] for one in counted]
        ratios, samples = count_ratios(tables, default, purpose=("samplings",))
        drawn[kind] = np.vstack([ratios, samples]) * (1.0 if default is not None else np.nan)
    drawn["drop"] = drawn["common"] - drawn["unique"]
    for kind, values in drawn.items():
        low, high = percentile_interval(values[1:])
        name = "ratio_drop" if kind == "drop" else f"{kind}_ratio"
        parts |= {name: values[0], f"low_{kind}": low, f"high_{kind}": high}
    n_common = np.array([len(one.common) for one in counted])
    n_duplicates = n_common - [len(one.unique) for one in counted]
    low, high = wilson_interval(n_duplicates, n_common)
    share = n_duplicates / np.where(n_common > 0, n_common, np.nan)
    parts |= {"share_duplicates": share, "low_duplicates": low, "high_duplicates": high}
    medians = [quantile(condition_numbers(hessians(one.extrema))) for one in counted]
    parts |= {
        f"{end}_condition": [getattr(each, end) for each in medians] for end in ("low", "high")
    }
    return pd.DataFrame(parts | _range_drop(counted, default))


def _range_drop(counted: Sequence[Counted], default: int | None) -> dict[str, Any]:
    """Ratios of all extrema less those of the comparable ones, of the same pieces of the scene."""
    n = len(counted)
    # Pieces at the border hold no comparable ones: both kinds are cut into pieces together.
    tables = [one.extrema[["y", "x"]] for one in counted]
    tables += [one.common[["y", "x"]] for one in counted]
    if default is None:
        return dict.fromkeys(("range_drop", "low_range", "high_range"), np.full(n, np.nan))
    numbers = np.vstack(count_ratios(tables, default, purpose=("samplings",)))
    of_sift = np.where(numbers[:, [n + default]] > 0, numbers[:, [n + default]], np.nan)
    drops = numbers[:, :n] - numbers[:, n:] / of_sift
    low, high = percentile_interval(drops[1:])
    return {"range_drop": drops[0], "low_range": low, "high_range": high}


def sampling_counts(extrema: pd.DataFrame, common: pd.DataFrame, same: Same) -> dict[str, Any]:
    """Numbers of extrema of one sampling, and the condition of their Hessians (figure 3).

    See `count_sampling`, which also says where they lie.
    """
    return count_sampling(extrema, common, same).numbers


def count_sampling(extrema: pd.DataFrame, common: pd.DataFrame, same: Same) -> Counted:
    """Count the extrema of one sampling, and see how well their Hessians are conditioned (fig. 3).

    Parameters
    ----------
    extrema : DataFrame
        All discrete extrema of the sampling.
    common : DataFrame
        The comparable ones.
    same : mapping
        Options of `keystab.matching.correspondence.same`.

    Returns
    -------
    Counted
        Its numbers are ``n_extrema``, ``n_common``, ``n_unique``, ``gap`` (0: the unique set is
        proven minimal) and the quartiles ``median_condition``, ``q25_condition``,
        ``q75_condition`` of the condition number of the Hessian per grid step over all extrema; NaN
        where there are none.
    """
    unique = minimum_unique_set(common, **same, set_column=None)
    condition = condition_numbers(hessians(extrema))
    quartiles = np.quantile(condition, [0.5, 0.25, 0.75]) if len(condition) else [np.nan] * 3
    numbers = {
        "n_extrema": len(extrema),
        "n_common": len(common),
        "n_unique": len(unique.keypoints),
        "gap": unique.gap,
        **dict(zip(("median_condition", "q25_condition", "q75_condition"), quartiles, strict=True)),
    }
    return Counted(numbers, extrema, common, unique.keypoints)


def change_counts(
    extrema: pd.DataFrame, common: pd.DataFrame, steps: Mapping[int, float], same: Same
) -> pd.DataFrame:
    """Numbers of extrema, and rates of new and lost ones, per sampling (figure 4 a, b).

    Parameters
    ----------
    extrema, common : DataFrame
        All discrete extrema of all samplings, and the comparable ones.
    steps : mapping from n_spo to delta_min
        The samplings, from coarse to fine.
    same : mapping
        Options of `keystab.matching.correspondence.same`.

    Returns
    -------
    DataFrame
        ``n_spo, delta_min, n_extrema, n_common`` and the columns of
        `keystab.evaluation.stability.new_and_lost`, which refer to ``n_common``.
    """
    counts = new_and_lost(common, **same, set_column="n_spo", sets=list(steps))
    counts = counts.rename(columns={"n_detections": "n_common"})
    counts.insert(1, "delta_min", list(steps.values()))
    found = extrema["n_spo"].value_counts()
    counts.insert(2, "n_extrema", [int(found.get(n_spo, 0)) for n_spo in steps])
    return counts


def floor_summary(
    counts: pd.DataFrame, stability: pd.Series | None, settles_at: int
) -> pd.DataFrame:
    """Rates of new and lost extrema where they have settled, in one row (figure floor).

    Parameters
    ----------
    counts : DataFrame
        From `change_counts`.
    stability : Series or None
        Share of the samplings in which each unique keypoint is detected; None where coarse
        samplings were not searched.
    settles_at : int
        Rates are those of the samplings with at least this `n_spo`, weighted by their detections.

    Returns
    -------
    DataFrame
        ``mean_common`` (compared detections per sampling), ``new_rate, new_low, new_high``,
        ``lost_rate, lost_low, lost_high`` (shares with 95 % Wilson intervals), ``n_unique``,
        ``share_always`` with ``low_always, high_always``; NaN where nothing is detected or known.
    """
    settled = counts[counts["n_spo"] >= settles_at]
    row: dict[str, Any] = {"mean_common": settled["n_common"].mean()}
    for name in ("new", "lost"):
        known = settled[settled[f"n_{name}"].notna()]
        k, n = int(known[f"n_{name}"].sum()), int(known["n_common"].sum())
        low, high = wilson_interval(k, n)
        row |= {f"{name}_rate": k / n if n else np.nan}
        row |= {f"{name}_low": float(low), f"{name}_high": float(high)}
    if stability is None:
        unknown = dict.fromkeys(("share_always", "low_always", "high_always"), np.nan)
        return pd.DataFrame([row | {"n_unique": pd.NA} | unknown]).astype({"n_unique": "Int64"})
    always = int((stability == 1).sum())
    low, high = wilson_interval(always, len(stability))
    row |= {"n_unique": len(stability), "share_always": always / max(len(stability), 1)}
    row |= {"low_always": float(low), "high_always": float(high)}
    return pd.DataFrame([row]).astype({"n_unique": "Int64"})


class Matched(NamedTuple):
    """Unique keypoints of many samplings, and which detection each is.

    Attributes
    ----------
    keypoints : DataFrame
        ``keypoint, y, x, sigma, sign, n_samplings, stability``, and ``n_changes``: how often a
        keypoint comes or goes from one sampling to the next.
    found : ndarray of int, shape (n_keypoints, n_samplings)
        Row positions in the table of comparable detections, -1 where there is none.
    gap : int
        0: proven to be a minimum set.
    """

    keypoints: pd.DataFrame
    found: NDArray[np.intp]
    gap: int


def keypoints_of_samplings(
    common: pd.DataFrame, samplings: Sequence[int], same: Same, reverse_order: bool = False
) -> Matched:
    """Find the unique keypoints of all samplings, and each in every sampling (section 5.2).

    Parameters
    ----------
    common : DataFrame
        Comparable detections of all samplings, and those that are counterparts only.
    samplings : sequence of int
        Values of n_spo.
    same : mapping
        Options of `keystab.matching.correspondence.same`.
    reverse_order : bool
        Choose among minimum sets the other way round, see
        `keystab.matching.unique_keypoints.unique_keypoints`.
    """
    asked = common[compared(common)]
    unique = minimum_unique_set(asked, **same, set_column="n_spo", reverse_order=reverse_order)
    found = matches(unique.keypoints, common, **same, set_column="n_spo", sets=samplings)
    keypoints = unique.keypoints[["y", "x", "sigma", "sign"]].reset_index(drop=True)
    keypoints.insert(0, "keypoint", np.arange(len(keypoints)))
    keypoints["n_samplings"] = (found >= 0).sum(axis=1)
    keypoints["stability"] = keypoints["n_samplings"] / len(samplings)
    keypoints["n_changes"] = (np.diff(found >= 0, axis=1)).sum(axis=1)
    return Matched(keypoints, found, unique.gap)


def long_matches(
    matched: Matched, samplings: Sequence[int], rows: NDArray[np.intp]
) -> pd.DataFrame:
    """Which detection of each sampling is which keypoint, one row per pair of them.

    Parameters
    ----------
    matched : Matched
        From `keypoints_of_samplings`.
    samplings : sequence of int
        Values of n_spo.
    rows : ndarray of int
        For each comparable detection, its row in the table of all extrema of its sampling.

    Returns
    -------
    DataFrame
        ``keypoint, n_spo, row``; ``row`` is -1 where the keypoint is not detected.
    """
    n_keypoints, n_samplings = matched.found.shape
    return pd.DataFrame(
        {
            "keypoint": np.repeat(np.arange(n_keypoints), n_samplings),
            "n_spo": np.tile(np.asarray(samplings, dtype=np.int64), n_keypoints),
            "row": np.append(rows, -1)[matched.found].ravel(),
        }
    )


def positions_of_matches(matches: pd.DataFrame, extrema: pd.DataFrame) -> NDArray[np.intp]:
    """Turn rows within the table of each sampling into row positions of one table of all.

    Parameters
    ----------
    matches : DataFrame
        ``keypoint, n_spo, row``, from `long_matches`.
    extrema : DataFrame
        Those of the same samplings below each other, in ascending order of ``n_spo``.

    Returns
    -------
    ndarray of int, shape (n_keypoints, n_samplings)
        -1 where a keypoint is not detected.
    """
    if matches.empty:
        return np.empty((0, extrema["n_spo"].nunique()), dtype=np.intp)
    n_spo = matches["n_spo"].unique()
    first = np.searchsorted(extrema["n_spo"].to_numpy(), n_spo)  # extrema ascend in n_spo
    row = matches["row"].to_numpy().reshape(-1, len(n_spo))
    return np.where(row >= 0, row + first, -1)


def summary(
    matched: Matched, reverse: Matched, stable_above: float, unstable_below: float
) -> pd.DataFrame:
    """What figure 4 says in a few numbers, and how much of it the choice of a unique set decides.

    Parameters
    ----------
    matched, reverse : Matched
        The unique set, and the one chosen the other way round.
    stable_above, unstable_below : float
        Limits of stability.

    Returns
    -------
    DataFrame
        ``quantity, value, note``.
    """

    def shares(stability: pd.Series) -> dict[str, float]:
        return {
            "share_always": float((stability == 1).mean()),
            "share_stable": float((stability > stable_above).mean()),
            "share_unstable": float((stability < unstable_below).mean()),
        }

    notes = {
        "share_always": "detected at every sampling",
        "share_stable": f"detected at more than {100 * stable_above:g} % of the samplings",
        "share_unstable": f"detected at less than {100 * unstable_below:g} % of the samplings",
    }
    here, other = (shares(each.keypoints["stability"]) for each in (matched, reverse))
    rows: list[tuple[str, float, str]] = [
        ("n_unique", len(matched.keypoints), "unique keypoints"),
        ("gap", matched.gap, "0: proven to be the smallest number possible"),
        *((name, here[name], notes[name]) for name in notes),
        *(
            (f"{name}_change", other[name] - here[name], "with the reversed choice of unique set")
            for name in notes
        ),
    ]
    return pd.DataFrame(rows, columns=["quantity", "value", "note"])
