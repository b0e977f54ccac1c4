"""What the public host and the workflow catalogue read of the project."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest
import yaml

ROOT = Path(__file__).parents[2]
HOST = ROOT / ".github"

if not HOST.is_dir():
    pytest.skip("an archive of the study, which has no public host", allow_module_level=True)


def read(name: str) -> Any:
    # BaseLoader: `on` is a name, not true.
    return yaml.load((ROOT / name).read_text(), yaml.BaseLoader)


def steps() -> list[dict[str, Any]]:
    return [step for job in read(".github/workflows/tests.yml")["jobs"].values() for step in job["steps"]]  # fmt: skip


def test_the_host_runs_tests_and_checks_and_may_do_nothing_else():
    flow = read(".github/workflows/tests.yml")
    assert flow["permissions"] == {"contents": "read"}
    assert not any("permissions" in job for job in flow["jobs"].values())
    targets = {each["target"] for each in flow["jobs"]["make"]["strategy"]["matrix"]["include"]}
    assert targets == {"test", "check"}
    makefile = (ROOT / "Makefile").read_text()
    called = {name for step in steps() for name in re.findall(r"make ([a-z-]+)", step.get("run", ""))}  # fmt: skip
    assert all(f"\n{name}: " in makefile for name in targets | called)


def test_what_others_run_for_the_project_is_of_a_known_version():
    used = [step["uses"] for step in steps() if "uses" in step]
    assert used and all(re.fullmatch(r"actions/[a-z-]+@v\d+\.\d+\.\d+", name) for name in used)
    assert all(
        step["with"]["persist-credentials"] == "false"
        for step in steps()
        if step.get("uses", "").startswith("actions/checkout@")
    )


def test_packages_are_cached_by_what_names_their_versions():
    for step in steps():
        if "setup-python" in step.get("uses", ""):
            assert (ROOT / step["with"]["cache-dependency-path"]).is_file()


def test_reports_of_errors_ask_for_the_environment():
    forms = {path.stem: read(f".github/ISSUE_TEMPLATE/{path.name}") for path in HOST.glob("ISSUE_TEMPLATE/*.yml")}  # fmt: skip
    del forms["config"]
    for form in forms.values():
        assert form["name"] and form["description"] and form["body"]
        names = [part["id"] for part in form["body"]]
        assert len(set(names)) == len(names)
        assert all(part["attributes"]["label"] for part in form["body"])
    asked = next(part for part in forms["error"]["body"] if part["id"] == "environment")
    assert "`keystab inspect --environment`" in asked["attributes"]["description"]
    assert asked["validations"]["required"] == "true"


def test_changes_are_asked_for_tests_and_checks():
    text = (HOST / "pull_request_template.md").read_text()
    assert "`make test`" in text and "`make check`" in text


def test_the_catalogue_finds_what_it_asks_for():
    usage = read(".snakemake-workflow-catalog.yml")["usage"]
    assert set(usage) == {"mandatory-flags", "software-stack-deployment", "report"}
    for name in ("workflow/Snakefile", "config/README.md", "workflow/schemas/config.schema.yaml"):
        assert (ROOT / name).is_file()
    words = (ROOT / "README.md").read_text().lower()
    assert "snakemake" in words and "workflow" in words
