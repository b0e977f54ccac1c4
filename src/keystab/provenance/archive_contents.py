"""Whether an archive holds what a run packs, all of it and nothing else, and this code."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path, PurePosixPath

from keystab.provenance.archive import MORE, SOURCES
from keystab.provenance.bare_code import bare_digest, is_code
from keystab.provenance.lineage import file_digest
from keystab.provenance.result_checks import Check, Run
from keystab.provenance.run_description import ABOUT, LEFT_OUT, SUMS
from keystab.provenance.snakemake_records import FOLDER, Record
from keystab.provenance.unpacking import Unpacked

__all__ = ["check_contents", "check_sources"]

_ROOT = (ABOUT, SUMS, LEFT_OUT, "ARCHIVE.md", "ro-crate-metadata.json")
_MOST_NAMED = 10


def check_sources(held: Unpacked, project: Path) -> Check:
    """Say which files of the project are other ones in an archive.

    Whether settings, texts and comments matter, Snakemake says. Other code does: who verified an
    archive may run what is in it.
    """
    names = sorted(name for name in held.digests if _is_source(name))
    other = [
        name
        for name in names
        if not (project / name).is_file() or file_digest(project / name) != held.digests[name]
    ]
    problems = [
        f"{name}: other code than is here; do not run it"
        for name in other
        if is_code(name) and held.bare_digests.get(name) != _bare_digest_of(project / name)
    ]
    words = f"{len(names) - len(other)} of {len(names)} files of code and settings are those here"
    named = ", ".join(other[:_MOST_NAMED]) + (" and more" if len(other) > _MOST_NAMED else "")
    told = [f"not the same here: {named}; whether it matters, the next lines say"] * bool(other)
    return Check("sources", words, problems, told)


def _is_source(name: str) -> bool:
    return any(name == source or name.startswith(f"{source}/") for source in SOURCES)


def _bare_digest_of(path: Path) -> str | None:
    return bare_digest(path.read_bytes()) if path.is_file() else None


def check_contents(held: Unpacked, run: Run, left_out: Mapping[str, Mapping[str, str]]) -> Check:
    """Hold the members of an archive, its records and its list of what is left out together.

    Parameters
    ----------
    held : Unpacked
    run : Run
    left_out : mapping from str to mapping
        Rows of the list, by path.
    """
    about, records = run.about, run.records
    problems = [f"{name}: not what a run packs" for name in held.digests if not _packed(name, run)]
    made = (f"{about.results}/", f"{about.figures}/")
    behind = {name for record in records.values() for name in record.inputs}
    unknown = {name for name in {*held.digests, *behind} if name.startswith(made)}
    problems += [
        f"{name}: no record of what made it"
        for name in sorted((unknown | left_out.keys()) - records.keys())
        if not _asked_for(name, run) and name != "results/README.md"
    ]
    problems += [
        f"{name}: recorded, but neither here nor in {LEFT_OUT}"
        for name in sorted(records.keys() - held.digests.keys() - left_out.keys())
    ]
    problems += [f"{name}: here, and in {LEFT_OUT}" for name in left_out if name in held.digests]
    known = _digests_of_inputs(records)
    for name, row in left_out.items():
        checksums = held.digests.get(f"{name}.sha256")
        expected = {checksums} if checksums else known.get(name, {row["sha256"]})
        rule = records[name].rule if name in records else row["rule"]
        if {row["sha256"]} != expected or row["rule"] != rule or not row["bytes"].isdecimal():
            problems.append(f"{name}: {LEFT_OUT} says otherwise than the records of the run")
    words = f"{len(held.digests)} files that a run packs, {len(left_out)} others left out"
    told = [
        f"{name}: nothing checks what it says"
        + ("; opened in a browser, it can run what its writer wants" * name.endswith(".html"))
        for name in sorted(held.digests)
        if _asked_for(name, run)
    ]
    return Check("contents", words, problems, told)


def _digests_of_inputs(records: Mapping[str, Record]) -> dict[str, set[str]]:
    """Digests that files had when others were made from them."""
    digests: dict[str, set[str]] = {}
    for record in records.values():
        for name, digest in record.digests.items():
            digests.setdefault(name, set()).add(digest)
    return digests


def _packed(name: str, run: Run) -> bool:
    """Whether `keystab.provenance.archive.pack` writes a file of this name for a run."""
    logs = f"{run.about.logs}/benchmarks/"
    return (
        name in _ROOT
        or name in run.about.overlays
        or name in run.records
        or name.startswith(f"{FOLDER.as_posix()}/")
        or (name.startswith(logs) and name.endswith(".tsv"))
        or _is_source(name)
        or _asked_for(name, run)
    )


def _asked_for(name: str, run: Run) -> bool:
    """Whether a file is a result that is made only where it is asked for."""
    path, patterns = PurePosixPath(name), [f"{run.about.results}/{it}" for it in MORE]
    return any(path.match(it) and name.count("/") == it.count("/") for it in patterns)
