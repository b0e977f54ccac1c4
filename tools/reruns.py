"""Write what a change reruns in docs/reproduce/reruns.md, from the workflow itself.

python tools/reruns.py           write it, in some minutes
python tools/reruns.py --check   say whether it is up to date

Every setting is changed in turn, Snakemake plans the study, and the plan is compared with that of
the settings as they are, by what Snakemake itself compares: parameters, inputs, commands. Code is
followed through the modules that a job imports. Nothing is run, and no results are needed.
"""

from __future__ import annotations

import contextlib
import copy
import functools
import io
import multiprocessing
import os
import re
import sys
import tempfile
import unittest.mock
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import yaml

from keystab.errors import InputError
from keystab.provenance.code_digest import CATALOGUES, PACKAGE_FOLDER, imported_modules
from keystab.study import feasibility, settings
from keystab.study.plan import FIGURES

sys.path.insert(0, str(Path(__file__).parent))
from study import Clock, read_durations  # noqa: E402

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs/reproduce/reruns.md"
BEGIN, END = "<!-- reruns: begin -->\n", "<!-- reruns: end -->\n"
SCHEMA = yaml.safe_load((ROOT / "workflow/schemas/config.schema.yaml").read_text())
BASE = settings.checked(settings.read_yaml(ROOT / "config/config.yaml"), SCHEMA)


class Job(NamedTuple):
    """A job of the plan, and all by which Snakemake decides whether it must run again."""

    rule: str
    message: str
    command: str
    template: str
    params: frozenset[str]
    inputs: tuple[str, ...]
    needs: frozenset[str]
    """First outputs of the jobs that make its inputs."""
    place: int = 0
    """Of its rule among all, in the order in which the workflow defines them."""


Plan = dict[str, Job]
"""Jobs by their first output, each after those that it needs."""


# ---------------------------------------------------------------------------------------------
# Plans


def plan(overlay: Mapping[str, Any] | None = None) -> Plan:
    """Return the jobs of the whole study with other settings, as Snakemake plans them."""
    from snakemake.api import SnakemakeApi
    from snakemake.settings.types import (
        ConfigSettings,
        DAGSettings,
        OutputSettings,
        Quietness,
        ResourceSettings,
    )

    here = Path.cwd()
    try:
        with (
            tempfile.TemporaryDirectory() as empty,  # no results of the project take part
            SnakemakeApi(OutputSettings(quiet={Quietness.ALL})) as api,
            contextlib.redirect_stdout(io.StringIO()),
            unittest.mock.patch.object(feasibility, "require"),  # done, see change
            unittest.mock.patch.dict(os.environ),  # the Snakefile sets variables for jobs
        ):
            (Path(empty) / "config").symlink_to(ROOT / "config")
            planned = api.workflow(
                ResourceSettings(cores=1),
                config_settings=ConfigSettings(config=copy.deepcopy(dict(overlay or {}))),
                snakefile=ROOT / "Snakefile",
                workdir=Path(empty),
            )
            planned.dag(DAGSettings(forceall=True)).summary()
            # The plan itself, and what Snakemake compares of a job, have no public names: its own
            # functions are asked, here and in _jobs, so that the table says what Snakemake does.
            workflow = planned._workflow
            jobs = _jobs(workflow.dag, workflow.persistence, [rule.name for rule in workflow.rules])
            os.chdir(here)
            return jobs
    finally:
        os.chdir(here)


def _jobs(dag: Any, persistence: Any, rules: list[str]) -> Plan:
    jobs: Plan = {}
    for level in dag.toposorted():
        for job in sorted(level, key=lambda job: job.output[0] if job.output else ""):
            # All but the rule that names the targets and the one that lists their digests, which
            # runs after any other.
            if job.output and job.rule.name != "checksums":
                jobs[str(job.output[0])] = Job(
                    job.rule.name,
                    str(job.message),
                    " ".join(job.shellcmd.partition(" >")[0].split()),  # but for the log
                    persistence._code(job.rule),
                    frozenset(persistence._params(job)),
                    tuple(map(str, persistence._input(job))),
                    frozenset(str(needed.output[0]) for needed in dag.dependencies[job]),
                    rules.index(job.rule.name),
                )
    return jobs


def reruns(before: Plan, after: Plan) -> Plan:
    """Return the jobs of a plan that run again where another plan has been finished.

    Raises
    ------
    RuntimeError
        If a job would not run though its command is another one: Snakemake compares neither the
        order of inputs nor the names of parameters.
    """
    again: Plan = {}
    for output, job in after.items():
        old = before.get(output)
        if (
            old is None
            or (old.template, old.params, old.inputs) != (job.template, job.params, job.inputs)
            or job.needs & again.keys()
        ):
            again[output] = job
        elif old.command != job.command:
            raise RuntimeError(f"{job.rule} has another command and would not run: {job.command}")
    return again


