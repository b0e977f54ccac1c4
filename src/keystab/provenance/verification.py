"""Check an archive, the committed reference or the results that are here, computing nothing.

Each check answers with one line, and names what does not hold. Nothing of the project's own results
is touched: archives are unpacked in temporary folders.
"""

from __future__ import annotations

import contextlib
import csv
import dataclasses
import json
import os
import shutil
import tempfile
import time
import zipfile
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path, PurePosixPath
from typing import Any

from keystab.errors import InputError
from keystab.io.checksums import verify as verify_seal
from keystab.provenance import table_differences
from keystab.provenance.archive import ABOUT, LEFT_OUT, SUMS, arithmetic, read_sums
from keystab.provenance.lineage import code_of_figure, file_digest, read_figure_metadata
from keystab.provenance.snakemake_records import Record, read_records, upstream
from keystab.provenance.study_folder import Study

__all__ = [
    "Check",
    "alike",
    "check_archive",
    "check_digests",
    "check_here",
    "compare_tables",
    "copy_workflow",
    "left_out_digests",
    "read_about",
    "report",
    "require_archive",
    "unpacked",
]

_MOST_NAMED = 10
_WORKFLOW = ("Snakefile", "environment.lock", "workflow", "profiles", "config")


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


def report(checks: Sequence[Check]) -> str:
    """Write the answers for people, problems first said and then named.

    Examples
    --------
    >>> print(report([Check("digests", "3 files as listed"), Check("code", "", ["fig5: changed"])]))
    ok      digests: 3 files as listed
    FAILED  code
              fig5: changed
    """
    lines = []
    for check in checks:
        if check.problems:
            lines.append(f"FAILED  {check.what}")
        else:
            lines.append(f"ok      {check.what}: {check.words}")
        more = len(check.problems) - _MOST_NAMED
        shown = check.problems if more <= 0 else check.problems[:_MOST_NAMED]
        lines += [f"          {problem}" for problem in shown]
        lines += [f"          and {more} more"] * (more > 0)
        lines += [f"          note: {note}" for note in check.notes]
    return "\n".join(lines)


def require_archive(path: Path) -> None:
    """Raise `InputError` where there is no such file."""
    if not path.is_file():
        raise InputError(f"{path}: no such file; make archive writes one")


@contextlib.contextmanager
def unpacked(archive: Path) -> Iterator[Path]:
    """Unpack an archive into a temporary folder for as long as a block runs.

    Raises
    ------
    InputError
        If it is no archive of this study, or holds paths that lead out of its folder.
    """
    require_archive(archive)
    try:
        with zipfile.ZipFile(archive) as file, tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            for member in file.infolist():
                path = PurePosixPath(member.filename)
                if path.is_absolute() or ".." in path.parts or "\\" in member.filename:
                    raise InputError(f"{archive}: {member.filename} leads out of its folder")
                target = folder / path
                target.parent.mkdir(parents=True, exist_ok=True)
                target.write_bytes(_bytes_of(file, member))
            if not (folder / ABOUT).is_file() or not (folder / SUMS).is_file():
                raise InputError(f"{archive}: no archive of this study; make archive writes one")
            yield folder
    except (zipfile.BadZipFile, OSError) as error:
        if isinstance(error, OSError) and error.errno is not None:
            raise
        raise InputError(f"{archive}: not a whole zip file; get it again") from None


def _bytes_of(file: zipfile.ZipFile, member: zipfile.ZipInfo) -> bytes:
    """Read a member; nothing where it is damaged, so that its digest tells, by its name."""
    try:
        return file.read(member)
    except zipfile.BadZipFile:
        return b""


def check_archive(archive: Path, project: Path) -> tuple[list[Check], bool]:
    """Check an archive against a copy of the project, without computing anything.

    Parameters
    ----------
    archive : path
        What `keystab.provenance.archive.pack` wrote.
    project : path
        The copy, whose code, settings and lock the archive is held against.

    Returns
    -------
    checks : list of Check
    sound : bool
        Whether nothing failed.

    Raises
    ------
    InputError
        If it is no archive of this study.
    """
    with unpacked(archive) as folder:
        about = read_about(folder)
        checks = [
            check_digests(folder),
            _check_sources(folder, project),
            _check_figures(folder, about, project),
            _check_inputs(read_records(folder), folder, left_out_digests(folder)),
            _check_nothing_to_do(folder, about, project),
        ]
    return checks, not any(check.problems for check in checks)


