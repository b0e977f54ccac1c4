"""Stages read, call and write; what goes wrong gets one line and leaves nothing behind."""

from __future__ import annotations

import errno
import importlib
from pathlib import Path

import numpy as np
import pytest

from keystab.pictures import pixel_digest, write_picture
from keystab.stages import _run, detect, scale_space, simulate
from keystab.tables import read_table

STAGES = sorted(
    path.stem for path in (Path(_run.__file__).parent).glob("*.py") if not path.stem.startswith("_")
)
DETECTOR = ["--sigma-min", "1.1", "--kappa", "1.2599210498948732", "--oversampling", "spline"]


@pytest.fixture(scope="module")
def reference(tmp_path_factory) -> Path:
    """A scene of 240 x 320 random pixels."""
    path = tmp_path_factory.mktemp("scene") / "scene.tif"
    write_picture(np.random.default_rng(1).random((240, 320)), path)
    return path


def view_arguments(reference: Path, folder: Path, **changes: str) -> list[str]:
    options = {
        "reference": str(reference),
        "reference-sha256": "None",
        "reference-blur": "0.0",
        "set": "still",
        "blur": "1.1",
        "step": "2",
        "shift-y": "0.0",
        "shift-x": "0.0",
        "rotation": "0.0",
        "noise": "0.0",
        "height": "None",
        "width": "None",
        "dtype": "float32",
        "store": str(folder / "views"),
        "digest": str(folder / "views.sha256"),
    } | {name.replace("_", "-"): value for name, value in changes.items()}
    return [text for name, value in options.items() for text in (f"--{name}", *value.split())]


def detect_arguments(folder: Path, name: str, *more: str) -> list[str]:
    return [
        *("--views", str(folder / "views"), "--views-digest", str(folder / "views.sha256")),
        *("--n-spo", "4", *DETECTOR, "--epsilon", "0.0", "--scale-moves", "True"),
        *("--move", "nearest", "--max-offset", "None"),
        *("--extrema", str(folder / f"{name}.parquet")),
        *("--traces", str(folder / f"{name}_traces.parquet"), *more),
    ]


@pytest.mark.parametrize("name", STAGES)
def test_every_stage_explains_itself(name, capsys):
    with pytest.raises(SystemExit) as caught:
        importlib.import_module(f"keystab.stages.{name}").main(["--help"])
    assert caught.value.code == 0
    assert len(capsys.readouterr().out.splitlines()) > 8


def test_stored_and_streamed_detections_are_the_same_to_the_bit(reference, tmp_path):
    assert simulate.main(view_arguments(reference, tmp_path)) == 0
    views = ["--views", str(tmp_path / "views"), "--views-digest", str(tmp_path / "views.sha256")]
    store = ["--store", str(tmp_path / "n4")]
    digest = ["--digest", str(tmp_path / "n4.sha256")]
    assert scale_space.main([*views, "--n-spo", "4", *DETECTOR, *store, *digest]) == 0
    assert detect.main(detect_arguments(tmp_path, "streamed")) == 0
    assert detect.main(detect_arguments(tmp_path, "stored", *store)) == 0
    for name in ("", "_traces"):
        streamed, stored = (tmp_path / f"{how}{name}.parquet" for how in ("streamed", "stored"))
        assert streamed.read_bytes() == stored.read_bytes()
    found = read_table(tmp_path / "stored.parquet")
    assert len(found) > 10 and (found["n_spo"] == 4).all()


def test_store_of_another_scale_space_is_refused(reference, tmp_path, capsys):
    simulate.main(view_arguments(reference, tmp_path))
    views = ["--views", str(tmp_path / "views"), "--views-digest", str(tmp_path / "views.sha256")]
    store = ["--store", str(tmp_path / "n5")]
    digest = ["--digest", str(tmp_path / "n5.sha256")]
    scale_space.main([*views, "--n-spo", "5", *DETECTOR, *store, *digest])
    capsys.readouterr()
    assert detect.main(detect_arguments(tmp_path, "wrong", *store)) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1 and "n_spo = 5, wanted is 4" in said
    assert not list(tmp_path.glob("wrong*"))


def test_wrong_picture_is_named_with_its_digest(reference, tmp_path, capsys):
    arguments = view_arguments(reference, tmp_path, reference_sha256="f" * 64)
    assert simulate.main(arguments) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1 and f"reference_sha256: {pixel_digest(reference)}" in said
    assert not list(tmp_path.iterdir())


def test_tampered_views_are_refused(reference, tmp_path, capsys):
    simulate.main(view_arguments(reference, tmp_path))
    chunk = tmp_path / "views/data.zarr/image/c/0/0/0"
    data = bytearray(chunk.read_bytes())
    data[100] ^= 1
    chunk.write_bytes(data)
    capsys.readouterr()
    assert detect.main(detect_arguments(tmp_path, "found")) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1 and "data.zarr/image/c/0/0/0 is damaged" in said


def test_blur_of_the_reference_adds_to_that_of_the_camera(reference, tmp_path):
    from keystab.stages._inputs import read_view

    simulate.main(view_arguments(reference, tmp_path, blur="0.9", step="4", reference_blur="1.6"))
    view = read_view(tmp_path / "views", tmp_path / "views.sha256")
    assert view.blur == pytest.approx(np.hypot(0.9, 1.6 / 4), rel=1e-15)
    assert view.shape == (60, 80)


@pytest.mark.parametrize(
    ("error", "line"),
    [
        (MemoryError("3 GB"), "error: the memory does not suffice: 3 GB\n"),
        (OSError(errno.ENOSPC, "No space left on device", "x.csv"), "error: x.csv: No space left on device\n"),
    ],
)  # fmt: skip
def test_machines_at_their_limits_get_one_line(error, line, capsys):
    @_run.stage
    def main(argv=None):
        raise error

    assert main([]) == 2
    assert capsys.readouterr().err == line


def test_defects_keep_their_traceback():
    @_run.stage
    def main(argv=None):
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        main([])
