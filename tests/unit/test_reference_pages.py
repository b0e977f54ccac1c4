"""The pages of docs/reference say what there is: every column, function, setting and command."""

from __future__ import annotations

import importlib
import runpy
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from keystab import detect_keypoints, true_extrema
from keystab.detection.view_detector import Detector, detect_in_view
from keystab.errors import InputError

ROOT = Path(__file__).parents[2]
TOOL = runpy.run_path(str(ROOT / "tools/reference_pages.py"))
DESCRIBED = TOOL["read"](TOOL["FOLDER"] / "columns.csv")
TABLES = {
    name: row["columns"].split()
    for row in TOOL["read"](TOOL["FOLDER"] / "tables.csv")
    for name in row["tables"].split()
}


@pytest.mark.parametrize("page", TOOL["PAGES"])
def test_page_is_up_to_date(page):
    # Otherwise: python tools/reference_pages.py
    text = TOOL["text_of"](TOOL["FOLDER"] / f"{page}.md")
    shown = text.split(TOOL["BEGIN"])[1].split(TOOL["END"])[0]
    assert shown == TOOL["PAGES"][page]()


def test_every_table_of_the_reference_is_described_and_no_other():
    there = {path.stem for path in (ROOT / "results/reference/tables").glob("*.csv")} | {"claims"}
    assert {name for name, columns in TABLES.items() if not columns} == there


@pytest.mark.parametrize(
    ("described", "problem"),
    [
        ([], "0 rows describe y of fig4"),
        ([{"tables": "fig*", "columns": "x y"}] * 2, "2 rows describe y of fig4"),
        ([{"tables": "fig5", "columns": "y"}], "0 rows describe y of fig4"),
    ],
)
def test_a_column_that_is_not_described_once_is_an_error(described, problem):
    with pytest.raises(InputError, match=problem):
        TOOL["meaning"]("fig4", ["y"], described)


def test_a_description_of_no_column_is_an_error(monkeypatch):
    more = [*DESCRIBED, {"tables": "fig1", "columns": "nowhere", "unit": "", "meaning": ""}]
    tables = TOOL["read"](TOOL["FOLDER"] / "tables.csv")
    columns = TOOL["columns"]
    monkeypatch.setitem(
        columns.__globals__, "read", lambda path: more if path.stem == "columns" else tables
    )
    with pytest.raises(InputError, match="fig1 has no nowhere"):
        columns()


def test_columns_of_keypoints_are_what_is_found():
    image = np.pad([[1.0]], 8)
    extrema, traces = detect_in_view(image, Detector(0.8, 3))
    assert TABLES["extrema"] == ["view", *extrema.columns]
    assert TABLES["traces"] == list(traces.columns)
    assert TABLES["detect"] == list(detect_keypoints(image, 0.8).columns)
    assert TABLES["truth"] == list(true_extrema(image, 0.8, n_spo=(3,)).columns)


@pytest.mark.parametrize("figure", ["fig2", "fig6", "fig12"])
def test_columns_of_pixels_and_cubes_are_what_figures_draw(figure):
    for file, columns in importlib.import_module(f"keystab.figures.{figure}").TABLES.items():
        if file.endswith(".parquet"):
            assert set(columns) == set(TABLES[file.removesuffix(".parquet")])


def test_a_tutorial_whose_code_fails_ends_with_an_error(capfd):
    tool = runpy.run_path(str(ROOT / "tools/tutorial.py"))
    with pytest.raises(SystemExit, match="exit status 1"):
        tool["executed"]("```sh\nfalse\ntrue\n```\n")
    with pytest.raises(ZeroDivisionError):
        tool["executed"]("```python\nx = 0\n```\n\n```python\n1 / x\n```\n")
    shown = "```sh\necho new\n```\n\n```\nold\n```\n"
    assert tool["executed"](shown) == shown.replace("old", "new")


@pytest.mark.slow
def test_the_tutorial_prints_what_it_shows():
    command = [sys.executable, str(ROOT / "tools/tutorial.py"), "--check"]
    assert subprocess.run(command).returncode == 0
