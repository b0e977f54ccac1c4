"""TIFF files that no program at hand writes, byte by byte."""

from __future__ import annotations

import itertools
import struct
import zlib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import tifffile
from PIL import Image
from zoo_base import (
    HEIGHT,
    LUMA,
    WIDTH,
    Case,
    grey_of,
    packed,
    samples,
)


def lzw(data: bytes) -> bytes:
    """LZW as in TIFF, without ever using the table: nine bits a byte, and clear codes in between."""
    codes = []
    for start in range(0, len(data), 200):
        codes += [256, *data[start : start + 200]]
    bits = "".join(f"{code:09b}" for code in [*codes, 257])
    bits += "0" * (-len(bits) % 8)
    return int(bits, 2).to_bytes(len(bits) // 8, "big")


def differences_of_floats(values: np.ndarray, order: str) -> list[bytes]:
    """Rows of floats as predictor 3 stores them: planes of bytes, each less the one before."""
    samples = values.shape[2] if values.ndim == 3 else 1
    rows = []
    for row in values.reshape(len(values), -1):
        planes = np.frombuffer(row.astype(row.dtype.newbyteorder(">")).tobytes(), np.uint8)
        planes = planes.reshape(row.size, -1).T.ravel().astype(int)
        planes[samples:] -= planes[:-samples].copy()
        rows.append((planes % 256).astype(np.uint8).tobytes())
    return rows


def reversed_bits(data: bytes) -> bytes:
    return bytes(int(f"{byte:08b}"[::-1], 2) for byte in data)


def tiff_page(order: str, tags: dict[int, object], segments: list[bytes], start: int) -> bytes:
    """Page that lies at `start`: its directory, longer values, then strips or tiles."""
    tags = {277: 1, 256: WIDTH, 257: HEIGHT, 278: HEIGHT, **tags}
    where, sizes = (324, 325) if 322 in tags else (273, 279)
    tags |= {where: [0] * len(segments), sizes: [len(segment) for segment in segments]}
    tags = {code: value for code, value in sorted(tags.items()) if value is not None}
    directory = 2 + 12 * len(tags) + 4
    lists = {code: value if isinstance(value, list) else [value] for code, value in tags.items()}
    long = sum(4 * len(v) for v in lists.values() if len(v) > 1)
    begin = start + directory + long
    for k, segment in enumerate(segments):
        lists[where][k] = begin
        begin += len(segment)
    entries, values = b"", b""
    for code, numbers in lists.items():
        text = struct.pack(f"{order}{len(numbers)}I", *numbers)
        if len(numbers) > 1:
            place = struct.pack(f"{order}I", start + directory + len(values))
            values += text
        else:
            place = text
        entries += struct.pack(f"{order}HHI", code, 4, len(numbers)) + place
    return struct.pack(f"{order}H", len(tags)) + entries + b"NEXT" + values + b"".join(segments)


def write_tiff(path: Path, order: str, *pages: tuple[dict[int, object], list[bytes]]) -> None:
    """TIFF of pages, each of its tags and segments; all values are of 32 bits."""
    data = struct.pack(f"{order}2sHI", b"II" if order == "<" else b"MM", 42, 8)
    for k, (tags, segments) in enumerate(pages):
        page = tiff_page(order, tags, segments, len(data))
        following = 0 if k == len(pages) - 1 else len(data) + len(page)
        data += page.replace(b"NEXT", struct.pack(f"{order}I", following), 1)
    path.write_bytes(data)


def strips(rows: list[bytes], codec: Callable[[bytes], bytes], per: int) -> list[bytes]:
    return [codec(b"".join(rows[k : k + per])) for k in range(0, len(rows), per)]


def by_hand() -> list[Case]:
    """What the other writers do not offer: odd depths, white as 0 under LZW, reversed bits."""
    codecs = {
        "none": (1, bytes),
        "lzw": (5, lzw),
        "deflate": (8, zlib.compress),
    }
    cases = []

    def add(name, tags, segments, grey=None, words="", order="<", **kind):
        write = lambda path: write_tiff(path, order, (tags, segments))  # noqa: E731
        cases.append(Case(f"hand-{name}.tif", write, grey, words, **kind))

    for bits, (name, (number, codec)), order in itertools.product(
        (1, 2, 4, 6, 10, 12, 14, 16), codecs.items(), "<>"
    ):
        for colour, photometric in {"white": 0, "grey": 1, "rgb": 2}.items():
            values = samples("u4", 3 if colour == "rgb" else 1, bits)
            if bits == 16:
                rows = [row.astype(f"{order}u2").tobytes() for row in values]
            else:
                rows = packed(values, bits)
            tags = {258: [bits] * 3 if colour == "rgb" else bits, 259: number, 262: photometric,
                    277: 3 if colour == "rgb" else 1, 278: 7}  # fmt: skip
            white = 2.0**bits - 1
            grey = grey_of(values, white)
            add(f"{bits}-{name}-{'little' if order == '<' else 'big'}-{colour}", tags,
                strips(rows, codec, 7), 1 - grey if colour == "white" else grey, order=order,
                tolerance=1e-15)  # fmt: skip
    for dtype, channels, order in itertools.product(("f2", "f4", "f8"), (1, 3), "<>"):
        values = samples(dtype, channels)
        rows = differences_of_floats(values, order)
        bits = 8 * values.itemsize
        tags = {258: [bits] * channels, 259: 8, 262: 1 if channels == 1 else 2, 277: channels,
                278: 5, 317: 3, 339: [3] * channels}  # fmt: skip
        add(f"{dtype}x{channels}-differences-{'little' if order == '<' else 'big'}", tags,
            strips(rows, zlib.compress, 5), grey_of(values), order=order)  # fmt: skip
    for number, codec, bits in itertools.product((1, 5, 8), (bytes, lzw, zlib.compress), (8, 12)):
        if codecs[{1: "none", 5: "lzw", 8: "deflate"}[number]][1] is codec:
            values = samples("u2", 1, bits)
            segments = [reversed_bits(s) for s in strips(packed(values, bits), codec, 23)]
            tags = {258: bits, 259: number, 262: 1, 266: 2}
            add(f"reversed-{bits}-{number}", tags, segments, grey_of(values, 2.0**bits - 1))
    for bits in (1, 2, 4, 8, 12):
        values, full = samples("u2", 1, bits), np.random.default_rng(bits)
        palette = full.integers(0, 65536, (3, 2**bits), np.uint16)
        tags = {258: bits, 259: 5, 262: 3, 320: [int(v) for v in palette.ravel()]}
        add(f"palette{bits}", tags, strips(packed(values, bits), lzw, 23),
            np.moveaxis(palette[:, values], 0, -1) @ LUMA / 65535, tolerance=1e-15)  # fmt: skip
    values = samples("u1")
    rows = packed(values, 8)
    for bits in (20, 24, 40):
        add(f"{bits}", {258: bits, 259: 1, 262: 1}, rows * 6, None, f"samples of {bits} bits")
    add("float24", {258: 24, 259: 1, 262: 1, 339: 3}, 3 * rows, None, "samples of 24 bits")
    add("predicted12", {258: 12, 259: 8, 262: 1, 317: 2}, strips(packed(values, 12), zlib.compress, 23),
        None, "samples of 12 bits as ADOBE_DEFLATE, predictor 2")  # fmt: skip
    for colour, tags in {"white": {262: 0}, "alpha": {262: 1, 277: 2, 258: [8, 8]}}.items():
        add(f"jpeg-{colour}", {258: 8, 259: 7} | tags, rows, None, "as JPEG")
    add("old-jpeg", {258: 8, 259: 6, 262: 1}, rows, None, "compressed as OJPEG")
    plain = {258: 8, 259: 1, 262: 1}
    add(
        "no-photometric",
        plain | {262: None},
        [b"".join(rows)],
        None,
        "does not say whether 0 is black",
    )
    add("sparse", plain | {278: 12}, [b"".join(rows[:12]), b""], None, "lacks a part of its pixels")
    add(
        "too-few",
        plain | {259: 8, 278: 12},
        strips(rows, zlib.compress, 12)[:1],
        None,
        "lacks a part",
    )
    add("short-strip", plain, [b"".join(rows[:12])], None, "lacks a part of its pixels")
    add(
        "cut-deflate",
        plain | {259: 8},
        [zlib.compress(b"".join(rows))[:-400]],
        None,
        "not a readable",
    )
    add(
        "short-deflate",
        plain | {259: 8},
        [zlib.compress(b"".join(rows[:9]))],
        None,
        "not a readable",
    )
    add("more", plain | {259: 5, 278: 12}, [*strips(rows, lzw, 12), lzw(rows[0])], grey_of(values))
    add(
        "cut-lzw",
        plain | {259: 5},
        [lzw(b"".join(rows[:12]))],
        None,
        "LZW of strip or tile 0 is damaged",
    )
    add("unknown", plain | {259: 4711}, rows, None, "4711")
    add("lerc", plain | {259: 34887}, rows[:1], None, "compressed as LERC, which needs the package")
    add(
        "jpeg12",
        plain | {259: 7, 258: 12},
        rows[:1],
        None,
        "compresses 1 MINISBLACK samples of 12 bits",
    )
    add("volume", plain | {32997: 2, 257: 12, 278: 12}, rows[:24], None, "volume of 2 slices")
    add("565", plain | {258: [5, 6, 5], 262: 2, 277: 3}, rows[:1], None, "TIFF holds samples of")
    return cases


def with_pages_beside() -> list[Case]:
    """Previews, masks and depth maps are no pictures; a second picture is one."""
    values = samples("u1")
    picture = ({258: 8, 259: 1, 262: 1}, [values.tobytes()])
    small = ({258: 8, 259: 1, 262: 1, 256: 5, 257: 5, 278: 5}, [bytes(25)])
    mask = ({258: 1, 259: 1, 262: 4}, [bytes(HEIGHT * 5)])

    def marked(page, kind, tag=254):
        return page[0] | {tag: kind}, page[1]

    beside = {
        "preview": marked(small, 1),
        "old-preview": marked(small, 2, 255),
        "mask": marked(mask, 4),
        "plain-mask": mask,
        "preview-of-mask": marked(small, 5),
        "grey-mask": marked(picture, 4),
        "depth": marked(small, 8),
    }
    cases = []
    for name, page in beside.items():
        for where, pages in {"after": (picture, page), "before": (page, picture)}.items():
            cases.append(Case(f"pages-{name}-{where}.tif",
                              lambda path, pages=pages: write_tiff(path, "<", *pages),
                              grey_of(values)))  # fmt: skip
        cases.append(Case(f"pages-{name}-alone.tif",
                          lambda path, page=page: write_tiff(path, "<", page),
                          None, "no picture of full size"))  # fmt: skip
    for name, pages, n in (
        ("two", (picture, picture), 2),
        ("two-sizes", (picture, small), 2),
        ("numbered", (marked(picture, 2), marked(picture, 2), marked(small, 1)), 2),
    ):
        cases.append(Case(f"pages-{name}.tif",
                          lambda path, pages=pages: write_tiff(path, "<", *pages),
                          None, f"holds {n} pictures"))  # fmt: skip
    numbered = (marked(picture, 2),)
    cases.append(Case("pages-one-of-many.tif", lambda path: write_tiff(path, "<", *numbered),
                      grey_of(values)))  # fmt: skip
    bits = Image.fromarray(samples("?"))
    thumb = Image.fromarray(np.zeros((4, 4), bool))

    def fax_behind_preview(path):
        thumb.save(path, compression="group4", save_all=True, append_images=[bits],
                   tiffinfo={254: 0})  # fmt: skip
        data = path.read_bytes()
        with tifffile.TiffFile(path, mode="r+") as tiff:
            tiff.pages[0].tags[254].overwrite(1)
        assert len(path.read_bytes()) == len(data)

    def fax_reversed(path):
        bits.save(path, compression="group4")
        with tifffile.TiffFile(path) as tiff:
            page = tiff.pages[0]
            offset, count = page.dataoffsets[0], page.databytecounts[0]
            white = int(page.photometric)
        data = reversed_bits(path.read_bytes()[offset : offset + count])
        write_tiff(path, "<", ({258: 1, 259: 4, 262: white, 266: 2}, [data]))

    cases.append(Case("fax-reversed.tif", fax_reversed, grey_of(samples("?"))))
    cases.append(Case("pages-fax-behind-preview.tif", fax_behind_preview, grey_of(samples("?"))))
    return cases
