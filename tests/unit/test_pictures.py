"""Reading pictures: values, depths, colours, and what is refused."""

import hashlib
import logging
import struct
import tracemalloc
import zlib

import cv2
import imageio.v3 as iio
import numpy as np
import pytest
import tifffile
from PIL import Image

from keystab.errors import InputError
from keystab.io.pictures import picture_shape, pixel_digest, read_picture, write_picture
from keystab.utils import memory

LEVELS = np.array([[0, 51, 102], [153, 204, 255]], dtype=np.uint8)
COLOUR = np.random.default_rng(0).integers(0, 256, (5, 4, 3), dtype=np.uint8)
COLOUR_GREY = (0.299 * COLOUR[..., 0] + 0.587 * COLOUR[..., 1] + 0.114 * COLOUR[..., 2]) / 255


@pytest.mark.parametrize(
    ("name", "samples", "expected"),
    [
        ("grey8.png", LEVELS, LEVELS / 255),
        ("grey16.png", LEVELS.astype(np.uint16) * 257, LEVELS / 255),
        ("grey8.tif", LEVELS, LEVELS / 255),
        ("grey16.tif", LEVELS.astype(np.uint16) * 257, LEVELS / 255),
        ("grey32.tif", LEVELS.astype(np.uint32) * 16843009, LEVELS / 255),
        ("single.tif", np.float32([[0.25, -1.5], [3.0, 0.5]]), [[0.25, -1.5], [3.0, 0.5]]),
        ("colour.png", COLOUR, COLOUR_GREY),
        ("colour.tif", COLOUR, COLOUR_GREY),
        ("colour16.tif", COLOUR.astype(np.uint16) * 257, COLOUR_GREY),
        ("array.npy", np.float64([[0.1, 0.7]]), [[0.1, 0.7]]),
        ("array_colour.npy", COLOUR / 255, COLOUR_GREY),
        ("switches.npy", np.array([[True, False]]), [[1.0, 0.0]]),
    ],
)
def test_values_of_every_depth(tmp_path, name, samples, expected):
    path = tmp_path / name
    if path.suffix == ".npy":
        np.save(path, samples)
    elif path.suffix == ".tif":
        kind = "rgb" if np.ndim(samples) == 3 else "minisblack"
        tifffile.imwrite(path, samples, photometric=kind)
    else:
        iio.imwrite(path, samples)
    u = read_picture(path)
    assert u.dtype == np.float64
    np.testing.assert_allclose(u, expected, rtol=0, atol=1e-15)


