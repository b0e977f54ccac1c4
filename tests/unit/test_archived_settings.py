"""Settings of a stranger are data: what they may say, and how much of it."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

import numpy as np
import pytest
import tifffile
import yaml
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from keystab import __version__
from keystab.errors import InputError
from keystab.provenance.archived_settings import (
    _MOST_PAGES,
    _check_picture,
    plain_settings,
    settings_of,
)
from keystab.provenance.run_description import About
from keystab.provenance.unpacking import Unpacked

ROOT = Path(__file__).parents[2]

PLAIN = st.recursive(
    st.none()
    | st.booleans()
    | st.integers()
    | st.floats(allow_nan=False)
    | st.from_regex(r"[a-z][a-z0-9_./]{0,9}", fullmatch=True),
    lambda inner: (
        st.lists(inner, max_size=3)
        | st.dictionaries(st.from_regex("[a-z_]{1,5}", fullmatch=True), inner, max_size=3)
    ),
    max_leaves=9,
)


@given(st.dictionaries(st.from_regex("[a-z_]{1,5}", fullmatch=True), PLAIN, max_size=3))
def test_plain_settings_are_read_as_they_were_written(settings):
    text = yaml.safe_dump(settings)
    assert plain_settings(text.encode(), "a.yaml") == yaml.safe_load(text)


@pytest.mark.parametrize("path", sorted(ROOT.glob("config/**/*.yaml")), ids=lambda path: path.name)
def test_the_settings_of_the_study_are_plain(path):
    given = yaml.safe_load(path.read_text())
    if isinstance(given, dict):
        assert plain_settings(path.read_bytes(), "a.yaml") == given


@given(st.binary(max_size=60) | st.text(max_size=60).map(str.encode))
def test_whatever_is_given_is_settings_or_refused_in_one_line(data):
    try:
        assert isinstance(plain_settings(data, "a.yaml"), dict)
    except InputError as error:
        assert str(error).startswith("a.yaml: ") and str(error).isprintable()


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("a: !!int ''", "has tags"),
        ("a: !!python/name:os.system", "has tags"),
        ("a: ! x", "has tags"),
        ("a: &b 1", "refers to parts of itself"),
        ("a: " + "1:" * 900 + "1.5", "not plain YAML"),
        ("a: " + "9" * 5000, "not plain YAML"),
        ("a: 2001-99-99", "as a date"),
        ("a: " + "[" * 3000, "nested too deeply"),
        ("a: [" + "1," * 2001 + "]", "too many values"),
        ("- a", "holds no settings"),
        ("a: $(x)", "is no text of a setting"),
        ("a: b --c", "is no text of a setting"),
        ("a: -b", "is no text of a setting"),
        ('"a\\n": 1', "is no text of a setting"),
    ],
)
def test_what_settings_never_say_is_refused(text, said):
    with pytest.raises(InputError, match=said):
        plain_settings(text.encode(), "a.yaml")


def archived(folder: Path, text: str) -> Unpacked:
    """An archive whose only member is a file of settings."""
    name = "settings/1-mine.yaml"
    (folder / "settings").mkdir()
    (folder / name).write_text(text)
    folders = ("results", "figures", "logs")
    about = About(__version__, 64 * "0", 64 * "0", (name,), *folders, arithmetic="", zlib="")
    return Unpacked(folder, {name: hashlib.sha256(text.encode()).hexdigest()}, about)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("reference: /etc/passwd", "reference is '/etc/passwd', a file outside the archive"),
        ("predictors: {pictures: {a: {path: ../a.png, step: 3}}}", "pictures.a.path is"),
        ("floor: {pictures: {a: {path: /etc/passwd, step: 3}}}", "floor.pictures.a.path is"),
        ("pictures: [../a.yaml]", "pictures is"),
        ("results: elsewhere", "settings say results"),
        ("detector: {epsilonn: 1}", "settings: config: detector.epsilonn is no setting"),
        (json.dumps({"sets": {f"x{n}": {"n_views": 1000} for n in range(30)}}), "of 3.... views"),
        (json.dumps({"sets": {f"x{n}": {} for n in range(300)}}), "sets of"),
    ],
)  # fmt: skip
def test_settings_that_lead_out_or_take_long_are_refused(text, said, tmp_path):
    with pytest.raises(InputError, match=said) as raised:
        settings_of(archived(tmp_path, text), ROOT)
    assert "\n" not in str(raised.value)


def test_settings_of_an_archive_are_laid_over_those_here(tmp_path):
    given = settings_of(archived(tmp_path, "detector: {epsilon: 1.0e-6}"), ROOT)
    assert given.given == {"detector": {"epsilon": 1e-6}}
    assert given.complete["detector"]["epsilon"] == 1e-6
    assert {"config/images/coldwarm.png", "config/images/lake.png"} <= set(given.pictures)


@pytest.mark.parametrize("options", [{}, {"bigtiff": True}, {"byteorder": ">"}])
def test_pictures_of_one_page_are_taken(options, tmp_path):
    tifffile.imwrite(tmp_path / "a.tif", np.zeros((9, 9), np.float32), **options)
    Image.new("L", (9, 9)).save(tmp_path / "a.png")
    Image.new("L", (9, 9)).save(tmp_path / "a.jpg")
    for name in ("a.tif", "a.png", "a.jpg"):
        _check_picture(tmp_path / name, name)


def test_stacks_of_pictures_are_refused(tmp_path):
    tifffile.imwrite(tmp_path / "a.tif", np.zeros((30, 9, 9)), photometric="minisblack")
    with pytest.raises(InputError, match="a.tif: no PNG, JPEG or TIFF that holds one picture"):
        _check_picture(tmp_path / "a.tif", "a.tif")


@pytest.mark.parametrize(
    "data",
    [
        b"",
        b"GIF89a" + bytes(30),
        b"%!PS-Adobe",
        b"\x89PNG\r\n\x1a",
        b"\xff\xd8\xfe\xe0",
        b"II\0*" + bytes(30),
    ],
)
def test_what_begins_as_no_known_picture_is_refused(data, tmp_path):
    (tmp_path / "a.tif").write_bytes(data)
    with pytest.raises(InputError, match="a.tif: no PNG, JPEG or TIFF that holds one picture"):
        _check_picture(tmp_path / "a.tif", "a.tif")


@pytest.mark.parametrize("options", [{}, {"bigtiff": True}, {"byteorder": ">"}])
def test_a_tiff_has_as_many_pages_as_allowed_and_no_more(options, tmp_path):
    for n in (_MOST_PAGES, _MOST_PAGES + 1):
        path = tmp_path / f"{n}.tif"
        with tifffile.TiffWriter(path, **options) as writer:
            for _ in range(n):
                writer.write(np.zeros((9, 9), np.uint8), photometric="minisblack", contiguous=False)
        if n == _MOST_PAGES:
            _check_picture(path, "a.tif")
        else:
            with pytest.raises(InputError, match="that holds one picture"):
                _check_picture(path, "a.tif")
