"""The verdicts on all claims, as a table, as JSON and for people."""

from __future__ import annotations

import json
import math
import os
import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from keystab._version import __version__
from keystab.errors import InputError
from keystab.study.claims import read_claims, table_names
from keystab.study.decisions import LEVEL
from keystab.study.verdicts import UNTESTED, VERDICTS, Outcome, outcomes_of, tally
from keystab.utils.files import written_whole

if TYPE_CHECKING:
    import pandas as pd

__all__ = [
    "FIELDS",
    "cell",
    "heading",
    "judged",
    "records",
    "to_json",
    "to_markdown",
    "to_table",
    "without_heading",
    "write_report",
]

#: What is said of every claim, in this order.
FIELDS = (
    *("id", "where", "statement", "figure", "table", "criterion"),
    *("value", "interval", "paper", "verdict", "note"),
    *("uncertainty", "by_numbers", "p", "p_holm"),
)


def judged(claims: Path, tables: Iterable[Path]) -> list[Outcome]:
    """Verdicts that tables give on the claims of a file.

    Raises
    ------
    InputError
        If a table is missing that the claims ask for.
    """
    from keystab.io.tables import read_table

    asked, files = read_claims(claims), {path.stem: path for path in tables}
    lacking = [f"{name}.csv" for name in table_names(asked) if name not in files]
    if lacking:
        raise InputError(f"{claims} asks for {', '.join(lacking)}: name them with --tables")
    return outcomes_of(asked, {name: read_table(files[name]) for name in table_names(asked)})


def heading(reference: str, settings: Sequence[str], draft: bool) -> str:
    """One line that says which run verdicts are of.

    Parameters
    ----------
    reference : str
        Picture.
    settings : sequence of str
        Files of settings, later ones laid over earlier ones.
    draft : bool
        Whether the run is a draft.

    Examples
    --------
    >>> heading("roof.png", ["config/config.yaml", "my.yaml"], True)  # doctest: +ELLIPSIS
    '*Draft.* Picture: `roof.png`. Settings: `config/config.yaml`, `my.yaml`. Version: keystab ...'
    """
    files = ", ".join(f"`{name}`" for name in settings)
    mark = "*Draft.* " if draft else ""
    return f"{mark}Picture: `{reference}`. Settings: {files}. Version: keystab {__version__}."


_HEADING = re.compile(r"(?<=\n\n)(?:\*Draft\.\* )?Picture: .*\n\n")


def without_heading(markdown: str) -> str:
    """Verdicts for people without the line of `heading`: the same for the same tables."""
    return _HEADING.sub("", markdown, count=1)


def records(outcomes: Iterable[Outcome]) -> list[dict[str, Any]]:
    """One record per claim with `FIELDS`; numbers that do not exist are None, infinity is "inf".

    ``value`` maps names to numbers, ``interval`` names to pairs of ends, where there are any.
    ``uncertainty`` is "interval", or says why there is none; ``by_numbers`` is the verdict that the
    numbers would give if they were exact; ``p`` and ``p_holm`` are the levels at which the verdict
    is decided, by itself and with all others.
    """
    return [
        {
            "id": each.claim.id,
            "where": each.claim.where,
            "statement": each.claim.statement,
            "figure": each.claim.figure,
            "table": [f"{name}.csv" for name in each.claim.tables],
            "criterion": each.claim.criterion,
            "value": {name: _plain(part.value) for name, part in each.measured.items()},
            "interval": {
                name: [_plain(part.low), _plain(part.high)]
                for name, part in each.measured.items()
                if not math.isnan(part.low)
            },
            "paper": each.claim.paper,
            "verdict": each.verdict,
            "note": each.note,
            "uncertainty": _uncertainty(each),
            "by_numbers": each.by_numbers,
            "p": _plain(each.p),
            "p_holm": _plain(each.p_holm),
        }
        for each in outcomes
    ]


def _uncertainty(each: Outcome) -> str:
    """What is known of how far the numbers that decide could be off."""
    return each.claim.uncertainty if math.isnan(each.p) else "interval"


def _plain(value: float) -> float | str | None:
    """Number as JSON can say it."""
    if math.isnan(value):
        return None
    return value if math.isfinite(value) else str(value)


def to_json(outcomes: Iterable[Outcome]) -> str:
    """Write the verdicts as JSON: a list of objects, see `records`."""
    return json.dumps(records(outcomes), indent=2, ensure_ascii=False, allow_nan=False) + "\n"


