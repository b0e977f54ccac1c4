"""A change reruns what depends on it and nothing else."""

from __future__ import annotations

import os
import time

import pytest
from project import QUICK, Project

from keystab.study import plan

FIGURES = set(plan.FIGURES)

PREDICTING = {"score_predictors", "predictors"}
AFTER_MATCHING = {"score_features", "cut_cubes", "fig4", "fig5", "fig6"}
AFTER_MATCHING |= {"evaluate_keypoints", "truth"} | PREDICTING
SAMPLINGS = {"match_grid", "match_samplings", "fig3"} | AFTER_MATCHING
VIEWS = {"match_views", "match_sift", "match_translations", "fig7", "fig8", "figS1", "figS5"}
STATED = {"match_large_scales", "match_blur_zooms", "match_unbalanced", "figS2"}
SWEEPS = {"match_sweep", "match_aliasing", "match_blurs", "fig10", "fig11", "fig12"} | STATED
KAPPAS = {"match_kappas", "fig9"}
BLOBS = {"match_blobs", "figS4"}
VARIANTS = {"match_variants", "floor"}
MATCHING = SAMPLINGS | VIEWS | SWEEPS | KAPPAS | VARIANTS
ACCEPTING = {"evaluate_samplings", "evaluate_cosine", "evaluate_kappas", "evaluate_views"}
ACCEPTING |= {"truth", "truth_cameras"}
EVALUATING = ACCEPTING | {
    "evaluate_grid",
    "evaluate_keypoints",
    "evaluate_refinement",
    "refinement",
}
EVALUATING |= PREDICTING
BARS = {"calibrate_bars", "uncertainty"}
TRUTHS = {"find_true_extrema", "find_scene_extrema"}
ONE_VIEW = {"detect", "detect_grid", "count_refined", "view_statements"} | SAMPLINGS
DETECTION = ONE_VIEW | {"detect_views", "detect_kappas", "detect_variant"} | MATCHING | EVALUATING
DETECTION |= {"detect_cosine"} | BARS
STILL = {"simulate", "scale_space", "detect_kappas", "detect_variant", "detect_cosine"} | ONE_VIEW
STILL |= KAPPAS | VARIANTS | TRUTHS | EVALUATING
SIMULATION = STILL | DETECTION | TRUTHS | {"describe_views", "crop_views", "fig2"}
THEORY = {"semigroup", "sampling_theory", "noise_theory", "camera_optics", "detect_blobs"} | BLOBS
EVERYTHING = SIMULATION | FIGURES | THEORY
MORE = "from __future__ import annotations"
MORE = (MORE, f"{MORE}\nMORE = 1")


def reruns(project, *overlays: str) -> set[str]:
    """Rules that would run, but for the list of digests that comes after whatever runs."""
    rules = project.would_run(*QUICK, *overlays).keys() - {"all"}
    assert ("checksums" in rules) is bool(rules)
    return rules - {"checksums"}


def test_nothing_to_do_when_finished_copied_and_touched(finished):
    now = time.time()
    for path in finished.folder.rglob("*"):
        if ".snakemake" not in path.parts and path.is_file():
            os.utime(path, (now, now))
    assert reruns(finished) == set()


NO_EFFECT = [
    ("src/keystab/detection/extrema.py", "def discrete_extrema(", "# a comment\ndef discrete_extrema("),
    ("src/keystab/detection/extrema.py", '"""Discrete extrema', '"""Discrete, local extrema'),
    ("src/keystab/__init__.py", '"fit_psf": ', '"blob_image": "scalespace.gaussian_blobs",\n    "fit_psf": '),
    ("src/keystab/study/settings.py", "from __future__ import annotations", "from __future__ import annotations\nMORE = 1"),
    ("src/keystab/figures/palette.py", '"""Predictors of stability', '"""Features'),
    ("src/keystab/__init__.py", '    "InputError": "errors",', '    "another": "errors",\n    "InputError": "errors",'),
    ("src/keystab/parameters.py", "@dataclass(frozen=True)\nclass Optics:", "class _More:\n    pass\n\n\n@dataclass(frozen=True)\nclass Optics:"),
    ("workflow/report/fig3.rst", "", "A better caption. "),
    ("workflow/rules/detect.smk", "rule detect:\n", "# a comment\nrule detect:\n"),
    ("config/config.yaml", "detector:\n", "# a comment\ndetector:\n"),
    ("config/claims.yaml", "- id:", "# a comment\n- id:"),
]  # fmt: skip


