"""What depends on the settings: sets, samplings, variants, truths, scenes, and what jobs may take."""

from __future__ import annotations

import copy
import math
import re
from pathlib import Path

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from keystab.camera.view_sets import per_view, view_shapes, view_specs
from keystab.study import floor_variants, job_resources, plan, scenes, settings
from keystab.study.claims import read_claims, table_names
from keystab.study.plain_yaml import read_plain_yaml

ROOT = Path(__file__).parents[2]
SCHEMA = read_plain_yaml(ROOT / "workflow/schemas/config.schema.yaml")
GIVEN = settings.read_yaml(ROOT / "config/config.yaml")
REFERENCE_SHAPE = (2250, 4000)


def complete(overlay: str = "{}") -> dict:
    """Complete settings with an overlay."""
    merged = copy.deepcopy(GIVEN)
    settings.merge(merged, yaml.safe_load(overlay))
    return settings.checked(merged, SCHEMA)


def study(overlay: str = "{}") -> dict:
    """Settings of the default scene."""
    return scenes.resolved(complete(overlay))


# Sets of views


def test_a_resolved_set_describes_the_same_views():
    given = complete()
    full = scenes.resolved(given)
    for name in ("still", "zooms", "translations", "rotations", "shipped", "blur_errors", "closer"):
        one, other = given["sets"][name], full["sets"][name]
        assert per_view(other) == per_view(one)
        specs = view_specs(name, one, REFERENCE_SHAPE)
        assert view_specs(name, other, REFERENCE_SHAPE) == specs
        assert view_shapes(other, REFERENCE_SHAPE) == [spec.shape for spec in specs]


def test_a_resolved_set_says_what_null_stands_for():
    full = study("{views_dtype: float64, sets: {zooms: {dtype: float32}, noise: {sigma_min: 1.0}}}")
    sets = full["sets"]
    assert sets["still"]["dtype"] == "float64" and sets["zooms"]["dtype"] == "float32"
    assert sets["zooms"]["sigma_min"] == full["detector"]["sigma_min"]
    assert sets["shipped"]["sigma_min"] == 0.8 and sets["noise_0p15"]["sigma_min"] == 1.0
    # Where blurs spread, the detector assumes the blur in the middle.
    assert sets["unknown_blur_0p4"]["assumed_blur"] == 0.7
    assert sets["translations"]["assumed_blur"] is None
    assert sets["blur_errors"]["assumed_blur"] == 0.7
    # A set that is not searched may spread from several blurs.
    assert study("{sets: {examples: {blur_spread: 0.1}}}")["sets"]["examples"]["blur"][0] == 0.5


def test_a_sweep_is_its_sets_with_their_values():
    full = study("{sets: {noise: {sweep: {noise: [0.01, 0.2]}}}}")
    assert full["sweeps"]["noise"] == {"noise_0p01": 0.01, "noise_0p2": 0.2}
    assert "noise" not in full["sets"]
    assert plan.sets_of_figure(full, "fig12") == ["noise_0p01", "noise_0p2"]
    assert plan.sets_of_figure(full, "fig8") == ["zooms"]
    found = plan.searches_of_figure(full, "fig12")
    assert [(one.set, one.n_spo, one.sweep, one.value) for one in found] == [
        ("noise_0p01", 15, "noise", 0.01),
        ("noise_0p2", 15, "noise", 0.2),
    ]
    zooms = plan.searches_of_figure(full, "fig8")
    assert [one.n_spo for one in zooms] == full["sets"]["zooms"]["n_spo"]
    assert all(one.sweep == "zooms" and math.isnan(one.value) for one in zooms)
    assert plan.swept(full, "fig11") == "blur_spread"
    assert plan.largest_blur(full, "fig12") == 0.8


def test_sets_of_another_step_are_not_held_against_the_scene():
    names = {one.set for one in plan.compared_with_scene(study())}
    assert {"translations", "rotations", "aliasing_1p1", "noise_0p15"} <= names
    assert names.isdisjoint({"zooms", "shipped", "blur_errors"})
    fewer = {one.set for one in plan.compared_with_scene(study("{sets: {rotations: {step: 9}}}"))}
    assert names - fewer == {"rotations"}


