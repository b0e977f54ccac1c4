"""TIFF files as tifffile, OpenCV and Pillow write them."""

from __future__ import annotations

import itertools

import cv2
import numpy as np
import tifffile
from PIL import Image
from zoo_base import (
    HEIGHT,
    LUMA,
    WIDTH,
    Case,
    grey_of,
    samples,
    seen_by_opencv,
    smooth_colours,
)


def by_tifffile() -> list[Case]:
    """Depth, byte order, photometric interpretation, layout, and what tifffile compresses."""
    cases = []

    def add(name: str, values: np.ndarray, grey: np.ndarray | None, words: str = "", **options):
        cases.append(
            Case(
                f"tifffile-{name}.tif",
                lambda path: tifffile.imwrite(path, values, metadata=None, **options),
                grey,
                words,
            )
        )

    compressions = {"none": {}, "deflate": {"compression": "zlib"}, "lzma": {"compression": "lzma"}}
    compressions["deflate2"] = {"compression": "zlib", "predictor": 2}
    layouts = {"strips": {"rowsperstrip": 5}, "tiles": {"tile": (16, 32)}}
    types = itertools.product(
        ["u1", "u2", "u4", "u8", "f2", "f4", "f8"], "<>", ["grey", "white", "rgb"], compressions
    )
    for k, (dtype, order, colour, compression) in enumerate(types):
        if compression == "deflate2" and dtype[0] == "f":
            continue
        layout = list(layouts)[k % 2]
        values = samples(dtype, 3 if colour == "rgb" else 1)
        photometric = {"grey": "minisblack", "white": "miniswhite", "rgb": "rgb"}[colour]
        options = {"byteorder": order, "photometric": photometric}
        options |= compressions[compression] | layouts[layout]
        grey, words = grey_of(values), ""
        if colour == "white" and dtype[0] == "f":
            grey, words = None, "TIFF holds floats of which 0 is white"
        elif colour == "white":
            grey = grey_of(np.iinfo(values.dtype).max - values)
        add(f"{dtype}-{'little' if order == '<' else 'big'}-{colour}-{compression}-{layout}",
            values, grey, words, **options)  # fmt: skip
    for dtype in ("i1", "i2", "i4", "i8", "c8"):
        values = samples(dtype) if dtype[0] == "i" else samples("f4").astype("c8")
        add(f"{dtype}-grey", values, None, "TIFF holds samples of", photometric="minisblack")
    for colour, extra in itertools.product(("rgb", "minisblack"), ("unassalpha", "assocalpha", 0)):
        values = samples("u2", 4 if colour == "rgb" else 2)
        for planar in ("contig", "separate"):
            stored = values if planar == "contig" else np.moveaxis(values, -1, 0)
            add(f"u2-{colour}-{extra}-{planar}", stored, grey_of(values), photometric=colour,
                planarconfig=planar, extrasamples=[extra])  # fmt: skip
    values = samples("u1", 3)
    add("bands", values, None, "3 grey values per pixel", photometric="minisblack",
        planarconfig="contig")  # fmt: skip
    values = samples("u1", 5)
    add("rgb-and-2", values, None, "5 samples per pixel", photometric="rgb")
    values = samples("u2")
    add("big", values, grey_of(values), photometric="minisblack", bigtiff=True)
    bits = samples("?")
    for colour in ("minisblack", "miniswhite"):
        grey = grey_of(bits) if colour == "minisblack" else 1 - grey_of(bits)
        add(f"bits-{colour}", bits, grey, photometric=colour)
    inks = samples("u1", 4)
    paper = (255.0 - inks[..., :3]) * (255.0 - inks[..., 3:]) / 255.0
    cases.append(
        Case(
            "tifffile-inks.tif",
            lambda path: tifffile.imwrite(path, inks, photometric="separated"),
            paper @ LUMA / 255.0,
            tolerance=1 / 255,  # Pillow rounds
        )
    )
    deep = samples("u2", 4)
    add("inks16", deep, None, "4 inks (SEPARATED) of 16 bits", photometric="separated")
    for kind in ("cielab", "icclab", "ycbcr", "cfa", "linear_raw", "logluv"):
        stored = samples("u1", 1 if kind == "cfa" else 3)
        add(kind, stored, None, f"of the kind {kind.upper()}", photometric=kind)
    for k, (bits_, dtype) in enumerate(((8, "u1"), (16, "u2"))):
        index = samples(dtype)
        for name, make in {
            "full": lambda n: np.random.default_rng(n).integers(0, 65536, (3, n), np.uint16),
            "by257": lambda n: np.random.default_rng(n).integers(0, 256, (3, n), np.uint16) * 257,
            "by256": lambda n: np.random.default_rng(n).integers(0, 256, (3, n), np.uint16) * 256,
            "by1": lambda n: np.random.default_rng(n).integers(0, 256, (3, n), np.uint16),
        }.items():
            palette = make(2**bits_)
            white = {"full": 65535, "by257": 65535, "by256": 65280, "by1": 255}[name]
            grey = np.moveaxis(palette[:, index], 0, -1).astype(float) @ LUMA / white
            add(f"palette{bits_}-{name}", index, grey, photometric="palette", colormap=palette,
                byteorder="<>"[k])  # fmt: skip
    return cases


