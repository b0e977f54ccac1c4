"""Pictures in TIFF files, of every depth, byte order, compression and photometric interpretation.

Tifffile reads them. What it cannot do without imagecodecs, a further package of 80 MB, is done
here: the libtiff within Pillow unpacks the bytes of segments that are compressed by LZW or
Zstandard, and samples of odd depths and the differences of floats are unpacked in a few lines. Fax
and JPEG, which know of pixels, are decoded by Pillow. All else is refused.
"""

from __future__ import annotations

import io
import logging
import math
import re
import struct
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from keystab.errors import InputError
from keystab.io import pillow_pictures
from keystab.io.picture_samples import Samples, check_memory, upright, upright_shape

__all__ = ["SIGNATURES", "decode", "shape"]

SIGNATURES = (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")
"""First bytes of TIFF files, classic and big, of both byte orders."""

# Tags by their numbers in the specification.
_PHOTOMETRIC, _ORIENTATION, _INKS, _XMP = 262, 274, 332, 700

_BYTE_CODECS = {1, 5, 8, 32773, 32946, 34925, 34926, 50000, 50013}
"""Compressions that know of bytes only: none, LZW, deflate, PackBits, LZMA and Zstandard."""

_LIBTIFF_NUMBERS = {5: 5, 34926: 50000, 50000: 50000}
"""Those of them that libtiff unpacks here, by the numbers that it knows them by."""

_FAX, _JPEG = {2, 3, 4}, 7
_DIFFERENCES_OF_FLOATS = 3  # predictor
_WHOLE_BYTES = (8, 16, 32, 64)
_CONVERT = "save it uncompressed or compressed by LZW or deflate"


def shape(path: Path) -> tuple[int, int]:
    """Height and width of the picture in a TIFF file, upright."""
    with _only_page(path) as page:
        return upright_shape(page.imagelength, page.imagewidth, _orientation(page))


def decode(path: Path) -> Samples:
    """Samples of the picture in a TIFF file, upright."""
    with _only_page(path) as page:
        _check(page, path)
        # Odd depths are unpacked bit by bit.
        bits = page.bitspersample
        sample_bytes = page.dtype.itemsize if bits in (1, *_WHOLE_BYTES) else bits
        pixel_bytes = page.samplesperpixel * sample_bytes
        check_memory(page.imagelength, page.imagewidth, pixel_bytes, path)
        if page.compression in _FAX | {_JPEG}:
            return _by_pillow(page, path)
        samples = _interpreted(_stored(page, path), page)
        return Samples(upright(samples.values, _orientation(page)), samples.white)


@contextmanager
def _only_page(path: Path) -> Iterator[Any]:
    """Open the page that holds the picture; previews, masks and depth maps are none."""
    import tifffile

    with _silent(), tifffile.TiffFile(path) as tiff:
        pages = [page for page in tiff.pages if not _is_beside(page)]
        if not tiff.pages:
            raise InputError(f"{path}: the TIFF holds no page, or is cut; write it anew")
        if not pages:
            raise InputError(
                f"{path}: the TIFF holds no picture of full size, only previews and masks; save "
                "the picture itself"
            )
        # Some programs write one page for a stack of pictures.
        n_stacked = math.prod(tiff.series[0].shape) // max(1, math.prod(tiff.pages[0].shape))
        n_pictures = n_stacked if n_stacked > len(tiff.pages) else len(pages)
        if n_pictures > 1:
            raise InputError(f"{path}: the TIFF holds {n_pictures} pictures; keep one")
        yield pages[0]


def _is_beside(page: Any) -> bool:
    """Whether a page is a preview, a mask or a depth map of another one."""
    return bool(page.subfiletype & ~2) or getattr(page.photometric, "name", "") == "MASK"


@contextmanager
def _silent() -> Iterator[None]:
    """Keep tifffile from logging what is wrong with a file; what matters is raised."""
    logger = logging.getLogger("tifffile")
    before, logger.disabled = logger.disabled, True
    try:
        yield
    finally:
        logger.disabled = before


def _orientation(page: Any) -> int:
    """Orientation that the tags ask for; 1 where there is none."""
    tag = page.tags.get(_ORIENTATION)
    if tag is not None:
        return int(tag.value)
    xmp = page.tags.get(_XMP)
    text = xmp.value if xmp is not None and isinstance(xmp.value, bytes) else b""
    found = re.search(rb'tiff:Orientation(?:="|>)([0-9])', text)
    return int(found[1]) if found else 1


def _check(page: Any, path: Path) -> None:
    """Refuse what would not be read exactly."""
    reason = _of_samples(page) or _of_colour(page) or _of_compression(page)
    if reason:
        raise InputError(f"{path}: the TIFF {reason}")


def _of_samples(page: Any) -> str:
    """What is wrong with the samples of a page, as the rest of a sentence; nothing if empty."""
    bits, kind = page.bitspersample, page.dtype.kind if page.dtype is not None else "?"
    # Of samples of 24 bits and the like, programs disagree about the order of their bytes.
    known = kind == "b" or (kind == "u" and isinstance(bits, int) and bits in (*range(17), 32, 64))
    if not (known or (kind == "f" and bits in _WHOLE_BYTES)):
        return (
            f"holds samples of {bits} bits and sample format {page.sampleformat}, which have no "
            "agreed white; use unsigned integers or floats"
        )
    if page.imagedepth > 1:
        return f"holds a volume of {page.imagedepth} slices; keep one"
    if not _is_whole(page):
        return "lacks a part of its pixels; save it whole"
    return ""


def _of_colour(page: Any) -> str:
    """What is wrong with the photometric interpretation of a page; nothing if empty."""
    photometric = getattr(page.photometric, "name", str(page.photometric))
    bits, samples = page.bitspersample, page.samplesperpixel
    if _PHOTOMETRIC not in page.tags:
        return "does not say whether 0 is black; save it with 0 as black"
    if photometric in ("MINISBLACK", "MINISWHITE"):
        if samples > 2:
            return f"holds {samples} grey values per pixel; keep one of these channels"
        if photometric == "MINISWHITE" and page.dtype.kind == "f":
            return (
                "holds floats of which 0 is white (MINISWHITE) and nothing says what is black; "
                "save it with 0 as black (MINISBLACK)"
            )
    elif photometric == "RGB":
        if samples not in (3, 4):
            return f"holds {samples} samples per pixel, 3 or 4 make a colour; keep these"
    elif photometric == "PALETTE":
        if page.colormap is None or bits > 16 or page.dtype.kind == "f" or samples > 2:
            return "has a palette that does not fit its samples; save it as colour (RGB)"
    elif photometric == "SEPARATED":
        inks = page.tags.get(_INKS)
        if bits != 8 or samples < 4 or (inks is not None and inks.value != 1):
            return f"holds {samples} inks (SEPARATED) of {bits} bits; save it as colour (RGB)"
    elif photometric != "YCBCR" or page.compression != _JPEG:
        return f"holds samples of the kind {photometric}; save it as colour (RGB) or grey"
    return ""


def _of_compression(page: Any) -> str:
    """What is wrong with the compression of a page; nothing if empty."""
    bits, samples, colour = page.bitspersample, page.samplesperpixel, page.photometric.name
    if page.compression in _FAX:
        good = bits == 1 and samples == 1 and colour in ("MINISBLACK", "MINISWHITE")
    elif page.compression == _JPEG:
        channels = {"MINISBLACK": 1, "RGB": 3, "YCBCR": 3}.get(colour)
        good = bits == 8 and samples == channels and page.planarconfig == 1
    else:
        good = page.predictor == 1 or bits in _WHOLE_BYTES
    if good:
        return ""
    what = f"{samples} {colour} samples of {bits} bits"
    return f"compresses {what} as {_codec(page)}, predictor {int(page.predictor)}; {_CONVERT}"


def _is_whole(page: Any) -> bool:
    """Whether a page lists all of its strips or tiles; tifffile puts zeros in place of others."""
    n_segments = math.prod(page.chunked)
    counts = page.databytecounts[:n_segments]
    row_bytes = -(-page.imagewidth * page.samplesperpixel * page.bitspersample // 8)
    is_enough: bool = page.compression != 1 or sum(counts) >= page.imagelength * row_bytes
    return len(counts) == n_segments and bool(min(counts) > 0) and is_enough


def _codec(page: Any) -> str:
    return str(getattr(page.compression, "name", page.compression))


def _stored(page: Any, path: Path) -> NDArray[Any]:
    """Samples as they are stored, shape (height, width) or (height, width, samples)."""
    import tifffile

    known = page.compression not in _LIBTIFF_NUMBERS
    known &= page.predictor == 1 or page.predictor in tifffile.TIFF.UNPREDICTORS
    if page.compression in _BYTE_CODECS and not (
        known and page.bitspersample in (1, *_WHOLE_BYTES)
    ):
        values = _assembled(page)
    else:
        try:
            values = page.asarray(squeeze=False)
        except ValueError as error:
            if "imagecodecs" not in str(error):
                raise
            raise InputError(
                f"{path}: the TIFF is compressed as {_codec(page)}, which needs the package "
                f"imagecodecs; install it, or {_CONVERT}"
            ) from None
    planes, _, height, width, samples = values.shape
    values = np.moveaxis(values[:, 0], 0, -1).reshape(height, width, planes * samples)
    return values[..., 0] if values.shape[-1] == 1 else values


def _interpreted(values: NDArray[Any], page: Any) -> Samples:
    """Samples of which 0 is black, from those that are stored."""
    photometric = page.photometric.name
    if photometric == "SEPARATED":
        from PIL import Image

        inks = Image.fromarray(np.ascontiguousarray(values[..., :4]), "CMYK")
        return Samples(pillow_pictures.picture_samples(inks), 255.0)
    if photometric == "PALETTE":
        indices = values if values.ndim == 2 else values[..., 0]
        return _colours(indices.astype(np.uint16), page.colormap)
    white = 1 if values.dtype.kind in "fb" else 2**page.bitspersample - 1
    if photometric == "MINISWHITE":
        values = ~values if values.dtype == bool else values.dtype.type(white) - values
    return Samples(values, float(white))


def _colours(indices: NDArray[Any], palette: NDArray[np.uint16]) -> Samples:
    """Colours that a palette gives to its indices."""
    # Palettes hold 16 bits. Many programs fill them from 8 bits, by a factor of 257, 256 or 1.
    for factor in (257, 256, 1):
        if not (palette % factor).any() and palette.max() // factor <= 255:
            return Samples((palette // factor).astype(np.uint8).T[indices], 255.0)
    return Samples(palette.T[indices], 65535.0)


def _by_pillow(page: Any, path: Path) -> Samples:
    """Samples of a picture that Pillow decodes, which also turns it upright."""
    with pillow_pictures.opened(path) as picture:
        picture.seek(page.index)
        values = pillow_pictures.picture_samples(picture)
    return Samples(values, 1.0 if values.dtype == bool else 255.0)


def _assembled(page: Any) -> NDArray[Any]:
    """Decode a page strip by strip or tile by tile, in tifffile's normalised shape."""
    bits, predictor, order = page.bitspersample, page.predictor, page.parent.byteorder
    samples = page.samplesperpixel if page.planarconfig == 1 else 1
    width = page.tilewidth if page.is_tiled else page.imagewidth
    raw = page.parent.filehandle.read_segments(
        page.dataoffsets, page.databytecounts, length=math.prod(page.chunked)
    )
    segments = []
    for data, index in raw:
        rows = _unpacked(page, data, index, -(-width * samples * bits // 8))
        if predictor == _DIFFERENCES_OF_FLOATS:
            rows = _summed(rows, samples, bits // 8, order)
        elif bits not in (1, *_WHOLE_BYTES):
            rows = _widened(rows, width * samples, bits).astype(page.dtype.newbyteorder(order))
        segments.append((rows.tobytes(), index))
    # What is left to do is what tifffile does with a page that is not compressed.
    page.compression, page.fillorder = 1, 1
    page.predictor = 1 if predictor == _DIFFERENCES_OF_FLOATS else predictor
    page.bitspersample = bits if bits in (1, *_WHOLE_BYTES) else 8 * page.dtype.itemsize
    values = np.empty(page.shaped, page.dtype)
    for data, index in segments:
        segment, (plane, _, y, x, _), _ = page.decode(data, index)
        part = values[plane, 0, y : y + segment.shape[1], x : x + segment.shape[2]]
        part[...] = segment[0, : part.shape[0], : part.shape[1]]
    page.bitspersample = bits
    return values


def _unpacked(page: Any, data: bytes, index: int, row_bytes: int) -> NDArray[np.uint8]:
    """Bytes of a strip or tile before its compression, one row for each row of pixels."""
    import tifffile

    if page.fillorder == 2:  # the bits of each byte are reversed
        bits = np.unpackbits(np.frombuffer(data, np.uint8), bitorder="little")
        data = np.packbits(bits).tobytes()
    if page.is_tiled:
        n_rows = page.tilelength
    else:
        step = min(page.rowsperstrip, page.imagelength)
        n_rows = min(step, page.imagelength - index % -(-page.imagelength // step) * step)
    if page.compression == 1:
        plain = data
    elif page.compression in _LIBTIFF_NUMBERS:
        codec = _LIBTIFF_NUMBERS[page.compression]
        try:
            plain = _unpacked_by_libtiff(data, codec, row_bytes, n_rows)
        except OSError:
            raise ValueError(f"{_codec(page)} of strip or tile {index} is damaged") from None
    else:
        plain = tifffile.TIFF.DECOMPRESSORS[page.compression](data)
    return np.frombuffer(plain, np.uint8, n_rows * row_bytes).reshape(n_rows, row_bytes)


def _unpacked_by_libtiff(data: bytes, codec: int, width: int, height: int) -> bytes:
    """Unpack bytes as if they were the only strip of a grey picture of 8 bits."""
    size = len(data)
    entries = {256: width, 257: height, 258: 8, 259: codec, 262: 1, 273: 122, 277: 1}
    entries |= {278: height, 279: size}  # 122 is where all this ends
    head = struct.pack("<2sHIH", b"II", 42, 8, len(entries))
    head += b"".join(struct.pack("<HHII", tag, 4, 1, value) for tag, value in entries.items())
    with pillow_pictures.opened(io.BytesIO(head + bytes(4) + data)) as picture:
        return np.asarray(picture).tobytes()


def _summed(rows: NDArray[np.uint8], samples: int, itemsize: int, order: str) -> NDArray[np.uint8]:
    """Bytes of floats, from the differences of bytes that predictor 3 stores (TIFF note 3)."""
    n_rows, n_bytes = rows.shape
    sums = np.cumsum(rows.reshape(n_rows, -1, samples), axis=1, dtype=np.uint8)
    planes = sums.reshape(n_rows, itemsize, n_bytes // itemsize)  # the most significant comes first
    if order == "<":
        planes = planes[:, ::-1]
    return np.ascontiguousarray(planes.swapaxes(1, 2)).reshape(n_rows, n_bytes)


def _widened(rows: NDArray[np.uint8], count: int, bits: int) -> NDArray[np.uint16]:
    """Whole numbers from samples of up to 16 bits, of which each row starts at a whole byte."""
    digits = np.unpackbits(rows, axis=1, count=count * bits).reshape(len(rows), count, bits)
    return digits @ (1 << np.arange(bits, dtype=np.uint16)[::-1])
