"""What docs/reproduce/reruns.md says of reruns is what the workflow gives, at the paper's settings."""

from __future__ import annotations

import re
import runpy

import pytest
from project import ROOT, Project

TOOL = runpy.run_path(str(ROOT / "tools/reruns.py"))
WHY = runpy.run_path(str(ROOT / "tools/why.py"))
Effect, Job = TOOL["Effect"], TOOL["Job"]
PLACES = dict(TOOL["leaves"](TOOL["SCHEMA"], TOOL["BASE"]))
TABLE = TOOL["PAGE"].read_text().split(TOOL["BEGIN"])[1].split(TOOL["END"])[0]
ROWS = {
    label: Effect(*row)
    for labels, *row in (line[2:-2].split(" | ") for line in TABLE.splitlines() if "`" in line)
    for label in re.findall("`([^`]+)`", labels)
}


def row_of(place: str, separator: str = ".") -> object:
    return ROWS[place] if place in ROWS else ROWS[f"{place.rpartition(separator)[0]}{separator}*"]


@pytest.fixture(scope="module")
def before():
    return TOOL["plan"]()


@pytest.fixture(scope="module")
def clock():
    return TOOL["Clock"]([], TOOL["read_durations"]())


def test_every_setting_and_module_has_a_row_and_no_other():
    modules = [
        path.relative_to(TOOL["PACKAGE_FOLDER"]).as_posix()
        for path in TOOL["PACKAGE_FOLDER"].rglob("*.py")
        if path.name not in ("palette.py", "parameters.py")  # count entry by entry
    ]
    for names, separator in ((PLACES, "."), (modules, "/")):
        for name in names:
            assert row_of(name, separator)
    blocks = {f"{place.rpartition('.')[0]}.*" for place in PLACES}
    blocks |= {f"{module.rpartition('/')[0]}/*" for module in modules}
    assert set(ROWS) <= {*PLACES, *modules, *blocks}
    assert TABLE.count("`") == 2 * len(ROWS)  # none twice


def test_rows_of_modules_are_what_the_workflow_gives(before, clock):
    effects = TOOL["effects_of_code"](before, clock)
    assert {module: row_of(module, "/") for module in effects} == effects


def test_no_search_knows_how_its_results_are_evaluated(before):
    searching = {"simulate", "scale_space", "scale_spaces", "describe_views", "crop_views"}
    rules = {job.rule for job in before.values()}
    searching |= {name for name in rules if name.startswith(("detect", "find"))}
    rooms = ("evaluation", "matching", "prediction", "experiments", "study", "provenance")
    modules = [
        f"keystab.{path.parent.name}.{path.stem}".removesuffix(".__init__")
        for room in rooms
        for path in (TOOL["PACKAGE_FOLDER"] / room).glob("*.py")
    ]
    assert len(modules) > 40
    for module in modules:
        again = {job.rule for job in TOOL["reruns_of_code"](before, module).values()}
        allowed = {"detect_blobs"} if "experiments" in module else set()  # makes its own pictures
        assert again & searching <= allowed, module


# One of every block; `python tools/reruns.py --check` tries all.
SOME = [
    *("views_dtype", "sets.still.blur", "sets.translations.n_spo", "sets.noise.sweep"),
    *("detector.epsilon", "refinement.max_offset", "comparison.match_sign", "stability.seen_by"),
    *("shipped.contrast", "kappas.fractions", "floor.variants.closer.epsilon", "truth.beyond"),
    *("semigroup.blob", "grid.delta_min", "samplings.n_spo", "cubes.count", "blobs.n_spo", "logs"),
]


# What a change of these reruns is also asserted, of the draft, in test_reruns.
ALSO_THERE = {
    *("refinement.max_offset", "comparison.match_sign", "stability.seen_by", "semigroup.blob"),
    *("shipped.contrast", "kappas.fractions", "cubes.count"),
}
# Of what is left, a sweep's, the detector's and one block's: a plan takes a second.
LIKE_THESE = {
    *("sets.still.blur", "floor.variants.closer.epsilon", "grid.delta_min", "samplings.n_spo"),
    *("blobs.n_spo", "logs", "views_dtype", "sets.translations.n_spo"),
}
assert set(SOME) > ALSO_THERE | LIKE_THESE


@pytest.mark.parametrize(
    "place",
    [pytest.param(it, marks=[pytest.mark.slow] * (it in ALSO_THERE | LIKE_THESE)) for it in SOME],
)
def test_rows_of_settings_are_what_the_workflow_gives(place, before, clock):
    after = TOOL["plan"](TOOL["change"](place, PLACES[place]))
    assert TOOL["effect"](TOOL["reruns"](before, after), before, clock) == row_of(place)


