"""What is detected less than half a step above the first scale (section 5.1)."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from keystab.evaluation.intervals import wilson_interval


def dead_range_row(
    discrete: ArrayLike, refined: ArrayLike, n_spo: int, sigma_min: float
) -> dict[str, float]:
    """Count detections below sigma_min 2^(1/(2 n_spo)), of which the paper says there are none.

    Extrema are sought in slices from the first step on, and a refined scale lies up to M_offset
    steps from that of its slice: with M_offset = 0.6 it may lie 0.4 steps above the first scale.

    Parameters
    ----------
    discrete, refined : array_like
        Scales of all extrema as they are found, and of the keypoints that the refinement accepts.
    n_spo : int
        Scales per octave.
    sigma_min : float
        First scale, in the unit of the others.

    Returns
    -------
    dict
        ``n_spo``; the ``end`` of the range; ``n_discrete`` extrema and ``below_discrete`` of them;
        ``n_refined`` keypoints, ``below_refined`` of them, the share ``share_below`` and its 95 %
        Wilson interval ``low_below, high_below``.

    Examples
    --------
    >>> row = dead_range_row([1.26, 1.59], [1.1, 1.3, 1.6], n_spo=3, sigma_min=1.0)
    >>> row["below_discrete"], row["below_refined"]
    (0, 1)
    """
    end = sigma_min * 2 ** (1 / (2 * n_spo))
    first, second = (np.asarray(scales, dtype=np.float64) for scales in (discrete, refined))
    below = int((second < end).sum())
    low, high = wilson_interval(below, second.size)
    return {
        "n_spo": n_spo,
        "end": end,
        "n_discrete": first.size,
        "below_discrete": int((first < end).sum()),
        "n_refined": second.size,
        "below_refined": below,
        "share_below": below / second.size if second.size else np.nan,
        "low_below": float(low),
        "high_below": float(high),
    }
