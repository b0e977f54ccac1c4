"""What SIFT's filters keep, and how keypoints scatter that its filter of edges rejects (2.1)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from keystab.detection.sift_filters import passes_filters
from keystab.evaluation.intervals import wilson_interval
from keystab.evaluation.location_errors import quantile
from keystab.experiments.view_stability import MatchedViews
from keystab.matching.unique_keypoints import gather

__all__ = ["edge_spreads", "kept_by_filters"]


def kept_by_filters(tables: Sequence[pd.DataFrame]) -> pd.DataFrame:
    """Say which share of the keypoints of the first row each row keeps.

    Parameters
    ----------
    tables : sequence of DataFrame
        ``n_unique, n_always`` without filters, and with them; see
        `keystab.experiments.view_stability.count_table`.

    Returns
    -------
    DataFrame
        The same as one table with ``kept_always``, of keypoints seen in all views, ``low_kept,
        high_kept``, ``kept_others``, of the others, and ``low_others, high_others``
        (Wilson intervals, 95 %).

    Examples
    --------
    >>> counts = pd.DataFrame({"n_unique": [100, 30], "n_always": [50, 20]})
    >>> kept_by_filters([counts[:1], counts[1:]])[["kept_always", "kept_others"]].iloc[1].tolist()
    [0.4, 0.2]
    """
    counts = pd.concat(tables, ignore_index=True)
    groups = {"kept": counts["n_always"], "others": counts["n_unique"] - counts["n_always"]}
    columns: dict[str, NDArray[np.float64]] = {}
    for name, number in groups.items():
        n, k = int(number.iloc[0]), np.minimum(number.to_numpy(), number.iloc[0])
        low, high = wilson_interval(k, np.full(len(k), n))
        column = "kept_always" if name == "kept" else "kept_others"
        columns |= {column: k / n if n else np.full(len(k), np.nan)}
        columns |= {f"low_{name}": low, f"high_{name}": high}
    return counts.assign(**columns)


def edge_spreads(
    matched: MatchedViews, edge_ratio: float, minimum_share: float = 0.5
) -> pd.DataFrame:
    r"""Spread of keypoints along the direction of least curvature and across it.

    Parameters
    ----------
    matched : MatchedViews
        Keypoints of translated views. Their detections have ``h_yy, h_xx, h_yx``, the Hessian of
        the difference of Gaussians in space.
    edge_ratio : float
        Ratio r of SIFT's filter of edges, see `keystab.detection.sift_filters.passes_filters`.
    minimum_share : float
        Least share of the views that see a keypoint that counts.

    Returns
    -------
    DataFrame
        One row per group, those on an ``edge``, which the filter rejects, and the ``other``:
        ``group, n_keypoints``; ``along``, the median over keypoints of the standard deviation of
        the location in the direction v of the smallest :math:`|v^T H v|`, pixels, with its interval
        ``low_along, high_along`` from order statistics; ``across``, in the other direction, with
        ``low_across, high_across``. NaN where a group is too small.

    Notes
    -----
    H is the mean over the detections of a keypoint. Views must not be rotated or zoomed against
    one another.
    """
    enough = max(2, int(np.ceil(minimum_share * matched.seen.shape[1] - 1e-9)))
    found = matched.found[matched.seen.sum(axis=1) >= enough]
    table = matched.common
    mean = {
        name: np.nanmean(gather(table[name], found), axis=1) for name in ("h_yy", "h_xx", "h_yx")
    }
    on_edge = ~passes_filters(pd.DataFrame({"value": 1.0, **mean}), 0.0, edge_ratio)
    hessian = np.stack(
        [np.stack([mean["h_yy"], mean["h_yx"]], -1), np.stack([mean["h_yx"], mean["h_xx"]], -1)], -1
    )
    values, vectors = np.linalg.eigh(hessian)
    least = np.abs(values).argmin(axis=1) if len(found) else np.empty(0, dtype=int)
    along = vectors[np.arange(len(found)), :, least]
    places = np.stack([gather(table["y"], found), gather(table["x"], found)], -1)
    spreads = {
        "along": _spread(places, along),
        "across": _spread(places, np.stack([-along[:, 1], along[:, 0]], -1)),
    }
    rows = []
    for group, members in (("edge", on_edge), ("other", ~on_edge)):
        row: dict[str, object] = {"group": group, "n_keypoints": int(members.sum())}
        for name, spread in spreads.items():
            middle = quantile(spread[members])
            row |= {name: middle.value, f"low_{name}": middle.low, f"high_{name}": middle.high}
        rows.append(row)
    return pd.DataFrame(rows)


def _spread(places: NDArray[np.float64], direction: NDArray[np.float64]) -> NDArray[np.float64]:
    """Standard deviation of places, shape (n, n_views, 2), in the direction of each keypoint."""
    projected = np.einsum("nva,na->nv", places, direction)
    return np.asarray(pd.DataFrame(projected).std(axis=1, ddof=1), dtype=np.float64)
