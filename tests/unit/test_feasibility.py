"""Settings that are well-formed but cannot work are refused before anything runs."""

from __future__ import annotations

import copy
import re
from pathlib import Path

import numpy as np
import pytest

from keystab.camera.view_sets import per_view, view_shapes, view_specs
from keystab.errors import InputError
from keystab.study import feasibility, picture_checks, settings
from keystab.study.plain_yaml import read_plain_yaml

ROOT = Path(__file__).parents[2]
SCHEMA = read_plain_yaml(ROOT / "workflow/schemas/config.schema.yaml")
DEFAULTS = settings.completed({}, SCHEMA)


def changed(*changes: tuple[str, object]) -> dict:
    config = copy.deepcopy(DEFAULTS)
    for place, value in changes:
        *blocks, key = place.split(".")
        block = config
        for name in blocks:
            block = block[name]
        block[key] = value
    return config


@pytest.mark.parametrize("path", ["config.yaml", "quick.yaml"])
def test_shipped_settings_are_feasible(path):
    given = settings.read_yaml(ROOT / "config/config.yaml", ROOT / "config" / path)
    feasibility.require(settings.checked(given, SCHEMA), ROOT)


@pytest.mark.parametrize(
    ("changes", "line"),
    [
        ([("detector.sigma_min", 1.0)], "detector.sigma_min is 1.0, allowed is at least 1.1"),
        ([("reference_blur", 5.0)], "detector.sigma_min is 1.1, allowed is at least 1.2083"),
        ([("sets.still.blur", [1.0, 1.1])], "sets.still has 2 views, allowed is one: figures 3 to 6 study a single view"),
        ([("sets.examples.step", [20, 14])], "sets.examples has lists of different lengths (blur 3, step 2)"),
        ([("comparison.unstable_below", 0.9)], "comparison.unstable_below is 0.9, allowed is a number below comparison.stable_above = 0.8"),
        ([("comparison.last_scale", 1.2)], "comparison.first_scale is 1.2599210498948732, allowed is a number below comparison.last_scale = 1.2"),
        ([("blobs.size_to", 1.0)], "blobs.size_from is 1.2, allowed is a number below blobs.size_to = 1.0"),
        ([("semigroup.sigma_to", 0.05)], "semigroup.sigma_from is 0.1, allowed is a number below semigroup.sigma_to = 0.05"),
        ([("keep_scale_spaces", [3, 40])], "keep_scale_spaces has 40, allowed are members of samplings.n_spo = [3, 4,"),
        ([("figures", "empty")], "results, figures and logs name the same folder"),
        ([("reference", "nowhere.png")], "reference: "),
        ([("reference", "config/config.yaml")], "reference: "),
        ([("sets.still.step", 500)], "sets.still asks for views of 4 x 8 px, allowed is a height of at least 9 px"),
        ([("sets.examples.height", 113)], "sets.examples.height is 113, allowed is at most 112: the reference has 2250 px, the step is 20"),
        ([("sets.still.step", 0.01), ("keep_scale_spaces", False)], "delta_min = "),
        ([("keep_scale_spaces", True)], "keep_scale_spaces asks for 2.53 TB of stores, 1 TB are free"),
        ([("sets.aliasing.sweep", None)], "sets.aliasing.sweep has nothing, allowed is blur: figure 10 is made from it"),
        ([("sets.noise.sweep", {"blur": [1.0]})], "sets.noise.sweep has blur, allowed is noise: figure 12 is made from it"),
        ([("sets.unknown_blur.n_spo", [3, 15])], "sets.unknown_blur.n_spo is [3, 15], allowed is one sampling for figure 11"),
        ([("sets.unknown_blur.sweep", {"blur_spread": [0.8]})], "sets.unknown_blur_0p8 has blur_spread 0.8, allowed is at most blur = 0.7"),
        ([("sets.zooms.n_spo", [])], "sets.zooms.n_spo is empty; give the scales per octave of a sampling"),
        ([("stability.curve_n_spo", [3, 11])], "stability.curve_n_spo is [3, 11], allowed are members of n_spo of sets.translations, sets.zooms and sets.rotations, which share [3, 5, 9, 15, 19]"),
        ([("sets.shipped.blur", 0.9)], "sets.shipped is searched from sigma_min = 0.8 px, allowed is at least 0.9, the blur that its views already have"),
        ([("sets.blur_errors.assumed_blur", 1.2), ("sets.blur_errors.blur", [1.2, 1.1])], "sets.blur_errors is searched from sigma_min = 1.1 px, allowed is at least 1.2"),
        ([("sets.zooms.guard", 26)], "sets.zooms.guard is 26, allowed is at least 27: 6 times the largest scale of its 2 octave(s)"),
        ([("sets.zooms.zoom", 4.0), ("sets.zooms.n_oct", 2)], "sets.zooms leaves no common range of scales: the last view begins at 5.54 px of the first, which ends at 4.4 px"),
        ([("sets.translations.shift_spread", 300.0)], "sets.translations leaves no common field of view: no pixel of the first view of 259 x 434 px lies 17 px inside all 32 views"),
        ([("sets.translations.height", 260)], "sets.translations.height is 260, allowed is at most 259: the reference has 2250 px, the step is 10"),
        ([("predictors.pictures.stream.step", 300.0)], "predictors.pictures.stream.step is 300, which gives a view of 6 x 10 px, allowed are sides of at least 9 px"),
        ([("predictors.pictures.stream.path", "nowhere.png")], "predictors.pictures.stream: "),
        ([("predictors.pictures", {"own": {"path": "config/images/../images/coldwarm.png", "step": 10}})], "predictors.pictures has no picture besides the reference"),
    ],
)  # fmt: skip
def test_contradictions_get_one_line(changes, line, monkeypatch):
    monkeypatch.setattr(picture_checks, "_free_bytes", lambda folder: int(1e12))
    with pytest.raises(InputError) as caught:
        feasibility.require(changed(("results", "empty"), *changes), ROOT)
    (said,) = str(caught.value).splitlines()
    assert said.startswith(f"config: {line}")


