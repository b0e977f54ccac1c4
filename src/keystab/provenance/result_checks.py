"""Whether figures, tables and verdicts that a run ended in belong together.

All that is looked at may come from a stranger. It is read as data, in bounded time and memory.
"""

from __future__ import annotations

import csv
import dataclasses
import io
import json
import math
import re
import tempfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING, Any, NamedTuple

from keystab.errors import InputError
from keystab.provenance import table_differences
from keystab.provenance.foreign_tables import read_foreign_table
from keystab.provenance.lineage import code_of_figure, file_digest, read_figure_metadata
from keystab.provenance.run_description import (
    LEFT_OUT,
    LEFT_OUT_COLUMNS,
    About,
    arithmetic,
    read_about,
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
    "alike",
    "check_columns",
    "check_figures",
    "check_final",
    "check_reference",
    "check_verdicts",
    "compare_tables",
    "compare_verdicts",
    "left_out_digests",
    "left_out_rows",
    "listed_in",
]

FINAL = "final.sha256"
"""List of all that a run ends in, in the folder of its results."""

_SUM = re.compile("([0-9a-f]{64})  ([^\n]+)\n")
_NUMBER = re.compile(r"-?\d+(?:\.\d+)?(?:e[+-]?\d+)?")
_MOST_NAMED, _MOST_CHUNKS = 5, 10_000
_MOST_ROWS_OF_JOIN = 5_000_000
_VERDICTS = ("claims.csv", "claims.json", "claims.md")
_GREY_LEVELS, _SHARE_OF_PIXELS = 32, 0.005


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
        """All its tables."""
        return self.files(f"{self.about.results}/tables", ".csv", ".parquet")

    @property
    def figures(self) -> list[Path]:
        """All its figures."""
        return self.files(self.about.figures, ".pdf", ".png")

    @property
    def verdicts(self) -> list[Path]:
        """The verdicts on claims, in all forms."""
        paths = [self.folder / self.about.results / name for name in _VERDICTS]
        return [path for path in paths if path.is_file()]


# ---------------------------------------------------------------------------------------------
# What a run says of itself


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
    """Hold each figure's passport against its name, its tables, and the code and lock here.

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
            passport = read_figure_metadata(path, as_drawn=True)
        except InputError as error:
            problems.append(f"{name}{str(error).removeprefix(str(path))}")
            continue
        if passport.figure not in code:
            code[passport.figure] = code_of_figure(passport.figure)
        if passport.figure != path.stem:
            problems.append(f"{name}: is figure {passport.figure}")
        if passport.version != run.about.keystab:
            problems.append(f"{name}: drawn by another version, {passport.version[:20]!a}")
        if passport.code is None or passport.code != code[passport.figure]:
            problems.append(f"{name}: drawn by other code than is here")
        if passport.lock != lock:
            problems.append(f"{name}: drawn under another environment.lock than is here")
        for table, digest in passport.tables.items():
            found = run.digest(f"{run.about.results}/tables/{table}")
            tables.add(table)
            if found != digest:
                state = "missing" if found is None else "changed"
                told = f"drawn from another {table[:80]} than the one here ({state})"
                problems.append(f"{name}: {told}")
    words = f"{len(run.figures)} drawn from the {len(tables)} tables here, by this code and lock"
    return Check("figures", words, problems)


def check_verdicts(run: Run, claims: Path, exact: bool) -> Check:
    """Judge the claims again from the tables of a run and compare.

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
    from keystab.study.claims_report import write_report
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
                if path.read_bytes() == (folder / path.name).read_bytes():
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
    """Whether two texts hold the same words, and numbers that differ by rounding at most."""
    texts = [path.read_text(encoding="utf-8") for path in (one, other)]
    words, numbers = zip(*((_NUMBER.split(it), _NUMBER.findall(it)) for it in texts), strict=True)
    return words[0] == words[1] and all(
        math.isclose(float(a), float(b), rel_tol=2e-3, abs_tol=1e-9)
        for a, b in zip(*numbers, strict=True)
    )


