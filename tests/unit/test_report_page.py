"""The page of a run: verdicts first, links both ways, one safe file."""

from __future__ import annotations

import base64
import hashlib
import importlib
import json
import re
from html.parser import HTMLParser
from pathlib import Path

import pytest
from PIL import Image

from keystab.study.plain_yaml import read_plain_yaml

ROOT = Path(__file__).parents[2]
FIGURES = ("fig4", "predictors", "fig1")
HOSTILE = "<script>alert(1)</script><img src=x onerror=alert(2)>\"'&"
IN_CAPTION = "3\n\n.. raw:: html\n\n   <script>alert(3)</script>\n\n`x <javascript:alert(4)>`_"


def claim(name, verdict, figure, **more):
    return {
        "id": name, "where": "section 1", "statement": f"Statement of {name}.", "figure": figure,
        "table": ["fig4_counts.csv"], "criterion": "new_rate <= 0.5", "paper": "small",
        "value": {"new_rate": 0.25, "other": None}, "interval": {"new_rate": [0.125, 0.375]},
        "verdict": verdict, "note": "", "uncertainty": "interval", "by_numbers": verdict,
        "p": 0.01, "p_holm": 0.2, **more,
    }  # fmt: skip


CLAIMS = [
    claim("holds", "reproduced", "fig4"),
    claim("cannot-be-asked", "not testable", "", criterion="", value={}, p=None, p_holm=None),
    claim("fails", "not reproduced", "fig4", statement=HOSTILE, note=HOSTILE, paper=HOSTILE),
    claim("no-perfect-stability", "undecided", "fig1", value={"seen_in_all_views": 1.0}),
]


class Page(HTMLParser):
    """Tags with their attributes in their order, and the text outside of scripts and styles."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags, self.words, self.inside = [], "", ""
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))
        self.inside = tag

    def handle_endtag(self, tag):
        self.inside = ""

    def handle_data(self, data):
        self.words += "" if self.inside in ("script", "style") else data

    def all(self, attribute):
        return [attrs[attribute] for _, attrs in self.tags if attribute in attrs]


@pytest.fixture(scope="module")
def text(tmp_path_factory):
    folder = tmp_path_factory.mktemp("run")
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(ROOT / "tools")
        report = importlib.import_module("report")
        patch.setattr(report, "FIGURES", dict.fromkeys(FIGURES))
        config = read_plain_yaml(ROOT / "config/config.yaml")
        config |= {name: str(folder) for name in ("results", "figures", "logs")}
        config |= {"draft": True, "reference": str(folder / f"{HOSTILE.replace('/', '')}.png")}
        config["predictors"] = config["predictors"] | {"n_spo": [IN_CAPTION]}
        Image.new("L", (900, 450), 99).save(config["reference"])
        (folder / "tables").mkdir()
        for name in FIGURES:
            Image.new("L", (8, 6)).save(folder / f"{name}.png")
            for table in importlib.import_module(f"keystab.figures.{name}").TABLES:
                (folder / "tables" / table).touch()
        (folder / "claims.json").write_text(json.dumps(CLAIMS))
        edges = {("simulate", "detect"), ("detect", "match_grid"), ("match_grid", "fig4")}
        return report.page(config, [HOSTILE], [(HOSTILE, "0" * 64)], edges)


@pytest.fixture(scope="module")
def page(text):
    return Page(text)


def test_verdicts_come_first_and_those_not_reproduced_on_top(page):
    listed = [name for name in page.all("id") if name.startswith("listed-")]
    order = ("fails", "no-perfect-stability", "holds", "cannot-be-asked")
    assert listed == [f"listed-claim-{name}" for name in order]
    ids = page.all("id")
    assert ids.index(listed[-1]) < ids.index("figure-fig4")
    # Beside a figure too.
    assert ids.index("claim-fails") < ids.index("claim-holds") < ids.index("figure-predictors")


def test_links_lead_both_ways_and_none_to_nothing(page):
    ids, links = page.all("id"), [link[1:] for link in page.all("href")]
    assert len(ids) == len(set(ids))
    assert set(links) <= set(ids) and all(link.startswith("#") for link in page.all("href"))
    for one in CLAIMS:
        card = f"claim-{one['id']}"
        assert links.count(card) == 1 + bool(one["figure"])  # from the list and from the figure
        assert links.count(f"listed-{card}") == 1
    assert links.count("figure-fig4") >= 2  # from the two claims about it
    assert "figure-fig1" in links


def test_nothing_of_strangers_becomes_part_of_the_page(page, text):
    tags = [tag for tag, _ in page.tags]
    assert tags.count("script") == 1 and "b" not in page.all("src")
    assert not any(name.startswith("on") for _, attrs in page.tags for name in attrs)
    assert not any("javascript:" in str(value) for _, a in page.tags for value in a.values())
    assert (
        page.words.count(HOSTILE) >= 5
    )  # statement twice, note, paper, overlay and so on: as text
    assert "alert(3)" in page.words  # in a caption, as text
    policy = next(a["content"] for tag, a in page.tags if "http-equiv" in a)
    script = text.split("<script>")[1].split("</script>")[0]
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    assert "default-src 'none'" in policy and f"script-src 'sha256-{digest}'" in policy


def test_the_page_is_one_file_that_loads_nothing(page, text):
    assert {tag for tag, _ in page.tags}.isdisjoint({"link", "iframe", "object", "embed"})
    sources = page.all("src")
    assert len(sources) == 1 + len(FIGURES)  # the picture and the figures
    assert all(source.startswith("data:image/png;base64,") for source in sources)
    assert not re.search(r"url\(|@import|fetch\(|XMLHttp|srcset", text)
    assert all(attrs.get("alt") for tag, attrs in page.tags if tag == "img")


def test_numbers_have_names_in_words_and_say_what_they_are(page):
    assert "new rate" in page.words and "0.25 (0.125 to 0.375)" in page.words
    assert "new rate ≤ 0.5" in page.words and "missing" in page.words
    about = "share seen in all at the last n_spo; refined, M_offset = 0.6, N_interp = 2"
    assert f"{about} (fig7_counts.csv)" in page.words  # from config/claims.yaml
    assert "This is a draft" in page.words and "900 pixels" not in page.words
    assert "900 x 450 pixels" in page.words
