"""What the study says when it has ended: what was found, where it lies, what to type next."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from keystab.study.overlays import on_command_line
from keystab.study.result_folders import normal_folder
from keystab.study.verdicts import VERDICTS

DRAFT = "config/quick.yaml"
"""Settings that make a draft of any study."""

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


def ending(settings: Mapping[str, Any], folder: Path = Path(), overlays: Sequence[str] = ()) -> str:
    """Verdicts of a finished study, and where they lie; nothing where there are none.

    Parameters
    ----------
    settings : mapping
        Complete settings of the run.
    folder : path, optional
        Folder that relative paths in them start from.
    overlays : sequence of str, optional
        Files of settings of the run, as they were typed.

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
    draft = bool(settings.get("draft"))
    picture = settings.get("reference", "no picture")  # a study of theory has none
    said = ", ".join(f"{counts[name]} {name}" for name in VERDICTS if counts[name])
    lines = ["", f"Verdicts{' of a draft' if draft else ''} on {picture}: {said}."]
    if surprising := clearest(claims):
        lines.append(
            "Most surprising, what the paper says and this run most clearly does not find:"
        )
    lines += [f"  {claim['id']}: {claim['statement']}" for claim in surprising]
    lines += [
        f"All verdicts: {results}/claims.md. Figures: {figures}/*.pdf. Numbers: {results}/tables.",
        f"Next: {what_next(overlays, draft)}",
    ]
    return "\n".join(lines) + "\n"


def what_next(overlays: Sequence[str], draft: bool) -> str:
    """What to type after a finished study: after a draft the study, else what is made of it.

    Examples
    --------
    >>> what_next(["config/quick.yaml"], draft=True)
    'make study (the same in full; this was a draft)'
    >>> what_next(["config/quick.yaml", "my.yaml"], draft=True)
    'make study WITH=my.yaml (the same in full; this was a draft)'
    >>> print(what_next(["my.yaml"], draft=False))
    make report WITH=my.yaml (all on one page)
      make verify WITH=my.yaml (check it)
      make archive WITH=my.yaml (pack it)
    """
    if draft:
        full = [name for name in overlays if normal_folder(name) != DRAFT]
        more = on_command_line(full, make=True)
        return f"make study{more} (the same in full; this was a draft)"
    more = on_command_line(overlays, make=True)
    tasks = {"report": "all on one page", "verify": "check it", "archive": "pack it"}
    commands = [f"make {task}{more} ({does})" for task, does in tasks.items()]
    return ("\n  " if more else ", ").join(commands)


def clearest(claims: Sequence[Mapping[str, Any]]) -> list[Mapping[str, Any]]:
    """Claims that do not hold at the smallest levels, and after these those that are exact."""
    failed = [claim for claim in claims if claim["verdict"] == "not reproduced"]
    return sorted(failed, key=lambda claim: 1.0 if claim["p"] is None else claim["p"])[:SHOWN]
