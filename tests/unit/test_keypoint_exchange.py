"""Keypoints of other programs: their bytes by hand, round trips, the programs where installed."""

from __future__ import annotations

import sqlite3
import struct
from contextlib import closing

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from keystab.errors import InputError
from keystab.io.keypoint_conventions import (
    SCALES,
    Convention,
    from_lafs,
    from_opencv,
    to_lafs,
    to_opencv,
)
from keystab.io.keypoint_files import KEYPOINT_FORMATS, read_keypoints, write_keypoints

DRAW = np.random.default_rng(1)
KEYPOINTS = pd.DataFrame(
    {
        "y": DRAW.uniform(0, 300, 40),
        "x": DRAW.uniform(0, 500, 40),
        "sigma": DRAW.uniform(0.8, 20, 40),
        "angle": DRAW.uniform(-3, 3, 40),
    }
)
TEXTS = {
    # x = 10.5, y = 4.5 from the corner of the picture; sigma 1.5; a quarter turn
    "colmap": "1 128\n10.5 4.5 1.5 1.5707963267948966" + 128 * " 0" + "\n",
    # a circle: a = c = 1 / 1.5^2
    "oxford": "1.0\n1\n10.0 4.0 0.4444444444444444 0.0 0.4444444444444444\n",
    "vlfeat": "10.0 4.0 1.5 1.5707963267948966\n",
}
ONE = pd.DataFrame({"y": [4.0], "x": [10.0], "sigma": [1.5], "angle": [np.pi / 2]})


@pytest.fixture
def database(tmp_path):
    """A database as COLMAP makes it, of two images, as far as keypoints are concerned."""
    path = tmp_path / "colmap.db"
    with closing(sqlite3.connect(path)) as made, made:
        made.execute("CREATE TABLE images (image_id INTEGER PRIMARY KEY, name TEXT UNIQUE)")
        made.execute(
            "CREATE TABLE keypoints (image_id INTEGER PRIMARY KEY NOT NULL, rows INTEGER NOT NULL, "
            "cols INTEGER NOT NULL, data BLOB)"
        )
        made.executemany("INSERT INTO images VALUES (?, ?)", [(3, "left.png"), (7, "right.png")])
    return path


def put(path, image, n_columns, *numbers):
    data = struct.pack(f"<{len(numbers)}f", *numbers)
    with closing(sqlite3.connect(path)) as made, made:
        row = (image, len(numbers) // n_columns, n_columns, data)
        made.execute("INSERT INTO keypoints VALUES (?, ?, ?, ?)", row)


# Conventions


@given(
    st.floats(-2, 2),
    st.sampled_from(["yx", "xy"]),
    st.sampled_from([*SCALES, 6.0, 3 * 3**0.5]),
)
def test_what_a_convention_says_is_undone_by_its_inverse(origin, order, scale):
    convention = Convention(origin, order, scale)
    back = convention.table(*convention.columns(KEYPOINTS))
    np.testing.assert_allclose(back, KEYPOINTS[["y", "x", "sigma"]], atol=1e-12)


def test_the_centre_of_the_first_pixel_is_the_origin():
    for origin in (0.0, 0.5, 1.0):
        table = Convention(origin, "xy", "diameter").table([origin + 1], [origin], [2.0])
        assert table.to_numpy().tolist() == [[0.0, 1.0, 1.0]]  # one pixel to the right


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ({"origin": "corner"}, "origin is 'corner'"),
        ({"origin": float("nan")}, "origin is nan"),
        ({"order": "xx"}, "order is 'xx'; give yx or xy"),
        ({"scale": "big"}, "give sigma, radius, diameter or how many times"),
        ({"scale": 0}, "scale is 0"),
        ({"scale": None}, "scale is None"),
    ],
)
def test_unknown_conventions_are_refused(arguments, said):
    with pytest.raises(InputError, match=said):
        Convention(**arguments)


