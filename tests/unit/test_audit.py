"""Audits: controls and libraries whose answers are known, wrong detectors, words and tables."""

from __future__ import annotations

import importlib
import math
import re
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from scipy import ndimage

from keystab import __version__
from keystab.audit import measures
from keystab.audit.conditions import (
    BLUR,
    CONDITIONS,
    HIGH,
    KAPPA,
    LOW,
    MARGIN,
    PLAN,
    QUICK,
    SPAN,
    STEP,
    Stage,
    blobs,
    condition_of,
    made_picture,
    scene_of,
    views_of,
)
from keystab.audit.controls import CONTROLS
from keystab.audit.detectors import DETECTORS, FINE, Detector, chosen, own_detector
from keystab.audit.isolation import Found, Limits, detections
from keystab.audit.measures import measured
from keystab.audit.page import as_table, findings, page
from keystab.audit.phases import even_phases, spread_points
from keystab.audit.run import (
    COLUMNS,
    Audit,
    audited,
    joined,
    with_conventions,
)
from keystab.audit.worker import columns_of
from keystab.camera.simulation import Scene
from keystab.camera.views import ViewSpec
from keystab.cli.main import main
from keystab.errors import InputError
from keystab.io.keypoint_conventions import KEYSTAB, Convention
from keystab.io.tables import read_table
from keystab.parameters import AuditPlan

ROOT = Path(__file__).parents[2]
SMALL = AuditPlan(width=80, n_views=2, blobs=10)
BLOBS = blobs(SMALL)
SLOW = pytest.mark.slow
SHOWN = ("blobs", "translations", "blur 1.1", "zoom 1.6", "rotation 90", "noise 0.03")


def python_with(module: str) -> str:
    """Python of an environment that has a module; the test is skipped where there is none."""
    for python in (sys.executable, str(ROOT / ".venv-audit/bin/python")):
        command = [python, "-c", f"import {module}"]
        try:
            if not subprocess.run(command, capture_output=True).returncode:
                return python
        except OSError:
            continue
    pytest.skip(f"{module} is not installed: make audit installs it in .venv-audit")


@pytest.fixture(scope="module")
def stage() -> Stage:
    """A scene of blobs, whose true extrema have a closed form."""
    size = int(STEP * SPAN * 80)
    n, apart, sizes = 9, size / 10, (7.0, 10.0, 14.0)
    y, x = (np.mgrid[1 : n + 1, 1 : n + 1].reshape(2, -1) * apart) + 3 * spread_points(n * n).T
    sigma = np.resize(sizes, n * n)
    at = np.arange(size)
    rows, columns = (
        np.exp(-((at[None, :] - p[:, None]) ** 2) / (2 * sigma[:, None] ** 2)) for p in (y, x)
    )
    truth = pd.DataFrame({"y": y, "x": x, "sigma": sigma / math.sqrt(KAPPA)})
    return Stage(Scene(0.2 + 0.5 * rows.T @ columns), truth, (80, 80))


@pytest.fixture(scope="module")
def controls(stage):
    audit = Audit([condition_of(name, SMALL, stage) for name in SHOWN])
    tables = audit.controls()
    return tables._replace(audit=with_conventions(tables.audit))


def rows(tables, setting, condition=None):
    own = tables.audit[tables.audit["setting"] == setting]
    return own if condition is None else own[own["condition"] == condition].iloc[0]


# What detectors are shown


def test_there_are_a_hundred_blobs_of_each_size_of_all_phases():
    for view in BLOBS.views:
        assert len(view.truth) >= 100 and view.wanted.all()
        phases = view.truth[["y", "x"]].to_numpy() % 1
        for axis in range(2):
            counts = np.histogram(phases[:, axis], 5, (0, 1))[0]
            assert counts.min() >= 0.7 * len(phases) / 5
        y, x = np.round(view.truth.iloc[7][["y", "x"]]).astype(int)
        assert view.image[y, x] > 0.7 and view.image.min() >= 0 and view.image.max() <= 1
        assert view.truth["sigma"].between(LOW, HIGH).all()


@pytest.mark.parametrize("plan", [PLAN, QUICK], ids=["plan", "quick"])
def test_phases_are_even_and_others_for_each_size(plan):
    n = plan.blobs
    sets = [view.truth[["y", "x"]].to_numpy() % 4 for view in blobs(plan).views]
    np.testing.assert_allclose(sets[1], even_phases(n, 1), atol=1e-9)
    grid = np.mgrid[:n, :n].reshape(2, -1)
    for places in sets:
        for values in places.T:
            assert np.ptp(np.histogram(values % 1, 10, (0, 1))[0]) <= 2
            assert np.ptp(np.histogram(values, 4, (0, 4))[0]) <= 1
            for step in (0.5, 1, 2, 4):
                assert abs(np.mean(values - step * np.round(values / step))) < 1e-3
        for step in (1, 2, 4):
            left = (places - step * np.round(places / step)).T
            assert np.abs(np.corrcoef(left)[0, 1]) < 0.1
            assert np.abs(np.corrcoef(left, grid)[:2, 2:]).max() < 0.11
    for first, second in ((0, 1), (1, 2), (0, 2)):
        both = np.intersect1d(*(np.round(sets[k][:, 0] % 1, 6) for k in (first, second)))
        assert len(both) <= 1


