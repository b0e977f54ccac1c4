"""Write README.md, docs/findings and what `ELSEWHERE` names from templates and committed results.

python tools/findings.py           write them
python tools/findings.py --check   say whether they are up to date

The templates lie in docs/findings/templates. They hold the words; measured numbers are named:

{{ claim("almost-20-percent-always.always") | percent }}    a number of the ledger: 60 %
{{ claim("no-feature-separates.best") | interval }}         with its interval: 0.78 (0.74 to 0.83)
{{ cell("fig4_counts.n_common", n_spo=3) }}                 of the one such row of a table: 499
{{ column("fig4_counts.n_common") | max }}                  of all such rows
{{ cost("Everything") | fixed(0) }}                         minutes, of docs/reproduce/costs.md
{{ verdict("almost-20-percent-always") }}                   in words: **does not hold**
{{ ledger("fig4") }}                                        a table of the claims of a figure

What these functions take is said below. A name that nothing has is an error.
"""

from __future__ import annotations

import json
import math
import re
import sys
import textwrap
import traceback
from collections.abc import Callable, Iterable, Iterator
from functools import cache
from pathlib import Path
from typing import Any

import jinja2
import numpy as np
import pandas as pd

from keystab.errors import InputError
from keystab.io.tables import read_table

ROOT = Path(__file__).parents[1]
TEMPLATES = ROOT / "docs/findings/templates"
REFERENCE = ROOT / "results/reference"
COSTS = ROOT / "docs/reproduce/costs.md"
ELSEWHERE = {
    "README.md": "README.md",
    **{name: f"docs/{name}" for name in ("deviations.md", "uncertainty.md")},
}
"""Templates of pages that do not lie in docs/findings."""
WIDTH = 110
"""Characters of a line."""

WORDS = {
    "reproduced": "holds",
    "reproduced with a condition": "holds in part",
    "not reproduced": "does not hold",
    "undecided": "undecided",
    "not testable": "cannot be tested",
}
"""What a page says for each verdict of the ledger, in the order of tables."""


class Number(float):
    """A measured number with its 95 % interval, where it has one."""

    interval: tuple[float, float] | None = None


def number(value: float, interval: Iterable[float] | None = None) -> Number:
    """A measured number."""
    made = Number(value)
    if interval is not None:
        low, high = interval
        made.interval = (float(low), float(high))
    return made


@cache
def claims() -> dict[str, dict[str, Any]]:
    """The ledger, by the ids of its claims."""
    listed = json.loads((REFERENCE / "claims.json").read_text(encoding="utf-8"))
    return {one["id"]: one for one in listed}


@cache
def pictures() -> dict[str, dict[str, str]]:
    """The claims of three pictures, by their ids."""
    table = read_table(ROOT / "docs/claims_pictures.csv")
    return {str(row["id"]): row for row in table.to_dict("records")}  # type: ignore[misc]


def scenes() -> list[dict[str, Any]]:
    """What claims are over the corpus of scenes; empty where it was not run."""
    path = REFERENCE / "scenes/claims.csv"
    return read_table(path).to_dict("records") if path.exists() else []  # type: ignore[return-value]


def known(name: str, names: Iterable[str], what: str) -> str:
    """The name, if it is one of those that there are.

    Examples
    --------
    >>> known("fig99", ["fig4", "fig5"], "figure")
    Traceback (most recent call last):
    keystab.errors.InputError: no figure 'fig99'; there are fig4, fig5
    """
    if name not in (listed := list(names)):
        near = [one for one in listed if one[:3] == name[:3]] or listed
        raise InputError(f"no {what} {name!r}; there are {', '.join(map(str, near[:12]))}")
    return name


def claim(place: str, picture: str = "") -> Number:
    """Number of a claim, "id.name", on the study's picture or on one of the three."""
    name, _, quantity = place.partition(".")
    known(name, claims(), "claim")
    if picture:
        row = pictures()[name]
        said = str(row[known(f"{picture}_value", row, "column of three pictures")])
        values = {pair.split()[0]: float(pair.split()[1]) for pair in said.split("; ")}
        return number(values[known(quantity, values, f"number of {name}")])
    own = claims()[name]
    known(quantity, own["value"], f"number of {name}")
    return number(own["value"][quantity], own["interval"].get(quantity))


def verdict(name: str) -> str:
    """Verdict of a claim in bold words."""
    return f"**{WORDS[claims()[known(name, claims(), 'claim')]['verdict']]}**"


