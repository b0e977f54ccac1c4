"""Pictures that Pillow decodes without loss of depth: PNG, JPEG, GIF, WebP and BMP."""

from __future__ import annotations

import io
import struct
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from keystab.errors import InputError
from keystab.io.picture_samples import Samples, check_memory, upright, upright_shape

__all__ = ["decode", "opened", "picture_samples", "shape"]

# Of other formats Pillow cuts or stretches samples of some depths, without a word.
_FORMATS = ("PNG", "JPEG", "MPO", "GIF", "WEBP", "BMP")

_SIGNATURES = {
    b"\xff\xd8\xff": "JPEG",
    b"\x89PNG": "PNG",
    b"GIF8": "GIF",
    b"RIFF": "WebP",
    b"BM": "BMP",
}
_PNG_COLOUR_TYPES = (b"\2", b"\4", b"\6")  # RGB, grey with alpha, RGB with alpha
_PNG_TEXT = (b"eXIf", b"tEXt", b"zTXt", b"iTXt")  # chunks that may hold an orientation
_ORIENTATION = 274
_SAMPLE_BYTES = {"I;16": 2, "I;16B": 2}
_GUARD = threading.RLock()


def shape(path: Path) -> tuple[int, int]:
    """Height and width of a picture, upright, from the head of its file."""
    with _one_picture(path) as picture:
        width, height = picture.size
        return upright_shape(height, width, _orientation(picture, path))


def decode(path: Path) -> Samples:
    """Samples of a picture, upright."""
    with _one_picture(path) as picture:
        width, height = picture.size
        n_bytes = _SAMPLE_BYTES.get(picture.mode, 1 if len(picture.mode) == 1 else 4)
        check_memory(height, width, 3 if picture.mode == "P" else n_bytes, path)
        orientation = _orientation(picture, path)
        values = picture_samples(picture)
    if values.dtype.kind not in ("b", "u"):
        raise InputError(f"{path}: samples of type {values.dtype} have no agreed white; use TIFF")
    white = 1.0 if values.dtype == bool else float(np.iinfo(values.dtype).max)
    return Samples(upright(values, orientation), white)


def picture_samples(picture: Any) -> NDArray[Any]:
    """Samples of an open picture, colours in place of palettes and inks."""
    if picture.mode in ("P", "PA"):
        picture = picture.convert(picture.palette.mode)
    elif picture.mode in ("CMYK", "YCbCr"):  # else ink densities would pass for colours
        picture = picture.convert("RGB")
    return np.array(picture)


@contextmanager
def opened(file: Path | io.BytesIO) -> Iterator[Any]:
    """Open a picture with Pillow, however large it is: keystab has estimates of its own."""
    from PIL import Image

    with _GUARD:  # the limit is one for the whole process
        limit, Image.MAX_IMAGE_PIXELS = Image.MAX_IMAGE_PIXELS, None
        try:
            with Image.open(file) as picture:
                yield picture
        finally:
            Image.MAX_IMAGE_PIXELS = limit


@contextmanager
def _one_picture(path: Path) -> Iterator[Any]:
    """Open a file that holds one picture whose samples Pillow leaves as they are."""
    from PIL import UnidentifiedImageError

    _check_depth(path)
    try:
        with opened(path) as picture:
            _check(picture, path)
            yield picture
    except UnidentifiedImageError:
        raise _unidentified(path) from None


def _check(picture: Any, path: Path) -> None:
    if picture.format not in _FORMATS:
        raise InputError(
            f"{path}: pictures of the format {picture.format} are not read, because their depth "
            "could get lost; save it as PNG or TIFF"
        )
    n_pictures = getattr(picture, "n_frames", 1)
    # The further pictures of a JPEG (MPO) are previews and depth maps.
    if n_pictures > 1 and picture.format != "MPO":
        raise InputError(f"{path}: the {picture.format} file holds {n_pictures} pictures; keep one")
    if picture.format == "BMP" and any(
        "16" in _raw(tile) or "15" in _raw(tile) for tile in picture.tile
    ):
        raise InputError(
            f"{path}: a BMP of 16 bits per pixel has 5 or 6 bits per colour, which would be "
            "stretched to 8; save it as PNG"
        )


def _raw(tile: Any) -> str:
    """How the samples of a part of a picture lie in its file."""
    arguments = tile[3]
    return str(arguments if isinstance(arguments, str) else arguments[0])


def _check_depth(path: Path) -> None:
    """Refuse a PNG that Pillow would cut down."""
    with path.open("rb") as file:
        head = file.read(26)
    depth, colour_type = head[24:25], head[25:26]
    if head.startswith(b"\x89PNG") and depth == b"\x10" and colour_type in _PNG_COLOUR_TYPES:
        raise InputError(
            f"{path}: a PNG with colour or alpha and 16 bits per channel would lose its lower 8 "
            "bits; save it as 16-bit grey PNG or 16-bit TIFF"
        )


def _orientation(picture: Any, path: Path) -> int:
    """Orientation that the metadata ask for; 1 where there is none or it cannot be read."""
    if picture.format == "PNG" and "exif" not in picture.info and not _late_text(path):
        # Pillow would decode all of the pixels to see whether there is more behind them.
        early = "xmp" in picture.info or "Raw profile type exif" in picture.info
        if not early and "XML:com.adobe.xmp" not in picture.info:
            return 1
    with suppress(Exception):  # damaged metadata; other programs ignore them too
        return int(picture.getexif().get(_ORIENTATION, 1))
    return 1


def _late_text(path: Path) -> bool:
    """Whether a PNG has metadata behind its pixels."""
    seen = False
    with path.open("rb") as file:
        file.seek(8)
        while len(head := file.read(8)) == 8:
            length, name = struct.unpack(">I4s", head)
            seen |= name == b"IDAT"
            if seen and name in _PNG_TEXT:
                return True
            file.seek(length + 4, io.SEEK_CUR)
    return False


def _unidentified(path: Path) -> InputError:
    with path.open("rb") as file:
        head = file.read(4)
    for signature, name in _SIGNATURES.items():
        if head.startswith(signature):
            return InputError(
                f"{path}: a damaged {name}, or one of a kind that is not read (such as 12 bits per "
                "sample); save it as PNG or TIFF"
            )
    return InputError(
        f"{path}: its content is none of PNG, JPEG, TIFF and .npy; give such a picture"
    )