def test_edits_without_effect(finished):
    """Comments, docstrings, names that nothing uses, settings that change nothing: all at once."""
    for name, old, new in NO_EFFECT:
        finished.edit(name, old, new)
    (finished.folder / "config/change.yaml").write_text("comparison: {border: 3}\n")  # 3.0
    assert reruns(Project(finished.folder), "config/change.yaml") == set()


def slow(*values):
    return pytest.param(*values, marks=pytest.mark.slow)


@pytest.mark.parametrize(
    ("name", "old", "new", "expected"),
    [
        ("src/keystab/detection/extrema.py", "def discrete_extrema(", "MORE = 1\n\n\ndef discrete_extrema(", DETECTION | BLOBS | TRUTHS | {"detect_blobs"}),
        slow("src/keystab/evaluation/roc.py", "from __future__ import annotations", "from __future__ import annotations\nMORE = 1", {"score_features", "fig5", "evaluate_keypoints", "truth"} | PREDICTING | BARS),
        slow("src/keystab/stages/cut_cubes.py", "    unique = ", "    MORE = 1\n    unique = ", {"cut_cubes", "fig6"}),
        slow("src/keystab/figures/fig5.py", "PANELS = {", "MORE = 1\nPANELS = {", {"fig5"}),
        slow("src/keystab/figures/style.py", "from __future__", "import os\nfrom __future__", FIGURES),
        slow("src/keystab/camera/simulation.py", *MORE, SIMULATION),
        # The contract for code: what depends on it, and nothing else. Of all modules it is tried by
        # their digests, in test_reruns_table.py.
        slow("src/keystab/evaluation/intervals.py", *MORE, MATCHING | EVALUATING | BARS | {"count_refined", "view_statements"}),
        slow("src/keystab/evaluation/recall_precision.py", *MORE, EVALUATING | VARIANTS),
        slow("src/keystab/detection/sift_filters.py", *MORE, {"match_sift", "fig7"}),
        slow("src/keystab/utils/validation.py", *MORE, EVERYTHING - {"simulate", "describe_views", "semigroup", "crop_views", "fig1", "fig2"}),
        slow("src/keystab/parameters.py", "        str | None, Setting(\"reference_sha256\"", "        None | str, Setting(\"reference_sha256\"", SIMULATION),
        ("environment.lock", "numpy==", "numpy==99.", EVERYTHING),
    ],
)  # fmt: skip
def test_edits_of_code(finished, name, old, new, expected):
    if name.endswith("style.py"):  # the future import must stay first
        old, new = (
            "from __future__ import annotations",
            "from __future__ import annotations\nMORE = 1",
        )
    finished.edit(name, old, new)
    edited = Project(finished.folder) if name.startswith("src") else finished
    assert reruns(edited) - {"claims"} == expected


def test_a_colour_and_another_criterion_reach_what_uses_them_and_nothing_else(finished):
    """Both at once: neither can do what the other does."""
    finished.edit("src/keystab/figures/palette.py", '"condition": "#A8458A"', '"condition": "#A8458B"')  # fmt: skip
    finished.edit("config/claims.yaml", "criterion: new > 0", "criterion: new >= 0")
    assert reruns(Project(finished.folder)) == {"fig5", "claims"}


@pytest.mark.slow  # another module of whose edit the same is asked in test_reruns_table.py
def test_other_code_of_verdicts_gives_verdicts_again_and_nothing_else(finished):
    finished.edit("src/keystab/study/verdicts.py", "\nVERDICTS = ", "\nMORE = 1\nVERDICTS = ")
    assert reruns(Project(finished.folder)) == {"claims"}


