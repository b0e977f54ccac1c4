"""What a person types with a photograph of their own."""

from __future__ import annotations

import ast
import inspect
import io
import sys
from importlib import import_module
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from PIL import Image
from scenes import blobs
from scipy.special import ndtr

import keystab
from keystab.camera.psf_fit import fit_psf
from keystab.camera.simulation import simulate_view
from keystab.cli import main as cli
from keystab.cli.parser import build_parser
from keystab.detection.detector import detect_keypoints
from keystab.errors import InputError
from keystab.io.describe import describe
from keystab.io.pictures import read_picture, write_picture
from keystab.io.tables import read_table
from keystab.prediction.uncertainty import keypoint_uncertainty


@pytest.fixture
def photo(tmp_path):
    noise = 0.01 * np.random.default_rng(3).standard_normal((50, 64))
    write_picture(blobs((50, 64), 2, 0.01) + noise, tmp_path / "photo.npy")
    return tmp_path / "photo.npy"


def run(photo, command, capsys):
    """Status, output and errors of a command."""
    status = cli.main(command.replace("PHOTO", str(photo)).split())
    return status, *capsys.readouterr()


def test_uncertainty_passes_every_parameter(photo, tmp_path):
    changed = {
        "camera_blur": 0.7, "n_spo": 4, "delta_min": 0.4, "sigma_min": 0.9, "kappa": 1.3,
        "oversampling": "cosine", "epsilon": 1e-7, "refine": True, "max_offset": 0.7,
        "max_iterations": 3.0, "scale_moves": False, "move": "unit_step", "n_oct": 2, "threads": 2,
        "noise": (1e-4, 1e-5),
    }  # fmt: skip
    known = {*inspect.signature(keypoint_uncertainty).parameters} - {"image", "noise_free"}
    assert known == set(changed)
    defaults = build_parser().parse_args(["uncertainty", "x.png", "--camera-blur", "1"])
    for name, parameter in inspect.signature(keypoint_uncertainty).parameters.items():
        if name not in ("image", "camera_blur", "noise_free", "n_oct"):
            assert getattr(defaults, name) == parameter.default, name
    assert defaults.n_oct == "all"
    flags = []
    for name, value in changed.items():
        flag = "--" + name.replace("_", "-")
        if isinstance(value, bool):
            flags += [flag if value else flag.replace("--", "--no-")]
        else:
            flags += [flag, *map(str, value if isinstance(value, tuple) else [value])]
    out = tmp_path / "found.parquet"
    assert cli.main(["uncertainty", str(photo), "-o", str(out), *flags]) == 0
    expected = keypoint_uncertainty(read_picture(photo), **changed)
    assert len(expected) > 0
    pd.testing.assert_frame_equal(read_table(out), expected)


def test_a_pipe_gets_the_table_and_a_terminal_a_summary(photo, monkeypatch, capsys):
    command = "uncertainty PHOTO --camera-blur 0.8 --n-oct 1"
    status, out, err = run(photo, command, capsys)
    found = pd.read_csv(io.StringIO(out))
    assert status == 0 and len(found) > 5 and {"std_y", "survival"} <= set(found)
    assert f"{len(found)} keypoints in 1 octave (--n-oct all for more)" in err
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True, raising=False)
    status, out, _ = run(photo, command, capsys)
    assert status == 0 and "half have a standard deviation below" in out and "," not in out[:6]
    assert f"{(found['survival'] > 0.9).mean():.0%} above 0.9" in out
    assert "estimated from the picture" in out and "-o TABLE.csv" in out


def test_where_a_file_gets_the_table_a_pipe_gets_nothing(photo, tmp_path, capsys):
    command = f"detect PHOTO --camera-blur 0.8 -o {tmp_path}/found.csv"
    status, out, err = run(photo, command, capsys)
    assert (status, out) == (0, "") and "maxima, minima" in err
    assert len(read_table(tmp_path / "found.csv")) > 5


@pytest.mark.parametrize("command", ["detect", "truth", "uncertainty"])
def test_keypoints_are_drawn(photo, tmp_path, command, capsys):
    more = " --sigma-max 1.5 --n-spo 4" if command == "truth" else " --n-oct 1"
    command += f" PHOTO --camera-blur 0.8 --draw {tmp_path}/k.svg --colour sign"
    status, _, err = run(photo, command + more + " --part 10 10 30 30", capsys)
    assert status == 0 and "colour: sign" in err
    assert (tmp_path / "k.svg").read_text().startswith("<?xml")


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ("--part 0 0 9 9", "give --draw FILE.png"),
        ("--draw k.pdf", "use .png or .svg"),
        # Before anything is searched: minutes on a large picture.
        ("--draw k.png --part 90 0 9 9 -o k.csv", "lies outside of a picture of 50 x 64"),
        ("--draw k.png --enlarge inf", "the factor of ellipses is inf"),
        ("--n-oct some", "no number of octaves"),
        ("--noise 1 2 3", "give one or two"),
        ("--noise -1", "noise is -1"),
        ("--camera-blur some", "give a number or auto"),
    ],
)
def test_wrong_words_get_one_line(photo, more, words, capsys):
    try:
        status, out, err = run(photo, f"uncertainty PHOTO --camera-blur 0.8 {more}", capsys)
    except SystemExit as end:
        status, (out, err) = end.code, capsys.readouterr()
    assert (status, out, err.count("\n")) == (2, "", 1)
    assert words in err


