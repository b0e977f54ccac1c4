"""Write the pages of docs/reference, below what is written there by hand.

python tools/reference_pages.py           write them
python tools/reference_pages.py --check   say whether they are up to date

Each fact has one source: docstrings, docs/reference/columns.csv and tables.csv with the headers of
results/reference/tables, workflow/schemas/config.schema.yaml, the parser of `keystab`, Makefile.
"""

from __future__ import annotations

import argparse
import csv
import inspect
import itertools
import re
import sys
from collections.abc import Iterator, Mapping, Sequence
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

import yaml

import keystab
from keystab.cli.parser import build_parser
from keystab.errors import InputError

sys.path.insert(0, str(Path(__file__).parent))
from settings_table import SCHEMA, rows  # noqa: E402

ROOT = Path(__file__).parents[1]
FOLDER = ROOT / "docs/reference"
HEADERS = ROOT / "results/reference"
BEGIN, END = "<!-- generated: begin -->\n\n", "<!-- generated: end -->\n"

FUNCTIONS = {
    "Pictures and views": (
        *("read_picture", "simulate_view", "make_scene", "edge_blur", "fit_psf", "open_views"),
    ),
    "Scale-space": ("scale_space", "balanced_delta", "open_scale_space"),
    "Keypoints": ("detect_keypoints", "keypoint_uncertainty"),
    "True extrema": ("true_extrema", "scene_extrema"),
    "Which detections are the same": ("unique_keypoints", "minimum_unique_set", "occurrence"),
    "Keypoints of other programs": (
        *("Convention", "read_keypoints", "write_keypoints", "from_opencv", "to_opencv"),
        *("from_lafs", "to_lafs"),
    ),
    "Errors": ("InputError",),
}
"""All public names, by what they are about."""


# ---------------------------------------------------------------------------------------------
# Functions


def api() -> str:
    """The page of the public names: in short for all readers, in full where Sphinx builds it."""
    known = [name for names in FUNCTIONS.values() for name in names]
    if sorted(known) != sorted({*dir(keystab)} - {"__version__"}):
        raise InputError("FUNCTIONS is not what keystab has: add or remove names in it")
    parts = []
    for title, names in FUNCTIONS.items():
        lines = [f"| `keystab.{name}` | {in_short(getattr(keystab, name))} |" for name in names]
        parts.append("\n".join([f"## {title}", "", "| name | what it is |", "|---|---|", *lines]))
        kinds = [(directive(getattr(keystab, name)), name) for name in names]
        lines = [f".. {kind}:: keystab.{name}" for kind, name in kinds]
        parts.append("\n".join(["```{eval-rst}", *lines, "```"]))
    return "\n\n".join(parts) + "\n"


def in_short(thing: object) -> str:
    """First paragraph of a docstring, as Markdown.

    Examples
    --------
    >>> def halve(x):
    ...     '''Halve `x`, see ``numpy``.
    ...
    ...     More.
    ...     '''
    >>> in_short(halve)
    'Halve `x`, see `numpy`.'
    """
    paragraph = (inspect.getdoc(thing) or "").partition("\n\n")[0]
    return " ".join(paragraph.split()).replace("``", "`")


def directive(thing: object) -> str:
    """How Sphinx documents it."""
    if isinstance(thing, type):
        return "autoexception" if issubclass(thing, Exception) else "autoclass"
    return "autofunction"


# ---------------------------------------------------------------------------------------------
# Columns


def columns() -> str:
    """The page of the columns of all tables."""
    described, tables = read(FOLDER / "columns.csv"), read(FOLDER / "tables.csv")
    used: set[int] = set()
    parts = []
    for part, members in itertools.groupby(tables, key=lambda row: row["part"]):
        parts.append(f"## {part}")
        for row in members:
            names = row["tables"].split()
            headers = {name: row["columns"].split() or header(name) for name in names}
            first = next(iter(headers.values()))
            if any(other != first for other in headers.values()):
                raise InputError(f"{row['tables']}: other columns; give each a row in tables.csv")
            chosen = [meaning(name, first, described) for name in names]
            if any(other != chosen[0] for other in chosen):
                raise InputError(f"{row['tables']}: other meanings; give each a row in tables.csv")
            used |= set(chosen[0])
            lines = [line(described[k], first) for k in chosen[0]]
            title = ", ".join(f"`{name}`" for name in names)
            table = "\n".join(["| column | unit | meaning |", "|---|---|---|", *lines])
            parts.append(f"### {title}\n\n{sentence(row['holds'])}\n\n{table}")
    never = [described[k] for k in range(len(described)) if k not in used]
    if never:
        row = never[0]
        raise InputError(f"columns.csv: {row['tables']} has no {row['columns']}: remove it")
    return "\n\n".join(parts) + "\n"


def meaning(table: str, header: Sequence[str], described: Sequence[Mapping[str, str]]) -> list[int]:
    """Rows that describe the columns of a table, in the order of the columns, each once.

    What names the table counts before what is said of all (`*`).

    Raises
    ------
    InputError
        If a column is described nowhere or twice.

    Examples
    --------
    >>> described = [{"tables": "*", "columns": "y x"}, {"tables": "fig6", "columns": "x"}]
    >>> meaning("fig4", ["x", "y"], described), meaning("fig6", ["x", "y"], described)
    ([0], [1, 0])
    """
    found: list[int] = []
    for column in header:
        rows = [
            k
            for k, row in enumerate(described)
            if any(fnmatchcase(column, name) for name in row["columns"].split())
            and any(fnmatchcase(table, name) for name in row["tables"].split())
        ]
        own = [k for k in rows if described[k]["tables"] != "*"] or rows
        if len(own) != 1:
            raise InputError(
                f"columns.csv: {len(own)} rows describe {column} of {table}, wanted is one: "
                "add or change one"
            )
        found += [own[0]] if own[0] not in found else []
    return found