@pytest.mark.parametrize(
    ("setting", "expected"),
    [
        # What some change is apart from what others change: a plan for all of them says the same.
        # Of the variant the inputs stay the same, but others belong to it.
        ("{predictors: {block: 25.0}, sets: {examples: {rotation: 112}}, stability: {n_resamples: 200}, floor: {variants: {closer_1e6: {set: still}}}}",
            PREDICTING | {"simulate", "describe_views", "fig2"} | VARIANTS
            | VIEWS | STATED | {"match_sweep", "match_aliasing", "fig10", "fig11", "fig12"}),
        ("{comparison: {soft_ends: true}, sets: {shots: {blur: [0.8, 0.9]}}}",
            (MATCHING - {"match_grid", "fig3", "match_blurs"} - VARIANTS) | BARS | {"simulate"}),
        slow("refinement: {max_offset: 0.7}", {"count_refined", "view_statements"} | VIEWS | SWEEPS | KAPPAS | BLOBS | ACCEPTING),
        slow("refinement: {move: unit_step}", DETECTION - {"detect_grid", "evaluate_grid", "detect_variant"} - VARIANTS - BARS),
        slow("comparison: {match_sign: true}", MATCHING | {"view_statements"}),
        slow("comparison: {last_scale: 2.0}", ({"count_refined", "view_statements", "match_unbalanced"} | SAMPLINGS | VIEWS | SWEEPS | VARIANTS) - {"match_large_scales", "match_blur_zooms", "figS5"}),
        slow("comparison: {scale_ratio: 1.5}", MATCHING | EVALUATING | {"view_statements"}),
        slow("sets: {translations_wide: {n_views: 3}}", {"simulate", "detect_views", "match_translations"}),
        slow("stability: {seen_by: 0.6}", {"match_sweep", "match_large_scales", "fig11", "fig12"}),
        slow("floor: {limits: [0.3, 1.0]}", VARIANTS),
        slow("floor: {pictures: {lake: {step: 20}}}", VARIANTS | {"simulate", "detect_variant"}),
        slow("sets: {noise: {blur: 0.9}}", {"simulate", "detect_views", "match_sweep", "crop_views", "noise_theory", "fig12", "evaluate_views", "truth_cameras"}),
        slow("sets: {blur_errors: {blur: [0.7, 1.1]}}", {"simulate", "detect_views", "match_blurs", "figS2"}),
        slow("comparison: {stable_above: 0.9}", {"match_samplings"} | AFTER_MATCHING),
        ("predictors: {pictures: {stream: {step: 22}}}", {"simulate", "detect", "match_samplings", "find_true_extrema"} | PREDICTING),
        slow("cubes: {count: 3}", {"cut_cubes", "fig6"}),
        slow("optics: {defocus: 20.0}", {"camera_optics", "figS3"}),
        slow("blobs: {camera_blur: 0.7}", BLOBS | {"detect_blobs"}),
        slow("semigroup: {blob: 1.0}", {"semigroup", "sampling_theory", "fig1"}),
        slow("stability: {max_offsets: [0.6, 1.0]}", {"match_views", "fig7", "evaluate_refinement", "refinement"}),
        slow("shipped: {contrast: 0.02}", {"match_sift", "fig7"}),
        slow("kappas: {fractions: [2, 3, 10]}", {"detect_kappas", "evaluate_kappas", "truth"} | KAPPAS),
        slow("stated: {zooms: [1.6]}", {"view_statements"}),
        slow("sets: {tilts: {focal_length: 330}}", {"simulate", "detect_views", "match_views", "figS5"}),
        slow("sets: {zooms: {zoom: 1.4}}", {"simulate", "detect_views", "match_views", "match_translations", "fig8"}),
        slow("truth: {last_scale: 1.9}", EVALUATING | TRUTHS | VARIANTS),
        slow("truth: {most_iterations: 4}", {"evaluate_refinement", "refinement"}),
        slow("uncertainty: {n_pairs: 3}", BARS),
        ("draft: false", FIGURES),
        # 1.1 is also the blur and 0.0 also the shift: the set of values stays the same.
        ("sets: {still: {noise: 1.1, step: 20}}", STILL),
    ],
)  # fmt: skip
def test_changes_of_settings(touched, tmp_path, setting, expected):
    (tmp_path / "change.yaml").write_text(setting + "\n")
    project = Project(touched.folder, own_library=False)  # the same code: digested once for all
    assert reruns(project, str(tmp_path / "change.yaml")) - {"claims"} == expected
