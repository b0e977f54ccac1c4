"""Refinement of discrete extrema by a quadratic model (section 2.1 of the paper, equation 2).

The model at a grid sample takes its gradient g and Hessian H from central differences of the 26
neighbours; its extremum lies at ``alpha = -H^{-1} g`` grid steps. It is accepted when
``max|alpha| < M_offset``; otherwise the model is made again at another sample, at most
``N_interp`` times in all. The models met on the way are recorded in a *trace*, from which every
``(M_offset, N_interp)`` can be decided later without touching the scale-space again.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from keystab.errors import InputError
from keystab.scalespace.sampling import Sampling
from keystab.utils import validation

if TYPE_CHECKING:
    from keystab.scalespace.dog import ScaleSpace

Columns = Mapping[str, np.ndarray]
"""A table as arrays by name: where tables are small, making a DataFrame takes most of the time."""


def columns_of(table: pd.DataFrame) -> dict[str, np.ndarray]:
    """Columns of a table as arrays."""
    return {str(name): column.to_numpy() for name, column in table.items()}


MOVES = ("nearest", "unit_step")

# "Infinitely many" interpolations: paths that have not ended by then do not end.
MOST_MODELS = 100


# Columns of a table of extrema that hold the quadratic model at the sample, per grid step.
GRADIENT_COLUMNS = {"g_s": 0, "g_y": 1, "g_x": 2}
HESSIAN_COLUMNS = {
    "h_ss": (0, 0),
    "h_yy": (1, 1),
    "h_xx": (2, 2),
    "h_sy": (0, 1),
    "h_sx": (0, 2),
    "h_yx": (1, 2),
}


def quadratic_model(cubes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Gradient and Hessian by central differences, per grid step.

    Parameters
    ----------
    cubes : ndarray, shape (n, 3, 3, 3)
        Values around n samples, axes (sample, scale, y, x).

    Returns
    -------
    gradient : ndarray, shape (n, 3)
        Components along scale, y, x.
    hessian : ndarray, shape (n, 3, 3)
        Symmetric; axes in the same order.

    Examples
    --------
    >>> s, y, x = np.mgrid[-1:2, -1:2, -1:2]
    >>> gradient, hessian = quadratic_model((3 * x + 2 * y**2 + s * x)[None].astype(float))
    >>> gradient[0], hessian[0, 1, 1], hessian[0, 0, 2]
    (array([0., 0., 3.]), np.float64(4.0), np.float64(1.0))
    """
    n = cubes.shape[0]
    gradient = np.empty((n, 3))
    hessian = np.empty((n, 3, 3))
    centre = np.array([1, 1, 1])

    def at(*steps: np.ndarray) -> np.ndarray:
        k, i, j = centre + sum(steps)
        return cubes[:, k, i, j]

    unit = np.eye(3, dtype=int)
    for a in range(3):
        forward, backward = at(unit[a]), at(-unit[a])
        gradient[:, a] = (forward - backward) / 2
        hessian[:, a, a] = forward - 2 * cubes[:, 1, 1, 1] + backward
        for b in range(a):
            mixed = at(unit[a], unit[b]) - at(unit[a], -unit[b])
            mixed = mixed - at(-unit[a], unit[b]) + at(-unit[a], -unit[b])
            hessian[:, a, b] = hessian[:, b, a] = mixed / 4
    return gradient, hessian


def stationary_point(gradient: np.ndarray, hessian: np.ndarray) -> np.ndarray:
    """Solve ``H alpha = -g`` for every model, by cofactors.

    Returns
    -------
    ndarray, shape (n, 3)
        Offsets in grid steps; NaN where the Hessian is singular.
    """
    rows = hessian.transpose(1, 2, 0)
    a, cofactors = hessian[:, 0], np.empty(hessian.shape)
    for k in range(3):  # np.cross says the same, and takes longer than a hundred models
        x, y = rows[(k + 1) % 3], rows[(k + 2) % 3]
        for i in range(3):
            u, v = (i + 1) % 3, (i + 2) % 3
            cofactors[:, i, k] = x[u] * y[v] - x[v] * y[u]
    determinant = np.einsum("ni,ni->n", a, cofactors[:, :, 0])
    with np.errstate(divide="ignore", invalid="ignore"):
        offset: np.ndarray = -np.einsum("nij,nj->ni", cofactors, gradient) / determinant[:, None]
    offset[~np.isfinite(offset).all(axis=1)] = np.nan
    return offset


