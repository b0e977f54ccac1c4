"""Write the report of a finished run: one HTML file that needs no network.

python tools/report.py [--configfile FILE]    after `make study`; `make report` does both

For a reviewer with ten minutes: verdicts first, those not reproduced on top; then every figure with
its caption and, beside it, the claims about it; then what the jobs cost, what the results were made
from, all settings, and the graph of the workflow. What is named in settings and results may come
from a stranger: all of it is escaped, and the page allows no script but its own.
"""

from __future__ import annotations

import base64
import csv
import datetime
import hashlib
import importlib
import io
import json
import os
import platform
import re
import struct
import subprocess
import sys
from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import jinja2
import numpy as np
import yaml
from docutils.core import publish_parts
from PIL import Image
from report_words import origin, said, shown, words
from rule_graph import drawn, edges_of

import keystab
from keystab.errors import InputError
from keystab.provenance.code_digest import fingerprint
from keystab.provenance.lineage import file_digest
from keystab.provenance.study_folder import Study
from keystab.study.claims import Claim, read_claims
from keystab.study.overlays import names_of, on_command_line
from keystab.study.plan import FIGURES
from keystab.utils.files import written_whole

ROOT = Path(__file__).parents[1]
PARTS = ROOT / "workflow/report"

ORDER = (
    "not reproduced",
    "undecided",
    "reproduced with a condition",
    "reproduced",
    "not testable",
)
"""Verdicts, those first that a reviewer looks for."""

THUMBNAIL = 440
"""Pixels: the longer side of the picture at the top."""

_SPECIAL = re.compile(r"([\\`*_|<>:])")
_DOCUTILS = {"raw_enabled": False, "file_insertion_enabled": False, "_disable_config": True}


def plain(value: Any) -> Any:
    r"""Text of a setting as reStructuredText that means itself, whoever wrote it.

    Examples
    --------
    >>> plain("a*b\n.. raw:: html"), plain(0.5)
    ('a\\*b .. raw\\:\\: html', 0.5)
    """
    return _SPECIAL.sub(r"\\\1", " ".join(value.split())) if isinstance(value, str) else value


def caption(name: str, config: Mapping[str, Any]) -> str:
    """Caption of a figure in HTML, with the values of the settings."""
    template = jinja2.Environment(finalize=plain).from_string((PARTS / f"{name}.rst").read_text())
    filled = template.render(snakemake=SimpleNamespace(config=config))
    return str(publish_parts(filled, writer="html5", settings_overrides=_DOCUTILS)["body"])


def figure(
    name: str, config: Mapping[str, Any], claims: Sequence[Mapping[str, Any]], typed: str
) -> Any:
    """All that the page says about a figure."""
    module = importlib.import_module(f"keystab.figures.{name.lower()}")
    tables = [ROOT / config["results"] / "tables" / table for table in module.TABLES]
    png = (ROOT / config["figures"] / f"{name}.png").read_bytes()
    size = struct.unpack(">II", png[16:24]) if png.startswith(b"\x89PNG") else None
    return {
        "name": name,
        "title": (module.__doc__ or name).splitlines()[0].rstrip("."),
        "png": base64.b64encode(png).decode(),
        "size": size,
        "caption": caption(name, config),
        "code": fingerprint(module.__name__),
        "tables": [(table.name, file_digest(table)) for table in tables],
        "command": f"make {config['figures']}/{name}.pdf{typed}",
        "claims": [claim for claim in claims if claim["figure"] == name],
    }


def in_order(claims: Iterable[Mapping[str, Any]]) -> list[Mapping[str, Any]]:
    """Claims verdict by verdict, those not reproduced first.

    Examples
    --------
    >>> [one["verdict"] for one in in_order([{"verdict": "reproduced"}, {"verdict": "undecided"}])]
    ['undecided', 'reproduced']
    """
    return sorted(claims, key=lambda claim: ORDER.index(claim["verdict"]))


def numbers(
    claim: Mapping[str, Any], known: Mapping[str, Claim], only_deciding: bool = False
) -> list[dict[str, str]]:
    """Numbers of a claim in words, with their intervals and what they are."""
    about = known.get(claim["id"])
    parts = {part.name: part for part in about.quantities} if about else {}
    names = list(claim["value"])
    if only_deciding:
        asked = set(re.findall(r"[A-Za-z_]\w*", claim["criterion"] or ""))
        names = [name for name in names if name in asked]
    lines = []
    for name in names:
        text = shown(claim["value"][name])
        if interval := claim["interval"].get(name):
            low, high = map(shown, interval)
            text += f" ({low} to {high})"
        where = origin(parts[name]) if name in parts else ""
        lines.append({"words": words(name), "value": text, "origin": where})
    return lines


def level(p: float) -> str:
    """Level at which a verdict is decided, for people.

    Examples
    --------
    >>> level(0.0312), level(1e-9)
    ('p = 0.031', 'p < 0.001')
    """
    return "p < 0.001" if p < 1e-3 else f"p = {p:.2g}"


def costs(logs: Path) -> list[dict[str, Any]]:
    """Jobs, seconds and largest memory of every rule, from the benchmark records."""
    rules: dict[str, list[dict[str, str]]] = {}
    for record in sorted((logs / "benchmarks").rglob("*.tsv")):
        parts = record.relative_to(logs / "benchmarks").parts
        name = parts[2 if parts[0] == "scenes" else 0].removesuffix(".tsv")  # of scenes/NAME/
        with record.open() as lines:
            rules.setdefault(name, []).extend(csv.DictReader(lines, delimiter="\t"))
    rows = [
        {
            "rule": name,
            "jobs": len(records),
            "seconds": sum(float(record["s"]) for record in records),
            "memory": max((number(record["max_rss"]) for record in records), default=0.0),
        }
        for name, records in rules.items()
    ]
    return sorted(rows, key=lambda row: -row["seconds"])


