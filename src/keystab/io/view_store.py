"""Sets of views on disk: write and open them.

A store is a folder that holds a Zarr (format 3) group; `keystab.io.scale_space_store` says what
can be relied on.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from keystab.camera.views import ViewSpec, effective_blur
from keystab.errors import InputError
from keystab.io.checksums import verify
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

__all__ = [
    "StoredViews",
    "View",
    "Views",
    "open_views",
    "read_view",
    "read_views",
    "view",
    "write_views",
]


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
    how much of each counts. `view` cuts it out. Where planes are seen from the side, the attribute
    ``homographies`` holds one 3 x 3 matrix, or null, for each view.
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
    attributes = dict(attributes or {})
    if any(spec.homography for spec in specs):  # nothing more is written of other views
        attributes["homographies"] = [spec.homography for spec in specs]
    with written_whole(Path(path) / GROUP_NAME) as part:
        group = new_group(part, "views", attributes)
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
        ``width``; see `keystab.camera.views.ViewSpec`.

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


class View(NamedTuple):
    """One simulated view and the blur that it has."""

    image: NDArray[np.float64]
    blur: float

    @property
    def shape(self) -> tuple[int, int]:
        """Height and width in pixels."""
        height, width = self.image.shape
        return height, width


def read_view(store: Path, digest: Path) -> View:
    """Read the first view of a stored set, after checking the store against its checksums."""
    return read_views(store, digest)[0]


class Views:
    """The views of a stored set, each read when it is asked for.

    Parameters
    ----------
    store : path
        Store of the views, already checked.
    """

    def __init__(self, store: Path) -> None:
        self._views = StoredViews(store)

    def __len__(self) -> int:
        return len(self._views.columns["blur"])

    def __iter__(self) -> Iterator[View]:
        return (self[number] for number in range(len(self)))

    def __getitem__(self, number: int) -> View:
        blur, step = (float(self._views.columns[name][number]) for name in ("blur", "step"))
        own = effective_blur(blur, step, self._views.attributes["reference_blur"])
        return View(self._views[number], own)

    @property
    def reference_shape(self) -> tuple[int, int]:
        """Height and width of the reference in pixels."""
        height, width = self._views.attributes["reference_shape"]
        return height, width

    @property
    def specs(self) -> list[ViewSpec]:
        """How each view was taken."""
        numbers = {name: values.tolist() for name, values in self._views.columns.items()}
        sides = self._views.attributes.get("homographies", [None] * len(self))
        return [
            ViewSpec(
                numbers["blur"][k],
                numbers["step"][k],
                (numbers["height"][k], numbers["width"][k]),
                (numbers["shift_y"][k], numbers["shift_x"][k]),
                numbers["rotation"][k],
                numbers["noise"][k],
                (str(self._views.attributes["set"]), k),
                sides[k],
            )
            for k in range(len(self))
        ]


def read_views(store: Path, digest: Path) -> Views:
    """Open all views of a stored set, after checking the store against its checksums."""
    verify(store, digest)
    return Views(store)