def said_of_picture(path: Path, config: dict, written: dict | None = None) -> str:
    config = {**config, "reference": str(path), "results": str(path.parent / "r")}
    with pytest.raises(InputError) as caught:
        feasibility.require(config, ROOT, written)
    return str(caught.value)


def picture_of(path: Path, height: int, width: int) -> Path:
    """A picture of which nobody looks at the pixels."""
    np.lib.format.open_memmap(path, "w+", np.uint8, (height, width))
    return path


@pytest.mark.parametrize("overlay", ["config.yaml", "quick.yaml"])
def test_a_small_picture_is_said_to_be_small_and_how_large_it_must_be(overlay, tmp_path):
    given = settings.read_yaml(ROOT / "config/config.yaml", ROOT / "config" / overlay)
    config = settings.checked(given, SCHEMA)
    said = said_of_picture(picture_of(tmp_path / "a.npy", 100, 140), config, {})
    assert said.startswith("config: picture too small: ") and "\n" not in said
    assert "has 100 x 140 pixels (height x width)" in said and "_0p" not in said
    height, width = map(int, re.search(r"at least (\d+) x (\d+);", said).groups())
    least = picture_of(tmp_path / "least.npy", height, width)
    own = {**config, "reference": str(least), "results": str(tmp_path / "r")}
    feasibility.require(own, ROOT, {})
    for less in ((height - 1, width), (height, width - 1)):
        said = said_of_picture(picture_of(tmp_path / "less.npy", *less), config, {})
        assert f"at least {height} x {width};" in said


def test_a_size_that_a_person_gave_is_named_and_not_the_picture(tmp_path):
    picture = picture_of(tmp_path / "a.npy", 2000, 3000)
    config, height = changed(("sets.still.height", 201)), {"sets": {"still": {"height": 201}}}
    line = "config: sets.still.height is 201, allowed is at most 200: the reference has 2000 px, the step is 10"
    assert said_of_picture(picture, config, height) == line
    assert "picture too small: " in said_of_picture(picture, config, {"draft": True})
    # A sweep: one line for each of its members, as before.
    config, width = (
        changed(("sets.unbalanced.width", 400)),
        {"sets": {"unbalanced": {"width": 400}}},
    )
    said = said_of_picture(picture, config, width)
    assert [line.split()[1] for line in said.splitlines()] == ["sets.unbalanced_0p073.width", "sets.unbalanced_0p5.width"]  # fmt: skip


def test_stores_that_exist_need_no_more_room(tmp_path, monkeypatch):
    monkeypatch.setattr(picture_checks, "_free_bytes", lambda folder: 0)
    config = changed(("results", str(tmp_path)), ("keep_scale_spaces", [3]))
    assert picture_checks.picture_problems(config, ROOT)
    (tmp_path / "scale_space").mkdir()
    (tmp_path / "scale_space" / "n3.sha256").touch()
    assert not picture_checks.picture_problems(config, ROOT)


def test_views_of_a_set():
    rest = {"shift_y": 0.0, "shift_x": [0.0, 0.25], "rotation": 0.0, "noise": 0.0}
    views = {"blur": 1.1, "step": [10.0, 12.0], "height": None, "width": 30, **rest}
    assert per_view(views)["blur"] == [1.1, 1.1]
    assert view_shapes(views, (250, 400)) == [(20, 30)] * 2  # the largest step decides
    first, second = view_specs("some", views, (250, 400))
    assert (first.step, first.shift, first.shape) == (10.0, (0.0, 0.0), (20, 30))
    assert (second.step, second.shift, second.seed) == (12.0, (0.0, 0.25), ("some", 1))
    with pytest.raises(InputError, match="different lengths"):
        per_view({**views, "noise": [0.0, 0.1, 0.2]})


def test_stores_take_eight_bytes_for_each_sample_of_all_views_octaves_and_samplings(monkeypatch):
    monkeypatch.setattr(picture_checks, "view_shapes", lambda views, shape: [(10, 20), (30, 5)])
    detector = {"detector": {"kappa": 2 ** (1 / 3), "sigma_min": 1.1}}

    def of(**changes):
        views = {"sigma_min": None, "n_oct": 1, "n_spo": [3], "delta_min": 0.5} | changes
        return picture_checks.bytes_of_stores("a", views, (100, 200), detector)

    assert of() == 8 * 350 * 5 * 4  # five slices, four samples in each pixel
    assert of(n_oct=2) == 1.25 * of()
    assert of(n_spo=[3, 5]) == of() * (5 + 7) / 5
    assert of(delta_min=0.25) == 4 * of()
    balanced = {scale: of(delta_min=None, sigma_min=scale) for scale in (None, 1.1, 2.2)}
    assert balanced[None] == balanced[1.1]
    # Steps in proportion to the first scale, but for the balance of the samplings of scale.
    assert 3 < balanced[1.1] / balanced[2.2] < 5