def verdicts_in(path: Path) -> dict[str, str]:
    """Verdicts by the names of claims, from a ledger in any of its forms.

    Raises
    ------
    InputError
        If it is no ledger. The name of the file is part of the text.
    """
    try:
        text = path.read_text(encoding="utf-8")
        found = list(_VERDICTS_OF[path.suffix](text))
    except (ValueError, TypeError, LookupError, csv.Error, RecursionError):
        found = [("", None)]
    texts = all(isinstance(it, str) for pair in found for it in pair)
    if not texts or len({name for name, _ in found}) < len(found):
        raise InputError(f"{path}: is no ledger of claims")
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


# ---------------------------------------------------------------------------------------------
# What another run says


def check_reference(run: Run, reference: Path, lock: str, other: Sequence[str] = ()) -> list[Check]:
    """Compare tables, verdicts and figures with the committed reference.

    Parameters
    ----------
    run : Run
    reference : path
        Folder that `keystab.provenance.archive.publish` wrote.
    lock : str
        SHA-256 of the lock file here.
    other : sequence of str, optional
        Names of settings that are not those of the reference, as far as they are known.

    Returns
    -------
    list of Check
        One that says why, where the reference cannot be compared with.
    """
    try:
        about = read_about(reference)
    except InputError as error:
        return [Check("results/reference", f"not compared: {str(error).split('; ')[0]}")]
    if about.settings != run.about.settings:
        named = ", ".join(other[:_MOST_NAMED]) + (" and more" if len(other) > _MOST_NAMED else "")
        told = "not compared: it was made with other settings" + (f": {named}" if named else "")
        return [Check("results/reference", told)]
    exact = alike(about, run.about.lock, run.about.arithmetic)
    return [
        compare_tables(
            reference, run.folder / run.about.results, lock, machine=run.about.arithmetic
        ),
        compare_verdicts(reference, run.folder / run.about.results),
        _compare_pictures(run, reference, about, exact),
    ]


def compare_verdicts(reference: Path, results: Path) -> Check:
    """Compare the verdicts on claims of two runs.

    Parameters
    ----------
    reference, results : path
        Folders of results; where there are no verdicts, none are compared.
    """
    try:
        before, after = (
            verdicts_in(folder / "claims.csv") if (folder / "claims.csv").is_file() else {}
            for folder in (reference, results)
        )
    except InputError as error:
        return Check("claims", "", [f"claims.csv: {str(error).partition(': ')[2]}"])
    told = [
        f"{name[:60]}: {before.get(name, 'no verdict')} before, "
        f"{after.get(name, 'no verdict')[:40]} now"
        for name in sorted(before.keys() | after.keys())
        if before.get(name) != after.get(name)
    ]
    return Check("claims", f"{len(before)} verdicts the same", told)


def _compare_pictures(run: Run, reference: Path, about: About, exact: bool) -> Check:
    """Compare figures with those of the reference that the same code drew."""
    digests = {PurePosixPath(name).name: it for name, it in left_out_digests(reference).items()}
    exact = exact and about.zlib == run.about.zlib
    problems, not_compared = [], 0
    for path in run.figures:
        expected = reference / "figures" / f"{path.stem}.png"
        try:
            mine = read_figure_metadata(path, as_drawn=True)
            its = read_figure_metadata(expected, as_drawn=True)
        except InputError:
            not_compared += 1
            continue
        alike = (mine.tables, mine.settings) == (its.tables, its.settings)
        told: str | None = None
        if (mine.code, mine.lock) == (its.code, its.lock):
            digest = run.digest(run.name(path))
            if path.suffix == ".png":
                same = digest == file_digest(expected)
                told = "" if same else _other_pixels(path, expected, alike)
            elif alike and exact and path.name in digests:
                told = "" if digest == digests[path.name] else "other bytes"
        if told:
            problems.append(f"{run.name(path)}: not as in results/reference: {told}")
        not_compared += told is None
    compared = len(run.figures) - not_compared
    words = f"{compared - len(problems)} of {compared} as in results/reference"
    why = "drawn there by other code or from other tables, or on another machine, or not at all"
    notes = [f"{not_compared} not compared: {why}"] * bool(not_compared)
    return Check("pictures", words, problems, notes)