@pytest.mark.parametrize("plan", [PLAN, QUICK], ids=["plan", "quick"])
@pytest.mark.parametrize("step", [1, 2])
def test_a_detector_that_rounds_has_no_bias_and_no_drift(plan, step):
    condition = blobs(plan)
    for view in condition.views:
        apart = np.diff(np.sort(view.truth["x"].to_numpy().reshape(plan.blobs, -1)))
        assert apart.min() >= 7 * view.truth["sigma"].iloc[0]
    columns = [
        (step * np.round(view.truth[["y", "x"]] / step)).assign(scale=view.truth["sigma"])
        for view in condition.views
    ]
    row = measured(condition, columns, KEYSTAB).row
    assert abs(row["bias_y"]) < 0.01 and abs(row["bias_x"]) < 0.01 and row["recall"] == 1.0
    assert row["phase_pattern"] == "no offsets" and row["phase_step"] == step
    for axis in "yx":
        assert row[f"drift_{axis}_low"] < 0 < row[f"drift_{axis}_high"]


def test_views_of_all_conditions_see_the_same_scene(stage):
    for name in CONDITIONS[1:]:
        condition = condition_of(name, SMALL, stage)
        assert len(condition.views) >= 2, name
        for view in condition.views:
            assert view.wanted.sum() > 5, name
            # A bright blob is brighter than its surroundings, wherever the camera stands.
            inside = view.truth[view.wanted]
            y, x = (np.round(inside[axis]).astype(int) for axis in ("y", "x"))
            assert np.median(view.image[y, x]) > np.median(view.image) + 0.1, name


def test_conditions_are_those_that_are_promised():
    found = {name: views_of(name, PLAN) for name in CONDITIONS[1:]}
    assert {f"blur {blur}" for blur in (0.3, 0.5, 0.8, 1.1)} <= found.keys()
    assert {"translations", "rotation 90", "noise 0.03"} < found.keys()
    for name, specs in found.items():
        blur = float(name.split()[1]) if name.startswith("blur") else BLUR
        assert {spec.blur for spec in specs} == {blur}
        phases = np.array([spec.shift for spec in specs]) % 1
        assert len(np.unique(phases.round(6), axis=0)) == len(specs)
    assert max(len(specs) for specs in found.values()) == len(found["translations"]) == 8


@pytest.mark.parametrize(
    "name",
    [
        "",
        "blur",
        "blur -1",
        "zoom 0.5",
        "zoom 9",
        "noise x",
        "rotation nan",
        "translations 3",
        "shear 2",
    ],
)
def test_unknown_conditions_are_refused(name):
    with pytest.raises(InputError, match="give blobs, translations, blur 0 to 1.4"):
        views_of(name, PLAN)


def test_a_picture_that_is_too_small_is_refused_before_it_is_searched():
    with pytest.raises(InputError, match="at least 368 x 368"):
        scene_of(np.zeros((300, 900)), PLAN)
    tiny = AuditPlan(60, 2, 4)
    small, large = np.zeros((380, 400)), np.zeros((500, 550))
    assert scene_of(small, tiny) is small
    assert scene_of(large, tiny).shape == (370, 407)
    assert scene_of(scene_of(large, tiny), tiny).shape == (370, 407)  # once is enough


def test_the_made_picture_is_the_same_everywhere():
    assert made_picture(60, 80).tolist() == made_picture(60, 80).tolist()
    values = made_picture(60, 80)
    assert 0 <= values.min() < 0.3 and 0.7 < values.max() <= 1


# Controls


def test_the_truth_has_no_fault(controls):
    for _, row in rows(controls, "truth").iterrows():
        assert row["recall"] == 1.0 and row["error_p90"] == 0.0 and row["duplicates"] == 0
        assert row["bias_y"] == row["bias_x"] == row["scale_bias"] == row["scale_spread"] == 0.0
        if row["condition"] != "blobs":
            assert row["precision"] == row["repeatability_0.1"] == row["repeatability_3"] == 1.0
    assert set(rows(controls, "truth")["convention_found"]) == {"0 yx sigma"}


def test_a_shift_is_a_bias_and_a_convention_and_parts_views_that_turn(controls):
    own = rows(controls, "truth + 0.25 px")
    np.testing.assert_allclose(own[["bias_y", "bias_x"]], 0.25, atol=1e-12)
    assert set(own["convention_found"]) == {"0.25 yx sigma"}
    assert rows(controls, "truth + 0.25 px", "translations")["repeatability_0.1"] == 1.0
    turned = rows(controls, "truth + 0.25 px", "rotation 90")
    assert turned["repeatability_0.1"] == 0.0 and turned["repeatability_1"] == 1.0


