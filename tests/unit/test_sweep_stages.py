"""Sets of views that differ in one value: what is matched within each, and what is cropped."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import scenes

from keystab.io.pictures import write_picture
from keystab.io.tables import read_table
from keystab.io.view_store import read_view, read_views
from keystab.stages import (
    crop_views,
    describe_views,
    detect_views,
    match_sweep,
    match_views,
    noise_theory,
    simulate,
)

KAPPA = "1.2599210498948732"
NOISES = (0.0, 0.02)
N_VIEWS = 3


@pytest.fixture(scope="module")
def sets(tmp_path_factory) -> list[Path]:
    """Two sets of three views of one scene: without noise, so that all are the same, and with."""
    folder = tmp_path_factory.mktemp("sweep")
    write_picture(scenes.blobs((180, 220), 5), folder / "scene.tif")
    members = []
    for noise in NOISES:
        member = folder / f"noise_{noise}"
        member.mkdir()
        views = ["--views", str(member / "views"), "--views-digest", str(member / "views.sha256")]
        arguments = [
            *("--reference", str(folder / "scene.tif"), "--reference-sha256", "None"),
            *("--reference-blur", "0.0", "--name", "noise", "--blur", "0.8", "--step", "2"),
            *("--shift-y", "0.0", "--shift-x", "0.0", "--rotation", "0.0"),
            *("--tilt", "0.0", "--azimuth", "0.0", "--focal-length", "800"),
            *("--noise", *[str(noise)] * N_VIEWS, "--height", "None", "--width", "None"),
            *("--whole", "False", "--guard", "0", "--dtype", "float64", *views),
        ]
        assert simulate.main(arguments) == 0
        arguments = [
            *("--views", str(member / "views"), "--views-digest", str(member / "views.sha256")),
            *("--n-spo", "4", "--assumed-blur", "None", "--n-oct", "2", "--delta-min", "None"),
            *("--sigma-min", "1.1", "--kappa", KAPPA, "--oversampling", "spline"),
            *("--guard", "0", "--epsilon", "0.0", "--scale-moves", "True", "--move", "nearest"),
            *("--max-offset", "0.5", "--extrema", str(member / "extrema.parquet")),
            *("--traces", str(member / "traces.parquet")),
        ]
        assert detect_views.main(arguments) == 0
        members.append(member)
    return members


def files(sets, name):
    return [str(member / name) for member in sets]


def matching(sets, folder, *more):
    return [
        *("--views", *files(sets, "views"), "--views-digest", *files(sets, "views.sha256")),
        *("--extrema", *files(sets, "extrema.parquet"), "--traces", *files(sets, "traces.parquet")),
        *("--name", "noise", "--values", *map(str, NOISES), "--sigma-min", "1.1", "--n-oct", "2"),
        *("--guard", "0", "--border", "3.0", "--first-scale", KAPPA, "--last-scale", "None"),
        *("--space-tolerance", "1.0", "--scale-ratio", "1.4142135623730951"),
        *("--match-sign", "False", "--max-offset", "0.6", "--max-iterations", "2"),
        *("--n-resamples", "20", "--curves", str(folder / "curves.csv")),
        *("--counts", str(folder / "counts.csv"), *more),
    ]


def test_each_set_of_a_sweep_is_matched_within_itself(sets, tmp_path):
    scales = [
        "--starts",
        "1.1",
        "2.2",
        "--seen-by",
        "0.7",
        "--scales",
        str(tmp_path / "scales.csv"),
    ]
    assert match_sweep.main(matching(sets, tmp_path, *scales)) == 0
    counts, curves, table = (
        read_table(tmp_path / f"{name}.csv") for name in ("counts", "curves", "scales")
    )
    assert counts["noise"].tolist() == list(NOISES)
    assert (counts["n_views"] == N_VIEWS).all()
    same, noisy = (row for _, row in counts.iterrows())
    # Three times the same view: every keypoint is seen in all, and their number does not vary.
    assert same["mean_detections"] == same["low_detections"] >= same["n_unique"] > 20
    assert same["share_always"] == 1 > noisy["share_always"]
    assert len(curves) == 2 * N_VIEWS
    assert (curves.loc[curves["noise"] == 0, "percentage_of_unique"] == 100).all()
    noise_free = table[table["noise"] == 0]
    assert table["sigma_from"].tolist() == [1.1, 2.2] * 2
    assert (table["seen_by"] == 0.7).all()
    assert (noise_free["n_seen"] == noise_free["n_unique"]).all()
    assert (noise_free["percentage_seen"] == 100).all()
    above = noise_free["mean_above"].to_numpy()
    assert above[0] > above[1] and above[1] >= noise_free["n_unique"].iloc[1]


def test_curves_and_counts_are_the_same_without_scales(sets, tmp_path):
    (tmp_path / "with").mkdir()
    scales = ["--starts", "1.1", "--seen-by", "0.7", "--scales", str(tmp_path / "scales.csv")]
    assert match_sweep.main(matching(sets, tmp_path / "with", *scales)) == 0
    assert match_sweep.main(matching(sets, tmp_path)) == 0
    for name in ("curves.csv", "counts.csv"):
        assert (tmp_path / name).read_bytes() == (tmp_path / "with" / name).read_bytes()


@pytest.mark.parametrize(
    "given", [["--starts", "1.1"], ["--seen-by", "0.7"], ["--starts", "1.1", "--seen-by", "0.7"]]
)
def test_starts_and_scales_go_together(sets, tmp_path, capsys, given):
    try:
        status = match_sweep.main(matching(sets, tmp_path, *given))
    except SystemExit as end:
        status = end.code
    assert status == 2
    assert "go together: give all or none" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def cropping(sets, folder, size):
    return [
        *("--views", *files(sets, "views"), "--views-digest", *files(sets, "views.sha256")),
        *("--name", "noise", "--values", *map(str, NOISES), "--size", str(size)),
        *("--table", str(folder / "pixels.parquet")),
    ]


@pytest.mark.parametrize("size", [16, 15, 1000])
def test_crops_are_the_middle_of_the_first_views(sets, tmp_path, size):
    assert crop_views.main(cropping(sets, tmp_path, size)) == 0
    pixels = read_table(tmp_path / "pixels.parquet")
    for noise, member in zip(NOISES, sets, strict=True):
        image = read_view(member / "views", member / "views.sha256").image
        rows = pixels[pixels["noise"] == noise]
        assert len(rows) == np.prod(np.minimum(size, image.shape))
        assert (rows["grey"].to_numpy() == image[rows["y"], rows["x"]]).all()
        for name, length in zip(("y", "x"), image.shape, strict=True):
            before, after = rows[name].min(), length - 1 - rows[name].max()
            assert 0 <= after - before <= 1
            assert rows[name].nunique() == min(size, length)


def test_theory_covers_all_octaves(tmp_path):
    table = tmp_path / "theory.csv"
    arguments = ["--camera-blur", "0.8", "--sigma-min", "1.1", "--kappa", KAPPA, "--n-oct", "2"]
    assert noise_theory.main([*arguments, "--table", str(table)]) == 0
    theory = read_table(table)
    assert (theory["sigma"].min(), theory["sigma"].max()) == pytest.approx((1.1, 4.4))
    octave = theory.set_index(theory["sigma"].round(9))["dog_noise"]
    ratio = octave[1.1] / octave[2.2]
    assert theory["octave_ratio"].iloc[0] == pytest.approx(ratio)


def test_views_are_described_by_their_own_pixels(sets, tmp_path):
    # Oblong views: height and width, and the axes of the pixels, cannot stand for each other.
    folder = sets[1]
    out = (tmp_path / "views.csv", tmp_path / "pixels.parquet")
    stored = ["--views", str(folder / "views"), "--views-digest", str(folder / "views.sha256")]
    assert describe_views.main([*stored, "--table", str(out[0]), "--pixels", str(out[1])]) == 0
    table, pixels = map(read_table, out)
    assert table["view"].tolist() == list(range(N_VIEWS))
    assert table["label"].tolist() == ["c = 0.8, S = 2"] * N_VIEWS
    for row in table.itertuples():
        image = read_views(folder / "views", folder / "views.sha256")[row.view].image
        own = pixels[pixels["view"] == row.view]
        assert (row.height, row.width) == image.shape and row.height < row.width
        assert (row.blur, row.step, len(own)) == (0.8, 2.0, image.size)
        assert (own["value"].to_numpy() == image[own["y"], own["x"]]).all()
        assert (row.mean, row.standard_deviation) == pytest.approx((image.mean(), image.std()))


def test_samplings_of_one_set_are_matched_with_curves_and_precision_where_they_are_asked_for(
    sets, tmp_path
):
    # Three times the same view: all is seen always, at the same place. Two samplings by name.
    member = sets[0]
    out = {
        name: tmp_path / f"{name}.csv" for name in ("curves", "precision", "counts", "differences")
    }
    words = {
        "views": [member / "views"], "views-digest": [member / "views.sha256"],
        "extrema": [member / "extrema.parquet"] * 2, "traces": [member / "traces.parquet"] * 2,
        "n-spo": [4, 6], "curve-n-spo": [4], "max-offsets": [0.6, 0.9], "iterations": [2, 5],
        "sigma-min": [1.1], "n-oct": [2], "guard": [0], "border": [3.0], "first-scale": [KAPPA],
        "last-scale": [None], "space-tolerance": [1.0], "scale-ratio": [2**0.5],
        "match-sign": [False], "max-offset": [0.6], "max-iterations": [2],
        "minimum-share": [0.5], "n-resamples": [20],
        **{name: [path] for name, path in out.items()},
    }  # fmt: skip
    asked = [text for name, values in words.items() for text in (f"--{name}", *map(str, values))]
    assert match_views.main(asked) == 0
    curves, precision, counts, differences = (read_table(path) for path in out.values())

    def of(table):
        rows = table[["n_spo", "detections", "max_offset", "max_iterations"]].drop_duplicates()
        return {
            tuple(None if pd.isna(it) else it for it in row) for row in rows.to_numpy().tolist()
        }

    discrete, usual = ("discrete", None, None), ("refined", 0.6, 2.0)
    further = {("refined", 0.9, 2.0), ("refined", 0.6, 5.0), ("refined", 0.9, 5.0)}
    assert of(curves) == {(4, *it) for it in {discrete, usual, *further}}
    assert of(counts) == of(curves) | {(6, *discrete), (6, *usual)}
    assert of(precision) == {(n, *it) for n in (4, 6) for it in (discrete, usual)}
    assert (counts["share_always"] == 1).all() and (counts["n_views"] == N_VIEWS).all()
    assert (curves["percentage_of_unique"] == 100).all()
    # Looser limits lose fewer keypoints.
    n = counts[counts["n_spo"] == 4].set_index(["max_offset", "max_iterations"])["n_unique"]
    assert n[0.9, 5] >= n[0.9, 2] >= n[0.6, 2] and n[0.9, 5] >= n[0.6, 5] >= n[0.6, 2]
    assert n[0.9, 5] > n[0.6, 2]
    assert len(differences) > 0
