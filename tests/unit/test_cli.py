"""The command: what it writes, and one line for what it refuses."""

import inspect
import io
import math
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from keystab import scale_space
from keystab.camera.psf_fit import fit_psf
from keystab.camera.simulation import simulate_view
from keystab.cli import main as cli
from keystab.cli.parser import build_parser
from keystab.detection.detector import detect_keypoints
from keystab.detection.extrema import bytes_of_search
from keystab.io.pictures import read_picture, write_picture
from keystab.io.tables import read_table
from keystab.truth.true_extrema import true_extrema
from keystab.utils import memory

BLUR = "--camera-blur 0.8"


@pytest.fixture
def picture(tmp_path):
    """A Gaussian blob of 3 px seen with a camera blur of 0.8, off centre."""
    y, x = np.mgrid[:40, :50]
    write_picture(
        np.exp(-0.5 * ((y - 18.0) ** 2 + (x - 24.5) ** 2) / (9 + 0.64)), tmp_path / "blob.npy"
    )
    return tmp_path / "blob.npy"


def test_detect_finds_the_blob(picture, capsys):
    assert cli.main(["detect", str(picture), "--camera-blur", "0.8", "--n-oct", "2"]) == 0
    out, err = capsys.readouterr()
    found = pd.read_csv(io.StringIO(out))
    best = found.loc[found["value"].idxmin()]
    # closed form: the DoG has its minimum at the centre, at s / sqrt(kappa)
    assert [best["y"], best["x"]] == pytest.approx([18.0, 24.5], abs=0.01)
    assert best["sigma"] == pytest.approx(3 / 2 ** (1 / 6), rel=0.02)
    assert f"{len(found)} keypoints" in err


def test_detect_passes_every_parameter(picture, tmp_path):
    changed = {
        "camera_blur": 0.7,
        "n_spo": 4,
        "delta_min": 0.4,
        "sigma_min": 0.9,
        "kappa": 1.3,
        "oversampling": "cosine",
        "epsilon": 1e-7,
        "refine": False,
        "max_offset": math.inf,
        "max_iterations": 3.0,
        "scale_moves": False,
        "move": "unit_step",
        "n_oct": 2,
        "threads": 2,
    }
    parameters = inspect.signature(detect_keypoints).parameters
    assert list(parameters)[1:] == list(changed)  # every parameter has a flag
    defaults = build_parser().parse_args(["detect", "x.png", "--camera-blur", "1"])
    for name, parameter in list(parameters.items())[2:]:
        assert getattr(defaults, name) == parameter.default, name
    flags = []
    for name, value in changed.items():
        flag = "--" + name.replace("_", "-")
        flags += [flag.replace("--", "--no-")] if value is False else [flag, str(value)]
    out = tmp_path / "found.parquet"
    assert cli.main(["detect", str(picture), "-o", str(out), *flags]) == 0
    expected = detect_keypoints(read_picture(picture), **changed)
    assert len(expected) > 0
    pd.testing.assert_frame_equal(read_table(out), expected)


def test_truth_passes_every_parameter(picture, tmp_path, capsys):
    changed = {
        "camera_blur": 0.7,
        "sigma_min": 1.3,
        "sigma_max": 2.9,
        "kappa": 1.3,
        "n_spo": [4, 6],
        "threads": 2,
    }
    parameters = inspect.signature(true_extrema).parameters
    assert list(parameters)[1:] == list(changed)  # every parameter has a flag
    defaults = build_parser().parse_args(["truth", "x.png", "--camera-blur", "1"])
    for name, parameter in list(parameters.items())[2:]:
        assert getattr(defaults, name) == parameter.default, name
    flags = []
    for name, value in changed.items():
        values = value if isinstance(value, list) else [value]
        flags += ["--" + name.replace("_", "-"), *map(str, values)]
    out = tmp_path / "truth.parquet"
    assert cli.main(["truth", str(picture), "-o", str(out), *flags]) == 0
    expected = true_extrema(read_picture(picture), **changed)
    assert f": {len(expected)} extrema" in capsys.readouterr().err
    # closed form, for a picture whose blur is in truth 0.8
    size = math.sqrt(9 + 0.8**2 - 0.7**2)
    assert expected.loc[expected["value"].idxmin(), "sigma"] == pytest.approx(size / 1.3**0.5)
    pd.testing.assert_frame_equal(read_table(out), expected)
    assert cli.main(["truth", str(picture), *flags]) == 0
    printed = pd.read_csv(io.StringIO(capsys.readouterr().out))
    pd.testing.assert_frame_equal(printed, expected)


