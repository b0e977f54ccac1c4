"""Write the report of a finished run: one HTML file that needs no network.

python tools/report.py [--configfile FILE]    after `make study`; `make report` does both

It holds every figure with its caption, the verdicts on the paper's claims, what the jobs cost, what
the results were made from, and the graph of the workflow, for a reader who has nothing else.
Snakemake's own report has the same parts, but shows one figure at a time, without its caption, and
a graph of sixty rules as arcs.
"""

from __future__ import annotations

import base64
import csv
import importlib
import json
import os
import platform
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import jinja2
import yaml
from docutils.core import publish_parts
from rule_graph import drawn, edges_of

import keystab
from keystab.errors import InputError
from keystab.provenance.code_digest import fingerprint
from keystab.provenance.lineage import file_digest
from keystab.provenance.study_folder import Study
from keystab.study.overlays import names_of, on_command_line
from keystab.study.plan import FIGURES
from keystab.study.verdicts import VERDICTS
from keystab.utils.files import written_whole

ROOT = Path(__file__).parents[1]
PAGE = "page.html.jinja"


def caption(name: str, config: dict[str, Any]) -> str:
    """Caption of a figure in HTML, with the values of the settings."""
    text = (ROOT / f"workflow/report/{name}.rst").read_text()
    filled = jinja2.Template(text).render(snakemake=SimpleNamespace(config=config))
    return str(publish_parts(filled, writer="html5")["body"])


def figure(name: str, config: dict[str, Any], overlays: list[str]) -> dict[str, Any]:
    """All that the page says about a figure."""
    module = importlib.import_module(f"keystab.figures.{name.lower()}")
    tables = [ROOT / config["results"] / "tables" / table for table in module.TABLES]
    png = ROOT / config["figures"] / f"{name}.png"
    of_make = on_command_line([] if overlays == ["config/quick.yaml"] else overlays, make=True)
    return {
        "name": name,
        "title": (module.__doc__ or name).splitlines()[0].rstrip("."),
        "png": base64.b64encode(png.read_bytes()).decode(),
        "caption": caption(name, config),
        "code": fingerprint(module.__name__),
        "tables": [(table.name, file_digest(table)) for table in tables],
        "command": f"make {config['figures']}/{name}.pdf{of_make}",
    }


def claims(config: dict[str, Any]) -> list[dict[str, Any]]:
    """The claims, verdict by verdict."""
    listed = json.loads((ROOT / config["results"] / "claims.json").read_text())
    return sorted(listed, key=lambda claim: list(VERDICTS).index(claim["verdict"]))


def numbers(claim: dict[str, Any]) -> list[str]:
    """Numbers of a claim, with their intervals."""
    lines = []
    for name, value in claim["value"].items():
        line = f"{name} {value:.4g}" if isinstance(value, float) else f"{name} {value}"
        if interval := claim["interval"].get(name):
            line += " ({:.3g} to {:.3g})".format(*interval)
        lines.append(line)
    return lines


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


def main(arguments: list[str]) -> int:
    """Write {results}/report.html."""
    overlays = [argument for argument in arguments if argument != "--configfile"]
    try:
        study = Study(ROOT, overlays)
        if study.to_do():
            sys.exit("error: the study is not finished with these settings; run make study first")
        graph = edges_of(study.snakemake("--rulegraph=dot", output_only=True))
    except InputError as problem:
        sys.exit(f"error: {problem}")
    config = study.settings
    listed = claims(config)
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(ROOT / "workflow/report"), autoescape=True
    )
    environment.filters["numbers"] = numbers
    html = environment.get_template(PAGE).render(
        version=keystab.__version__,
        draft=config["draft"],
        picture=config["reference"],
        overlays=names_of(ROOT.resolve(), ["config/config.yaml", *overlays]),
        figures=[figure(name, config, overlays) for name in FIGURES],
        claims=listed,
        verdicts={name: sum(one["verdict"] == name for one in listed) for name in VERDICTS},
        graph=drawn(graph, {*FIGURES, "claims"}),
        costs=costs(ROOT / config["logs"]),
        machine=f"{os.cpu_count()} cores ({platform.machine()}), {platform.system()}, "
        f"Python {platform.python_version()}",
        made_from=[
            ("settings, complete, as JSON", study.settings_digest),
            ("environment.lock", study.lock_digest),
            (config["reference"], file_digest(ROOT / config["reference"])),
            ("config/claims.yaml", file_digest(ROOT / "config/claims.yaml")),
        ],
        settings=yaml.safe_dump(config, sort_keys=False, default_flow_style=None, width=100),
    )
    path = ROOT / config["results"] / "report.html"
    with written_whole(path) as part:
        part.write_text(html, encoding="utf-8")
    print(f"{path.relative_to(ROOT)}: {path.stat().st_size / 1e6:.1f} MB; open it in any browser")
    return 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
