"""Samples of a decoded picture: what is white, which way is up, whether they fit into memory."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

from numpy.typing import NDArray

from keystab.errors import InputError
from keystab.utils import memory

__all__ = ["Samples", "check_channels", "check_memory", "upright", "upright_shape"]

# What the Orientation of EXIF and TIFF asks for; all other values ask for nothing.
_TRANSPOSED = (5, 6, 7, 8)
_ROWS_REVERSED = (3, 4, 7, 8)
_COLUMNS_REVERSED = (2, 3, 6, 7)


class Samples(NamedTuple):
    """Decoded samples of a picture.

    Attributes
    ----------
    values : ndarray, shape (height, width) or (height, width, channels)
        As stored, in upright orientation.
    white : float
        Sample that is white where 0 is black.
    """

    values: NDArray[Any]
    white: float


def upright(values: NDArray[Any], orientation: object) -> NDArray[Any]:
    """Turn and mirror a picture as its orientation asks for.

    Parameters
    ----------
    values : ndarray, shape (height, width) or (height, width, channels)
        Samples in the order in which they are stored.
    orientation : object
        Value of the tag Orientation (274) of EXIF or TIFF; 1, None and what is no orientation
        leave the picture as it is.

    Examples
    --------
    >>> import numpy as np
    >>> stored = np.array([[1, 2, 3], [4, 5, 6]])
    >>> upright(stored, 6)  # the first row is the right-hand side
    array([[4, 1],
           [5, 2],
           [6, 3]])
    """
    if orientation in _TRANSPOSED:
        values = values.swapaxes(0, 1)
    if orientation in _ROWS_REVERSED:
        values = values[::-1]
    if orientation in _COLUMNS_REVERSED:
        values = values[:, ::-1]
    return values


def upright_shape(height: int, width: int, orientation: object) -> tuple[int, int]:
    """Height and width of what `upright` gives.

    Examples
    --------
    >>> upright_shape(2, 3, 6), upright_shape(2, 3, None)
    ((3, 2), (2, 3))
    """
    return (width, height) if orientation in _TRANSPOSED else (height, width)


def check_memory(height: int, width: int, pixel_bytes: float, path: Path) -> None:
    """Raise unless a picture can be decoded and made grey in memory.

    Parameters
    ----------
    height, width : int
        Size of the picture.
    pixel_bytes : float
        Bytes of the samples of one pixel.
    path : Path
        File of the picture.
    """
    # While decoding, its bytes up to three times; then the samples and two float64 values each.
    estimate = height * width * max(3.0 * pixel_bytes, pixel_bytes + 17.0)
    memory.require(
        estimate + path.stat().st_size,
        f"{path}: a picture of {height} x {width} pixels",
        "crop it, or use a machine with more memory",
    )


def check_channels(shape: Sequence[int], path: Path) -> int:
    """Return the number of channels of an array that is a picture, or refuse it."""
    channels = shape[-1] if len(shape) == 3 else 1
    if len(shape) not in (2, 3) or channels > 4:
        raise InputError(
            f"{path}: shape {tuple(shape)} is no picture; expected (height, width) or "
            "(height, width, 1 to 4 channels)"
        )
    return channels
