"""What the documents say exists, and what they show runs."""

from __future__ import annotations

import contextlib
import io
import re
import shlex
import subprocess
import tomllib
from itertools import takewhile
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from keystab import __version__, detect_keypoints, keypoint_uncertainty, scale_space
from keystab.camera.views import ViewSpec
from keystab.cli.main import main
from keystab.cli.parser import build_parser
from keystab.io.scale_space_store import write_scale_space
from keystab.io.view_store import write_views
from keystab.study.plain_yaml import read_plain_yaml

ROOT = Path(__file__).parents[2]
DOCUMENTS = sorted(
    path.relative_to(ROOT).as_posix()
    for pattern in (
        "*.md",
        "config/*.md",
        "docs/**/*.md",
        "results/*.md",
        "benchmarks/results/*.md",
    )
    for path in ROOT.glob(pattern)
    if "templates" not in path.parts
)
STARTING = ["README.md", *(name for name in DOCUMENTS if name.startswith("docs/start/"))]
FENCE = re.compile(r"^```(\w*|\{[\w-]+\})\n(.*?)^```", re.MULTILINE | re.DOTALL)
EXAMPLES = {"what_if": "cosine", "pictures": "stream"}
PARTS = ("benchmarks", "config", "docs", "src", "tests", "tools", "workflow")


def text_of(document: str) -> str:
    return (ROOT / document).read_text()


def prose(document: str) -> str:
    return FENCE.sub("", text_of(document))


def blocks(document: str, language: str) -> list[str]:
    return [body for kind, body in FENCE.findall(text_of(document)) if kind == language]


