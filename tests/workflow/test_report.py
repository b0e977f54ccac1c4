"""The report of a run: one file with everything in it."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys

import pytest
from project import QUICK, ROOT, Project

FIGURES = sorted((ROOT / "workflow/report").glob("*.rst"))

CLAIM = {
    "id": "a-claim",
    "where": "section 1",
    "statement": "Ratios are < 1 & more.",
    "figure": "fig4",
    "criterion": "ratio < 1",
    "value": {"ratio": 0.5},
    "interval": {"ratio": [0.25, 0.75]},
    "paper": "small",
    "verdict": "reproduced",
    "note": "",
    "uncertainty": "interval",
    "by_numbers": "reproduced",
    "p": 0.01,
    "p_holm": 0.01,
}


def report(project: Project) -> tuple[subprocess.CompletedProcess[str], str]:
    shutil.copytree(ROOT / "tools", project.folder / "tools")
    run = subprocess.run(
        [sys.executable, "tools/report.py", *QUICK],
        cwd=project.folder,
        env=project.environment,
        capture_output=True,
        text=True,
    )
    page = project.folder / "results/quick/report.html"
    return run, page.read_text() if page.exists() else ""


# The page itself is tested in tests/unit/test_report_page.py, without a run.
@pytest.mark.slow
def test_all_of_a_run_in_one_file(finished):
    (finished.folder / "results/quick/claims.json").write_text(json.dumps([CLAIM]))
    assert finished.snakemake(*QUICK, "--touch", "--forcerun", "checksums").returncode == 0
    run, page = report(finished)
    assert run.returncode == 0, run.stderr
    loaded = re.findall(r'src="([^"]*)"', page)
    assert len(loaded) == 1 + len(FIGURES)  # the picture and the figures
    assert all(source.startswith("data:image/png") for source in loaded)
    anchors = set(re.findall(r'id="([^"]+)"', page))
    links = re.findall(r'href="#([^"]+)"', page)
    assert {"figure-fig4", "figure-truth_cameras", "claim-a-claim"} <= set(links) <= anchors
    assert "Ratios are &lt; 1 &amp; more." in page and "0.5 (0.25 to 0.75)" in page
    assert "Keypoints of 4 views that differ by random translations" in page  # quick.yaml's 4
    assert "{{" not in page and "{%" not in page
    drawn = set(re.findall(r"<text [^>]*>(\w+)</text>", page))
    assert finished.would_run(*QUICK, "--forceall").keys() - {"all"} <= drawn


@pytest.mark.slow
def test_an_unfinished_run_has_no_report(finished):
    (finished.folder / "figures/quick/fig4.png").unlink()
    run, page = report(finished)
    assert run.returncode != 0 and not page
    assert run.stderr.splitlines() == [
        "error: the study is not finished with these settings; run make study first"
    ]
