"""A study of some rules, which runs in seconds: what is packed and verified like the real one."""

from __future__ import annotations

from pathlib import Path

from keystab import __version__
from keystab.provenance.code_digest import fingerprint
from keystab.provenance.study_folder import Study

CODES = {name: fingerprint(f"keystab.figures.{name.lower()}") for name in ("fig1", "figS3")}
"""What the passports of its figures say about the code."""

SCHEMA = """
type: object
additionalProperties: false
properties:
  blur: {type: number, default: 1.1}
  seed: {type: number, default: 1}
  numbers: {type: array, items: {type: number}, default: []}
  reference: {type: string, default: config/scene.txt}
  predictors:
    type: object
    additionalProperties: false
    default: {}
    properties:
      pictures:
        type: object
        default: {}
        additionalProperties:
          type: object
          additionalProperties: false
          properties:
            path: {type: string, default: config/scene.txt}
  pictures: {type: array, items: {type: string}, default: []}
  results: {type: string, default: results}
  figures: {type: string, default: figures}
  logs: {type: string, default: logs}
"""

COMMON = """
import hashlib
LOCK = hashlib.sha256(Path(workflow.basedir, "environment.lock").read_bytes()).hexdigest()
RESULTS, FIGURES, LOGS = (config.get(key, key) for key in ("results", "figures", "logs"))
"""

SNAKEFILE = """
configfile: "config/config.yaml"
include: "workflow/rules/common.smk"

FINAL = expand(f"{FIGURES}/{{name}}.{{kind}}", name=["fig1", "figS3"], kind=["pdf", "png"])
FINAL += [f"{RESULTS}/tables/fig1.csv", f"{RESULTS}/tables/figS3.csv"]
FINAL += [f"{RESULTS}/claims.csv", f"{RESULTS}/claims.json", f"{RESULTS}/claims.md"]

rule all:
    input: *FINAL, f"{RESULTS}/final.sha256"

rule checksums:
    input: FINAL
    output: f"{RESULTS}/final.sha256"
    params: lock=LOCK
    log: f"{LOGS}/checksums.log"
    benchmark: f"{LOGS}/benchmarks/checksums.tsv"
    message: "Listing"
    shell: "sha256sum {input} >{output}"

rule views:
    input: config.get("reference", "config/scene.txt")
    output: store=directory(f"{RESULTS}/views/still"), seal=f"{RESULTS}/views/still.sha256"
    params: blur=config.get("blur", 1.1), lock=LOCK
    log: f"{LOGS}/views.log"
    benchmark: f"{LOGS}/benchmarks/views.tsv"
    message: "Taking views"
    shell: "python workflow/jobs.py views {output.store} {output.seal} {params.blur} {input} >{log} 2>&1"

rule keypoints:
    input: store=ancient(f"{RESULTS}/views/still"), seal=f"{RESULTS}/views/still.sha256"
    output: f"{RESULTS}/keypoints/still.csv"
    params: lock=LOCK
    log: f"{LOGS}/keypoints.log"
    benchmark: f"{LOGS}/benchmarks/keypoints.tsv"
    message: "Finding keypoints"
    shell: "cat {input.store}/a {input.store}/b >{output}"

rule table:
    input: f"{RESULTS}/keypoints/still.csv"
    output: f"{RESULTS}/tables/fig1.csv"
    params: seed=config.get("seed", 1), lock=LOCK
    log: f"{LOGS}/table.log"
    benchmark: f"{LOGS}/benchmarks/table.tsv"
    message: "Counting"
    shell: "cp {input} {output}"

rule blurs:
    output: f"{RESULTS}/tables/figS3.csv"
    params: seed=config.get("seed", 1), lock=LOCK
    log: f"{LOGS}/blurs.log"
    benchmark: f"{LOGS}/benchmarks/blurs.tsv"
    message: "Measuring"
    shell: "printf 'c,pitch,c_um\\n0.5,2.0,1.0\\n0.75,4.0,3.0\\n' >{output}"

rule claims:
    input:
        tables=[f"{RESULTS}/tables/fig1.csv", f"{RESULTS}/tables/figS3.csv"],
        claims=ancient("config/claims.yaml"),
    output: csv=f"{RESULTS}/claims.csv", json=f"{RESULTS}/claims.json", md=f"{RESULTS}/claims.md"
    params: tables=f"{RESULTS}/tables", lock=LOCK
    log: f"{LOGS}/claims.log"
    benchmark: f"{LOGS}/benchmarks/claims.tsv"
    message: "Judging"
    shell: "python -m keystab.stages.check_claims --claims {input.claims} --tables {input.tables} --csv {output.csv} --json {output.json} --markdown {output.md} >{log} 2>&1"

rule fig1:
    input: f"{RESULTS}/tables/fig1.csv"
    output: pdf=f"{FIGURES}/fig1.pdf", png=f"{FIGURES}/fig1.png"
    params: code=CODE_OF_fig1, lock=LOCK
    log: f"{LOGS}/fig1.log"
    benchmark: f"{LOGS}/benchmarks/fig1.tsv"
    message: "Drawing"
    shell: "python workflow/jobs.py draw {output} {params.code} {params.lock} {input} >{log} 2>&1"

use rule fig1 as figS3 with:
    input: f"{RESULTS}/tables/figS3.csv"
    output: pdf=f"{FIGURES}/figS3.pdf", png=f"{FIGURES}/figS3.png"
    params: code=CODE_OF_figS3, lock=LOCK
    log: f"{LOGS}/figS3.log"
    benchmark: f"{LOGS}/benchmarks/figS3.tsv"
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
- id: sharp
  where: section 2
  statement: All are sharp.
  figure: figS3
  paper: below 4
  value:
    most: {table: figS3, column: c_um, take: max}
  criterion: most < 4
"""

JOBS = '''
"""The jobs that a shell alone cannot do."""
import sys
from pathlib import Path

def views(store, seal, blur, scene):
    from keystab.io.checksums import write_checksums
    Path(store).mkdir(parents=True)
    Path(store, "a").write_text("n_spo,found\\n")
    Path(store, "b").write_text(f"3,{blur}\\n" + Path(scene).read_text())
    write_checksums(store, seal)

def draw(pdf, png, code, lock, table):
    from PIL import Image, PngImagePlugin
    from pypdf import PdfWriter
    from keystab.io.figure_metadata import PNG_KEY, FigureMetadata, digests_of
    name = Path(pdf).stem
    digests = digests_of([Path(table)])
    passport = FigureMetadata(name, "VERSION", code, lock, {"draft": "False"}, digests)
    writer = PdfWriter()
    writer.add_blank_page(9 + len(name), 9)
    writer.add_metadata({"/Keywords": passport.to_text()})
    writer.write(pdf)
    text = PngImagePlugin.PngInfo()
    text.add_text(PNG_KEY, passport.to_text())
    picture = Image.new("RGB", (40, 30), "white")
    picture.paste((0, 0, 99), (5, 5, 10 + len(name), 9))
    picture.save(png, pnginfo=text)

globals()[sys.argv[1]](*sys.argv[2:])
'''


def write(folder: Path) -> Study:
    """Write the study."""
    snakefile = SNAKEFILE
    for name, code in CODES.items():
        snakefile = snakefile.replace(f"CODE_OF_{name}", repr(code))
    files = {
        "Snakefile": snakefile,
        "workflow/rules/common.smk": COMMON,
        "workflow/schemas/config.schema.yaml": SCHEMA,
        "workflow/jobs.py": JOBS.replace("VERSION", __version__),
        "profiles/default/config.yaml": "show-failed-logs: true\n",
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
