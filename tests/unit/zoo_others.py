"""PNM, PNG, JPEG, GIF, WebP, BMP and npy files, and every orientation."""

from __future__ import annotations

import itertools
import struct
import zlib

import cv2
import imageio.v3 as iio
import numpy as np
import tifffile
from PIL import Image, ImageOps
from zoo_base import (
    HEIGHT,
    WIDTH,
    Case,
    grey_of,
    packed,
    samples,
    seen_by_opencv,
    smooth_colours,
)


def netpbm() -> list[Case]:
    """PBM, PGM, PPM, PAM and PFM, in digits and in bytes."""
    cases = []

    def add(name, data, grey=None, words="", **kind):
        cases.append(Case(name, lambda path: path.write_bytes(data), grey, words, **kind))

    size = f"{WIDTH} {HEIGHT}"
    for maxval, channels in itertools.product((1, 15, 100, 255, 256, 1023, 4095, 65535), (1, 3)):
        values = np.random.default_rng(maxval).integers(
            0, maxval, (HEIGHT, WIDTH, channels), np.uint16, endpoint=True
        )
        grey = grey_of(values, maxval)
        name = f"{'pgm' if channels == 1 else 'ppm'}-{maxval}"
        data = values.astype("u1" if maxval < 256 else ">u2").tobytes()
        magic = {1: (b"P2", b"P5"), 3: (b"P3", b"P6")}[channels]
        add(f"{name}.pnm", b"%s\n# a comment\n%s # one more\n%d\n%s"
            % (magic[1], size.encode(), maxval, data), grey)  # fmt: skip
        digits = " ".join(map(str, values.ravel())).replace(" ", "\n", 9)
        add(f"{name}-plain.pnm", b"%s %s %d\n# so\n%s" % (magic[0], size.encode(), maxval,
            digits.encode()), grey)  # fmt: skip
        kind = "GRAYSCALE" if channels == 1 else "RGB"
        for alpha in (0, 1):
            stored = np.dstack([values, values[..., :alpha]])
            head = (f"P7\n#c\nWIDTH {WIDTH}\nHEIGHT {HEIGHT}\nDEPTH {channels + alpha}\n"
                    f"MAXVAL {maxval}\nTUPLTYPE {kind}{'_ALPHA' * alpha}\nENDHDR\n")  # fmt: skip
            data = stored.astype("u1" if maxval < 256 else ">u2").tobytes()
            add(f"{name}-{alpha}.pam", head.encode() + data, grey)
    ink = samples("?")
    add(
        "bits.pbm",
        b"P4 %s\n" % size.encode() + np.packbits(ink, axis=1).tobytes(),
        1 - grey_of(ink),
    )
    digits = "".join(str(int(v)) for v in ink.ravel())
    add("bits-plain.pbm", f"P1\n{size}\n{digits}\n".encode(), 1 - grey_of(ink))
    for channels, order in itertools.product((1, 3), "<>"):
        values = samples("f4", channels)
        head = f"{'Pf' if channels == 1 else 'PF'}\n{size}\n{'-' * (order == '<')}1.0\n"
        add(f"floats{channels}-{'little' if order == '<' else 'big'}.pfm",
            head.encode() + values[::-1].astype(f"{order}f4").tobytes(), grey_of(values))  # fmt: skip
    values = samples("u1")
    head = b"P5 %s 255\n" % size.encode()
    for name, data, words in (
        ("scaled.pfm", b"Pf %s 2.5\n" % size.encode() + bytes(4 * values.size), "PFM has the scale 2.5"),
        ("short.pgm", head + values.tobytes()[:-1], "damaged PNM"),
        ("long.pgm", head + values.tobytes() + b"more", "damaged PNM"),
        ("two.pgm", 2 * (head + values.tobytes()), "damaged PNM"),
        ("beyond.pgm", head.replace(b"255", b"200") + values.tobytes(), "a sample is 255, beyond"),
        ("huge.pgm", head.replace(b"255", b"65536") + values.tobytes(), "largest sample of the PNM"),
        ("zero.pgm", head.replace(b"255", b"0") + values.tobytes(), "largest sample of the PNM"),
        ("headless.pgm", b"P5 37", "damaged PNM"),
        ("comment.pgm", b"P5 37 # 23 255", "damaged PNM"),
        ("negative.pgm", b"P2 2 1 255 -1 3", "damaged PNM"),
        ("word.pgm", b"P2 2 1 255 1 x", "damaged PNM"),
        ("few.pgm", b"P2 2 2 255 1 2 3", "3 samples instead of 4"),
        ("digit.pbm", b"P1 2 2 1012", "damaged PNM"),
        ("large.ppm", b"P3 1 1 255 1 2 70000", "damaged PNM"),
        ("empty.pgm", b"P5 0 3 255\n", "no pixels"),
        ("cmyk.pam", b"P7\nWIDTH 1\nHEIGHT 1\nDEPTH 4\nMAXVAL 255\nTUPLTYPE CMYK\nENDHDR\n1234",
         "PAM has tuples of 4"),
        ("short.pam", b"P7\nWIDTH 1\nHEIGHT 1\n", "damaged PNM"),
    ):  # fmt: skip
        add(name, data, None, words)
    for dtype, channels, name in itertools.product(("u1", "u2"), (1, 3), ("pgm", "ppm", "pam")):
        if (channels, name) in ((3, "pgm"), (1, "ppm")):
            continue
        values = samples(dtype, channels)
        stored = values if channels == 1 else values[..., ::-1]
        nameless = name == "pam"  # OpenCV writes blue first, and nothing that says so
        cases.append(Case(f"opencv-{dtype}x{channels}.{name}",
                          lambda path, v=stored: cv2.imwrite(str(path), v),
                          None if nameless and channels == 3 else grey_of(values),
                          "PAM has tuples of 3"))  # fmt: skip
    values = samples("f4", 3)
    cases.append(Case("opencv.pfm", lambda path: cv2.imwrite(str(path), values[..., ::-1]),
                      grey_of(values)))  # fmt: skip
    return cases


