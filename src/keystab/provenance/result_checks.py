"""Whether figures, tables and verdicts that a run ended in belong together.

All that is looked at may come from a stranger. It is read as data, in bounded time and memory.
"""

from __future__ import annotations

import csv
import dataclasses
import io
import json
import re
import tempfile
from collections.abc import Iterable, Iterator, Mapping
from decimal import Decimal
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from keystab.errors import InputError
from keystab.provenance.foreign_tables import read_foreign_table
from keystab.provenance.lineage import code_of_figure, file_digest, read_figure_metadata
from keystab.provenance.run_description import (
    AUDIT_TABLES,
    FIGURES_BESIDE,
    LEFT_OUT,
    LEFT_OUT_COLUMNS,
    About,
)
from keystab.provenance.snakemake_records import Record
from keystab.study.column_relations import broken_relations

if TYPE_CHECKING:
    import pandas as pd

    from keystab.study.claims import Claim

__all__ = [
    "FINAL",
    "Check",
    "Run",
    "check_columns",
    "check_figures",
    "check_final",
    "check_verdicts",
    "left_out_digests",
    "left_out_rows",
    "listed_in",
    "verdicts_in",
]

FINAL = "final.sha256"
"""List of all that a run ends in, in the folder of its results."""

_SUM = re.compile("([0-9a-f]{64})  ([^\n]+)\n")
_NUMBER = re.compile(r"-?\d+(?:\.\d+)?(?:e[+-]?\d+)?")
_MOST_ROWS_OF_JOIN = 5_000_000
_ROUNDING = Decimal("1e-12")
_VERDICTS = ("claims.csv", "claims.json", "claims.md")


@dataclasses.dataclass(frozen=True)
class Check:
    """Answer to one question.

    Parameters
    ----------
    what : str
        What was asked, in a word or two.
    words : str
        The answer, if all is well.
    problems : list of str
        What does not hold, one line each.
    notes : list of str
        What a reader should know although it harms nothing.
    """

    what: str
    words: str
    problems: list[str] = dataclasses.field(default_factory=list)
    notes: list[str] = dataclasses.field(default_factory=list)


class Run(NamedTuple):
    """A finished run.

    Parameters
    ----------
    folder : path
        Where it lies.
    about : About
        What it says of itself.
    records : mapping from str to Record
        Snakemake's records of it, by output.
    digests : mapping from str to str, optional
        SHA-256 of all its files by name, where they are known.
    """

    folder: Path
    about: About
    records: Mapping[str, Record]
    digests: Mapping[str, str] | None = None

    def digest(self, name: str) -> str | None:
        """SHA-256 of one of its files; None where there is no such."""
        if self.digests is not None:
            return self.digests.get(name)
        path = self.folder / name
        return file_digest(path) if path.is_file() else None

    def files(self, place: str, *suffixes: str) -> list[Path]:
        """Files of one of its folders by suffix, sorted."""
        found = [path for path in (self.folder / place).glob("*") if path.suffix in suffixes]
        return sorted(path for path in found if path.is_file())

    def name(self, path: Path) -> str:
        """A file's place within the run."""
        return path.relative_to(self.folder).as_posix()

    @property
    def tables(self) -> list[Path]:
        """All its tables; not those of an audit, which is no part of it."""
        paths = self.files(f"{self.about.results}/tables", ".csv", ".parquet")
        return [path for path in paths if path.name not in AUDIT_TABLES]

    @property
    def figures(self) -> list[Path]:
        """All its figures; not those of an audit and of several scenes."""
        paths = self.files(self.about.figures, ".pdf", ".png")
        return [path for path in paths if path.name not in FIGURES_BESIDE]

    @property
    def verdicts(self) -> list[Path]:
        """The verdicts on claims, in all forms."""
        paths = [self.folder / self.about.results / name for name in _VERDICTS]
        return [path for path in paths if path.is_file()]


def check_final(run: Run) -> Check:
    """Hold figures, tables and verdicts against the list in which the run ended, and its record."""
    place = f"{run.about.results}/{FINAL}"
    path = run.folder / place
    if not path.is_file() or place not in run.records:
        return Check("final", "", [f"{place}: missing, or without a record; make study makes it"])
    try:
        listed = listed_in(path)
    except InputError as error:
        return Check("final", "", [f"{place}: {error}"])
    recorded = run.records[place].digests
    there = {run.name(it) for it in (*run.figures, *run.tables, *run.verdicts)}
    problems = [f"{name}: missing" for name in sorted(listed.keys() - there)]
    problems += [f"{name}: not in {place}" for name in sorted(there - listed.keys())]
    for name in sorted(listed.keys() & there):
        if run.digest(name) != listed[name]:
            problems.append(f"{name}: not as it was when the run ended")
    problems += [
        f"{name}: {place} says otherwise than the record of the run"
        for name in sorted(listed.keys() | recorded.keys())
        if listed.get(name) != recorded.get(name)
    ]
    return Check("final", f"{len(listed)} figures, tables and verdicts as the run ended", problems)


