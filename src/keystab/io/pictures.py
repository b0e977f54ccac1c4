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
from keystab.utils.files import check_writable, written_whole
from keystab.utils.validation import unmasked

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
_PNG_SIGNATURE = b"\x89PNG\r\n\x1a\n"
_PNG_COLOUR_TYPES = (b"\2", b"\4", b"\6")  # RGB, grey with alpha, RGB with alpha
_NPY_SIGNATURE = b"\x93NUMPY"
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
        A PNG, JPEG, TIFF or NumPy (.npy) file; other formats that Pillow knows are tried. The
        content decides, whatever the suffix. Arrays in .npy files have the shape (height, width)
        or (height, width, channels). Previews beside the picture (JPEG with MPO, reduced pages of
        a TIFF) do not count.

    Returns
    -------
    ndarray of float64, shape (height, width)
        Grey values u[y, x], in [0, 1] for integer pictures.

    Raises
    ------
    InputError
        If the file is missing or unreadable, holds several pictures (pages or frames of an
        animation), holds signed integers, NaN or infinities, is a floating-point TIFF in which 0
        is white, or is a PNG in colour with 16 bits per channel, which the decoder at hand would
        cut down to 8 bits.

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
    pixels = _decode(path)
    return _finite_grey(pixels, path), _digest(pixels)


def picture_shape(path: str | os.PathLike[str]) -> tuple[int, int]:
    """Height and width of a picture, from the head of its file.

    Parameters
    ----------
    path : path
        A picture that `read_picture` accepts.

    Returns
    -------
    (int, int)
        Height and width in pixels. The pixels themselves are not looked at.

    Raises
    ------
    InputError
        If the file is missing, no picture or several of them; see `read_picture`.
    """
    path = Path(path)
    head = _head(path)
    with _one_line(path):
        if head.startswith(_NPY_SIGNATURE):
            shape: tuple[int, ...] = np.load(path, mmap_mode="r", allow_pickle=False).shape
            _count_channels(shape, path)
            return shape[0], shape[1]
        if head.startswith(_TIFF_SIGNATURES):
            import tifffile

            with tifffile.TiffFile(path) as tiff:
                page = _only_page(tiff, path)
                return int(page.imagelength), int(page.imagewidth)
        _, (width, height) = _pillow_mode_and_size(path)
        return height, width


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
    return _digest(_decode(Path(path)))


def _digest(pixels: NDArray[Any]) -> str:
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
        If the suffix is none of these, no file can be written there (see
        `keystab.utils.files.check_writable`), or `u` is no grey picture of finite values.
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


def _decode(path: Path) -> NDArray[Any]:
    """Decode the samples as stored: (height, width) or (height, width, channels)."""
    head = _head(path)
    with _one_line(path):
        if head.startswith(_NPY_SIGNATURE):
            pixels = np.load(path, allow_pickle=False)
        elif head.startswith(_TIFF_SIGNATURES):
            pixels = _decode_tiff(path)
        else:
            pixels = _decode_by_pillow(path, _pillow_mode_and_size(path)[0])
    if pixels.size == 0:
        raise InputError(f"{path}: the picture has no pixels (shape {pixels.shape})")
    return pixels


def _head(path: Path) -> bytes:
    """First bytes of a file, which tell its format."""
    try:
        with path.open("rb") as file:
            head = file.read(26)
    except FileNotFoundError:
        raise InputError(f"{path}: no such file; give the path of a {_READABLE} picture") from None
    except IsADirectoryError:
        raise InputError(f"{path}: is a folder; give the path of a {_READABLE} picture") from None
    except OSError as error:
        raise InputError(f"{path}: cannot be opened ({error.strerror})") from None
    depth, colour_type = head[24:25], head[25:26]
    if head.startswith(_PNG_SIGNATURE) and depth == b"\x10" and colour_type in _PNG_COLOUR_TYPES:
        raise InputError(
            f"{path}: a PNG with colour or alpha and 16 bits per channel would lose its lower 8 "
            "bits; save it as 16-bit grey PNG or 16-bit TIFF"
        )
    return head