def read_about(folder: Path) -> Mapping[str, Any]:
    """Read what a run says about itself.

    Raises
    ------
    InputError
        If it does not say it.
    """
    try:
        about = json.loads((folder / ABOUT).read_text(encoding="utf-8"))
        _ = [about[key] for key in ("lock", "settings", "overlays", "results", "figures", "logs")]
    except (OSError, ValueError, KeyError, TypeError):
        raise InputError(
            f"{folder / ABOUT}: no such file, or it says nothing about a run; make reference or "
            "make archive writes it"
        ) from None
    return about


def check_digests(folder: Path) -> Check:
    """Hold every file of a folder against the list of digests that lies in it."""
    sums = read_sums((folder / SUMS).read_text(encoding="utf-8"))
    there = {path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file()}
    problems = [f"{name}: missing" for name in sorted(sums.keys() - there)]
    problems += [
        f"{name}: damaged or changed"
        for name in sorted(sums.keys() & there)
        if file_digest(folder / name) != sums[name]
    ]
    problems += [f"{name}: not in {SUMS}" for name in sorted(there - sums.keys() - {SUMS})]
    return Check("digests", f"{len(sums)} files as listed in {SUMS}", problems)


def _check_sources(folder: Path, project: Path) -> Check:
    """Say which sources differ; whether that matters, Snakemake says."""
    names = [
        path.relative_to(folder)
        for part in ("src", *_WORKFLOW)
        for path in ([folder / part] if (folder / part).is_file() else (folder / part).rglob("*"))
        if path.is_file()
    ]
    other = [
        name.as_posix()
        for name in sorted(names)
        if not (project / name).is_file()
        or (project / name).read_bytes() != (folder / name).read_bytes()
    ]
    words = f"{len(names) - len(other)} of {len(names)} files of code and settings are those here"
    named = ", ".join(other[:_MOST_NAMED]) + (" and more" if len(other) > _MOST_NAMED else "")
    told = f"not the same here: {named}; whether it matters, the next lines say"
    return Check("sources", words, notes=[told] if other else [])


def _check_figures(folder: Path, about: Mapping[str, Any], project: Path) -> Check:
    """Hold each passport against the tables beside its figure, and the code and lock here."""
    figures = sorted((folder / about["figures"]).glob("*.p[dn][fg]"))
    lock = file_digest(project / "environment.lock")
    problems = [] if figures else [f"{about['figures']}: holds no figures"]
    code: dict[str, str | None] = {}
    tables = set()
    for path in figures:
        name = path.relative_to(folder).as_posix()
        try:
            passport = read_figure_metadata(path)
        except InputError as error:
            problems.append(f"{name}{str(error).removeprefix(str(path))}")
            continue
        if passport.figure not in code:
            code[passport.figure] = code_of_figure(passport.figure)
        if passport.code != code[passport.figure]:
            problems.append(f"{name}: drawn by other code than is here")
        if passport.lock != lock:
            problems.append(f"{name}: drawn under another environment.lock than is here")
        for table, digest in passport.tables.items():
            found = folder / about["results"] / "tables" / table
            tables.add(table)
            if not found.is_file() or file_digest(found) != digest:
                state = "changed" if found.is_file() else "missing"
                problems.append(f"{name}: drawn from another {table} than the one here ({state})")
    words = f"{len(figures)} drawn from the {len(tables)} tables here, by this code and lock"
    return Check("figures", words, problems)


def _check_nothing_to_do(folder: Path, about: Mapping[str, Any], project: Path) -> Check:
    """Ask Snakemake, in a copy of the project's workflow with the archive's results, what to run.

    Every file is made to look newer than what was made of it, so that Snakemake trusts no times: it
    holds each input that is there against the digest in its records. Files that were left out are
    not missed, because nothing that needs them has to run.
    """
    with tempfile.TemporaryDirectory() as name:
        scratch = Path(name)
        copy_workflow(project, scratch)
        for part in (about["results"], about["figures"], ".snakemake/metadata", "settings"):
            if (folder / part).is_dir():
                shutil.copytree(folder / part, scratch / part, dirs_exist_ok=True)
        (scratch / ".snakemake/incomplete").mkdir(parents=True, exist_ok=True)
        _age(scratch)
        try:
            todo = Study(scratch, about["overlays"]).to_do()
        except InputError as error:
            todo = [str(error)]
    return Check("workflow", "snakemake --dry-run has nothing to do after unpacking", todo)


def copy_workflow(project: Path, scratch: Path) -> None:
    """Copy what Snakemake reads of a project: rules and settings, but no results and no library."""
    for part in _WORKFLOW:
        source = project / part
        if source.is_dir():
            shutil.copytree(source, scratch / part, dirs_exist_ok=True)
        elif source.is_file():
            shutil.copy2(source, scratch / part)