@pytest.mark.parametrize(
    ("changed", "again"),
    [
        ({}, set()),
        ({"params": frozenset({"a = 2"})}, {"one", "two"}),
        ({"inputs": ("b",)}, {"one", "two"}),
        ({"template": "other"}, {"one", "two"}),
        ({"message": "other"}, set()),
    ],
)
def test_what_runs_again_runs_all_after_it(changed, again):
    first = Job("r", "m", "c", "t", frozenset({"a = 1"}), ("a",), frozenset())
    second = first._replace(needs=frozenset({"one"}))
    other = first._replace(rule="other")
    plan = {"one": first, "two": second, "three": other}
    after = {**plan, "one": first._replace(**changed)}
    assert TOOL["reruns"](plan, after).keys() == again


def test_a_change_that_snakemake_does_not_see_is_an_error():
    job = Job("r", "m", "stage --x a b", "t", frozenset(), ("a", "b"), frozenset())
    with pytest.raises(RuntimeError, match="would not run"):
        TOOL["reruns"]({"one": job}, {"one": job._replace(command="stage --x b a")})


@pytest.mark.parametrize(
    "overlay",
    [
        "refinement: {max_offset: 0.7}",
        pytest.param("floor: {variants: {closer_1e6: {set: still}}}", marks=pytest.mark.slow),
    ],
)
def test_plans_are_compared_as_snakemake_compares_them(finished, overlay):
    (finished.folder / "config/change.yaml").write_text(overlay + "\n")
    jobs = finished.would_run("--configfile", "config/quick.yaml", "config/change.yaml")
    files = [finished.folder / "config" / name for name in ("quick.yaml", "change.yaml")]
    quick, changed = (TOOL["plan"](TOOL["settings"].read_yaml(*files[:n])) for n in (1, 2))
    again = [job.rule for job in TOOL["reruns"](quick, changed).values()]
    assert {rule: again.count(rule) for rule in again} == {
        k: v for k, v in jobs.items() if k not in ("all", "checksums")
    }


def why(project: Project, monkeypatch, *arguments: str, durations: dict | None = None) -> list[str]:
    """What `make why` says in a copy of the project, run with the library there."""
    status, said = project.dry_run("--printshellcmds", *arguments)
    assert status == 0
    monkeypatch.chdir(project.folder)
    clock = TOOL["Clock"]([], durations or {})
    return WHY["answer"](said, list(arguments), clock, project.library / "keystab")


def test_why_says_what_changed_what_follows_and_what_is_overwritten(finished, monkeypatch):
    (finished.folder / "config/change.yaml").write_text(
        "refinement: {max_offset: 0.7}\nsets: {aliasing: {n_views: 3}}\n"
    )
    overlays = ("--configfile", "config/quick.yaml", "config/change.yaml")
    durations = {
        "Drawing figures/quick/fig7.pdf": 7.0,
        "Matching the keypoints of SIFT as shipped": 2,
    }
    figures = ("--", "figures/quick/fig7.pdf", "figures/quick/fig10.pdf")
    lines = why(finished, monkeypatch, *overlays, *figures, durations=durations)
    offset = lines.index("Because refinement.max_offset was 0.6 and is 0.7:")
    assert "  Matching the keypoints of SIFT as shipped (2 s)" in lines[offset + 1 : offset + 3]
    after = lines.index("After these:")
    assert "  Drawing figures/quick/fig7.pdf, and 1 like it (14 s)" in lines[after:]
    # Both sets of the sweep, all that is different between their views, once.
    assert [line for line in lines if "aliasing." in line or "shift" in line] == [
        "Because sets.aliasing.n_views was 4 and is 3:"
    ]
    assert re.fullmatch("In results/quick and figures/quick are .*: [0-9]+ files would be overwritten.", lines[-2])  # fmt: skip
    assert "into config/change.yaml: results, figures and logs" in lines[-1]


def test_why_names_the_file_that_was_edited_and_another_picture(finished, monkeypatch):
    finished.edit(
        "src/keystab/evaluation/roc.py", "import annotations", "import annotations\nMORE = 1"
    )
    quick = ("--configfile", "config/quick.yaml")
    edited = Project(finished.folder)
    lines = why(edited, monkeypatch, *quick, "--", "figures/quick/fig5.pdf")
    assert lines[1] == "Because src/keystab/evaluation/roc.py was edited:"
    assert not any("overwritten" in line for line in lines)
    (finished.folder / "my.yaml").write_text(
        "reference: config/images/lake.png\nreference_sha256: null\n"
    )
    lines = why(finished, monkeypatch, *quick, "my.yaml", "--", "results/quick/views/still")
    assert lines[1] == (
        "Because another picture, config/images/lake.png in place of config/images/coldwarm.png:"
    )
    assert lines[3].startswith("In results/quick and figures/quick are results of config/images/c")


def test_why_stays_short():
    jobs = [(f"{word} 1", "a is missing") for word in "abcdefghijklmnop"]
    jobs += [(f"Detecting {n}", "the rule has another command") for n in range(90)]
    lines = list(WHY["in_lines"](jobs, TOOL["Clock"]([], {})))
    assert lines[-2:] == [
        "Because the rule has another command:",
        "  Detecting 0, and 89 like it (4 min 30 s)",
    ]
    assert "  and 8 other jobs (24 s)" in lines
    assert len(lines) == 13