def statement(name: str) -> str:
    """What a claim says."""
    return str(claims()[known(name, claims(), "claim")]["statement"])


def chosen(figure: str | None = None, kind: str = "", ours: bool | None = None) -> list[Any]:
    """Claims of a figure, of a verdict in the words of `WORDS`, of the paper or of ours."""
    return [
        one
        for one in claims().values()
        if (figure is None or (one["figure"] or "") == known(figure, _figures(), "figure"))
        and (not kind or WORDS[one["verdict"]] == known(kind, WORDS.values(), "verdict"))
        and (ours is None or one["id"].startswith("ours-") == ours)
    ]


def _figures() -> set[str]:
    return {one["figure"] or "" for one in claims().values()}


def ledger(*figures: str) -> str:
    """Table of the claims of figures, with what decides them."""
    listed = [one for figure in figures for one in chosen(figure)]
    lines = ["| verdict | statement | criterion | found | claim |", "|---|---|---|---|---|"]
    for one in listed:
        found = "<br>".join(_numbers(one))
        criterion = f"`{one['criterion']}`" if one["criterion"] else ""
        cells = (WORDS[one["verdict"]], one["statement"], criterion, found, f"`{one['id']}`")
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)


def _numbers(one: dict[str, Any]) -> Iterator[str]:
    """Numbers that the criterion names."""
    deciding = set(re.findall(r"\w+", one["criterion"]))
    for name, value in one["value"].items():
        if name not in deciding:
            continue
        low_high = one["interval"].get(name)
        yield f"{name} {float(value):.4g}" + (
            " ({:.4g} to {:.4g})".format(*low_high) if low_high else ""
        )


@cache
def table(name: str) -> pd.DataFrame:
    """A table of the committed results."""
    paths = {path.stem: path for path in REFERENCE.glob("*/*.csv") if path.parent.name != "scenes"}
    return read_table(paths[known(name, sorted(paths), "table")])


def figure(name: str, says: str) -> str:
    """A figure, as pages in docs/findings show it, with what it says below."""
    path = f"../figures/{name}.png"
    known(name, sorted(one.stem for one in (ROOT / "docs/figures").glob("*.png")), "figure")
    title = f"Figure {name.removeprefix('fig')}"
    return f"[![{title}]({path})]({path})\n\n*{title}. {says}*"


@cache
def cost(name: str) -> float:
    """Minutes of all jobs of a row of docs/reproduce/costs.md, one at a time."""
    lines = COSTS.read_text(encoding="utf-8").splitlines()
    rows = [[cell.strip() for cell in line.split("|")] for line in lines if line.startswith("|")]
    minutes = {row[1]: row[4] for row in rows[2:]}
    return float(minutes[known(name, minutes, "row of costs")])


def column(place: str, **where: Any) -> list[float]:
    """Values of "table.column" in the rows where columns have these values (None: no value)."""
    name, _, column_name = place.partition(".")
    rows = table(name)
    names = [str(one) for one in rows.columns]
    keep = np.ones(len(rows), dtype=bool)
    for key, value in where.items():
        own = rows[known(key, names, f"column of {name}")]
        if value is None:
            keep &= own.isna().to_numpy()
        elif isinstance(value, range | list | tuple):
            keep &= own.isin(value).to_numpy()
        else:
            near = isinstance(value, float) and math.isfinite(value)
            keep &= np.isclose(own, value) if near else (own == value).to_numpy()
    found = rows[known(column_name, names, f"column of {name}")][keep]
    if found.empty:
        raise InputError(f"no row of {name} has {where}")
    return [float(value) for value in found]


def cell(place: str, **where: Any) -> Number:
    """Value of "table.column" in the one row where columns have these values."""
    found = column(place, **where)
    if len(found) > 1:
        raise InputError(f"{len(found)} rows of {place} have {where}; name one")
    return number(found[0])


def pooled(place: str, weight: str, **where: Any) -> float:
    """Mean of such rows, each counting as often as another column of the table says."""
    name = place.partition(".")[0]
    weights = column(f"{name}.{weight}", **where)
    return float(np.average(column(place, **where), weights=weights))


def apart(one: list[float], other: list[float]) -> float:
    """Largest difference of numbers that belong together."""
    return max(abs(a - b) for a, b in zip(one, other, strict=True))