def test_octaves_end_within_those_that_are_searched():
    # From 1.1 px two octaves end at 4.4, one at 2.2.
    full = study("{stability: {starts: [1.1, 2.2, 2.21]}}")
    assert plan.starts_within(full, "fig11") == [1.1, 2.2]
    one = study("{sets: {unknown_blur: {n_oct: 1}}, stability: {starts: [1.1, 1.2]}}")
    assert plan.starts_within(one, "fig11") == [1.1]


def test_figure_7_alone_draws_further_limits():
    full = study()
    assert plan.further_limits(full, "fig7", "max_offsets") == full["stability"]["max_offsets"]
    assert plan.further_limits(full, "fig8", "max_offsets") == []


def test_sets_that_answer_statements_are_compared_over_all_their_octaves():
    full = study("{comparison: {last_scale: 2.0}}")
    assert plan.last_scale(full, "translations") == plan.last_scale(full, "unbalanced") == 2.0
    assert plan.last_scale_of_figure(full, "figS5") is None
    assert plan.last_scale(full, "blur_zooms_0p4") is None
    octaves = plan.octaves_of_sweep(full, "large_scales")
    assert octaves[0] == 2.2 and octaves[-1] == pytest.approx(17.6)
    pairs = [(one.value, one.n_spo) for one in plan.searches_of_sweep(full, "unbalanced")]
    assert pairs == [(0.073, 3), (0.073, 19), (0.5, 3), (0.5, 19)]
    assert {plan.stated_key(full, name) for name in plan.STATED_SWEEPS} == {
        "assumed_blur", "delta_min", "noise",
    }  # fmt: skip


def test_views_of_each_tilt_have_curves_at_all_their_samplings():
    full = study("{stability: {curve_n_spo: [5, 9]}}")
    assert plan.curve_n_spo(full, "figS5") == [3, 15] and plan.tilts(full, "figS5")[-1] == 40
    assert plan.curve_n_spo(full, "fig7") == [5, 9] and plan.tilts(full, "fig7") == []
    assert plan.finest_curve(full) == 9


# Detection


@pytest.mark.parametrize(
    ("kept", "n_spo", "sets"), [("[3]", [3], []), ("true", [3, 15], ["zooms"]), ("false", [], [])]
)
def test_what_is_kept_is_searched_in_its_store(kept, n_spo, sets):
    full = study(f"{{samplings: {{n_spo: [3, 15]}}, keep_scale_spaces: {kept}}}")
    assert [n for text in ("3", "15") for n in plan.kept_sampling(full, text)] == n_spo
    assert plan.kept_set(full, "zooms") == sets


@given(st.lists(st.floats(0.5, 1000), min_size=1, max_size=9, unique=True))
def test_ratios_ascend(fractions):
    found = plan.kappas({"kappas": {"fractions": fractions}})
    assert found == sorted(found)
    assert sorted(found) == sorted(2 ** (1 / fraction) for fraction in fractions)


def test_the_path_of_a_refinement_depends_on_the_offset_for_unit_steps_only():
    assert plan.max_offset_of_path(study("{refinement: {max_offset: 0.7}}")) == 0.5
    unit = study("{refinement: {max_offset: 0.7, move: unit_step}}")
    assert plan.max_offset_of_path(unit) == 0.7


# Variants of the arithmetic


def test_variants_that_differ_in_the_tolerance_share_their_extrema():
    overlay = "{a: {bits: 8, epsilon: 1.0e-6}, b: {bits: 8, grey_range: 255.0, epsilon: 1.0}}"
    full = study(f"{{floor: {{variants: {overlay}}}}}")
    by_name = {one.variant: one for one in floor_variants.variants(full)}
    assert by_name["epsilon_1e6"].run == "usual" and by_name["epsilon_1e6"].tolerance == 1e-6
    assert by_name["cosine"].run == "cosine" and by_name["float64_view"].run == "float64_view"
    assert by_name["a"].run == by_name["b"].run == "bits_8"
    assert by_name["b"].tolerance == 1 / 255
    # Single precision has its tolerance applied while it searches, in its own grey range.
    for name in ("single", "single_255"):
        assert by_name[name].run == name and by_name[name].tolerance == -1
    assert by_name["closer"].set == "closer"
    # Each run is crossed with readings once, the first with all of them.
    crossing = {name: one.crossing for name, one in by_name.items() if one.scene == "reference"}
    assert [name for name, how in crossing.items() if how == "all"] == ["usual"]
    assert crossing["bits_8"] == crossing["closer"] == "some"
    assert crossing["a"] == crossing["epsilon_1e6"] == crossing["single"] == "none"