def test_alpha_is_ignored(tmp_path):
    alpha = np.arange(20, dtype=np.uint8).reshape(5, 4, 1)
    iio.imwrite(tmp_path / "a.png", np.concatenate([COLOUR, alpha], axis=-1))
    np.testing.assert_allclose(read_picture(tmp_path / "a.png"), COLOUR_GREY, rtol=0, atol=1e-15)
    Image.fromarray(np.stack([LEVELS, LEVELS // 2], axis=-1), "LA").save(tmp_path / "la.png")
    np.testing.assert_array_equal(read_picture(tmp_path / "la.png"), LEVELS / 255)


@pytest.mark.parametrize("mode", ["P", "1", "CMYK"])
def test_palettes_bits_and_inks_become_grey(tmp_path, mode):
    black_and_white = Image.fromarray(np.uint8([[0, 255, 0], [255, 255, 0]])).convert("RGB")
    path = tmp_path / ("picture.tif" if mode == "CMYK" else "picture.png")
    black_and_white.convert(mode).save(path)
    np.testing.assert_allclose(read_picture(path), [[0, 1, 0], [1, 1, 0]], rtol=0, atol=1e-15)


def test_jpeg_is_read(tmp_path):
    flat = np.full((16, 16), 128, dtype=np.uint8)
    iio.imwrite(tmp_path / "flat.jpg", flat)
    np.testing.assert_allclose(read_picture(tmp_path / "flat.jpg"), 128 / 255, rtol=0, atol=1 / 255)


def test_tiff_varieties(tmp_path):
    tifffile.imwrite(tmp_path / "white0.tif", LEVELS, photometric="miniswhite")
    np.testing.assert_array_equal(read_picture(tmp_path / "white0.tif"), (255 - LEVELS) / 255)
    tifffile.imwrite(
        tmp_path / "planes.tif", np.moveaxis(COLOUR, -1, 0), photometric="rgb", planarconfig=2
    )
    np.testing.assert_allclose(
        read_picture(tmp_path / "planes.tif"), COLOUR_GREY, rtol=0, atol=1e-15
    )
    bits = LEVELS > 100
    tifffile.imwrite(tmp_path / "bits.tif", bits, photometric="miniswhite")
    np.testing.assert_array_equal(read_picture(tmp_path / "bits.tif"), ~bits)
    with tifffile.TiffWriter(tmp_path / "preview.tif") as tiff:
        tiff.write(LEVELS, photometric="minisblack")
        tiff.write(LEVELS[::2, ::2], photometric="minisblack", subfiletype=1)
    np.testing.assert_array_equal(read_picture(tmp_path / "preview.tif"), LEVELS / 255)
    Image.fromarray(COLOUR).save(tmp_path / "lzw.tif", compression="tiff_lzw")
    np.testing.assert_allclose(read_picture(tmp_path / "lzw.tif"), COLOUR_GREY, rtol=0, atol=1e-15)


@pytest.mark.parametrize(
    ("suffix", "tolerance"), [(".png", 0.5 / 65535), (".tiff", 1e-7), (".npy", 0.0)]
)
def test_round_trip(tmp_path, suffix, tolerance):
    u = np.random.default_rng(1).random((6, 9))
    path = tmp_path / "new folder" / f"u{suffix}"
    write_picture(u, path)
    np.testing.assert_allclose(read_picture(path), u, rtol=0, atol=tolerance)
    assert [p.name for p in path.parent.iterdir()] == [path.name]  # no temporary file stays


def test_png_clips(tmp_path):
    write_picture(np.array([[-0.3, 1.7]]), tmp_path / "u.png")
    np.testing.assert_array_equal(read_picture(tmp_path / "u.png"), [[0.0, 1.0]])


def test_digest_is_that_of_the_pixel_bytes(tmp_path):
    expected = hashlib.sha256(bytes([0, 51, 102, 153, 204, 255])).hexdigest()
    iio.imwrite(tmp_path / "a.png", LEVELS)
    tifffile.imwrite(tmp_path / "b.tif", LEVELS)
    assert pixel_digest(tmp_path / "a.png") == pixel_digest(tmp_path / "b.tif") == expected
    words = np.array([[1, 258]], dtype=np.uint16)
    tifffile.imwrite(tmp_path / "big.tif", words, byteorder=">")
    little = hashlib.sha256(bytes([1, 0, 2, 1])).hexdigest()
    assert pixel_digest(tmp_path / "big.tif") == little


NO_FORMAT = "its content is none of PNG, JPEG, TIFF and .npy"


def animate(path):
    frames = [Image.fromarray(LEVELS), Image.fromarray(255 - LEVELS)]
    frames[0].save(path, save_all=True, append_images=frames[1:])


def write_pages(path):
    with tifffile.TiffWriter(path) as tiff:
        for size in (8, 6):  # no stack: the pages differ in size
            tiff.write(np.zeros((size, size), np.uint8), photometric="minisblack")


def refuse_16_bit_colour(path):
    """A PNG header that promises colour at 16 bits; the decoder never gets to see it."""
    path.write_bytes(
        b"\x89PNG\r\n\x1a\n"
        + bytes([0, 0, 0, 13])
        + b"IHDR"
        + bytes([0, 0, 0, 1, 0, 0, 0, 1, 16, 2, 0, 0, 0])
    )


@pytest.mark.parametrize(
    ("name", "make", "words"),
    [
        ("gone.png", lambda p: None, "no such file"),
        ("folder.png", lambda p: p.mkdir(), "is a folder; give the path"),
        ("text.png", lambda p: p.write_text("hello"), NO_FORMAT),
        ("empty.png", lambda p: p.write_bytes(b""), NO_FORMAT),
        ("cut.png", lambda p: cut(p), "not a readable picture"),
        ("cut.tif", lambda p: p.write_bytes(b"II*\0\x08\0"), "not a readable picture"),
        ("deep.png", refuse_16_bit_colour, "16 bits per channel"),
        ("nan.npy", lambda p: np.save(p, np.array([[0.0, np.nan], [np.inf, 1]])), "2 of 4 pixels"),
        ("signed.npy", lambda p: np.save(p, np.zeros((2, 2), dtype=np.int16)), "int16"),
        ("none.npy", lambda p: np.save(p, np.zeros((0, 5))), "no pixels"),
        ("line.npy", lambda p: np.save(p, np.zeros(5)), "shape (5,)"),
        ("bands.npy", lambda p: np.save(p, np.zeros((5, 5, 7))), "shape (5, 5, 7)"),
        ("objects.npy", lambda p: np.save(p, np.array([[None]]), allow_pickle=True), "not a"),
        (
            "pages.tif",
            lambda p: tifffile.imwrite(p, np.zeros((3, 8, 8), np.uint8), photometric="minisblack"),
            "3 pictures",
        ),
        ("sizes.tif", write_pages, "the TIFF holds 2 pictures"),
        (
            "stack.tif",
            lambda p: tifffile.imwrite(p, np.zeros((3, 8, 8), np.uint8), imagej=True),
            "the TIFF holds 3 pictures",
        ),
        ("moving.gif", animate, "the GIF file holds 2 pictures"),
        ("moving.png", animate, "the PNG file holds 2 pictures"),
        (
            "inverse.tif",
            lambda p: tifffile.imwrite(p, np.float32(LEVELS), photometric="miniswhite"),
            "0 is white (MINISWHITE)",
        ),
    ],
)
def test_what_cannot_be_read_gets_one_line(tmp_path, name, make, words):
    path = tmp_path / name
    make(path)
    with pytest.raises(InputError) as raised:
        read_picture(path)
    message = str(raised.value)
    assert message.startswith(str(path))
    assert words in message
    assert "\n" not in message


def cut(path):
    iio.imwrite(path, np.random.default_rng(0).integers(0, 255, (64, 64), dtype=np.uint8))
    path.write_bytes(path.read_bytes()[:2000])


def test_unknown_suffix_is_refused(tmp_path):
    with pytest.raises(InputError, match=r"cannot write '\.bmp'"):
        write_picture(np.zeros((2, 2)), tmp_path / "u.bmp")
    assert list(tmp_path.iterdir()) == []


def test_a_jpeg_with_previews_is_one_picture(tmp_path):
    flat, preview = (Image.fromarray(np.full((16, 16), v, np.uint8)) for v in (128, 0))
    flat.save(tmp_path / "phone.jpg", "MPO", save_all=True, append_images=[preview])
    assert picture_shape(tmp_path / "phone.jpg") == (16, 16)
    np.testing.assert_allclose(read_picture(tmp_path / "phone.jpg"), 128 / 255, atol=1 / 255)


@pytest.mark.parametrize("suffix", [".png", ".tif", ".npy"])
@pytest.mark.parametrize("disguise", [".png", ".tif", ".npy", ""])
def test_content_and_not_the_suffix_decides(tmp_path, suffix, disguise):
    u = np.linspace(0, 1, 54).reshape(6, 9)
    write_picture(u, tmp_path / f"u{suffix}")
    path = (tmp_path / f"u{suffix}").rename(tmp_path / f"picture{disguise}")
    assert picture_shape(path) == (6, 9)
    np.testing.assert_allclose(read_picture(path), u, atol=1e-5)


def test_shape_of_colour_and_what_has_none(tmp_path):
    np.save(tmp_path / "colour.npy", COLOUR)
    assert picture_shape(tmp_path / "colour.npy") == (5, 4)
    tifffile.imwrite(
        tmp_path / "planes.tif", np.moveaxis(COLOUR, -1, 0), photometric="rgb", planarconfig=2
    )
    assert picture_shape(tmp_path / "planes.tif") == (5, 4)
    np.save(tmp_path / "line.npy", np.zeros(5))
    write_pages(tmp_path / "pages.tif")
    animate(tmp_path / "moving.gif")
    (tmp_path / "text.tif").write_text("hello")
    for name, words in (
        ("line.npy", "shape (5,)"),
        ("pages.tif", "2 pictures"),
        ("moving.gif", "2 pictures"),
        ("text.tif", NO_FORMAT),
        ("gone.png", "no such file; give the path of a PNG, JPEG, TIFF or .npy picture"),
        ("", "is a folder; give the path of a PNG, JPEG, TIFF or .npy picture"),
    ):
        with pytest.raises(InputError) as raised:
            picture_shape(tmp_path / name)
        assert words in str(raised.value)


@pytest.mark.parametrize("suffix", [".png", ".tif", ".npy"])
@pytest.mark.parametrize(
    ("u", "words"),
    [
        ([[0.0, np.nan]], "1 of 2 pixels is NaN"),
        ([[np.inf, -np.inf]], "2 of 2 pixels are NaN or infinite"),
        (np.zeros((2, 2, 3)), "shape (2, 2, 3)"),
        (np.zeros((0, 2)), "shape (0, 2)"),
        ([[1j]], "complex128"),
        ([["black"]], "<U5"),
    ],
)
def test_what_is_no_grey_picture_is_not_written(tmp_path, suffix, u, words):
    with pytest.raises(InputError) as raised:
        write_picture(u, tmp_path / f"u{suffix}")
    assert words in str(raised.value)
    assert list(tmp_path.iterdir()) == []


def test_a_picture_never_replaces_a_folder(tmp_path):
    path = tmp_path / "u.npy"
    path.mkdir()
    (path / "precious").write_text("kept")
    with pytest.raises(InputError, match=r"u\.npy is a folder; give a file name"):
        write_picture(LEVELS / 255, path)
    assert (path / "precious").read_text() == "kept"


def png_of(height, width):
    """Grey PNG that promises many pixels and holds next to nothing."""
    head = struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)
    chunks = ((b"IHDR", head), (b"IDAT", zlib.compress(bytes(9))), (b"IEND", b""))
    return b"\x89PNG\r\n\x1a\n" + b"".join(
        struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))
        for name, data in chunks
    )