@pytest.mark.parametrize(
    "command",
    [
        f"detect PICTURE {BLUR} -o LINK",
        f"truth PICTURE {BLUR} --sigma-max 1.4 --n-spo 3 -o LINK",
        "simulate PICTURE LINK",
    ],
)
def test_output_on_a_link_goes_where_the_link_leads(picture, tmp_path, command):
    is_view = command.startswith("simulate")
    target = tmp_path / "far" / ("view.npy" if is_view else "table.csv")
    link = tmp_path / f"link{target.suffix}"
    link.symlink_to(target)
    command += " --blur 1 --step 2" if is_view else ""
    words = command.replace("PICTURE", str(picture)).replace("LINK", str(link))
    assert cli.main(words.split()) == 0
    assert link.is_symlink() and target.stat().st_size > 0


@pytest.mark.parametrize("suffix", [".npy", ".tiff", ".png"])
def test_simulate_takes_the_view(picture, tmp_path, suffix, capsys):
    out = tmp_path / f"view{suffix}"
    arguments = "--blur 0.9 --step 2.5 --shape 9 12 --shift -0.5 1 --rotation 90 --noise 0.01"
    assert cli.main(["simulate", str(picture), str(out), *arguments.split(), "--seed", "7"]) == 0
    expected = simulate_view(
        read_picture(picture), 0.9, 2.5, (9, 12), (-0.5, 1.0), math.pi / 2, 0.01, 7
    )
    if suffix == ".png":
        clipped = int((expected < 0).sum())
        assert clipped and f"{clipped} pixels clipped" in capsys.readouterr().err
        expected = np.clip(expected, 0, 1)
    tolerance = {".npy": 0.0, ".tiff": 1e-7, ".png": 0.5 / 65535}[suffix]
    np.testing.assert_allclose(read_picture(out), expected, rtol=0, atol=tolerance)


def test_simulate_sees_all_of_the_picture_by_default(picture, tmp_path):
    out = tmp_path / "view.npy"
    assert cli.main(["simulate", str(picture), str(out), "--blur", "1", "--step", "3"]) == 0
    assert read_picture(out).shape == (13, 16)


def test_seeds_may_be_words(picture, tmp_path):
    for seed in ("seven", "7"):
        out = str(tmp_path / f"{seed}.npy")
        arguments = ["--blur", "1", "--step", "3", "--noise", "0.1", "--seed", seed]
        assert cli.main(["simulate", str(picture), out, *arguments]) == 0
    assert not np.array_equal(
        read_picture(tmp_path / "7.npy"), read_picture(tmp_path / "seven.npy")
    )


