"""Pictures from files, as grey float64 arrays, and back."""

from __future__ import annotations

import hashlib
import os
import warnings
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from keystab.errors import InputError
from keystab.files import written_whole

__all__ = ["check_writable", "pixel_digest", "read_picture", "write_picture"]

#: Weights of red, green and blue in the grey value (ITU-R BT.601 luma).
LUMA = (0.299, 0.587, 0.114)

_READABLE = "PNG, TIFF, JPEG or .npy"
_PNG_SIGNATURE = b"\x89PNG\r\n\x1a\n"
_PNG_COLOUR_TYPES = (b"\2", b"\4", b"\6")  # RGB, grey with alpha, RGB with alpha
_TIFF_SIGNATURES = (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")


def read_picture(path: str | os.PathLike[str]) -> NDArray[np.float64]:
    """Read a picture as grey values.

    Unsigned integers of any depth are divided by their largest value, so that black is 0 and
    white is 1. Floating-point pictures are kept as they are, whatever their range. Colour becomes
    0.299 R + 0.587 G + 0.114 B of the stored values; no gamma is undone. Transparency (an alpha
    channel) is ignored: the stored colour counts. EXIF orientation is ignored too.

    Parameters
    ----------
    path : path
        A PNG, TIFF, JPEG or NumPy (.npy) file; other formats that Pillow knows are tried. Arrays
        in .npy files have the shape (height, width) or (height, width, channels).

    Returns
    -------
    ndarray of float64, shape (height, width)
        Grey values u[y, x], in [0, 1] for integer pictures.

    Raises
    ------
    InputError
        If the file is missing or unreadable, holds several pictures, holds signed integers, NaN
        or infinities, or is a PNG in colour with 16 bits per channel, which the decoder at hand
        would cut down to 8 bits.

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
    grey = _grey(_decode(path), path)
    if not np.isfinite(grey).all():
        raise InputError(
            f"{path}: {np.count_nonzero(~np.isfinite(grey))} of {grey.size} pixels are NaN or "
            "infinite; replace them by finite values"
        )
    return grey


def pixel_digest(path: str | os.PathLike[str]) -> str:
    """SHA-256 of the decoded pixels of a picture, row by row.

    The digest identifies what is seen, whatever the compression or metadata of the file. The bytes
    are those of the decoded samples (before any conversion to grey), little-endian, row-major,
    channels last. Shape and depth are not part of them.

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
    pixels = _decode(Path(path))
    little = np.ascontiguousarray(pixels.astype(pixels.dtype.newbyteorder("<"), copy=False))
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
        If the suffix is none of these.
    """
    path = Path(path)
    check_writable(path)
    suffix = path.suffix.lower()
    u = np.asarray(u, dtype=np.float64)
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


def check_writable(path: str | os.PathLike[str]) -> None:
    """Raise unless `write_picture` knows the format that a suffix asks for.

    Parameters
    ----------
    path : path
        File to be written later; asked before anything expensive is done.

    Raises
    ------
    InputError
        If the suffix is none of .png, .tif, .tiff and .npy.
    """
    suffix = Path(path).suffix
    if suffix.lower() not in {".png", ".tif", ".tiff", ".npy"}:
        raise InputError(f"{path}: cannot write '{suffix}'; use .png, .tif, .tiff or .npy")


def _decode(path: Path) -> NDArray[Any]:
    """Decode the samples as stored: (height, width) or (height, width, channels)."""
    try:
        with path.open("rb") as file:
            head = file.read(26)
    except FileNotFoundError:
        raise InputError(f"{path}: no such file; give the path of a {_READABLE} picture") from None
    except OSError as error:
        raise InputError(f"{path}: cannot be opened ({error.strerror})") from None
    depth, colour_type = head[24:25], head[25:26]
    if head.startswith(_PNG_SIGNATURE) and depth == b"\x10" and colour_type in _PNG_COLOUR_TYPES:
        raise InputError(
            f"{path}: a PNG with colour or alpha and 16 bits per channel would lose its lower 8 "
            "bits; save it as 16-bit grey PNG or 16-bit TIFF"
        )
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # a large picture is no reason to warn a user
            if head.startswith(b"\x93NUMPY"):
                pixels = np.load(path, allow_pickle=False)
            elif head.startswith(_TIFF_SIGNATURES):
                pixels = _decode_tiff(path)
            else:
                pixels = _decode_by_pillow(path)
    except InputError:
        raise
    except Exception as error:  # decoders raise whatever they like
        reason = " ".join(str(error).split()) or type(error).__name__
        raise InputError(f"{path}: not a readable picture ({_READABLE}): {reason[:120]}") from None
    if pixels.size == 0:
        raise InputError(f"{path}: the picture has no pixels (shape {pixels.shape})")
    return pixels


def _decode_tiff(path: Path) -> NDArray[Any]:
    import tifffile

    with tifffile.TiffFile(path) as tiff:
        n_pictures = len(tiff.pages)
        if n_pictures > 1 and len(tiff.series[0].pages) != 1:
            raise InputError(f"{path}: the TIFF holds {n_pictures} pictures; keep one")
        page = tiff.pages.first
        photometric = getattr(page.photometric, "name", "")
        if photometric in {"MINISBLACK", "MINISWHITE", "RGB"}:
            try:
                pixels = page.asarray()
            except ValueError:  # a compression that needs a package we do not ask for
                return _decode_by_pillow(path)
            if page.axes == "SYX":  # one plane per channel
                pixels = np.moveaxis(pixels, 0, -1)
            if photometric == "MINISWHITE":
                pixels = np.iinfo(pixels.dtype).max - pixels
            return pixels
    return _decode_by_pillow(path)


def _decode_by_pillow(path: Path) -> NDArray[Any]:
    import imageio.v3 as iio

    mode = iio.immeta(path, plugin="pillow", index=0).get("mode")
    # Pillow would hand over ink densities (CMYK) or Lab as if they were colours.
    convert = {"mode": "RGB"} if mode in {"CMYK", "YCbCr", "LAB", "HSV"} else {}
    return np.asarray(iio.imread(path, plugin="pillow", index=0, **convert))


def _grey(pixels: NDArray[Any], path: Path) -> NDArray[np.float64]:
    """Grey float64 values of decoded samples."""
    kind = pixels.dtype.kind
    if kind == "b":
        white = 1.0
    elif kind == "u":
        white = float(np.iinfo(pixels.dtype).max)
    elif kind == "f":
        white = 1.0
    else:
        raise InputError(
            f"{path}: samples of type {pixels.dtype} have no agreed white; "
            "use unsigned integers or floats"
        )
    channels = 1 if pixels.ndim == 2 else pixels.shape[-1]
    if pixels.ndim not in (2, 3) or channels > 4:
        raise InputError(
            f"{path}: shape {pixels.shape} is no picture; expected (height, width) or "
            "(height, width, 1 to 4 channels)"
        )
    if pixels.ndim == 3 and channels < 3:  # grey, or grey and alpha
        pixels = pixels[..., 0]
    if pixels.ndim == 2:
        return pixels.astype(np.float64) / white
    red, green, blue = (pixels[..., c].astype(np.float64) for c in range(3))
    return (LUMA[0] * red + LUMA[1] * green + LUMA[2] * blue) / white