def number(text: str) -> float:
    """Number of a record; jobs that ended at once have none."""
    try:
        return float(text)
    except ValueError:
        return 0.0


def picture(config: Mapping[str, Any]) -> dict[str, str]:
    """Name of the picture that was studied, its size, and a small copy, where there is one."""
    from keystab.io.pictures import read_picture

    name = config.get("reference")
    if not name:
        return {"name": "no picture", "size": "", "png": ""}
    pixels = read_picture(ROOT / name)
    step = -(-max(pixels.shape) // THUMBNAIL)
    height, width = (n // step * step for n in pixels.shape)
    small = pixels[:height, :width].reshape(height // step, step, width // step, step)
    grey = np.clip(255 * small.mean(axis=(1, 3)) + 0.5, 0, 255).astype(np.uint8)
    file = io.BytesIO()
    Image.fromarray(grey).save(file, "PNG", optimize=True)
    size = f"{pixels.shape[1]} x {pixels.shape[0]} pixels"
    return {"name": str(name), "size": size, "png": base64.b64encode(file.getvalue()).decode()}


def commit() -> str:
    """Commit of the project's folder, and whether files differ from it."""
    said_by_git = []
    for command in ("rev-parse --show-toplevel", "rev-parse HEAD", "status --porcelain -uno"):
        try:
            run = subprocess.run(
                ["git", *command.split()], cwd=ROOT, capture_output=True, text=True
            )
        except OSError:
            return "unknown, git is not installed"
        if run.returncode:
            return "unknown, no repository"
        said_by_git.append(run.stdout.strip())
    top, head, changed = said_by_git
    if Path(top) != ROOT.resolve():  # a copy of the project inside of another one's repository
        return "unknown, no repository"
    return head + (", with changes" if changed else "")


def facts(
    config: Mapping[str, Any], overlays: Sequence[str], about: Mapping[str, str], when: float
) -> list[tuple[str, str]]:
    """What a reviewer asks first of a run: when, which code, which picture, which settings."""
    day = datetime.datetime.fromtimestamp(when, datetime.UTC)
    samplings = config["samplings"]["n_spo"]
    files = ", ".join(names_of(ROOT.resolve(), ["config/config.yaml", *overlays]))
    return [
        ("Verdicts of", f"{day:%Y-%m-%d %H:%M} UTC"),
        ("Version", f"keystab {keystab.__version__}"),
        ("Commit", commit()),
        ("Picture", f"{about['name']}, {about['size']}" if about["size"] else about["name"]),
        ("Settings", files),
        ("Samplings", f"n_spo = {min(samplings)} to {max(samplings)}, {len(samplings)} of them"),
    ]


def page(config: Mapping[str, Any], overlays: Sequence[str], made_from: Any, edges: Any) -> str:
    """The page, from the files of a finished run."""
    path = ROOT / config["results"] / "claims.json"
    typed = on_command_line([] if overlays == ["config/quick.yaml"] else overlays, make=True)
    claims = in_order(json.loads(path.read_text(encoding="utf-8")))
    known = {claim.id: claim for claim in read_claims(ROOT / "config/claims.yaml")}
    about = picture(config)
    script = (PARTS / "page.js").read_text()
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(PARTS), autoescape=True, undefined=jinja2.StrictUndefined
    )
    environment.filters |= {
        "numbers": lambda claim, deciding=False: numbers(claim, known, deciding),
        "said": said,
        "level": level,
    }
    return environment.get_template("page.html.jinja").render(
        script=script,
        script_digest=f"sha256-{digest}",
        style=(PARTS / "page.css").read_text(),
        draft=config["draft"],
        picture=about,
        facts=facts(config, overlays, about, path.stat().st_mtime),
        figures=[figure(name, config, claims, typed) for name in FIGURES],
        shown=set(FIGURES),
        groups=[(name, [one for one in claims if one["verdict"] == name]) for name in ORDER],
        without_figure=[claim for claim in claims if claim["figure"] not in FIGURES],
        graph=drawn(edges, {*FIGURES, "claims"}),
        costs=costs(ROOT / config["logs"]),
        machine=f"{os.cpu_count()} cores ({platform.machine()}), {platform.system()}, "
        f"Python {platform.python_version()}",
        made_from=made_from,
        settings=yaml.safe_dump(config, sort_keys=False, default_flow_style=None, width=100),
    )


def main(arguments: list[str]) -> int:
    """Write {results}/report.html."""
    overlays = [argument for argument in arguments if argument != "--configfile"]
    try:
        study = Study(ROOT, overlays)
        with ThreadPoolExecutor() as both:  # Snakemake is asked twice, at the same time
            graph = both.submit(study.snakemake, "--rulegraph=dot", output_only=True)
            left = study.to_do()
        if left:
            sys.exit("error: the study is not finished with these settings; run make study first")
        edges = edges_of(graph.result())
    except InputError as problem:
        sys.exit(f"error: {problem}")
    config = study.settings
    made_from = [
        ("settings, complete, as JSON", study.settings_digest),
        ("environment.lock", study.lock_digest),
        (config["reference"], file_digest(ROOT / config["reference"])),
        ("config/claims.yaml", file_digest(ROOT / "config/claims.yaml")),
    ]
    path = ROOT / config["results"] / "report.html"
    with written_whole(path) as part:
        part.write_text(page(config, overlays, made_from, edges), encoding="utf-8")
    print(f"{path.relative_to(ROOT)}: {path.stat().st_size / 1e6:.1f} MB; open it in any browser")
    return 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
