"""What becomes of the keypoints of a first view in others: found again, how far off (section 3.3).

Pairs of views and not whole sets: where views differ by something that grows from one to the next,
a curve over all of them would not say what costs what.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd

from keystab.evaluation.intervals import wilson_interval
from keystab.matching.common_range import CommonRange
from keystab.matching.correspondence import matched, pairs_between


def against_first(
    keypoints: pd.DataFrame,
    everywhere: CommonRange,
    same: Mapping[str, Any],
    labels: Mapping[str, Any] | None = None,
) -> pd.DataFrame:
    """Compare the keypoints of every view with those of the first.

    Parameters
    ----------
    keypoints : DataFrame
        ``view, y, x, sigma`` of the refined keypoints of all views, each in its own frame.
    everywhere : CommonRange
        Field of view and range of scales of all views. Keypoints in it are asked for; their
        counterparts may lie beyond the ends of the range of scales.
    same : mapping
        Options of `keystab.matching.correspondence.same`.
    labels : mapping, optional
        Columns to put before the others.

    Returns
    -------
    DataFrame
        One row per view: `labels`; ``view``; its ``blur`` and its ``zoom`` against the first;
        of the ``n_first`` keypoints of the first view the share
        ``share_found`` that has a same one in this view, with its 95 % Wilson interval ``low_found,
        high_found``; of the ``n_view`` keypoints of this view the share ``share_right`` that has a
        same one in the first, with ``low_right, high_right``; over the keypoints of the first view
        and their nearest same ones, the median ``distance`` in pixels of the first view and the
        median ``scale_shift`` of log2 of the ratio of scales, with its quartiles ``q25_shift,
        q75_shift``; NaN where there are none.

    Examples
    --------
    >>> from keystab.camera.views import ViewSpec
    >>> views = CommonRange([ViewSpec(1.1, 1.0, (40, 40))] * 2, (40, 40), 3.0, 1.0, 4.0)
    >>> points = {"view": [0, 0, 1], "y": [9.0, 20, 9.5], "x": [9.0, 20, 9], "sigma": [2.0, 2, 2]}
    >>> table = against_first(pd.DataFrame(points), views, {})
    >>> table[["share_found", "share_right", "distance"]].to_numpy().tolist()
    [[1.0, 1.0, 0.0], [0.5, 1.0, 0.5]]
    """
    common = replace(everywhere, low=0.0, high=np.inf).common(keypoints)
    inside = common["sigma"].between(everywhere.low, everywhere.high)
    first_all, first = (
        common[(common["view"] == 0) & rows].reset_index(drop=True) for rows in (True, inside)
    )
    rows = []
    for number, spec in enumerate(everywhere.specs):
        here = common["view"] == number
        view, asked = (common[here & rows].reset_index(drop=True) for rows in (True, inside))
        rows.append(
            {
                **(labels or {}),
                "view": number,
                "blur": spec.blur,
                "zoom": spec.step / everywhere.specs[0].step,
                **_share("first", "found", matched(first, view, **same)),
                **_share("view", "right", matched(asked, first_all, **same)),
                **_offsets(first, view, same),
            }
        )
    return pd.DataFrame(rows)


def _share(members: str, kind: str, which: np.ndarray) -> dict[str, float]:
    low, high = wilson_interval(int(which.sum()), len(which))
    return {
        f"n_{members}": len(which),
        f"share_{kind}": which.mean() if len(which) else np.nan,
        f"low_{kind}": float(low),
        f"high_{kind}": float(high),
    }


def _offsets(first: pd.DataFrame, view: pd.DataFrame, same: Mapping[str, Any]) -> dict[str, float]:
    """Medians over the keypoints of the first view and the nearest same ones of another."""
    i, j, apart = pairs_between(first, view, **same)
    pairs = pd.DataFrame({"i": i, "j": j, "apart": apart}).sort_values(["apart", "i", "j"])
    i, j = pairs.drop_duplicates("i")[["i", "j"]].to_numpy().T
    if not len(i):
        return dict.fromkeys(("distance", "scale_shift", "q25_shift", "q75_shift"), np.nan)
    one, other = first.iloc[i], view.iloc[j]
    gap = np.hypot(*(one[c].to_numpy() - other[c].to_numpy() for c in ("y", "x")))
    shift = np.log2(other["sigma"].to_numpy() / one["sigma"].to_numpy())
    middle, low, high = np.quantile(shift, [0.5, 0.25, 0.75])
    return {
        "distance": float(np.median(gap)),
        "scale_shift": middle,
        "q25_shift": low,
        "q75_shift": high,
    }
