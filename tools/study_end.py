"""What the study says when it has ended: what was found, where it lies, what to type next."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from keystab.study.verdicts import VERDICTS

SHOWN = 3
"""Claims that are named, of those that do not hold."""

LONGEST = 200
"""Letters of a line about one job; Snakemake's lists of files run to thousands."""


def short(line: str) -> str:
    r"""Line of Snakemake about the files of a job, cut where it is long.

    Examples
    --------
    >>> short("Reason: Input files updated by another job: " + "results/a.csv, " * 40 + "b\n")[-28:]
    'a.csv and 31 more of a list\n'
    >>> short("Finished jobid: 3 (Rule: fig1)\n")
    'Finished jobid: 3 (Rule: fig1)\n'
    """
    is_list = line.lstrip().lower().startswith(("reason:", "input:", "output:"))
    if not is_list or len(line) <= LONGEST:
        return line
    end = line.rfind(", ", 0, LONGEST)
    return f"{line[:end]} and {line.count(', ', end)} more of a list\n" if end > 0 else line


def ending(settings: Mapping[str, Any], folder: Path = Path()) -> str:
    """Verdicts of a finished study, and where they lie; nothing where there are none.

    Parameters
    ----------
    settings : mapping
        Complete settings of the run.
    folder : path, optional
        Folder that relative paths in them start from.

    Returns
    -------
    str
        Lines: the number of claims by verdict, those that fail most clearly, files and commands.
    """
    results, figures = str(settings["results"]), str(settings["figures"])
    try:
        claims = json.loads((folder / results / "claims.json").read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return ""
    counts = Counter(claim["verdict"] for claim in claims)
    head = "Verdicts of a draft, on" if settings.get("draft") else "Verdicts on"
    picture = settings.get("reference", "no picture")  # a study of theory has none
    said = ", ".join(f"{counts[name]} {name}" for name in VERDICTS if counts[name])
    lines = ["", f"{head} {picture}: {said}."]
    lines += [
        f"  {claim['id']}: {claim['statement']} ({claim['verdict']})" for claim in clearest(claims)
    ]
    lines += [
        f"All verdicts: {results}/claims.md. Figures: {figures}/*.pdf. Numbers: {results}/tables.",
        "Next: make report (all in one page), make verify (check it), make archive (pack it).",
    ]
    return "\n".join(lines) + "\n"


def clearest(claims: Sequence[Mapping[str, Any]]) -> list[Mapping[str, Any]]:
    """Claims that do not hold at the smallest levels, and after these those that are exact."""
    failed = [claim for claim in claims if claim["verdict"] == "not reproduced"]
    return sorted(failed, key=lambda claim: 1.0 if claim["p"] is None else claim["p"])[:SHOWN]