def test_single_precision_that_takes_long_is_asked_for_where_rates_have_settled():
    full = study("{floor: {settles_at: 17}}")
    by_name = {one.variant: one for one in floor_variants.variants(full)}
    assert floor_variants.samplings(full, "usual") == full["samplings"]["n_spo"]
    for name in ("single_sums", "single_transforms", "single_transforms_prime"):
        assert floor_variants.samplings(full, name) == [17, 18, 19]
        assert by_name[name].crossing == "rates" and by_name[name].first == 17


def test_further_pictures_have_the_usual_arithmetic_and_single_precision():
    full = {**study("{floor: {pictures: {hill: {path: hill.png}}}}"), "place": "scenes/stream/"}
    variants = floor_variants.variants(full)
    own = [one for one in variants if one.scene == "reference"]
    assert {one.place for one in own} == {"scenes/stream/"}
    hill = [one for one in variants if one.scene == "hill"]
    assert {one.place for one in hill} == {"scenes/hill/"}
    kinds = ["usual", "single_sums", "single_transforms", "single_transforms_prime"]
    assert [one.variant for one in hill] == [f"hill_{name}" for name in kinds]
    assert [one.run for one in hill] == kinds
    assert [one.words for one in hill][:2] == ["hill", "hill, sums in 32 bits"]


def test_variants_are_said_in_words_that_follow_the_settings():
    variants = floor_variants.variants(study("{floor: {pictures: {lake: null}}}"))
    assert {one.variant: one.words for one in variants} == {
        "usual": "no tolerance",
        "epsilon_1e7": "tolerance 1.19e-7",
        "epsilon_1e6": "tolerance 1e-6",
        "epsilon_1e5": "tolerance 1e-5",
        "cosine": "cosine series, not spline",
        "float64_view": "view in 64 bits",
        "bits_16": "view in 16 bits",
        "bits_8": "view in 8 bits",
        "single": "Gaussians rounded to 32 bits",
        "single_255": "Gaussians rounded to 32 bits, range 255",
        "range_255": "tolerance 1e-6, range 255",
        "closer": "S = 4",
        "closer_1e6": "S = 4, tolerance 1e-6",
        "sharper": "c = 0.6",
        "single_sums": "sums in 32 bits",
        "single_transforms": "transforms in 32 bits",
        "single_transforms_prime": "transforms in 32 bits, prime sides",
    }
    other = "{sets: {closer: {step: 5}}, floor: {variants: {usual: null, bits_8: {bits: 6}}}}"
    words = [one.words for one in floor_variants.variants(study(other))]
    assert "S = 5" in words and "view in 6 bits" in words and "no tolerance" not in words


def test_single_precision_alone_is_told_its_tolerance_and_its_range():
    full = study("{floor: {variants: {single_255: {epsilon: 0.5}, range_255: {epsilon: 0.5}}}}")
    asked = [("single_255", "epsilon"), ("single_255", "grey_range"), ("range_255", "epsilon")]
    assert [floor_variants.of_single_precision(full, *each) for each in asked] == [0.5, 255.0, 0.0]
    assert floor_variants.of_single_precision(full, "range_255", "grey_range") == 1.0
    prime = "single_transforms_prime"
    assert floor_variants.of_single_precision(full, prime, "sides") == "large"


# True extrema


def test_ratios_have_a_truth_of_their_own_but_for_that_of_the_detector():
    full = study("{truth: {fractions: [2, 3, 7.5, 500]}, kappas: {fractions: [2, 3, 7.5]}}")
    found = plan.true_ratios(full)
    assert [one.suffix for one in found] == ["_2", "", "_7.5"]
    for one in found:
        assert plan.kappa_of_truth(full, one.suffix) == pytest.approx(one.kappa, rel=1e-15)
    assert plan.true_ratios(study("{truth: {fractions: [500]}}"))[0].suffix == "_2"


