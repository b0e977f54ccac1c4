"""The semigroup property of three ways to blur, as a table (section 2.2, figure 1)."""

from __future__ import annotations

from collections.abc import Sequence
from math import ceil, isfinite, sqrt
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from keystab.errors import InputError
from keystab.scalespace.semigroup import (
    METHODS,
    blob_profile,
    blur_profile,
    fitted_blur,
    semigroup_residual,
)

if TYPE_CHECKING:
    import pandas as pd

SIGMAS = tuple(i / 40 for i in range(4, 61))
"""Standard deviations of one pass in pixels: 0.1 to 1.5 in steps of 0.025."""

_REACH = 10.0
"""Half width of the grid in standard deviations of the widest blob: its border is below 1e-21."""


def semigroup_table(
    c: float = 1.1,
    n_passes: int = 10,
    sigmas: Sequence[float] | NDArray[np.float64] = SIGMAS,
    methods: Sequence[str] = METHODS,
    truncation: float = 4.0,
) -> pd.DataFrame:
    """Put the three ways to blur to the test of figure 1.

    Parameters
    ----------
    c : float, default 1.1
        Standard deviation of the blob in pixels, > 0. The paper's text says 1.0, its caption 1.1.
    n_passes : int, default 10
        Number of passes ``N``, >= 1.
    sigmas : sequence of float, default 0.1 to 1.5
        Standard deviations of one pass in pixels, > 0.
    methods : sequence of str, default all three
        Names from `METHODS`.
    truncation : float, default 4.0
        Radius of the sampled kernel in units of its standard deviation, > 0.

    Returns
    -------
    pandas.DataFrame
        One row per method and `sigma`, with columns ``sigma``, ``method``, ``repeated_blur`` and
        ``single_blur`` (fitted standard deviations after ``N`` passes of `sigma` and after one of
        ``sqrt(N) * sigma``), ``theory`` (``sqrt(c**2 + N * sigma**2)``), ``residual`` (the largest
        difference of the two pictures over the maximum of the second), ``c`` and ``n_passes``.
        Blurs are in pixels.

    Raises
    ------
    InputError
        If a parameter is out of range.

    Examples
    --------
    >>> table = semigroup_table(sigmas=[0.3]).set_index("method")
    >>> table.loc["sampled", ["repeated_blur", "theory"]].astype(float).round(3).tolist()
    [1.128, 1.453]
    >>> bool(table.loc["dct", "residual"] < 1e-13)
    True
    """
    import pandas as pd

    _check(c, n_passes, sigmas, methods, truncation)
    widest = sqrt(c**2 + n_passes * max(sigmas) ** 2)
    blob = blob_profile(2 * ceil(_REACH * widest) + 1, c)
    rows = []
    for method in methods:
        for sigma in map(float, sigmas):
            repeated = blob
            for _ in range(n_passes):
                repeated = blur_profile(repeated, sigma, method, truncation)
            single = blur_profile(blob, sqrt(n_passes) * sigma, method, truncation)
            rows.append(
                {
                    "sigma": sigma,
                    "method": method,
                    "repeated_blur": fitted_blur(repeated),
                    "single_blur": fitted_blur(single),
                    "theory": sqrt(c**2 + n_passes * sigma**2),
                    "residual": semigroup_residual(repeated, single),
                    "c": float(c),
                    "n_passes": n_passes,
                }
            )
    return pd.DataFrame(rows)


def _check(
    c: float,
    n_passes: int,
    sigmas: Sequence[float] | NDArray[np.float64],
    methods: Sequence[str],
    truncation: float,
) -> None:
    """Raise `InputError` for the first parameter out of range."""
    if not (isfinite(c) and c > 0):
        raise InputError(f"c: {c} is not a blur; give a finite number above 0, in pixels")
    if int(n_passes) != n_passes or n_passes < 1:
        raise InputError(f"n_passes: {n_passes} is not a number of passes; give an integer from 1")
    if not (isfinite(truncation) and truncation > 0):
        raise InputError(f"truncation: {truncation} is not a radius; give a number above 0")
    if len(sigmas) == 0 or not all(isfinite(s) and s > 0 for s in sigmas):
        raise InputError(f"sigmas: {list(sigmas)} must be one or more finite numbers above 0")
    unknown = [method for method in methods if method not in METHODS]
    if unknown or len(methods) == 0:
        raise InputError(f"methods: {list(methods)} must be names out of {', '.join(METHODS)}")
