"""Stages that hold detections against true extrema, given detections whose worth is known."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import scenes

from keystab.evaluation.recall_precision import CAUSES
from keystab.io.pictures import write_picture
from keystab.io.tables import read_table, write_table
from keystab.prediction.features import DIRECTIONS
from keystab.stages import (
    detect,
    evaluate_grid,
    evaluate_kappas,
    evaluate_keypoints,
    evaluate_refinement,
    evaluate_samplings,
    evaluate_views,
    find_true_extrema,
    simulate,
)

KAPPA = 2 ** (1 / 3)
SHAPE = (60, 70)
STILL = {"name": "still", "shift-y": "0.0", "shift-x": "0.0", "guard": "0"}
RANGE = ["--sigma-min", "1.1", "--border", "3.0", "--first-scale", "1.25", "--last-scale", "2.0"]
SAME = ["--space-tolerance", "1.0", "--scale-ratio", "1.4142135623730951"]
ACCEPTED = ["--max-offset", "0.6", "--max-iterations", "2"]
DETECTOR = ["--sigma-min", "1.1", "--kappa", str(KAPPA), "--oversampling", "spline"]
NAMES = ["y", "x", "sigma", "sign"]


def take_views(folder: Path, name: str, **changes: str) -> list[str]:
    """Simulate a set of views of the scene; its store and its checksums."""
    options = STILL | {
        "reference": str(folder / "scene.tif"),
        "reference-sha256": "None",
        "reference-blur": "0.0",
        "blur": "1.1",
        "step": "2",
        "rotation": "0.0",
        "tilt": "0.0",
        "azimuth": "0.0",
        "focal-length": "800",
        "noise": "0.0",
        "height": "None",
        "width": "None",
        "whole": "False",
        "dtype": "float64",
        "views": str(folder / name),
        "views-digest": str(folder / f"{name}.sha256"),
    }
    options |= {"name": name}
    options |= {key.replace("_", "-"): value for key, value in changes.items()}
    words = [text for key, value in options.items() for text in (f"--{key}", *value.split())]
    assert simulate.main(words) == 0
    return [options["views"], options["views-digest"]]


@pytest.fixture(scope="module")
def seen(tmp_path_factory) -> Path:
    """A folder with a scene and a view of it of 60 x 70 pixels."""
    folder = tmp_path_factory.mktemp("judging")
    # Blobs that are twice as large as those of one octave: the camera sees them half the size.
    image = np.kron(scenes.blobs(SHAPE, 3), np.ones((2, 2)))
    write_picture(image, folder / "scene.tif")
    take_views(folder, "still")
    return folder


def still(folder: Path) -> list[str]:
    """Arguments that name the view."""
    return ["--views", str(folder / "still"), "--views-digest", str(folder / "still.sha256")]


def known(n: int = 24) -> pd.DataFrame:
    """True extrema of the compared range, far from each other and from the border."""
    rows = np.arange(n)
    return pd.DataFrame(
        {
            "y": 8.0 + 10 * (rows % 5),
            "x": 8.0 + 10 * (rows // 5),
            "sigma": np.geomspace(1.5, 2.1, n),
            "sign": np.where(rows % 2, 1, -1),
            "conditioning": 0.5,
        }
    )


def discrete(table: pd.DataFrame, **columns: object) -> pd.DataFrame:
    """Detections at the places of true extrema."""
    return table[NAMES].assign(step_sigma=table["sigma"], **columns)


def traced(table: pd.DataFrame, accepted) -> pd.DataFrame:
    """One model for each of these keypoints, which refines it to where it is."""
    offset = np.where(accepted, 0.1, 0.9)
    return table[["y", "x", "sigma"]].assign(
        keypoint=np.arange(len(table)), model=1, value=0.1,
        alpha_s=0.0, alpha_y=offset, alpha_x=0.0,
    )  # fmt: skip


# Nodes of a grid


def test_every_node_of_the_grid_is_judged_by_itself(seen, tmp_path):
    truth = known()
    write_table(truth, tmp_path / "truth.parquet")
    nodes = {
        (3, 0.25): truth[::2],
        (3, 0.5): truth,
        (5, 0.5): pd.concat([truth.assign(y=truth["y"] + 0.3), truth.assign(y=truth["y"] + 5)]),
    }
    for n_spo in (3, 5):
        here = [discrete(found, n_spo=n, delta_min=step) for (n, step), found in nodes.items() if n == n_spo]  # fmt: skip
        # Which are counted is up to the scale after one unbounded quadratic step.
        here[0].iloc[:2, here[0].columns.get_loc("step_sigma")] = 1.2
        write_table(pd.concat(here), tmp_path / f"grid_n{n_spo}.parquet")
    out = tmp_path / "grid.csv"
    grids = [str(tmp_path / f"grid_n{n_spo}.parquet") for n_spo in (3, 5)]
    given = [*still(seen), "--truth", str(tmp_path / "truth.parquet"), "--extrema", *grids]
    assert evaluate_grid.main([*given, *RANGE, *SAME, "--table", str(out)]) == 0
    table = read_table(out)
    assert list(zip(table["n_spo"], table["delta_min"], strict=True)) == list(nodes)
    assert table["recall"].tolist() == [0.5, 1.0, 1.0]
    assert table["precision"].to_numpy() == pytest.approx([1, 1, 22 / 46])
    assert table["n_detections"].tolist() == [len(truth) / 2 - 2, len(truth), 2 * len(truth) - 2]
    assert table["median_location"].to_numpy() == pytest.approx([0, 0, 0.3])
    assert (table["n_true"] == len(truth)).all()


# Ratios of the two blurs


def test_every_ratio_is_held_against_its_own_truth(seen, tmp_path):
    # The second ratio has its extrema elsewhere, and finds a quarter of them.
    truths = {1.1: known(), 1.4: known().assign(y=lambda table: table["y"] + 4)}
    found = {1.1: truths[1.1], 1.4: truths[1.4][::4]}
    for kappa, truth in truths.items():
        write_table(truth, tmp_path / f"truth_{kappa}.parquet")
    extrema = pd.concat(
        [discrete(table, kappa=kappa) for kappa, table in found.items()], ignore_index=True
    )
    write_table(extrema, tmp_path / "extrema.parquet")
    # Of the first ratio every third keypoint is accepted, of the second all are.
    accepted = (extrema.index % 3 == 0) | (extrema["kappa"] == 1.4)
    write_table(traced(extrema, accepted), tmp_path / "traces.parquet")
    out = tmp_path / "kappas.csv"
    arguments = [
        *still(seen),
        *("--truths", *(str(tmp_path / f"truth_{kappa}.parquet") for kappa in truths)),
        *("--kappas", *map(str, truths), "--extrema", str(tmp_path / "extrema.parquet")),
        *("--traces", str(tmp_path / "traces.parquet"), *RANGE, *SAME, *ACCEPTED),
    ]
    assert evaluate_kappas.main([*arguments, "--table", str(out)]) == 0
    table = read_table(out)
    assert table["kappa"].tolist() == [1.1, 1.1, 1.4, 1.4]
    assert table["detections"].tolist() == ["discrete", "refined"] * 2
    assert table["recall"].to_numpy() == pytest.approx([1, 1 / 3, 1 / 4, 1 / 4])
    assert (table["precision"] == 1).all() and (table["median_location"] == 0).all()


# Keypoints of figure 4


def test_causes_are_counted_within_their_groups_and_features_are_asked_for_truth(tmp_path):
    truth = known(6).assign(conditioning=[0.5, 0.5, 0.01, 0.5, 0.5, 0.5])
    truth.loc[3:4, "sigma"] = 1.2  # below the compared range
    write_table(truth, tmp_path / "truth.parquet")
    # Right ones; then a second one beside the first, and two where nothing is.
    others = pd.DataFrame(
        {"y": [8.5, 30.0, 40.0], "x": [8.0, 53.0, 53.0], "sigma": 1.6, "sign": -1}
    )
    keypoints = pd.concat([truth[NAMES], others], ignore_index=True)
    keypoints["stability"] = [1.0, 1.0, 1.0, 0.5, 0.1, 1.0, 0.1, 0.1, 0.5]
    write_table(keypoints.assign(keypoint=range(9)), tmp_path / "keypoints.csv")
    # One feature knows the truth, one is the other way round, all others know nothing.
    direction = pd.Series(DIRECTIONS)
    features = pd.DataFrame(0.0, index=range(9), columns=direction.index)
    features["dog"] = direction["dog"] * (np.arange(9) < 6)
    features["difference"] = -direction["difference"] * (np.arange(9) < 6)
    write_table(features, tmp_path / "features.csv")
    arguments = [
        *("--truth", str(tmp_path / "truth.parquet")),
        *("--keypoints", str(tmp_path / "keypoints.csv")),
        *("--features", str(tmp_path / "features.csv")),
        *("--stable-above", "0.8", "--unstable-below", "0.2", "--n-resamples", "100"),
        *("--causes", str(tmp_path / "causes.csv"), "--auc", str(tmp_path / "auc.csv")),
    ]
    assert evaluate_keypoints.main([*arguments, *RANGE, *SAME]) == 0
    causes = read_table(tmp_path / "causes.csv")
    counted = causes.pivot(index="group", columns="cause", values="n")[list(CAUSES)]
    assert counted.loc["stable"].tolist() == [3, 1, 0, 0, 0]
    assert counted.loc["between"].tolist() == [0, 0, 1, 0, 1]
    assert counted.loc["unstable"].tolist() == [0, 0, 1, 1, 1]
    assert causes.groupby("group")["share"].sum().to_numpy() == pytest.approx(1)
    assert (causes["low"] <= causes["share"]).all() and (causes["share"] <= causes["high"]).all()
    areas = read_table(tmp_path / "auc.csv").set_index(["label", "feature"])
    assert (areas.loc["truth", "n_good"] == 6).all() and (areas.loc["truth", "n_bad"] == 3).all()
    assert (
        areas.loc[("truth", "dog"), "auc"] == 1 and areas.loc[("truth", "difference"), "auc"] == 0
    )
    assert areas.loc[("truth", "condition"), "auc"] == 0.5
    # Of the unstable ones one is right, so that what knows the truth is not perfect there.
    assert areas.loc[("stability", "dog"), "auc"] == pytest.approx(5 / 6)
    assert areas.loc[("stability", "dog"), ["n_good", "n_bad"]].tolist() == [4, 3]


# Sets of views


def test_views_are_held_against_the_scene_in_its_own_frame(seen, tmp_path):
    guard, shift = 4, (2, -3)
    views = take_views(seen, "moved", shift_y="0 2", shift_x="0 -3", guard=str(guard))
    truth = known()
    write_table(truth, tmp_path / "scene.parquet")
    first = truth.assign(y=truth["y"] + guard, x=truth["x"] + guard)
    second = first.assign(y=first["y"] - shift[0], x=first["x"] - shift[1])[::4]
    seen_twice = [discrete(table, view=view) for view, table in enumerate((first, second))]
    extrema = pd.concat(seen_twice, ignore_index=True)
    write_table(extrema, tmp_path / "extrema.parquet")
    write_table(traced(extrema, extrema["sign"] > 0), tmp_path / "traces.parquet")
    out = tmp_path / "views.csv"
    arguments = [
        *still(seen),
        *("--truth", str(tmp_path / "scene.parquet"), "--sets", views[0], "--sets-digest", views[1]),
        *("--extrema", str(tmp_path / "extrema.parquet")),
        *("--traces", str(tmp_path / "traces.parquet"), "--sweeps", "noise", "--values", "0.03"),
        *("--n-spo", "15", "--guards", str(guard), *RANGE, *SAME, *ACCEPTED),
    ]  # fmt: skip
    assert evaluate_views.main([*arguments, "--table", str(out)]) == 0
    table = read_table(out)
    assert table["detections"].tolist() == ["discrete", "refined"]
    assert (table["sweep"] == "noise").all() and (table["value"] == 0.03).all()
    assert (table["n_views"] == 2).all() and (table["n_true"] == len(truth)).all()
    # The first view finds all, the second every fourth; these have the sign that is not refined.
    assert table["recall"].to_numpy() == pytest.approx([(1 + 1 / 4) / 2, (1 / 2 + 0) / 2])
    assert table["precision"].iloc[0] == 1
    assert table["median_location"].iloc[0] == pytest.approx(0, abs=1e-12)


# Detections of a real view


@pytest.fixture(scope="module")
def detected(seen) -> Path:
    """The true extrema of the view, and its detections at two samplings."""
    arguments = [*still(seen), "--sigma-min", "1.1", "--kappa", str(KAPPA)]
    arguments += ["--sigma-max", "2.6", "--table", str(seen / "truth.parquet")]
    assert find_true_extrema.main(arguments) == 0
    for n_spo in (3, 9):
        arguments = [
            *(*still(seen), "--n-spo", str(n_spo), *DETECTOR, "--epsilon", "0.0"),
            *("--scale-moves", "True", "--move", "nearest", "--max-offset", "0.5"),
            *("--extrema", str(seen / f"n{n_spo}.parquet")),
            *("--traces", str(seen / f"traces_n{n_spo}.parquet")),
        ]
        assert detect.main(arguments) == 0
    return seen


def inside(table: pd.DataFrame, scale: str = "sigma") -> np.ndarray:
    """Rows of the compared range, counted by hand."""
    y, x = table["y"], table["x"]
    place = (y >= 3) & (y <= SHAPE[0] - 4) & (x >= 3) & (x <= SHAPE[1] - 4)
    return (place & table[scale].between(1.1 * 1.25, 2.2)).to_numpy()


def judging(folder: Path) -> list[str]:
    samplings = ["--samplings", *(str(folder / f"n{n}.parquet") for n in (3, 9))]
    return [
        *still(folder),
        "--truth",
        str(folder / "truth.parquet"),
        *samplings,
        "--n-spo",
        "3",
        "9",
        *DETECTOR,
        *RANGE[2:],
        *SAME,
    ]


def test_finer_and_refined_detections_lie_nearer_to_the_truth(detected, tmp_path):
    traces = ["--traces", *(str(detected / f"traces_n{n}.parquet") for n in (3, 9))]
    out = tmp_path / "samplings.csv"
    arguments = [*judging(detected), *traces, *ACCEPTED, "--table", str(out)]
    assert evaluate_samplings.main(arguments) == 0
    table = read_table(out)
    labels = ["n_spo", "detections"]
    assert table[labels].values.tolist() == [
        [n, what] for n in (3, 9) for what in ("discrete", "refined")
    ]
    assert (table["oversampling"] == "spline").all()
    balanced = [2**0.5 * KAPPA * 1.1 * (2 ** (1 / n) - 1) for n in (3, 3, 9, 9)]
    assert table["delta_min"].to_numpy() == pytest.approx(balanced)
    truth = read_table(detected / "truth.parquet")
    assert (table["n_true"] == inside(truth).sum()).all() and inside(truth).sum() > 10
    for n, counted in ((3, table.iloc[0]), (9, table.iloc[2])):
        extrema = read_table(detected / f"n{n}.parquet")
        assert counted["n_detections"] == inside(extrema, "step_sigma").sum()
    by = table.set_index(labels)
    for quantity in ("median_location", "median_scale"):
        coarse, coarse_refined, fine, fine_refined = table[quantity]
        assert coarse > coarse_refined > fine_refined and coarse > fine > fine_refined
    assert by.loc[(9, "discrete"), "recall"] >= 0.9


def test_every_way_to_refine_keeps_or_loses_what_there_is(detected, tmp_path):
    out = tmp_path / "refinement.csv"
    limits = ["--max-offsets", "0.5", "0.6", "inf", "--most-iterations", "3"]
    assert evaluate_refinement.main([*judging(detected), *limits, "--table", str(out)]) == 0
    table = read_table(out)
    ways = ["n_spo", "move", "scale_moves", "max_offset"]
    assert (
        len(table) == 2 * 2 * 2 * 3 * 4 and not table[[*ways, "max_iterations"]].duplicated().any()
    )
    for n_spo, rows in table.groupby("n_spo"):
        extrema = read_table(detected / f"n{n_spo}.parquet")
        n_true, n_false = (
            rows["kept_true"] + rows["lost_true"],
            rows["kept_false"] + rows["lost_false"],
        )
        assert n_true.nunique() == n_false.nunique() == 1 and n_true.iloc[0] > 10
        assert n_true.iloc[0] + n_false.iloc[0] == inside(extrema, "step_sigma").sum()
    # More models lose less of anything, and no limit of the offset loses nothing.
    for _, rows in table.sort_values("max_iterations").groupby(ways):
        assert rows["kept_true"].is_monotonic_increasing
        assert rows["kept_false"].is_monotonic_increasing
    unlimited = table[table["max_offset"] == np.inf]
    assert (unlimited[["lost_true", "lost_false"]] == 0).all(axis=None)
    # The first model is the same whatever comes after it.
    once = table[table["max_iterations"] == 1]
    for _, rows in once.groupby(["n_spo", "max_offset"]):
        assert rows["kept_true"].nunique() == rows["kept_false"].nunique() == 1
    # More models do save some, of which the first lies too far from its stationary point.
    strict = table[table["max_offset"] == 0.5].groupby(["n_spo", "move"])["lost_true"]
    assert (strict.max() > strict.min()).all()
