"""A finished run can be packed, and whoever gets it sees in seconds what is wrong with it."""

from __future__ import annotations

import dataclasses
import hashlib
import json
import re
import shlex
import shutil
import zipfile
from pathlib import Path

import pytest
import small_study
from PIL import Image
from PIL.PngImagePlugin import PngInfo
from project import QUICK

from keystab.cli import main as cli
from keystab.errors import InputError
from keystab.io.figure_metadata import PNG_KEY
from keystab.provenance import (
    archive,
    lineage,
    recomputation,
    result_checks,
    run_comparison,
    verification,
)
from keystab.provenance.run_description import ABOUT, LEFT_OUT, SUMS
from keystab.provenance.study_folder import Study
from keystab.provenance.unpacking import Unpacked, unpacked
from keystab.study import overlays

FIGURES = ("fig1.pdf", "fig1.png", "figS3.pdf", "figS3.png")

pytestmark = pytest.mark.usefixtures("snakemake_in_forks")


@pytest.fixture
def clone(ran, tmp_path) -> Path:
    """A copy of the small study without results."""
    return small_study.write(tmp_path / "clone").project


@pytest.fixture
def here(ran, tmp_path) -> Study:
    """A copy of the small study with its results."""
    shutil.copytree(ran.project, tmp_path / "here")
    return Study(tmp_path / "here")


def rewritten(packed: Path, target: Path, changes: dict[str, bytes | None], forge: bool) -> Path:
    """Copy an archive with other bytes in some members, and its digests adapted or not."""
    with zipfile.ZipFile(packed) as file:
        members = {name: file.read(name) for name in file.namelist()}
    members = {name: data for name, data in (members | changes).items() if data is not None}
    if forge:
        sums = {name: hashlib.sha256(data).hexdigest() for name, data in members.items()}
        del sums[SUMS]
        lines = [f"{digest}  {name}\n" for name, digest in sums.items()]
        members[SUMS] = "".join(lines).encode()
    with zipfile.ZipFile(target, "w") as file:
        for name, data in members.items():
            file.writestr(name, data)
    return target


def digests(held: Unpacked) -> list[str]:
    """What the list of digests of an archive does not agree with."""
    return verification.check_digests(verification._listed(held.folder), held.digests).problems


def found(path: Path, project: Path) -> dict[str, list[str]]:
    """Problems of an archive by the name of the check."""
    with unpacked(path) as held:
        checks, sound = verification.check_archive(held, project)
    problems = {check.what: check.problems for check in checks if check.problems}
    assert sound == (not problems)
    return problems


def test_an_archive_is_verified_without_its_intermediate_files(packed, clone):
    with zipfile.ZipFile(packed) as file:
        names = set(file.namelist())
    assert {"results/tables/fig1.csv", "results/claims.csv", "results/views/still.sha256"} <= names
    assert {"figures/fig1.pdf", "figures/fig1.png", "environment.lock", "Snakefile"} <= names
    assert {"logs/benchmarks/table.tsv", "ro-crate-metadata.json", "ARCHIVE.md"} <= names
    assert not {name for name in names if "keypoints/" in name or "views/still/" in name}
    assert found(packed, clone) == {}
    assert not (clone / "results").exists() and not (clone / ".snakemake").exists()


def test_what_is_left_out_is_listed_with_digests(packed, ran):
    with zipfile.ZipFile(packed) as file:
        rows = file.read(LEFT_OUT).decode().splitlines()
        guide = file.read("ARCHIVE.md").decode()
    keypoints = (ran.project / "results/keypoints/still.csv").read_bytes()
    seal = (ran.project / "results/views/still.sha256").read_bytes()
    size = sum(
        path.stat().st_size
        for path in (ran.project / "results/views/still").iterdir()
        if not path.name.startswith(".")
    )
    assert rows == [
        "path,bytes,sha256,rule",
        f"results/keypoints/still.csv,{len(keypoints)},{hashlib.sha256(keypoints).hexdigest()},keypoints",
        f"results/views/still,{size},{hashlib.sha256(seal).hexdigest()},views",
    ]
    assert "| `results/keypoints` | 1 |" in guide and "| `results/views` | 1 |" in guide