def test_the_truth_reaches_beyond_what_is_held_against_it():
    full = study("{detector: {sigma_min: 1.2}, truth: {last_scale: 1.5, beyond: 1.25}}")
    assert plan.end_of_truth(full) == pytest.approx(1.2 * 1.5 * 1.25)


# Scenes


def test_a_further_scene_is_the_same_study_of_another_picture():
    overlay = "{reference_blur: 0.5, sets: {still: {noise: 0.1, shift_y: 3, guard: 4}}}"
    given_settings = complete(overlay)
    places = scenes.by_place(given_settings, ROOT)
    assert list(places) == ["", "scenes/stream/", "scenes/lanterns/", "scenes/lake/"]
    assert all(own["place"] == place for place, own in places.items())
    own, other = places[""], places["scenes/stream/"]
    assert other["reference"] == "config/images/stream.png" and own["reference_blur"] == 0.5
    assert other["reference_blur"] == 0 and other["keep_scale_spaces"] is False
    # Its view has the blur of that of the default scene, and nothing else of it.
    still = other["sets"]["still"]
    assert still["blur"] == own["sets"]["still"]["blur"] and still["noise"] == [0.0]
    assert (still["shift_y"], still["guard"]) == ([0.0], 0)
    changed = {"reference", "reference_sha256", "reference_blur", "sets", "keep_scale_spaces"}
    changed |= {"place"}
    assert {key for key in own if own[key] != other[key]} == changed


def test_the_step_of_a_scene_is_that_of_all_sets_that_share_the_step_of_the_view():
    given_settings = complete("{predictors: {pictures: {stream: {step: 8}}}}")
    sets = scenes.by_place(given_settings, ROOT)["scenes/stream/"]["sets"]
    for name in ("still", "exact", "translations", "noise_0p15"):
        assert set(sets[name]["step"]) == {8}
    assert sets["examples"]["step"] == [20, 14, 10] and sets["closer"]["step"] == [4]
    assert plan.compared_with_scene({"sets": sets, **{"sweeps": study()["sweeps"]}})


def test_places_are_those_of_scenes_that_there_are():
    pattern = re.compile(scenes.place_pattern(scenes.by_place(complete(), ROOT)))
    assert all(map(pattern.fullmatch, ("", "scenes/stream/", "scenes/lake/")))
    assert not any(map(pattern.fullmatch, ("scenes/coldwarm/", "scenes/", "tables/")))
    assert re.compile(scenes.place_pattern([""])).fullmatch("")


@pytest.mark.parametrize(
    ("overlay", "name"),
    [
        ("{}", "coldwarm"),
        ("{reference: config/images/../images/stream.png}", "stream"),
        ("{reference: roof.png}", "roof"),
        ("{reference: elsewhere/stream.png}", "reference"),  # a name that is taken
    ],
)
def test_the_default_scene_is_called_after_its_picture(overlay, name):
    first, *others = scenes.scored_scenes(complete(overlay), ROOT)
    assert first == scenes.Scene(name, "")
    assert [one.place for one in others] == [f"scenes/{one.name}/" for one in others]
    assert name not in {one.name for one in others}


def test_every_scene_is_scored_at_every_sampling(monkeypatch):
    monkeypatch.chdir(ROOT)
    overlay = "{samplings: {n_spo: [3, 9, 12]}, predictors: {n_spo: [3, 5, 9]}}"
    found = scenes.scored_samplings(complete(overlay))
    assert [one.n_spo for one in found] == [3, 9] * 3
    assert [one.place for one in found] == [""] * 2 + ["scenes/stream/"] * 2 + [
        "scenes/lanterns/"
    ] * 2


# What the study ends in


def test_a_scene_ends_in_its_figures_tables_and_verdicts_and_shares_what_shows_none():
    own = plan.final_files("", "r", "f", ["fig1.csv", "extra.csv"])
    other = plan.final_files("scenes/roof/", "r", "f", ["fig1.csv", "extra.csv"])
    assert {"f/fig5.pdf", "f/predictors.png", "r/claims.md", "r/tables/extra.csv"} <= set(own)
    assert "r/tables/predictors_detections.parquet" in own and own == sorted(own)
    assert {"f/scenes/roof/fig5.pdf", "r/scenes/roof/claims.md", "r/tables/fig1.csv"} <= set(other)
    assert "r/scenes/roof/tables/extra.csv" in other
    shared = {path for path in other if "/scenes/roof/" not in path}
    assert shared == {"r/tables/fig1.csv"}
    drawn_once = {"fig1", "figS3", "figS4", "predictors"}
    assert {name for name, figure in plan.FIGURES.items() if not figure.of_scene} == drawn_once
    assert len([path for path in own if path.startswith("f/")]) == 2 * len(plan.FIGURES)