def test_swapped_offsets_are_found_though_there_is_no_bias(controls):
    row = rows(controls, "swapped offsets", "blobs")
    assert abs(row["bias_y"]) < 0.01 and row["bias_y_low"] < 0 < row["bias_y_high"]
    assert row["phase_pattern"] == "swapped offsets" and row["phase_step"] == 1.0
    matrix = [row[f"phase_{name}"] for name in ("yy", "yx", "xy", "xx")]
    np.testing.assert_allclose(matrix, [-1, 1, 1, -1], atol=1e-9)
    for setting in ("truth", "truth + 0.25 px"):
        assert rows(controls, setting, "blobs")["phase_pattern"] == "none"


def test_random_points_are_worth_what_chance_is(controls):
    own = rows(controls, "random points")
    assert own["recall"].max() < 0.25 and set(own["convention_found"]) == {""}
    n = own["n_true"].sum()
    difference = (own["recall"] - own["chance"]) * own["n_true"]
    assert abs(difference.sum()) < 3 * math.sqrt(0.05 * n)


def test_every_number_has_a_column_and_every_column_a_number(controls):
    assert tuple(controls.audit.columns) == COLUMNS
    needed = "detector setting version condition n_keypoints duplicates recall precision chance bias_y bias_x bias_y_low bias_x_high error_median error_p90 scale_bias scale_spread repeatability_0.1 repeatability_matched convention_found"
    assert set(needed.split()) <= set(COLUMNS)
    measured_by_libraries = ("version", "problem", "coverage_90", "own", "seam")
    for name in COLUMNS:
        if not name.startswith(measured_by_libraries):
            assert controls.audit[name].notna().any(), name
    assert len(controls.audit) == len(CONTROLS) * len(SHOWN)
    assert set(controls.octaves["sigma_low"]) == {LOW, 2 * LOW}


def test_scales_that_are_wrong_are_said_to_be():
    columns = [view.truth.rename(columns={"sigma": "scale"}) for view in BLOBS.views]
    wrong = [table.assign(scale=1.06 * table["scale"]) for table in columns]
    row = measured(BLOBS, wrong, KEYSTAB).row
    assert row["scale_bias"] == pytest.approx(0.06) and row["scale_spread"] < 1e-9
    right = measured(BLOBS, wrong, Convention(0.0, "yx", 1.06)).row
    assert right["scale_bias"] == pytest.approx(0.0)


def test_error_bars_are_held_against_the_truth():
    draw = np.random.default_rng(3)
    columns = []
    for view in BLOBS.views:
        error = draw.normal(0, 0.1, (2, len(view.truth)))
        table = view.truth.rename(columns={"sigma": "scale"})
        columns.append(
            table.assign(y=table["y"] + error[0], x=table["x"] + error[1], std_y=0.1, std_x=0.1)
        )
    row = measured(BLOBS, columns, KEYSTAB).row
    assert row["coverage_90_low"] <= 0.9 <= row["coverage_90_high"]


def test_copies_are_counted_and_do_not_count():
    columns = [view.truth.rename(columns={"sigma": "scale"}) for view in BLOBS.views]
    twice = [pd.concat([table, table], ignore_index=True) for table in columns]
    row = measured(BLOBS, twice, KEYSTAB).row
    assert row["duplicates"] == row["n_keypoints"] == 100 and row["recall"] == 1.0


# Libraries whose answers are known


def bias_of(detector: Detector, python: str, sizes=slice(None)) -> dict:
    condition = BLOBS._replace(views=BLOBS.views[sizes])
    tables = Audit([condition]).rows(detector, python=python)
    row = tables.audit.iloc[0].to_dict()
    assert row["problem"] == "" and row["version"], row["problem"]
    return row


def setting(name: str, words: str) -> Detector:
    return next(each for each in DETECTORS if each.name == name and each.setting.startswith(words))


@pytest.mark.parametrize(
    ("name", "words", "module", "bias", "convention"),
    [
        ("opencv", "default, no", "cv2", 0.25, "0.25 xy diameter"),
        ("opencv", "precise, no", "cv2", 0.0, "0 xy diameter"),
        ("skimage", "upsampling 2, no", "skimage", 0.25, "0.25 yx sigma"),
        pytest.param(*("skimage", "upsampling 1, no", "skimage", 0.0, "0 yx sigma"), marks=SLOW),
        ("vlfeat", "no", "vlsift", 0.0, "0 yx sigma"),
        ("colmap", "no", "pycolmap", 0.0, "0.5 xy sigma"),
        pytest.param(*("kaze", "no", "cv2.xfeatures2d", 0.0, "0 xy diameter"), marks=SLOW),
    ],
)
def test_known_answers_on_blobs(name, words, module, bias, convention):
    row = bias_of(setting(name, words), python_with(module))
    assert abs(row["bias_y"] - bias) <= 0.01 and abs(row["bias_x"] - bias) <= 0.01
    assert row["bias_y_low"] <= bias + 0.005 and row["bias_y_high"] >= bias - 0.005
    assert row["convention_found"] == convention
    assert row["recall"] > 0.6  # the smallest blobs are beyond the first octave of some