def percent(value: float, digits: int = 0, sign: str = " %") -> str:
    """A share in percent.

    Examples
    --------
    >>> percent(0.601), percent(0.0236, 1), percent(0.601, sign="")
    ('60 %', '2.4 %', '60')
    """
    return f"{100 * value:.{digits}f}{sign}"


def fixed(value: float, digits: int = 2) -> str:
    """A number with so many digits after the point."""
    return f"{value:.{digits}f}"


def digits(value: float, number: int = 2) -> str:
    """A number with so many digits that count.

    Examples
    --------
    >>> digits(3.693e-15, 1)
    '4e-15'
    """
    return f"{value:.{number}g}"


def interval(value: Number, digits: int = 2) -> str:
    """A number and its interval.

    Examples
    --------
    >>> interval(number(0.784, (0.737, 0.83)))
    '0.78 (0.74 to 0.83)'
    """
    if value.interval is None:
        raise InputError(f"{value:g} has no interval")
    low, high = value.interval
    return f"{value:.{digits}f} ({low:.{digits}f} to {high:.{digits}f})"


def _said(value: Any) -> Any:
    return f"{value:g}" if isinstance(value, float) else value


def environment() -> jinja2.Environment:
    """What templates can name."""
    made = jinja2.Environment(
        loader=jinja2.FileSystemLoader(TEMPLATES),
        undefined=jinja2.StrictUndefined,
        finalize=_said,
        keep_trailing_newline=True,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    functions: list[Callable[..., Any]] = [
        claim, verdict, statement, chosen, ledger, figure, cell, column, cost, pooled, apart,
        scenes, pictures,
    ]  # fmt: skip
    made.globals.update({one.__name__: one for one in functions}, inf=math.inf, words=WORDS)
    made.filters.update(percent=percent, fixed=fixed, digits=digits, interval=interval)
    return made


def filled(text: str) -> str:
    r"""Prose in lines of a page's width; tables, headings, pictures and code stay as they are.

    Examples
    --------
    >>> filled("- a\n  word\n- b\n\n| c\n|\n")
    '- a word\n- b\n\n| c\n|\n'
    """
    pieces = re.split(r"(^```.*?^```$)", text, flags=re.MULTILINE | re.DOTALL)
    for k in range(0, len(pieces), 2):  # between fences
        pieces[k] = re.sub(r"(?:^(?![|#!<]|\[!).+\n)+", _fill, pieces[k], flags=re.MULTILINE)
    return "".join(pieces)


def _fill(found: re.Match[str]) -> str:
    items = re.split(r"\n(?=- |\d\. )", found[0].rstrip("\n"))
    lines = []
    for item in items:
        mark = re.match(r"- |\d\. |", item)
        indent = " " * len(mark[0]) if mark else ""
        # What would be a list or a lone sign at the start of a line stays with the word before it.
        words = re.sub(r" (?=%|\d+\. |[-+*=>] )", "\0", " ".join(item.split()))
        lines += textwrap.wrap(
            words, WIDTH, subsequent_indent=indent, break_long_words=False, break_on_hyphens=False
        )
    return "\n".join(lines).replace("\0", " ") + "\n"


def written(name: str) -> str:
    """The page that a template makes."""
    note = f"<!-- Written by tools/findings.py from {(TEMPLATES / name).relative_to(ROOT)} -->\n\n"
    try:
        text = environment().get_template(name).render()
    except (InputError, jinja2.TemplateError) as problem:
        lines = [
            frame.lineno
            for frame in traceback.extract_tb(problem.__traceback__)
            if Path(frame.filename).name == name
        ]
        line = getattr(problem, "lineno", None) or (lines[-1] if lines else "?")
        raise InputError(f"{name}, line {line}: {problem}") from None
    return note + filled(re.sub(r"\n{3,}", "\n\n", text))


def pages() -> dict[str, Path]:
    """The page of every template."""
    names = sorted(path.name for path in TEMPLATES.glob("*.md"))
    return {name: ROOT / ELSEWHERE.get(name, f"docs/findings/{name}") for name in names}


def main(argv: list[str]) -> int:
    """Write or check; returns the exit status."""
    status = 0
    for name, page in pages().items():
        try:
            text = written(name)
        except InputError as problem:
            print(f"error: {problem}", file=sys.stderr)
            return 2
        if "--check" not in argv:
            page.write_text(text, encoding="utf-8")
        elif not page.exists() or page.read_text(encoding="utf-8") != text:
            print(f"{page.relative_to(ROOT)} is out of date: python tools/findings.py")
            status = 1
    return status


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