def to_table(outcomes: Iterable[Outcome]) -> pd.DataFrame:
    """Lay out the verdicts as a table of texts, one row per claim."""
    import pandas as pd

    rows = [
        record
        | {
            "table": " ".join(record["table"]),
            "value": _numbers(record["value"]),
            "interval": "; ".join(
                f"{name} {_short(low)} to {_short(high)}"
                for name, (low, high) in record["interval"].items()
            ),
            **{name: _level(record[name]) for name in ("p", "p_holm")},
        }
        for record in records(outcomes)
    ]
    return pd.DataFrame(rows, columns=list(FIELDS))


def _numbers(values: Mapping[str, float | str | None]) -> str:
    return "; ".join(f"{name} {_short(value)}" for name, value in values.items())


def _level(p: float | None) -> str:
    """Write a level for people: two digits, small ones as a bound, none where there is none.

    Examples
    --------
    >>> _level(0.0312), _level(1e-9), _level(None)
    ('0.031', '<0.001', '')
    """
    if p is None:
        return ""
    return "<0.001" if p < 1e-3 else f"{p:.2g}"


def _short(value: float | str | None) -> str:
    """Write a number for people: four digits, or all of a whole number.

    Examples
    --------
    >>> _short(0.123456), _short(12345.0), _short(None)
    ('0.1235', '12345', 'missing')
    """
    if value is None:
        return "missing"
    if isinstance(value, str):
        return value
    return f"{value:.0f}" if value == round(value) else f"{value:.4g}"


def to_markdown(outcomes: Sequence[Outcome], head: str = "") -> str:
    """Write the verdicts for people: how many verdicts of each kind, then the claims by verdict.

    Parameters
    ----------
    outcomes : sequence of Outcome
    head : str, optional
        Line that says which run they are of (`heading`).
    """
    table = to_table(outcomes)
    counts = tally(outcomes)
    lines = [
        "# What the paper says, and what this run says of it",
        "",
        *([head, ""] if head else []),
        "Every claim was given a criterion from the paper's words. `claims.csv` and `claims.json`",
        "hold the same with all criteria; `config/claims.yaml` says how each number is computed.",
        "",
        f"A criterion is decided at p <= {LEVEL:g}, where the 95 % interval of its margin keeps",
        "off its line; else the claim is undecided. `p` is that of the claim by itself, and after",
        "it that of all claims at once (Holm): where that is above the level, a verdict is",
        "descriptive.",
        *_of_all(outcomes),
        "",
        "| verdict | claims |",
        "|---|---|",
        *(f"| {verdict} | {number} |" for verdict, number in counts.items()),
        f"| all | {len(outcomes)} |",
    ]
    for verdict in VERDICTS:
        if not counts[verdict]:
            continue
        lines += ["", f"## {verdict.capitalize()}", ""]
        if verdict == UNTESTED:
            lines += ["| claim | where | the paper says | why |", "|---|---|---|---|"]
        else:
            lines += [
                "| claim | where | the paper says | its number or word | criterion | found | p | |",
                "|---|---|---|---|---|---|---|---|",
            ]
        for row in table[table["verdict"] == verdict].to_dict("records"):
            cells = [f"`{row['id']}`", _place(row), row["statement"]]
            if verdict != UNTESTED:
                found = row["value"] + (f" ({row['interval']})" if row["interval"] else "")
                cells += [row["paper"], f"`{row['criterion']}`", found]
                cells += [f"{row['p']}, {row['p_holm']}" if row["p"] else row["uncertainty"]]
            lines.append("| " + " | ".join(cell(text) for text in (*cells, row["note"])) + " |")
    return "\n".join(lines) + "\n"


def _of_all(outcomes: Sequence[Outcome]) -> list[str]:
    """Say how many verdicts are decided by intervals, and how many for all claims at once."""
    levels = [(each.p, each.p_holm) for each in outcomes if not math.isnan(each.p)]
    alone, together = (sum(pair[i] <= LEVEL for pair in levels) for i in (0, 1))
    return [
        f"Of {len(levels)} claims with intervals {alone} are decided by themselves and {together} "
        "with all others."
    ]


def _place(row: Mapping[Any, Any]) -> str:
    """Say where a claim stands, and in which figure it is tested."""
    return f"{row['where']}; {row['figure']}" if row["figure"] else str(row["where"])


def cell(text: str) -> str:
    """Text that does not end a cell of a Markdown table."""
    return text.replace("|", "\\|")


def write_report(
    outcomes: Sequence[Outcome],
    csv: str | os.PathLike[str],
    json_file: str | os.PathLike[str],
    markdown: str | os.PathLike[str],
    *,
    head: str = "",
) -> None:
    """Write the verdicts as a table, as JSON and, under a head, for people; each file whole."""
    from keystab.io.tables import write_table

    write_table(to_table(outcomes), csv)
    for path, text in ((json_file, to_json(outcomes)), (markdown, to_markdown(outcomes, head))):
        with written_whole(path) as part:
            part.write_text(text, encoding="utf-8", newline="")