def reruns_of_code(before: Plan, module: str) -> Plan:
    """Return the jobs that run again after an edit of a module's code."""
    again: Plan = {}
    for output, job in before.items():
        if module in _modules_of(job) or job.needs & again.keys():
            again[output] = job
    return again


def _modules_of(job: Job) -> list[str]:
    stage = re.search(r"python -m (\S+)", job.command)
    assert stage, job.command
    return _closure(stage[1])


@functools.cache
def _closure(module: str) -> list[str]:
    return imported_modules(module)


# ---------------------------------------------------------------------------------------------
# Changes


def leaves(schema: Mapping[str, Any], given: Any, place: str = "") -> Iterator[tuple[str, Any]]:
    """Every setting of the study with what the schema says of it."""
    for key, value in given.items():
        known = schema.get("properties", {})
        part = known[key] if key in known else schema["additionalProperties"]
        name = f"{place}.{key}" if place else key
        if part.get("type") == "object":
            yield from leaves(part, value, name)
        elif key != "sweep" or value is not None:  # a set that figures need cannot become a sweep
            yield name, part


def overlay(place: str, value: Any) -> dict[str, Any]:
    """Settings with a single one.

    Examples
    --------
    >>> overlay("detector.kappa", 1.5)
    {'detector': {'kappa': 1.5}}
    """
    *above, last = place.split(".")
    block = {last: value}
    for key in reversed(above):
        block = {key: block}
    return block


def change(place: str, schema: Mapping[str, Any]) -> dict[str, Any]:
    """Settings in which one has another value, with which the study can run."""
    value = functools.reduce(lambda block, key: block[key], place.split("."), BASE)
    allowed = []
    if place in TOGETHER:
        return overlay(place.rpartition(".")[0], TOGETHER[place])
    for other in [*SPECIAL.get(re.sub(NAMES, r"\1.*", place), []), *others(value, schema)]:
        if other == value:
            continue
        with contextlib.suppress(InputError):
            complete = settings.checked(_laid_over(overlay(place, other)), SCHEMA)
            allowed.append(overlay(place, other))
            feasibility.require(complete, ROOT)
            return allowed[-1]
    # Nothing goes without a change of another setting; the plan is the same for all values.
    return allowed[0]


def _laid_over(above: Mapping[str, Any]) -> dict[str, Any]:
    merged = copy.deepcopy(BASE)
    settings.merge(merged, above)
    return merged


NAMES = r"^(sets|floor\.variants|floor\.pictures|predictors\.pictures)\.\w+"
"""Beginning of the places of settings that belong to something with a name of its own."""

SPECIAL: dict[str, list[Any]] = {
    "reference_sha256": [None],
    "keep_scale_spaces": [False],
    "sets.*.dtype": ["float64", "float32"],
    "sets.*.assumed_blur": [0.65, 1.0],
    "floor.variants.*.set": ["still", "exact"],
    "floor.pictures.*.sha256": [None],
    "predictors.pictures.*.sha256": [None],
}
"""Values for settings whose others are not found by trying."""

TOGETHER: dict[str, dict[str, Any]] = {
    "sets.examples.n_views": {"n_views": 2, "blur": [0.5, 1.0], "step": [20, 14]},
    "sets.blur_errors.n_views": {"n_views": 2, "blur": [0.7, 0.3]},
    "sets.shots.n_views": {"n_views": 2, "blur": [0.8, 0.5]},
    "sets.tilts.n_views": {"n_views": 2, "tilt": [0, 5], "azimuth": [0, 10]},
    "sets.blur_zooms.n_views": {"n_views": 2, "step": [5, 6.25]},
}
"""Settings that others of their block must follow."""


def others(value: Any, schema: Mapping[str, Any]) -> Iterator[Any]:
    """Other values, those first that change little."""
    if isinstance(value, bool):
        yield not value
    elif isinstance(value, dict):
        for key, values in value.items():
            yield from ({key: other} for other in others(values, {"items": {}}))
    elif value == []:
        yield [3]
    elif isinstance(value, list):
        yield [*value[:-1], *[new for new in others(value[-1], schema["items"])][:1]]
        yield value[:-1]
        yield [*value[1:-1], value[-1]]
        for new in others(value[0], schema["items"]):
            yield [new, *value[1:]]
    elif isinstance(value, int):
        yield from (value + 1, value - 1, value * 0.99)
    elif isinstance(value, float):
        yield from (value * 1.01, value * 0.99, value + 0.01, 0.01, 10.0)
    elif "enum" in schema:
        yield from schema["enum"]
    elif isinstance(value, str):
        yield re.sub(r"^(\w+)/", r"\1/../\1/", value)  # the same file by another path
        yield f"{value}_2"
    elif value is None:
        yield from (0.5, 1, 1.2, 2, 200, "a")