def test_colmap_is_half_a_pixel_off_where_its_convention_is_not_known():
    raw = {**vars(setting("colmap", "no")), "convention": KEYSTAB}
    row = bias_of(Detector(**raw), python_with("pycolmap"))
    assert abs(row["bias_y"] - 0.5) <= 0.01 and abs(row["bias_x"] - 0.5) <= 0.01


@pytest.mark.slow
def test_the_control_of_this_project_finds_all_blobs_where_they_are():
    row = bias_of(FINE, sys.executable, slice(0, 2))
    assert row["recall"] == 1.0 and row["error_p90"] < 0.01 and row["phase_pattern"] == "none"


# Wrong detectors

WRONG = """
import os, sys, time
import numpy as np

def nan(image, blur): return [[1.0, np.nan, 2.0], [1.0, 2.0, 2.0]]
def crash(image, blur): os.abort()
def leave(image, blur): sys.exit(7)
def endless(image, blur):
    while True: pass
def nonsense(image, blur): return "keypoints"
def ragged(image, blur): return {"y": np.zeros(3), "x": np.zeros(2), "sigma": np.ones(3)}
def loud(image, blur):
    sys.stdout.write("x" * 10**6); sys.stdout.flush()
    return np.ones((1, 3))
def colour(image, blur): return image[:, :, 2]
def many(image, blur): return np.ones((10**6, 3))
def none(image, blur): return np.zeros((0, 3))
def child(image, blur):
    import subprocess
    subprocess.Popen(["sleep", "1000"])
    raise ValueError("two\\nlines \\x1b[31m")
"""
SAID = {
    "nan": "1 of 2 keypoints are at NaN or infinity",
    "crash": "it was ended by SIGABRT",
    "leave": "it ended with status 7 before it was done",
    "endless": "it took more than 0.5 s for a picture",
    "nonsense": "TypeError: it returned text; return a table with y, x and sigma",
    "ragged": "its columns have different lengths",
    "loud": "it printed more than 262144 bytes",
    "colour": "IndexError: too many indices",
    "many": "1000000 keypoints, more than the picture has pixels",
    "none": "it found nothing",
    "child": "ValueError: two lines ?[31m (the image is grey, of shape (24, 32))",
    "missing": "AttributeError: module 'wrong' has no attribute 'missing'",
}
IMAGE = np.random.default_rng(1).random((24, 32))


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("wrong.py").write_text(WRONG)
    return tmp_path


@pytest.mark.parametrize("name", SAID)
def test_a_wrong_detector_is_one_clear_line(name, here):
    limits = Limits(0.5 if name == "endless" else 10.0)
    found = list(detections(own_detector(f"wrong:{name}"), [IMAGE], [0.5], limits))
    (only,) = found
    assert only.problem.startswith(SAID[name]) and "\n" not in only.problem
    assert (only.keypoints is None) == (name != "none")


@pytest.mark.parametrize(
    ("found", "said"),
    [
        (None, "it returned None; return a table with y, x and sigma"),
        (b"keypoints", "it returned text"),
        (np.zeros((4, 2)), r"an array of the shape \(4, 2\); return rows of y, x, sigma"),
        ([[1.0, 2.0, "big"]], "could not convert string to float: 'big'"),
        ({"row": np.zeros(3)}, "its table has no column y"),
        ({"y": np.zeros(3), "x": np.zeros(3)}, "its table has no column sigma"),
        (7, "'int' object is not iterable"),
    ],
)
def test_what_is_no_table_is_refused(found, said):
    with pytest.raises((TypeError, ValueError), match=said):
        columns_of(found, "yx")


def test_the_rows_of_others_are_complete_beside_a_wrong_one(here):
    Path("right.py").write_text(
        "def detect(image, blur):\n    return [[5.0, 6.0, 2.0], [15.0, 16.0, 3.0]]\n"
    )
    told: list[str] = []
    detectors = [own_detector(f"wrong:{name}") for name in ("crash", "nan")]
    detectors.append(own_detector("right:detect"))
    condition = BLOBS._replace(views=BLOBS.views[:1])
    other = condition._replace(name="again")
    tables = joined(
        list(audited(Audit([condition, other]), detectors, Limits(5.0), told=told.append))
    )
    by = tables.audit.set_index(["detector", "condition"])
    assert by.loc[("wrong:crash", "blobs"), "problem"] == "it was ended by SIGABRT"
    assert by.loc[("wrong:crash", "again"), "problem"] == "it was ended by SIGABRT"
    assert math.isnan(by.loc[("wrong:crash", "blobs"), "recall"])
    assert by.loc[("right:detect", "blobs"), "n_keypoints"] == 2
    assert by.loc[("right:detect", "again"), "problem"] == ""
    assert told == [
        "wrong:crash, as given: it was ended by SIGABRT",
        "wrong:nan, as given: 1 of 2 keypoints are at NaN or infinity",
    ]