@pytest.mark.parametrize(
    ("columns", "said"),
    [
        (([1.0], [1.0, 2.0], [1.0]), "1 y, 2 x, 1 sigma; give as many of each"),
        (([1.0], [np.nan], [1.0]), "x is nan in row 0"),
        (([1.0], [1.0], [-2.0]), "a scale is -2"),
        ((["a"], [1.0], [1.0]), "y holds something else than numbers"),
        (([[1.0]], [1.0], [1.0]), "y has the shape"),
    ],
)
def test_keypoints_that_are_none_are_refused(columns, said):
    with pytest.raises(InputError, match=said):
        Convention().table(*columns)


# OpenCV and kornia


def test_opencv_gives_back_what_it_was_given():
    cv2 = pytest.importorskip("cv2")
    keypoints = KEYPOINTS.assign(value=DRAW.uniform(0, 1, len(KEYPOINTS)))
    keypoints.loc[0, "angle"] = np.nan
    made = to_opencv(keypoints)
    assert isinstance(made[0], cv2.KeyPoint) and made[0].angle == -1
    back = from_opencv(made)
    turned = (back["angle"] - keypoints["angle"]) / (2 * np.pi)
    assert np.nanmax(np.abs(turned - np.round(turned))) < 1e-6
    assert np.isnan(back["angle"]).tolist() == np.isnan(keypoints["angle"]).tolist()
    names = ["y", "x", "sigma", "value"]
    np.testing.assert_allclose(back[names], keypoints[names], rtol=1e-6)


def test_a_blob_lies_where_opencv_says_and_has_the_scale_that_it_says():
    # With precise upscaling, which has no bias: at its centre, at s / sqrt(kappa).
    cv2 = pytest.importorskip("cv2")
    y, x = np.mgrid[:64, :80]
    blob = np.exp(-((y - 30.25) ** 2 + (x - 40.5) ** 2) / (2 * (5.0**2 + 0.5**2)))
    sift = cv2.SIFT_create(enable_precise_upscale=True)
    found = from_opencv(sift.detect(np.round(200 * blob).astype(np.uint8), None))
    best = found.loc[found["value"].idxmax()]
    assert abs(best["y"] - 30.25) < 0.1 and abs(best["x"] - 40.5) < 0.1
    assert abs(best["sigma"] - 5 / 2 ** (1 / 6)) < 0.1


def test_nothing_is_a_list_of_keypoints_too():
    assert len(from_opencv([])) == 0
    assert to_lafs(KEYPOINTS.iloc[:0]).shape == (1, 0, 2, 3)
    assert len(from_lafs(np.zeros((1, 0, 2, 3)))) == 0


@pytest.mark.parametrize("wrong", [[1], [None], "text", [(1, 2)]])
def test_other_lists_are_no_keypoints_of_opencv(wrong):
    with pytest.raises(InputError, match=r"give a list of cv2\.KeyPoint"):
        from_opencv(wrong)


def test_local_affine_frames_give_back_what_they_were_given():
    back = from_lafs(to_lafs(KEYPOINTS, mr_size=4.0), mr_size=4.0)
    np.testing.assert_allclose(back[list(KEYPOINTS)], KEYPOINTS, rtol=1e-5, atol=1e-5)


def test_kornia_reads_the_same_centre_scale_and_angle():
    feature = pytest.importorskip("kornia.feature")
    torch = pytest.importorskip("torch")
    frames = torch.from_numpy(to_lafs(KEYPOINTS))
    centre = feature.get_laf_center(frames)[0].numpy()
    np.testing.assert_allclose(centre, KEYPOINTS[["x", "y"]], rtol=1e-5)
    scale = feature.get_laf_scale(frames).numpy().ravel()
    np.testing.assert_allclose(scale / 6.0, KEYPOINTS["sigma"], rtol=1e-5)
    pd.testing.assert_frame_equal(from_lafs(frames), from_lafs(to_lafs(KEYPOINTS)))


@pytest.mark.parametrize("wrong", [np.zeros((2, 3)), np.zeros((2, 4, 2, 3)), "text", None, [1]])
def test_other_arrays_are_no_frames(wrong):
    with pytest.raises(InputError, match="the frames have the shape"):
        from_lafs(wrong)


def test_a_frame_without_area_is_refused():
    with pytest.raises(InputError, match="a scale is 0"):
        from_lafs(np.zeros((1, 1, 2, 3)))


# Files