def tiff_of(height, width):
    """TIFF that promises many pixels in one small strip."""
    tags = {256: width, 257: height, 258: 8, 259: 8, 262: 1, 273: 8, 277: 1, 278: height, 279: 9}
    body = b"".join(struct.pack("<HHII", tag, 4, 1, value) for tag, value in tags.items())
    return struct.pack("<2sHI", b"II", 42, 8) + struct.pack("<H", len(tags)) + body + bytes(13)


def test_large_pictures_are_judged_by_what_they_need(tmp_path, monkeypatch):
    small = np.zeros((40, 50), np.uint8)
    files = {"jpeg.jpg": iio.imwrite, "png.png": iio.imwrite, "tiff.tif": tifffile.imwrite}
    files |= {"npy.npy": np.save, "webp.webp": iio.imwrite, "gif.gif": iio.imwrite}
    files["pgm.pgm"] = lambda path, v: path.write_bytes(b"P5 50 40 255 " + v.tobytes())
    files["lzw.tif"] = lambda path, v: Image.fromarray(v).save(path, compression="tiff_lzw")
    monkeypatch.setattr(Image, "MAX_IMAGE_PIXELS", 100)  # more than ten times over it
    for name, write in files.items():
        write(tmp_path / name, small)
        assert read_picture(tmp_path / name).shape == (40, 50), name
        assert Image.MAX_IMAGE_PIXELS == 100
    monkeypatch.setattr(memory, "available", lambda: 30_000)
    for name in files:
        assert picture_shape(tmp_path / name) == (40, 50), name
        with pytest.raises(InputError, match="40 x 50 pixels needs about .* of memory") as raised:
            read_picture(tmp_path / name)
        assert name in str(raised.value) and "\n" not in str(raised.value)