@pytest.mark.parametrize(
    ("command", "words"),
    [
        ("", "required: COMMAND"),
        ("frobnicate", "invalid choice: 'frobnicate'"),
        ("detect PICTURE", "--camera-blur"),
        ("detect PICTURE --camera-blur wide", "'wide' is no blur; give a number or auto"),
        (f"detect PICTURE {BLUR} --move far", "invalid choice: 'far'"),
        (f"detect gone.png {BLUR}", "gone.png: no such file"),
        (
            f"detect PICTURE {BLUR} -o found.txt",
            "found.txt: cannot write '.txt'; use .csv or .parquet",
        ),
        (f"detect PICTURE {BLUR} --n-spo 0", "n_spo is 0"),
        (f"detect PICTURE {BLUR} --n-oct 0", "n_oct is 0"),
        (f"detect PICTURE {BLUR} --n-oct 40", "fewer octaves"),
        (f"detect PICTURE {BLUR} --threads 0", "threads is 0"),
        (f"detect PICTURE {BLUR} --delta-min 0", "delta_min is 0"),
        (f"detect PICTURE {BLUR} --delta-min 1e-12", "larger delta_min"),
        (f"detect PICTURE {BLUR} --kappa 1", "kappa is 1"),
        (f"detect PICTURE {BLUR} --epsilon -1", "epsilon is -1"),
        (f"detect PICTURE {BLUR} --max-offset 0", "max_offset is 0"),
        (f"detect PICTURE {BLUR} --max-iterations nan", "max_iterations is nan"),
        (f"detect PICTURE {BLUR} --max-iterations 2.5", "'2.5' is no whole number"),
        (f"detect PICTURE {BLUR} --max-iterations few", "'few' is no whole number"),
        ("detect PICTURE --camera-blur 1.2", "sigma_min is 1.1"),
        ("detect PICTURE --camera-blur nan", "camera_blur is nan"),
        ("simulate PICTURE view.jpg --blur 1 --step 2", "cannot write '.jpg'"),
        ("simulate gone.png view.png --blur 1 --step 2", "gone.png: no such file"),
        ("simulate PICTURE view.png --blur -1 --step 2", "camera blur is -1"),
        ("simulate PICTURE view.png --blur 1 --step 0", "step is 0"),
        ("simulate PICTURE view.png --blur 1 --step 1000", "smaller step or a shape"),
        ("simulate PICTURE view.png --blur 1 --step 2 --shape 0 4", "shape is (0, 4)"),
        ("simulate PICTURE view.png --blur 1 --step 2 --noise 0.1", "seed"),
        ("simulate PICTURE view.png --blur 1 --step 2 --rotation inf", "rotation is inf"),
        ("simulate PICTURE PICTURE --blur 1 --step 2", "is the picture itself"),
        ("simulate PICTURE PICTURE/view.png --blur 1 --step 2", "blob.npy is no folder"),
        (f"detect PICTURE {BLUR} -o PICTURE/found.csv", "blob.npy is no folder"),
        ("blur gone.png", "gone.png: no such file"),
        ("blur PICTURE --background dark", "'dark' is no level; give a number or border"),
        ("blur PICTURE --background 2", "nothing in the picture lies above the background"),
        ("blur PICTURE --oversampling 0", "oversampling is 0"),
        ("truth PICTURE", "--camera-blur"),
        (f"truth PICTURE {BLUR} --n-spo 0", "n_spo is 0"),
        (f"truth PICTURE {BLUR} --sigma-max 1", "sigma_max is 1"),
        (f"truth PICTURE {BLUR} -o truth.txt", "cannot write '.txt'; use .csv or .parquet"),
        ("inspect gone", "gone: no such file"),
        ("verify --cores 0", "cores is 0"),
        ("verify --rtol -1", "rtol is -1"),
        ("verify --atol nan", "atol is nan"),
        ("inspect .", "no store of keystab here"),
    ],
)
def test_bad_input_gets_status_2_and_one_line(
    picture, tmp_path, monkeypatch, capsys, command, words
):
    monkeypatch.chdir(tmp_path)
    try:
        status = cli.main(command.replace("PICTURE", str(picture)).split())
    except SystemExit as end:  # argparse
        status = end.code
    out, err = capsys.readouterr()
    assert status == 2 and out == ""
    assert words in err
    assert err.endswith("\n") and err.count("\n") == 1
    assert [p.name for p in tmp_path.iterdir()] == ["blob.npy"]