def anchors(document: str) -> set[str]:
    """Anchors of the headings, as code forges make them."""
    titles = re.findall(r"^#+ (.+)$", prose(document), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-") for title in titles}


def settings(schema: dict, name: str = "") -> set[str]:
    """Places of all settings and blocks; NAME stands for the name of a set of views."""
    places = {name} if name else set()
    for key, part in schema.get("properties", {}).items():
        places |= settings(part, f"{name}.{key}" if name else key)
    if isinstance(schema.get("additionalProperties"), dict):
        places |= settings(schema["additionalProperties"], f"{name}.NAME")
    return places


def test_documents_are_found():
    assert {"README.md", "config/README.md", "docs/index.md", "docs/start/install.md"} <= set(
        DOCUMENTS
    )


@pytest.mark.parametrize("document", DOCUMENTS)
def test_links_lead_somewhere(document):
    for link in re.findall(r"\]\(([^)\s]+)\)", prose(document)):
        if link.startswith("https://"):
            continue
        path, _, anchor = link.partition("#")
        target = (ROOT / document).parent / path if path else ROOT / document
        assert target.exists(), link
        page = target.resolve().relative_to(ROOT).as_posix()
        assert not anchor or anchor in anchors(page), link


@pytest.mark.parametrize("document", DOCUMENTS)
def test_files_named_exist(document):
    for name in re.findall(r"`([\w./-]+)`", prose(document)):
        if name.split("/")[0] in PARTS and "NAME" not in name and "figN" not in name:
            assert (ROOT / name).exists(), name


@pytest.mark.parametrize("document", DOCUMENTS)
def test_make_targets_exist(document):
    makefile = (ROOT / "Makefile").read_text()
    rules = re.findall(r"^([\w/%. -]+):", makefile, re.MULTILINE)
    targets = {name.replace("%", "") for rule in rules for name in rule.split()}
    commands = re.findall(r"`make ([^`]+)`", prose(document))
    commands += re.findall(r"^make (.+)$", "\n".join(blocks(document, "sh")), re.MULTILINE)
    for command in commands:
        words = takewhile(lambda word: word != "#", shlex.split(command))
        for word in words:
            if "=" in word:
                assert word.split("=")[0] in makefile, command
                for path in word.removeprefix("WITH=").split():
                    if path.startswith("config"):
                        place = path.replace("NAME", EXAMPLES.get(path.split("/")[1], ""))
                        assert (ROOT / place).exists()
            else:
                assert word in targets or any(
                    word.startswith(target) for target in targets if target.endswith("/")
                ), command


@pytest.mark.parametrize("target", ["quick", "figures/quick/fig1.pdf"])
def test_a_draft_of_another_picture_is_not_that_of_the_default_one(target):
    # It would be, without a word, since the settings of the draft name its folders.
    command = ["make", "--dry-run", target, "WITH=my.yaml"]
    ended = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert ended.returncode == 2
    assert 'make study WITH="config/quick.yaml my.yaml"' in ended.stderr


def test_no_job_at_a_time_is_refused():
    command = ["make", "--dry-run", "study", "CORES=0"]
    ended = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert ended.returncode == 2
    assert "CORES is 0" in ended.stderr


def test_settings_of_deviations_exist():
    schema = read_plain_yaml(ROOT / "workflow/schemas/config.schema.yaml")
    known = settings(schema)
    rows = [
        line.split(" | ") for line in text_of("docs/deviations.md").splitlines() if " | " in line
    ]
    named = [name for row in rows for name in re.findall(r"`([\w.]+)` *[|,]", ", " + row[-1] + "|")]
    named = [name for name in named if not name.endswith(".csv")]
    assert len(named) > 25
    for name in named:
        place = re.sub(r"^sets\.\w+", "sets.NAME", name)
        assert place in known, name


def commands_of(document: str) -> list[list[str]]:
    """Commands of keystab that a document shows, without those that ask for help."""
    lines = "\n".join(blocks(document, "sh")).splitlines()
    commands = [shlex.split(line, comments=True) for line in lines if line.startswith("keystab ")]
    return [command for command in commands if "--help" not in command]


@pytest.mark.parametrize("document", DOCUMENTS)
def test_commands_are_understood(document):
    for command in commands_of(document):
        build_parser().parse_args(command[1:])  # exits where it does not understand


def test_the_pages_for_a_start_show_the_commands_for_pictures():
    shown = {command[1] for document in STARTING for command in commands_of(document)}
    assert {"detect", "truth", "inspect", "uncertainty", "audit", "whence"} <= shown


def test_the_readme_is_short():
    assert len(text_of("README.md").encode()) <= 8192


def test_one_s_own_picture_takes_three_lines_of_shell_and_six_of_python(
    monkeypatch, tmp_path, capsys
):
    (tmp_path / "config").symlink_to(ROOT / "config")
    monkeypatch.chdir(tmp_path)
    lines = [command[1:] for command in commands_of("README.md") if command[1] != "audit"]
    assert len(lines) == 3
    assert main(lines[0]) == 0
    capsys.readouterr()
    ((code, shown),) = re.findall(
        r"^```python\n(.*?)^```\s+^```\n(.*?)^```", text_of("README.md"), re.M | re.S
    )
    assert len(code.strip().splitlines()) <= 6
    exec(code, {})
    assert capsys.readouterr().out == shown
    with Image.open("photo.png") as photo:  # all octaves of all of it take some seconds
        photo.crop((0, 0, 60, 40)).save("photo.png")
    for words in lines[1:]:
        assert main(words) == 0
    assert Path("bars.png").stat().st_size > 10_000


def test_the_page_on_error_bars_has_every_column():
    rows = re.findall(r"^\| (`.*?) \|", text_of("docs/uncertainty.md"), re.MULTILINE)
    named = {name for row in rows for name in re.findall(r"`(\w+)`", row)}
    y, x = np.mgrid[:24, :24] - 12.0
    found = keypoint_uncertainty(np.exp(-(y**2 + x**2) / 8), 0.8, 0.01, n_spo=3)
    detected = set(detect_keypoints(np.eye(12), 0.8).columns)
    assert set(found.columns) - detected == named - detected


EXAMPLE = re.compile(r"^```python\n(.*?)^```\n(?:\n```\n(.*?)^```\n)?", re.MULTILINE | re.DOTALL)


# The README's reads what its commands write: see above. The tutorial takes longer: `make docs` and
# the test beside its tool run it.
@pytest.mark.parametrize("document", sorted({*STARTING} - {"README.md", "docs/start/tutorial.md"}))
def test_examples_run_and_print_what_is_shown(document, monkeypatch):
    monkeypatch.chdir(ROOT)
    examples = EXAMPLE.findall(text_of(document))
    assert len(examples) == len(blocks(document, "python"))
    names: dict = {}
    for code, shown in examples:
        printed = io.StringIO()
        with contextlib.redirect_stdout(printed):
            exec(code, names)
        assert printed.getvalue() == shown


def test_example_of_stores_runs(monkeypatch, tmp_path, capsys):
    monkeypatch.chdir(tmp_path)
    image = np.random.default_rng(1).random((112, 212))
    space = scale_space(image, camera_blur=1.1, n_spo=3)
    write_scale_space(space, tmp_path / "results/scale_space/n15")
    write_views([image], [ViewSpec(1.1, 10.0, image.shape)], tmp_path / "results/views/still")
    (code,) = blocks("docs/reproduce/index.md", "python")
    exec(code, {})
    sizes, peak, views = capsys.readouterr().out.splitlines()
    assert sizes.startswith(str(dict(zip(("scale", "y", "x"), space.shape, strict=True))))
    assert set(eval(peak.split("}")[0] + "}")) == {"sigma", "y", "x"}
    assert views == "('view', 'y', 'x') 1.1 10.0"


def test_the_version_is_the_same_wherever_it_is_said():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    assert project["version"] == __version__
    assert f"\nversion: {__version__}\n" in (ROOT / "CITATION.cff").read_text()