def png(values: np.ndarray, bits: int, colour_type: int, palette: bytes = b"") -> bytes:
    """PNG without filters, written by hand."""

    def chunk(name, data):
        return (
            struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))
        )

    rows = packed(values, bits) if bits < 16 else [row.astype(">u2").tobytes() for row in values]
    head = struct.pack(">IIBBBBB", WIDTH, HEIGHT, bits, colour_type, 0, 0, 0)
    body = chunk(b"IHDR", head) + (chunk(b"PLTE", palette) if palette else b"")
    body += chunk(b"IDAT", zlib.compress(b"".join(b"\0" + row for row in rows)))
    return b"\x89PNG\r\n\x1a\n" + body + chunk(b"IEND", b"")


def others() -> list[Case]:
    """All else."""
    cases = []
    for bits in (1, 2, 4, 8, 16):
        values = samples("u2", 1, bits)
        cases.append(Case(f"grey{bits}.png", lambda path, v=values, b=bits: path.write_bytes(
            png(v, b, 0)), grey_of(values, 2.0**bits - 1), tolerance=1e-15))  # fmt: skip
        if bits < 16:
            palette = np.random.default_rng(bits).integers(0, 256, (2**bits, 3), np.uint8)
            cases.append(Case(f"palette{bits}.png", lambda path, v=values, b=bits, p=palette:
                              path.write_bytes(png(v, b, 3, p.tobytes())),
                              grey_of(palette[values])))  # fmt: skip
    for channels, kind in ((2, 4), (3, 2), (4, 6)):
        values = samples("u1", channels)
        cases.append(Case(f"{channels}x8.png", lambda path, v=values, k=kind: path.write_bytes(
            png(v, 8, k)), grey_of(values)))  # fmt: skip
        deep = samples("u2", channels)
        cases.append(Case(f"{channels}x16.png", lambda path, v=deep, k=kind: path.write_bytes(
            png(v, 16, k)), None, "PNG with colour or alpha and 16 bits"))  # fmt: skip
    for dtype, channels in (("u1", 1), ("u2", 1), ("u1", 3), ("u1", 4), ("u2", 3), ("u2", 4)):
        values = samples(dtype, channels)
        stored = values if channels == 1 else values[..., [2, 1, 0, 3][:channels]]
        refused = dtype == "u2" and channels > 1
        cases.append(Case(f"opencv-{dtype}x{channels}.png",
                          lambda path, v=stored: cv2.imwrite(str(path), v),
                          None if refused else grey_of(values),
                          "16 bits per channel" if refused else ""))  # fmt: skip
        if dtype == "u1" or channels == 1:
            cases.append(Case(f"imageio-{dtype}x{channels}.png",
                              lambda path, v=values: iio.imwrite(path, v), grey_of(values)))  # fmt: skip
    for dtype in ("?", "u1", "u2", "u4", "u8", "f2", "f4", "f8"):
        for channels, order in itertools.product((1, 2, 3, 4), "<>"):
            values = samples(dtype, channels)
            cases.append(Case(f"{dtype.strip('?') or 'bool'}x{channels}-{ord(order)}.npy",
                              lambda path, v=values, o=order: np.save(path, v.astype(v.dtype.newbyteorder(o))),
                              grey_of(values)))  # fmt: skip
    for dtype in ("i1", "i2", "i4", "i8", "c8", "S3", "M8[s]"):
        cases.append(Case(f"{dtype[:2]}.npy", lambda path, d=dtype: np.save(path, np.zeros((3, 4), d)),
                          None, "have no agreed white"))  # fmt: skip
    grey, colour, alpha = samples("u1"), samples("u1", 3), samples("u1", 4)
    rgb = Image.fromarray(colour)
    for suffix, values in (("bmp", grey), ("bmp", colour), ("bmp", alpha)):
        cases.append(Case(f"pillow-{values.ndim}-{values.size}.{suffix}",
                          lambda path, v=values: Image.fromarray(v).save(path), grey_of(values)))  # fmt: skip
    cases.append(Case("bits.bmp", lambda path: Image.fromarray(samples("?")).save(path),
                      grey_of(samples("?"))))  # fmt: skip
    colours = np.random.default_rng(3).integers(0, 256, (256, 3), np.uint8)
    for suffix, values in (("gif", grey), ("gif", None)):

        def write_gif(path, grey_=values is grey):
            picture = Image.fromarray(grey, "L" if grey_ else "P")
            if not grey_:
                picture.putpalette(colours.tobytes())
            picture.save(path)

        cases.append(Case(f"{'grey' if values is grey else 'colours'}.{suffix}", write_gif,
                          grey_of(grey if values is grey else colours[grey])))  # fmt: skip
    for values in (colour, alpha):
        cases.append(Case(f"lossless{values.shape[2]}.webp", lambda path, v=values: Image.fromarray(v).save(
            path, lossless=True, exact=True), grey_of(values)))  # fmt: skip
    for name, words, save in (
        ("tga", "TGA", {}), ("jp2", "JPEG2000", {}), ("sgi", "SGI", {}), ("pcx", "PCX", {}),
        ("ico", "ICO", {}), ("dds", "DDS", {}), ("avif", "AVIF", {}), ("qoi", "QOI", {}),
        ("icns", "ICNS", {}),
    ):  # fmt: skip
        cases.append(Case(f"pillow.{name}", lambda path, s=save: rgb.save(path, **s), None,
                          f"pictures of the format {words} are not read"))  # fmt: skip
    deep = samples("u2")
    flags = [cv2.IMWRITE_JPEG2000_COMPRESSION_X1000, 1000]
    wide = np.tile(deep, (8, 8))
    cases.append(
        Case("deep.jp2", lambda path: cv2.imwrite(str(path), wide, flags), None, "JPEG2000")
    )
    for name, (depth, words) in {"565": (16, "BMP of 16 bits")}.items():
        head = struct.pack("<2sIHHI", b"BM", 54 + 2 * 40 * HEIGHT, 0, 0, 54)
        head += struct.pack("<IiiHHIIiiII", 40, WIDTH, HEIGHT, 1, depth, 0, 0, 0, 0, 0, 0)
        cases.append(Case(f"{name}.bmp", lambda path, h=head: path.write_bytes(
            h + bytes(2 * 38 * HEIGHT)), None, words))  # fmt: skip
    smooth = smooth_colours()
    for mode in ("L", "RGB", "CMYK"):
        cases.append(Case(f"{mode}.jpg", lambda path, m=mode: Image.fromarray(smooth).convert(m).save(
            path, quality=95), seen_by_opencv, tolerance=1.5 / 255 if mode == "CMYK" else 1e-12))  # fmt: skip
    jpeg12 = bytes.fromhex("ffd8ffc1000b0c00170025010111 00".replace(" ", "")) + bytes(20)
    cases.append(Case("12bits.jpg", lambda path: path.write_bytes(jpeg12), None, "JPEG"))
    return cases