def listed_in(path: Path) -> dict[str, str]:
    """Digests by file name, from a list that a stranger may have written.

    Raises
    ------
    InputError
        If there is anything else in it, or a file twice. The name of the list is to be put before.
    """
    try:
        text = path.read_bytes().decode("utf-8")
    except UnicodeError:
        text = "?"
    found = _SUM.findall(text)
    listed = {name: digest for digest, name in found}
    if len(listed) < len(found) or "".join(f"{it[0]}  {it[1]}\n" for it in found) != text:
        raise InputError("is no list of digests")
    return listed


def check_figures(run: Run, lock: str) -> Check:
    """Hold each figure's metadata against its name, its tables, and the code and lock here.

    Parameters
    ----------
    run : Run
    lock : str
        SHA-256 of the lock file here.
    """
    problems = [] if run.figures else [f"{run.about.figures}: holds no figures"]
    code: dict[str, str | None] = {}
    tables = set()
    for path in run.figures:
        name = run.name(path)
        try:
            metadata = read_figure_metadata(path, as_drawn=True)
        except InputError as error:
            problems.append(f"{name}{str(error).removeprefix(str(path))}")
            continue
        if metadata.figure not in code:
            code[metadata.figure] = code_of_figure(metadata.figure)
        if metadata.figure != path.stem:
            problems.append(f"{name}: is figure {metadata.figure}")
        if metadata.version != run.about.keystab:
            problems.append(f"{name}: drawn by another version, {metadata.version[:20]!a}")
        if metadata.code is None or metadata.code != code[metadata.figure]:
            problems.append(f"{name}: drawn by other code than is here")
        if metadata.lock != lock:
            problems.append(f"{name}: drawn under another environment.lock than is here")
        for table, digest in metadata.tables.items():
            found = run.digest(f"{run.about.results}/tables/{table}")
            tables.add(table)
            if found != digest:
                state = "missing" if found is None else "changed"
                told = f"drawn from another {table[:80]} than the one here ({state})"
                problems.append(f"{name}: {told}")
    words = f"{len(run.figures)} drawn from the {len(tables)} tables here, by this code and lock"
    return Check("figures", words, problems)


def check_verdicts(run: Run, claims: Path, exact: bool) -> Check:
    """Evaluate the claims again from the tables of a run and compare.

    Parameters
    ----------
    run : Run
    claims : path
        File of claims.
    exact : bool
        Whether every bit has to be the same; else verdicts have to be, and texts may differ.
    """
    import numpy as np

    from keystab.study.claims import read_claims, table_names
    from keystab.study.claims_report import without_heading, write_report
    from keystab.study.verdicts import outcomes_of

    if not claims.is_file():
        return Check("verdicts", "there are no claims here to judge")
    folder = run.folder / run.about.results
    places = {name: f"{run.about.results}/{name}" for name in _VERDICTS}
    problems = [f"{it}: missing" for name, it in places.items() if not (folder / name).is_file()]
    if problems:
        return Check("verdicts", "", problems)
    try:
        asked = read_claims(claims)
        tables = {
            name: read_foreign_table(folder / "tables" / f"{name}.csv")
            for name in table_names(asked)
        }
        _check_joins(asked, tables)
        with tempfile.TemporaryDirectory() as scratch:
            again = [Path(scratch) / name for name in _VERDICTS]
            with np.errstate(all="ignore"):
                write_report(outcomes_of(asked, tables), *again)
            for path in again:
                texts = [
                    it.read_bytes().decode("utf-8", "surrogateescape")
                    for it in (path, folder / path.name)
                ]
                if path.suffix == ".md":  # which says besides whose verdicts they are
                    texts = list(map(without_heading, texts))
                if texts[0] == texts[1]:
                    continue
                told = list(_other_verdicts(verdicts_in(folder / path.name), verdicts_in(path)))
                if not told and (exact or not _but_for_rounding(folder / path.name, path)):
                    told = ["other numbers or words than its tables give"]
                problems += [f"{places[path.name]}: {it}" for it in told]
    except InputError as error:
        return Check("verdicts", "", [str(error).replace(f"{run.folder}/", "")])
    except (ValueError, TypeError, LookupError, ArithmeticError, RecursionError):
        return Check("verdicts", "", ["the tables here are not such that claims can be judged"])
    return Check("verdicts", f"{len(asked)} judged again from the tables, all the same", problems)


def _check_joins(claims: Iterable[Claim], tables: Mapping[str, pd.DataFrame]) -> None:
    """Raise where joining tables gives more rows than are handled in bounded memory."""
    for joined in {part.tables for claim in claims for part in claim.quantities if part.tables}:
        first, *others = (tables[name] for name in joined)
        rows = len(first)
        for other in others:
            shared = [name for name in first if name in other]
            if shared and len(other):
                rows *= int(other.groupby(shared, dropna=False).size().max())
        if rows > _MOST_ROWS_OF_JOIN:
            raise InputError(f"{' and '.join(joined)}: give too many rows when they are joined")


