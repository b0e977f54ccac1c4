"""The two filters of published SIFT that the study turns off (section 2.1).

Published detectors discard extrema of low contrast and extrema on edges. The study's own detector
has no filter of any kind; these are for comparison only.
"""

from __future__ import annotations

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from keystab.errors import InputError

CONTRAST = 0.03
"""Least absolute DoG value for grey values in [0, 1], at kappa = 2**(1/3) and n_spo = 3."""

EDGE_RATIO = 10.0
"""Largest ratio of the principal curvatures of the DoG slice."""


def passes_filters(
    keypoints: pd.DataFrame, contrast: float = CONTRAST, edge_ratio: float = EDGE_RATIO
) -> NDArray[np.bool_]:
    r"""Whether keypoints pass SIFT's filters of contrast and of edges.

    Kept are those with :math:`|w| \ge C` and, with H the 2 x 2 Hessian of the slice,

    .. math:: \det H > 0 \quad\text{and}\quad
              \frac{(\mathrm{tr} H)^2}{\det H} < \frac{(r + 1)^2}{r}

    Parameters
    ----------
    keypoints : DataFrame
        Columns ``value`` (refined DoG) and ``h_yy, h_xx, h_yx`` (Hessian at the discrete extremum,
        per grid step; the ratio does not depend on the step).
    contrast : float
        C, at least 0; 0 keeps all.
    edge_ratio : float
        r, at least 1; infinity keeps all but saddles.

    Returns
    -------
    ndarray of bool

    Raises
    ------
    InputError
        If `contrast` or `edge_ratio` is out of its range.

    Examples
    --------
    >>> table = pd.DataFrame({"value": [0.1, 0.1, 0.01], "h_yy": [-1.0, -1.0, -1.0],
    ...                       "h_xx": [-1.0, -0.01, -1.0], "h_yx": 0.0})
    >>> passes_filters(table).tolist()
    [True, False, False]
    """
    if not contrast >= 0:
        raise InputError(f"contrast is {contrast}, allowed is a number of at least 0: change it")
    if not edge_ratio >= 1:
        raise InputError(f"edge_ratio is {edge_ratio}, allowed is at least 1: change it")
    trace = keypoints["h_yy"] + keypoints["h_xx"]
    determinant = keypoints["h_yy"] * keypoints["h_xx"] - keypoints["h_yx"] ** 2
    # (r + 1)^2 / r is r + 2 + 1/r, which has a limit as a multiple of the determinant.
    on_edge = trace**2 >= (edge_ratio + 2 + 1 / edge_ratio) * determinant
    strong = keypoints["value"].abs() >= contrast
    return (strong & (determinant > 0) & ~on_edge).to_numpy()
