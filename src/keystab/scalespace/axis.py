"""Oversampling and Gaussian blur of one image axis as one matrix.

Oversampling and blur are linear and separable, so that along one axis "interpolate on the fine
grid, then blur by a Gaussian" is a matrix L(blur) with one row per fine sample. A blurred fine
image is ``L_y C L_x^T`` with C the source of the interpolant. Only the rows of a tile are ever
built, and of these only the columns that matter.

Two interpolants of the input image are offered: `keystab.scalespace.spline_axis`, as in section 2.3
of the paper, and `keystab.scalespace.cosine_axis`.
"""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np


class AxisOperator(Protocol):
    """Rows of L(blur) for one axis and several blurs."""

    def block(self, start: int, stop: int) -> Block:
        """Rows `start` to `stop` for every blur."""


class Block(NamedTuple):
    """Rows of L for a range of fine samples, ``factor(blur)``.

    The factors of all blurs lie one behind the other in memory, so that compiled code can go
    through them.

    Attributes
    ----------
    rank : int
        Rows of every factor.
    first : ndarray of int, shape (n_blurs,)
        The first column of the source that counts for each blur.
    offset : ndarray of int, shape (n_blurs + 1,)
        Where the entries of each factor begin.
    entries : ndarray
        Entries of all factors, row by row.
    """

    rank: int
    first: np.ndarray
    offset: np.ndarray
    entries: np.ndarray

    @classmethod
    def of(cls, first: list[int], factors: list[np.ndarray]) -> Block:
        """Put factors of one height behind each other."""
        sizes = [factor.size for factor in factors]
        offset = np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64)
        entries = np.concatenate([factor.ravel() for factor in factors])
        return cls(len(factors[0]), np.array(first, dtype=np.int64), offset, entries)

    def factor(self, blur: int) -> np.ndarray:
        """Factor of one blur, shape (rank, n_columns)."""
        return self.entries[self.offset[blur] : self.offset[blur + 1]].reshape(self.rank, -1)
