"""Every target can be planned, and the rules keep the house's rules."""

from __future__ import annotations

import importlib
import re
from pathlib import Path

import pytest
from project import ROOT

from keystab.study.claims_report import FIELDS

PICTURES = sorted((ROOT / "config/pictures").glob("*.yaml"))
LEDGER = f"{','.join(FIELDS)}\none,,,,,,,,,reproduced,\n"
RULES = sorted((ROOT / "workflow/rules").glob("*.smk"))
FIGURES = [f"fig{n}" for n in (*range(1, 13), "S1", "S2", "S3", "S4")] + ["floor", "predictors"]


def test_whole_study_at_the_papers_settings(project):
    jobs = project.would_run()
    assert {*FIGURES, "all"} <= jobs.keys()
    assert (jobs["detect"], jobs["detect_stored"], jobs["scale_space"]) == (14, 3, 3)
    assert sum(jobs.values()) <= 200  # fat jobs
    assert "claims" in jobs and "claims_pictures" not in jobs  # which needs several studies


@pytest.mark.parametrize(
    ("target", "rules"),
    [
        ("figures/quick/fig1.pdf", {"semigroup", "fig1"}),
        ("figures/quick/figS3.pdf", {"camera_optics", "figS3"}),
        ("figures/quick/figS4.png", {"detect_blobs", "match_blobs", "figS4"}),
        ("figures/quick/fig2.png", {"simulate", "describe_views", "fig2"}),
        ("figures/quick/fig12.pdf", {"simulate", "detect_views", "match_sweep", "crop_views", "noise_theory", "fig12"}),
        ("figures/quick/figS2.pdf", {"simulate", "detect_views", "match_blurs", "figS2"}),
        ("figures/quick/fig6.pdf", {"simulate", "scale_space", "detect_stored", "detect", "match_samplings", "cut_cubes", "fig6"}),
        ("figures/quick/fig7.pdf", {"simulate", "detect_views", "match_views", "match_shipped", "fig7"}),
        ("figures/quick/fig9.pdf", {"simulate", "detect_kappas", "match_kappas", "fig9"}),
        ("figures/quick/figS1.png", {"simulate", "detect_views", "match_views", "figS1"}),
        ("figures/quick/predictors.pdf", {"simulate", "scale_space", "detect_stored", "detect", "match_samplings", "find_truth", "simulate_picture", "detect_picture", "match_picture", "find_truth_of_picture", "score_predictors", "predictors"}),
    ],
)  # fmt: skip
def test_figures_need_only_what_they_show(project, target, rules):
    assert project.would_run("--configfile", "config/quick.yaml", "--", target).keys() == rules


@pytest.mark.parametrize(("keep", "stored"), [("true", 6), ("false", 0)])
def test_any_sampling_can_be_stored_or_streamed(project, keep, stored):
    project.edit("config/quick.yaml", "keep_scale_spaces: [3]", f"keep_scale_spaces: {keep}")
    jobs = project.would_run("--configfile", "config/quick.yaml")
    assert (jobs.get("detect_stored", 0), jobs.get("detect", 0)) == (stored, 6 - stored)


@pytest.mark.parametrize("overlay", sorted((ROOT / "config/what_if").glob("*.yaml")), ids=str)
def test_what_ifs_can_be_planned(project, overlay):
    jobs = project.would_run("--configfile", f"config/what_if/{overlay.name}")
    assert jobs["fig6"] == 1


@pytest.mark.parametrize("overlay", PICTURES, ids=lambda path: path.stem)
def test_the_whole_study_fits_the_other_pictures(project, overlay):
    jobs = project.would_run("--configfile", f"config/pictures/{overlay.name}")
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
    assert code == 0 and "picture 'coldwarm'" in said and "picture 'stream'" not in said


@pytest.mark.parametrize("figure", FIGURES)
def test_rules_of_figures_take_the_tables_that_the_figures_read(figure):
    tables = importlib.import_module(f"keystab.figures.{figure.lower()}").TABLES
    text = (ROOT / "workflow/rules/figures.smk").read_text()
    block = re.search(rf"^(?:use )?rule (?:fig1 as )?{figure}\b.*?output:", text, re.M | re.S)
    assert block
    assert re.findall(r'f"{RESULTS}/tables/(.*)",', block[0]) == list(tables)


@pytest.mark.parametrize("path", RULES, ids=lambda path: path.name)
def test_rules_keep_the_rules(path: Path):
    text = path.read_text()
    assert text.startswith('"""'), "says what comes in, what goes out, and which steps"
    assert not re.search(r"^ +(run|script|notebook|group|cache):", text, re.M)
    assert "lambda" not in text
    for rule in re.split(r"^(?=rule \w+:)", text, flags=re.M)[1:]:
        for directive in ("log", "benchmark", "message", "shell"):
            assert re.search(rf"^    {directive}:", rule, re.M), (rule.split(":")[0], directive)
        assert "code=fingerprint(" in rule and "software=SOFTWARE" in rule


@pytest.mark.parametrize("path", RULES, ids=lambda path: path.name)
def test_settings_reach_rules_with_their_names(path: Path):
    # Plain values would be compared as a set, without names; see Named in common.smk.
    for block in re.findall(r"^    params:\n((?:        .*\n)+)", path.read_text(), re.M):
        assert "config[" not in block and "lookup(" not in block
        assert "Named(" not in block  # a constant loses its name: fixed(...)
