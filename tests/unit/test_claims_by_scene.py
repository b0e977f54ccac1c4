"""Ledgers of several pictures: what differs is flagged, and what cannot be compared is refused."""

from __future__ import annotations

import re

import pandas as pd
import pytest
import yaml

from keystab import __version__
from keystab.errors import InputError
from keystab.io.tables import read_table
from keystab.stages import compare_claims
from keystab.study import claims, claims_by_scene, claims_report, verdicts

RATE = {"table": "rates", "column": "rate", "take": "max", "low": "low", "high": "high"}
COUNT = {"table": "rates", "column": "n", "take": "max"}
TOLD = {"where": "section 5", "figure": "fig4"}
CLAIMS = [
    TOLD | {"id": "rare", "statement": "It is rare.", "paper": "10 %", "value": {"rate": RATE, "n": COUNT}, "criterion": "rate < 0.2"},
    TOLD | {"id": "found", "statement": "Some | any.", "paper": "some", "value": {"n": COUNT}, "criterion": "n > 0"},
    TOLD | {"id": "cited", "statement": "Others agree.", "paper": "all", "reason": "It is about others."},
]  # fmt: skip


def ledger(folder, rate: float, entries=CLAIMS):
    """Write the ledger of a picture in which a rate was found; its path."""
    table = pd.DataFrame({"rate": [rate], "low": [rate - 0.05], "high": [rate + 0.05], "n": [7]})
    judged = verdicts.outcomes_of(claims.parse_claims(entries), {"rates": table})
    head = claims_report.heading(f"{folder.name}.png", ["config/config.yaml"], draft=rate > 0.2)
    claims_report.write_report(
        judged, *(folder / f"claims.{kind}" for kind in ("csv", "json", "md")), head=head
    )
    return folder / "claims.csv"


@pytest.fixture
def three(tmp_path):
    """Ledgers of three pictures, of which the last finds the rare more often."""
    rates = {"hill": 0.1, "lake": 0.14, "town": 0.3}
    for name in rates:
        (tmp_path / name).mkdir()
    return {name: ledger(tmp_path / name, rate) for name, rate in rates.items()}


def compare(given, folder) -> int:
    out = ["--csv", str(folder / "out/pictures.csv"), "--markdown", str(folder / "out/pictures.md")]
    return compare_claims.main(["--verdicts", *map(str, given.values()), "--names", *given, *out])


def test_a_verdict_that_differs_is_flagged_with_the_numbers_of_every_picture(
    three, tmp_path, capsys
):
    assert compare(three, tmp_path) == 0
    assert capsys.readouterr().out == "verdicts that depend on the picture: 1 rare\n"
    table = read_table(tmp_path / "out/pictures.csv").fillna("")
    assert table["id"].tolist() == ["rare", "found", "cited"]
    assert table["depends"].tolist() == ["yes", "no", "no"]
    rare = table.iloc[0]
    verdicts = [rare[f"{name}_verdict"] for name in three]
    assert verdicts == ["reproduced", "reproduced", "not reproduced"]
    assert rare["lake_value"] == "rate 0.14; n 7" and rare["town_value"] == "rate 0.3; n 7"
    assert rare["town_interval"] == "rate 0.25 to 0.35"
    assert set(table.loc[2, [f"{name}_verdict" for name in three]]) == {"not testable"}


def test_a_verdict_that_is_undecided_contradicts_none(three, tmp_path):
    three["mill"] = ledger(tmp_path, 0.19)  # 0.14 to 0.24
    tables = {name: claims_by_scene.read_report(path) for name, path in three.items()}
    del tables["town"]
    table = claims_by_scene.side_by_side(tables)
    assert table.loc[0, "mill_verdict"] == "undecided" and table.loc[0, "depends"] == "no"


def test_people_read_first_what_depends_on_the_picture(three, tmp_path):
    assert compare(three, tmp_path) == 0
    text = (tmp_path / "out/pictures.md").read_text()
    assert "1 of 2 verdicts depend on the picture." in text
    assert "| reproduced | 2 | 2 | 1 |" in text and "| not testable | 1 | 1 | 1 |" in text
    differing, same = text.split("## Verdicts that depend on the picture")[1].split("## Verd")
    assert "| **not reproduced**<br>rate 0.3 (0.25 to 0.35)<br>n 7 |" in differing
    assert "`rare`" in differing and "`rare`" not in same
    assert "Some \\| any. (some)" in same and "`found`" not in differing
    assert same.endswith("`cited`.\n")


