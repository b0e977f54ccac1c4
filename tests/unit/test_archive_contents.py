"""What an archive holds is held against its records: each file that is odd is named, and no other."""

from __future__ import annotations

import zipfile
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from PIL import Image

from keystab.provenance import archive, archive_contents, run_comparison, unpacking
from keystab.provenance.lineage import file_digest
from keystab.provenance.snakemake_records import FOLDER

TABLE, STORE, BENCHMARK = "out/tables/a.csv", "out/views/still", "log/benchmarks/a.tsv"
ABOUT = SimpleNamespace(
    results="out", figures="fig", logs="log", overlays=("settings/0-mine.yaml",)
)


def record(rule, inputs=(), digests=()):
    return SimpleNamespace(rule=rule, inputs=list(inputs), digests=dict(digests))


def sound():
    """An archive of one table, made from views that are left out, of which nothing is wrong."""
    records = {
        STORE: record("simulate", ["config/images/a.png"]),
        f"{STORE}.sha256": record("simulate"),
        TABLE: record("match", [STORE], {STORE: "d" * 64}),
        "fig/a.pdf": record("draw", [TABLE]),
    }
    names = [TABLE, "fig/a.pdf", BENCHMARK, "archive.json", "settings/0-mine.yaml", "Makefile"]
    names += ["src/keystab/x.py", f"{FOLDER.as_posix()}/abc", "results/README.md"]
    digests = {name: "a" * 64 for name in names} | {f"{STORE}.sha256": "d" * 64}
    left_out = {STORE: {"path": STORE, "bytes": "12", "sha256": "d" * 64, "rule": "simulate"}}
    held = SimpleNamespace(digests=digests, bare_digests={})
    return held, SimpleNamespace(about=ABOUT, records=records), left_out


def problems(change):
    held, run, left_out = sound()
    change(held.digests, run.records, left_out)
    return archive_contents.check_contents(held, run, left_out).problems


def test_what_a_run_packs_has_no_problem():
    assert problems(lambda *_: None) == []


@pytest.mark.parametrize(
    "name",
    ["evil.py", "log/benchmarks/a.py", "log/a.tsv", "settings/1-other.yaml", "srcs/x.py", "docs.locks",
     ".snakemake/other", "archive.json/x"],
)  # fmt: skip
def test_a_file_that_no_run_packs_is_named(name):
    assert problems(lambda digests, *_: digests.update({name: "b" * 64})) == [
        f"{name}: not what a run packs"
    ]


@pytest.mark.parametrize("name", ["src/y.py", "docs.lock", ".ci/x", "log/benchmarks/b/c.tsv"])
def test_a_source_or_a_benchmark_more_is_packed(name):
    assert problems(lambda digests, *_: digests.update({name: "b" * 64})) == []


@pytest.mark.parametrize(
    ("name", "asked"),
    [("out/report.html", True), ("out/report/x.html", True), ("out/claims_pictures.md", True),
     ("out/deep/er/x.html", False), ("other/report.html", False)],
)  # fmt: skip
def test_what_was_asked_for_is_told_and_never_a_problem(name, asked):
    held, run, left_out = sound()
    held.digests[name] = "b" * 64
    check = archive_contents.check_contents(held, run, left_out)
    assert (check.problems == []) == asked
    told = [note for note in check.notes if note.startswith(f"{name}: nothing checks")]
    assert len(told) == asked
    if asked:
        assert ("can run what its writer wants" in told[0]) == name.endswith(".html")


def test_results_and_records_belong_together():
    lost = f"{TABLE}: recorded, but neither here nor in left-out.csv"
    assert problems(lambda digests, *_: digests.pop(TABLE)) == [lost]
    unknown = [f"{TABLE}: not what a run packs", f"{TABLE}: no record of what made it"]
    assert problems(lambda _, records, __: records.pop(TABLE)) == unknown
    assert problems(lambda _, records, __: records["fig/a.pdf"].inputs.append("out/b.csv")) == [
        "out/b.csv: no record of what made it"
    ]
    assert problems(lambda digests, *_: digests.update({STORE: "d" * 64})) == [
        f"{STORE}: here, and in left-out.csv"
    ]