def trace(
    space: ScaleSpace,
    extrema: pd.DataFrame,
    max_offset: float = 0.5,
    move: str = "nearest",
    scale_moves: bool = True,
    max_models: int = MOST_MODELS,
) -> pd.DataFrame:
    """Follow each discrete extremum from model to model.

    Parameters
    ----------
    space : ScaleSpace
        Where the extrema were found.
    extrema : DataFrame
        From `keystab.detection.detector.extrema_table`; the first models are in it.
    max_offset : float
        A path ends at the first model with ``max|alpha| < max_offset``. With ``move="nearest"``
        give the smallest M_offset that will be asked for (below 1/2 paths do not move on anyway);
        with ``move="unit_step"`` the path depends on M_offset, and the trace serves this value
        only.
    move : {"nearest", "unit_step"}
        Where the next model is made: at the grid sample nearest to the stationary point, or one
        step along each axis whose ``|alpha|`` exceeds `max_offset`.
    scale_moves : bool
        Whether the scale index may change.
    max_models : int
        Length at which paths are cut.

    Returns
    -------
    DataFrame
        One row per model: ``keypoint`` (position in `extrema`), ``model`` (1, 2, ...),
        ``s, row, column`` of its sample, ``alpha_s, alpha_y, alpha_x`` (NaN for a singular
        Hessian) and the model's extremal ``value``. Ordered by keypoint and model.

    Notes
    -----
    A path also ends where the next sample would have no complete neighbourhood (it leaves the
    grid or the slices of the octave), where it would stay, and where it returns to a sample that
    it has seen, since from there it only repeats itself.
    """
    return pd.DataFrame(
        traced(space, columns_of(extrema), max_offset, move, scale_moves, max_models)
    )


def traced(
    space: ScaleSpace,
    extrema: Columns,
    max_offset: float,
    move: str,
    scale_moves: bool,
    max_models: int,
) -> dict[str, np.ndarray]:
    """As `trace`, from and to columns."""
    _check(move, max_offset, max_models)
    here = np.stack([extrema[name] for name in ("s", "row", "column")], axis=1)
    here = here.astype(np.int64)
    centre, gradient, hessian = _first_model(extrema)
    keypoint = np.arange(here.shape[0])
    seen: list[np.ndarray] = []
    parts = []
    last = np.array(space.shape) - 2
    for model in range(1, max_models + 1):
        if model > 1:
            cubes = space.neighbourhoods(*here.T)
            centre = cubes[:, 1, 1, 1]
            gradient, hessian = quadratic_model(cubes)
        alpha = stationary_point(gradient, hessian)
        value = centre + 0.5 * np.einsum("ni,ni->n", gradient, alpha)
        parts.append((keypoint, np.full(keypoint.size, model), here, alpha, value))
        step = _step(alpha, max_offset, move)
        if not scale_moves:
            step[:, 0] = 0
        seen = [*seen, here]
        there = here + step
        goes_on = (np.abs(alpha).max(axis=1, initial=0) >= max_offset) & step.any(axis=1)
        goes_on &= (there >= 1).all(axis=1) & (there <= last).all(axis=1)
        for earlier in seen:
            goes_on &= (there != earlier).any(axis=1)
        if not goes_on.any():
            break
        keypoint, here = keypoint[goes_on], there[goes_on]
        seen = [earlier[goes_on] for earlier in seen]
    of, number, place, alpha, value = (np.concatenate(part) for part in zip(*parts, strict=True))
    order = np.lexsort((number, of))
    place, alpha = place[order], alpha[order]
    return {
        "keypoint": of[order],
        "model": number[order],
        **dict(zip(("s", "row", "column"), place.T, strict=True)),
        **dict(zip(("alpha_s", "alpha_y", "alpha_x"), alpha.T, strict=True)),
        "value": value[order],
    }


def accepted(trace: pd.DataFrame, max_offset: float, max_iterations: float) -> pd.DataFrame:
    """Models at which keypoints are accepted.

    Parameters
    ----------
    trace : DataFrame
        From `trace`.
    max_offset : float
        M_offset; infinity accepts the first model of every extremum that has one.
    max_iterations : float
        N_interp, the number of models in all; infinity for no limit.

    Returns
    -------
    DataFrame
        The rows of `trace` of the first model of each keypoint with ``max|alpha| < max_offset``
        among its first `max_iterations`; keypoints without one are discarded.
    """
    return trace.iloc[_first_accepted(columns_of(trace), max_offset, max_iterations)].reset_index(
        drop=True
    )


def _first_accepted(trace: Columns, max_offset: float, max_iterations: float) -> NDArray[np.int64]:
    """Rows of a trace at which keypoints are accepted, in their order."""
    alpha = (np.abs(trace[name]) for name in ("alpha_s", "alpha_y", "alpha_x"))
    good = np.max(list(alpha), axis=0) < max_offset  # of what is not a number, none is less
    good &= trace["model"] <= max_iterations
    rows = np.flatnonzero(good)
    return np.sort(rows[np.unique(trace["keypoint"][rows], return_index=True)[1]])


