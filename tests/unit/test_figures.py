"""What every figure promises: files that repeat, text that can be read, errors in one line."""

import subprocess
import sys

import figure_tables
import matplotlib
import numpy as np
import pytest
from figure_labels import collisions
from PIL import Image

from keystab import __version__
from keystab.errors import InputError
from keystab.figures import style
from keystab.figures._render import check_tables, main, read_tables, save
from keystab.io.figure_metadata import PNG_KEY, FigureMetadata, digests_of
from keystab.io.tables import write_table

NUMBERS = (*range(1, 13), "S1", "S2", "S3", "S4", "S5")


@pytest.fixture(scope="module")
def modules():
    return {n: figure_tables.module(n) for n in NUMBERS}


@pytest.fixture(scope="module")
def tables():
    return {n: figure_tables.tables(n) for n in NUMBERS}


@pytest.fixture(scope="module")
def drawn():
    return {n: figure_tables.drawn(n)[1] for n in NUMBERS}


@pytest.fixture
def folder(tmp_path, tables):
    def write(n, skip=()):
        for stem, table in tables[n].items():
            kind = "parquet" if stem in ("fig2_pixels", "fig6_cubes", "fig12_pixels") else "csv"
            if stem not in skip:
                write_table(table, tmp_path / f"{stem}.{kind}")
        return tmp_path

    return write


# Embedding fonts takes longer than drawing, and is the same for all: most are written as drafts are.
# Pixels, a surface, a grid and curves are drawn in different ways; of each one here.
TWICE = [
    ("S2", False),
    *(pytest.param(n, True, marks=[pytest.mark.slow] * (n not in (3, 6, 12))) for n in NUMBERS),
]


@pytest.mark.parametrize(("n", "draft"), TWICE)
def test_drawing_twice_writes_the_same_pdf(n, draft, modules, tables, drawn, tmp_path):
    save(drawn[n], tmp_path / "first.pdf", draft)
    with matplotlib.rc_context({"font.size": 20.0, "font.family": "serif", "pdf.fonttype": 3}):
        save(modules[n].draw(tables[n]), tmp_path / "second.pdf", draft)
    first = (tmp_path / "first.pdf").read_bytes()
    assert first == (tmp_path / "second.pdf").read_bytes()
    assert b"/CreationDate" not in first and b"/Producer" not in first
    if not draft:  # TrueType outlines, embedded
        assert b"/FontFile2" in first and b"DejaVuSans" in first