@pytest.mark.parametrize(
    ("key", "value"), [("sha256", "e" * 64), ("rule", "other"), ("bytes", "-1"), ("bytes", "1e3")]
)
def test_the_list_of_what_is_left_out_says_what_the_records_say(key, value):
    wrong = f"{STORE}: left-out.csv says otherwise than the records of the run"
    assert problems(lambda *given: given[2][STORE].update({key: value})) == [wrong]


def test_what_is_left_out_is_known_by_its_checksums_or_by_what_was_made_from_it():
    def without_checksums(digests, records, _):
        del digests[f"{STORE}.sha256"], records[f"{STORE}.sha256"]

    assert problems(without_checksums) == []

    def of_another(digests, records, left_out):
        without_checksums(digests, records, left_out)
        records[TABLE].digests[STORE] = "e" * 64

    assert len(problems(of_another)) == 1

    def of_two(digests, records, left_out):  # made from other bytes at other times
        without_checksums(digests, records, left_out)
        records["fig/a.pdf"].digests[STORE] = "e" * 64

    assert len(problems(of_two)) == 1


def test_other_code_is_a_problem_and_other_texts_are_told(tmp_path):
    (tmp_path / "src").mkdir()
    for name, text in (("same.py", "a = 1\n"), ("said.py", "a = 1\n"), ("other.py", "a = 2\n")):
        (tmp_path / "src" / name).write_text(text)
    (tmp_path / "Makefile").write_text("all:\n")
    bare = archive_contents._bare_digest_of
    held = SimpleNamespace(
        digests={
            "src/same.py": file_digest(tmp_path / "src/same.py"), "src/said.py": "b" * 64,
            "src/other.py": "b" * 64, "src/gone.py": "b" * 64, "LICENSE": "b" * 64,
            "out/x.py": "b" * 64,
        },
        bare_digests={
            "src/same.py": bare(tmp_path / "src/same.py"),
            "src/said.py": bare(tmp_path / "src/same.py"),  # comments alone differ
            "src/other.py": bare(tmp_path / "src/same.py"), "src/gone.py": "c" * 64,
        },
    )  # fmt: skip
    check = archive_contents.check_sources(held, tmp_path)
    assert check.problems == [
        f"src/{name}.py: other code than is here; do not run it" for name in ("gone", "other")
    ]
    assert check.words.startswith("1 of 5 files")
    assert "LICENSE, src/gone.py, src/other.py, src/said.py;" in check.notes[0]


def test_sources_are_all_files_that_make_up_the_project_and_none_that_was_made(tmp_path):
    kept = ["src/keystab/a.py", "docs/x/y.md", "Makefile", ".ci/run", "config/images/a.png"]
    made = [
        "src/__pycache__/a.py", "src/keystab/a.pyc", "src/keystab.egg-info/PKG", "docs/.hidden",
        "docs/.cache/x", "other/a.py", "results/tables/a.csv",
    ]  # fmt: skip
    for name in (*kept, *made):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text("x")
    found = [path.relative_to(tmp_path).as_posix() for path in archive._source_files(tmp_path)]
    assert sorted(found) == sorted(kept)


# Pictures that are not the same


def other_pixels(folder: Path, change, same_tables: bool) -> str:
    pixels = np.full((20, 50, 3), 100, np.uint8)
    Image.fromarray(pixels).save(folder / "there.png")
    Image.fromarray(change(pixels)).save(folder / "here.png")
    return run_comparison._other_pixels(folder / "here.png", folder / "there.png", same_tables)


def changed(n: int, by: int, channel: int = 2):
    def change(pixels):
        pixels = pixels.copy()
        pixels.reshape(-1, 3)[:n, channel] += np.uint8(by)
        return pixels

    return change


