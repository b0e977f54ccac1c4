"""Pictures from files, as grey float64 arrays, and back."""

from __future__ import annotations

import hashlib
import math
import os
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from keystab.errors import InputError
from keystab.io import netpbm_pictures, pillow_pictures, tiff_pictures
from keystab.io.picture_samples import Samples, check_channels, check_memory
from keystab.utils.files import check_writable, written_whole
from keystab.utils.masks import unmasked

__all__ = [
    "FORMATS",
    "picture_shape",
    "pixel_digest",
    "read_picture",
    "read_with_digest",
    "write_picture",
]

#: Suffixes of the files that pictures are written to.
FORMATS = (".png", ".tif", ".tiff", ".npy")

#: Weights of red, green and blue in the grey value (ITU-R BT.601 luma).
LUMA = (0.299, 0.587, 0.114)

_READABLE = "PNG, JPEG, TIFF or .npy"
_NPY_SIGNATURE = b"\x93NUMPY"


def read_picture(path: str | os.PathLike[str]) -> NDArray[np.float64]:
    """Read a picture as grey values.

    Unsigned integers of any depth are divided by the largest value of that depth, so that black is
    0 and white is 1, also where the file stores white as 0. Floating-point pictures are kept as
    they are, whatever their range. Colour becomes 0.299 R + 0.587 G + 0.114 B of the stored values;
    no gamma is undone. Transparency (an alpha channel) is ignored: the stored colour counts. The
    picture is turned upright as its EXIF or TIFF orientation asks, whatever the format.

    Parameters
    ----------
    path : path
        A PNG, JPEG, TIFF, PNM (PBM, PGM, PPM, PAM, PFM), GIF, WebP, BMP or NumPy (.npy) file. The
        content decides, whatever the suffix. Arrays in .npy files have the shape (height, width)
        or (height, width, channels). Previews, masks and depth maps beside the picture (reduced
        and mask pages of a TIFF, JPEG with MPO) do not count.

    Returns
    -------
    ndarray of float64, shape (height, width)
        Grey values u[y, x], in [0, 1] for integer pictures.

    Raises
    ------
    InputError
        If the file is missing or unreadable, holds several pictures (pages or frames of an
        animation), needs more memory than there is, or holds signed integers, NaN or infinities.
        Also where depth, sign or scale could get lost with the decoders at hand: a PNG in colour or
        with alpha of 16 bits per channel; a TIFF of floats in which 0 is white, in inks of more
        than 8 bits, in Lab, of raw sensor data, or compressed by other than LZW, deflate,
        PackBits, LZMA, Zstandard, fax or 8-bit JPEG; a BMP of 16 bits per pixel; a PFM with a scale
        other than 1; and every format that is not named above, such as JPEG 2000 and AVIF.

    Notes
    -----
    Only these are not exact: JPEG as such; inks of 8 bits (CMYK), which become colours by the plain
    formula, rounded to 8 bits.

    Examples
    --------
    >>> import tempfile
    >>> path = Path(tempfile.mkdtemp()) / "ramp.png"
    >>> write_picture(np.linspace(0, 1, 6).reshape(2, 3), path)
    >>> read_picture(path)
    array([[0. , 0.2, 0.4],
           [0.6, 0.8, 1. ]])
    """
    path = Path(path)
    return _finite_grey(_decode(path), path)


def read_with_digest(path: str | os.PathLike[str]) -> tuple[NDArray[np.float64], str]:
    """Read a picture as `read_picture` does, and its `pixel_digest`, from one decoding."""
    path = Path(path)
    samples = _decode(path)
    return _finite_grey(samples, path), _digest(samples)


def picture_shape(path: str | os.PathLike[str]) -> tuple[int, int]:
    """Height and width of a picture, from the head of its file.

    Parameters
    ----------
    path : path
        A picture that `read_picture` accepts.

    Returns
    -------
    (int, int)
        Height and width in pixels, as `read_picture` gives them. The pixels themselves are not
        looked at, but for those of a PNG that holds metadata behind them.

    Raises
    ------
    InputError
        If the file is missing, no picture or several of them; see `read_picture`.
    """
    path = Path(path)
    head = _head(path)
    with _one_line(path):
        if head.startswith(_NPY_SIGNATURE):
            shape, _ = _npy_head(path)
            check_channels(shape, path)
            return shape[0], shape[1]
        if head.startswith(tiff_pictures.SIGNATURES):
            return tiff_pictures.shape(path)
        if netpbm_pictures.is_netpbm(head):
            return netpbm_pictures.shape(path)
        return pillow_pictures.shape(path)


def pixel_digest(path: str | os.PathLike[str]) -> str:
    """SHA-256 of the decoded pixels of a picture, row by row.

    The digest identifies what is seen, whatever the compression or metadata of the file. The bytes
    are those of the decoded samples (upright, before any conversion to grey), little-endian,
    row-major, channels last. Shape and depth are not part of them.

    Parameters
    ----------
    path : path
        A picture that `read_picture` accepts.

    Returns
    -------
    str
        64 hexadecimal digits.

    Raises
    ------
    InputError
        If the file cannot be decoded; see `read_picture`.
    """
    return _digest(_decode(Path(path)))