@pytest.mark.parametrize(
    ("name", "data"),
    [
        ("bomb.png", png_of),
        ("bomb.tif", tiff_of),
        ("bomb.pgm", lambda h, w: b"P5 %d %d 255 " % (w, h)),
    ],
)
def test_bombs_are_refused_by_their_size_and_measured_without_it(tmp_path, name, data, monkeypatch):
    path = tmp_path / name
    path.write_bytes(data(14_000, 14_001))
    assert picture_shape(path) == (14_000, 14_001)  # nothing is decoded
    monkeypatch.setattr(memory, "available", lambda: 3 * 10**9)
    with pytest.raises(InputError, match=r"14000 x 14001 pixels needs about 3\.53 GB of memory"):
        read_picture(path)


@pytest.mark.parametrize("kind", ["colours.tif", "floats.tif", "odd.ppm", "grey.npy"])
def test_the_estimate_of_memory_bounds_what_is_taken(tmp_path, monkeypatch, kind):
    path = tmp_path / kind
    values = np.random.default_rng(0).integers(0, 65535, (700, 900, 3), np.uint16)
    if kind == "floats.tif":
        cv2.imwrite(str(path), values.astype(np.float32))
    elif kind == "grey.npy":
        np.save(path, values[..., 0])
    else:
        cv2.imwrite(str(path), values)
    read_picture(path)  # what is imported does not count
    estimates = []
    monkeypatch.setattr(memory, "require", lambda n_bytes, *_: estimates.append(n_bytes))
    tracemalloc.start()
    try:
        read_picture(path)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert 0.3 < peak / estimates[0] < 1