def line(row: Mapping[str, str], header: Sequence[str]) -> str:
    """Row of the page for what a row of columns.csv says of a table with these columns."""
    names = [
        name for name in row["columns"].split() if any(fnmatchcase(one, name) for one in header)
    ]
    cells = [", ".join(f"`{name}`" for name in names), row["unit"], row["meaning"]]
    return f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in cells)} |"


def header(table: str) -> list[str]:
    """Names of the columns of a table of the reference results."""
    for path in (HEADERS / f"tables/{table}.csv", HEADERS / f"{table}.csv"):
        if path.is_file():
            with path.open(newline="") as file:
                return next(csv.reader(file))
    raise InputError(f"{table}: not in results/reference; name its columns in tables.csv")


def read(path: Path) -> list[dict[str, str]]:
    """Rows of a CSV file."""
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def sentence(text: str) -> str:
    """Text as a sentence.

    Examples
    --------
    >>> sentence("one row"), sentence("`a`, one row")
    ('One row.', '`a`, one row.')
    """
    return f"{text[0].upper()}{text[1:]}."


# ---------------------------------------------------------------------------------------------
# Settings


def settings() -> str:
    """The page of all settings, block by block."""
    schema = yaml.safe_load(text_of(SCHEMA))
    head = "| setting | meaning | allowed | default |\n|---|---|---|---|"
    blocks = {key: part for key, part in schema["properties"].items() if is_block(part)}
    alone = {key: part for key, part in schema["properties"].items() if key not in blocks}
    parts = ["\n".join(["## Outside of blocks\n", head, *rows({"properties": alone})])]
    for key, part in blocks.items():
        lines = list(rows({"properties": {key: part}}))[1:]  # the first one is the block itself
        parts.append("\n".join([f"## {key}\n", f"{part['description']}\n", head, *lines]))
    return "\n\n".join(parts) + "\n"


def is_block(part: Mapping[str, Any]) -> bool:
    """Whether a setting holds others."""
    return part.get("type") == "object"


# ---------------------------------------------------------------------------------------------
# Commands


def commands() -> str:
    """The page of what can be typed: `keystab`, and targets of `make`."""
    parts = []
    for name, parser in subcommands(build_parser()).items():
        lines = list(arguments(parser))
        table = ["| argument | meaning |", "|---|---|", *lines] if lines else []
        parts.append("\n".join([f"## keystab {name}\n", f"{parser.description}\n", *table]))
    targets = re.findall(r"^([a-z-]+):.*## (.*)$", text_of(ROOT / "Makefile"), re.MULTILINE)
    lines = [f"| `make {name}` | {what} |" for name, what in targets]
    parts.append("\n".join(["## make\n", "| target | what it does |", "|---|---|", *lines]))
    return "\n\n".join(parts) + "\n"


def subcommands(parser: argparse.ArgumentParser) -> Mapping[str, argparse.ArgumentParser]:
    """Return the parsers of the commands by their names."""
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            return dict(action.choices)
    return {}


def arguments(parser: argparse.ArgumentParser) -> Iterator[str]:
    """One row for each argument of a command, but for --help."""
    formatter = parser._get_formatter()
    for action in parser._actions:
        if not isinstance(action, argparse._HelpAction):
            said = formatter._expand_help(action) if action.help else ""
            said = said.removesuffix(" (default: None)").replace("|", "\\|")
            required = ", required" if action.required and action.option_strings else ""
            yield f"| `{invocation(action)}`{required} | {said} |"


def invocation(action: argparse.Action) -> str:
    """How an argument is typed.

    Examples
    --------
    >>> parser = argparse.ArgumentParser()
    >>> invocation(parser.add_argument("--shift", nargs=2, metavar=("Y", "X")))
    '--shift Y X'
    >>> invocation(parser.add_argument("-n", "--noise", nargs="+"))
    '-n, --noise NOISE ...'
    """
    names = ", ".join(action.option_strings)
    if action.nargs == 0 or isinstance(action, argparse.BooleanOptionalAction):
        return names
    word = action.metavar or (
        "{" + ",".join(map(str, action.choices)) + "}" if action.choices else action.dest.upper()
    )
    words = " ".join(word) if isinstance(word, tuple) else word
    if isinstance(action.nargs, int) and isinstance(word, str):
        words = " ".join([word] * action.nargs)
    words += " ..." if action.nargs in ("+", "*") else ""
    words = f"[{words}]" if action.nargs == "?" else words
    return f"{names} {words}".strip()


# ---------------------------------------------------------------------------------------------


PAGES = {"api": api, "columns": columns, "settings": settings, "command_line": commands}


def text_of(path: Path) -> str:
    """Text of a file of the project."""
    return path.read_text(encoding="utf-8")


def main() -> int:
    """Write or check the pages."""
    stale = []
    for name, make in PAGES.items():
        path = FOLDER / f"{name}.md"
        text = text_of(path)
        head, rest = text.split(BEGIN)
        new = head + BEGIN + make() + END + rest.split(END)[1]
        if "--check" not in sys.argv:
            path.write_text(new, encoding="utf-8")
        elif text != new:
            stale.append(str(path.relative_to(ROOT)))
    if stale:
        print(f"{', '.join(stale)}: out of date: python tools/reference_pages.py", file=sys.stderr)
    return 1 if stale else 0


if __name__ == "__main__":
    raise SystemExit(main())
