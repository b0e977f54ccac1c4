r"""What a wrongly assumed camera blur does to keypoints, view by view (section 3.3, figure S2).

Views of one scene have blurs c around the blur c' that is assumed. Compared with the keypoints
that the right assumption finds, those of a view with c > c' lie at larger scales and those of one
with c < c' at smaller ones: a blob is detected at

.. math:: \sigma' = \sqrt{\sigma^2 + (c^2 - c'^2) / \kappa}

instead of :math:`\sigma` (see `keystab.blobs`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from keystab.duplicates import matched, pairs_between
from keystab.intervals import wilson_interval


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
        assumed blur.
    blurs : sequence of float
        True blur c of every view, in pixels.
    assumed : float
        Assumed blur c', in pixels.
    kappa : float
        DoG ratio.
    scales : mapping from names to (low, high)
        Ranges of scales to look at, in pixels.
    same : mapping
        Options of `keystab.duplicates.same`.

    Returns
    -------
    DataFrame
        One row per view and range: ``blur, error`` (c - c'), ``scales``; of the keypoints of view 0
        in the range ``n_right``, the share ``share_found`` that has a same one in the view, with
        its 95 % Wilson interval ``low_found, high_found``; of the view's keypoints in the range
        ``n_view``, the share ``share_right`` that has a same one in view 0, with ``low_right,
        high_right``; ``scale_shift``, the median of log2(sigma' / sigma) over the pairs of nearest
        same keypoints of either table, with its quartiles ``q25_shift, q75_shift``; and
        ``blob_shift``, the median that the closed form for blobs predicts for the same pairs.
    """
    right = keypoints[keypoints["view"] == 0].reset_index(drop=True)
    rows = []
    for number, blur in enumerate(blurs):
        view = keypoints[keypoints["view"] == number].reset_index(drop=True)
        found, correct = matched(right, view, **same), matched(view, right, **same)
        shift, predicted, sigma = _shifts(right, view, (blur**2 - assumed**2) / kappa, same)
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
                    "blob_shift": np.median(predicted[pairs]) if pairs.any() else np.nan,
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


def _shifts(
    right: pd.DataFrame, view: pd.DataFrame, change: float, same: Mapping[str, Any]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Measured and predicted log2 ratio of scales of mutually nearest keypoints, and their sigma.

    Nearest in space alone: the nearest in scale would hide the shift that is asked for.
    """
    i, j, _ = pairs_between(right, view, **same)
    if not len(i):
        return (np.empty(0),) * 3
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
    with np.errstate(invalid="ignore"):
        expected = np.sqrt(np.maximum(before**2 + change, 0.0))
    return np.log2(after / before), np.log2(np.maximum(expected, 1e-9) / before), before
