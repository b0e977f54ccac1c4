"""What a figure says about itself: no time, nothing of others, and nothing that was changed."""

from __future__ import annotations

import dataclasses
import io

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from matplotlib.figure import Figure
from PIL import Image, PngImagePlugin
from PIL.PngImagePlugin import PngInfo
from pypdf import PdfReader, PdfWriter

from keystab import __version__
from keystab.cli import main as cli
from keystab.errors import InputError
from keystab.figures._render import main, save
from keystab.io.figure_metadata import PNG_KEY, FigureMetadata, digests_of
from keystab.io.tables import write_table
from keystab.provenance.lineage import read_figure_metadata

DIGEST = st.text("0123456789abcdef", min_size=64, max_size=64)
SIMPLE = st.text(st.characters(codec="utf-8"), max_size=8)
METADATA = FigureMetadata(
    "fig5",
    "0.1.0",
    64 * "a",
    64 * "b",
    {"draft": "False"},
    {"one.csv": 64 * "1", "two.csv": 64 * "2"},
)


def drawing() -> Figure:
    figure = Figure((1, 1))
    figure.subplots().plot([0, 1])
    return figure


@pytest.fixture(params=["pdf", "png"])
def figure(request, tmp_path):
    path = tmp_path / f"fig5.{request.param}"
    save(drawing(), path, metadata=METADATA)
    return path


@settings(max_examples=30)
@given(
    st.builds(
        FigureMetadata, st.from_regex("[a-z][a-zA-Z0-9_]*", fullmatch=True), SIMPLE,
        st.none() | DIGEST, st.none() | DIGEST, st.dictionaries(SIMPLE, SIMPLE, max_size=3),
        st.dictionaries(st.from_regex(r"\w[\w.]*", fullmatch=True), DIGEST, max_size=3),
    )
)  # fmt: skip
def test_metadata_are_read_as_they_were_written(metadata):
    text = metadata.to_text()
    assert text.isascii() and "\n" not in text
    assert FigureMetadata.from_text(text) == metadata


def test_config_changes_with_tables_and_own_settings_and_nothing_else():
    config = METADATA.config
    for changes in ({"code": 64 * "c"}, {"lock": None}, {"version": "2"}, {"figure": "fig6"}):
        assert dataclasses.replace(METADATA, **changes).config == config
    turned = dict(reversed(METADATA.tables.items()))
    assert dataclasses.replace(METADATA, tables=turned).to_text() == METADATA.to_text()
    for changes in (
        {"settings": {"draft": "True"}},
        {"tables": METADATA.tables | {"one.csv": 64 * "3"}},
    ):
        assert dataclasses.replace(METADATA, **changes).config != config


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("1111", "1112"),
        ('"False"', '"True"'),
        ("aaaa", "aaax"),
        ('"draft"', '"more"'),
        ("{", "["),
        ('"fig5"', ""),
    ],
)
def test_changed_metadata_are_refused(old, new):
    text = METADATA.to_text()
    assert old in text
    with pytest.raises(InputError, match="no metadata of keystab|changed by hand or damaged"):
        FigureMetadata.from_text(text.replace(old, new, 1))


@pytest.mark.parametrize("figure", ["", "../fig5", "fig5/x", "fig5\n", "/etc/x", "fig.5"])
def test_a_figure_that_could_be_a_path_is_refused(figure):
    text = dataclasses.replace(METADATA, figure=figure).to_text()
    with pytest.raises(InputError, match="changed by hand or damaged"):
        FigureMetadata.from_text(text)


@pytest.mark.parametrize("table", ["../one.csv", "/etc/passwd", "a/b.csv", "", ".hidden"])
def test_a_table_that_could_be_a_path_is_refused(table):
    text = dataclasses.replace(METADATA, tables={table: 64 * "0"}).to_text()
    with pytest.raises(InputError, match="changed by hand or damaged"):
        FigureMetadata.from_text(text)


def test_what_a_figure_carries_is_found_without_decoding_it(figure):
    assert read_figure_metadata(figure, as_drawn=True) == METADATA
    spoilt = dataclasses.replace(METADATA, settings={"draft": "a (b) \\ c"})
    save(drawing(), figure, metadata=spoilt)
    assert read_figure_metadata(figure, as_drawn=True) == spoilt


def test_figures_carry_their_metadata_and_no_time(figure):
    assert read_figure_metadata(figure) == METADATA
    before = figure.read_bytes()
    assert b"/CreationDate" not in before and b"tIME" not in before and b"/ModDate" not in before
    save(drawing(), figure, metadata=METADATA)
    assert figure.read_bytes() == before
    other = dataclasses.replace(METADATA, tables={"one.csv": 64 * "3"})
    save(drawing(), figure, metadata=other)
    assert figure.read_bytes() != before and read_figure_metadata(figure) == other


