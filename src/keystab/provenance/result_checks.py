"""Whether figures, tables and verdicts that a run ended in belong together.

All that is looked at may come from a stranger. It is read as data, in bounded time and memory.
"""

from __future__ import annotations

import csv
import dataclasses
import io
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path, PurePosixPath
from typing import NamedTuple

from keystab.errors import InputError
from keystab.io.checksums import read_sums
from keystab.io.figure_metadata import FigureMetadata
from keystab.provenance import table_differences
from keystab.provenance.column_relations import broken_relations
from keystab.provenance.lineage import code_of_figure, file_digest, read_figure_metadata
from keystab.provenance.run_description import LEFT_OUT, About, arithmetic, read_about
from keystab.provenance.snakemake_records import Record

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
    "left_out_digests",
]

FINAL = "final.sha256"
"""List of all that a run ends in, in the folder of its results."""

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
    """A finished run: where it lies, what it says of itself, and Snakemake's records of it."""

    folder: Path
    about: About
    records: Mapping[str, Record]

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
        listed = read_sums(path.read_text(encoding="utf-8"))
    except UnicodeError:
        return Check("final", "", [f"{place}: is no list of digests"])
    recorded = run.records[place].digests
    there = {run.name(it): it for it in (*run.figures, *run.tables, *run.verdicts)}
    problems = [f"{name}: missing" for name in sorted(listed.keys() - there.keys())]
    problems += [f"{name}: not in {place}" for name in sorted(there.keys() - listed.keys())]
    for name in sorted(listed.keys() & there.keys()):
        if file_digest(there[name]) != listed[name]:
            problems.append(f"{name}: not as it was when the run ended")
    problems += [
        f"{name}: {place} says otherwise than the record of the run"
        for name in sorted(listed.keys() | recorded.keys())
        if listed.get(name) != recorded.get(name)
    ]
    return Check("final", f"{len(listed)} figures, tables and verdicts as the run ended", problems)


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
        if passport.code != code[passport.figure]:
            problems.append(f"{name}: drawn by other code than is here")
        if passport.lock != lock:
            problems.append(f"{name}: drawn under another environment.lock than is here")
        for table, digest in passport.tables.items():
            found = run.folder / run.about.results / "tables" / table
            tables.add(table)
            if not found.is_file() or file_digest(found) != digest:
                state = "changed" if found.is_file() else "missing"
                problems.append(f"{name}: drawn from another {table} than the one here ({state})")
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
    from keystab.io.tables import read_table
    from keystab.study.claims import read_claims, table_names
    from keystab.study.claims_report import write_report
    from keystab.study.verdicts import outcomes_of

    if not claims.is_file():
        return Check("verdicts", "there are no claims here to judge")
    folder = run.folder / run.about.results
    problems = [f"{name}: missing" for name in _VERDICTS if not (folder / name).is_file()]
    if problems:
        return Check("verdicts", "", problems)
    try:
        asked = read_claims(claims)
        tables = {
            name: read_table(folder / "tables" / f"{name}.csv") for name in table_names(asked)
        }
        with tempfile.TemporaryDirectory() as scratch:
            again = [Path(scratch) / name for name in _VERDICTS]
            write_report(outcomes_of(asked, tables), *again)
            for path in again:
                if path.read_bytes() == (folder / path.name).read_bytes():
                    continue
                place = f"{run.about.results}/{path.name}"
                told = list(_other_verdicts(folder / path.name, path))
                told = told or (["other numbers or words than its tables give"] if exact else [])
                problems += [f"{place}: {it}" for it in told]
    except (InputError, ValueError, TypeError, KeyError, csv.Error, RecursionError) as error:
        said = " ".join(str(error).replace(f"{run.folder}/", "").split())
        return Check("verdicts", "", [said[:200] or "cannot be judged from the tables here"])
    return Check("verdicts", f"{len(asked)} judged again from the tables, all the same", problems)


def _other_verdicts(given: Path, again: Path) -> Iterator[str]:
    """Verdicts that are not those which the tables give."""
    before, after = verdicts_in(given), verdicts_in(again)
    for name in sorted(before.keys() | after.keys()):
        if before.get(name) != after.get(name):
            yield (
                f"{name[:60]} is {str(before.get(name, 'absent'))[:40]!r}, its tables give "
                f"{after.get(name, 'no such claim')!r}"
            )


def verdicts_in(path: Path) -> dict[str, str]:
    """Verdicts by the names of claims, from a ledger in any of its forms.

    Raises
    ------
    ValueError, TypeError, KeyError, csv.Error
        If it is no ledger.
    """
    import json

    text = path.read_text(encoding="utf-8")
    if path.suffix == ".csv":
        return {row["id"]: row["verdict"] for row in csv.DictReader(io.StringIO(text))}
    if path.suffix == ".json":
        return {str(row["id"]): str(row["verdict"]) for row in json.loads(text)}
    verdict, found = "", {}
    for line in text.split("\n"):
        if line.startswith("## "):
            verdict = line.removeprefix("## ").lower()
        elif line.startswith("| `"):
            found[line.split("`")[1]] = verdict
    return found


