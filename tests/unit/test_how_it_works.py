"""The pages on how it works: examples run, what they name exists, and hosts can show them."""

from __future__ import annotations

import contextlib
import importlib
import inspect
import io
import re
from pathlib import Path

import pytest
from PIL import Image

from keystab.detection.detector import detect_keypoints
from keystab.detection.search_records import STENCIL
from keystab.evaluation.recall_precision import CAUSES, DEGENERATE
from keystab.evaluation.stability import STABLE, UNSTABLE
from keystab.matching.common_range import comparable
from keystab.matching.correspondence import SCALE_RATIO, SPACE_TOLERANCE
from keystab.prediction.noise_covariance import ORDERS
from keystab.prediction.survival import RADIUS
from keystab.scalespace.cosine_series import NEGLIGIBLE
from keystab.scalespace.sampling import Sampling
from keystab.truth.seeds import SEED_SAMPLINGS
from keystab.truth.true_extrema import RESIDUAL, SAME

ROOT = Path(__file__).parents[2]
FOLDER = ROOT / "docs/how_it_works"
PAGES = sorted(path.stem for path in FOLDER.glob("*.md"))
FENCE = re.compile(r"^```(\w*)\n(.*?)^```\n", re.MULTILINE | re.DOTALL)
FORMULA = re.compile(r"\$\$(.+?)\$\$|\$([^$\n]+?)\$", re.DOTALL)
MOST_WORDS, MOST_BYTES, LEAST_WIDTH = 1500, 60_000, 1400


def default(function, name: str) -> float:
    return inspect.signature(function).parameters[name].default


def samples_per_pixel() -> float:
    octave = Sampling.balanced((1000, 1000), 1.1, 15, 1.1, 2 ** (1 / 3))
    return round(octave.n_samples / 1000**2, -2)


STATED = [
    ("series", "weakens by more than $10^{20}$", 1 / NEGLIGIBLE, 1e20),
    ("scale_space", "$2^{1/3}$ unless", default(detect_keypoints, "kappa"), 2 ** (1 / 3)),
    (
        "scale_space",
        "that is 0.89 times",
        round(default(detect_keypoints, "kappa") ** -0.5, 2),
        0.89,
    ),
    ("scale_space", "about 2000 samples", samples_per_pixel(), 2000),
    ("search", "$\\eta$ is 0 unless", default(detect_keypoints, "epsilon"), 0),
    ("search", r"$M_{\mathrm{offset}} = 0.6$", default(detect_keypoints, "max_offset"), 0.6),
    ("search", r"$N_{\mathrm{interp}} = 2$", default(detect_keypoints, "max_iterations"), 2),
    ("search", "through eight nodes", STENCIL, 8),
    ("truth", "$10^{-12}$ of the image's contrast", RESIDUAL, 1e-12),
    ("truth", "closer than $10^{-6}$ px", SAME, 1e-6),
    ("truth", "with 5, 10 and 15 scales per octave", SEED_SAMPLINGS, (5, 10, 15)),
    ("truth", "conditioning below 0.03", DEGENERATE, 0.03),
    ("truth", "one of five names", len(CAUSES), 5),
    ("matching", r"$\epsilon = 1$ px", SPACE_TOLERANCE, 1),
    ("matching", r"$R = \sqrt 2$", SCALE_RATIO, 2**0.5),
    ("matching", "more than 80 %", STABLE, 0.8),
    ("matching", "less than 20 %", UNSTABLE, 0.2),
    (
        "matching",
        r"below $2^{1/3} \sigma_{\min}$",
        default(comparable, "first_scale"),
        2 ** (1 / 3),
    ),
    ("matching", "within 3 px", default(comparable, "border"), 3),
    ("error_bars", "the 35 derivatives", len(ORDERS), 35),
    ("error_bars", "distance of 0.5 in", RADIUS, 0.5),
]
"""Numbers of the pages: page, words around it, the code's value, and the page's."""


def prose(page: str) -> str:
    return FENCE.sub("", (FOLDER / f"{page}.md").read_text())


def examples(page: str) -> list[tuple[str, str]]:
    """Code, and what it prints: the block after it."""
    blocks = FENCE.findall((FOLDER / f"{page}.md").read_text())
    kinds = [kind for kind, _ in blocks]
    assert kinds == ["python", ""] * (len(kinds) // 2)
    return [(blocks[i][1], blocks[i + 1][1]) for i in range(0, len(blocks), 2)]


def found(name: str) -> object:
    """What a dotted name of the library stands for."""
    parts = name.split(".")
    for n in range(len(parts), 0, -1):
        try:
            thing: object = importlib.import_module(".".join(parts[:n]))
        except ModuleNotFoundError:
            continue
        for part in parts[n:]:
            thing = getattr(thing, part)
        return thing
    raise AssertionError(name)


@pytest.mark.parametrize("page", [page for page in PAGES if page != "index"])
def test_examples_print_what_is_shown(page):
    for code, shown in examples(page):
        printed = io.StringIO()
        with contextlib.redirect_stdout(printed):
            exec(code, {})
        assert printed.getvalue() == shown


@pytest.mark.parametrize(("page", "words", "value", "said"), STATED)
def test_numbers_are_those_of_the_code(page, words, value, said):
    assert words in " ".join(prose(page).split())
    assert value == pytest.approx(said)


@pytest.mark.parametrize("page", PAGES)
def test_names_of_the_library_exist(page):
    names = re.findall(r"`(keystab(?:\.\w+)+)`", prose(page))
    assert names
    for name in names:
        assert found(name) is not None


@pytest.mark.parametrize("page", PAGES)
def test_pages_are_short_and_their_formulas_survive_markdown(page):
    text = prose(page)
    assert len(text.split()) <= MOST_WORDS
    formulas = [display or inline for display, inline in FORMULA.findall(text)]
    assert FORMULA.sub("", text).count("$") == 0  # none is left open, or goes over a line
    for formula in formulas:
        assert formula.count("{") == formula.count("}"), formula
        # Markdown takes a backslash before a sign for its own, and bars in tables for cells.
        assert not re.search(r"\\[^a-zA-Z\s]", formula), formula
        assert "|" not in formula and "*" not in formula, formula
        for line in formula.split("\n")[1:]:  # such a line would begin a list or a heading
            assert not re.match(r"\s*([-+#>=]|\d+[.)])", line), formula


def test_pages_lead_to_each_other_and_to_their_figures(monkeypatch):
    monkeypatch.syspath_prepend(ROOT / "tools")
    explain = importlib.import_module("explain")
    shown = []
    for page in PAGES:
        for text, path in re.findall(r"\[([^]]*)\]\(([^):#]+)\)", prose(page)):
            target = (FOLDER / path).resolve()
            if target.parent == FOLDER or target.suffix == ".png":
                assert target.exists(), path
            if target.suffix == ".png":
                assert len(text) > 40  # what one who cannot see it is told
                shown.append(target)
    assert sorted(shown) == sorted(explain.place(name) for name in explain.FIGURES)
    for path in shown:
        assert path.stat().st_size < MOST_BYTES, path
        with Image.open(path) as picture:
            assert picture.width >= LEAST_WIDTH
    linked = set(re.findall(r"\]\((\w+)\.md\)", prose("index")))
    assert linked == set(PAGES) - {"index"}