def test_figures_that_other_programs_saved_again_keep_it(figure):
    if figure.suffix == ".pdf":
        writer = PdfWriter(clone_from=PdfReader(figure))
        writer.compress_identical_objects()
        writer.write(figure)
    else:
        with Image.open(figure) as picture:
            info = PngInfo()
            info.add_itxt(PNG_KEY, picture.info[PNG_KEY], zip=True)
            picture.convert("L").save(figure, pnginfo=info)
    assert read_figure_metadata(figure) == METADATA


def foreign_pdf() -> bytes:
    data = io.BytesIO()
    writer = PdfWriter()
    writer.add_blank_page(9, 9)
    writer.add_metadata({"/Keywords": "cats, dogs"})
    writer.write(data)
    return data.getvalue()


def foreign_png() -> bytes:
    data = io.BytesIO()
    Image.fromarray(np.eye(5) > 0).save(data, "png")
    return data.getvalue()


@pytest.mark.parametrize(
    ("data", "said"),
    [
        (foreign_png(), "has no metadata"),
        (foreign_pdf(), "no metadata of keystab"),
        (foreign_png()[:40], "a damaged PNG"),
        (b"%PDF-1.4\n", "a damaged PDF"),
        (foreign_pdf()[:300], "a damaged PDF"),
        (b"%PDF-1.4\nxref\n0 3\n0000000000 65535 f\ntrailer <</Size 3>>\nstartxref\n9\n%%EOF", "has no metadata|a damaged PDF"),
        (b"n_spo,found\n", "neither a PDF nor a PNG"),
        (b"", "neither a PDF nor a PNG"),
    ],
)  # fmt: skip
def test_what_has_no_metadata_gives_one_line(data, said, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    for name in ("Snakefile", "environment.lock"):
        (tmp_path / name).touch()
    (tmp_path / "thing.pdf").write_bytes(data)
    with pytest.raises(InputError, match=f"thing.pdf: .*({said})"):
        read_figure_metadata(tmp_path / "thing.pdf")
    assert cli.main(["whence", "thing.pdf"]) == 2
    error = capsys.readouterr().err
    assert error.startswith("keystab whence: thing.pdf: ") and error.count("\n") == 1


def test_missing_figures_folders_and_projects_give_one_line(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert cli.main(["whence", "fig5.pdf"]) == 2
    assert "lies in no copy of the project" in capsys.readouterr().err
    for path, said in ((tmp_path / "fig5.pdf", "no such file"), (tmp_path, "is a folder")):
        with pytest.raises(InputError, match=said):
            read_figure_metadata(path)


def test_the_command_of_a_figure_writes_what_it_was_told_and_what_it_read(tmp_path):
    write_table(pd.DataFrame({"x": [1.0]}), tmp_path / "one.csv")
    flags = [
        "--tables",
        str(tmp_path),
        "--pdf",
        f"{tmp_path}/fig0.pdf",
        "--png",
        f"{tmp_path}/fig0.png",
    ]
    needs = {"one.csv": ("x",)}
    assert (
        main(
            lambda tables, draft: drawing(), needs, [*flags, "--code", 64 * "a", "--lock", 64 * "b"]
        )
        == 0
    )
    expected = FigureMetadata(
        "fig0",
        __version__,
        64 * "a",
        64 * "b",
        {"draft": "False"},
        digests_of([tmp_path / "one.csv"]),
    )
    assert [read_figure_metadata(tmp_path / f"fig0.{kind}") for kind in ("pdf", "png")] == 2 * [
        expected
    ]
    assert main(lambda tables, draft: drawing(), needs, [*flags, "--draft"]) == 0
    by_hand = dataclasses.replace(expected, code=None, lock=None, settings={"draft": "True"})
    assert read_figure_metadata(tmp_path / "fig0.pdf") == by_hand


@pytest.mark.parametrize(("height", "width"), [(2, 40), (40, 2), (2, 41), (41, 2)])
def test_pixels_of_a_large_picture_are_not_decoded_to_find_what_stands_behind(
    height, width, tmp_path, monkeypatch
):
    data, told = io.BytesIO(), PngImagePlugin.PngInfo()
    told.add_text(PNG_KEY, "not of keystab")
    Image.fromarray(np.zeros((height, width), np.uint8)).save(data, "png", pnginfo=told)
    raw = data.getvalue()
    at = raw.index(b"tEXt") - 4
    size = int.from_bytes(raw[at : at + 4], "big") + 12
    behind = raw[:at] + raw[at + size : -12] + raw[at : at + size] + raw[-12:]
    (tmp_path / "k.png").write_bytes(behind)
    monkeypatch.setattr("keystab.provenance.lineage._MOST_PIXELS", 80)
    found = "has no metadata" if height * width > 80 else "no metadata of keystab|draw it again"
    with pytest.raises(InputError, match=found) as raised:
        read_figure_metadata(tmp_path / "k.png")
    assert ("has no metadata" in str(raised.value)) == (height * width > 80)
