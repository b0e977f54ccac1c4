"""Stages read, call and write; what goes wrong gets one line and leaves nothing behind."""

from __future__ import annotations

import errno
import importlib
from pathlib import Path

import numpy as np
import pytest

from keystab.figures import _render, fig4
from keystab.io.pictures import pixel_digest, write_picture
from keystab.io.tables import read_table
from keystab.stages import (
    count_refined,
    cut_cubes,
    detect,
    detect_views,
    find_true_extrema,
    match_samplings,
    scale_space,
    scale_spaces,
    score_features,
    score_predictors,
    simulate,
)
from keystab.utils.stage_command import command

STAGES = sorted(
    path.stem
    for path in (Path(detect.__file__).parent).glob("*.py")
    if not path.stem.startswith("_")
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
        "name": "still",
        "blur": "1.1",
        "step": "2",
        "shift-y": "0.0",
        "shift-x": "0.0",
        "rotation": "0.0",
        "tilt": "0.0",
        "azimuth": "0.0",
        "focal-length": "800",
        "noise": "0.0",
        "height": "None",
        "width": "None",
        "whole": "False",
        "guard": "0",
        "dtype": "float32",
        "views": str(folder / "views"),
        "views-digest": str(folder / "views.sha256"),
    } | {name.replace("_", "-"): value for name, value in changes.items()}
    return [text for name, value in options.items() for text in (f"--{name}", *value.split())]