def test_the_same_run_gives_the_same_bytes_and_no_time(packed, here, tmp_path):
    for path in here.project.rglob("*.csv"):
        path.touch()
    again = archive.pack(here, tmp_path / "again.zip")
    assert again.read_bytes() == packed.read_bytes()
    with zipfile.ZipFile(packed) as file:
        infos = file.infolist()
        assert {info.date_time for info in infos} == {(1980, 1, 1, 0, 0, 0)}
        assert [info.filename for info in infos] == sorted(info.filename for info in infos)
        records = [name for name in file.namelist() if name.startswith(".snakemake/metadata/")]
        assert len(records) == 13
        for name in records:
            record = json.loads(file.read(name))
            assert record["starttime"] == 0.0 and 0 <= record["endtime"] < 60


def test_an_unfinished_run_is_not_packed(here, tmp_path):
    (here.project / "results/tables/fig1.csv").write_text("n_spo,found\n3,9\n")
    with pytest.raises(InputError, match=r"fig1\.\w+ and \d more: missing or not up to date"):
        archive.pack(here, tmp_path / "none.zip")
    assert list(tmp_path.iterdir()) == [here.project]


def test_results_whose_intermediate_files_were_deleted_are_packed_all_the_same(
    here, packed, tmp_path
):
    shutil.rmtree(here.project / "results/views/still")
    (here.project / "results/keypoints/still.csv").unlink()
    again = archive.pack(here, tmp_path / "again.zip")
    with zipfile.ZipFile(packed) as one, zipfile.ZipFile(again) as other:
        before, after = (
            [line.split(",")[2] for line in file.read(LEFT_OUT).decode().splitlines()]
            for file in (one, other)
        )
    assert before == after


