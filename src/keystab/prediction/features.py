r"""Features of an extremum that might tell whether it is stable (section 5.3 of the paper).

The detector records central differences on its own grid, in units of one grid step. They shrink
as the grid gets finer, so extrema of different samplings compare only after a change of units.

Units
-----
One step of the grid is :math:`\delta` pixels in y and x and :math:`\ln 2 / n_{spo}` in
:math:`\lambda = \ln\sigma`. A zoom by a factor z maps :math:`(\sigma, x)` to
:math:`(z\sigma, zx)`, so what a zoom leaves alone are derivatives with respect to
:math:`x / \sigma` (with :math:`\sigma` held at the extremum) and :math:`\lambda`: the scale-space's
own units of length. With the length of one grid step in these units

.. math:: r_y = r_x = \delta / \sigma, \qquad r_s = a \, \ln 2 / n_{spo}

the Hessian in them is :math:`H_{ij} = h_{ij} / (r_i r_j)`, that is

.. math:: H_{yy} = \sigma^2 \, \partial_{yy} w, \qquad
          H_{sy} = a^{-1} \sigma \, \partial_\lambda \partial_y w, \qquad
          H_{ss} = a^{-2} \, \partial_{\lambda\lambda} w .

Zoom invariance leaves the number a open: how many units of :math:`x / \sigma` make one unit of
:math:`\ln\sigma`. The default a = 1 compares a shift by :math:`\sigma` with a factor e in scale.
The paper's balanced sampling amounts to :math:`a = \sqrt 2 \kappa`: with that value, one step in
scale is as long as one step in space at ``sigma_min`` (as :math:`n_{spo} \to \infty`).

At an extremum the gradient vanishes, and second derivatives with respect to :math:`\sigma` and to
:math:`\lambda` carry the same information (:math:`\partial_{\lambda\lambda} w =
\sigma^2 \partial_{\sigma\sigma} w`). At a grid sample near it they differ by a term of the order of
one grid step, as all these differences do.
"""

from __future__ import annotations

import math

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from keystab.errors import InputError

DIRECTIONS = {
    "dog": 1,
    "difference": 1,
    "laplacian": 1,
    "condition": -1,
    "condition_normalised": -1,
}
"""Which way each feature is used, chosen before seeing any result.

+1: a larger value is expected of a stable extremum. It stands out more (``dog``), stands out more
from its neighbours (``difference``), is more peaked (``laplacian``).
-1: a smaller value is. An extremum that is elongated, ``condition`` much above 1, moves far
along its long axis when the function changes little.
"""

_HESSIAN_COLUMNS = ("h_ss", "h_sy", "h_sx", "h_sy", "h_yy", "h_yx", "h_sx", "h_yx", "h_xx")


def feature_table(
    extrema: pd.DataFrame,
    n_spo: ArrayLike,
    delta_min: ArrayLike,
    log_scale_unit: float = 1.0,
) -> pd.DataFrame:
    r"""Features of discrete extrema, all positive and comparable across balanced samplings.

    Parameters
    ----------
    extrema : DataFrame
        Columns ``sigma``, ``value``, ``difference`` and ``h_ss``, ``h_yy``, ``h_xx``, ``h_sy``,
        ``h_sx``, ``h_yx`` (central differences per grid step), as `keystab.detection.detector`
        makes them.
    n_spo : int or array
        Scales per octave of the sampling; one number or one per row.
    delta_min : float or array
        Distance of adjacent samples in input pixels where the extremum was found: it doubles with
        every octave.
    log_scale_unit : float
        The number a above.

    Returns
    -------
    DataFrame
        With the index of `extrema` and the columns

        ``dog``
            :math:`|w|`; needs no change of units.
        ``difference``
            Smallest :math:`|w - w_{neighbour}|` of the 26, times :math:`(\sigma/\delta)^2`. Near an
            extremum a difference over a step r is a second derivative times :math:`r^2 / 2`, so
            the raw difference shrinks like the square of the step. Comparable only
            where space and scale keep one ratio of steps, as in balanced samplings.
        ``laplacian``
            :math:`|H_{ss} + H_{yy} + H_{xx}|`.
        ``condition``
            2-norm condition number of the Hessian per grid step, as the paper uses it: the matrix
            of the linear system that the refinement solves. It says how well that sampling suits
            refinement, and nearly the same extremum has another one on an unbalanced grid.
        ``condition_normalised``
            The same of :math:`H`: a property of the extremum, not of the grid.

    Raises
    ------
    InputError
        If a column is missing or `n_spo`, `delta_min` or `log_scale_unit` is not above 0.

    Examples
    --------
    >>> one = pd.DataFrame({"sigma": [2.0], "value": [-0.1], "difference": [0.01], "h_ss": [0.04],
    ...     "h_yy": [0.08], "h_xx": [0.02], "h_sy": [0.0], "h_sx": [0.0], "h_yx": [0.0]})
    >>> feature_table(one, n_spo=3, delta_min=0.5).round(3).to_dict("records")[0]["condition"]
    4.0
    """
    _require_columns(extrema, ("sigma", "value", "difference"))
    grid = hessians(extrema)
    sigma = extrema["sigma"].to_numpy(dtype=float)
    own = normalised(grid, sigma, n_spo, delta_min, log_scale_unit)
    return pd.DataFrame(
        {
            "dog": extrema["value"].abs().to_numpy(dtype=float),
            "difference": extrema["difference"].to_numpy(dtype=float)
            * (sigma / np.asarray(delta_min)) ** 2,
            "laplacian": np.abs(np.trace(own, axis1=-2, axis2=-1)),
            "condition": condition_numbers(grid),
            "condition_normalised": condition_numbers(own),
        },
        index=extrema.index,
    )


