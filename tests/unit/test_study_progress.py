"""How far the study is: weights of jobs, and what is printed."""

from __future__ import annotations

import importlib
import json
import runpy
from pathlib import Path

import pytest

TOOLS = Path(__file__).parents[2] / "tools"
TOOL = runpy.run_path(str(TOOLS / "study.py"))
Clock, jobs_of, in_words = (TOOL[name] for name in ("Clock", "jobs_of", "in_words"))

DETECT = "Detecting extrema in the views '{}' at n_spo = {}"
PLAN = f"""Building DAG of jobs...
[Wed Nov 25 06:04:54 2026]
Job 3: {DETECT.format("zooms", 3)}
Reason: Missing output files: results/a.parquet
Job 4: {DETECT.format("zooms", 15)}
Job 5: Drawing figures/fig8.pdf
"""


def test_plan_lists_every_job():
    assert jobs_of(PLAN) == [
        DETECT.format("zooms", 3),
        DETECT.format("zooms", 15),
        "Drawing figures/fig8.pdf",
    ]


def test_jobs_weigh_what_they_took_before():
    known = {
        DETECT.format("zooms", 3): 10.0,
        DETECT.format("zooms", 15): 80.0,
        "Drawing figures/fig1.pdf": 10.0,
    }
    clock = Clock(jobs_of(PLAN), known)
    assert clock.total == 100.0  # a figure that was never timed counts like another
    clock.finish(DETECT.format("zooms", 15))
    assert (
        clock.line(40.0) == "progress: 1 of 3 jobs, 80 % of the work; 40 s so far, about 10 s to go"
    )
    clock.finish(DETECT.format("zooms", 3))
    clock.finish("Drawing figures/fig8.pdf")
    assert clock.line(50.0) == "progress: 3 of 3 jobs, 100 % of the work; 50 s so far"


def test_nothing_known_and_nothing_to_do():
    clock = Clock(jobs_of(PLAN), {})
    clock.finish(jobs_of(PLAN)[0])
    assert (
        clock.line(600.0)
        == "progress: 1 of 3 jobs, 33 % of the work; 10 min so far, about 20 min to go"
    )
    assert Clock([], {}).line(1.0) == "progress: 0 of 0 jobs, 100 % of the work; 1 s so far"


def test_durations_survive_writing(tmp_path):
    durations = {DETECT.format("zooms", 3): 1.25, "Drawing a, b": 3.0}
    TOOL["write_durations"](durations, tmp_path / "d.csv")
    assert TOOL["read_durations"](tmp_path / "d.csv") == {
        "Drawing a, b": 3.0,
        DETECT.format("zooms", 3): pytest.approx(1.2),
    }
    assert TOOL["read_durations"](tmp_path / "none.csv") == {}


@pytest.mark.parametrize(
    ("text", "line"),
    [
        (None, "no such file of settings; check WITH="),
        ("detector: {kappa: 1.2\nrefinement: [}", "is not YAML in line 2: "),
        ("detector:\n\tkappa: 1.2\n", "is not YAML in line 2: "),
        ("- 1\n- 2\n", "holds no settings; write lines such as 'draft: true'"),
        ("# draft: true\n", "holds no settings; write lines such as 'draft: true'"),
    ],
)
@pytest.mark.parametrize("tool", ["study", "why"])
def test_files_that_are_no_settings_get_one_line(capsys, tmp_path, tool, text, line):
    path = tmp_path / "given.yaml"
    if text is not None:
        path.write_text(text)
    main = runpy.run_path(str(TOOLS / f"{tool}.py"))["main"]
    assert main(["--cores", "1", "--configfile", str(path)]) == 2
    said = capsys.readouterr().err
    assert said.startswith(f"error: {path}: {line}") and said.count("\n") == 1


def test_the_end_of_a_study_says_what_was_found_and_where_it_lies(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(TOOLS)
    ending = importlib.import_module("study_end").ending
    settings = {"results": "r", "figures": "f", "reference": "roof.png", "draft": False}
    assert ending(settings, tmp_path) == ""
    claims = [
        {"id": name, "statement": f"{name} holds.", "verdict": verdict, "p": p}
        for name, verdict, p in [
            ("a", "reproduced", 0.0),
            ("b", "not reproduced", None),
            ("c", "not reproduced", 0.02),
            ("d", "not reproduced", 0.01),
            ("e", "not reproduced", 0.03),
        ]
    ]
    (tmp_path / "r").mkdir()
    (tmp_path / "r/claims.json").write_text(json.dumps(claims))
    lines = ending(settings, tmp_path).splitlines()
    assert lines[1] == "Verdicts on roof.png: 1 reproduced, 4 not reproduced."
    assert lines[2].startswith("Most surprising")
    assert [line.split(":")[0].strip() for line in lines[3:6]] == ["d", "c", "e"]
    assert "r/claims.md" in lines[6] and "f/*.pdf" in lines[6]
    assert lines[7].startswith("Next: make report (") and "make study" not in lines[7]
    own = ending(settings, tmp_path, ["my roof.yaml"])
    assert all(f"make {task} WITH=" in own for task in ("report", "verify", "archive"))
    draft = ending(settings | {"draft": True}, tmp_path, ["config/quick.yaml"])
    assert draft.startswith("\nVerdicts of a draft") and "Next: make study (" in draft
    assert "make report" not in draft