@pytest.mark.parametrize(
    "name", ["results/tables/fig1.csv", "figures/fig1.pdf", "results/claims.csv", "Snakefile"]
)
def test_a_file_that_was_tampered_with_is_named(packed, tmp_path, name):
    with zipfile.ZipFile(packed) as file:
        data = bytearray(file.read(name))
    data[len(data) // 2] ^= 1
    with unpacked(rewritten(packed, tmp_path / "t.zip", {name: bytes(data)}, False)) as held:
        assert digests(held) == [f"{name}: damaged or changed"]


def test_files_lost_added_and_damaged_in_the_zip_are_named(packed, tmp_path):
    changes: dict[str, bytes | None] = {"results/claims.csv": None, "more.txt": b"1"}
    path = rewritten(packed, tmp_path / "t.zip", changes, False)
    data = path.read_bytes()
    assert data.count(b"free\n") == 1
    path.write_bytes(data.replace(b"free\n", b"fred\n"))  # the checksum in the zip is the old one
    with unpacked(path) as held:
        assert digests(held) == [
            "results/claims.csv: missing",
            "LICENSE: damaged or changed",
            "more.txt: not in SHA256SUMS",
        ]


def test_a_forged_table_does_not_pass_though_all_digests_were_adapted(packed, clone, tmp_path):
    changes: dict[str, bytes | None] = {"results/tables/fig1.csv": b"n_spo,found\n3,9\n"}
    problems = found(rewritten(packed, tmp_path / "t.zip", changes, True), clone)
    assert problems["figures"] == [
        f"figures/fig1.{kind}: drawn from another fig1.csv than the one here (changed)"
        for kind in ("pdf", "png")
    ]
    (told,) = problems["inputs"]
    assert told.startswith("results/tables/fig1.csv: not as it was")
    assert sorted(problems["workflow"]) == [
        f"{job}: Updated input files: results/tables/fig1.csv" for job in ("Drawing", "Judging")
    ]
    assert "digests" not in problems


def test_a_forged_seal_does_not_pass(packed, tmp_path):
    changes: dict[str, bytes | None] = {"results/views/still.sha256": 64 * b"0" + b"  a\n"}
    with unpacked(rewritten(packed, tmp_path / "t.zip", changes, True)) as held:
        elsewhere = result_checks.left_out_digests(held.folder) | dict(held.digests)
        check = verification.check_inputs(verification._run_of(held), elsewhere)
    assert check.problems == [
        "results/views/still.sha256: not as it was when others were made from it"
    ]


def test_other_settings_code_and_lock_are_told_apart(packed, clone):
    (clone / "config/config.yaml").write_text("blur: 0.9\nseed: 1\n")
    problems = found(packed, clone)
    assert list(problems) == ["workflow"]
    (told,) = problems["workflow"]
    assert told.startswith("Taking views: Params have changed")
    assert told.endswith("before: 1.1 now: 0.9")

    small_study.write(clone)
    (clone / "LICENSE").write_text("free, still\n")
    snakefile = clone / "Snakefile"
    snakefile.write_text(snakefile.read_text() + "# bye\n")
    assert found(packed, clone) == {}  # a comment changes no result

    (clone / "environment.lock").write_text("numpy==3\n")
    problems = found(packed, clone)
    assert problems["figures"] == [
        f"figures/{name}: drawn under another environment.lock than is here" for name in FIGURES
    ]
    jobs = ["Measuring", "Taking views"]
    assert sorted(told.partition(":")[0] for told in problems["workflow"]) == jobs
    for told in problems["workflow"]:
        assert "Params have changed" in told and told.endswith(
            "before: code or lock now: code or lock"
        )


def test_figures_of_other_code_are_named(packed, ran, monkeypatch):
    monkeypatch.setattr(result_checks, "code_of_figure", lambda figure: 64 * "0")
    with unpacked(packed) as held:
        check = result_checks.check_figures(verification._run_of(held), ran.lock_digest)
    assert check.problems == [
        f"figures/{name}: drawn by other code than is here" for name in FIGURES
    ]


@pytest.mark.parametrize("content", [b"", b"PK\x03\x04", None])
def test_what_is_no_archive_is_refused(content, clone, tmp_path, packed):
    path = tmp_path / "a.zip"
    path.write_bytes(packed.read_bytes()[:5000] if content is None else content)
    with pytest.raises(InputError, match="a.zip: not a whole zip file"), unpacked(path):
        pass


def test_archives_that_write_elsewhere_are_refused(clone, tmp_path):
    path = tmp_path / "a.zip"
    with zipfile.ZipFile(path, "w") as file:
        file.writestr("../escaped.txt", "")
    with pytest.raises(InputError, match="leads out of its folder"), unpacked(path):
        pass
    with zipfile.ZipFile(path, "w") as file:
        file.writestr("a.txt", "")
    with pytest.raises(InputError, match="no archive of this study"), unpacked(path):
        pass
    assert not (tmp_path.parent / "escaped.txt").exists()


def test_results_that_are_here_are_checked_down_to_the_chunk(here, monkeypatch, capsys):
    monkeypatch.chdir(here.project)
    assert cli.main(["verify"]) == 0
    assert "1 with every chunk as recorded" in capsys.readouterr().out
    (here.project / "results/views/still/b").write_text("3,1.2\n")
    (here.project / "results/keypoints/still.csv").write_text("n_spo,found\n")
    assert cli.main(["verify"]) == 1
    said = capsys.readouterr().out
    assert "results/views/still: b is damaged" in said
    assert "results/keypoints/still.csv: not as it was when others were made from it" in said
    assert "NOT verified" in said
    (here.project / "results/keypoints/still.csv").unlink()  # Snakemake does not miss it
    assert cli.main(["verify"]) == 1
    again = (
        "results/keypoints/still.csv: missing; `make results/keypoints/still.csv` makes it again"
    )
    assert again in capsys.readouterr().out


def test_an_unpacked_archive_is_a_finished_copy(packed, tmp_path, monkeypatch, capsys):
    with zipfile.ZipFile(packed) as file:
        file.extractall(tmp_path / "there")
    monkeypatch.chdir(tmp_path / "there")
    assert cli.main(["verify"]) == 0
    said = capsys.readouterr().out
    assert "ok      results: 10 figures, tables and verdicts are there" in said
    assert "ok      inputs: 13 as they were" in said and "missing" not in said


def test_what_is_missing_is_said_first_and_once_and_then_what_would_run(here, monkeypatch, capsys):
    monkeypatch.chdir(here.project)
    for name in ("figures/fig1.pdf", "results/claims.json", "results/final.sha256"):
        (here.project / name).unlink()
    (here.project / "config/config.yaml").write_text("blur: 0.9\nseed: 1\n")
    assert cli.main(["verify"]) == 1
    said = capsys.readouterr().out
    first, second = said.index("FAILED  results\n"), said.index("FAILED  workflow\n")
    assert said.index("results of ") < first < second
    for name in ("figures/fig1.pdf", "results/claims.json", "results/final.sha256"):
        assert first < said.index(f"{name}: missing; `make {name}` makes it") < second
        assert said.count(f"{name}: missing") == 1
    assert "Taking views: Params have changed" in said[second:]
    assert said.count("missing, as said above") == 3  # among inputs, in the list and the ledger

    shutil.rmtree(here.project / "results")
    shutil.rmtree(here.project / ".snakemake")
    monkeypatch.setattr(verification, "_MOST_NAMED", 3)
    assert cli.main(["verify"]) == 1
    said = capsys.readouterr().out
    assert "and 4 more\nFAILED  workflow\n          13 of 13 files would be made" in said
    assert "jobs like it: Missing output files" in said


def test_archives_of_other_versions_say_so_in_one_line(
    packed, clone, tmp_path, monkeypatch, capsys
):
    monkeypatch.chdir(clone)
    for version in ("0.1.0", "99.0"):
        with zipfile.ZipFile(packed) as file:
            about = json.loads(file.read(ABOUT)) | {"keystab": version}
        changes: dict[str, bytes | None] = {ABOUT: json.dumps(about).encode()}
        path = rewritten(packed, tmp_path / "a.zip", changes, True)
        assert cli.main(["verify", str(path)]) == 2
        out, err = capsys.readouterr()
        assert out == "" and err.count("\n") == 1
        assert f"archive.json was written by keystab {version}, and this is" in err


def test_recomputing_gives_the_same_bits_or_says_what_differs(packed, clone, tmp_path):
    with unpacked(packed) as held:
        source = held.folder
        checks, sound = recomputation.recompute(held, clone, ["all"], 1)
        assert sound and [check.what for check in checks] == [
            "tables",
            "figures",
            "claims",
            "left out",
        ]
        assert checks[0].words.startswith("2 of 2 the same to the last bit (same lock")
        (clone / "config/scene.txt").write_text("5,0.2500000001\n7,\n")
        checks, sound = recomputation.recompute(held, clone, ["fig1"], 1)
        assert not sound
        tables, figures, left_out = (check.problems for check in checks)
        assert tables == [
            "fig1.csv: found differs in 1 of 3 rows, most in row 2, by 1e-10: 0.25 became 0.2500000001"
        ]
        assert figures == ["figures/fig1.pdf: other bytes", "figures/fig1.png: other bytes"]
        assert "results/views/still: 1 of 2 files differ, first b" in left_out

        # The same run from another processor: numbers may differ by rounding, and no more.
        about = json.loads((source / ABOUT).read_text())
        (source / ABOUT).write_text(json.dumps(about | {"arithmetic": "another"}))
        made = tmp_path / "made"
        shutil.copytree(source / "results/tables", made / "tables")
        (made / "tables/fig1.csv").write_text("n_spo,found\n3,1.1\n5,0.2500000000001\n7,\n")
        check = run_comparison.compare_tables(source, made, about["lock"])
        assert check.problems == [] and "by 1e-13" in check.notes[0]
        (made / "tables/fig1.csv").write_text("n_spo,found\n3,1.1\n5,0.2500000001\n7,\n")
        assert "by 1e-10" in run_comparison.compare_tables(source, made, about["lock"]).problems[0]
        with pytest.raises(InputError, match="fig9: no figure; give fig1, figS3 or all"):
            recomputation.recompute(held, clone, ["fig9"], 1)


def test_the_reference_holds_what_is_small_and_is_compared_with(here, monkeypatch, capsys):
    monkeypatch.chdir(here.project)
    assert cli.main(["reference"]) == 0
    folder = here.project / "results/reference"
    names = {path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file()}
    assert names == {
        "SHA256SUMS", "archive.json", "claims.csv", "claims.json", "claims.md", "figures/fig1.png",
        "figures/figS3.png", "left-out.csv", "tables/fig1.csv", "tables/figS3.csv",
    }  # fmt: skip
    before = {name: (folder / name).read_bytes() for name in names}
    assert cli.main(["reference"]) == 0
    assert before == {name: (folder / name).read_bytes() for name in names}
    assert cli.main(["verify"]) == 0
    assert "tables: 2 of 2 the same to the last bit" in capsys.readouterr().out
    (folder / "tables/fig1.csv").write_text("n_spo,found\n3,7\n")
    assert cli.main(["verify"]) == 1
    said = capsys.readouterr().out
    assert (
        "tables/fig1.csv: damaged or changed" in said
        and "fig1.csv: has 3 rows instead of 1" in said
    )


def test_an_audit_and_scenes_beside_a_study_are_neither_missed_nor_in_its_way(
    here, monkeypatch, capsys
):
    monkeypatch.chdir(here.project)
    assert cli.main(["verify"]) == 0  # nobody asked for one
    (here.project / "results/tables/audit.csv").write_text("detector,bias_y\nopencv,0.25\n")
    (here.project / "figures/audit.png").write_bytes(b"a figure")
    (here.project / "results/scenes/lake/tables").mkdir(parents=True)
    for name in (
        "results/scenes/claims.csv",
        "results/scenes/lake/claims.csv",
        "figures/scenes.png",
    ):
        (here.project / name).write_text("claim,scene\n")
    assert cli.main(["verify"]) == 0, capsys.readouterr().out
    assert cli.main(["reference"]) == 0
    folder = here.project / "results/reference/audit"
    assert {path.name for path in folder.iterdir()} == {"audit.csv", "audit.png"}
    assert {path.name for path in (folder.parent / "scenes").iterdir()} == {
        "claims.csv",
        "scenes.png",
    }
    assert cli.main(["verify"]) == 0
    assert cli.main(["archive"]) == 0
    (packed,) = (here.project / "results/archive").iterdir()
    names = zipfile.ZipFile(packed).namelist()
    assert not [
        name for name in names if re.match("results/(tables/audit|scenes/)|figures/(a|s)", name)
    ]
    (folder / "audit.csv").write_text("detector,bias_y\nopencv,0.00\n")
    assert cli.main(["verify"]) == 1  # a reference that was changed


def test_whence_follows_a_figure_to_the_scene_and_says_what_changed(here, monkeypatch, capsys):
    monkeypatch.chdir(here.project / "results")
    assert cli.main(["whence", "../figures/fig1.pdf"]) == 0
    said = capsys.readouterr().out
    digest = hashlib.sha256((here.project / "results/tables/fig1.csv").read_bytes()).hexdigest()
    assert f"  results/tables/fig1.csv  {digest}  unchanged\n" in said
    order = [said.index(f"\n  {rule}\n") for rule in ("table", "keypoints", "views")]
    assert order == sorted(order)
    assert "drawn with\n  python workflow/jobs.py draw figures/fig1.pdf figures/fig1.png" in said
    assert "CHANGED" not in said and "not here" not in said and said.count("  as it is here") == 2

    shutil.move(here.project / "figures/fig1.png", here.project / "somewhere.png")
    (here.project / "results/tables/fig1.csv").write_text("n_spo,found\n")
    (here.project / "environment.lock").write_text("")
    (here.project / "results/keypoints/still.csv").unlink()
    assert cli.main(["whence", "../somewhere.png"]) == 0
    said = capsys.readouterr().out
    assert f"results/tables/fig1.csv  {digest}  CHANGED since then" in said
    assert re.search(r"still.csv  \w{12}  not here", said) and "config/scene.txt" in said
    assert said.count("not as it is here") == 1

    shutil.rmtree(here.project / ".snakemake")
    assert cli.main(["whence", "../figures/fig1.pdf"]) == 0
    said = capsys.readouterr().out
    assert f"fig1.csv  {digest}  " in said and "know no such figure" in said

    passport = lineage.read_figure_metadata(here.project / "figures/fig1.pdf")
    forged = dataclasses.replace(passport, version="1\x1b[2J\n2", settings={"\x07": "\x9b2J"})
    text = PngInfo()
    text.add_text(PNG_KEY, forged.to_text())
    Image.new("L", (9, 9)).save(here.project / "figures/fig1.png", pnginfo=text)
    assert cli.main(["whence", "../figures/fig1.png"]) == 0
    said = capsys.readouterr().out
    assert "drawn by keystab 1?[2J?2" in said and said.replace("\n", "").isprintable()


def test_whence_names_commands_that_can_be_pasted(here):
    def pasted(figure: str) -> list[list[str]]:
        lines = lineage._commands(figure, here.project)
        return [shlex.split(line) for line in lines if line.startswith("  ")]

    assert pasted("figures/fig1.pdf")[0] == ["make", "figures/fig1.pdf"]
    (here.project / "config/what_if").mkdir()
    (here.project / "config/what_if/sharp.yaml").write_text("figures: figures/sharp\n")
    (here.project / "config/broken.yaml").write_text("{")
    make, snakemake = pasted("figures/sharp/scenes/stream/fig1.pdf")
    assert make[1:] == ["figures/sharp/scenes/stream/fig1.pdf", "WITH=config/what_if/sharp.yaml"]
    assert snakemake[-2:] == ["--configfile", "config/what_if/sharp.yaml"]
    (note, first, *_) = lineage._commands("figures/lost/fig1.pdf", here.project)
    assert "figures/lost" in note and first == "  make figures/lost/fig1.pdf WITH=my.yaml"
    # Two files, one of them with a blank and outside of config: a run wrote them down.
    (here.project / "my roof.yaml").write_text("figures: figures/roof\n")
    files = ["config/what_if/sharp.yaml", "my roof.yaml"]
    overlays.note(here.project, {"figures": "figures/roof", "results": "results/roof"}, files)
    make, snakemake = pasted("figures/roof/fig1.pdf")
    assert shlex.split(make[2].removeprefix("WITH=")) == files
    assert snakemake[-2:] == files
    # What no longer leads there is not named.
    (here.project / "my roof.yaml").write_text("figures: figures/else\n")
    assert pasted("figures/roof/fig1.pdf")[0][2] == "WITH=my.yaml"


def test_the_crate_describes_every_file_and_the_run(packed):
    with zipfile.ZipFile(packed) as file:
        crate = json.loads(file.read("ro-crate-metadata.json"))
        members = {name: file.read(name) for name in file.namelist()}
    entities = {entity["@id"]: entity for entity in crate["@graph"]}
    assert len(entities) == len(crate["@graph"])
    files = {name for name, entity in entities.items() if "File" in entity["@type"]}
    hidden = {name for name in members if name.startswith(".")}
    assert files == members.keys() - hidden - {"SHA256SUMS", "ro-crate-metadata.json"}
    for name in files:
        assert entities[name]["sha256"] == hashlib.sha256(members[name]).hexdigest()
        assert entities[name]["contentSize"] == str(len(members[name]))
    root, run = entities["./"], entities["#run"]
    assert {part["@id"] for part in root["hasPart"]} == files
    assert root["mentions"] == {"@id": "#run"} and root["mainEntity"] == run["instrument"]
    assert {it["@id"] for it in run["result"]} == {
        *(f"figures/{name}" for name in FIGURES), "results/claims.csv", "results/claims.json",
        "results/claims.md", "results/final.sha256", "results/tables/fig1.csv",
        "results/tables/figS3.csv", "results/views/still.sha256",
    }  # fmt: skip
    assert {it["@id"] for it in run["object"]} == {
        "config/claims.yaml", "config/config.yaml", "config/scene.txt", "environment.lock",
    }  # fmt: skip
    for entity in crate["@graph"]:  # whatever is referred to is described, or is a web page
        for value in entity.values():
            for reference in value if isinstance(value, list) else [value]:
                if isinstance(reference, dict):
                    name = reference["@id"]
                    assert name in entities or re.match("https?://", name)


@pytest.mark.slow
def test_the_real_study_is_finished_without_its_intermediate_files(touched, tmp_path):
    study = Study(touched.folder, ["config/quick.yaml"])
    contents = archive.Contents.of(study)
    left_out = {output.rule for output in contents.left_out}
    assert left_out >= {"simulate", "detect", "scale_space", "match_samplings"}
    assert not left_out & {"fig5", "score_features", "claims"}
    with unpacked(archive.pack(study, tmp_path / "quick.zip")) as held:
        assert not (held.folder / "results/quick/keypoints").exists()
        run = verification._run_of(held)
        check = verification.check_nothing_to_do(held, run, touched.folder)
    assert check.problems == []


@pytest.mark.parametrize(
    ("table", "rule"),
    [
        ("fig5_auc.csv", "score_features"),  # is drawn
        # is drawn by no figure
        pytest.param("fig5_features.csv", "score_features", marks=pytest.mark.slow),
        pytest.param("predictors_detections.parquet", "score_predictors", marks=pytest.mark.slow),
        pytest.param("refinement.csv", "count_refined", marks=pytest.mark.slow),
    ],
)
def test_a_lost_table_that_cannot_be_packed_is_made_again(finished, table, rule):
    (finished.folder / "results/quick/tables" / table).unlink()
    with pytest.raises(InputError, match=r"finish the study first \(make study\)"):
        archive.Contents.of(Study(finished.folder, ["config/quick.yaml"]))
    assert finished.would_run(*QUICK)[rule] == 1