def turned() -> list[Case]:
    """Every orientation in every container that can hold one."""
    cases = []
    smooth = smooth_colours()
    grey = grey_of(smooth)
    views = {1: grey, 2: grey[:, ::-1], 3: grey[::-1, ::-1], 4: grey[::-1], 5: grey.T,
             6: np.rot90(grey, -1), 7: np.rot90(grey, 2).T, 8: np.rot90(grey)}  # fmt: skip
    picture, deep = Image.fromarray(smooth), samples("u2")
    for k, expected in views.items():
        exif = Image.Exif()
        exif[274] = k
        for name, options in {
            "jpeg.jpg": {"quality": 95},
            "png.png": {},
            "webp.webp": {"lossless": True},
            "none.tif": {},
            "lzw.tif": {"compression": "tiff_lzw"},
            "jpeg.tif": {"compression": "jpeg", "quality": 95},
        }.items():
            if name.endswith("tif"):
                options = options | {"tiffinfo": {274: k}}
            else:
                options = options | {"exif": exif}
            cases.append(Case(f"turned{k}-{name}", lambda path, o=options: picture.save(path, **o),
                              expected, tolerance=0.02 if "jp" in name else 0.0))  # fmt: skip
        data = png(smooth, 8, 2)
        late = exif.tobytes().removeprefix(b"Exif\0\0")
        late = (
            struct.pack(">I", len(late))
            + b"eXIf"
            + late
            + struct.pack(">I", zlib.crc32(b"eXIf" + late))
        )
        cases.append(Case(f"turned{k}-late.png", lambda path, d=data, late=late: path.write_bytes(
            d[:-12] + late + d[-12:]), expected))  # fmt: skip
        xmp = f'<x tiff:Orientation="{k}"/>'.encode()
        cases.append(Case(f"turned{k}-xmp.tif", lambda path, x=xmp: tifffile.imwrite(
            path, deep, photometric="minisblack", extratags=[(700, 1, len(x), x, True)]),
            turn(grey_of(deep), k)))  # fmt: skip
        cases.append(Case(f"turned{k}-deep.tif", lambda path, k=k: tifffile.imwrite(
            path, deep, photometric="miniswhite", extratags=[(274, 3, 1, k, True)]),
            turn(1 - grey_of(deep), k), tolerance=1e-15))  # fmt: skip
    return cases


def turn(grey: np.ndarray, orientation: int) -> np.ndarray:
    """What Pillow makes of an orientation."""
    index = np.arange(grey.size, dtype=np.float32).reshape(grey.shape)
    picture = Image.fromarray(index)
    picture.getexif()[274] = orientation
    return grey.ravel()[np.asarray(ImageOps.exif_transpose(picture)).astype(int)]
