"""What detections of many views of one scene have in common, as tables (section 5.5 and 6).

Detections are tables with the columns ``view``, ``y, x, sigma`` in pixels of their view, and
``step_sigma`` where they are discrete. They are brought to the frame of the first view, kept where
all views could have seen them, and matched there.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from keystab.evaluation.intervals import (
    BOTH,
    Purpose,
    centred_interval,
    normal_half_width,
    wilson_interval,
)
from keystab.evaluation.localization import mean_localization
from keystab.evaluation.scene_pieces import drawn_anew
from keystab.evaluation.stability import stability_curve
from keystab.matching.common_range import CommonRange, compared
from keystab.matching.correspondence import SPACE_TOLERANCE
from keystab.matching.unique_keypoints import matches, minimum_unique_set

Labels = Mapping[str, Any]
"""What a table is about: columns of one value each, put before its own."""


class MatchedViews(NamedTuple):
    """Unique keypoints of a set of views, and which detection each is.

    Attributes
    ----------
    common : DataFrame
        The detections that were compared, and those that are counterparts only.
    found : ndarray of int, shape (n_unique, n_views)
        Row positions in `common`, -1 where a keypoint is not detected.
    gap : int
        0: the unique set is proven to be a minimum set.
    """

    common: pd.DataFrame
    found: NDArray[np.intp]
    gap: int

    @property
    def seen(self) -> NDArray[np.bool_]:
        """Occurrence matrix."""
        return self.found >= 0


def keypoints_of_views(common: pd.DataFrame, n_views: int, same: Mapping[str, Any]) -> MatchedViews:
    """Find the unique keypoints of a set of views, and each in every view.

    Parameters
    ----------
    common : DataFrame
        From `CommonRange.common`.
    n_views : int
        Views of the set, whether or not anything is detected in them.
    same : mapping
        Options of `keystab.matching.correspondence.same`.
    """
    unique = minimum_unique_set(common[compared(common)], **same, set_column="view")
    found = matches(unique.keypoints, common, **same, set_column="view", sets=range(n_views))
    return MatchedViews(common, found, unique.gap)


def parts_by(tilts: Sequence[float], n_views: int) -> list[tuple[dict[str, float], list[int]]]:
    """Parts of a set that are matched by themselves: the first view with those of each tilt.

    Parameters
    ----------
    tilts : sequence of float
        Tilt of every view; empty where all views are matched together.
    n_views : int
        Views of the set.

    Returns
    -------
    list of (labels, numbers of views)

    Examples
    --------
    >>> parts_by([0.0, 5.0, 40.0, 5.0], 4)
    [({'tilt': 5.0}, [0, 1, 3]), ({'tilt': 40.0}, [0, 2])]
    >>> parts_by([], 2)
    [({}, [0, 1])]
    """
    if not tilts:
        return [({}, list(range(n_views)))]
    numbers = {tilt: [k for k, other in enumerate(tilts) if k and other == tilt] for tilt in tilts}
    return [({"tilt": tilt}, [0, *views]) for tilt, views in numbers.items() if views]


def of_views(common: pd.DataFrame, members: Sequence[int]) -> pd.DataFrame:
    """Detections in some views of a set, which are numbered anew; all where these are all."""
    if common["view"].isin(members).all():
        return common
    table = common[common["view"].isin(members)].reset_index(drop=True)
    return table.assign(view=table["view"].map({view: k for k, view in enumerate(members)}))


def labelled(table: pd.DataFrame, labels: Labels) -> pd.DataFrame:
    """Put columns of one value each before those of a table."""
    return pd.concat(
        [pd.DataFrame({name: [value] * len(table) for name, value in labels.items()}), table],
        axis=1,
    )


def curve_table(matched: MatchedViews, labels: Labels, n_resamples: int) -> pd.DataFrame:
    """Percentage of unique keypoints seen in at least p % of the views (figures 7 to 12).

    Returns
    -------
    DataFrame
        `labels` and the columns of `keystab.evaluation.stability.stability_curve`; bands by
        resampling keypoints and views at once, with the unique set and the matches held fixed.
    """
    curve = stability_curve(matched.seen, n_resamples=n_resamples, purpose=purpose_of(labels))
    return labelled(curve, labels)


def localization_table(
    matched: MatchedViews,
    labels: Labels,
    minimum_share: float,
    n_resamples: int,
    resample: Collection[str] = BOTH,
) -> pd.DataFrame:
    """Mean precision of the keypoints seen often enough (figures 7 c, 8 b, S5 b).

    Keypoints are drawn anew for its interval, and views as well unless they are no sample of all
    that there could be, as are the few directions from which a scene is seen at a tilt.

    Returns
    -------
    DataFrame
        `labels`, ``quantity`` (location in pixels of the first view, log2_sigma in octaves) and the
        columns of `keystab.evaluation.localization.mean_localization`.
    """
    table = mean_localization(
        matched.common, matched.found, minimum_share, n_resamples, purpose_of(labels), resample
    )
    return labelled(table.reset_index(), labels)


def count_table(matched: MatchedViews, labels: Labels) -> pd.DataFrame:
    """One row of numbers: how many detections and keypoints, and how many are seen in all views.

    Returns
    -------
    DataFrame
        `labels`; ``n_views``; mean number of compared detections per view ``mean_detections``
        with the ends ``low_detections, high_detections`` of its 95 % interval over views
        (1.96 standard errors); ``n_unique``, ``gap``, ``n_always``; ``share_always`` with its
        95 % Wilson interval ``low_always, high_always``.
    """
    n_unique, n_views = matched.found.shape
    asked = matched.common[compared(matched.common)]
    per_view = np.bincount(asked["view"].to_numpy(np.int64), minlength=n_views)
    error = normal_half_width(per_view)
    always = int(matched.seen.all(axis=1).sum())
    low, high = wilson_interval(always, n_unique)
    row = {
        "n_views": n_views,
        "mean_detections": per_view.mean(),
        "low_detections": per_view.mean() - error,
        "high_detections": per_view.mean() + error,
        "n_unique": n_unique,
        "gap": matched.gap,
        "n_always": always,
        "share_always": always / n_unique if n_unique else np.nan,
        "low_always": float(low),
        "high_always": float(high),
    }
    return labelled(pd.DataFrame([row]), labels)


def scale_table(
    detections: pd.DataFrame,
    everywhere: CommonRange,
    starts: Sequence[float],
    same: Mapping[str, Any],
    seen_by: float,
    labels: Labels,
    n_resamples: int,
    unit: float = 0.0,
) -> pd.DataFrame:
    """Stability of one octave's keypoints against where it starts (figures 11 b, 12 c, d).

    Parameters
    ----------
    detections : DataFrame
        Refined keypoints of all views.
    everywhere : CommonRange
        Its field of view and whether its ends are soft are used; its scales are replaced.
    starts : sequence of float
        First scales of the octaves, in pixels of the first view.
    same : mapping
        Options of `keystab.matching.correspondence.same`.
    seen_by : float
        Share of the views in which a keypoint must be seen.
    labels : mapping
        Columns to put before the others.
    n_resamples : int
        Of the bootstrap over keypoints and views.
    unit : float
        With a unit above 0, a second row per start, in pixels of the octave: as if it was an image
        of its own that began at the scale `unit`, its space tolerance is longer by start / unit.

    Returns
    -------
    DataFrame
        One row per start: `labels`; with a unit ``pixels_of``, "view" or "octave", and
        ``space_tolerance`` in pixels of the view; ``sigma_from``; ``n_unique``, of the octave;
        ``n_seen`` of
        them, in at least ``seen_by`` of the views; ``percentage_seen`` with ``low, high``;
        ``mean_above``, keypoints per view at scales of at least ``sigma_from`` and without upper
        end, with ``low_above, high_above`` (1.96 standard errors over views); ``step``, by how much
        ``percentage_seen`` is larger than at the start before, with ``low_step, high_step``: the
        octaves overlap, and both are drawn anew with the same pieces of the scene and views.
    """
    rows = []
    n_views = len(everywhere.specs)
    limit = same.get("space_tolerance", SPACE_TOLERANCE)
    kinds = [("view", [limit] * len(starts))]
    if unit:
        kinds.append(("octave", [limit * start / unit for start in starts]))
    octaves: dict[str, list[tuple[pd.DataFrame, NDArray[np.intp]]]] = {
        kind: [] for kind, _ in kinds
    }
    for kind, start, tolerance in (
        (kind, *pair) for kind, limits in kinds for pair in zip(starts, limits, strict=True)
    ):
        field = (everywhere.specs, everywhere.reference_shape, everywhere.margin)
        octave = CommonRange(*field, start, 2 * start, everywhere.soft)
        how = {**same, "space_tolerance": tolerance}
        matched = keypoints_of_views(octave.common(detections), n_views, how)
        octaves[kind].append((matched.common, matched.found))
        curve = stability_curve(
            matched.seen,
            [100 * seen_by],
            n_resamples,
            (*purpose_of(labels), f"{start:.6g}"),
        ).iloc[0]
        above = CommonRange(*field, start).common(detections)
        per_view = np.bincount(above["view"].to_numpy(np.int64), minlength=n_views)
        error = normal_half_width(per_view)
        rows.append(
            {
                **({"pixels_of": kind, "space_tolerance": tolerance} if unit else {}),
                "sigma_from": start,
                "n_unique": len(matched.found),
                "seen_by": seen_by,
                "n_seen": int(curve["n_unique"]),
                "percentage_seen": curve["percentage_of_unique"],
                "low": curve["low"],
                "high": curve["high"],
                "mean_above": per_view.mean(),
                "low_above": per_view.mean() - error,
                "high_above": per_view.mean() + error,
            }
        )
    steps = [_steps(found, seen_by, n_resamples) for found in octaves.values()]
    return labelled(pd.DataFrame(rows).join(pd.concat(steps, ignore_index=True)), labels)


def _steps(
    octaves: Sequence[tuple[pd.DataFrame, NDArray[np.intp]]], seen_by: float, n_resamples: int
) -> pd.DataFrame:
    """Steps of the percentage of keypoints seen often enough, from one octave to the next."""
    shares = [
        100 * drawn.share(int(np.ceil(seen_by * drawn.n_views - 1e-9)))
        for drawn in drawn_anew(octaves, n_resamples)
    ]
    steps = np.diff(np.array(shares), axis=0, prepend=np.nan)
    columns = {"step": steps[:, 0], "low_step": np.nan, "high_step": np.nan}
    if n_resamples and len(octaves) > 1:
        low, high = centred_interval(steps[1:, 1:].T, steps[1:, 0])
        columns["low_step"], columns["high_step"] = np.append(np.nan, low), np.append(np.nan, high)
    return pd.DataFrame(columns)


def purpose_of(labels: Labels) -> Purpose:
    """What random draws are for, from the labels of a table."""
    return tuple(f"{name}={value}" for name, value in labels.items())