# ---------------------------------------------------------------------------------------------
# The table


class Effect(NamedTuple):
    """What runs again, in words."""

    rules: str
    figures: str
    minutes: str


NOTHING = Effect("nothing", "", "0")


def effect(again: Plan, before: Plan, clock: Clock) -> Effect:
    """Return what runs again in words: rules, figures, and minutes one job at a time."""
    if not again:
        return NOTHING
    figures = [name for name in _rules(before) if name in FIGURES]
    drawn = [name for name in _rules(again) if name in FIGURES]
    rules = [name for name in _rules(again) if name not in drawn]
    others = [name for name in _rules(before) if name not in figures and name not in rules]
    if len(others) < len(rules):
        text = f"all but {', '.join(others)}" if others else "all"
    else:
        text = ", ".join(rules)
    minutes = sum(clock.weight(job.message) for job in again.values()) / 60
    return Effect(
        text,
        "all" if drawn == figures else ", ".join(name.removeprefix("fig") for name in drawn),
        "< 0.1" if minutes < 0.05 else f"{minutes:.1f}" if minutes < 10 else f"{minutes:.0f}",
    )


def _rules(jobs: Plan) -> list[str]:
    """Names of the rules of some jobs in the order in which the workflow defines them."""
    places = {job.rule: job.place for job in jobs.values()}
    return sorted(places, key=lambda name: places[name])


def effects_of_settings(before: Plan, clock: Clock) -> dict[str, Effect]:
    """Return what a change of each setting runs again, by its place."""
    places = dict(leaves(SCHEMA, BASE))
    with multiprocessing.get_context("fork").Pool() as workers:
        plans = workers.imap(_plan_of_change, places.items(), chunksize=4)
        found = {
            place: effect(reruns(before, after), before, clock)
            for place, after in zip(places, plans, strict=True)
        }
    return found


def _plan_of_change(place_and_schema: tuple[str, Mapping[str, Any]]) -> Plan:
    return plan(change(*place_and_schema))


def effects_of_code(before: Plan, clock: Clock) -> dict[str, Effect]:
    """Return what an edit of each module's code runs again, by its path in the package."""
    modules = {
        path.relative_to(PACKAGE_FOLDER).as_posix(): ".".join(
            ("keystab", *path.relative_to(PACKAGE_FOLDER).with_suffix("").parts)
        ).removesuffix(".__init__")
        for path in sorted(PACKAGE_FOLDER.rglob("*.py"))
    }
    return {
        path: effect(reruns_of_code(before, module), before, clock)
        for path, module in modules.items()
        if not any(module.endswith(name) for name in CATALOGUES)
    }


def rows(effects: Mapping[str, Effect], separator: str) -> Iterator[tuple[str, Effect]]:
    """Rows of the table: changes of the same effect together.

    Of the members of a block that have the same effect, the most stand as ``block.*``.
    """
    blocks: dict[str, list[str]] = {}
    for place in effects:
        blocks.setdefault(place.rpartition(separator)[0], []).append(place)
    labels: dict[Effect, list[str]] = {}
    for block, places in blocks.items():
        together: dict[Effect, list[str]] = {}
        for place in places:
            together.setdefault(effects[place], []).append(place)
        most = max(together.values(), key=len)
        for same, members in together.items():
            whole = block and members is most and len(members) > 2
            names = [f"{block}{separator}*"] if whole else members
            labels.setdefault(same, []).extend(names)
    for same, names in labels.items():
        yield ", ".join(f"`{name}`" for name in names), same


def table(settings_effects: Mapping[str, Effect], code_effects: Mapping[str, Effect]) -> str:
    """Return the whole table, in two parts."""
    parts = []
    for head, effects, separator in (
        ("a setting", settings_effects, "."),
        ("code in src/keystab", code_effects, "/"),
    ):
        lines = [f"| {head} | rules | figures | minutes |", "|---|---|---|---:|"]
        lines += [f"| {label} | {' | '.join(row)} |" for label, row in rows(effects, separator)]
        parts.append("\n".join(lines) + "\n")
    return "\n".join(parts)


def main() -> int:
    """Write or check the table."""
    if sys.argv[1:] not in ([], ["--check"]):
        print(__doc__, file=sys.stderr)
        return 2
    before, clock = plan(), Clock([], read_durations())
    written = table(effects_of_settings(before, clock), effects_of_code(before, clock))
    text = PAGE.read_text()
    head, rest = text.split(BEGIN)
    new = head + BEGIN + written + END + rest.split(END)[1]
    if "--check" not in sys.argv:
        PAGE.write_text(new)
    elif new != text:
        print(f"{PAGE} is out of date: python tools/reruns.py", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