@pytest.mark.parametrize("channel", [0, 1, 2])
def test_a_pixel_of_the_same_tables_may_not_differ(channel, tmp_path):
    assert other_pixels(tmp_path, changed(0, 1), True) == ""
    assert other_pixels(tmp_path, changed(3, 1, channel), True) == "3 of its 1000 pixels differ"


def test_of_other_tables_a_few_pixels_may_differ_clearly(tmp_path):
    assert other_pixels(tmp_path, changed(1000, 32), False) == ""
    assert other_pixels(tmp_path, changed(5, 33), False) == ""
    assert other_pixels(tmp_path, changed(6, 33), False) == "6 of its 1000 pixels differ clearly"


def test_a_picture_of_another_size_is_told(tmp_path):
    assert other_pixels(tmp_path, lambda it: it[:, :49], True) == "49 x 20 pixels, there 50 x 20"


def test_chunks_of_a_picture_are_counted_one_by_one(tmp_path, monkeypatch):
    Image.fromarray(np.zeros((9, 9), np.uint8)).save(tmp_path / "a.png")
    data = (tmp_path / "a.png").read_bytes()
    more = b"".join(b"\0\0\0\4tEXta\0bc" + bytes(4) for _ in range(4))
    (tmp_path / "a.png").write_bytes(data[:33] + more + data[33:])  # head, 4 of text, pixels, end
    for most, many in ((7, True), (8, False)):
        monkeypatch.setattr(run_comparison, "_MOST_CHUNKS", most)
        assert run_comparison._has_many_chunks(tmp_path / "a.png") == many


# Members of an archive, and the list of what is not in it


@pytest.mark.parametrize(
    ("mode", "good"),
    [
        (0, True), (0o100644, True), (0o100755, True), (0o644, True),
        *((kind, False) for kind in (0o120777, 0o040755, 0o010644, 0o020644, 0o060644, 0o140644)),
        (0o104755, False), (0o102755, False), (0o101755, False),
    ],
)  # fmt: skip
def test_members_are_plain_files(mode, good):
    member = zipfile.ZipInfo("docs/a.md")
    member.external_attr = mode << 16
    said = unpacking._problem(member)
    assert said == ("" if good else "is a link or a device; make archive writes files only")


@pytest.mark.parametrize(
    ("name", "good"),
    [
        ("a/b.md", True), ("a.b/c d.md", True), ("a:b", False), ("d/a:b", True), ("../a", False),
        ("a/../b", False), ("a/./b", False), ("/a", False), ("a//b", False), ("a\\b", False),
        ("a/", False), ("a\n", False), (255 * "a", True), (256 * "a", False),
    ],
)  # fmt: skip
def test_members_have_names_of_files_within_a_folder(name, good):
    assert (unpacking._problem(zipfile.ZipInfo(name)) == "") == good


def test_what_is_left_out_has_the_digest_that_it_has_or_had(tmp_path):
    for name, data in (
        ("out/there.csv", b"12345"),
        ("out/store/a", b"1"),
        ("out/store/b/c", b"22"),
    ):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_bytes(data)
    (tmp_path / "out/store.sha256").write_text("checksums")
    names = ["out/there.csv", "out/store", "out/gone.csv", "out/never.csv"]
    recorded = {"out/there.csv": "a" * 64, "out/gone.csv": "b" * 64}
    contents = SimpleNamespace(
        study=SimpleNamespace(project=tmp_path), records={"x": record("match", (), recorded)}
    )
    outputs = [SimpleNamespace(path=name, rule="rule") for name in names]
    rows = [it.split(",") for it in archive._listed(outputs, contents).splitlines()]
    assert rows == [
        ["path", "bytes", "sha256", "rule"],
        ["out/there.csv", "5", file_digest(tmp_path / "out/there.csv"), "rule"],
        ["out/store", "3", file_digest(tmp_path / "out/store.sha256"), "rule"],
        ["out/gone.csv", "0", "b" * 64, "rule"],
        ["out/never.csv", "0", "", "rule"],
    ]