def detect_arguments(folder: Path, name: str, *more: str) -> list[str]:
    return [
        *("--views", str(folder / "views"), "--views-digest", str(folder / "views.sha256")),
        *("--n-spo", "4", *DETECTOR, "--epsilon", "0.0", "--scale-moves", "True"),
        *("--move", "nearest", "--max-offset", "0.5"),
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
    digest = ["--store-digest", str(tmp_path / "n4.sha256")]
    assert scale_space.main([*views, "--n-spo", "4", *DETECTOR, *store, *digest]) == 0
    checked = [*store, "--store-digest", str(tmp_path / "n4.sha256")]
    assert detect.main(detect_arguments(tmp_path, "streamed")) == 0
    assert detect.main(detect_arguments(tmp_path, "stored", *checked)) == 0
    for name in ("", "_traces"):
        streamed, stored = (tmp_path / f"{how}{name}.parquet" for how in ("streamed", "stored"))
        assert streamed.read_bytes() == stored.read_bytes()
    found = read_table(tmp_path / "stored.parquet")
    assert len(found) > 10 and (found["n_spo"] == 4).all()


def views_arguments(folder: Path, *more: str) -> list[str]:
    return [
        *("--views", str(folder / "views"), "--views-digest", str(folder / "views.sha256")),
        *("--n-spo", "4", "--assumed-blur", "None", "--n-oct", "2", "--delta-min", "None"),
        *(*DETECTOR, *more),
    ]


def test_stored_and_streamed_detections_of_a_set_are_the_same_to_the_bit(reference, tmp_path):
    several = {"shift_y": "0.0 0.3", "step": "3 4", "whole": "True", "guard": "2"}
    assert simulate.main(view_arguments(reference, tmp_path, **several)) == 0
    stores, checksums = str(tmp_path / "stores"), str(tmp_path / "stores.sha256")
    assert (
        scale_spaces.main(views_arguments(tmp_path, "--store", stores, "--store-digest", checksums))
        == 0
    )
    search = [
        "--guard",
        "2",
        "--epsilon",
        "0.0",
        "--scale-moves",
        "True",
        "--move",
        "nearest",
        "--max-offset",
        "0.5",
    ]
    written = {}
    for how, more in (
        ("streamed", []),
        ("stored", ["--store", stores, "--store-digest", checksums]),
    ):
        tables = [tmp_path / f"{how}_{what}.parquet" for what in ("extrema", "traces")]
        names = ["--extrema", str(tables[0]), "--traces", str(tables[1])]
        assert detect_views.main(views_arguments(tmp_path, *search, *names, *more)) == 0
        written[how] = [table.read_bytes() for table in tables]
    assert written["streamed"] == written["stored"]
    found = read_table(tmp_path / "stored_extrema.parquet")
    assert set(found["view"]) == {0, 1} and set(found["octave"]) == {0, 1}
    traces = read_table(tmp_path / "stored_traces.parquet")
    assert set(traces["keypoint"]) == set(range(len(found)))


def test_store_of_another_scale_space_is_refused(reference, tmp_path, capsys):
    simulate.main(view_arguments(reference, tmp_path))
    views = ["--views", str(tmp_path / "views"), "--views-digest", str(tmp_path / "views.sha256")]
    store = ["--store", str(tmp_path / "n5")]
    digest = ["--store-digest", str(tmp_path / "n5.sha256")]
    scale_space.main([*views, "--n-spo", "5", *DETECTOR, *store, *digest])
    capsys.readouterr()
    checked = [*store, "--store-digest", str(tmp_path / "n5.sha256")]
    assert detect.main(detect_arguments(tmp_path, "wrong", *checked)) == 2
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


def test_a_damaged_scale_space_is_refused(reference, tmp_path, capsys):
    simulate.main(view_arguments(reference, tmp_path))
    views = ["--views", str(tmp_path / "views"), "--views-digest", str(tmp_path / "views.sha256")]
    store, digest = tmp_path / "n4", tmp_path / "n4.sha256"
    written = ["--store", str(store), "--store-digest", str(digest)]
    assert scale_space.main([*views, "--n-spo", "4", *DETECTOR, *written]) == 0
    chunk = max(store.rglob("c/*/*/*"), key=lambda file: file.stat().st_size)
    data = bytearray(chunk.read_bytes())
    data[100] ^= 1
    chunk.write_bytes(data)
    capsys.readouterr()
    checked = ["--store", str(store), "--store-digest", str(digest)]
    assert detect.main(detect_arguments(tmp_path, "found", *checked)) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1 and f"{chunk.relative_to(store)} is damaged" in said
    assert not list(tmp_path.glob("found*"))


def test_stores_are_never_searched_without_their_checksums(tmp_path, capsys):
    with pytest.raises(SystemExit):
        detect.main(detect_arguments(tmp_path, "found", "--store", str(tmp_path / "n4")))
    assert "--store, --store-digest go together" in capsys.readouterr().err


COMPARED = ["--border", "3.0", "--first-scale", "1.2599210498948732"]
SAME = ["--space-tolerance", "1.0", "--scale-ratio", "1.4142135623730951"]
LABELS = ["--stable-above", "0.8", "--unstable-below", "0.2"]


def seen_at(reference: Path, folder: Path, *samplings: int) -> list[str]:
    """Detect in a view of a scene; return the arguments that name view and tables."""
    assert simulate.main(view_arguments(reference, folder)) == 0
    for n_spo in samplings:
        arguments = detect_arguments(folder, f"n{n_spo}")
        arguments[arguments.index("--n-spo") + 1] = str(n_spo)
        assert detect.main(arguments) == 0
    return [
        *("--views", str(folder / "views"), "--views-digest", str(folder / "views.sha256")),
        *("--samplings", *(str(folder / f"n{n_spo}.parquet") for n_spo in samplings)),
        *("--n-spo", *map(str, samplings), *DETECTOR[:4]),
    ]


def refined_arguments(folder: Path, given: list[str], last_scale: str) -> list[str]:
    return [
        *(*given, "--traces", *(name.replace(".parquet", "_traces.parquet") for name in given if name.endswith(".parquet"))),
        *(*COMPARED, "--last-scale", last_scale, "--max-offset", "0.6", "--max-iterations", "2"),
        *("--table", str(folder / f"refinement_{last_scale}.csv")),
        *("--dead", str(folder / "dead_range.csv")),
    ]  # fmt: skip


def test_refined_keypoints_are_counted_with_and_without_an_upper_end(reference, tmp_path):
    given = seen_at(reference, tmp_path, 3, 5)
    for last_scale in ("None", "2.0"):
        assert count_refined.main(refined_arguments(tmp_path, given, last_scale)) == 0
    open_end, closed = (read_table(tmp_path / f"refinement_{end}.csv") for end in ("None", "2.0"))
    assert open_end["n_refined_octave"].sum() < open_end["n_refined_common"].sum()
    assert (open_end["n_refined_octave"] == closed["n_refined_common"]).all()
    assert (closed["n_refined_octave"] == closed["n_refined_common"]).all()
    assert closed["n_common"].sum() < open_end["n_common"].sum()


def test_the_truth_is_that_of_the_stored_view(reference, tmp_path):
    from keystab.io.view_store import read_view
    from keystab.truth.true_extrema import true_extrema

    assert simulate.main(view_arguments(reference, tmp_path, step="5", blur="0.9")) == 0
    given = [str(tmp_path / "views"), "--views-digest", str(tmp_path / "views.sha256")]
    out = tmp_path / "truth.parquet"
    arguments = ["--views", *given, "--sigma-min", "1.2", "--kappa", "1.3"]
    arguments += ["--sigma-max", "2.4", "--table", str(out)]
    assert find_true_extrema.main(arguments) == 0
    view = read_view(tmp_path / "views", tmp_path / "views.sha256")
    found = read_table(out)
    assert len(found) > 3 and view.blur == 0.9
    assert found.equals(true_extrema(view.image, 0.9, 1.2, 2.4, 1.3))


def test_single_detections_of_several_scenes_are_scored(reference, tmp_path):
    assert simulate.main(view_arguments(reference, tmp_path, step="3")) == 0
    views = ["--views", str(tmp_path / "views"), "--views-digest", str(tmp_path / "views.sha256")]
    for n_spo in ("3", "4"):
        arguments = detect_arguments(tmp_path, f"n{n_spo}")
        arguments[arguments.index("--n-spo") + 1] = n_spo
        assert detect.main(arguments) == 0
    samplings = [str(tmp_path / f"n{n_spo}.parquet") for n_spo in (3, 4)]

    same = [
        "--space-tolerance",
        "1.0",
        "--scale-ratio",
        "1.4142135623730951",
        "--match-sign",
        "False",
    ]
    compared = ["--border", "3.0", "--first-scale", "1.05", "--last-scale", "None"]
    scales = ["--sigma-min", "1.1", "--kappa", "1.2599210498948732"]
    labels = ["--stable-above", "0.8", "--unstable-below", "0.6"]
    names = ("matches", "counts", "keypoints", "occurrence", "summary")
    tables = [text for name in names for text in (f"--{name}", str(tmp_path / f"{name}.csv"))]
    asked = ["--n-spo", "3", "4", *scales, *same, *compared, *labels]
    assert match_samplings.main([*views, "--samplings", *samplings, *asked, *tables]) == 0
    truth = str(tmp_path / "truth.parquet")
    assert find_true_extrema.main([*views, *scales, "--sigma-max", "2.4", "--table", truth]) == 0

    scenes = [
        *("--names", "one", "two", "--views", *[views[1]] * 2, "--views-digest", *[views[3]] * 2),
        *("--keypoints", *[str(tmp_path / "keypoints.csv")] * 2, "--truth", truth, truth),
        *("--samplings", *samplings, *samplings),
    ]
    split = ["--end", "2.0", "--block", "20.0", "--n-folds", "3", "--n-resamples", "100"]
    names = ("detections", "auc", "gain", "roc")
    tables = [text for name in names for text in (f"--{name}", str(tmp_path / f"{name}.csv"))]
    assert score_predictors.main([*scenes, *asked, *split, *tables]) == 0
    scored, auc = read_table(tmp_path / "detections.csv"), read_table(tmp_path / "auc.csv")
    assert len(scored) > 10 and set(scored["n_spo"]) == {3, 4}
    # The same scene twice: the same predictors, and the same areas of those that learn nothing.
    areas = auc[auc["validation"] == "none"].pivot(
        index=["label", "predictor"], columns="picture", values="auc"
    )
    assert areas["one"].equals(areas["two"]) and areas.loc["stability"].notna().all(axis=None)


def test_a_picture_without_detail_has_no_keypoints_and_is_named_where_some_are_needed(
    tmp_path, capsys
):
    scene = tmp_path / "grey.tif"
    write_picture(np.full((240, 320), 0.5), scene)
    given = seen_at(scene, tmp_path, 3, 4)
    assert len(read_table(tmp_path / "n3.parquet")) == len(read_table(tmp_path / "n4.parquet")) == 0
    assert count_refined.main(refined_arguments(tmp_path, given, "None")) == 0
    counted = read_table(tmp_path / "refinement_None.csv")
    assert counted["n_refined_common"].tolist() == [0, 0]

    names = ("matches.parquet", "counts.csv", "keypoints.csv", "occurrence.csv", "summary.csv")
    tables = [text for name in names for text in (f"--{name.split('.')[0]}", str(tmp_path / f"fig4_{name}"))]  # fmt: skip
    matched = [*given, *SAME, "--match-sign", "False", *COMPARED, "--last-scale", "None"]
    assert match_samplings.main([*matched, *LABELS, *tables]) == 0
    assert read_table(tmp_path / "fig4_counts.csv")["n_extrema"].tolist() == [0, 0]
    assert len(read_table(tmp_path / "fig4_keypoints.csv")) == 0

    keypoints = ["--keypoints", str(tmp_path / "fig4_keypoints.csv")]
    views, samplings = given[:4], given[4:7]
    scores = [text for name in ("features", "thresholds", "roc", "auc") for text in (f"--{name}", str(tmp_path / f"{name}.csv"))]  # fmt: skip
    matches = ["--matches", str(tmp_path / "fig4_matches.parquet")]
    panels = ["--panels", str(tmp_path / "p.csv"), "--cubes", str(tmp_path / "c.parquet")]
    dense = ["--n-spo", "16", "--per-group", "2", *DETECTOR]
    capsys.readouterr()
    for stage, arguments in (
        (score_features, [*keypoints, *matches, *samplings, *LABELS, "--n-resamples", "100", *scores]),
        (cut_cubes, [*views, *keypoints, *dense, *SAME, *LABELS, *panels]),
    ):  # fmt: skip
        assert stage.main(arguments) == 2
        said = capsys.readouterr().err
        assert said.count("\n") == 1
        assert "fig4_keypoints.csv has no keypoints: no sampling finds an extremum" in said
        assert "give a picture with more detail" in said
    arguments = ["--tables", str(tmp_path), "--pdf", str(tmp_path / "fig4.pdf")]
    assert _render.main(fig4.draw, fig4.TABLES, arguments) == 2
    said = capsys.readouterr().err
    assert (
        said.count("\n") == 1 and "nothing to draw; remake the table, from another picture" in said
    )


def test_blur_of_the_reference_adds_to_that_of_the_camera(reference, tmp_path):
    from keystab.io.view_store import read_view

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
    @command
    def main():
        raise error

    assert main([]) == 2
    assert capsys.readouterr().err == line


def test_defects_keep_their_traceback():
    @command
    def main():
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        main([])