def by_opencv() -> list[Case]:
    """What OpenCV writes, in its default LZW and in all other compressions that it knows."""
    cases = []
    compressions = {"none": 1, "lzw": 5, "deflate": 8, "packbits": 32773}
    for dtype, channels in itertools.product(("u1", "u2", "f4", "f8"), (1, 3, 4)):
        values = samples(dtype, channels)
        stored = values if channels == 1 else values[..., [2, 1, 0, 3][:channels]]
        for name, number in {"default": None, **compressions}.items():
            flags = [] if number is None else [cv2.IMWRITE_TIFF_COMPRESSION, number]
            for predictor in (None, 1, 2, 3):
                if predictor and (number is None or (predictor == 3) != (dtype[0] == "f")):
                    continue
                more = [cv2.IMWRITE_TIFF_PREDICTOR, predictor] if predictor else []
                cases.append(
                    Case(
                        f"opencv-{dtype}x{channels}-{name}-{predictor}.tif",
                        lambda path, stored=stored, flags=(*flags, *more): cv2.imwrite(
                            str(path), stored, list(flags)
                        ),
                        grey_of(values),
                    )
                )
    return cases


def by_pillow() -> list[Case]:
    """What Pillow writes as TIFF."""
    cases = []
    bits = Image.fromarray(samples("?"))
    for compression in (None, "packbits", "tiff_lzw", "tiff_adobe_deflate", "tiff_deflate",
                        "lzma", "zstd"):  # fmt: skip
        for mode, values in {
            "1": samples("?"),
            "L": samples("u1"),
            "LA": samples("u1", 2),
            "RGB": samples("u1", 3),
            "RGBA": samples("u1", 4),
            "I;16": samples("u2"),
            "I;16B": samples("u2"),
            "F": samples("f4"),
        }.items():

            def write(path, mode=mode, values=values, compression=compression):
                if mode == "I;16B":
                    picture = Image.frombytes(mode, (WIDTH, HEIGHT), values.astype(">u2").tobytes())
                else:
                    picture = Image.fromarray(values)
                picture.save(path, compression=compression)

            cases.append(
                Case(f"pillow-{mode.replace(';', '')}-{compression}.tif", write, grey_of(values))
            )
    for compression in ("group3", "group4", "tiff_ccitt"):
        cases.append(
            Case(f"pillow-fax-{compression}.tif",
                 lambda path, c=compression: bits.save(path, compression=c), grey_of(samples("?")))
        )  # fmt: skip
    index = Image.fromarray(samples("u1"), "P")
    colours = np.random.default_rng(3).integers(0, 256, (256, 3), np.uint8)
    index.putpalette(colours.tobytes())
    grey = grey_of(colours[samples("u1")])
    for compression in (None, "tiff_lzw"):
        cases.append(Case(f"pillow-P-{compression}.tif",
                          lambda path, c=compression: index.save(path, compression=c), grey))  # fmt: skip
    smooth = Image.fromarray(smooth_colours())
    for mode in ("L", "RGB", "YCbCr"):

        def write_jpeg(path, mode=mode):
            smooth.convert(mode).save(path, compression="jpeg", quality=95)

        cases.append(Case(f"pillow-jpeg-{mode}.tif", write_jpeg,
                          seen_by_opencv, tolerance=1e-12))  # fmt: skip
    lab = Image.fromarray(samples("u1", 3), "LAB")
    cases.append(Case("pillow-lab.tif", lambda path: lab.save(path), None, "kind CIELAB"))
    return cases