@pytest.mark.parametrize(
    "command",
    [f"detect PICTURE {BLUR} -o folder.csv", "simulate PICTURE folder.npy --blur 1 --step 2"],
)
def test_a_folder_in_the_place_of_the_output_survives(
    picture, tmp_path, monkeypatch, capsys, command
):
    monkeypatch.chdir(tmp_path)
    for name in ("folder.csv", "folder.npy"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "precious").write_text("kept")
    monkeypatch.setattr("keystab.io.pictures.read_picture", None)  # refused before it is read
    assert cli.main(command.replace("PICTURE", str(picture)).split()) == 2
    assert "is a folder; give a file name\n" in capsys.readouterr().err
    for name in ("folder.csv", "folder.npy"):
        assert (tmp_path / name / "precious").read_text() == "kept"


def test_blur_says_what_the_library_says(tmp_path, capsys):
    y, x = np.mgrid[:41, :45]
    along, across = (x - 22.4 + y - 19.7) / 2**0.5, (x - 22.4 - y + 19.7) / 2**0.5
    psf = 0.5 * np.exp(-0.5 * ((along / 4.0) ** 2 + (across / 3.0) ** 2)) + 0.1
    write_picture(psf, tmp_path / "psf.png")
    for background in ("border", "0.1"):
        flags = ["--oversampling", "4", "--background", background]
        assert cli.main(["blur", str(tmp_path / "psf.png"), *flags]) == 0
        lines = capsys.readouterr().out.splitlines()
        # The nearest isotropic Gaussian has the geometric mean of both axes.
        assert lines[0] == "camera blur c    0.866 pixels"
        assert lines[1] == "centre           y 19.70, x 22.40 in the picture's samples"
        axes = "1 and 0.75 pixels, the longer at 45 degrees from x towards y"
        assert lines[2] == f"principal axes   {axes}"
        fit = fit_psf(read_picture(tmp_path / "psf.png"), 4.0, 0.1)
        assert lines[3].startswith(f"residual         {fit.residual:.1%} of")
        assert lines[4] == "background       0.1"


@pytest.mark.parametrize(
    ("values", "words"),
    [(np.full((9, 9), 0.3), "picture is constant"), (np.full((9, 9), np.nan), "NaN or infinite")],
)
def test_blur_names_the_picture_that_it_cannot_fit(tmp_path, capsys, values, words):
    np.save(tmp_path / "psf.npy", values)
    assert cli.main(["blur", str(tmp_path / "psf.npy")]) == 2
    out, err = capsys.readouterr()
    assert out == "" and err.count("\n") == 1
    assert "psf.npy: " in err and words in err


def test_compiled_code_that_can_be_kept_nowhere_gets_one_line(picture, tmp_path):
    # As in a container that runs for a user who may write neither to the package nor to a home.
    source = Path(cli.__file__).parents[1]
    package = tmp_path / "library" / "keystab"
    shutil.copytree(source, package, ignore=shutil.ignore_patterns("__pycache__"))
    for room in [package, *(path for path in package.iterdir() if path.is_dir())]:
        (room / "__pycache__").write_text("no folder")
    nowhere = {"HOME": str(picture), "XDG_CACHE_HOME": str(picture)}
    environment = {name: os.environ[name] for name in os.environ if name != "NUMBA_CACHE_DIR"}
    command = [
        sys.executable,
        "-m",
        "keystab.cli",
        "detect",
        str(picture),
        "--camera-blur",
        "0.8",
    ]
    ended = subprocess.run(
        command,
        env=environment | nowhere | {"PYTHONPATH": str(package.parent)},
        capture_output=True,
        text=True,
    )
    assert ended.returncode == 2
    assert "set the environment variable NUMBA_CACHE_DIR" in ended.stderr
    assert ended.stderr.count("\n") == 1


def test_one_keypoint_is_singular(picture, tmp_path, monkeypatch, capsys):
    found = detect_keypoints(read_picture(picture), 0.8, n_oct=2)
    for n, words in ((0, "0 keypoints in"), (1, "1 keypoint in"), (2, "2 keypoints in")):
        table = pd.concat([found[:1]] * n) if n else found[:0]
        monkeypatch.setattr(
            "keystab.detection.detector.detect_keypoints", lambda *_, t=table, **__: t
        )
        assert cli.main(["detect", str(picture), "--camera-blur", "0.8"]) == 0
        assert words in capsys.readouterr().err