def test_an_orientation_changes_shape_and_digest_as_turning_does(tmp_path):
    exif = Image.Exif()
    exif[274] = 6
    picture = Image.fromarray(COLOUR)
    picture.save(tmp_path / "turned.png", exif=exif)
    picture.save(tmp_path / "turned.tif", exif=exif, compression="tiff_lzw")
    Image.fromarray(np.rot90(COLOUR, -1)).save(tmp_path / "upright.png")
    for name in ("turned.png", "turned.tif"):
        assert picture_shape(tmp_path / name) == (4, 5)
        assert pixel_digest(tmp_path / name) == pixel_digest(tmp_path / "upright.png")


def test_damaged_metadata_do_not_make_a_picture_unreadable(tmp_path):
    Image.fromarray(COLOUR).save(tmp_path / "u.png", exif=b"Exif\0\0II*\0\xff\xff\xff\xff")
    np.testing.assert_allclose(read_picture(tmp_path / "u.png"), COLOUR_GREY, rtol=0, atol=1e-15)


def test_what_tifffile_has_to_say_of_a_file_is_kept_to_one_line(tmp_path, caplog):
    path = tmp_path / "u.tif"
    tifffile.imwrite(path, LEVELS, compression="zlib", photometric="minisblack")
    with tifffile.TiffFile(path, mode="r+") as tiff:
        tiff.pages[0].tags["StripByteCounts"].overwrite((10, 10))
    caplog.clear()
    with pytest.raises(InputError, match="not a readable picture|lacks a part"):
        read_picture(path)
    assert [record for record in caplog.records if record.name == "tifffile"] == []
    assert not logging.getLogger("tifffile").disabled