def test_a_crash_in_one_picture_leaves_the_other_conditions(here):
    Path("fragile.py").write_text(
        "import os\ndef detect(image, blur):\n    if blur > 1: os.abort()\n    return [[5.0, 6.0, 2.0]]\n"
    )
    first = BLOBS._replace(views=BLOBS.views[:1])
    bad = [type(view)(view.image, 1.1, view.truth, view.wanted, None) for view in first.views]
    chain = [first, first._replace(name="bad", views=bad), first._replace(name="last")]
    table = Audit(chain).rows(own_detector("fragile:detect"), Limits(5.0)).audit
    assert table["problem"].tolist() == ["", "it was ended by SIGABRT", ""]


def test_a_command_gets_a_picture_and_gives_a_table(here):
    pytest.importorskip("PIL")
    Path("mine.py").write_text(
        "import sys\nfrom PIL import Image\n"
        "picture = Image.open(sys.argv[1])\nassert picture.mode == 'L', picture.mode\n"
        "width, height = picture.size\n"
        "open(sys.argv[2], 'w').write(f'x,y,sigma,name\\n{width},{height},{picture.getpixel((3, 2))},a b\\n')\n"
    )
    image = IMAGE.copy()
    image[2, 3] = 0.4
    command = f"{sys.executable} 'mine.py' {{picture}} {{table}}"
    (found,) = detections(own_detector(command), [image], [0.5])
    assert found.problem == ""
    assert found.keypoints.iloc[0].to_dict() == {"y": 24.0, "x": 32.0, "scale": 102.0}


@pytest.mark.parametrize(
    ("code", "said"),
    [
        ("print('no display'); sys.exit(3)", "it ended with status 3: no display"),
        ("pass", "it wrote no table"),
        ("open(sys.argv[2], 'wb').write(bytes(range(256)))", "ValueError: the first line of its table"),
        ("open(sys.argv[2], 'w').write('y,x,sigma\\n1,2,three\\n')", "ValueError: row 1 of its table holds no numbers"),
        ("open(sys.argv[2], 'w').write('y,x,sigma\\n1,nan,3\\n')", "1 of 1 keypoints are at NaN"),
        ("import os; os.kill(os.getpid(), 11)", "it was ended by signal 11"),
        ("import time; time.sleep(100)", "it took more than 1 s for a picture"),
    ],
)  # fmt: skip
def test_a_wrong_command_is_one_clear_line(code, said, here):
    Path("mine.py").write_text(f"import sys\n{code}\n")
    detector = own_detector(f"{sys.executable} mine.py {{picture}} {{table}}")
    (found,) = detections(detector, [IMAGE], [0.5], Limits(1.0, patience=1.0))
    assert found.problem.startswith(said) and found.keypoints is None


def test_what_functions_may_return():
    point = SimpleNamespace(pt=(2.0, 1.0), size=1.0, response=0.3)
    table = pd.DataFrame({"x": [2.0], "y": [1.0], "sigma": [0.5], "note": ["a"]})
    for found in (table, np.array([[1.0, 2.0, 0.5, 9.0]]), [(1.0, 2.0, 0.5)], [point]):
        columns = columns_of(found, "yx")
        assert [columns[name].tolist() for name in ("y", "x", "scale")] == [[1.0], [2.0], [0.5]]
    assert columns_of([(1.0, 2.0, 0.5)], "xy")["y"].tolist() == [2.0]  # rows have no names
    assert columns_of(table, "xy")["y"].tolist() == [1.0]
    assert len(columns_of([], "yx")["y"]) == 0


def test_a_function_may_leave_the_blur_alone(here):
    Path("plain.py").write_text("def detect(image): return [image[0, :3]]\n")
    own = own_detector("plain:detect", Convention(order="xy"))
    (found,) = detections(own, [IMAGE], [0.5])
    assert found.keypoints[["x", "y", "scale"]].to_numpy().tolist() == [IMAGE[0, :3].tolist()]


def test_detectors_are_named_or_refused():
    both = chosen(["opencv", "./mine {picture} {table}"])
    assert [each.name for each in both][-2:] == ["./mine", "keystab"]
    assert len({(each.name, each.setting) for each in DETECTORS}) == len(DETECTORS)
    for wrong in ("orb", "a b:c", "./mine {picture}", "'unclosed {picture} {table}"):
        with pytest.raises(InputError):
            chosen([wrong])


# Words, and the command


def test_findings_say_what_is_wrong_and_what_is_not(controls):
    shifted = "\n".join(findings(rows(controls, "truth + 0.25 px")))
    assert "**A bias on blobs**: +0.250 px (0.250 to 0.250) down and +0.250 px" in shifted
    assert "`0.25 yx sigma` was found" in shifted
    swapped = "\n".join(findings(rows(controls, "swapped offsets")))
    assert "**The sub-pixel offsets of y and x are swapped** on blobs" in swapped
    right = "\n".join(findings(rows(controls, "truth")))
    assert "No bias on blobs" in right and "**" not in right
    failed = rows(controls, "truth").assign(problem="it was ended", recall=np.nan, version="1.2")
    assert findings(failed) == ["Version 1.2.", "**It was ended**."]
    assert findings(failed.assign(version="")) == ["**It was ended**."]