def test_a_page_of_several_pictures_names_the_run_of_each(three, tmp_path):
    (tmp_path / "lake/claims.md").unlink()
    assert compare(three, tmp_path) == 0
    text = (tmp_path / "out/pictures.md").read_text()
    run = f"Picture: `{{}}.png`. Settings: `config/config.yaml`. Version: keystab {__version__}."
    assert f"| hill | {run.format('hill')} |\n| lake | not recorded |\n" in text
    assert f"| town | *Draft.* {run.format('town')} |" in text


def test_claims_are_brought_together_by_their_names(three, tmp_path):
    # Another order, as of a file of claims that was put in order in between.
    ledger(tmp_path / "town", 0.3, CLAIMS[::-1])
    assert compare(three, tmp_path) == 0
    table = read_table(tmp_path / "out/pictures.csv")
    assert table.set_index("id").loc["rare", "town_verdict"] == "not reproduced"
    assert table["id"].tolist() == ["rare", "found", "cited"]


@pytest.mark.parametrize(
    ("picture", "entries", "says"),
    [
        ("town", CLAIMS[1:], "town: its report lacks rare; make all from one config/claims.yaml"),
        ("hill", CLAIMS[:1], "hill: its report lacks found, cited;"),
        ("lake", [CLAIMS[0] | {"criterion": "rate < 0.4"}, *CLAIMS[1:]], "hill and lake were asked different criteria for rare;"),
    ],
)  # fmt: skip
def test_ledgers_of_other_claims_are_refused(three, tmp_path, capsys, picture, entries, says):
    ledger(tmp_path / picture, 0.1, entries)
    assert compare(three, tmp_path) == 2
    said = capsys.readouterr().err
    assert said.startswith(f"error: {says}") and said.count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_one_picture_depends_on_nothing(three, tmp_path, capsys):
    assert compare({"hill": three["hill"]}, tmp_path) == 2
    assert "two pictures or more" in capsys.readouterr().err


# Where ledgers come from


def overlays(folder, **given):
    """A file of all settings, and one overlay for each picture."""
    base = {"reference": "images/hill.png", "results": "results", "draft": False}
    files = {"base": base} | given
    for name, content in files.items():
        (folder / f"{name}.yaml").write_text(yaml.safe_dump(content))
    return [str(folder / f"{name}.yaml") for name in files]


def test_pictures_are_named_by_their_files_and_found_in_their_results(tmp_path, monkeypatch):
    lake = {"reference": "/pictures/lake 2.tif", "results": "results/lake"}
    base, second = overlays(tmp_path, lake=lake)
    found = claims_by_scene.sources(base, [base, second])
    assert found == [
        ("hill", "results/claims.csv", base),
        ("lake_2", "results/lake/claims.csv", second),
    ]
    monkeypatch.chdir(tmp_path)
    line = f"results/lake/claims.csv is missing; make it first: make results/lake/claims.md WITH={second}"
    assert claims_by_scene.missing(found, made="results/claims.csv") == [line]
    (tmp_path / "results/lake").mkdir(parents=True)
    (tmp_path / "results/lake/claims.csv").touch()
    assert claims_by_scene.missing(found, made="results/claims.csv") == []
    (other,) = claims_by_scene.missing(found, made="results/lake/claims.csv")
    assert other.startswith("results/claims.csv is missing;")


@pytest.mark.parametrize(
    ("lake", "says"),
    [
        ({"reference": "lake.png"}, "have the same report, results/claims.csv"),
        ({"results": "results/lake"}, "have the same name, hill"),
    ],
)
def test_pictures_that_share_a_name_or_results_are_refused(tmp_path, lake, says):
    base, second = overlays(tmp_path, lake=lake)
    with pytest.raises(InputError, match=re.escape(f"{base} and {second} {says}")):
        claims_by_scene.sources(base, [base, second])