def test_all_tables_that_a_study_writes_are_among_what_it_ends_in():
    claimed = [f"{name}.csv" for name in table_names(read_claims(ROOT / "config/claims.yaml"))]
    final = {Path(path).name for path in plan.final_files("", "r", "f", claimed)}
    written = {path.name for path in (ROOT / "results/reference/tables").glob("*.csv")}
    assert len(written) > 80 and written <= final


# What jobs may take


@pytest.fixture
def small(monkeypatch):
    monkeypatch.setattr(job_resources, "_shape", lambda path: (1000, 2000))
    return study("{sets: {still: {step: 2}, zooms: {n_views: 2, zoom: 2.0, step: 10, guard: 0}}}")


def test_time_grows_with_what_is_visited(small):
    # 500 x 1000 pixels, 15 microseconds each and per scale; 5 minutes to wake up.
    assert job_resources.pixels(small, "still") == (500_000, 1000)
    assert job_resources.minutes_of_set(small, "still", "8") == 5 + 1
    assert job_resources.minutes_of_set(small, "still", "9") == 5 + 2  # 67.5 s
    # Views of the whole of it, 100 x 200 and 50 x 100 pixels.
    assert job_resources.pixels(small, "zooms") == (25_000, 200)
    steps = len(small["grid"]["delta_min"])
    assert job_resources.minutes_of_grid(small, "9") == 5 + math.ceil(steps * 67.5 / 60)
    kappas = small["kappas"]
    visited = 10 * len(kappas["fractions"]) * kappas["n_spo"]
    assert job_resources.minutes_of_kappas(small) == 5 + math.ceil(visited * 7.5 / 60)
    assert job_resources.minutes_of_truth(small) == 5 + math.ceil(300 * 7.5 / 60)
    scales = sum(small["samplings"]["n_spo"])
    assert job_resources.minutes_of_variant(small) == 5 + math.ceil(10 * scales * 7.5 / 60)


def test_memory_grows_with_the_picture_and_with_rows_of_the_scale_space(small):
    assert job_resources.megabytes_of_reference(small) == 600 + 160  # ten copies of 2 M doubles
    # Three copies of 128 rows of 5 slices of 3000 doubles.
    expected = 600 + math.ceil(3 * 128 * 5 * 3000 * 8 / 1e6)
    assert job_resources.megabytes_of_store(small, "still", "3") == expected


def test_time_of_shots_grows_with_pairs_scales_and_kinds_of_noise(small, monkeypatch):
    looked_at = {"shots": 3_000_000, "moved": 500_000}
    monkeypatch.setattr(job_resources, "pixels", lambda settings, name: (looked_at[name], 1))

    def seconds(**changes):
        asked = {
            "n_pairs": 10, "n_pairs_others": 2, "n_spo": 15, "n_oct": 2, "n_moved": 4,
            "noise": ["one"],
        } | changes  # fmt: skip
        return 60 * (job_resources.minutes_of_shots({"uncertainty": asked}) - 5)

    one = 15e-6 * 15 * 2
    assert seconds() == pytest.approx(one * (5 * 18 * 3e6 + 8 * 5e5), abs=60)
    assert seconds(n_pairs=11) - seconds() == pytest.approx(one * 5 * 3e6, abs=60)
    assert seconds(n_pairs_others=3) - seconds() == pytest.approx(one * 20 * 3e6, abs=60)
    assert seconds(n_moved=1004) - seconds() == pytest.approx(one * 2000 * 5e5, abs=60)
    for more in ({"noise": ["one", "two"]}, {"n_spo": 30}, {"n_oct": 4}):
        assert seconds(**more) == pytest.approx(2 * seconds(), abs=120)