def test_swapped_axes_are_said_first_and_nothing_of_chance(stage):
    conditions = [condition_of(name, SMALL, stage) for name in ("blobs", "translations")]
    found = [
        [
            Found(view.truth.rename(columns={"y": "x", "x": "y", "sigma": "scale"}), 0.1, "", "")
            for view in condition.views
        ]
        for condition in conditions
    ]
    tables = Audit(conditions).rows(own_detector("mine:detect"), found=found)
    table = with_conventions(tables.audit)
    first, *others = findings(table)
    assert first.startswith("**Its axes are swapped: audit again with `--convention 0,xy,sigma`**")
    assert others == ["It says `0 yx sigma`, and on blobs `0 xy sigma` was found."]
    assert (
        as_table(table)
        .splitlines()[-1]
        .startswith("| mine:detect | as given | 0 xy sigma |  |  | ")
    )


def test_no_number_is_said_without_its_interval():
    few = BLOBS.views[0].truth.rename(columns={"sigma": "scale"}).head(3)
    columns = [few.assign(y=few["y"] + 0.3, scale=1.277 * few["scale"]), few.head(0), few.head(0)]
    found = [[Found(each, 0.1, "", "") for each in columns]]
    table = Audit([BLOBS]).rows(own_detector("mine:detect"), found=found).audit
    assert table["scale_bias"][0] == pytest.approx(0.277)
    text = "\n".join(findings(table))
    assert "Too few of those on blobs are found to say how far off they are." in text
    assert "Scales" not in text and "bias" not in text.lower() and "nan" not in text
    assert "+0.300" not in as_table(table)


def test_drifts_are_said_of_detectors_that_drift():
    said = {}
    for zoom in (1.0, 1.002):
        columns = []
        for view in BLOBS.views:
            found = pd.DataFrame(laplacian_maxima(view.image), columns=["y", "x", "scale"])
            columns.append(Found(found.assign(y=zoom * found["y"]), 0.1, "", ""))
        table = Audit([BLOBS]).rows(own_detector("mine:detect"), found=[columns]).audit
        assert table["recall"][0] > 0.9
        said[zoom] = "\n".join(findings(table))
    assert "drifts" not in said[1.0] and "The error in y drifts by +0." in said[1.002]


def test_a_drift_of_the_scene_alone_is_not_said(controls):
    table = rows(controls, "truth").copy()
    scene = table["condition"] == "translations"
    ends = ["drift_x", "drift_x_low", "drift_x_high"]
    table.loc[scene, ends] = [-0.7, -1.0, -0.4]
    assert "drifts" not in "\n".join(findings(table))
    table.loc[table["condition"] == "blobs", ends] = [-0.04, -0.05, -0.03]
    said = [line for line in findings(table) if "drifts" in line]
    line = "The error in x drifts by -0.700 px (-1.000 to -0.400) from left to right on the scene."
    assert said == [line]
    table.loc[table["condition"] == "blobs", ends[1:]] = np.nan
    assert line in findings(table)


def laplacian_maxima(image):
    """Maxima of the Laplacian of Gaussians, which knows of no place in the picture."""
    sigma = 1.2 * 2 ** (np.arange(10) / 3)
    stack = np.array([-(s**2) * ndimage.gaussian_laplace(image, s, truncate=3.0) for s in sigma])
    k, y, x = np.nonzero((stack == ndimage.maximum_filter(stack, 3)) & (stack > 0.05))
    k, y, x = (each[(k > 0) & (k < len(sigma) - 1)] for each in (k, y, x))
    return np.stack([y, x, sigma[k] / math.sqrt(KAPPA)], axis=1)


def test_an_extremum_has_one_number_in_all_views(stage):
    condition = condition_of("translations", SMALL, stage)
    columns = [view.truth.rename(columns={"sigma": "scale"}) for view in condition.views]
    row = measured(condition, columns, KEYSTAB).row
    different = {each for view in condition.views for each in view.extremum[view.wanted]}
    assert len(different) < sum(view.wanted.sum() for view in condition.views) / 2
    assert row["drift_y"] == 0.0 and math.isnan(row["drift_y_low"])  # fewer than 30


def test_the_page_has_every_detector_and_the_command(controls):
    table = controls.audit.copy()
    table.loc[table["setting"] == "truth", "detector"] = "mine|yours"
    text = page(table, "keystab audit mine", "a roof")
    assert "`keystab audit mine`" in text and "### mine|yours, truth" in text
    assert text.count("| control |") == len(CONTROLS) - 1


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["orb"], "'orb' is no detector; give keystab, opencv"),
        (["opencv", "--convention", "0.5"], "give origin, order and scale, such as 0.5,xy,sigma"),
        (["opencv", "--convention", "a,xy,sigma"], "give numbers of pixels"),
        (["opencv", "--convention", "0,zz,sigma"], "order is 'zz'"),
        (["opencv", "--scene", "none.png"], "none.png: no such file"),
        (["opencv", "--python", "nopython"], "--python nopython: no such program"),
    ],
)
def test_what_cannot_be_audited_is_refused_in_one_line(arguments, said, here, capsys):
    assert main(["audit", *arguments, "-o", "out"]) == 2
    error = capsys.readouterr().err
    assert said in error and error.splitlines()[-1].startswith("keystab audit: ")
    assert not Path("out").exists()


