"""Discrete extrema of a stored scale-space: the same as those of the lazy one."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from keystab.detection.extrema import decided, extrema_of_array
from keystab.errors import InputError
from keystab.scalespace.dog import ScaleSpace
from keystab.utils.progress import progress


class Stored(Protocol):
    """A scale-space that is read, as `keystab.io.scale_space_store.StoredScaleSpace`."""

    @property
    def shape(self) -> tuple[int, int, int]:
        """Number of slices, rows and columns."""

    @property
    def tile_height(self) -> int:
        """Rows that are best read at once."""

    def window(self, *, rows: slice) -> NDArray[np.float64]:
        """Values of some rows, shape (n_slices, n_rows, n_columns)."""

    def attributes(self) -> dict[str, Any]:
        """What the scale-space was made of."""


def stored_extrema(store: Stored, space: ScaleSpace, epsilon: float = 0.0) -> NDArray[np.int64]:
    """Find all discrete extrema of a stored scale-space, one row of tiles at a time.

    Parameters
    ----------
    store : Stored
        Where the values are read from.
    space : ScaleSpace
        The scale-space that was stored. It says what rounding can explain, and the store must be
        its own.
    epsilon : float
        See `keystab.detection.extrema.discrete_extrema`.

    Returns
    -------
    ndarray of int64, shape (n, 4)
        Slice s, row, column and sign, ordered by s, row, column.

    Raises
    ------
    InputError
        If the store holds another scale-space, or is damaged.
    """
    _require_same(store, space)
    tolerance = max(epsilon, space.rounding)
    n_rows = store.shape[1]
    found = [np.empty((0, 4), dtype=np.int64)]
    above = np.empty((store.shape[0], 0, store.shape[2]))  # last two rows of the tiles before
    starts = range(0, n_rows, store.tile_height)
    for top in progress(starts, len(starts), f"extrema of {n_rows} stored rows"):
        rows = store.window(rows=slice(top, min(top + store.tile_height, n_rows)))
        rows = np.concatenate([above, rows], axis=1)
        found.append(
            extrema_of_array(
                rows, tolerance - space.rounding_bounds.between, (top - above.shape[1], 0)
            )
        )
        above = rows[:, -2:].copy()
    return decided(space, np.concatenate(found), tolerance)[0]


def _require_same(store: Stored, space: ScaleSpace) -> None:
    stored = store.attributes()
    for name, wanted in space.attributes().items():
        wanted = list(wanted) if isinstance(wanted, tuple) else wanted
        if stored.get(name) != wanted:
            raise InputError(
                f"the stored scale-space has {name} = {stored.get(name)}, wanted is {wanted}: "
                "delete the store and make it again"
            )
