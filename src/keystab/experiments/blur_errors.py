r"""What a wrongly assumed camera blur does to keypoints, view by view (section 3.3, figure S2).

Views of one scene have blurs c around the blur c' that is assumed. Compared with the keypoints
that the right assumption finds, those of a view with c > c' lie at larger scales and those of one
with c < c' at smaller ones: a blob is detected at

.. math:: \sigma' = \sqrt{\sigma^2 + (c^2 - c'^2) / \kappa}

instead of :math:`\sigma` (see `keystab.scalespace.gaussian_blobs`). A mere dilation of the scale
axis, in which each Gaussian of the scale-space is only misnamed, would move keypoints the other
way, to :math:`\sqrt{\sigma^2 + c'^2 - c^2}`; but the ratio of the two Gaussians of a difference
changes as well.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from keystab.errors import InputError
from keystab.evaluation.intervals import normal_half_width, wilson_interval
from keystab.matching.common_range import CommonRange
from keystab.matching.correspondence import matched, pairs_between

_DISPLACEMENTS = 16
"""Directions in which keypoints are moved, a quarter of their field, to see what chance finds."""


def errors_by_octave(
    keypoints: pd.DataFrame,
    everywhere: CommonRange,
    blurs: Sequence[float],
    assumed: float,
    kappa: float,
    same: Mapping[str, Any],
) -> pd.DataFrame:
    """Compare views in the first and in the second octave of the range that they have in common.

    Parameters
    ----------
    keypoints : DataFrame
        ``view, y, x, sigma`` of the refined keypoints of all views, each in its own frame.
    everywhere : CommonRange
        Field of view and range of scales of all views.
    blurs, assumed, kappa, same
        See `blur_error_table`.

    Returns
    -------
    DataFrame
        See `blur_error_table`; ``scales`` are "first octave" and "second octave".

    Raises
    ------
    InputError
        If the blur of the first view is not the assumed one.
    """
    if blurs[0] != assumed:
        raise InputError(
            f"the first view has blur {blurs[0]:g}, wanted is the assumed {assumed:g}: "
            "put it first in the list of blurs"
        )
    low = everywhere.low
    octaves = {"first octave": (low, 2 * low), "second octave": (2 * low, 4 * low)}
    # Keypoints move across the ends of the ranges: those beyond are needed as counterparts.
    common = replace(everywhere, low=0.0).common(keypoints)
    return blur_error_table(common, blurs, assumed, kappa, octaves, same)


def blur_error_table(
    keypoints: pd.DataFrame,
    blurs: Sequence[float],
    assumed: float,
    kappa: float,
    scales: Mapping[str, tuple[float, float]],
    same: Mapping[str, Any],
) -> pd.DataFrame:
    """Compare the keypoints of every view with those of the view whose blur is the assumed one.

    Parameters
    ----------
    keypoints : DataFrame
        ``view, y, x, sigma`` of the refined keypoints of all views, in one frame. View 0 has the
        assumed blur. All scales that were searched: if they were cut at the lower end of a range,
        what moves below it would count as lost.
    blurs : sequence of float
        True blur c of every view, in pixels.
    assumed : float
        Assumed blur c', in pixels.
    kappa : float
        DoG ratio.
    scales : mapping from names to (low, high)
        Ranges of scales to look at, in pixels.
    same : mapping
        Options of `keystab.matching.correspondence.same`.

    Returns
    -------
    DataFrame
        One row per view and range: ``blur, error`` (c - c'), ``scales``; of the keypoints of view 0
        in the range ``n_right``, the share ``share_found`` that has a same one in the view, with
        its 95 % Wilson interval ``low_found, high_found``; of the view's keypoints in the range
        ``n_view``, the share ``share_right`` that has a same one in view 0, with ``low_right,
        high_right``; ``scale_shift``, the median of log2(sigma' / sigma) over the pairs of nearest
        same keypoints of either table, with its quartiles ``q25_shift, q75_shift``; and for these
        pairs the medians ``blob_shift``, that the closed form for blobs predicts, and
        ``dilation_shift``, of a mere dilation; NaN where no such scale exists. Last the share
        ``share_chance`` of the right keypoints that would be found by chance: by the view's if they
        lay elsewhere, with ``low_chance, high_chance`` (1.96 standard errors over displacements).
    """
    right = keypoints[keypoints["view"] == 0].reset_index(drop=True)
    rows = []
    for number, blur in enumerate(blurs):
        view = keypoints[keypoints["view"] == number].reset_index(drop=True)
        found, correct = matched(right, view, **same), matched(view, right, **same)
        shift, sigma = _shifts(right, view, same)
        chance = [matched(right, elsewhere, **same) for elsewhere in _displaced(view)]
        more = blur**2 - assumed**2
        for name, (low, high) in scales.items():
            inside = right["sigma"].between(low, high).to_numpy()
            theirs = view["sigma"].between(low, high).to_numpy()
            pairs = (sigma >= low) & (sigma <= high)
            quartiles = (
                np.quantile(shift[pairs], [0.5, 0.25, 0.75]) if pairs.any() else [np.nan] * 3
            )
            rows.append(
                {
                    "blur": blur,
                    "error": blur - assumed,
                    "scales": name,
                    **_share("right", "found", found[inside]),
                    **_share("view", "right", correct[theirs]),
                    **dict(zip(("scale_shift", "q25_shift", "q75_shift"), quartiles, strict=True)),
                    "blob_shift": _median_of_closed_form(sigma[pairs], more / kappa),
                    "dilation_shift": _median_of_closed_form(sigma[pairs], -more),
                    **_chance([of_one[inside] for of_one in chance]),
                }
            )
    return pd.DataFrame(rows)


def _displaced(view: pd.DataFrame) -> list[pd.DataFrame]:
    """Keypoints at other places with the same scales and neighbours, round the field of all."""
    if view.empty:
        return []
    places = view[["y", "x"]].to_numpy(dtype=float)
    start, size = places.min(axis=0), np.maximum(np.ptp(places, axis=0), 1e-9)
    moved = []
    for turn in np.linspace(0, 2 * np.pi, _DISPLACEMENTS, endpoint=False):
        away = size * np.array([np.sin(turn), np.cos(turn)]) / 4
        y, x = (start + (places - start + away) % size).T
        moved.append(view.assign(y=y, x=x))
    return moved


def _chance(found: Sequence[NDArray[np.bool_]]) -> dict[str, float]:
    """Mean share that is found over displacements, with its interval."""
    shares = np.array([each.mean() for each in found if len(each)])
    mean, half = (shares.mean(), normal_half_width(shares)) if len(shares) else (np.nan, np.nan)
    ends = {"low_chance": max(0.0, mean - half), "high_chance": min(1.0, mean + half)}
    return {"share_chance": mean, **(ends if len(shares) else dict.fromkeys(ends, np.nan))}


def _share(members: str, kind: str, which: np.ndarray) -> dict[str, float]:
    low, high = wilson_interval(int(which.sum()), len(which))
    return {
        f"n_{members}": len(which),
        f"share_{kind}": which.mean() if len(which) else np.nan,
        f"low_{kind}": float(low),
        f"high_{kind}": float(high),
    }


def _median_of_closed_form(sigma: NDArray[np.float64], change: float) -> float:
    """Median of log2(sqrt(sigma**2 + change) / sigma); NaN where most have a negative root."""
    if not len(sigma):
        return np.nan
    with np.errstate(divide="ignore"):
        middle = float(np.median(np.log2(np.maximum(1 + change / sigma**2, 0.0)) / 2))
    return middle if np.isfinite(middle) else np.nan


def _shifts(
    right: pd.DataFrame, view: pd.DataFrame, same: Mapping[str, Any]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Log2 ratio of the scales of mutually nearest keypoints, and their scale in `right`.

    Nearest in space alone: the nearest in scale would hide the shift that is asked for.
    """
    i, j, _ = pairs_between(right, view, **same)
    if not len(i):
        return np.empty(0), np.empty(0)
    apart = np.hypot(
        right["y"].to_numpy()[i] - view["y"].to_numpy()[j],
        right["x"].to_numpy()[i] - view["x"].to_numpy()[j],
    )
    pairs = pd.DataFrame({"i": i, "j": j, "apart": apart}).sort_values(["apart", "i", "j"])
    nearest_i = pairs.drop_duplicates("i")["j"].set_axis(pairs.drop_duplicates("i")["i"])
    nearest_j = pairs.drop_duplicates("j")["i"].set_axis(pairs.drop_duplicates("j")["j"])
    mutual = [(a, b) for a, b in nearest_i.items() if nearest_j[b] == a]
    a, b = (np.array(side, dtype=np.intp) for side in zip(*mutual, strict=True))
    before, after = right["sigma"].to_numpy()[a], view["sigma"].to_numpy()[b]
    return np.log2(after / before), before