def check_columns(run: Run) -> Check:
    """Ask of each table whether its columns follow from one another where they have to."""
    from keystab.io.tables import read_table

    problems, asked = [], 0
    for path in run.tables:
        if path.suffix != ".csv":
            continue
        try:
            broken = broken_relations(path.stem, read_table(path))
        except InputError as error:
            broken = [str(error).removeprefix(f"{path}: ")]
        asked += 1
        problems += [f"{run.name(path)}: {it}" for it in broken]
    words = f"{asked} tables, whose columns follow from one another where they have to"
    return Check("columns", words, problems)


# ---------------------------------------------------------------------------------------------
# What another run says


def check_reference(run: Run, reference: Path, lock: str) -> list[Check]:
    """Compare tables, verdicts and figures with the committed reference.

    Parameters
    ----------
    run : Run
    reference : path
        Folder that `keystab.provenance.archive.publish` wrote.
    lock : str
        SHA-256 of the lock file here.

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
        return [Check("results/reference", "not compared: it was made with other settings")]
    exact = alike(about, run.about.lock, run.about.arithmetic)
    before, after = (
        verdicts_in(folder / "claims.csv") if (folder / "claims.csv").is_file() else {}
        for folder in (reference, run.folder / run.about.results)
    )
    told = [
        f"{name}: {before.get(name, 'no verdict')} in results/reference, "
        f"{after.get(name, 'no verdict')} here"
        for name in sorted(before.keys() | after.keys())
        if before.get(name) != after.get(name)
    ]
    return [
        compare_tables(
            reference, run.folder / run.about.results, lock, machine=run.about.arithmetic
        ),
        Check("claims", f"{len(before)} verdicts as in results/reference", told),
        _compare_pictures(run, reference, about, exact),
    ]


def _compare_pictures(run: Run, reference: Path, about: About, exact: bool) -> Check:
    """Compare figures with those of the reference that the same code drew."""
    digests = {PurePosixPath(name).name: it for name, it in left_out_digests(reference).items()}
    problems, same = [], 0
    compared = [
        path for path in run.figures if (reference / "figures" / f"{path.stem}.png").is_file()
    ]
    by_other_code = 0
    for path in compared:
        expected = reference / "figures" / f"{path.stem}.png"
        try:
            mine = read_figure_metadata(path, as_drawn=True)
            its = read_figure_metadata(expected, as_drawn=True)
        except InputError:
            continue  # said by check_figures
        if (mine.code, mine.lock, mine.version) != (its.code, its.lock, its.version):
            by_other_code += 1
            continue
        told = ""
        if path.suffix == ".png":
            told = _other_pixels(path, expected, _same_tables(mine, its))
        elif _same_tables(mine, its) and exact and about.zlib and about.zlib == run.about.zlib:
            known = digests.get(path.name)
            told = "" if known in (None, file_digest(path)) else "other bytes"
        if told:
            problems.append(f"{run.name(path)}: not as in results/reference: {told}")
        else:
            same += 1
    words = f"{same} of {len(run.figures)} as in results/reference"
    notes = [f"{by_other_code} were drawn there by other code, and not compared"] * bool(
        by_other_code
    )
    return Check("pictures", words, problems, notes)


def _same_tables(one: FigureMetadata, other: FigureMetadata) -> bool:
    return (one.tables, one.settings) == (other.tables, other.settings)


def _other_pixels(path: Path, expected: Path, same_tables: bool) -> str:
    """Say how a picture differs from another; a little is allowed where tables differ."""
    import numpy as np
    from PIL import Image

    try:
        with Image.open(path) as one, Image.open(expected) as other:
            if one.size != other.size:
                return (
                    f"{one.size[0]} x {one.size[1]} pixels, there {other.size[0]} x {other.size[1]}"
                )
            a, b = (np.asarray(it.convert("RGB"), dtype=np.int16) for it in (one, other))
    except (OSError, SyntaxError, ValueError, Image.DecompressionBombError):
        return "cannot be read"
    distance = np.abs(a - b).max(axis=2)
    if same_tables:
        share = float((distance > 0).mean())
        return f"{share:.1%} of its pixels differ" if share else ""
    share = float((distance > _GREY_LEVELS).mean())
    return f"{share:.1%} of its pixels differ clearly" if share > _SHARE_OF_PIXELS else ""


def left_out_digests(folder: Path) -> dict[str, str]:
    """Digests of the files that a run left out, by their paths; none where nothing was.

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
            return {row["path"]: row["sha256"] for row in csv.DictReader(lines)}
    except (ValueError, KeyError, csv.Error):
        raise InputError(f"{LEFT_OUT}: is no list of files; get the archive again") from None


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
