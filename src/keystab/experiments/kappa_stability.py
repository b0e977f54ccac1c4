"""What the detections of scale-spaces with different DoG ratios have in common (section 5.6).

A blob of standard deviation s is detected at s / sqrt(kappa), so that scales are compared after
multiplication by sqrt(kappa).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from keystab.evaluation.scene_pieces import ratio_intervals
from keystab.matching.common_range import comparable
from keystab.matching.unique_keypoints import gather, matches, unique_keypoints
from keystab.scalespace.sampling import balanced_delta


class KappaTables(NamedTuple):
    """Tables of figure 9, see `kappa_tables`."""

    counts: pd.DataFrame
    keypoints: pd.DataFrame
    occurrence: pd.DataFrame


def common_normalised_scales(kappas: Sequence[float], sigma_min: float) -> tuple[float, float]:
    r"""Range of normalised scales :math:`\sigma\sqrt\kappa` that all ratios cover (section 5.6).

    .. math:: \sigma_{min} \sqrt{\kappa_{max}} \le \sigma\sqrt\kappa
              \le 2 \sigma_{min} \sqrt{\kappa_{min}}

    Examples
    --------
    >>> common_normalised_scales([1.0, 2.0], 1.0)
    (1.4142135623730951, 2.0)
    """
    return sigma_min * max(kappas) ** 0.5, 2 * sigma_min * min(kappas) ** 0.5


def scale_slopes(normalised: NDArray[np.float64], kappas: Sequence[float]) -> NDArray[np.float64]:
    r"""Exponent of kappa to which the scale of each keypoint goes: -1/2 for a blob.

    Parameters
    ----------
    normalised : ndarray, shape (n_keypoints, n_kappas)
        Scales :math:`\sigma\sqrt\kappa`; NaN where a keypoint is not found.
    kappas : sequence of float

    Returns
    -------
    ndarray, shape (n_keypoints,)
        Slope of :math:`\ln\sigma` against :math:`\ln\kappa` in least squares; NaN for keypoints
        that are found with less than half of the ratios or with fewer than three.

    Examples
    --------
    >>> kappas = [1.1, 1.2, 1.3, 1.4]
    >>> blob = [1.5] * 4
    >>> (1 + scale_slopes(np.array([blob, np.sqrt(kappas)]), kappas)).round(6).tolist()
    [0.5, 1.0]
    """
    seen = np.isfinite(normalised)
    n_seen = seen.sum(axis=1)
    enough = n_seen >= max(3, len(kappas) / 2)
    x, y = (np.where(seen, np.log(np.broadcast_to(v, seen.shape)), 0) for v in (kappas, normalised))
    x, y = (np.where(seen, v - (v.sum(axis=1) / np.maximum(n_seen, 1))[:, None], 0) for v in (x, y))
    power = (x * x).sum(axis=1)
    slope = (x * y).sum(axis=1) / np.where(power > 0, power, np.nan)
    return np.where(enough, slope - 0.5, np.nan)


def kappa_tables(
    keypoints: pd.DataFrame,
    kappas: Sequence[float],
    n_spo: int,
    sigma_min: float,
    shape: tuple[int, int],
    border: float,
    same: Mapping[str, Any],
    soft_ends: bool = False,
) -> KappaTables:
    """Match the keypoints of all ratios by normalised scale.

    Parameters
    ----------
    keypoints : DataFrame
        ``kappa, y, x, sigma, sign`` of refined keypoints.
    kappas : sequence of float
        All ratios, also those without a keypoint.
    n_spo, sigma_min
        Of the scale-spaces.
    shape : tuple of int
        Height and width of the view.
    border : float
        Margin of the view that is left out, in pixels.
    same : mapping
        Options of `keystab.matching.correspondence.same`.
    soft_ends : bool
        Whether counterparts may lie beyond the common range of normalised scales.

    Returns
    -------
    KappaTables
        ``counts``: ``kappa, delta_min``, ``n_octave`` (keypoints with sigma in [sigma_min,
        2 sigma_min]), ``n_common`` (in the common range of normalised scales and off the border);
        ``octave_ratio, common_ratio``, the same over their means, with 95 % intervals over pieces
        of the scene ``low_octave, high_octave, low_common, high_common``.
        ``keypoints``: ``keypoint, y, x, sigma`` (normalised), ``n_kappas, stability, scale_slope``,
        see `scale_slopes`.
        ``occurrence``: ``keypoint, kappa, detected`` (0 or 1).

    Notes
    -----
    At its lower end the common range starts where the scale-space of the largest ratio does, and
    that finds nothing within about half a scale step of its first slice: up to 2**(1/(2 n_spo)).
    """
    low, high = common_normalised_scales(kappas, sigma_min)
    table = keypoints.reset_index(drop=True)
    octave = (table["sigma"] >= sigma_min) & (table["sigma"] <= 2 * sigma_min)
    normalised = table.assign(sigma=table["sigma"] * np.sqrt(table["kappa"]))
    kept = comparable(normalised, shape, low, 1.0, border, "sigma", high / low)
    common = normalised[kept].reset_index(drop=True)
    unique = unique_keypoints(common, **same, set_column="kappa")
    counterparts = common
    if soft_ends:
        near = comparable(normalised, shape, 0.0, 1.0, border, "sigma")
        counterparts = normalised[near].reset_index(drop=True)
    rows = matches(unique, counterparts, **same, set_column="kappa", sets=kappas)
    found = rows >= 0
    counts = pd.DataFrame({"kappa": kappas})
    counts["delta_min"] = [balanced_delta(n_spo, kappa, sigma_min) for kappa in kappas]
    for name, members in (("n_octave", table[octave]), ("n_common", common)):
        number = members["kappa"].value_counts()
        counts[name] = [int(number.get(kappa, 0)) for kappa in kappas]
    for kind, members in (("octave", table[octave]), ("common", common)):
        places = [members.loc[members["kappa"] == kappa, ["y", "x"]] for kappa in kappas]
        counts = counts.join(ratio_intervals(places, None, f"{kind}_ratio", kind, "kappas"))
    described = unique[["y", "x", "sigma"]].reset_index(drop=True)
    described.insert(0, "keypoint", np.arange(len(unique)))
    described["n_kappas"] = found.sum(axis=1)
    described["stability"] = described["n_kappas"] / len(kappas)
    described["scale_slope"] = scale_slopes(gather(counterparts["sigma"], rows), kappas)
    occurrence = pd.DataFrame(
        {
            "keypoint": np.repeat(np.arange(len(unique)), len(kappas)),
            "kappa": np.tile(np.asarray(kappas, dtype=float), len(unique)),
            "detected": found.astype(int).ravel(),
        }
    )
    return KappaTables(counts, described, occurrence)