@pytest.mark.parametrize("format", TEXTS)
def test_bytes_of_texts_are_those_of_the_format(format, tmp_path):
    path = tmp_path / "one.txt"
    write_keypoints(ONE, path, format)
    assert path.read_bytes() == TEXTS[format].encode()
    found = read_keypoints(path, format)
    np.testing.assert_allclose(found, ONE[list(found)], atol=1e-15)


@pytest.mark.parametrize("convention", [None, Convention(1.0, "yx", 3.0)])
@pytest.mark.parametrize("format", ["csv", *TEXTS])
def test_texts_give_back_what_they_were_given(format, convention, tmp_path):
    path = tmp_path / "keypoints.csv"
    write_keypoints(KEYPOINTS, path, format, convention=convention)
    found = read_keypoints(path, format, convention=convention)
    assert {"y", "x", "sigma"} <= {*found}
    np.testing.assert_allclose(found, KEYPOINTS[list(found)], rtol=1e-12, atol=1e-12)
    write_keypoints(KEYPOINTS.iloc[:0], path, format)
    assert len(read_keypoints(path, format)) == 0


def test_an_ellipse_has_the_scale_of_the_circle_of_its_area(tmp_path):
    path = tmp_path / "ellipse.txt"
    # Half axes 2 and 8 along the diagonals: eigenvalues 1/4 and 1/64.
    a, b = (1 / 4 + 1 / 64) / 2, (1 / 4 - 1 / 64) / 2
    path.write_text(f"1.0\n1\n10 4 {a} {b} {a}\n")
    assert read_keypoints(path, "oxford")["sigma"].tolist() == pytest.approx([4.0])


def test_comments_and_empty_lines_do_not_count(tmp_path):
    path = tmp_path / "one.frame"
    path.write_text(f"# x y sigma theta\n\n{TEXTS['vlfeat']}\n")
    assert len(read_keypoints(path, "vlfeat")) == 1


def test_a_database_gives_back_what_it_was_given(database):
    write_keypoints(KEYPOINTS, database, "colmap-db", image="right.png")
    found = read_keypoints(database, "colmap-db", image="right.png")
    np.testing.assert_allclose(found, KEYPOINTS[list(found)], rtol=1e-6, atol=3e-5)
    assert len(read_keypoints(database, "colmap-db", image="left.png")) == 0
    with pytest.raises(InputError, match="keypoints already; remove them"):
        write_keypoints(ONE, database, "colmap-db", image="right.png")
    assert len(read_keypoints(database, "colmap-db", image="right.png")) == len(KEYPOINTS)


@pytest.mark.parametrize(
    ("n_columns", "shape"), [(4, (1.5, np.pi / 2)), (6, (0.0, -1.5, 1.5, 0.0))]
)
def test_both_forms_of_a_database_are_read(n_columns, shape, database):
    put(database, 3, n_columns, 10.5, 4.5, *shape)
    found = read_keypoints(database, "colmap-db", image="left.png")
    np.testing.assert_allclose(found, ONE[list(found)], rtol=1e-6)


def test_colmap_reads_what_was_written_and_is_read(tmp_path):
    pycolmap = pytest.importorskip("pycolmap")
    path = tmp_path / "real.db"
    with pycolmap.Database.open(path) as made:
        camera = pycolmap.Camera.create_from_model_name(1, "PINHOLE", 500.0, 500, 300)
        made.write_camera(camera, use_camera_id=True)
        image = pycolmap.Image(name="only.png", camera_id=1, image_id=1)
        made.write_image(image, use_image_id=True)
    write_keypoints(KEYPOINTS, path, "colmap-db")
    with pycolmap.Database.open(path) as made:
        there = made.read_keypoints(1)
        assert len(there) == len(KEYPOINTS)
        expected = KEYPOINTS[["x", "y", "sigma", "angle"]] + [0.5, 0.5, 0, 0]
        np.testing.assert_allclose(there, expected, rtol=1e-6)
        # As its own extractor writes them: an affine shape.
        cosine, sine = (f(there[:, 3]) * there[:, 2] for f in (np.cos, np.sin))
        made.clear_keypoints()
        made.write_keypoints(1, np.stack([*there[:, :2].T, cosine, -sine, sine, cosine], axis=1))
    found = read_keypoints(path, "colmap-db")
    np.testing.assert_allclose(found, KEYPOINTS[list(found)], rtol=1e-5, atol=1e-4)


