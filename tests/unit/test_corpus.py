"""The table of scenes, and what claims are over them."""

import importlib
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.stats import fisher_exact, ttest_1samp

from keystab.camera.made_scenes import KINDS as MADE
from keystab.errors import InputError
from keystab.figures import scenes as figure
from keystab.io.pictures import pixel_digest, write_picture
from keystab.io.tables import write_table
from keystab.study import corpus, scene_verdicts
from keystab.study.scene_numbers import ALL, over_families
from keystab.study.scene_report import to_markdown

ROOT = Path(__file__).parents[2]
CORPUS = corpus.read_corpus(ROOT / "config/scenes.csv")
FAMILIES = {name: scene.family for name, scene in CORPUS.items()}


def test_there_are_enough_scenes_of_every_family():
    sizes = pd.Series(FAMILIES).value_counts()
    assert sizes["photograph"] == 9 and (sizes >= 6).all() and sizes.sum() >= 33
    assert {scene.kind for scene in CORPUS.values()} == {corpus.PHOTOGRAPH, *MADE}
    fields = [scene for scene in CORPUS.values() if scene.kind == "fractal"]
    assert len({scene.exponent for scene in fields}) == 3
    straight = [scene for scene in CORPUS.values() if scene.family == "straight"]
    assert {0, 90} < {scene.angle for scene in straight}
    assert all(scene.credit for scene in CORPUS.values() if scene.path)


@pytest.mark.parametrize("name", [name for name, scene in CORPUS.items() if scene.path])
def test_photographs_are_those_that_are_meant(name):
    assert pixel_digest(ROOT / CORPUS[name].path) == CORPUS[name].sha256
    assert f"{name}.png" in (ROOT / "config/images/NOTICE").read_text()


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=[pytest.mark.slow] * (name not in ("text_1", "strokes_20")))
        for name, scene in CORPUS.items()
        if not scene.path
    ],
)
def test_made_scenes_are_those_that_are_meant(name, tmp_path):
    from keystab.stages.make_scene import main

    scene, picture = CORPUS[name], tmp_path / "scene.png"
    numbers = [f"--{key}={getattr(scene, key)}" for key in ("kind", "seed", "exponent", "angle")]
    assert main([*numbers, "--picture", str(picture)]) == 0
    assert pixel_digest(picture) == scene.sha256


ROW = {"name": "a", "family": "lakes", "kind": "text", "seed": 1, "sha256": "ab" * 32}


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"name": "A b"}, "a-z, 0-9"),
        ({"name": "../a"}, "a-z, 0-9"),
        ({"family": "x y"}, "family 'x y'"),
        ({"kind": "painting"}, "photograph, dead-leaves"),
        ({"kind": "photograph"}, "a photograph has a path"),
        ({"path": "a.png"}, "a photograph has a path"),
        ({"sha256": "12"}, "64 hexadecimal"),
        ({"seed": 0.5}, "whole number"),
        ({"seed": -1}, "whole number of at least 0"),
        ({"angle": "steep"}, "numbers or empty"),
    ],
)
def test_wrong_rows_are_named(change, words, tmp_path):
    table = pd.DataFrame([{**dict.fromkeys(corpus.COLUMNS), **ROW, **change}])
    write_table(table, tmp_path / "scenes.csv")
    with pytest.raises(InputError) as error:
        corpus.read_corpus(tmp_path / "scenes.csv")
    assert words in str(error.value) and "row 1" in str(error.value)
    assert "\n" not in str(error.value)


def test_two_scenes_have_two_names(tmp_path):
    write_table(
        pd.DataFrame([{**dict.fromkeys(corpus.COLUMNS), **ROW}] * 2), tmp_path / "scenes.csv"
    )
    with pytest.raises(InputError, match="row 2 .*a name of its own"):
        corpus.read_corpus(tmp_path / "scenes.csv")


# ---------------------------------------------------------------------------------------------
# Verdicts over scenes