@pytest.mark.slow
def test_the_command_writes_tables_a_figure_and_a_page(here, capsys):
    Path("mine.py").write_text("def detect(image, blur): return [[50.0, 60.0, 2.0]]\n")
    picture = str(ROOT / "config/images/stream.png")
    command = ["audit", "mine:detect", "wrong:nan", "--quick", "--scene", picture, "-o", "out"]
    assert main(command) == 0
    assert "wrong:nan, as given: 1 of 2 keypoints are at NaN" in capsys.readouterr().err
    names = {path.name for path in Path("out").iterdir()}
    tables = {"audit.csv", "audit_octaves.csv", "audit_phases.csv", "durations.csv"}
    assert names == tables | {"audit.md", "audit.pdf", "audit.png"}
    table = read_table("out/audit.csv")
    fine = table[table["detector"] == "keystab"].set_index("condition")
    assert fine.loc["translations", "recall"] > 0.95 and fine["problem"].isna().all()
    assert fine.loc["translations", "own_recall"] > 0.95
    made = Path("out/audit.md").read_text()
    assert "keystab audit mine:detect wrong:nan --quick" in made
    assert f"-o out`, keystab {__version__}." in made


def test_the_page_of_documents_is_written_between_its_marks(controls, monkeypatch):
    monkeypatch.syspath_prepend(ROOT / "tools")
    tool = importlib.import_module("audit_page")
    table = controls.audit.copy()
    table.loc[table["setting"] == "truth", "detector"] = "mine"
    text = tool.page(f"head\n{tool.BEGIN}stale words\n{tool.END}rest\n", table)
    assert (
        text.startswith("head\n")
        and text.endswith(f"{tool.END}rest\n")
        and "stale words" not in text
    )
    assert "### mine" in text and "No bias on blobs" in text
    assert tool.page(text, table) == text
    assert tool.main(["--check"]) == 0  # docs/audit.md says what results/reference/audit says


def test_the_figure_draws_every_setting_where_its_numbers_are(controls):
    from keystab.figures.audit import draw

    figure = draw({"audit": controls.audit, "audit_octaves": controls.octaves})
    axes = {ax.get_label(): ax for ax in figure.axes}
    assert sorted(axes) == list("abcde")
    labels = [label.get_text() for label in axes["a"].get_yticklabels()]
    assert labels == [f"control, {setting}" for setting in CONTROLS]
    lines = {line.get_label(): line for line in axes["a"].lines}
    assert lines["bias_y"].get_xdata()[1] == pytest.approx(0.25)
    assert lines["bias_x"].get_xdata()[0] == 0.0
    found = {line.get_label(): line for line in axes["d"].lines}
    assert found["recall"].get_xdata()[0] == 100.0
    with pytest.raises(InputError, match=r"audit\.csv: lacks the column"):
        draw({"audit": controls.audit[["detector"]], "audit_octaves": controls.octaves})


def test_the_figure_says_what_lies_beyond_and_what_failed(controls):
    from keystab.figures.audit import FARTHEST, draw

    names = list(CONTROLS)
    audit, octaves = controls.audit.copy(), controls.octaves.copy()
    ends = ["", "_low", "_high"]
    far = [f"bias_{axis}{end}" for axis in "yx" for end in ends]
    audit.loc[audit["setting"] == names[1], far] += [0.25] * 3 + [-1.25] * 3
    octaves.loc[octaves["setting"] == names[1], far[:3]] += 0.25
    failed = audit["setting"] == names[2]
    numbers = audit.select_dtypes("number").columns
    audit.loc[failed, numbers] = np.nan
    audit.loc[failed, "problem"] = "it was ended"
    octaves = octaves[octaves["setting"] != names[2]]
    figure = draw({"audit": audit, "audit_octaves": octaves})
    axes = {ax.get_label(): ax for ax in figure.axes}
    arrows = [line for line in axes["a"].lines if line.get_label() == "beyond"]
    places = {
        (line.get_marker(), float(x), round(float(y)))
        for line in arrows
        for x, y in zip(*line.get_data(), strict=True)
    }
    assert places == {(">", 0.96 * FARTHEST, 1), ("<", -0.96 * FARTHEST, 1)}
    texts = {letter: [each.get_text() for each in ax.texts] for letter, ax in axes.items()}
    assert {"+0.50", "-1.00"} <= {*texts["a"]} and "+0.50" in texts["b"]
    for letter in "abcde":
        assert texts[letter].count("failed") == 1
    assert "too few" in texts["a"]  # random points have no bias
    assert axes["e"].get_title(loc="left").endswith("1 px")
    turned = audit[audit["condition"] == "rotation 90"].set_index("setting")
    dots = axes["e"].lines[0].get_xdata()
    assert dots[0] == 100 * turned.loc[names[0], "repeatability_1"]
    assert dots[3] == 100 * turned.loc[names[3], "repeatability_1"]


