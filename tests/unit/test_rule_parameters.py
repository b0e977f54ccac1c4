"""What rules hand to stages: parameters with names, files of scenes, quoted commands."""

from __future__ import annotations

import shlex
from typing import NamedTuple

import pytest
from hypothesis import given
from hypothesis import strategies as st

from keystab.parameters import ComparedInViews, Detection, Octaves
from keystab.study.rule_parameters import Named, Rules, command_line, options

DEFAULT = {
    "detector": {"sigma_min": 1.1, "kappa": 1.25, "oversampling": "spline", "epsilon": 0.0},
    "sets": {"zooms": {"n_oct": 2}, "noise_0p1": {"n_oct": 3}},
    "sweeps": {"noise": {"noise_0p1": 0.1}},
}
OTHER = {**DEFAULT, "detector": {**DEFAULT["detector"], "kappa": 1.5}}
RULES = Rules(
    "results", {"": DEFAULT, "scenes/roof/": OTHER}, lambda module: f"of {module}", "lock"
)
HERE, THERE = {"place": ""}, {"place": "scenes/roof/"}


class Row(NamedTuple):
    set: str
    n_spo: int


def rows(settings, *names):
    return [Row(name, settings["sets"][name]["n_oct"]) for name in names]


class Files(dict):
    """Inputs or outputs of a job, by number as well."""

    def __getitem__(self, key):
        return list(self.values())[key] if isinstance(key, int) else super().__getitem__(key)


def test_a_stage_is_given_its_settings_one_by_one_under_their_names():
    parameters = RULES.stage("detect", Detection, n_spo="{n_spo}", oversampling="cosine")
    wildcards = {**THERE, "n_spo": "15"}
    assert parameters["n_spo"](wildcards, Files()) == "15"  # for messages
    given_ = {name: parameters[name](wildcards) for name in parameters if name not in DERIVED}
    assert {repr(value) for value in given_.values()} == {
        "detector.sigma_min = 1.1",
        "detector.kappa = 1.5",
        "detector.oversampling = cosine",  # another value under the name of the setting
        "detector.epsilon = 0",
        "code of keystab.stages.detect = of keystab.stages.detect",
        "environment.lock = lock",
    }
    files = Files(views="my views/still", store=[], samplings=["a.csv", "b.csv"])
    command = parameters["command"](wildcards, files, Files(extrema="it's.parquet"))
    assert shlex.split(command) == [
        *("python", "-m", "keystab.stages.detect", "--views", "my views/still"),
        *("--samplings", "a.csv", "b.csv", "--sigma-min", "1.1", "--kappa", "1.5"),
        *("--oversampling", "cosine", "--epsilon", "0", "--n-spo", "15"),
        *("--extrema", "it's.parquet"),
    ]


DERIVED = ("command", "scene", "n_spo")
"""Made from input or output, or said by the path of the output: not compared by Snakemake."""


def test_what_snakemake_must_not_compare_takes_input():
    parameters = RULES.stage("detect", Detection, n_spo="{n_spo}")
    for name, function in parameters.items():
        names = function.__code__.co_varnames[: function.__code__.co_argcount]
        assert ("input" in names) is (name in DERIVED), name
    assert parameters["scene"](HERE, Files()) == ""
    assert parameters["scene"](THERE, Files()) == ", scene 'roof'"


@pytest.mark.parametrize(
    ("wildcards", "of_set", "name"),
    [
        ({"set": "zooms"}, "", "sets.zooms.n_oct"),
        ({"figure": "fig8"}, "", "sets.zooms.n_oct"),
        ({"figure": "fig12"}, "", "sets.noise_0p1.n_oct"),  # the first of a sweep
        ({}, "zooms", "sets.zooms.n_oct"),
    ],
)
def test_the_set_of_a_setting_is_a_wildcard_or_what_a_figure_studies(wildcards, of_set, name):
    parameters = RULES.stage("match", "sets.{set}.n_oct", of_set=of_set)
    n_oct = parameters["n_oct"]({**HERE, **wildcards})
    assert n_oct.name == name and n_oct.words == [str(DEFAULT["sets"][name.split(".")[1]]["n_oct"])]


def test_files_of_rows_lie_at_the_place_of_their_scene():
    stores = RULES.files("keypoints/{set}/n{n_spo}.parquet", rows, "zooms", "{set}")
    assert stores({**THERE, "set": "noise_0p1"}) == [
        "results/scenes/roof/keypoints/zooms/n2.parquet",
        "results/scenes/roof/keypoints/noise_0p1/n3.parquet",
    ]
    plain = RULES.files("truth/view_{}.parquet", lambda settings: [2, 3])
    assert plain(HERE) == ["results/truth/view_2.parquet", "results/truth/view_3.parquet"]


def test_each_search_has_a_table_of_extrema_and_one_of_traces():
    found = {name: paths(THERE) for name, paths in RULES.detections(rows, "zooms").items()}
    folder = "results/scenes/roof/keypoints/zooms"
    assert found == {name: [f"{folder}/{name}_n2.parquet"] for name in ("extrema", "traces")}


def test_files_of_several_scenes_lie_each_at_its_own_place():
    class Scene(NamedTuple):
        place: str

    every = RULES.files("views/still", lambda settings: [Scene(""), Scene("scenes/roof/")])
    assert every({}) == ["results/views/still", "results/scenes/roof/views/still"]


def test_columns_values_and_resources_are_asked_of_the_scene():
    assert RULES.column("n_spo", rows, "zooms", "noise_0p1")(HERE) == [2, 3]
    assert RULES.of(lambda settings: settings["detector"]["kappa"])(THERE) == 1.5
    assert RULES.setting("detector.kappa")(THERE).name == "detector.kappa"
    assert RULES.growing(lambda settings, n: 7 * int(n), "{n_spo}")({**HERE, "n_spo": "2"}, 3) == 42
    assert RULES.placed(lambda place, more: place + more, "x")(THERE) == "scenes/roof/x"
    assert RULES.placed(lambda place: place)({}) == ""


def test_a_figure_is_drawn_from_tables_of_one_folder_by_its_code():
    parameters = RULES.figure("figS1", draft=True)
    output = Files(pdf="my figures/figS1.pdf")
    words = shlex.split(parameters["command"](HERE, Files(first="a b/tables/x.csv"), output))
    assert words[:3] == ["python", "-m", "keystab.figures.figs1"]
    assert words[3:] == [
        *("--tables", "a b/tables", "--pdf", "my figures/figS1.pdf"),
        *("--code", "of keystab.figures.figs1", "--lock", "lock", "--draft"),
    ]
    assert repr(parameters["draft"](HERE)) == "draft = True"
    assert "--draft" not in RULES.figure("figS1", draft=False)["command"](
        HERE, Files(first="t/x.csv"), output
    )


def test_equal_values_of_two_settings_stay_apart():
    # Snakemake compares the set of representations: of two zeros one could change unseen.
    assert len({repr(Named(name, 0.0)) for name in ("shift_y", "shift_x")}) == 2


def test_blocks_say_where_their_settings_stand():
    assert options(Octaves, "kappas.n_spo") == {
        "starts": "stability.starts",
        "seen_by": "stability.seen_by",
        "n_spo": "kappas.n_spo",
    }
    assert options(ComparedInViews)["guard"] == "sets.{set}.guard"


@given(st.lists(st.text(min_size=1), max_size=4), st.text(min_size=1))
def test_a_shell_sees_the_words_that_were_meant(values, path):
    line = command_line("m", [("path", path), ("values", values)])
    assert shlex.split(line)[3:] == ["--path", path, *(["--values", *values] if values else [])]
