"""Keypoints lie where they were found, as large and as coloured as they are."""

from __future__ import annotations

import re

import numpy as np
import pandas as pd
import pytest
from PIL import Image

from keystab.errors import InputError
from keystab.figures.overlay import check_drawing, draw_keypoints

PICTURE = np.full((60, 100), 0.5)


def table(**columns):
    return pd.DataFrame({"y": [20.0], "x": [70.0], "sigma": [8.0], "sign": [1]} | columns)


def bars(std_y=0.4, std_x=0.2, cov=0.0, survival=0.9):
    return table(std_y=[std_y], std_x=[std_x], cov_yx=[cov], survival=[survival])


def drawn(path):
    """Pixels that are not grey, in rows and columns of the picture (12 pixels for each)."""
    pixels = np.asarray(Image.open(path).convert("RGB")).astype(int)[: 60 * 12]
    coloured = np.ptp(pixels, axis=2) > 40
    row, column = np.nonzero(coloured)
    return (row + 0.5) / 12 - 0.5, (column + 0.5) / 12 - 0.5


def test_a_circle_has_its_centre_and_radius(tmp_path):
    words = draw_keypoints(PICTURE, table(), tmp_path / "k.png")
    y, x = drawn(tmp_path / "k.png")
    radius = np.hypot(y - 20, x - 70)
    assert radius.min() > 7.7 and radius.max() < 8.3
    assert [y.mean(), x.mean()] == pytest.approx([20, 70], abs=0.1)
    assert words == "1 keypoints; circles: radius σ; colour: sign"


def test_an_ellipse_is_that_of_95_percent_enlarged(tmp_path):
    # Standard deviations 0.4 and 0.2: half axes of 2.448 times these, five times enlarged.
    words = draw_keypoints(PICTURE, bars(), tmp_path / "k.png", enlarge=5)
    y, x = drawn(tmp_path / "k.png")
    near = np.hypot(y - 20, x - 70) < 7
    assert np.ptp(y[near]) == pytest.approx(2 * 5 * 2.448 * 0.4, rel=0.06)
    assert np.ptp(x[near]) == pytest.approx(2 * 5 * 2.448 * 0.2, rel=0.06)
    assert "enlarged 5 times" in words


def test_the_factor_lets_half_of_the_ellipses_fit(tmp_path):
    # 8 / (2.448 * 0.4) = 8.2: of 1, 2, 5, 10 that is 5.
    assert "enlarged 5 times" in draw_keypoints(PICTURE, bars(), tmp_path / "k.png")


def test_correlated_errors_tilt_an_ellipse_the_right_way(tmp_path):
    draw_keypoints(PICTURE, bars(0.3, 0.3, 0.08), tmp_path / "k.png", enlarge=5)
    y, x = drawn(tmp_path / "k.png")
    near = np.hypot(y - 20, x - 70) < 7
    assert np.corrcoef(y[near], x[near])[0, 1] > 0.5  # down and right, as the covariance says


def test_a_part_shows_its_keypoints_and_no_others(tmp_path):
    both = pd.concat([table(), table(y=[50.0], x=[10.0])])
    words = draw_keypoints(PICTURE, both, tmp_path / "k.png", part=(0, 40, 40, 60))
    assert words.startswith("1 of 2 keypoints")


def test_the_same_keypoints_give_the_same_bytes_and_nothing_of_the_day(tmp_path):
    for suffix in ("png", "svg"):
        one, other = (tmp_path / f"{n}.{suffix}" for n in "ab")
        for path in (one, other):
            draw_keypoints(PICTURE, bars(), path)
        assert one.read_bytes() == other.read_bytes()
    assert not re.search(r"20\d\d-\d\d-\d\d", (tmp_path / "a.svg").read_text())


def test_no_keypoints_are_drawn_as_none(tmp_path):
    assert draw_keypoints(PICTURE, bars()[:0], tmp_path / "k.png").startswith("0 keypoints")


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"colour": "survival"}, "columns that these keypoints have: sign"),
        ({"part": (60, 0, 5, 5)}, "lies outside"),
        ({"part": (0, 0, 0, 5)}, "lies outside"),
        ({"enlarge": 0.0}, "allowed are positive numbers"),
        ({"enlarge": np.nan}, "allowed are positive numbers"),
        ({"enlarge": 1e300}, "up to 10000"),
        ({"path": "k.pdf"}, "use .png or .svg"),
    ],
)
def test_what_cannot_be_drawn_is_refused_in_one_line(tmp_path, options, words):
    path = tmp_path / options.pop("path", "k.png")
    with pytest.raises(InputError, match=re.escape(words)):
        draw_keypoints(PICTURE, table(), path, **options)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("part", "expected"),
    [
        (None, (0, 0, 60, 100)),
        ((59, 99, 1, 1), (59, 99, 1, 1)),
        ((59, 99, 7, 9), (59, 99, 1, 1)),
        ((0, 0, 60, 100), (0, 0, 60, 100)),
        ((10, 70, 60, 20), (10, 70, 50, 20)),
        ((60, 0, 1, 1), None),
        ((0, 100, 1, 1), None),
        ((-1, 0, 9, 9), None),
        ((0, -1, 9, 9), None),
        ((0, 0, 1, 0), None),
    ],
)
def test_a_part_begins_on_the_picture_and_ends_with_it(part, expected):
    if expected is None:
        with pytest.raises(InputError, match="lies outside of a picture of 60 x 100 pixels"):
            check_drawing(PICTURE.shape, part, None)
    else:
        assert check_drawing(PICTURE.shape, part, None) == expected


@pytest.mark.parametrize("shape", [(60, 100), (100, 60), (3000, 40), (40, 3000)])
def test_pictures_are_enlarged_or_reduced_by_their_longer_side_alone(shape, tmp_path):
    draw_keypoints(np.full(shape, 0.5), table(), tmp_path / "k.png")
    with Image.open(tmp_path / "k.png") as drawing:
        width, height = drawing.size
    longer = min(max(*shape, 1200), 2400)
    zoom = longer / max(shape)
    assert height == pytest.approx(shape[0] * zoom + 75, abs=1)
    assert width == pytest.approx(max(shape[1] * zoom, 600), abs=1)


def test_black_and_white_are_those_of_the_picture_whatever_its_grey_values(tmp_path):
    seen = []
    for low, high in ((0.0, 1.0), (-3.0, 5.0), (0.4, 0.5)):
        ramp = low + (high - low) * np.tile(np.linspace(0, 1, 100), (60, 1))
        draw_keypoints(ramp, table(), tmp_path / "k.png")
        with Image.open(tmp_path / "k.png") as drawing:
            seen.append(np.asarray(drawing.convert("L"))[20, :1200].astype(int))
        assert seen[-1][0] < 130 < 240 < seen[-1][-1]
    assert np.ptp(seen, axis=0).max() <= 1