def _other_verdicts(before: Mapping[str, str], after: Mapping[str, str]) -> Iterator[str]:
    """Verdicts that are not those which the tables give."""
    for name in sorted(before.keys() | after.keys()):
        if before.get(name) != after.get(name):
            yield (
                f"{name[:60]} is {before.get(name, 'absent')[:40]!r}, its tables give "
                f"{after.get(name, 'no such claim')!r}"
            )


def _but_for_rounding(one: Path, other: Path) -> bool:
    """Whether two texts hold the same words, and numbers that differ by rounding at most.

    That is by one in the last digit that is written, or in the thirteenth; whole numbers by none.
    """
    from keystab.study.claims_report import without_heading

    texts = [without_heading(path.read_text(encoding="utf-8")) for path in (one, other)]
    words, numbers = zip(*((_NUMBER.split(it), _NUMBER.findall(it)) for it in texts), strict=True)
    return words[0] == words[1] and all(map(_same_number, *numbers))


def _same_number(one: str, other: str) -> bool:
    """Whether two numbers are the same but for rounding; both were given the same digits.

    Examples
    --------
    >>> _same_number("0.12", "0.1201"), _same_number("120", "121"), _same_number("0.12", "0.1202")
    (True, False, False)
    """
    if one == other:
        return True
    a, b = Decimal(one), Decimal(other)
    last = min(int(a.as_tuple().exponent), int(b.as_tuple().exponent))
    if last >= 0 and "e" not in one + other:
        return False
    return abs(a - b) <= max(Decimal(1).scaleb(last), abs(a) * _ROUNDING, _ROUNDING)


def verdicts_in(path: Path) -> dict[str, str]:
    """Verdicts by the names of claims, from a report on claims in any of its forms.

    Raises
    ------
    InputError
        If it is no such report. The name of the file is part of the text.
    """
    try:
        text = path.read_text(encoding="utf-8")
        found = list(_VERDICTS_OF[path.suffix](text))
    except (ValueError, TypeError, LookupError, csv.Error, RecursionError):
        found = [("", None)]
    texts = all(isinstance(it, str) for pair in found for it in pair)
    if not texts or len({name for name, _ in found}) < len(found):
        raise InputError(f"{path}: is no report on claims")
    return dict(found)


def _verdicts_of_csv(text: str) -> Iterator[tuple[Any, Any]]:
    for row in csv.DictReader(io.StringIO(text, newline=""), strict=True):
        yield row["id"], row["verdict"]


def _verdicts_of_json(text: str) -> Iterator[tuple[Any, Any]]:
    for row in json.loads(text):
        yield row["id"], row["verdict"]


def _verdicts_of_markdown(text: str) -> Iterator[tuple[Any, Any]]:
    verdict = ""
    for line in text.split("\n"):
        if line.startswith("## "):
            verdict = line.removeprefix("## ").lower()
        elif line.startswith("| `"):
            yield line.split("`")[1], verdict


_VERDICTS_OF = {
    ".csv": _verdicts_of_csv,
    ".json": _verdicts_of_json,
    ".md": _verdicts_of_markdown,
}


def check_columns(run: Run) -> Check:
    """Ask of each table whether its columns follow from one another where they have to."""
    problems, asked = [], 0
    for path in run.tables:
        if path.suffix != ".csv":
            continue
        try:
            broken = broken_relations(path.stem, read_foreign_table(path))
        except InputError as error:
            broken = [str(error).removeprefix(f"{path}: ")]
        asked += 1
        problems += [f"{run.name(path)}: {it}" for it in broken]
    words = f"{asked} tables, whose columns follow from one another where they have to"
    return Check("columns", words, problems)


def left_out_rows(folder: Path) -> dict[str, dict[str, str]]:
    """What a run says of the files that it left out, by their paths; none where nothing was.

    Raises
    ------
    InputError
        If the list is none.
    """
    path = folder / LEFT_OUT
    if not path.is_file():
        return {}
    try:
        with path.open(newline="", encoding="utf-8") as lines:
            names, *rows = csv.reader(lines, strict=True)
    except (ValueError, csv.Error):
        names, rows = [], []
    found = {row[0]: dict(zip(names, row, strict=False)) for row in rows if row}
    sound = names == LEFT_OUT_COLUMNS and all(len(row) == len(names) for row in rows)
    if not sound or len(found) < len(rows) or not all(it.isprintable() for it in found):
        raise InputError(f"{LEFT_OUT}: is no list of files; get the archive again")
    return found


def left_out_digests(folder: Path) -> dict[str, str]:
    """Digests of the files that a run left out, by their paths; see `left_out_rows`."""
    return {name: row["sha256"] for name, row in left_out_rows(folder).items()}