def reports(**holds: dict[str, int]) -> dict[str, pd.DataFrame]:
    """Reports of all scenes; each claim holds on so many of every family."""
    left = {claim: dict(numbers) for claim, numbers in holds.items()}
    found = {}
    for scene, family in FAMILIES.items():
        verdicts = []
        for numbers in left.values():
            verdicts.append("reproduced" if numbers.get(family, 0) > 0 else "not reproduced")
            numbers[family] = numbers.get(family, 0) - 1
        table = {
            "id": list(holds),
            "criterion": "a > b",
            "verdict": verdicts,
            "value": f"share {len(found)}",
        }
        found[scene] = pd.DataFrame(table)
    return found


def over(**holds: dict[str, int]) -> pd.DataFrame:
    table = scene_verdicts.long_table(reports(**holds), FAMILIES)
    return scene_verdicts.over_scenes(table).set_index("claim")


ALL_OF = {family: 99 for family in set(FAMILIES.values())}


def test_claims_are_general_dependent_undecided_or_nowhere_true():
    found = over(
        everywhere=ALL_OF,
        but_two={**ALL_OF, "text": 5, "straight": 5},
        but_text={**ALL_OF, "text": 0},
        but_three={**ALL_OF, "text": 5, "straight": 5, "fractal": 5},
        nowhere={},
    )
    # Of 33 scenes 31 are enough for a lower end of 0.804.
    assert found["kind"].to_dict() == {
        "everywhere": "general",
        "but_two": "general",
        "but_text": "scene-dependent",
        "but_three": "undecided",
        "nowhere": "generally not",
    }
    assert found.loc["but_text", ["n_scenes", "n_holds", "text_n", "text_holds"]].tolist() == [33, 27, 6, 0]  # fmt: skip


def test_what_gives_the_same_numbers_on_all_scenes_is_of_no_scene():
    given = reports(one=ALL_OF, other=ALL_OF)
    for report in given.values():
        report.loc[1, "value"] = "error 1.5e-13"
    found = scene_verdicts.over_scenes(scene_verdicts.long_table(given, FAMILIES))
    assert found["kind"].tolist() == ["general", "of no scene"]
    two = {name: given[name] for name in ("lake", "text_1")}
    found = scene_verdicts.over_scenes(scene_verdicts.long_table(two, FAMILIES))
    assert found["kind"].tolist() == ["undecided", "undecided"]


def test_what_no_scene_can_test_is_said_to_be_so():
    given = reports(one=ALL_OF, other=ALL_OF)
    for report in given.values():
        report.loc[1, "verdict"] = "not testable"
    found = scene_verdicts.over_scenes(scene_verdicts.long_table(given, FAMILIES))
    assert found["kind"].tolist() == ["general", "not testable"]
    assert np.isnan(found["share"][1]) and found["n_scenes"][1] == 0


@pytest.mark.parametrize(("sizes", "held"), [((6, 6), (5, 1)), ((9, 6), (7, 3)), ((3, 8), (3, 0))])
def test_the_test_of_two_families_is_fishers(sizes, held):
    table = [[k, n - k] for n, k in zip(sizes, held, strict=True)]
    expected = fisher_exact(table).pvalue
    assert scene_verdicts.families_differ(sizes, held) == pytest.approx(expected, rel=1e-9)


def test_families_in_another_order_differ_as_much():
    there = scene_verdicts.families_differ([9, 6, 6], [8, 1, 3])
    assert scene_verdicts.families_differ([6, 9, 6], [3, 8, 1]) == pytest.approx(there)
    assert scene_verdicts.families_differ([9, 6, 6], [9, 6, 6]) == pytest.approx(1)


def test_other_criteria_are_refused():
    given = reports(one=ALL_OF)
    given["lake"]["criterion"] = "a > 2 * b"
    with pytest.raises(InputError, match="lake: its claims or criteria"):
        scene_verdicts.long_table(given, FAMILIES)
    with pytest.raises(InputError, match="run make scenes"):
        scene_verdicts.long_table({}, FAMILIES)


# ---------------------------------------------------------------------------------------------
# Numbers over scenes


def numbers(values: dict[str, list[float]]) -> pd.DataFrame:
    rows = [
        {"claim": "c", "family": family, "value": f"share {value!r}; note missing: nothing"}
        for family, each in values.items()
        for value in each
    ]
    return over_families(pd.DataFrame(rows)).set_index("family")


