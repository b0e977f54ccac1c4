"""Files that no rule makes: what a person is told who asks for one."""

from __future__ import annotations

import logging
import re
from pathlib import Path
from types import SimpleNamespace

import pytest

from keystab.study.overlays import note
from keystab.study.wrong_targets import Offered


def rule(name: str, *patterns: str) -> SimpleNamespace:
    made = [re.compile(pattern) for pattern in patterns]
    plain = [pattern for pattern in patterns if "(" not in pattern and "[" not in pattern]
    return SimpleNamespace(
        name=name, output=plain, is_producer=lambda path: any(it.fullmatch(path) for it in made)
    )


def offered(folder: Path, kind: str = "") -> Offered:
    """What settings offer whose figures and results go to folders of a kind."""
    figures, results = f"figures{kind}", f"results{kind}"
    place = "(scenes/(stream|roof)/)?"
    rules = [
        rule("fig12", f"{figures}/{place}fig12.(pdf|png)"),
        rule("views", f"{results}/{place}views/[a-z]+"),
        rule("gather", f"{figures}/audit.pdf"),
    ]
    places = ["", "scenes/stream/", "scenes/roof/"]
    files = [f"{figures}/fig12.pdf", f"{results}/tables/fig5_roc.csv"]
    settings = {"figures": figures, "results": results, "sets": {"still": {}, "zooms": {}}}
    return Offered(settings, places, rules, files, folder)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "config").mkdir()
    (tmp_path / "config/config.yaml").write_text("{figures: figures, results: results}\n")
    (tmp_path / "config/quick.yaml").write_text(
        "{figures: figures/quick, results: results/quick}\n"
    )
    return tmp_path


@pytest.mark.parametrize(
    ("target", "kind", "said"),
    [
        ("figures/fig12.pdf", "/quick", "figures/fig12.pdf: these settings draw into figures/quick: type figures/quick/fig12.pdf (figures/fig12.pdf is made without --configfile and WITH=)"),
        ("./figures/quick//fig12.pdf", "", "figures/quick/fig12.pdf: these settings draw into figures: type figures/fig12.pdf (figures/quick/fig12.pdf is made with --configfile config/quick.yaml)"),
        ("results/views/still", "/quick", "results/views/still: these settings write to results/quick: type results/quick/views/still (results/views/still is made without --configfile and WITH=)"),
        ("fig12.png", "", "fig12.png: these settings draw into figures: type figures/fig12.png"),
        ("figures/roof/scenes/stream/fig12.pdf", "", "figures/roof/scenes/stream/fig12.pdf: these settings draw into figures: type figures/scenes/stream/fig12.pdf"),
        ("figures/scenes/raof/fig12.pdf", "", "figures/scenes/raof/fig12.pdf: there is no scene 'raof'; did you mean roof?"),
        ("figures/fig21.pdf", "", "figures/fig21.pdf: these settings make no such file; did you mean figures/fig12.pdf?"),
        ("results/tables/fig5_rco.csv", "", "results/tables/fig5_rco.csv: these settings make no such file; did you mean results/tables/fig5_roc.csv?"),
        ("gathr", "", "gathr: these settings make no such file; did you mean gather?"),
        ("figures/xyz.doc", "", "figures/xyz.doc: these settings make no such file; figures are figures/fig1.pdf and so on, tables lie in results/tables, and make help lists what there is besides"),
    ],
)  # fmt: skip
def test_what_is_asked_for_in_vain_gets_one_line(target, kind, said, folder):
    assert offered(folder, kind).instead_of(target) == said


def test_the_files_of_settings_of_the_last_run_there_are_named(folder):
    (folder / "my roof.yaml").write_text("{figures: figures/roof, results: results/roof}\n")
    files = ["config/quick.yaml", "my roof.yaml"]
    note(folder, {"figures": "figures/roof", "results": "results/roof"}, files)
    said = offered(folder).instead_of("figures/roof/fig12.pdf")
    assert said.endswith("is made with --configfile config/quick.yaml 'my roof.yaml')")


def test_a_set_of_views_that_is_not_in_the_settings_is_named(folder):
    words = "Error:\n  KeyError: 'zoomz'\nWildcards:\n  place=\n  set=zoomz\nTraceback:\n  ..."
    record = logging.makeLogRecord({"msg": words, "exception": "InputFunctionException"})
    assert offered(folder).explain(record) is True
    assert record.getMessage() == (
        "error: these settings have no set of views 'zoomz'; did you mean zooms?"
    )


def test_what_snakemake_says_otherwise_stays(folder):
    words = "No rule to produce figures/fig12.pdf (if you use input functions ...)."
    for exception, told in (("MissingRuleException", "error: figures/fig12.pdf"), ("WorkflowError", words)):  # fmt: skip
        record = logging.makeLogRecord({"msg": f"{exception}:\n{words}", "exception": exception})
        assert offered(folder, "/quick").explain(record) is True
        assert told in record.getMessage()
