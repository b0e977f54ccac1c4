"""The RO-Crate of an archive: what is in it, in the vocabulary that repositories read.

It follows RO-Crate 1.1 and the profile Workflow Run Crate 0.5: the workflow, the run of it, what
went in and what came out (https://w3id.org/ro/wfrun/workflow/0.5).
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from pathlib import PurePosixPath
from typing import Any, NamedTuple
from urllib.parse import quote

__all__ = ["Item", "crate_text"]

_CONTEXT = [
    "https://w3id.org/ro/crate/1.1/context",
    {"sha256": "https://w3id.org/ro/terms/workflow-run#sha256"},
]
_PROFILES = {
    "https://w3id.org/ro/wfrun/process/0.5": ("Process Run Crate", "0.5"),
    "https://w3id.org/ro/wfrun/workflow/0.5": ("Workflow Run Crate", "0.5"),
    "https://w3id.org/workflowhub/workflow-ro-crate/1.0": ("Workflow RO-Crate", "1.0"),
}
_FORMATS = {
    ".csv": "text/csv",
    ".html": "text/html",
    ".json": "application/json",
    ".md": "text/markdown",
    ".parquet": "application/vnd.apache.parquet",
    ".pdf": "application/pdf",
    ".png": "image/png",
    ".py": "text/x-python",
    ".tsv": "text/tab-separated-values",
    ".yaml": "application/yaml",
}
_LICENSE = "https://spdx.org/licenses/MIT"
_BIOSCHEMAS = "https://bioschemas.org/profiles/ComputationalWorkflow/1.0-RELEASE"
_WORKFLOW = "Snakefile"


class Item(NamedTuple):
    """One file of the archive: its bytes are `size` many and have the digest `sha256`."""

    size: int
    sha256: str


def crate_text(
    items: Mapping[str, Item],
    inputs: Sequence[str],
    results: Sequence[str],
    version: str,
    snakemake: str,
    date: str,
    words: Mapping[str, str],
) -> str:
    """Write ``ro-crate-metadata.json``.

    Parameters
    ----------
    items : mapping from path to Item
        All files of the archive that are to be described.
    inputs, results : sequence of str
        Those of them that the run took in and gave out.
    version, snakemake : str
        Version of keystab, and of Snakemake.
    date : str
        Day on which the run ended, as in 2026-01-31.
    words : mapping from path to str
        What files are, where that can be said in a few words.

    Returns
    -------
    str
        JSON; the same arguments give the same text.
    """
    graph: list[dict[str, Any]] = [
        {
            "@id": "ro-crate-metadata.json",
            "@type": "CreativeWork",
            "about": {"@id": "./"},
            "conformsTo": [
                {"@id": "https://w3id.org/ro/crate/1.1"},
                {"@id": "https://w3id.org/workflowhub/workflow-ro-crate/1.0"},
            ],
        },
        {
            "@id": "./",
            "@type": "Dataset",
            "name": f"keystab {version}: the stability of scale-space extrema, a finished run",
            "description": "Figures, tables and verdicts of a reproducible study of keypoint "
            "stability, with the code, settings and software versions that made them. "
            "ARCHIVE.md says how to check it and what is left out.",
            "datePublished": date,
            "license": {"@id": _LICENSE},
            "author": {"@id": "#authors"},
            "publisher": {"@id": "#authors"},
            "conformsTo": _references(_PROFILES),
            "mainEntity": {"@id": _WORKFLOW},
            "mentions": {"@id": "#run"},
            "hasPart": _references(map(_identifier, items)),
        },
        {
            "@id": "#run",
            "@type": "CreateAction",
            "name": f"Run of the study with Snakemake {snakemake}",
            "description": "Every job of it, with command, settings and digests of its inputs, is "
            "described in .snakemake/metadata; what it cost, in the files named *.tsv.",
            "instrument": {"@id": _WORKFLOW},
            "object": _references(map(_identifier, inputs)),
            "result": _references(map(_identifier, results)),
            "agent": {"@id": "#authors"},
            "endTime": date,
            "actionStatus": "http://schema.org/CompletedActionStatus",
        },
        {"@id": "#authors", "@type": "Organization", "name": "The keystab authors"},
        {
            "@id": "#snakemake",
            "@type": "ComputerLanguage",
            "name": "Snakemake",
            "alternateName": "Snakemake",
            "identifier": {"@id": "https://doi.org/10.1093/bioinformatics/bts480"},
            "url": {"@id": "https://snakemake.readthedocs.io"},
            "version": snakemake,
        },
        {
            "@id": _LICENSE,
            "@type": "CreativeWork",
            "name": "MIT License",
            "identifier": "https://spdx.org/licenses/MIT",
        },
    ]
    for identifier, (name, number) in _PROFILES.items():
        graph.append({"@id": identifier, "@type": "CreativeWork", "name": name, "version": number})
    graph += [_file(path, item, words.get(path), version) for path, item in sorted(items.items())]
    return json.dumps({"@context": _CONTEXT, "@graph": graph}, indent=1) + "\n"


def _file(path: str, item: Item, words: str | None, version: str) -> dict[str, Any]:
    suffix = PurePosixPath(path).suffix
    entity: dict[str, Any] = {
        "@id": _identifier(path),
        "@type": "File",
        "name": path,
        "contentSize": str(item.size),
        "sha256": item.sha256,
        "encodingFormat": _FORMATS.get(suffix, "text/plain"),
    }
    if words:
        entity["description"] = words
    if path == "README.md":
        entity["about"] = {"@id": "./"}
    if path == _WORKFLOW:
        entity |= {
            "@type": ["File", "SoftwareSourceCode", "ComputationalWorkflow"],
            "conformsTo": {"@id": _BIOSCHEMAS},
            "name": "keystab: the stability of scale-space extrema",
            "programmingLanguage": {"@id": "#snakemake"},
            "license": {"@id": _LICENSE},
            "version": version,
        }
    return entity


def _identifier(path: str) -> str:
    """A path as a relative URI."""
    return quote(path)


def _references(identifiers: Iterable[str]) -> list[dict[str, str]]:
    return [{"@id": identifier} for identifier in identifiers]