def test_one_family_has_students_interval():
    values = [0.6, 0.62, 0.76, 0.5]
    found = numbers({"lakes": values}).loc["lakes"]
    low, high = ttest_1samp(values, 0).confidence_interval()
    assert found[["mean", "low", "high"]].tolist() == pytest.approx([np.mean(values), low, high])
    assert found[["n_scenes", "least", "most"]].tolist() == [4, 0.5, 0.76]


def test_families_have_equal_weights_and_one_spread():
    found = numbers({"lakes": [1.0, 3.0], "texts": [10.0, 12.0, 11.0, 11.0]})
    pooled = np.sqrt((2 + 2) / 4)  # squares within families, over scenes less families
    assert found.loc[ALL, "mean"] == 6.5
    assert found.loc[ALL, "sd"] == pytest.approx(pooled)
    half = 2.776445 * pooled * np.sqrt(1 / 2 + 1 / 4) / 2
    assert found.loc[ALL, "high"] - 6.5 == pytest.approx(half, rel=1e-6)


def test_one_scene_has_no_interval():
    assert np.isnan(numbers({"lakes": [0.5]})[["sd", "low", "high"]].to_numpy()).all()


# ---------------------------------------------------------------------------------------------
# What people see


def test_the_report_and_the_figure_have_every_claim_that_was_tested():
    found = over(a_first=ALL_OF, b_second={**ALL_OF, "text": 0}).reset_index()
    text = to_markdown(
        found,
        {"a_first": "All | is well.", "b_second": "Some is."},
        {"lake": "Picture: `lake.png`."},
    )
    assert text.endswith("| lake | Picture: `lake.png`. |\n")
    assert "| `a_first` | All \\| is well. | 33 of 33 (0.90 to 1.00) |" in text
    assert "| `b_second` | Some is. | 27 of 33 (0.66 to 0.91) | 9 of 9 |" in text
    tables = {"claims_over_scenes": found, "claims_by_family": scene_verdicts.by_family(found)}
    drawn = figure.draw(tables)
    first, second = (ax for ax in drawn.axes if ax.get_label() in ("a", "b"))
    names = [label.get_text() for ax in (first, second) for label in ax.get_yticklabels()]
    assert names == ["General (1)", "a_first", "Depend on the family (1)", "b_second"]
    squares = [patch.get_facecolor()[:3] for patch in second.patches]
    assert len(squares) == 5 and len(set(squares)) == 2  # of five families, one is different
    untested = {"claims_over_scenes": found.assign(kind="not testable")}
    with pytest.raises(InputError, match="no claim that a scene could test"):
        figure.draw(tables | untested)


def test_the_tool_names_the_scenes_that_there_are(monkeypatch):
    monkeypatch.syspath_prepend(ROOT / "tools")
    monkeypatch.delitem(sys.modules, "scenes", raising=False)
    tool = importlib.import_module("scenes")
    assert tool.chosen(CORPUS, []) == list(CORPUS)
    with pytest.raises(InputError, match="no scene 'sea' in config/scenes.csv; there are coldwarm"):
        tool.chosen(CORPUS, ["lake", "sea"])
    monkeypatch.delitem(sys.modules, "scenes")


def test_a_scene_lies_where_its_picture_does(tmp_path):
    write_picture(np.full((20, 30), 0.5), tmp_path / "own.png")
    scenes = {"": {"reference": CORPUS["lake"].path}}
    found = corpus.places(CORPUS, scenes)
    assert found["lake"] == "" and found["text_1"] == "scenes/text_1/"
    assert corpus.judged(CORPUS, scenes, str(tmp_path)) == {}


@pytest.mark.parametrize("seed", [0, 1, None])
def test_seeds_begin_at_0_which_is_that_of_whoever_gives_none(seed, tmp_path):
    row = {**dict.fromkeys(corpus.COLUMNS), **ROW, "seed": seed}
    write_table(pd.DataFrame([row]), tmp_path / "scenes.csv")
    assert corpus.read_corpus(tmp_path / "scenes.csv")["a"].seed == (seed or 0)
