"""Every target can be planned, and the rules keep the house's rules."""

from __future__ import annotations

import importlib
import re
import runpy

import pytest
import yaml
from project import QUICK, ROOT

from keystab.audit.conditions import CONDITIONS, PLAN
from keystab.audit.detectors import DETECTORS
from keystab.parameters import AuditPlan
from keystab.study.claims_report import FIELDS
from keystab.study.plan import FIGURES

TOOL = runpy.run_path(str(ROOT / "tools/reruns.py"))
PICTURES = sorted((ROOT / "config/pictures").glob("*.yaml"))
LEDGER = f"{','.join(FIELDS)}\none,,,,,,,,,reproduced,,,,,\n"


@pytest.fixture(scope="module")
def draft():
    """The plan of all figures in draft form: a plan for each costs as much as this one."""
    return TOOL["plan"](TOOL["settings"].read_yaml(ROOT / "config/quick.yaml"))


@pytest.fixture(scope="module")
def rules_of_draft(draft):
    return {job.rule for job in draft.values()}


def test_whole_study_at_the_papers_settings(planned, rules_of_draft):
    jobs = planned.would_run()
    assert jobs.keys() - {"all", "checksums"} == rules_of_draft
    assert {*FIGURES, "all"} <= jobs.keys()
    # Of the default scene and two further ones, of which no scale-space is kept.
    assert (jobs["detect"], jobs["scale_space"]) == (3 * 17, 3)
    assert sum(jobs.values()) <= 285  # fat jobs
    assert "claims" in jobs and "claims_pictures" not in jobs  # which needs several studies
    assert not any("audit" in name for name in jobs)  # which needs the detectors of others


@pytest.mark.parametrize(
    ("target", "rules"),
    [
        ("figures/quick/fig1.pdf", {"semigroup", "fig1"}),
        ("figures/quick/figS3.pdf", {"camera_optics", "figS3"}),
        ("figures/quick/figS4.png", {"detect_blobs", "match_blobs", "figS4"}),
        ("figures/quick/fig2.png", {"simulate", "describe_views", "fig2"}),
        ("figures/quick/fig12.pdf", {"simulate", "detect_views", "match_sweep", "crop_views", "noise_theory", "fig12"}),
        ("figures/quick/figS2.pdf", {"simulate", "detect_views", "match_blurs", "match_blur_zooms", "figS2"}),
        ("figures/quick/fig6.pdf", {"simulate", "scale_space", "detect", "match_samplings", "cut_cubes", "fig6"}),
        ("figures/quick/fig7.pdf", {"simulate", "detect_views", "match_views", "match_sift", "fig7"}),
        ("figures/quick/fig9.pdf", {"simulate", "detect_kappas", "match_kappas", "fig9"}),
        ("figures/quick/figS1.png", {"simulate", "detect_views", "match_views", "figS1"}),
        ("figures/quick/figS5.png", {"simulate", "detect_views", "match_views", "figS5"}),
        ("figures/quick/uncertainty.pdf", {"simulate", "calibrate_bars", "uncertainty"}),
        ("figures/quick/predictors.pdf", {"simulate", "scale_space", "detect", "match_samplings", "find_true_extrema", "score_predictors", "predictors"}),
    ],
)  # fmt: skip
def test_figures_need_only_what_they_show(draft, planned, target, rules):
    waiting, needed = {target.replace(".png", ".pdf")}, set()
    while waiting:
        needed |= waiting
        waiting = {name for output in waiting for name in draft[output].needs} - needed
    assert {draft[output].rule for output in needed} == rules
    # That this part of the whole plan is what Snakemake plans for the target is asked of two.
    if target in ("figures/quick/figS4.png", "figures/quick/predictors.pdf"):
        assert planned.would_run(*QUICK, "--", target).keys() == rules


def test_an_audit_is_one_job_for_each_detector_and_condition(planned):
    jobs = planned.would_run("--", "figures/audit.pdf", "figures/scenes/stream/audit.pdf")
    one = {"find_audit_truth": 1, "audit_detector": 8 * 12, "gather_audits": 1, "audit": 1}
    assert jobs == {rule: 2 * n for rule, n in one.items()}


def test_the_conditions_of_the_settings_are_those_of_the_command():
    config = yaml.safe_load((ROOT / "config/config.yaml").read_text())["audit"]
    assert tuple(config["conditions"]) == CONDITIONS
    assert {each.name for each in DETECTORS} == {*config["detectors"], "kornia"}
    assert AuditPlan(*(config[name] for name in ("width", "n_views", "blobs"))) == PLAN


@pytest.mark.parametrize(
    ("keep", "stored"),
    # That what is not kept is streamed is seen with some kept as well, of the scenes.
    [("true", 6), pytest.param("false", 0, marks=pytest.mark.slow)],
)
def test_any_sampling_can_be_stored_or_streamed(project, keep, stored):
    project.edit("config/quick.yaml", "keep_scale_spaces: [3]", f"keep_scale_spaces: {keep}")
    _, said = project.dry_run("--configfile", "config/quick.yaml", "--printshellcmds")
    commands = [line for line in said.splitlines() if "stages.detect " in line]
    own = [line for line in commands if "/scenes/" not in line and "--oversampling spline" in line]
    assert len(own) == 6 and sum("--store-digest" in line for line in own) == stored
    assert not any("--store" in line for line in set(commands) - set(own))


