"""Verdicts on claims from several pictures side by side: which of them depend on the picture.

Each picture has a study of its own, laid out by an overlay of the settings, and verdicts in its
folder of results. `side_by_side` puts them into one table; criteria must be the same in all.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from keystab.errors import InputError
from keystab.study import settings
from keystab.study.claims_report import FIELDS, cell
from keystab.study.result_folders import normal_folder
from keystab.study.verdicts import UNDECIDED, UNTESTED, VERDICTS

if TYPE_CHECKING:
    import pandas as pd

__all__ = [
    "Source",
    "finished",
    "missing",
    "read_report",
    "run_of",
    "runs_table",
    "side_by_side",
    "sources",
    "to_markdown",
]

#: What the table says of each picture, after the picture's name and an underscore.
OF_PICTURE = ("verdict", "value", "interval")

#: What it says of each claim, before.
OF_CLAIM = ("id", "where", "statement", "paper", "criterion", "depends")


class Source(NamedTuple):
    """Where the verdicts of a picture come from.

    Parameters
    ----------
    name : str
        Name of the picture: that of its file, without suffix and with _ for what is no letter.
    report : str
        Path of the table of verdicts.
    overlay : str
        File of settings that a run needs to make it.
    """

    name: str
    report: str
    overlay: str


def sources(base: Path | str, overlays: Sequence[Path | str]) -> list[Source]:
    """Verdicts that studies of several pictures give.

    Parameters
    ----------
    base : path
        File of all settings.
    overlays : sequence of path
        What each picture lays over it; `base` itself for the picture that it names.

    Raises
    ------
    InputError
        If a file cannot be read, or two of them share the name of the picture or the results.
    """
    found: list[Source] = []
    for overlay in overlays:
        given = settings.read_yaml(base, overlay)
        name = re.sub(r"\W+", "_", Path(given["reference"]).stem)
        source = Source(name, f"{normal_folder(given['results'])}/claims.csv", str(overlay))
        for other in found:
            for what in ("name", "report"):
                if getattr(source, what) == getattr(other, what):
                    raise InputError(
                        f"{other.overlay} and {source.overlay} have the same {what}, "
                        f"{getattr(source, what)}: give every picture a name and results of its own"
                    )
        found.append(source)
    return found


def missing(found: Sequence[Source], made: str) -> list[str]:
    """One line for every report that does not exist and is not made now, with what makes it.

    Parameters
    ----------
    found : sequence of Source
        Reports that are wanted.
    made : str
        Path of the one that is made in this run.
    """
    return [
        f"{source.report} is missing; make it first: "
        f"make {Path(source.report).with_suffix('.md')} WITH={source.overlay}"
        for source in found
        if source.report != made and not Path(source.report).is_file()
    ]


def finished(base: Path | str, overlays: Sequence[Path | str], made: str) -> list[Source]:
    """Reports of studies of several pictures, all of them there or made in this run.

    Each picture has settings of its own, and so a run of its own.

    Raises
    ------
    InputError
        As `sources`, and if a report is `missing`.
    """
    found = sources(base, overlays)
    problems = missing(found, made)
    if problems:
        raise InputError("\n".join(problems))
    return found


def read_report(path: Path | str) -> pd.DataFrame:
    """Read a table of `keystab.study.claims_report.write_report`; empty texts are ''.

    Raises
    ------
    InputError
        As `keystab.io.tables.read_table`.
    """
    from keystab.io.tables import read_table

    return read_table(path, FIELDS).astype(object).fillna("").astype(str)


def run_of(report: Path | str) -> str:
    """Picture, settings and version of the run that made a report, as its `claims.md` says them.

    Parameters
    ----------
    report : path
        Table of verdicts. What `keystab.study.claims_report.heading` wrote stands beside it.

    Returns
    -------
    str
        That line; "not recorded" where there is none.
    """
    beside = Path(report).with_suffix(".md")
    lines = beside.read_text(encoding="utf-8").splitlines() if beside.is_file() else []
    said = (line for line in lines if line.removeprefix("*Draft.* ").startswith("Picture: "))
    return next(said, "not recorded")


def runs_table(what: str, runs: Mapping[str, str]) -> list[str]:
    """Lines of a table that says which run (`run_of`) each picture or scene has.

    Examples
    --------
    >>> runs_table("scene", {"lake": "Picture: `lake.png`."})
    ['| scene | run |', '|---|---|', '| lake | Picture: `lake.png`. |']
    """
    lines = [f"| {name} | {cell(run)} |" for name, run in runs.items()]
    return [f"| {what} | run |", "|---|---|", *lines]


def side_by_side(reports: Mapping[str, pd.DataFrame]) -> pd.DataFrame:
    """One row per claim, with its verdict and numbers for every picture.

    Parameters
    ----------
    reports : mapping
        Report of each picture, see `keystab.study.claims_report.to_table`, in the order of the
        columns.

    Returns
    -------
    DataFrame
        ``id, where, statement, paper, criterion``; ``depends``, yes where verdicts that are
        decided differ and else no; and ``NAME_verdict, NAME_value, NAME_interval`` for every
        picture NAME. Claims are in the order of the first report.

    Raises
    ------
    InputError
        If there are fewer than two pictures, if one of them lacks a claim that another has, or if
        a claim was not asked with the same criterion.

    Examples
    --------
    >>> import pandas as pd
    >>> one = pd.DataFrame([dict.fromkeys(FIELDS, "") | {"id": "few", "verdict": "reproduced"}])
    >>> table = side_by_side({"hill": one, "lake": one.assign(verdict="not reproduced")})
    >>> table[["id", "depends", "hill_verdict", "lake_verdict"]].values.tolist()
    [['few', 'yes', 'reproduced', 'not reproduced']]
    >>> side_by_side({"hill": one, "lake": one[:0]})
    Traceback (most recent call last):
    keystab.errors.InputError: lake: its report lacks few; make all from one config/claims.yaml
    """
    import pandas as pd

    if len(reports) < 2:
        raise InputError("reports of two pictures or more are needed to compare")
    every = list(dict.fromkeys(name for report in reports.values() for name in report["id"]))
    together = "make all from one config/claims.yaml"
    for picture, report in reports.items():
        lacking = [name for name in every if name not in set(report["id"])]
        if lacking:
            raise InputError(f"{picture}: its report lacks {', '.join(lacking)}; {together}")
    ordered = {name: report.set_index("id").loc[every] for name, report in reports.items()}
    first, *others = ordered
    for other in others:
        differ = ordered[first]["criterion"] != ordered[other]["criterion"]
        if differ.any():
            raise InputError(
                f"{first} and {other} were asked different criteria for "
                f"{', '.join(differ[differ].index)}; {together}"
            )
    verdicts = pd.DataFrame({name: report["verdict"] for name, report in ordered.items()})
    table = ordered[first].reset_index()
    decided = verdicts.where(verdicts != UNDECIDED).nunique(axis=1)
    table["depends"] = ["yes" if n > 1 else "no" for n in decided]
    of_pictures = {
        f"{name}_{what}": report[what].to_numpy()
        for name, report in ordered.items()
        for what in OF_PICTURE
    }
    return pd.concat([table[list(OF_CLAIM)], pd.DataFrame(of_pictures)], axis=1)


def pictures_of(table: pd.DataFrame) -> list[str]:
    """Names of the pictures of a table of `side_by_side`."""
    ending = f"_{OF_PICTURE[0]}"
    return [name.removesuffix(ending) for name in map(str, table) if name.endswith(ending)]


def to_markdown(table: pd.DataFrame, runs: Mapping[str, str]) -> str:
    """Write a table of `side_by_side` for people: first the verdicts that depend on the picture.

    Parameters
    ----------
    table : DataFrame
    runs : mapping
        Run of each picture, see `run_of`.
    """
    pictures = pictures_of(table)
    heads = " | ".join(pictures)
    rules = "---|" * len(pictures)
    untested = (table[[f"{name}_verdict" for name in pictures]] == UNTESTED).all(axis=1)
    tested, depends = table[~untested], table["depends"] == "yes"
    lines = [
        "# Which verdicts depend on the picture",
        "",
        "Every claim of the paper, with the same criterion for every picture; the `claims.md` of",
        "each picture explains the verdicts, and `claims_pictures.csv` holds the same as below.",
        "A verdict depends on the picture where two pictures decide it differently; one that is",
        "undecided for a picture contradicts none.",
        "",
        *runs_table("picture", runs),
        "",
        f"{depends.sum()} of {len(tested)} verdicts depend on the picture.",
        "",
        f"| verdict | {heads} |",
        f"|---|{rules}",
    ]
    for verdict in VERDICTS:
        counts = [str((table[f"{name}_verdict"] == verdict).sum()) for name in pictures]
        lines.append(f"| {verdict} | {' | '.join(counts)} |")
    for title, rows in (
        ("Verdicts that depend on the picture", table[depends]),
        ("Verdicts that do not", tested[tested["depends"] == "no"]),
    ):
        if rows.empty:
            continue
        lines += ["", f"## {title}", ""]
        lines += [f"| claim | the paper says | criterion | {heads} |", f"|---|---|---|{rules}"]
        for row in rows.to_dict("records"):
            cells = [f"`{row['id']}`", f"{row['statement']} ({row['paper']})"]
            cells += [f"`{row['criterion']}`"]
            cells += ["<br>".join(_answer(row, name)) for name in pictures]
            lines.append("| " + " | ".join(map(cell, cells)) + " |")
    if untested.any():
        names = ", ".join(f"`{name}`" for name in table.loc[untested, "id"])
        lines += ["", "## Not testable with any of them", "", f"{names}."]
    return "\n".join(lines) + "\n"


def _answer(row: Mapping[Any, str], picture: str) -> list[str]:
    """Verdict and numbers of one claim for one picture; a number's interval stands behind it."""
    verdict, value, interval = (row[f"{picture}_{what}"] for what in OF_PICTURE)
    ends = dict(part.split(" ", 1) for part in interval.split("; ") if part)
    numbers = [part.split(" ", 1) for part in value.split("; ") if part]
    return [f"**{verdict}**"] + [
        f"{name} {number}" + (f" ({ends[name]})" if name in ends else "")
        for name, number in numbers
    ]