def hessians(extrema: pd.DataFrame) -> NDArray[np.float64]:
    """Hessians of the difference of Gaussians per grid step, axes in the order (s, y, x).

    Parameters
    ----------
    extrema : DataFrame
        Columns ``h_ss``, ``h_yy``, ``h_xx``, ``h_sy``, ``h_sx``, ``h_yx``.

    Returns
    -------
    ndarray, shape (n, 3, 3)

    Raises
    ------
    InputError
        If a column is missing.
    """
    _require_columns(extrema, _HESSIAN_COLUMNS)
    return extrema[list(_HESSIAN_COLUMNS)].to_numpy(dtype=float).reshape(-1, 3, 3)


def normalised(
    hessian: NDArray[np.float64],
    sigma: ArrayLike,
    n_spo: ArrayLike,
    delta_min: ArrayLike,
    log_scale_unit: float = 1.0,
) -> NDArray[np.float64]:
    r"""Hessians in the units of the scale-space, :math:`H_{ij} = h_{ij} / (r_i r_j)`.

    Parameters
    ----------
    hessian : ndarray, shape (n, 3, 3)
        Per grid step, axes in the order (s, y, x).
    sigma, n_spo, delta_min : float or array of n
        Scale of the extremum in input pixels, scales per octave, distance of adjacent samples in
        input pixels.
    log_scale_unit : float
        Units of x / sigma that make one unit of ln sigma (the number a above).

    Returns
    -------
    ndarray, shape (n, 3, 3)

    Raises
    ------
    InputError
        If one of the numbers is not above 0.

    Examples
    --------
    A grid twice as fine: second differences a quarter as large, the same Hessian.

    >>> h = np.diag([4.0, 4.0, 4.0])[None]
    >>> bool(np.allclose(normalised(h, 1.1, 3, 0.5), normalised(h / 4, 1.1, 6, 0.25)))
    True
    """
    numbers = {"sigma": sigma, "n_spo": n_spo, "delta_min": delta_min}
    for name, value in {**numbers, "log_scale_unit": log_scale_unit}.items():
        if not np.all(np.asarray(value) > 0):
            raise InputError(f"{name} is {np.min(value)}, allowed is above 0: change {name}")
    space = np.asarray(delta_min, dtype=float) / np.asarray(sigma, dtype=float)
    scale = log_scale_unit * math.log(2) / np.asarray(n_spo, dtype=float)
    step = np.stack(np.broadcast_arrays(scale, space, space), axis=-1)
    rescaled: NDArray[np.float64] = hessian / (step[..., :, None] * step[..., None, :])
    return rescaled


def condition_numbers(hessian: NDArray[np.float64]) -> NDArray[np.float64]:
    """Condition number in the 2-norm: ratio of the eigenvalues largest and smallest in size.

    Parameters
    ----------
    hessian : ndarray, shape (..., 3, 3)
        Symmetric matrices; the lower triangle is read.

    Returns
    -------
    ndarray, shape (...)
        1 or more, infinite for the zero matrix, NaN where an entry is not finite. A singular
        matrix gives infinity or, by rounding, something above about 1e15.

    Examples
    --------
    >>> condition_numbers(np.diag([-2.0, 1.0, 8.0])[None])
    array([8.])
    """
    finite = np.asarray(np.isfinite(hessian).all(axis=(-2, -1)))
    # The solver refuses NaN, so such matrices are replaced and marked afterwards.
    usable = np.where(finite[..., None, None], hessian, 0.0)
    size = np.abs(np.linalg.eigvalsh(usable))
    smallest, largest = size.min(axis=-1), size.max(axis=-1)
    condition = np.full(finite.shape, np.inf)
    np.divide(largest, smallest, out=condition, where=smallest > 0)
    return np.where(finite, condition, np.nan)


def _require_columns(extrema: pd.DataFrame, names: tuple[str, ...]) -> None:
    missing = sorted(set(names) - set(extrema.columns))
    if missing:
        raise InputError(
            f"the table of extrema has no column {missing[0]!r}, needed are "
            f"{', '.join(sorted(set(names)))}: use a table that the detector made"
        )