def _has_many_chunks(path: Path) -> bool:
    """Whether a PNG has so many chunks that decoding it takes long."""
    with path.open("rb") as file:
        file.seek(8)
        for _ in range(_MOST_CHUNKS):
            head = file.read(8)
            if len(head) < 8:
                return False
            file.seek(int.from_bytes(head[:4], "big") + 4, 1)
    return True


def _other_pixels(path: Path, expected: Path, same_tables: bool) -> str:
    """Say how a picture differs from another; a little is allowed where tables differ."""
    import numpy as np
    from PIL import Image

    if _has_many_chunks(path):
        return "cannot be read"
    try:
        with Image.open(path, formats=["PNG"]) as one, Image.open(expected) as other:
            if one.size != other.size:
                return (
                    f"{one.size[0]} x {one.size[1]} pixels, there {other.size[0]} x {other.size[1]}"
                )
            a, b = (np.asarray(it.convert("RGB"), dtype=np.int16) for it in (one, other))
    except (OSError, SyntaxError, ValueError, LookupError, Image.DecompressionBombError):
        return "cannot be read"
    distance = np.abs(a - b).max(axis=2)
    if same_tables:
        n = int((distance > 0).sum())
        return f"{n} of its {distance.size} pixels differ" if n else ""
    n = int((distance > _GREY_LEVELS).sum())
    if n <= _SHARE_OF_PIXELS * distance.size:
        return ""
    return f"{n} of its {distance.size} pixels differ clearly"


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


def compare_tables(
    expected: Path,
    found: Path,
    lock: str,
    names: Sequence[str] = (),
    rtol: float = table_differences.RTOL,
    atol: float = table_differences.ATOL,
    machine: str | None = None,
) -> Check:
    """Compare tables of two runs.

    Parameters
    ----------
    expected : path
        Folder with ``archive.json`` of the one run, and its tables.
    found : path
        Folder of the results of the other.
    lock : str
        SHA-256 of the lock file of the other.
    names : sequence of str, optional
        Tables to compare, by file name; all by default.
    rtol, atol : float, optional
        Tolerances, see `keystab.provenance.table_differences.difference`. They count where software
        or processor differ; where both are the same, tables have to be the same to the last bit.
    machine : str, optional
        Arithmetic of the other run, see `keystab.provenance.run_description.arithmetic`;
        that of this machine by default.

    Returns
    -------
    Check
    """
    about = read_about(expected)
    same_machine = alike(about, lock, machine)
    tables = expected / "tables"
    if not tables.is_dir():
        tables = expected / about.results / "tables"
    paths = sorted(tables.glob("*.csv")) + sorted(tables.glob("*.parquet"))
    paths = [path for path in paths if not names or path.name in names]
    left_out = {PurePosixPath(path).name for path in left_out_digests(expected)}
    new = sorted(set(names) - {path.name for path in paths} - left_out)
    problems = [f"{name}: not in the run that it is compared with" for name in new]
    notes: list[str] = []
    same = 0
    for path in paths:
        other = found / "tables" / path.name
        if not other.is_file():
            problems.append(f"{path.name}: missing")
        elif path.read_bytes() == other.read_bytes():
            same += 1
        else:
            try:
                it = table_differences.file_difference(path, other, rtol, atol)
            except InputError:
                problems.append(f"{path.name}: no readable table")
                continue
            told = f"{path.name}: {it.words or 'the same numbers in other bytes'}"
            (notes if it.within and not same_machine else problems).append(told)
    allowed = f"numbers may differ by {rtol:g} of their size or by {atol:g}"
    why = "same lock and processor" if same_machine else f"another lock or processor: {allowed}"
    words = f"{same} of {len(paths)} the same to the last bit ({why})"
    return Check("tables", words, problems, notes)


def alike(about: About, lock: str, other: str | None = None) -> bool:
    """Whether two runs had the same software and kind of processor: then all bits are the same.

    Parameters
    ----------
    about : About
        Of the one run.
    lock : str
        SHA-256 of the lock file of the other.
    other : str, optional
        Arithmetic of the other; that of this machine by default.
    """
    return about.lock == lock and about.arithmetic == (arithmetic() if other is None else other)