def test_too_large_for_memory_is_refused_beforehand(picture, monkeypatch, capsys):
    monkeypatch.setattr(memory, "available", lambda: 100_000)
    assert cli.main(["detect", str(picture), "--camera-blur", "0.8"]) == 2
    assert "needs about" in capsys.readouterr().err


@pytest.mark.parametrize(
    "options",
    [
        {},
        pytest.param({"n_spo": 15}, marks=pytest.mark.slow),
        pytest.param({"n_spo": 15, "oversampling": "cosine"}, marks=pytest.mark.slow),
    ],
)
def test_memory_estimate_bounds_what_is_taken(picture, options):
    import tracemalloc

    image = np.tile(read_picture(picture), (2, 2))
    detect_keypoints(image[:60, :60], 0.8, **options)  # what is made once does not count
    tracemalloc.start()
    try:
        detect_keypoints(image, 0.8, **options)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert 0.2 < peak / bytes_of_search(scale_space(image, 0.8, **options)) < 1


def test_help_and_version_need_nothing_heavy():
    code = (
        "import sys\n"
        "from keystab.cli import main as cli\n"
        "try:\n    cli.main(['detect', '--help'])\n"
        "except SystemExit as end:\n    assert end.code == 0\n"
        "assert not {'numpy', 'pandas', 'zarr'} & set(sys.modules)\n"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert "--max-offset" in run.stdout


def test_a_reader_that_stops_early_is_no_error(picture):
    command = f"{sys.executable} -m keystab.cli detect {picture} --camera-blur 0.8 | true"
    run = subprocess.run(command, shell=True, capture_output=True, text=True, check=True)
    assert "Traceback" not in run.stderr and "BrokenPipe" not in run.stderr


def run_on(capsys, *words):
    """What a command says on standard error."""
    assert cli.main([*map(str, words)]) == 0
    return capsys.readouterr().err


def test_a_scene_has_the_height_and_width_that_are_asked_for(tmp_path, capsys):
    out = tmp_path / "scene.npy"
    said = run_on(capsys, "scene", "dead-leaves", "-o", out, "--shape", "40", "64")
    assert read_picture(out).shape == (40, 64)
    assert "40 x 64 pixels, dead-leaves" in said


@pytest.mark.parametrize(
    ("n_oct", "words"),
    [
        ("1", " in 1 octave (--n-oct all for more), "),
        ("2", " in 2 octaves, "),
        ("all", " in all octaves, "),
    ],
)
def test_how_many_octaves_were_searched_is_said(picture, tmp_path, capsys, n_oct, words):
    out = tmp_path / "found.csv"
    said = run_on(capsys, "detect", picture, *BLUR.split(), "--n-oct", n_oct, "-o", out)
    assert words in said


def test_only_what_a_png_cannot_hold_is_said_to_be_clipped(tmp_path, capsys):
    dark, bright = tmp_path / "dark.npy", tmp_path / "bright.npy"
    write_picture(np.full((20, 30), 0.5), dark)
    write_picture(np.full((20, 30), 1.5), bright)
    for picture, name, clipped in (
        (dark, "a.png", False), (bright, "b.npy", False), (bright, "c.png", True),
    ):  # fmt: skip
        view = ("simulate", picture, tmp_path / name, "--blur", "0.8", "--step", "1")
        said = run_on(capsys, *view)
        assert ("clipped to [0, 1]" in said) == clipped


def test_a_view_never_takes_the_place_of_its_picture_by_whatever_name(picture, tmp_path, capsys):
    before = picture.read_bytes()
    (tmp_path / "link.npy").symlink_to(picture)
    for out in (picture, tmp_path / "link.npy"):
        assert cli.main(["simulate", str(picture), str(out), "--blur", "1", "--step", "1"]) == 2
        assert "is the picture itself" in capsys.readouterr().err
    assert picture.read_bytes() == before
    (tmp_path / "other.npy").write_bytes(before)  # another file of the same bytes is another one
    out = str(tmp_path / "other.npy")
    assert cli.main(["simulate", str(picture), out, "--blur", "1", "--step", "1"]) == 0


def test_the_summary_counts_what_the_table_holds(tmp_path):
    from argparse import Namespace

    from keystab.cli import library

    found = pd.DataFrame(
        {
            "sign": [1.0, -1.0, -1.0, -1.0],
            "sigma": [1.0, 2.0, 4.0, 9.0],
            "std_y": [0.1, 0.4, 0.1, 0.6],
            "std_x": [0.3, 0.2, 0.2, 0.1],
            "std_log_sigma": [math.log(1.1)] * 4,
            "survival": [0.95, 0.9, 0.5, 0.4],
            "noise": [0.01] * 4,
        }
    )
    # The larger of both deviations of each: 0.3, 0.4, 0.2, 0.6.
    said = library._summary(Namespace(noise=None, output="t.csv", draw=None), found).splitlines()
    words = {line[:16].strip(): line[16:].strip() for line in said}
    assert words["maxima, minima"] == "1, 3"
    assert words["sigma"] == "1 to 9 px, half of them below 3"
    assert words["position"].startswith(
        "half have a standard deviation below 0.35 px, nine tenths below 0.54"
    )
    assert words["scale"] == "half have one below 10.0%"
    assert words["survival"] == "25% above 0.9, 25% below 0.5"
    assert words["noise"] == "0.01, estimated from the picture"
    given = library._summary(Namespace(noise=0.01, output=None, draw=None), found)
    assert given.endswith("draws them") and "0.01, as given" in given
    bare = library._summary(
        Namespace(noise=None, output="t.csv", draw=None), found[["sign", "sigma"]]
    )
    assert "survival" not in bare and "1, 3" in bare
    assert library._summary(Namespace(noise=None, output="t.csv", draw=None), found[:0]) == ""


@pytest.mark.parametrize(
    ("flag", "text", "value"),
    [
        ("--camera-blur", "auto", "auto"),
        ("--camera-blur", "0.75", 0.75),
        ("--camera-blur", "blurred", None),
        ("--n-oct", "all", "all"),
        ("--n-oct", "3", 3),
        ("--n-oct", "3.5", None),
        ("--max-iterations", "4", 4.0),
        ("--max-iterations", "inf", math.inf),
        ("--max-iterations", "2.5", None),
        ("--noise", "0.01", 0.01),
        ("--noise", "0.01 0.02", (0.01, 0.02)),
        ("--noise", "0.01 0.02 0.03", None),
    ],
)
def test_words_of_the_command_line_become_values(flag, text, value, capsys):
    words = ["uncertainty", "p.png", "--camera-blur", "1", flag, *text.split()]
    if value is None:
        with pytest.raises(SystemExit):
            build_parser().parse_args(words)
        assert f"argument {flag}" in capsys.readouterr().err
    else:
        given = getattr(build_parser().parse_args(words), flag[2:].replace("-", "_"))
        assert given == value and type(given) is type(value)


@pytest.mark.parametrize(
    ("text", "good"),
    [("5", True), ("1e-3", True), ("0", False), ("-1", False), ("inf", False), ("x", False)],
)
def test_seconds_of_an_audit_are_above_zero(text, good, capsys):
    words = ["audit", "mine:detect", "-o", "out", "--time-limit", text]
    if good:
        assert build_parser().parse_args(words).time_limit == float(text)
    else:
        with pytest.raises(SystemExit):
            build_parser().parse_args(words)
        assert "is no time" in capsys.readouterr().err


def test_each_command_samples_as_its_question_needs():
    plain = ["p.png", "--camera-blur", "1"]
    for command, n_spo, n_oct in (("detect", 3, 1), ("uncertainty", 15, "all")):
        given = build_parser().parse_args([command, *plain])
        assert (given.n_spo, given.n_oct) == (n_spo, n_oct)