def test_the_command_writes_what_the_library_writes(drawn, folder, tmp_path):
    flags = [f"--tables={folder(2)}", f"--pdf={tmp_path}/new/a.pdf"]
    paths = [tmp_path / name for name in figure_tables.module(2).TABLES]
    done = subprocess.run(
        [sys.executable, "-m", "keystab.figures.fig2", *flags], capture_output=True, text=True
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert [path.name for path in (tmp_path / "new").iterdir()] == ["a.pdf"]
    metadata = FigureMetadata("a", __version__, None, None, {"draft": "False"}, digests_of(paths))
    save(drawn[2], tmp_path / "b.pdf", metadata=metadata)
    assert (tmp_path / "new" / "a.pdf").read_bytes() == (tmp_path / "b.pdf").read_bytes()


def pixels(figure):
    with style.context():
        figure.canvas.draw()
    return np.asarray(figure.canvas.buffer_rgba())[..., :3]


def rim_is_white(pixels):
    inner = np.zeros(pixels.shape[:2], dtype=bool)
    inner[2:-2, 2:-2] = True
    return (pixels[~inner] == 255).all() and (pixels[inner] < 100).all(axis=-1).any()


@pytest.mark.parametrize("n", NUMBERS)
def test_text_has_seven_points_and_touches_neither_edge_nor_points_nor_curves(n, drawn):
    texts = [text for text in drawn[n].findobj(matplotlib.text.Text) if text.get_text().strip()]
    assert len(texts) > 4
    assert min(text.get_fontsize() for text in texts) >= 7.0
    assert rim_is_white(pixels(drawn[n]))
    assert collisions(drawn[n]) == []  # where labels are as the figure was drawn last


@pytest.mark.parametrize(
    ("n", "letters"),
    [
        (1, "abcde"),
        (2, "abc"),
        (3, "abcde"),
        (4, "abcd"),
        (5, "abcde"),
        (7, "abcdef"),
        (8, "abc"),
        (9, "ab"),
        (10, "ab"),
        (11, "ab"),
        (12, "abcdef"),
        ("S1", "abc"),
        ("S2", "abcd"),
        ("S3", "abcdef"),
        ("S4", "abc"),
        ("S5", "abc"),
    ],
)
def test_panels_carry_their_letters(n, letters, drawn):
    labels = {ax.get_label() for ax in drawn[n].axes}
    assert set(letters) <= labels
    titles = {ax.get_label(): ax.get_title(loc="left") for ax in drawn[n].axes}
    for name in letters:
        assert titles[name].startswith(rf"$\bf{{({name})}}$")


def test_dashed_means_the_coarse_sampling_in_every_figure(drawn):
    dashed = {
        (n, line.get_label().split(",")[0])
        for n in NUMBERS
        for ax in drawn[n].axes
        for line in ax.get_lines()
        if line.get_linestyle() not in ("-", ":", "None")
    }
    assert dashed == {(8, "3"), ("S1", "3"), ("S5", "3")}


@pytest.mark.parametrize("n", [5, 6])
def test_a_draft_says_so_below_the_figure(n, modules, tables, drawn):
    draft = modules[n].draw(tables[n], draft=True)
    final, marked = pixels(drawn[n]), pixels(draft)
    assert rim_is_white(marked)
    # The foot is 0.14 in, at 100 dots per inch, and only its right half is written on.
    assert marked.shape[0] - final.shape[0] == 14 and marked.shape[1] == final.shape[1]
    left, right = np.array_split(marked[-14:], 2, axis=1)
    assert (left == 255).all() and (right < 150).any()
    assert [text.get_text() for text in draft.texts if text.get_label() == "draft"] == [
        "draft: quick settings"
    ]


def test_the_command_marks_drafts_and_stamps_no_date(folder, capsys, modules, tmp_path):
    flags = ["--tables", str(folder(2)), "--png"]
    for name, more in (("final.png", []), ("draft.png", ["--draft"])):
        assert main(modules[2].draw, modules[2].TABLES, [*flags, str(tmp_path / name), *more]) == 0
    assert capsys.readouterr().out.count("wrote ") == 2
    with Image.open(tmp_path / "final.png") as final, Image.open(tmp_path / "draft.png") as draft:
        assert final.width == draft.width == 300 * style.WIDTH
        assert final.height < draft.height
        assert set(final.info) <= {"dpi", PNG_KEY}


@pytest.mark.parametrize("n", NUMBERS)
def test_each_missing_table_is_named(n, modules, folder):
    for name in modules[n].TABLES:
        path = folder(n, skip=(name.split(".")[0],)) / name
        path.unlink(missing_ok=True)
        with pytest.raises(InputError, match=f"{name}: no such table; run the study"):
            read_tables(path.parent, modules[n].TABLES)


@pytest.mark.parametrize("n", NUMBERS)
def test_empty_tables_and_missing_columns_are_named(n, modules, tables):
    for name, columns in modules[n].TABLES.items():
        stem = name.split(".")[0]
        whole = tables[n][stem]
        with pytest.raises(InputError, match=f"^{name}: has no rows"):
            modules[n].draw(tables[n] | {stem: whole.iloc[:0]})
        with pytest.raises(InputError, match=f"^{name}: .*{columns[-1]}"):
            modules[n].draw(tables[n] | {stem: whole.drop(columns=columns[-1])})
        with pytest.raises(InputError, match=f"^{name}: the figure needs this table"):
            check_tables({}, {name: columns})


def test_a_command_that_fails_prints_one_line_and_leaves_nothing(folder, capsys, modules, tmp_path):
    module = modules[4]
    target = tmp_path / "out" / "fig4.pdf"
    flags = ["--tables", str(folder(4, skip=("fig4_counts",))), "--pdf", str(target)]
    assert main(module.draw, module.TABLES, flags) == 2
    assert main(module.draw, module.TABLES, flags[:2]) == 2
    output = capsys.readouterr()
    assert output.out == ""
    first, second = output.err.splitlines()
    assert "fig4_counts.csv: no such table" in first
    assert second == "error: nothing to write: give --pdf, --png or both"
    assert not target.parent.exists()


def test_other_endings_and_unwritable_folders_are_refused(drawn, tmp_path):
    with pytest.raises(InputError, match="written as .pdf or .png"):
        save(drawn[2], tmp_path / "fig2.svg")
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="is no folder; give another place"):
        save(drawn[2], tmp_path / "file" / "fig2.png")


def test_the_style_leaves_no_trace():
    before = dict(matplotlib.rcParams)
    with style.context():
        assert matplotlib.rcParams["font.family"] == ["DejaVu Sans"]
    assert dict(matplotlib.rcParams) == before