@pytest.mark.parametrize(
    ("format", "text", "said"),
    [
        ("colmap", "", "the number of keypoints does not stand"),
        ("colmap", "2 128\n1 2 3 0\n", "2 keypoints are announced and 1 follow"),
        ("colmap", "1 128\n1 2 3\n", "keypoint 1 has 3 numbers; this format has 4"),
        ("colmap", "1 128\n1 2 x 0\n", "keypoint 1 is '1 2 x 0'; give numbers"),
        ("colmap", "1 128\n1 nan 2 0\n", "y is nan in row 0"),
        ("colmap", "1 128\n1 2 0 0\n", "a scale is 0"),
        ("oxford", "1.0\n", "the number of keypoints does not stand"),
        ("oxford", "1.0\n1\n1 2 1 2 1\n", "keypoint 1 is no ellipse"),
        ("oxford", "1.0\n1\n1 2 -1 0 -1\n", "keypoint 1 is no ellipse"),
        ("vlfeat", "1 2 3\n", "keypoint 1 has 3 numbers"),
        ("vlfeat", "\N{DEGREE SIGN}", "no text"),
        ("csv", "y,x\n1,2\n", "lacks the column sigma"),
        ("csv", "y,x,sigma\n1,inf,2\n", "x is inf in row 0"),
        ("colmap-db", "no database at all, but some text", "no database of COLMAP"),
    ],
)
def test_broken_files_are_refused_in_one_line(format, text, said, tmp_path):
    path = tmp_path / "broken.csv"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=said) as refused:
        read_keypoints(path, format)
    assert str(path) in str(refused.value) and "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("row", "said"),
    [
        ((3, 2, 4, b"1234"), "4 bytes for 2 keypoints of 4; it is damaged"),
        ((3, 1, 5, bytes(20)), "keypoints of 5 numbers"),
        ((3, 1, 2, bytes(8)), "its keypoints have no scale"),
        ((3, 1, 4, "text"), "COLMAP has 2, 4 or 6"),
    ],
)
def test_broken_databases_are_refused(row, said, database):
    with closing(sqlite3.connect(database)) as made, made:
        made.execute("INSERT INTO keypoints VALUES (?, ?, ?, ?)", row)
    with pytest.raises(InputError, match=said):
        read_keypoints(database, "colmap-db", image="left.png")


def test_images_and_files_must_be_there(database, tmp_path):
    with pytest.raises(InputError, match="no image or several; name one"):
        read_keypoints(database, "colmap-db")
    with pytest.raises(InputError, match=r"it holds no image 'up\.png'"):
        write_keypoints(ONE, database, "colmap-db", image="up.png")
    with pytest.raises(InputError, match="COLMAP makes the database"):
        write_keypoints(ONE, tmp_path / "new.db", "colmap-db", image="up.png")
    with pytest.raises(InputError, match="no such file"):
        read_keypoints(tmp_path / "none.csv")
    with pytest.raises(InputError, match="give one of csv, colmap, colmap-db, oxford, vlfeat"):
        read_keypoints(database, "sqlite")


@pytest.mark.parametrize("format", KEYPOINT_FORMATS)
def test_what_cannot_be_written_leaves_nothing(format, database, tmp_path):
    path = database if format == "colmap-db" else tmp_path / "out.csv"
    for wrong in (ONE.drop(columns="sigma"), ONE.assign(y=np.nan)):
        with pytest.raises(InputError):
            write_keypoints(wrong, path, format, image="left.png")
    assert [each.name for each in tmp_path.iterdir()] == ["colmap.db"]


@pytest.mark.parametrize("row", [0, 1, 2])
@pytest.mark.parametrize("name", ["y", "x", "sigma"])
def test_the_row_that_holds_no_number_is_named(name, row, tmp_path):
    keypoints = pd.DataFrame({"y": [1.0, 2.0, 3.0], "x": 4.0, "sigma": 1.5})
    keypoints.loc[row, name] = np.nan
    with pytest.raises(InputError, match=f"is nan in row {row};"):
        Convention(0.0, "xy", "sigma").columns(keypoints)