@contextmanager
def _one_line(path: Path) -> Iterator[None]:
    """Turn whatever a decoder raises into an `InputError`."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # a large picture is no reason to warn a user
            yield
    except InputError:
        raise
    except Exception as error:  # decoders raise whatever they like
        reason = " ".join(str(error).split()) or type(error).__name__
        raise InputError(f"{path}: not a readable picture ({_READABLE}): {reason[:120]}") from None


def _only_page(tiff: Any, path: Path) -> Any:
    """Page of a TIFF that holds one picture; thumbnails and other reduced pages do not count."""
    pages = [page for page in tiff.pages if not page.is_reduced]
    series = tiff.series[0]  # ImageJ lists one page for a stack of pictures
    n_pictures = max(len(pages), math.prod(series.shape) // max(1, math.prod(pages[0].shape)))
    if n_pictures > 1:
        raise InputError(f"{path}: the TIFF holds {n_pictures} pictures; keep one")
    return pages[0]


def _decode_tiff(path: Path) -> NDArray[Any]:
    import tifffile

    with tifffile.TiffFile(path) as tiff:
        page = _only_page(tiff, path)
        photometric = getattr(page.photometric, "name", "")
        if photometric not in {"MINISBLACK", "MINISWHITE", "RGB"}:
            return _decode_by_pillow(path, _pillow_mode(path))
        if photometric == "MINISWHITE" and page.dtype is not None and page.dtype.kind == "f":
            raise InputError(
                f"{path}: in this TIFF of floats 0 is white (MINISWHITE) and nothing says what is "
                "black; save it with 0 as black (MINISBLACK)"
            )
        try:
            pixels = page.asarray()
        except ValueError:  # a compression that needs a package we do not ask for
            return _decode_by_pillow(path, _pillow_mode(path))
        if page.axes == "SYX":  # one plane per channel
            pixels = np.moveaxis(pixels, 0, -1)
        if photometric == "MINISWHITE" and pixels.dtype.kind in {"b", "u"}:
            pixels = ~pixels  # the largest value minus the sample
        return pixels


def _pillow_mode(path: Path) -> str:
    from PIL import Image

    with Image.open(path) as picture:
        return picture.mode


def _pillow_mode_and_size(path: Path) -> tuple[str, tuple[int, int]]:
    """Colour mode, width and height of a file that holds one picture."""
    from PIL import Image, UnidentifiedImageError

    try:
        with Image.open(path) as picture:
            n_pictures = getattr(picture, "n_frames", 1)
            # The further pictures of a JPEG (MPO) are previews and depth maps.
            if n_pictures > 1 and picture.format != "MPO":
                raise InputError(
                    f"{path}: the {picture.format} file holds {n_pictures} pictures; keep one"
                )
            return picture.mode, picture.size
    except UnidentifiedImageError:
        raise InputError(
            f"{path}: its content is none of PNG, JPEG, TIFF and .npy; give such a picture"
        ) from None


def _decode_by_pillow(path: Path, mode: str) -> NDArray[Any]:
    import imageio.v3 as iio

    # Pillow would hand over ink densities (CMYK) or Lab as if they were colours.
    convert = {"mode": "RGB"} if mode in {"CMYK", "YCbCr", "LAB", "HSV"} else {}
    return np.asarray(iio.imread(path, plugin="pillow", index=0, **convert))


def _finite_grey(pixels: NDArray[Any], path: Path) -> NDArray[np.float64]:
    grey = _grey(pixels, path)
    _require_finite(grey, path)
    return grey


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
    channels = _count_channels(pixels.shape, path)
    if pixels.ndim == 3 and channels < 3:  # grey, or grey and alpha
        pixels = pixels[..., 0]
    if pixels.ndim == 2:
        return pixels.astype(np.float64) / white
    red, green, blue = (pixels[..., c].astype(np.float64) for c in range(3))
    return (LUMA[0] * red + LUMA[1] * green + LUMA[2] * blue) / white


def _count_channels(shape: tuple[int, ...], path: Path) -> int:
    channels = shape[-1] if len(shape) == 3 else 1
    if len(shape) not in (2, 3) or channels > 4:
        raise InputError(
            f"{path}: shape {shape} is no picture; expected (height, width) or "
            "(height, width, 1 to 4 channels)"
        )
    return channels
