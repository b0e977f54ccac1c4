"""Zarr groups that are complete or refused.

The only module that knows Zarr. Zarr takes a chunk that is not there for one full of the fill
value, and hands over a damaged chunk as numbers; here every chunk carries a CRC-32C checksum, and
a group is opened only if every chunk file is there with its full length.
"""

from __future__ import annotations

import math
import os
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from keystab._version import __version__
from keystab.errors import InputError

if TYPE_CHECKING:
    import xarray as xr
    import zarr

__all__ = [
    "GROUP_NAME",
    "Kind",
    "attributes_of",
    "new_array",
    "new_group",
    "open_array",
    "open_dataset",
    "open_group",
    "require_complete",
    "write_column",
]

#: Name of the group in a store's folder.
GROUP_NAME = "data.zarr"

Kind = Literal["scale-space", "views"]

#: Arrays without which a group of a kind is not complete.
_NEEDED: dict[str, set[str]] = {
    "scale-space": {"dog", "sigma", "y", "x"},
    "views": {"image", "blur", "step", "shift_y", "shift_x", "rotation", "noise"}
    | {"height", "width"},
}

_CHECKSUM_BYTES = 4  # of CRC-32C, after every chunk
_INDEX_BYTES = 16  # per inner chunk: its offset and length in the shard


def new_group(folder: Path, kind: Kind, attributes: Mapping[str, Any]) -> zarr.Group:
    """Make a group in a new folder, with what kind of store it is and who wrote it."""
    import zarr

    values = {"kind": kind, **attributes, "keystab_version": __version__}
    return zarr.create_group(store=folder, zarr_format=3, attributes=values)


def new_array(
    group: zarr.Group,
    name: str,
    shape: tuple[int, ...],
    dtype: str,
    dimensions: tuple[str, ...],
    chunks: tuple[int, ...],
    shards: tuple[int, ...] | None = None,
    attributes: Mapping[str, Any] | None = None,
) -> zarr.Array[Any]:
    """Make an array of which every chunk will be written, with its checksum."""
    from zarr.codecs import Crc32cCodec

    return group.create_array(
        name,
        shape=shape,
        dtype=dtype,
        chunks=chunks,
        shards=shards,
        compressors=Crc32cCodec(),
        fill_value=0 if dtype.startswith("int") else math.nan,
        dimension_names=dimensions,
        attributes=dict(attributes or {}),
        config={"write_empty_chunks": True},  # a chunk of zeros is still a chunk
    )


def write_column(
    group: zarr.Group, name: str, values: NDArray[Any], dimension: str, meaning: str
) -> None:
    """Write a one-dimensional array along a dimension, in one chunk."""
    column = new_array(
        group, name, values.shape, values.dtype.name, (dimension,), values.shape,
        attributes={"long_name": meaning},
    )  # fmt: skip
    column[:] = values


def open_group(path: str | os.PathLike[str], kind: Kind | None) -> tuple[zarr.Group, Path]:
    """Open a complete group of the kind asked for."""
    import zarr

    folder = Path(path) if (Path(path) / "zarr.json").is_file() else Path(path) / GROUP_NAME
    if not (folder / "zarr.json").is_file():
        raise InputError(
            f"{path}: no store of keystab here (no {GROUP_NAME} in it); check the path"
        )
    try:
        group = zarr.open_group(folder, mode="r", zarr_format=3, use_consolidated=False)
        found = group.attrs.get("kind")
        require_complete(group, folder)
    except (ValueError, TypeError, KeyError, FileNotFoundError) as error:
        if isinstance(error, InputError):
            raise
        reason = " ".join(str(error).split())
        raise InputError(f"{path}: not a readable store ({reason[:120]}); make it again") from None
    if kind is not None and found != kind:
        raise InputError(f"{path}: a store of {found or 'something else'}, not of {kind}")
    return group, folder


def open_array(group: zarr.Group, name: str) -> zarr.Array[Any]:
    """Open an array of a group."""
    import zarr

    array = group[name]
    assert isinstance(array, zarr.Array)
    return array


def require_complete(group: zarr.Group, folder: Path) -> None:
    """Raise unless every chunk file is there with the length that it must have.

    Zarr takes a chunk that is not there for one full of the fill value. Chunks are not compressed,
    so that the length of each file is known.
    """
    names = {description.parent.name for description in folder.glob("*/zarr.json")}
    for name in sorted(names | _NEEDED.get(str(group.attrs.get("kind")), set())):
        if name not in names:
            raise InputError(f"{folder / name} is missing; delete the store and make it again")
        array = open_array(group, name)
        inner, outer = array.chunks, array.shards or array.chunks
        n_bytes = math.prod(inner) * array.dtype.itemsize + _CHECKSUM_BYTES
        if array.shards:
            n_inner = math.prod(o // i for o, i in zip(outer, inner, strict=True))
            n_bytes = n_inner * (n_bytes + _INDEX_BYTES) + _CHECKSUM_BYTES
        counts = [math.ceil(n / o) for n, o in zip(array.shape, outer, strict=True)]
        for index in np.ndindex(*counts):
            file = folder.joinpath(name, "c", *map(str, index))
            length = file.stat().st_size if file.is_file() else None
            if length != n_bytes:
                what = "is missing" if length is None else f"has {length} bytes, not {n_bytes}"
                raise InputError(f"{file} {what}; delete the store and make it again")


def open_dataset(path: str | os.PathLike[str], kind: Kind) -> xr.Dataset:
    """Open a complete group of a kind with xarray, without reading its values."""
    import xarray as xr

    _, folder = open_group(path, kind)
    dataset: xr.Dataset = xr.open_zarr(folder, chunks=None, consolidated=False, zarr_format=3)
    return dataset


__all__ = ["attributes_of"]


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