# Limits, and height for width


def test_a_large_picture_is_seen_from_so_far_that_its_width_is_that_of_the_views():
    plan = AuditPlan(60, 2, 4)
    span = scene_of(np.zeros((500, 550)), plan).shape[1]  # of any large one
    for width in (700, 900):
        assert scene_of(np.zeros((900, width)), plan).shape[1] == pytest.approx(span, abs=1)
    high = scene_of(np.zeros((1100, 550)), plan).shape
    assert high[1] == span and high[0] == pytest.approx(2 * high[1], abs=2)


def test_how_large_a_picture_must_be_is_said_in_its_own_pixels():
    plan = AuditPlan(60, 2, 4)
    with pytest.raises(InputError) as small:
        scene_of(np.zeros((300, 390)), plan)
    with pytest.raises(InputError) as large:  # seen from twice as far
        scene_of(np.zeros((300, 2 * 407)), plan)
    (few,), (many,) = (
        {int(it) for it in re.findall(r"at least (\d+) x", str(each.value))}
        for each in (small, large)
    )
    assert many == pytest.approx(2 * few, rel=0.01)


@pytest.mark.parametrize("axis", [0, 1])
def test_what_is_compared_begins_on_the_margin(stage, axis):
    spec = views_of_size(stage)
    middle = [(size - 1) / 2 for size in spec.shape]
    for at, inside in (
        (MARGIN, True), (MARGIN - 1e-6, False),
        (spec.shape[axis] - 1 - MARGIN, True), (spec.shape[axis] - 1 - MARGIN + 1e-6, False),
    ):  # fmt: skip
        position = list(middle)
        position[axis] = at
        y, x = (np.array([it]) for it in position)
        assert stage.compared(spec, y, x).tolist() == [inside]


def views_of_size(stage):
    """A view in the middle of the scene, oblong, with room around it for the scene's margin."""
    return ViewSpec(BLUR, STEP, (int(2 * MARGIN) + 7, int(2 * MARGIN) + 12))


def test_a_scale_on_the_end_of_two_octaves_is_of_the_upper_one(monkeypatch):
    sigma = np.array([1.4, 2.0, 2.8, 2.8, 4.0, 5.6])
    pairs = SimpleNamespace(sigma=sigma, error=np.zeros((6, 2)), scale=np.zeros(6))
    monkeypatch.setattr(measures, "_recalled", lambda seen: (sigma, np.ones(6, bool), None))
    rows = [measures._octave(low, 2 * low, [], pairs) for low in (1.4, 2.8)]
    assert [row["n"] for row in rows] == [2, 3]
    assert [row["recall"] for row in rows] == [1.0, 1.0]
    # Found are those on the lower ends alone: one of two and two of three.
    on_end = np.isin(sigma, [1.4, 2.8])
    monkeypatch.setattr(measures, "_recalled", lambda seen: (sigma, on_end, None))
    rows = [measures._octave(low, 2 * low, [], pairs) for low in (1.4, 2.8)]
    assert [row["recall"] for row in rows] == pytest.approx([1 / 2, 2 / 3])


@pytest.mark.parametrize(
    ("ratio", "low", "high"), [(1.0, LOW, HIGH), (1.5, 1.5 * LOW, HIGH), (0.5, LOW, 0.5 * HIGH)]
)
def test_two_views_are_compared_at_scales_that_both_see(ratio, low, high):
    scales = np.array([low * 0.999, low, low * 1.001, high * 0.999, high * 1.001])
    specs = [ViewSpec(BLUR, step, (80, 90)) for step in (STEP, STEP * ratio)]
    stage = SimpleNamespace(
        scene=SimpleNamespace(shape=(900, 900)), compared=lambda spec, y, x: np.ones(len(y), bool)
    )
    seen = []
    for spec, factor in zip(specs, (1.0, ratio), strict=True):
        found = pd.DataFrame({"y": 40.0, "x": 45.0, "sigma": scales / factor})
        view = SimpleNamespace(spec=spec, strength=lambda it: np.arange(len(it)))
        seen.append(SimpleNamespace(found=found, view=view))
    # As given, where the ends are not met to the last digit.
    inside = scales[2:4] if ratio != 1.0 else scales[1:4]
    for table in measures._in_first_frame(SimpleNamespace(stage=stage), *seen):
        kept = table["sigma"].to_numpy()
        assert set(np.round(inside, 9)) <= set(np.round(kept, 9))
        assert (kept >= low * (1 - 1e-9)).all() and (kept <= high * (1 + 1e-9)).all()
