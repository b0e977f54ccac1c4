"""Polynomials through the nodes of a search, and what they leave of the samples between.

Nodes are every p-th fine sample; a *functional* is a finite sum of samples around a cell, such as a
sample less what a polynomial through the nodes says it is. All functionals here vanish for cubic
polynomials.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from keystab.detection.search_records import STENCIL

Array = NDArray[np.float64]

# Nodes that the polynomial of Hermite uses, and how many of them come before a cell.
_HERMITE, _BEFORE = 6, 2


class Functionals(NamedTuple):
    """Functionals of cells of p samples; of two that are mirror images, one.

    Attributes
    ----------
    begin : int
        First sample that has a weight, from the first sample of the cell on.
    value, step : ndarray, shape (n, n_samples)
        A sample less that of the polynomial of Hermite; a difference of adjacent samples less that
        of the polynomial.
    wide, wide_step : ndarray, shape (n, n_samples)
        The same with the polynomial through eight nodes.
    nodes : tuple of ndarray
        Absolute weights in the same order: of six nodes for a sample, of differences of adjacent
        nodes for a difference of samples; of eight nodes, of differences of eight nodes.
    """

    begin: int
    value: Array
    step: Array
    wide: Array
    wide_step: Array
    nodes: tuple[Array, Array, Array, Array]


def expansion(p: int) -> Array:
    """Polynomial through eight nodes at the samples -1 .. p + 1 of a cell, shape (p + 3, 8).

    Examples
    --------
    >>> nodes = 4 * np.arange(-3, 5)
    >>> bool(np.abs(expansion(4) @ nodes**7.0 - np.arange(-1.0, 6) ** 7).max() < 1e-6)
    True
    """
    nodes, place = p * np.arange(1 - STENCIL // 2, STENCIL // 2 + 1), np.arange(-1, p + 2)
    weights = np.ones((p + 3, STENCIL))
    for k, node in enumerate(nodes):
        others = np.delete(nodes, k)
        weights[:, k] = np.prod((place[:, None] - others) / (node - others), axis=1)
    return weights


def hermite(p: int) -> Array:
    """Polynomial of Hermite at the samples 0 .. p of a cell from six nodes, shape (p + 1, 6)."""
    t = np.arange(p + 1)[:, None] / p
    slope = np.zeros((2, _HERMITE))
    slope[0, :5] = slope[1, 1:] = np.array([1, -8, 0, 8, -1]) / 12
    at = np.eye(_HERMITE)[_BEFORE : _BEFORE + 2]
    weights = (1 + 2 * t) * (1 - t) ** 2 * at[0] + t**2 * (3 - 2 * t) * at[1]
    return weights + t * (1 - t) ** 2 * slope[0] + t**2 * (t - 1) * slope[1]


def functionals(p: int) -> Functionals:
    """All functionals that the bounds need."""
    begin = p * (1 - STENCIL // 2)
    size = p * (STENCIL - 1) + 1
    narrow, wide = hermite(p), expansion(p)
    value = np.zeros((p + 1, size))
    value[:, p * (STENCIL // 2 - 1 - _BEFORE) :: p][:, :_HERMITE] = -narrow
    value[np.arange(p + 1), np.arange(p + 1) - begin] += 1
    far = np.zeros((p + 3, size))
    far[:, ::p] = -wide
    far[np.arange(p + 3), np.arange(-1, p + 2) - begin] += 1
    # Weights of differences of adjacent nodes: a difference of samples does not see the mean.
    steps, wide_steps = (
        np.abs(np.cumsum(np.diff(weights, axis=0), axis=1)[:, :-1]) for weights in (narrow, wide)
    )
    return Functionals(
        begin,
        value[1 : p // 2 + 1],
        np.diff(value, axis=0)[: (p + 1) // 2],
        far[[0, *range(2, p // 2 + 2)]],
        np.diff(far, axis=0)[: (p + 3) // 2],
        (np.abs(narrow), steps, np.abs(wide), wide_steps),
    )