def _age(scratch: Path) -> None:
    """Date files so that each is older than what it was made from."""
    depth: dict[str, int] = {}
    records = read_records(scratch)
    for record in upstream(records, records):
        depth[record.output] = 1 + max((depth.get(name, 0) for name in record.inputs), default=0)
    now = time.time()
    for path in (scratch / "config").rglob("*"):
        os.utime(path, (now, now))
    for name, level in depth.items():
        if (scratch / name).exists():
            os.utime(scratch / name, (now - 10.0 * level, now - 10.0 * level))


def check_here(study: Study) -> tuple[list[Check], bool]:
    """Check the results that are here against the records of Snakemake, without computing.

    Returns
    -------
    checks : list of Check
        Whether the study is finished; whether files are those that Snakemake read when it made
        others from them; whether every chunk of every store is as sealed; whether figures were
        drawn from the tables here; and how tables compare with the committed reference.
    sound : bool
        Whether nothing failed.

    Raises
    ------
    InputError
        If Snakemake cannot plan the study.
    """
    project = study.project
    outputs = study.outputs()
    records = read_records(project)
    mine = {output.path: records[output.path] for output in outputs if output.path in records}
    todo = [f"{it.path}: {it.status}" for it in outputs if it.pending]
    about = {"figures": study.figures, "results": study.results}
    checks = [
        Check("workflow", f"{len(outputs)} files up to date", todo),
        _check_inputs(mine, project),
        _check_stores(mine, project),
        _check_figures(project, about, project),
    ]
    reference = project / "results/reference"
    if reference.is_dir():
        checks.append(check_digests(reference))
        if read_about(reference)["settings"] == study.settings_digest:
            checks.append(compare_tables(reference, project / study.results, study.lock_digest))
        else:
            words = "not compared: it was made with other settings"
            checks.append(Check("results/reference", words))
    return checks, not any(check.problems for check in checks)


def left_out_digests(folder: Path) -> dict[str, str]:
    """Digests of the files that a run left out, by their paths; none where nothing was."""
    path = folder / LEFT_OUT
    if not path.is_file():
        return {}
    with path.open(newline="", encoding="utf-8") as lines:
        return {row["path"]: row["sha256"] for row in csv.DictReader(lines)}


def _check_inputs(
    records: Mapping[str, Record], project: Path, left_out: Mapping[str, str] | None = None
) -> Check:
    """Hold files against the digests that they had when others were made from them."""
    again = "; `make {0}` makes it again" if left_out is None else ""
    left_out = left_out or {}
    digests: dict[str, set[str]] = {}
    for record in records.values():
        for name, digest in record.digests.items():
            digests.setdefault(name, set()).add(digest)
    problems = []
    for name, expected in sorted(digests.items()):
        if (project / name).is_file():
            found = file_digest(project / name)
        elif name in left_out:
            found = left_out[name]
        else:
            problems.append(f"{name}: missing" + again.format(name))
            continue
        if {found} != expected:
            problems.append(f"{name}: not as it was when others were made from it")
    return Check("inputs", f"{len(digests)} as they were when others were made from them", problems)


def _check_stores(records: Mapping[str, Record], project: Path) -> Check:
    stores = [name for name in records if (project / name).is_dir()]
    problems = []
    for name in stores:
        try:
            verify_seal(project / name, project / f"{name}.sha256")
        except InputError as error:
            problems.append(str(error).replace(f"{project}/", ""))
    return Check("stores", f"{len(stores)} with every chunk as sealed", problems)


def compare_tables(
    expected: Path,
    found: Path,
    lock: str,
    names: Sequence[str] = (),
    rtol: float = table_differences.RTOL,
    atol: float = table_differences.ATOL,
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

    Returns
    -------
    Check
    """
    about = read_about(expected)
    same_machine = alike(about, lock)
    tables = expected / "tables"
    if not tables.is_dir():
        tables = expected / about["results"] / "tables"
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
            it = table_differences.file_difference(path, other, rtol, atol)
            told = f"{path.name}: {it.words or 'the same numbers in other bytes'}"
            (notes if it.within and not same_machine else problems).append(told)
    allowed = f"numbers may differ by {rtol:g} of their size or by {atol:g}"
    why = "same lock and processor" if same_machine else f"another lock or processor: {allowed}"
    words = f"{same} of {len(paths)} the same to the last bit ({why})"
    return Check("tables", words, problems, notes)


def alike(about: Mapping[str, Any], lock: str) -> bool:
    """Whether a run had this software and this kind of processor: then all bits are the same."""
    return bool(about["lock"] == lock and about.get("arithmetic") == arithmetic())
