"""Scale-spaces on disk: write and open them (`keystab.io.checksums` guards them).

A store is a folder that holds a Zarr (format 3) group named ``data.zarr``, which any Zarr reader
opens. It appears whole or not at all, every chunk carries a checksum, so that a damaged one raises
instead of giving wrong numbers, and a store that lacks a chunk is refused when it is opened,
instead of reading as missing values.
"""

from __future__ import annotations

import math
import os
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from keystab.errors import InputError
from keystab.io.zarr_groups import (
    GROUP_NAME,
    new_array,
    new_group,
    open_array,
    open_dataset,
    open_group,
    require_complete,
    write_column,
)
from keystab.utils.files import written_whole
from keystab.utils.progress import progress

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["Sampled", "StoredScaleSpace", "open_scale_space", "write_scale_space"]

#: Rows and columns of an inner chunk of a stored scale-space.
TILE = 128


class Sampled(Protocol):
    """What a scale-space must offer to be stored, as `keystab.scalespace.dog.ScaleSpace` does."""

    @property
    def shape(self) -> tuple[int, int, int]:
        """Number of slices, rows and columns."""

    @property
    def sigma(self) -> NDArray[np.float64]:
        """Scale of every slice in input pixels."""

    @property
    def y(self) -> NDArray[np.float64]:
        """Position of every row in input pixels."""

    @property
    def x(self) -> NDArray[np.float64]:
        """Position of every column in input pixels."""

    def window(self, slices: slice, rows: slice, columns: slice, /) -> NDArray[np.float64]:
        """Values of a box of samples, float64."""

    def attributes(self) -> dict[str, object]:
        """Everything needed to build the scale-space again from its image."""


def write_scale_space(
    space: Sampled,
    path: str | os.PathLike[str],
    attributes: Mapping[str, Any] | None = None,
    tile: int = TILE,
) -> None:
    """Write a scale-space to a store, one row of tiles at a time.

    Parameters
    ----------
    space : ScaleSpace
        Evaluated row of tiles by row of tiles; it is never held as a whole.
    path : path
        Folder of the store; an older store in it is replaced.
    attributes : mapping, optional
        What else to keep beside `space.attributes()`, such as the digest of the input's pixels.
        Numbers, text, and lists or mappings of them.
    tile : int
        Rows and columns of an inner chunk. A chunk holds all slices of a tile, a file all chunks
        of a row of tiles.

    Notes
    -----
    The array ``dog`` has the dimensions (scale, y, x), float64, not compressed: scale-spaces
    hardly shrink. ``sigma``, ``y`` and ``x`` are in input pixels.
    """
    from keystab.utils import memory

    n_slices, height, width = space.shape
    tile = min(tile, max(height, width))
    across = math.ceil(width / tile) * tile
    memory.require(
        3.0 * 8 * n_slices * tile * across,  # the values, the encoded shard, and joining it
        f"writing rows of tiles of {n_slices} x {tile} x {width} samples",
        "store a smaller image or fewer scales",
    )
    with written_whole(Path(path) / GROUP_NAME) as part:
        group = new_group(part, "scale-space", {**space.attributes(), **(attributes or {})})
        for name, dimension in (("sigma", "scale"), ("y", "y"), ("x", "x")):
            values = getattr(space, name)
            write_column(group, name, values, dimension, f"{name} in pixels of the input image")
        dog = new_array(
            group, "dog", space.shape, "float64", ("scale", "y", "x"),
            chunks=(n_slices, tile, tile),
            shards=(n_slices, tile, across),
            attributes={
                "long_name": "difference of Gaussians",
                "coordinates": "sigma",  # tells xarray that sigma describes the scale dimension
            },
        )  # fmt: skip
        starts = range(0, height, tile)
        for top in progress(starts, len(starts), f"writing {path}"):
            rows = slice(top, min(top + tile, height))
            dog[:, rows, :] = space.window(slice(0, n_slices), rows, slice(0, width))
        require_complete(group, part)


def open_scale_space(path: str | os.PathLike[str]) -> xr.Dataset:
    """Open a stored scale-space; values are read when they are asked for.

    Parameters
    ----------
    path : path
        Folder that `write_scale_space` wrote.

    Returns
    -------
    xarray.Dataset
        Variable ``dog`` with dimensions (scale, y, x) and coordinates ``sigma``, ``y`` and ``x``
        in input pixels; the attributes hold every parameter. Reading a damaged chunk raises
        ValueError.

    Raises
    ------
    InputError
        If there is no such store, or chunks are missing from it.
    """
    return open_dataset(path, "scale-space")


class StoredScaleSpace:
    """A stored scale-space with the interface of `keystab.scalespace.dog.ScaleSpace`.

    Reads windows straight from the store, without xarray.

    Parameters
    ----------
    path : path
        Folder that `write_scale_space` wrote.

    Raises
    ------
    InputError
        If there is no such store, or chunks are missing from it.
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self._group, self._folder = open_group(path, "scale-space")
        self._dog = open_array(self._group, "dog")
        self.sigma, self.y, self.x = (
            np.asarray(open_array(self._group, name)[:]) for name in ("sigma", "y", "x")
        )

    @property
    def shape(self) -> tuple[int, int, int]:
        """Number of slices, rows and columns."""
        n_slices, height, width = self._dog.shape
        return n_slices, height, width

    @property
    def tile_height(self) -> int:
        """Rows of samples in a row of tiles."""
        assert self._dog.shards is not None
        return int(self._dog.shards[1])

    def window(
        self,
        slices: slice = slice(None),
        rows: slice = slice(None),
        columns: slice = slice(None),
    ) -> NDArray[np.float64]:
        """Read a box of samples.

        Parameters
        ----------
        slices, rows, columns : slice
            Ranges of indices with step 1; the whole axis by default.

        Returns
        -------
        ndarray of float64, shape (n_slices, n_rows, n_columns)

        Raises
        ------
        InputError
            If a chunk is damaged, or gone since the store was opened.
        """
        try:
            values = np.asarray(self._dog[slices, rows, columns])
        except ValueError as error:
            raise self._damaged(rows, str(error)) from None
        # Zarr reads what is gone as NaN, in which a search would find no extrema.
        if np.isnan(values).any():
            raise self._damaged(rows, "parts of it are gone")
        return values

    def _damaged(self, rows: slice, reason: str) -> InputError:
        assert self._dog.shards is not None
        start, stop, _ = rows.indices(self.shape[1])
        first, last = start // self._dog.shards[1], (stop - 1) // self._dog.shards[1]
        return InputError(
            f"{self._folder}: damaged data in the rows of tiles {first} to {last} ({reason}); "
            "delete the store and make it again"
        )

    def attributes(self) -> dict[str, object]:
        """Everything that was stored beside the values."""
        return dict(self._group.attrs)
