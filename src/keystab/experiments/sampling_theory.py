r"""What samplings of a scale-space mean for its Gaussians, without a picture (sections 2.2, 5.1).

Two things are asked of samplings. How much blur is added from one scale to the next, in samples,
and does a sampled kernel of that width still blur as a Gaussian does? And do its steps in scale and
in space change a Gaussian by as much (equation 23)?
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import pandas as pd

from keystab.experiments.semigroup_table import semigroup_table
from keystab.parameters import Scales, Semigroup
from keystab.scalespace.sampling import balanced_delta

__all__ = ["kernel_distances", "sampling_theory"]

_UNTRUNCATED = 12.0
"""Radius of a kernel that is not cut off, over its standard deviation: e^-72 is left out."""


def kernel_distances(sigma: float, step: float, aside: float) -> dict[str, float]:
    r"""Hellinger's distances of a Gaussian kernel from itself one step wider and one step aside.

    Parameters
    ----------
    sigma : float
        Standard deviation of the kernel, > 0.
    step : float
        By how much the other is wider.
    aside : float
        By how much the other is moved along one axis.

    Returns
    -------
    dict
        ``moved_1d, widened_1d, moved_2d, widened_2d`` for kernels of one and of two dimensions,
        between 0 and 1: :math:`H^2 = 1 - \int \sqrt{G\,G'}`, where the integral is
        :math:`e^{-\delta^2 / 8\sigma^2}` for a kernel moved by :math:`\delta`, and
        :math:`(2\sigma\sigma' / (\sigma^2 + \sigma'^2))^{d/2}` for one of width
        :math:`\sigma'` in d dimensions.

    Notes
    -----
    For small steps the distances are equal where :math:`\delta = \sqrt{2 d}\,\Delta\sigma`, as the
    Fisher information of a Gaussian has it.

    Examples
    --------
    >>> near = kernel_distances(1.0, 1e-3, 2**0.5 * 1e-3)
    >>> [round(near[f"widened_{d}d"] / near[f"moved_{d}d"], 3) for d in (1, 2)]
    [1.0, 1.414]
    """
    wider = sigma + step
    overlap = 2 * sigma * wider / (sigma**2 + wider**2)
    moved = math.sqrt(-math.expm1(-(aside**2) / (8 * sigma**2)))
    widened = {d: math.sqrt(-math.expm1(d / 2 * math.log(overlap))) for d in (1, 2)}
    return {
        "moved_1d": moved,
        "widened_1d": widened[1],
        "moved_2d": moved,
        "widened_2d": widened[2],
    }


def sampling_theory(
    n_spo: Sequence[int], scales: Scales, sift: tuple[float, float], semigroup: Semigroup
) -> pd.DataFrame:
    r"""What samplings mean for kernels: with SIFT's step in space, and balanced with that in scale.

    Parameters
    ----------
    n_spo : sequence of int
        Scales per octave.
    scales : Scales
        First scale and ratio of the two blurs.
    sift : (float, float)
        First scale and sampling step of SIFT, pixels.
    semigroup : Semigroup
        The blob, in samples, and how often it is blurred; see
        `keystab.experiments.semigroup_table.semigroup_table`.

    Returns
    -------
    DataFrame
        One row per ``grid`` (``sift``, ``balanced``) and ``n_spo``: ``delta_min``, pixels;
        ``increment``, the smallest blur :math:`\sigma_{min} \sqrt{2^{2/n_{spo}} - 1}` that leads
        from one scale to the next, in samples; the relative errors of the blur that several of them
        add up to, ``sampled_error`` with the sampled kernel, ``untruncated_error`` if it is not cut
        off, ``dct_error`` by the cosine transform; and `kernel_distances` at
        :math:`\kappa\sigma_{min}`.

    Examples
    --------
    >>> blurs = Semigroup(1.1, 10, 0.1, 1.5, 57, 4.0)
    >>> table = sampling_theory([3, 15], Scales(1.1, 2 ** (1 / 3)), (0.8, 0.5), blurs)
    >>> table[["grid", "n_spo", "increment"]].round(2).to_numpy().tolist()
    [['sift', 3, 1.23], ['sift', 15, 0.5], ['balanced', 3, 1.65], ['balanced', 15, 3.69]]
    """
    rows = []
    for grid in ("sift", "balanced"):
        for n in n_spo:
            first, delta = sift
            if grid == "balanced":
                first = scales.sigma_min
                delta = balanced_delta(n, scales.kappa, first)
            added = first * math.sqrt(2 ** (2 / n) - 1) / delta
            step = scales.kappa * first * (2 ** (1 / n) - 1)
            rows.append(
                {
                    "grid": grid,
                    "n_spo": int(n),
                    "delta_min": float(delta),
                    "increment": added,
                    **_errors(added, semigroup.blob, semigroup.n_passes, semigroup.truncation),
                    **kernel_distances(scales.kappa * first, step, delta),
                }
            )
    return pd.DataFrame(rows)


def _errors(added: float, blob: float, n_passes: int, truncation: float) -> dict[str, float]:
    """Relative errors of a blur that is added several times."""

    def error(method: str, radius: float) -> float:
        row = semigroup_table(blob, n_passes, [added], [method], radius).iloc[0]
        return float(np.abs(row["repeated_blur"] / row["theory"] - 1))

    return {
        "sampled_error": error("sampled", truncation),
        "untruncated_error": error("sampled", _UNTRUNCATED),
        "dct_error": error("dct", truncation),
    }
