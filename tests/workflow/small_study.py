"""A study of six rules, which runs in seconds: what is packed and verified like the real one."""

from __future__ import annotations

from pathlib import Path

from keystab.provenance.study_folder import Study

SCHEMA = """
type: object
additionalProperties: false
properties:
  blur: {type: number, default: 1.1}
  seed: {type: number, default: 1}
  results: {type: string, default: results}
  figures: {type: string, default: figures}
  logs: {type: string, default: logs}
"""

SNAKEFILE = """
import hashlib
configfile: "config/config.yaml"
LOCK = hashlib.sha256(Path(workflow.basedir, "environment.lock").read_bytes()).hexdigest()

FINAL = ["figures/fig1.pdf", "figures/fig1.png", "results/tables/fig1.csv"]
FINAL += ["results/claims.csv", "results/claims.json", "results/claims.md"]

rule all:
    input: *FINAL, "results/final.sha256"

rule checksums:
    input: FINAL
    output: "results/final.sha256"
    params: lock=LOCK
    log: "logs/checksums.log"
    benchmark: "logs/benchmarks/checksums.tsv"
    message: "Listing"
    shell: "sha256sum {input} >{output}"

rule views:
    input: "config/scene.txt"
    output: store=directory("results/views/still"), checksums="results/views/still.sha256"
    params: blur=config["blur"], lock=LOCK
    log: "logs/views.log"
    benchmark: "logs/benchmarks/views.tsv"
    message: "Taking views"
    shell: "python workflow/jobs.py views {output.store} {output.checksums} {params.blur} {input} >{log} 2>&1"

rule keypoints:
    input: store=ancient("results/views/still"), checksums="results/views/still.sha256"
    output: "results/keypoints/still.csv"
    params: lock=LOCK
    log: "logs/keypoints.log"
    benchmark: "logs/benchmarks/keypoints.tsv"
    message: "Finding keypoints"
    shell: "cat {input.store}/a {input.store}/b >{output}"

rule table:
    input: "results/keypoints/still.csv"
    output: "results/tables/fig1.csv"
    params: seed=config["seed"], lock=LOCK
    log: "logs/table.log"
    benchmark: "logs/benchmarks/table.tsv"
    message: "Counting"
    shell: "cp {input} {output}"

rule claims:
    input: tables="results/tables/fig1.csv", claims=ancient("config/claims.yaml")
    output: csv="results/claims.csv", json="results/claims.json", md="results/claims.md"
    params: lock=LOCK
    log: "logs/claims.log"
    benchmark: "logs/benchmarks/claims.tsv"
    message: "Judging"
    shell: "python -m keystab.stages.check_claims --claims {input.claims} --tables {input.tables} --csv {output.csv} --json {output.json} --markdown {output.md} >{log} 2>&1"

rule fig1:
    input: "results/tables/fig1.csv"
    output: pdf="figures/fig1.pdf", png="figures/fig1.png"
    params: code=CODE, lock=LOCK
    log: "logs/fig1.log"
    benchmark: "logs/benchmarks/fig1.tsv"
    message: "Drawing"
    shell: "python workflow/jobs.py fig1 {output} {params.code} {params.lock} {input} >{log} 2>&1"
"""

CLAIMS = """
- id: few
  where: section 1
  statement: Few are found.
  figure: fig1
  paper: few
  value:
    most: {table: fig1, column: found, take: max}
  criterion: most < 2
- id: many
  where: section 1
  statement: Many are found.
  figure: fig1
  paper: many
  value:
    most: {table: fig1, column: found, take: max}
  criterion: most > 2
"""

JOBS = '''
"""The jobs that a shell alone cannot do."""
import sys
from pathlib import Path

def views(store, checksums, blur, scene):
    from keystab.io.checksums import write_checksums
    Path(store).mkdir(parents=True)
    Path(store, "a").write_text("n_spo,found\\n")
    Path(store, "b").write_text(f"3,{blur}\\n" + Path(scene).read_text())
    write_checksums(store, checksums)

def fig1(pdf, png, code, lock, table):
    from PIL import Image, PngImagePlugin
    from pypdf import PdfWriter
    from keystab.io.figure_metadata import PNG_KEY, FigureMetadata, digests_of
    metadata = FigureMetadata("fig1", "0", code, lock, {"draft": "False"}, digests_of([Path(table)]))
    writer = PdfWriter()
    writer.add_blank_page(9, 9)
    writer.add_metadata({"/Keywords": metadata.to_text()})
    writer.write(pdf)
    text = PngImagePlugin.PngInfo()
    text.add_text(PNG_KEY, metadata.to_text())
    Image.new("L", (9, 9)).save(png, pnginfo=text)

globals()[sys.argv[1]](*sys.argv[2:])
'''


def write(folder: Path, code: str) -> Study:
    """Write the study; `code` is what its figure's metadata says about the code."""
    files = {
        "Snakefile": SNAKEFILE.replace("CODE", repr(code)),
        "workflow/schemas/config.schema.yaml": SCHEMA,
        "workflow/jobs.py": JOBS,
        "config/config.yaml": "blur: 1.1\nseed: 1\nfigures: figures\n",
        "config/scene.txt": "5,0.25\n7,\n",
        "config/claims.yaml": CLAIMS,
        "environment.lock": "numpy==2\n",
        "LICENSE": "free\n",
    }
    for name, text in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text)
    return Study(folder)