def test_noise_that_a_jpeg_hides_is_warned_of(tmp_path, capsys):
    grey = np.random.default_rng(0).integers(0, 256, (24, 24), dtype=np.uint8)
    for name in ("photo.jpg", "photo.png"):
        Image.fromarray(grey).save(tmp_path / name)
        command = "uncertainty PHOTO --camera-blur 0.8 --n-spo 3 --n-oct 1"
        status, _, err = run(tmp_path / name, command, capsys)
        assert status == 0 and ("give --noise" in err) is name.endswith(".jpg")
        status, _, err = run(tmp_path / name, f"{command} --noise 0.01", capsys)
        assert status == 0 and "give --noise" not in err


def test_a_drawing_does_not_replace_the_picture(tmp_path, capsys):
    picture = tmp_path / "photo.png"
    write_picture(np.random.default_rng(0).random((30, 40)), picture)
    (tmp_path / "same.png").symlink_to(picture)
    before = picture.read_bytes()
    command = f"detect PHOTO --camera-blur 0.8 --draw {tmp_path}/same.png"
    status, _, err = run(picture, command, capsys)
    assert status == 2 and "is the picture itself" in err and picture.read_bytes() == before


def test_the_blur_can_be_told_from_edges(tmp_path, capsys):
    y, x = np.mgrid[:60, :80]
    write_picture(ndtr((x - 40 + 0.4 * y - 12) / np.hypot(1, 0.4) / 0.9), tmp_path / "edge.npy")
    status, out, err = run(tmp_path / "edge.npy", "detect PHOTO --camera-blur auto", capsys)
    assert status == 0 and out.startswith("y,x,")
    assert "camera blur 0.90 px (0.7" in err and "% larger" in err
    # An extremum of blur c at sigma lies at the same sigma^2 - c^2 whatever blur is assumed.
    assert "scales near 1.1 px would be 9% larger" in err


def test_a_soft_picture_says_from_which_scale_on_it_can_be_searched(tmp_path, capsys):
    y, x = np.mgrid[:60, :80]
    write_picture(ndtr((x - 40 + 0.4 * y - 12) / np.hypot(1, 0.4) / 1.7), tmp_path / "soft.npy")
    status, _, err = run(tmp_path / "soft.npy", "detect PHOTO --camera-blur auto", capsys)
    assert status == 2 and "give --sigma-min 1.7" in err


def test_samples_that_are_too_coarse_are_warned_of(photo, capsys):
    status, _, err = run(photo, "detect PHOTO --camera-blur 0.8 --delta-min 3", capsys)
    assert status == 0 and "samples 3 px apart do not resolve a blur of 1.1 px" in err
    _, _, err = run(photo, "detect PHOTO --camera-blur 0.8 --delta-min 0.5", capsys)
    assert "warning" not in err


def test_all_octaves_end_at_a_quarter_of_the_shorter_side():
    image = np.random.default_rng(1).random((120, 150))
    found, four = (detect_keypoints(image, 0.8, n_oct=n) for n in ("all", 4))
    pd.testing.assert_frame_equal(found, four)  # 1.1 * 2**4 <= 120 / 4 < 1.1 * 2**5
    assert (found["octave"] == 2).any()


def test_a_photograph_is_no_point_spread_function():
    photograph = np.random.default_rng(0).random((400, 600))
    with pytest.raises(InputError, match=r"no point spread function: \d+ separate areas"):
        fit_psf(photograph)
    with pytest.raises(InputError, match="crop it"):
        fit_psf(np.zeros((2000, 3000)))


def test_pictures_are_described(photo):
    lines = describe(photo).splitlines()
    assert lines[0].endswith("picture, 50 pixels high, 64 wide: 0.0032 megapixels")
    notes = photo.with_name("notes.txt")
    notes.write_text("no picture")
    with pytest.raises(InputError, match="notes.txt: its content is none of"):
        describe(notes)


@pytest.mark.parametrize(
    ("image", "words"),
    [
        ("photo.png", r"keystab.read_picture\(path\)"),
        (Path("photo.png"), r"keystab.read_picture\(path\)"),
        (np.zeros((9, 9, 3)), "which is colour"),
        (np.zeros((9, 9, 4)), "which is colour"),
        (np.full((9, 9), -1e300), "grey values up to 1e[+]300, allowed are"),
        (np.full((9, 9), 1e-300), "grey values up to 1e-300, allowed are"),
    ],
)
@pytest.mark.parametrize("function", [detect_keypoints, keypoint_uncertainty])
def test_paths_and_colour_are_refused_with_the_remedy(function, image, words):
    with pytest.raises(InputError, match=words):
        function(image, 0.8)


def test_a_view_sees_the_whole_picture_by_default():
    scene = np.random.default_rng(0).random((43, 65))
    whole = simulate_view(scene, 0.8, 4)
    assert whole.shape == (10, 16)
    np.testing.assert_array_equal(whole, simulate_view(scene, 0.8, 4, (10, 16)))
    with pytest.raises(InputError, match="more than a side"):
        simulate_view(scene, 0.8, 44)


def test_type_checkers_know_every_public_name():
    stub = ast.parse(Path(keystab.__file__).with_suffix(".pyi").read_text())
    typed = {
        alias.asname: (node.module, alias.name)
        for node in stub.body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }
    assert set(typed) == set(keystab.__all__)
    for name, (module, own) in typed.items():
        assert own == name and getattr(keystab, name) is getattr(import_module(str(module)), name)
