"""Scale-spaces and sets of views on disk: write and open them (`keystab.io.checksums` seals them).

A store is a folder that holds a Zarr (format 3) group named ``data.zarr``, which any Zarr reader
opens. It appears whole or not at all, every chunk carries a checksum, so that a damaged one raises
instead of giving wrong numbers, and a store that lacks a chunk is refused when it is opened,
instead of reading as missing values.
"""

from __future__ import annotations

import math
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, Protocol

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

    from keystab.camera.views import ViewSpec

__all__ = [
    "Sampled",
    "StoredScaleSpace",
    "StoredViews",
    "attributes_of",
    "open_scale_space",
    "open_views",
    "view",
    "write_scale_space",
    "write_views",
]

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


def write_views(
    images: Iterable[NDArray[np.floating[Any]]],
    specs: Sequence[ViewSpec],
    path: str | os.PathLike[str],
    attributes: Mapping[str, Any] | None = None,
    dtype: Literal["float32", "float64"] = "float32",
) -> None:
    """Write a set of views to a store, one view at a time.

    Parameters
    ----------
    images : iterable of ndarray
        The views, in the order of `specs` and of their shapes. They may be a generator.
    specs : sequence of ViewSpec
        How each view was taken.
    path : path
        Folder of the store; an older store in it is replaced.
    attributes : mapping, optional
        What else to keep, such as the digest of the reference's pixels.
    dtype : {"float32", "float64"}
        Type in which the pixels are stored; the paper's images have 32 bits.

    Raises
    ------
    InputError
        If there is no view, `dtype` is another one, or an image has not the shape of its
        specification.

    Notes
    -----
    The array ``image`` has the dimensions (view, y, x). Views of different shapes share it:
    smaller ones are filled up with NaN at the bottom and right, and ``height`` and ``width`` say
    how much of each counts. `view` cuts it out.
    """
    if not specs:
        raise InputError("a set of views is empty; give at least one view")
    if dtype not in ("float32", "float64"):
        raise InputError(f"views are stored as float32 or float64, not as {dtype}")
    height, width = (max(spec.shape[axis] for spec in specs) for axis in (0, 1))
    columns = {
        "blur": ([spec.blur for spec in specs], "camera blur in view pixels"),
        "step": ([spec.step for spec in specs], "reference pixels per view pixel"),
        "shift_y": ([spec.shift[0] for spec in specs], "shift down in view pixels"),
        "shift_x": ([spec.shift[1] for spec in specs], "shift right in view pixels"),
        "rotation": ([spec.rotation for spec in specs], "rotation in radians"),
        "noise": ([spec.noise for spec in specs], "standard deviation of the noise"),
        "height": ([spec.shape[0] for spec in specs], "height of the view in pixels"),
        "width": ([spec.shape[1] for spec in specs], "width of the view in pixels"),
    }
    with written_whole(Path(path) / GROUP_NAME) as part:
        group = new_group(part, "views", attributes or {})
        for name, (values, meaning) in columns.items():
            number = np.int64 if name in ("height", "width") else np.float64
            write_column(group, name, np.asarray(values, dtype=number), "view", meaning)
        stack = new_array(
            group, "image", (len(specs), height, width), dtype, ("view", "y", "x"),
            chunks=(1, height, width),
            attributes={"long_name": "grey value", "coordinates": " ".join(columns)},
        )  # fmt: skip
        paired = zip(images, specs, strict=True)
        for k, (image, spec) in enumerate(progress(paired, len(specs), f"writing {path}")):
            if image.shape != tuple(spec.shape):
                raise InputError(f"view {k} has the shape {image.shape}, not {spec.shape}")
            padded = np.full((height, width), np.nan, dtype=dtype)
            padded[: image.shape[0], : image.shape[1]] = image
            stack[k] = padded
        require_complete(group, part)


def open_views(path: str | os.PathLike[str]) -> xr.Dataset:
    """Open a stored set of views; pixels are read when they are asked for.

    Parameters
    ----------
    path : path
        Folder that `write_views` wrote.

    Returns
    -------
    xarray.Dataset
        Variable ``image`` with dimensions (view, y, x), and for each view the coordinates
        ``blur``, ``step``, ``shift_y``, ``shift_x``, ``rotation``, ``noise``, ``height`` and
        ``width``; see `keystab.camera.simulation.ViewSpec`.

    Raises
    ------
    InputError
        If there is no such store, or views are missing from it.
    """
    return open_dataset(path, "views")


def view(views: xr.Dataset, k: int) -> NDArray[np.float64]:
    """Read one view of a set as float64, without the filling of smaller views.

    Parameters
    ----------
    views : xarray.Dataset
        From `open_views`.
    k : int
        Number of the view, from 0.

    Returns
    -------
    ndarray of float64, shape (height, width)

    Raises
    ------
    InputError
        If there is no such view, or its chunk is damaged.
    """
    if not 0 <= k < views.sizes["view"]:
        raise InputError(f"there is no view {k}; the set has views 0 to {views.sizes['view'] - 1}")
    one = views["image"][k, : int(views["height"][k]), : int(views["width"][k])]
    with _damage_named(k):
        return one.to_numpy().astype(np.float64)


class StoredViews:
    """A stored set of views as arrays, for jobs that cannot wait for the import of xarray.

    Parameters
    ----------
    path : path
        Folder that `write_views` wrote.

    Attributes
    ----------
    attributes : dict
        Of the store.
    columns : dict of ndarray, shape (n_views,)
        Coordinates of the views; see `open_views`.

    Raises
    ------
    InputError
        If there is no such store, or views are missing from it.
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        group, _ = open_group(path, "views")
        self.attributes: dict[str, Any] = dict(group.attrs)
        self._image = open_array(group, "image")
        names = self._image.attrs["coordinates"]
        self.columns = {name: np.asarray(open_array(group, name)[:]) for name in str(names).split()}

    def __getitem__(self, k: int) -> NDArray[np.float64]:
        """Return what `view` returns."""
        height, width = (int(self.columns[name][k]) for name in ("height", "width"))
        with _damage_named(k):
            return np.asarray(self._image[k, :height, :width], dtype=np.float64)


@contextmanager
def _damage_named(k: int) -> Iterator[None]:
    try:
        yield
    except ValueError as error:
        raise InputError(
            f"view {k} is damaged ({error}); delete the store, make it again"
        ) from None


def attributes_of(path: str | os.PathLike[str]) -> dict[str, Any]:
    """Read the attributes of a store of either kind; ``kind`` says which.

    Parameters
    ----------
    path : path
        Folder that `write_scale_space` or `write_views` wrote.

    Raises
    ------
    InputError
        If there is no such store, or chunks are missing from it.
    """
    return dict(open_group(path, None)[0].attrs)