def positions(models: pd.DataFrame, sampling: Sampling) -> pd.DataFrame:
    """Continuous positions of models: ``y, x`` in input pixels and ``sigma``.

    The refined scale is geometric, ``sigma_s * 2**(alpha_s / n_spo)``.
    """
    place = [models[name].to_numpy() for name in ("s", "row", "column")]
    alpha = [models[name].to_numpy() for name in ("alpha_s", "alpha_y", "alpha_x")]
    return pd.DataFrame(positions_of(place, alpha, sampling))


def positions_of(
    place: Sequence[np.ndarray] | np.ndarray,
    alpha: Sequence[np.ndarray] | np.ndarray,
    sampling: Sampling,
) -> dict[str, np.ndarray]:
    """As `positions`, from samples s, row, column and the offsets of models to them."""
    with np.errstate(over="ignore"):
        sigma = sampling.sigma[place[0]] * 2.0 ** (alpha[0] / sampling.n_spo)
    return {
        "y": (place[1] + alpha[1]) * sampling.step,
        "x": (place[2] + alpha[2]) * sampling.step,
        "sigma": sigma,
    }


def _first_model(extrema: Columns) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Value, gradient and Hessian at the discrete extrema, from their table."""
    value = extrema["value"]
    hessian = np.empty((value.size, 3, 3))
    for name, (i, j) in HESSIAN_COLUMNS.items():
        hessian[:, i, j] = hessian[:, j, i] = extrema[name]
    gradient = np.stack([extrema[name] for name in GRADIENT_COLUMNS], axis=1)
    return value, gradient, hessian


def _step(alpha: np.ndarray, max_offset: float, move: str) -> np.ndarray:
    """Grid steps from the sample of a model to that of the next; zero where there is none."""
    if move == "nearest":
        # Offsets of singular or nearly singular models lead far out of any grid.
        step = np.rint(np.clip(np.nan_to_num(alpha, nan=0.0), -(2.0**40), 2.0**40))
    else:
        step = np.sign(alpha) * (np.abs(alpha) > max_offset)
    moved: np.ndarray = np.nan_to_num(step).astype(np.int64)
    return moved


def _check(move: str, max_offset: float, max_models: int) -> None:
    if move not in MOVES:
        raise InputError(f"move is {move!r}, allowed are {' and '.join(MOVES)}: change move")
    validation.limit("max_offset", max_offset, above=0)
    validation.integer("max_models", max_models, least=1)


def refined_table(
    sampling: Sampling,
    extrema: pd.DataFrame,
    models: pd.DataFrame,
    max_offset: float,
    max_iterations: float,
) -> pd.DataFrame:
    """Keypoints that a refinement accepts.

    Parameters
    ----------
    sampling : Sampling
        Where the extrema were found.
    extrema : DataFrame
        From `keystab.detection.detector.extrema_table`.
    models : DataFrame
        Their trace, from `trace`.
    max_offset, max_iterations : float
        M_offset and N_interp.

    Returns
    -------
    DataFrame
        Refined ``y, x, sigma, value`` with ``sign``, the indices ``s, row, column`` and
        ``difference`` of the discrete extremum, the number of ``models``, and ``keypoint``, the
        row in `extrema`.
    """
    columns = columns_of(extrema), columns_of(models)
    return pd.DataFrame(refined(sampling, *columns, max_offset, max_iterations))


def refined(
    sampling: Sampling,
    extrema: Columns,
    models: Columns,
    max_offset: float,
    max_iterations: float,
) -> dict[str, np.ndarray]:
    """As `refined_table`, from and to columns."""
    rows = _first_accepted(models, max_offset, max_iterations)
    good = {name: column[rows] for name, column in models.items()}
    of = good["keypoint"]
    names = ["sign", "s", "row", "column", "difference"]
    place = [good[name] for name in ("s", "row", "column")]
    alpha = [good[name] for name in ("alpha_s", "alpha_y", "alpha_x")]
    return {
        **positions_of(place, alpha, sampling),
        "value": good["value"],
        **{name: extrema[name][of] for name in names},
        "models": good["model"],
        "keypoint": of,
    }


def refined_keypoints(
    extrema: pd.DataFrame, traces: pd.DataFrame, max_offset: float, max_iterations: float
) -> pd.DataFrame:
    """Keypoints that a refinement accepts.

    Parameters
    ----------
    extrema, traces : DataFrame
        Of one or several views; ``keypoint`` is the row in `extrema`.
    max_offset, max_iterations : float
        M_offset and N_interp.

    Returns
    -------
    DataFrame
        The rows of `extrema` of the accepted ones, in the same order, with the refined ``y, x,
        sigma, value``.
    """
    good = accepted(traces, max_offset, max_iterations).sort_values("keypoint")
    table = extrema.iloc[good["keypoint"].to_numpy()].reset_index(drop=True)
    for name in ("y", "x", "sigma", "value"):
        table[name] = good[name].to_numpy()
    return table