def _digest(samples: Samples) -> str:
    values = samples.values
    little = np.ascontiguousarray(values.astype(values.dtype.newbyteorder("<"), copy=False))
    return hashlib.sha256(little.data).hexdigest()


def write_picture(u: NDArray[np.floating[Any]], path: str | os.PathLike[str]) -> None:
    """Write grey values to a file; the suffix chooses the format.

    Parameters
    ----------
    u : ndarray, shape (height, width)
        Grey values; [0, 1] is black to white.
    path : path
        ``.png``: 16 bits, values clipped to [0, 1] and rounded to multiples of 1/65535.
        ``.tif`` or ``.tiff``: float32, rounded only to single precision.
        ``.npy``: float64, exact.

    Raises
    ------
    InputError
        If the suffix is none of these, no file can be written there (see
        `keystab.utils.files.check_writable`), or `u` is no grey picture of finite values, or is
        masked in part.
    """
    path = Path(path)
    check_writable(path, FORMATS)
    suffix = path.suffix.lower()
    u = np.asarray(unmasked(f"{path}: the picture", u))
    if u.dtype.kind not in "biuf":
        raise InputError(f"{path}: values of type {u.dtype} are no grey values; give real numbers")
    if u.ndim != 2 or u.size == 0:
        raise InputError(f"{path}: shape {u.shape} is no grey picture; give (height, width)")
    u = u.astype(np.float64)
    _require_finite(u, path)
    with written_whole(path) as part:
        if suffix == ".npy":
            np.save(part, u, allow_pickle=False)
        elif suffix == ".png":
            import imageio.v3 as iio

            levels = np.round(np.clip(u, 0.0, 1.0) * 65535.0).astype(np.uint16)
            iio.imwrite(part, levels, plugin="pillow", extension=".png")
        else:
            import tifffile

            tifffile.imwrite(part, u.astype(np.float32), photometric="minisblack")


def _require_finite(u: NDArray[np.floating[Any]], path: Path) -> None:
    bad = np.count_nonzero(~np.isfinite(u))
    if bad:
        raise InputError(
            f"{path}: {bad} of {u.size} pixels {'is' if bad == 1 else 'are'} NaN or infinite; "
            "replace them by finite values"
        )


def _decode(path: Path) -> Samples:
    """Decode the samples as stored, upright."""
    head = _head(path)
    with _one_line(path):
        if head.startswith(_NPY_SIGNATURE):
            samples = _decode_npy(path)
        elif head.startswith(tiff_pictures.SIGNATURES):
            samples = tiff_pictures.decode(path)
        elif netpbm_pictures.is_netpbm(head):
            samples = netpbm_pictures.decode(path)
        else:
            samples = pillow_pictures.decode(path)
    if samples.values.size == 0:
        raise InputError(f"{path}: the picture has no pixels (shape {samples.values.shape})")
    return samples


def _decode_npy(path: Path) -> Samples:
    shape, dtype = _npy_head(path)
    check_channels(shape, path)
    if dtype.kind not in "buf":
        raise InputError(
            f"{path}: samples of type {dtype} have no agreed white; use unsigned integers or floats"
        )
    check_memory(shape[0], shape[1], math.prod(shape[2:]) * dtype.itemsize, path)
    values = np.load(path, allow_pickle=False)
    return Samples(values, float(np.iinfo(dtype).max) if dtype.kind == "u" else 1.0)


def _npy_head(path: Path) -> tuple[tuple[int, ...], np.dtype[Any]]:
    array = np.load(path, mmap_mode="r", allow_pickle=False)
    return array.shape, array.dtype


def _head(path: Path) -> bytes:
    """First bytes of a file, which tell its format."""
    try:
        with path.open("rb") as file:
            return file.read(26)
    except FileNotFoundError:
        raise InputError(f"{path}: no such file; give the path of a {_READABLE} picture") from None
    except IsADirectoryError:
        raise InputError(f"{path}: is a folder; give the path of a {_READABLE} picture") from None
    except OSError as error:
        raise InputError(f"{path}: cannot be opened ({error.strerror})") from None


@contextmanager
def _one_line(path: Path) -> Iterator[None]:
    """Turn whatever a decoder raises into an `InputError`."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # what matters of a picture is raised
            yield
    except (InputError, MemoryError):
        raise
    except Exception as error:  # decoders raise whatever they like
        reason = " ".join(str(error).split()) or type(error).__name__
        raise InputError(f"{path}: not a readable picture ({_READABLE}): {reason[:120]}") from None


def _finite_grey(samples: Samples, path: Path) -> NDArray[np.float64]:
    grey = _grey(samples, path)
    _require_finite(grey, path)
    return grey


def _grey(samples: Samples, path: Path) -> NDArray[np.float64]:
    """Grey float64 values of decoded samples."""
    values = samples.values
    if values.ndim == 3 and check_channels(values.shape, path) < 3:  # grey, or grey and alpha
        values = values[..., 0]
    with np.errstate(all="ignore"):  # values that are not finite are refused soon
        if values.ndim == 2:
            grey = values.astype(np.float64, order="C")
        else:
            grey = LUMA[0] * values[..., 0].astype(np.float64, order="C")
            for channel in (1, 2):
                grey += LUMA[channel] * values[..., channel].astype(np.float64, order="C")
        grey /= samples.white
    return grey
