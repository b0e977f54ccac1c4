"""What people mistype: every mistake gets one line that names the setting, what was given, what is
allowed."""

from __future__ import annotations

import copy
from pathlib import Path

import pytest
import yaml

from keystab.errors import InputError
from keystab.study import feasibility, settings
from keystab.study.plain_yaml import read_plain_yaml

ROOT = Path(__file__).parents[2]
SCHEMA = read_plain_yaml(ROOT / "workflow/schemas/config.schema.yaml")
GIVEN = settings.read_yaml(ROOT / "config/config.yaml")

WRONG = [
    # types
    ("detector: {epsilon: 1e-3}", "detector.epsilon is the text '1e-3', allowed is a number of at least 0: write 0.001"),
    ("detector: {sigma_min: [1.1]}", "detector.sigma_min is [1.1], allowed is a number above 0"),
    ("detector: {kappa: true}", "detector.kappa is true, allowed is a number above 1"),
    ("detector: 1.1", "detector is 1.1, allowed is a block of settings"),
    ("detector: [1, 2]", "detector is [1, 2], allowed is a block of settings"),
    ("reference: null", "reference is empty, allowed is a text that is not empty"),
    ("reference: 3", "reference is 3, allowed is a text that is not empty"),
    ("reference_sha256: 12345678", "reference_sha256 is 12345678, allowed is 64 hexadecimal digits or null"),
    ("sets: {still: {step: \"ten\"}}", "sets.still.step is the text 'ten', allowed is a number above 0 or a list [a, b, ...], each a number above 0"),
    ("sets: {still: {height: 10.5}}", "sets.still.height is 10.5, allowed is a whole number of at least 1 or null"),
    ("sets: {translations: {n_spo: 3}}", "sets.translations.n_spo is 3, allowed is a list [a, b, ...], each a whole number of at least 1 and at most 100, smallest first, none twice"),
    ("sets: {aliasing: {sweep: {blur: 0.3}}}", "sets.aliasing.sweep.blur is 0.3, allowed is a list [a, b, ...], each a number of at least 0, smallest first, none twice"),
    ("refinement: {max_offset: inf}", "refinement.max_offset is the text 'inf', allowed is a number above 0: write .inf"),
    ("refinement: {max_iterations: .inf}", "refinement.max_iterations is inf, allowed is a whole number of at least 1 and at most 100"),
    ("refinement: {max_iterations: 2.0}", "refinement.max_iterations is 2.0, allowed is a whole number of at least 1 and at most 100"),
    ("refinement: {scale_moves: \"yes\"}", "refinement.scale_moves is the text 'yes', allowed is true or false"),
    ("kappas: {n_spo: [15]}", "kappas.n_spo is [15], allowed is a whole number of at least 1 and at most 100"),
    ("floor: {variants: []}", "floor.variants is [], allowed is a block of settings"),
    ("samplings: {n_spo: \"3, 5\"}", "samplings.n_spo is the text '3, 5', allowed is a list with at least 2 items, each a whole number of at least 1 and at most 100, smallest first, none twice"),
    ("keep_scale_spaces: 3", "keep_scale_spaces is 3, allowed is true or false or a list [a, b, ...], each a whole number of at least 1 and at most 100, smallest first, none twice"),
    ("draft: \"true\"", "draft is the text 'true', allowed is true or false: write true without quotes"),
    ("draft: 1", "draft is 1, allowed is true or false"),
    # names
    ("detector: {kapa: 1.3}", "detector.kapa is no setting; did you mean detector.kappa?"),
    ("Detector: {kappa: 1.2}", "Detector is no setting; did you mean detector?"),
    ("referense: x.png", "referense is no setting; did you mean reference?"),
    ("1: 2", "1 is no setting; the settings are reference, reference_sha25"),
    ("detector: {oversampling: Spline}", "detector.oversampling is the text 'Spline', allowed is spline or cosine: did you mean spline?"),
    ("detector: {oversampling: bicubic}", "detector.oversampling is the text 'bicubic', allowed is spline or cosine"),
    ("views_dtype: double", "views_dtype is the text 'double', allowed is float32 or float64"),
    ("refinement: {move: unitstep}", "refinement.move is the text 'unitstep', allowed is nearest or unit_step: did you mean unit_step?"),
    ("sets: {still: {dtype: float}}", "sets.still.dtype is the text 'float', allowed is float32 or float64 or null: did you mean float64?"),
    ("sets: {Still: {blur: 1.0}}", "sets has 'Still', allowed are names of small letters, digits and _ that start with a letter"),
    ("sets: {translation: {n_views: 2}}", "sets.translation is no set that figures are made from; did you mean sets.translations? Give another set a name that is less alike"),
    ("sets: {noise: {sweep: {sigma: [0.01]}}}", "sets.noise.sweep.sigma is no setting; the settings of sets.noise.sweep are blur, blur_spread, noise"),
    ("floor: {variants: {usual: {set: near}}}", "floor.variants.usual.set is near, allowed are sets of views, such as exact, closer, sharper"),
    ("floor: {variants: {new: {epsilom: 1.0e-6}}}", "floor.variants.new.epsilom is no setting; did you mean floor.variants.new.epsilon?"),
    # ranges
    ("detector: {sigma_min: -1.1}", "detector.sigma_min is -1.1, allowed is a number above 0"),
    ("detector: {sigma_min: .nan}", "detector.sigma_min is nan, allowed is a number above 0"),
    ("detector: {kappa: .inf}", "detector.kappa is inf, allowed is a number above 1"),
    ("detector: {kappa: 1}", "detector.kappa is 1, allowed is a number above 1"),
    ("reference: \"\"", "reference is the text '', allowed is a text that is not empty"),
    ("sets: {still: {step: 0}}", "sets.still.step is 0, allowed is a number above 0 or a list [a, b, ...], each a number above 0"),
    ("sets: {still: {n_views: 0}}", "sets.still.n_views is 0, allowed is a whole number of at least 1 and at most 1000"),
    ("sets: {examples: {blur: []}}", "sets.examples.blur is [], allowed is a number of at least 0 or a list [a, b, ...], each a number of at least 0"),
    ("sets: {translations: {n_spo: [0, 3, 15]}}", "sets.translations.n_spo[0] is 0, allowed is a whole number of at least 1 and at most 100"),
    ("sets: {translations: {n_spo: [3, 3, 15]}}", "sets.translations.n_spo is [3, 3, 15], allowed is a list [a, b, ...], each a whole number of at least 1 and at most 100, smallest first, none twice"),
    ("sets: {noise: {sweep: {noise: [-0.01]}}}", "sets.noise.sweep.noise[0] is -0.01, allowed is a number of at least 0"),
    ("comparison: {stable_above: 80}", "comparison.stable_above is 80, allowed is a number of at least 0 and at most 1"),
    ("stability: {max_offsets: []}", "stability.max_offsets is [], allowed is a list [a, b, ...], each a number above 0, smallest first, none twice"),
    ("stability: {max_offsets: [0.6, 0.5]}", "stability.max_offsets is [0.6, 0.5], allowed is a list [a, b, ...], each a number above 0, smallest first, none twice"),
    ("stability: {curve_n_spo: [3, 15, 19]}", "stability.curve_n_spo is [3, 15, 19], allowed is a list of 2 items, each a whole number of at least 1 and at most 100, smallest first, none twice"),
    ("kappas: {fractions: [3, 1000000]}", "kappas.fractions[1] is 1000000, allowed is a number of at least 0.5 and at most 1000"),
    ("samplings: {n_spo: []}", "samplings.n_spo is [], allowed is a list with at least 2 items, each a whole number of at least 1 and at most 100, smallest first, none twice"),
    # combinations
    ("sets: {still: {blur: 1.2}}", "detector.sigma_min is 1.1, allowed is at least 1.2, the blur that the view sets.still already has"),
    ("sets: {still: {n_views: 3}}", "sets.still has 3 views, allowed is one: figures 3 to 6 study a single view"),
    ("sets: {still: null}", "sets.still is missing; the figures are made from it"),
    ("sets: {still: {sweep: {blur: [1.0]}}}", "sets.still has a sweep, allowed is none: figures are made from its views as one set"),
    ("sets: {examples: {blur: [0.5, 1.0]}}", "sets.examples has lists of different lengths (blur 2, step 3); give one number per view"),
    ("sets: {translations: {n_spo: []}}", "sets.translations.n_spo is empty; give the scales per octave of a sampling"),
    ("sets: {translations: {guard: 3}}", "sets.translations.guard is 3, allowed is at least 14: 6 times the largest scale of its 1 octave(s), or borders enter the comparison"),
    ("sets: {translations: {shift_spread: 300.0}}", "sets.translations leaves no common field of view: no pixel of the first view of 259 x 434 px lies 17 px inside all 32 views; give smaller shifts, zooms or rotations"),
    ("sets: {zooms: {zoom: 6.0}}", "sets.zooms leaves no common range of scales: the last view begins at 8.32 px of the first, which ends at 4.4 px; give a smaller zoom or more octaves"),
    ("sets: {shipped: {sigma_min: 0.4}}", "sets.shipped is searched from sigma_min = 0.4 px, allowed is at least 0.5, the blur that its views already have"),
    ("sets: {shipped: {n_spo: [3, 5]}}", "sets.shipped.n_spo is [3, 5], allowed is one sampling for figure 7"),
    ("sets: {aliasing: {sweep: {noise: [0.1]}}}", "sets.aliasing.sweep has blur and noise, allowed is one of blur, blur_spread, noise"),
    ("sets: {aliasing: {sweep: null}}", "sets.aliasing.sweep has nothing, allowed is blur: figure 10 is made from it"),
    ("sets: {unknown_blur: {sweep: {blur_spread: [0.9]}}}", "sets.unknown_blur_0p9 has blur_spread 0.9, allowed is at most blur = 0.7: blurs below 0 do not exist"),
    ("sets: {blur_errors: {assumed_blur: 0.8}}", "sets.blur_errors.assumed_blur is 0.8, allowed is 0.7, the blur of its first view: figure S2 compares the others with that one"),
    ("sets: {blur_errors: {assumed_blur: null}}", "sets.blur_errors.assumed_blur is empty, allowed is 0.7, the blur of its first view: figure S2 compares the others with that one"),
    ("comparison: {first_scale: 2.5}", "truth.last_scale is 2.0, allowed is a number above comparison.first_scale = 2.5"),
    ("comparison: {unstable_below: 0.9}", "comparison.unstable_below is 0.9, allowed is a number below comparison.stable_above = 0.8"),
    ("stability: {curve_n_spo: [3, 16]}", "stability.curve_n_spo is [3, 16], allowed are members of n_spo of sets.translations, sets.zooms and sets.rotations, which share [3, 5, 9, 15, 19]"),
    ("stability: {starts: [3.0, 4.0]}", "stability.starts is [3.0, 4.0], allowed is at least one of at most 2.2: an octave from there must end within the 2 of sets.unknown_blur"),
    ("floor: {variants: {single_transforms: {oversampling: cosine}}}", "floor.variants.single_transforms transforms in single precision with the cosine series, allowed is oversampling: spline"),
    ("floor: {pictures: {stream: {path: config/images/lake.png}}}", "floor.pictures.stream has the name of another picture, that of predictors.pictures: give it a name of its own"),
    ("floor: {pictures: {lake: {path: config/images/sea.png}}}", "floor.pictures.lake: {}/config/images/sea.png: no such file; give the path"),
    ("floor: {settles_at: 30}", "floor.settles_at is 30, allowed is at most 19, the last of samplings.n_spo"),
    ("samplings: {n_spo: [3, 15]}", "keep_scale_spaces has 19, allowed are members of samplings.n_spo = [3, 15]"),
    ("keep_scale_spaces: [40]", "keep_scale_spaces has 40, allowed are members of samplings.n_spo = [3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16, 17, 18, 19]"),
    ("results: figures", "results, figures and logs name the same folder; give three"),
    ("results: logs/../figures", "results, figures and logs name the same folder; give three"),
    # the picture
    ("reference: nowhere.png", "reference: {}/nowhere.png: no such file; give the path of a PNG, JPEG, TIFF or .npy picture"),
    ("reference: config", "reference: {}/config: is a folder; give the path of a PNG, JPEG, TIFF or .npy picture"),
    ("reference: config/config.yaml", "reference: {}/config/config.yaml: its content is none of PNG, JPEG, TIFF and .npy; give such a picture"),
    ("sets: {still: {step: 1000}}", "sets.still asks for views of 2 x 4 px, allowed is a height of at least 9 px: give a larger reference or a step below 1000"),
    ("sets: {still: {height: 300}}", "sets.still.height is 300, allowed is at most 225: the reference has 2250 px, the step is 10"),
    ("comparison: {border: 200}", "comparison.border is 200, allowed is at most 54: the views of sets.examples have a side of 112 px"),
]  # fmt: skip


def said_of(overlay: str) -> str:
    """What is said before anything runs, of config/config.yaml under an overlay."""
    given = copy.deepcopy(GIVEN)
    settings.merge(given, yaml.safe_load(overlay))
    with pytest.raises(InputError) as caught:
        feasibility.require(settings.checked(given, SCHEMA), ROOT)
    return str(caught.value)


@pytest.mark.parametrize(("overlay", "line"), WRONG)
def test_a_mistake_gets_one_line(overlay, line):
    said = said_of(overlay)
    assert "\n" not in said
    assert said.startswith(f"config: {line.replace('{}', str(ROOT))}")
    # An unknown name is followed by known ones; all else by what is allowed or what to do.
    ends = ("allowed", "did you mean", "the settings", "give", "made from")
    assert any(words in said for words in ends)