@pytest.mark.slow
@pytest.mark.parametrize(
    "overlay", sorted((ROOT / "config/what_if").glob("*.yaml")), ids=lambda path: path.stem
)
def test_what_ifs_can_be_planned(planned, overlay):
    jobs = planned.would_run("--configfile", f"config/what_if/{overlay.name}")
    assert jobs["fig6"] == 1


@pytest.mark.parametrize(
    "overlay",
    # The others differ from the first in the scene alone.
    [pytest.param(it, marks=[pytest.mark.slow] * (it is not PICTURES[0])) for it in PICTURES],
    ids=lambda path: path.stem,
)
def test_the_whole_study_fits_the_other_pictures(planned, overlay):
    jobs = planned.would_run("--configfile", f"config/pictures/{overlay.name}")
    assert {*FIGURES, "all", "claims"} <= jobs.keys()


def test_pictures_are_compared_when_their_studies_are_made(project):
    name = "results/claims_pictures.md"
    status, said = project.dry_run("--", name)
    assert status != 0
    lines = [
        f"results/{path.stem}/claims.csv is missing; make it first: "
        f"make results/{path.stem}/claims.md WITH=config/pictures/{path.name}"
        for path in PICTURES
    ]
    assert set(lines) < set(said.splitlines())
    for folder in ("results", *(f"results/{path.stem}" for path in PICTURES)):
        (project.folder / folder).mkdir(exist_ok=True)
        (project.folder / folder / "claims.csv").write_text(LEDGER)
    # In a run with results elsewhere, none of the three is made again.
    (project.folder / "config/else.yaml").write_text("{results: results/else, logs: logs/else}\n")
    target = "results/else/claims_pictures.md"
    run = project.snakemake("--configfile", "config/else.yaml", "--", target)
    assert run.returncode == 0, run.stdout
    assert "0 of 1 verdicts depend on the picture." in (project.folder / target).read_text()


def test_a_picture_that_is_the_reference_is_not_seen_twice(project):
    (project.folder / "own.yaml").write_text(
        "reference: config/images/stream.png\nreference_sha256: null\n"
    )
    target = ("--configfile", "config/quick.yaml", "own.yaml", "--", "figures/quick/predictors.pdf")
    code, said = project.dry_run(*target)
    assert code == 0 and "scene 'coldwarm'" in said and "scene 'stream'" not in said


@pytest.mark.parametrize("figure", FIGURES)
def test_rules_of_figures_take_the_tables_that_the_figures_read(figure):
    tables = importlib.import_module(f"keystab.figures.{figure.lower()}").TABLES
    assert FIGURES[figure].tables == tuple(tables)


# Further scenes


def test_a_further_scene_is_studied_by_the_same_rules(planned, draft, rules_of_draft):
    quick = (*QUICK, "--")
    jobs = planned.would_run(*quick, "results/quick/scenes/stream/final.sha256")
    own = rules_of_draft | {"checksums"}
    # All but what kept scale-spaces, several scenes and the figures of theory ask for.
    assert own - jobs.keys() == {"scale_space", "score_predictors", "predictors", "fig1", "figS3", "figS4"}  # fmt: skip
    assert jobs.keys() <= own and sum(jobs.values()) <= len(draft) + 1
    target = "figures/quick/scenes/stream/fig5.pdf"
    assert planned.would_run(*quick, target).keys() == {"simulate", "detect", "match_samplings", "score_features", "fig5"}  # fmt: skip


def test_a_scene_that_is_not_in_the_settings_is_refused(planned):
    status, said = planned.dry_run(
        "--configfile", "config/quick.yaml", "--", "results/quick/scenes/roof/claims.csv"
    )
    assert status != 0 and "/claims.csv: there is no scene 'roof'; there are " in said


def test_what_no_rule_makes_is_said_with_where_it_is_made(planned):
    status, said = planned.dry_run(*QUICK, "--", "figures/fig12.pdf")
    line = "error: figures/fig12.pdf: these settings draw into figures/quick: type figures/quick/fig12.pdf"
    assert status != 0 and any(each.startswith(line) for each in said.splitlines())


def test_a_change_of_the_view_of_the_default_scene_touches_no_other(finished):
    (finished.folder / "config/change.yaml").write_text("sets: {still: {noise: 0.01}}\n")
    _, said = finished.dry_run(*QUICK, "config/change.yaml")
    assert "Simulating the views 'still'" in said and "Scoring predictors" in said
    assert "scene 'stream'" not in said


# What every rule keeps


def test_every_job_says_what_it_does_and_depends_on_its_code_and_the_software(draft):
    assert len(draft) > 100
    for job in draft.values():
        assert job.message and job.template == "{params.command} >{log:q} 2>&1", job
        module = job.command.split()[2]
        names = {text.partition(" = ")[0] for text in job.params}
        assert {f"code of {module}", "environment.lock"} <= names, job


def test_parameters_are_compared_with_their_names(draft):
    # Plain values would be compared as a set, without names; see Named.
    for job in draft.values():
        assert all(re.match(r"(code of )?[\w.]+ = ", text) for text in job.params), job
