"""Small parts of the study, run for real; and what a person sees who mistypes something."""

from __future__ import annotations

import pytest
from project import copy_of_project

TINY = """
sets: {still: {step: 40}, examples: {step: [40, 28, 20]}}
samplings: {n_spo: [3, 4]}
floor: {settles_at: 4}
keep_scale_spaces: KEEP
reference_sha256: SHA
results: results/tiny
figures: figures/tiny
logs: logs/tiny
"""
SHA = "d5f714f453d58bdda7b7575dac5d19d32994ff482217e19e58f74d0b63e2dd30"


def tiny(project, keep: str = "false", sha: str = SHA) -> tuple[str, str]:
    text = TINY.replace("KEEP", keep).replace("SHA", sha)
    (project.folder / "config/tiny.yaml").write_text(text)
    return ("--configfile", "config/tiny.yaml")


@pytest.mark.slow
def test_detections_of_a_stored_scale_space(project):
    target = "results/tiny/keypoints/sampling_n3.parquet"
    run = project.snakemake(*tiny(project, "[3]"), "--printshellcmds", "--", target)
    assert run.returncode == 0, run.stdout
    (shell,) = (block for block in run.stdout.split("python -m ") if ".detect " in block)
    named = "--store results/tiny/scale_space/n3 --store-digest results/tiny/scale_space/n3.sha256"
    assert named in shell
    store = project.folder / "results/tiny/scale_space/n3"
    assert (store / "data.zarr/zarr.json").is_file()
    assert "data.zarr/zarr.json" in store.with_suffix(".sha256").read_text()
    assert "extrema among" in (project.folder / "logs/tiny/detect/n3.log").read_text()
    assert "max_rss" in (project.folder / "logs/tiny/benchmarks/detect/n3.tsv").read_text()

    tables = [project.folder / target, project.folder / target.replace("sampling", "traces")]
    stored = [table.read_bytes() for table in tables]
    run = project.snakemake(*tiny(project), "--printshellcmds", "--", target)
    assert "stages.detect " in run.stdout and "--store-digest" not in run.stdout
    assert [table.read_bytes() for table in tables] == stored

    chunk = max(store.rglob("c/*/*/*"), key=lambda file: file.stat().st_size)
    data = bytearray(chunk.read_bytes())
    data[len(data) // 2] ^= 1
    chunk.write_bytes(data)
    run = project.snakemake(*tiny(project, "[3]"), "--forcerun", "detect", "--", target)
    assert run.returncode != 0
    assert "Traceback" not in run.stdout
    log = (project.folder / "logs/tiny/detect/n3.log").read_text()
    assert log.count("\n") == 1 and f"{chunk.relative_to(store)} is damaged" in log
    assert log in run.stdout


def test_figure_from_picture_and_nothing_to_do_afterwards(project):
    target = "figures/tiny/fig2.pdf"
    run = project.snakemake(*tiny(project), "--", target)
    assert run.returncode == 0, run.stdout
    assert (project.folder / target).read_bytes().startswith(b"%PDF")
    assert project.would_run(*tiny(project), "--", target) == {}


SETS = """
sets:
  still: {step: 40}
  examples: {step: [40, 28, 20]}
  translations: {n_views: 3, step: 40, n_spo: [3, 5]}
  zooms: {n_views: 3, step: 40, n_spo: [3, 5]}
  rotations: {n_views: 3, step: 40, n_spo: [3, 5]}
  shipped: {n_views: 2, step: 40}
  aliasing: {n_views: 2, step: 40, n_spo: [4]}
  unknown_blur: {n_views: 3, step: 40, n_spo: [4], sweep: {blur_spread: [0.1, 0.4]}}
  noise: {n_views: 2, step: 40, n_spo: [4], sweep: {noise: [0.01, 0.02]}}
  blur_errors: {blur: [0.7, 0.3], step: 40, n_spo: [4]}
  shots: {blur: [0.8, 1.1], step: 40, height: 40, width: 60}
stability: {curve_n_spo: [3, 5], n_resamples: 100}
samplings: {n_spo: [3, 4]}
floor: {settles_at: 4}
keep_scale_spaces: KEEP
results: results/tiny
figures: figures/tiny
logs: logs/tiny
"""


# That what is stored is what is streamed is also tried above, and of stages in test_stages.
@pytest.mark.slow
@pytest.mark.parametrize("figure", ["fig8", "fig11"])
def test_tables_of_sets_depend_on_neither_cores_nor_stores(figure, tmp_path):
    written = {}
    for how, keep, cores in (("streamed", "false", "1"), ("stored", "true", "2")):
        project = copy_of_project(tmp_path / how, own_library=False)
        (project.folder / "config/tiny.yaml").write_text(SETS.replace("KEEP", keep))
        run = project.snakemake(
            "--cores",
            cores,
            "--configfile",
            "config/tiny.yaml",
            "--",
            f"results/tiny/tables/{figure}_curves.csv",
        )
        assert run.returncode == 0, run.stdout
        tables = sorted((project.folder / "results/tiny/tables").iterdir())
        written[how] = {table.name: table.read_bytes() for table in tables}
        stores = project.folder / "results/tiny/scale_space"
        assert bool(list(stores.glob("*/n*"))) == (how == "stored")
    assert len(written["streamed"]) == 3
    assert written["streamed"] == written["stored"]


def test_failing_job_shows_its_one_line_and_leaves_no_output(project):
    run = project.snakemake(*tiny(project, sha="f" * 64), "--", "results/tiny/views/still.sha256")
    assert run.returncode != 0
    assert f"for this picture write reference_sha256: {SHA} or null" in run.stdout
    assert "Traceback" not in run.stdout
    assert not (project.folder / "results/tiny/views/still").exists()


@pytest.mark.parametrize(
    ("overlay", "line"),
    [
        ("detector: {sigma_mim: 1}", "config: detector.sigma_mim is no setting; did you mean detector.sigma_min?"),
        ("detector: {epsilon: 1e-6}", "config: detector.epsilon is the text '1e-6', allowed is a number of at least 0: write 1.0e-06"),
        ("reference: nowhere.png", "config: reference: nowhere.png: no such file; give the path of a PNG, JPEG, TIFF or .npy picture"),
    ],
)  # fmt: skip
def test_wrong_settings_end_in_one_line(project, overlay, line):
    (project.folder / "config/wrong.yaml").write_text(overlay + "\n")
    run = project.snakemake("--dry-run", "--configfile", "config/wrong.yaml")
    assert run.returncode != 0
    # Snakemake itself says first which profile and which files of settings it takes.
    assert run.stdout.splitlines()[2:] == [line]
