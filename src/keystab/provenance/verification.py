"""Check an archive, or the results that are here, computing nothing but verdicts.

Each check answers with one line, and names what does not hold. Nothing of the project's own results
is touched, and nothing of an archive is run: it is taken apart as data in a temporary folder, where
the rules and the code are those that are here. What this proves, and against whom, says
docs/reproduce/archive.md.
"""

from __future__ import annotations

import contextlib
import dataclasses
import os
import shutil
import tempfile
import time
from collections.abc import Mapping, Sequence
from pathlib import Path

from keystab.errors import InputError
from keystab.io.checksums import verify as verify_store
from keystab.provenance.archive import about_study, is_final
from keystab.provenance.archive_contents import check_contents, check_sources
from keystab.provenance.archived_settings import differing, place_settings, settings_of
from keystab.provenance.imported_software import software_digest, software_problems
from keystab.provenance.lineage import file_digest, printable
from keystab.provenance.result_checks import (
    Check,
    Run,
    check_columns,
    check_figures,
    check_final,
    check_verdicts,
    left_out_digests,
    left_out_rows,
    listed_in,
)
from keystab.provenance.run_comparison import alike, check_reference
from keystab.provenance.run_description import ABOUT, LEFT_OUT, SUMS
from keystab.provenance.snakemake_records import (
    Record,
    place_records,
    read_foreign_records,
    read_records,
    upstream,
)
from keystab.provenance.study_folder import Output, Study
from keystab.provenance.unpacking import Unpacked, committed
from keystab.study.settings import Settings

__all__ = ["check_archive", "check_here", "check_reference_itself", "copy_workflow", "report"]

_MOST_NAMED, _MOST_LETTERS = 10, 400
_WORKFLOW = ("Snakefile", "audit.lock", "environment.lock", "workflow", "profiles", "config")
_MOST_SECONDS = 60.0


def report(checks: Sequence[Check]) -> str:
    """Write the answers for people, problems first said and then named.

    Text that a stranger wrote is shown without what a terminal would obey.

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
    return "\n".join(printable(it[:_MOST_LETTERS]) for it in lines)


def check_archive(held: Unpacked, project: Path) -> tuple[list[Check], bool]:
    """Check an archive against a copy of the project, without computing anything but verdicts.

    Parameters
    ----------
    held : Unpacked
        What `keystab.provenance.archive.pack` wrote, taken apart.
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
        If its lists, records or settings are not what `pack` packs.
    """
    lock = file_digest(project / "environment.lock")
    here = software_digest(project / "environment.lock")
    settings = settings_of(held, project)
    # What the settings are, their files say.
    about = dataclasses.replace(held.about, settings=settings.digest)
    run = _run_of(held)._replace(about=about)
    left_out = left_out_rows(held.folder)
    elsewhere = {name: row["sha256"] for name, row in left_out.items()}
    checks = [
        check_digests(_listed(held.folder), held.digests),
        check_sources(held, project),
        check_contents(held, run, left_out),
        _check_description(held, settings.digest, lock, project),
        check_final(run),
        check_figures(run, lock),
        check_inputs(run, elsewhere),
        check_columns(run),
        check_verdicts(run, project / "config/claims.yaml", alike(about, here)),
        *_check_reference(run, project, here, settings.complete),
        check_nothing_to_do(held, run, project),
    ]
    # Others' software is no fault of the archive; then last digits may differ.
    checks += [
        dataclasses.replace(it, problems=[], notes=it.problems) for it in _check_software(project)
    ]
    return checks, not any(check.problems for check in checks)


def _run_of(held: Unpacked) -> Run:
    """The run that an archive holds; its records were checked one by one."""
    about = held.about
    records = read_foreign_records(held.folder, (about.results, about.figures))
    return Run(held.folder, about, records, held.digests)


def _check_description(held: Unpacked, settings: str, lock: str, project: Path) -> Check:
    """Ask whether the archive is of the lock file here, and of the settings that it names."""
    about, config = held.about, "config/config.yaml"
    given = {ABOUT: about.lock, "environment.lock": held.digests.get("environment.lock")}
    problems = [
        f"{name}: another environment.lock than is here"
        for name, digest in given.items()
        if digest != lock
    ]
    same_config = held.digests.get(config) == file_digest(project / config)
    if same_config and about.settings != settings:
        problems.append(f"{ABOUT}: names other settings than its files of settings are")
    return Check("description", "of the lock file here, and of the settings in here", problems)


def _listed(folder: Path) -> dict[str, str]:
    try:
        return listed_in(folder / SUMS)
    except InputError as error:
        raise InputError(f"{SUMS} {error}; get the archive again") from None


def check_digests(listed: Mapping[str, str], found: Mapping[str, str]) -> Check:
    """Hold files against the list of digests that lies beside them.

    Parameters
    ----------
    listed, found : mapping from str to str
        SHA-256 by name: as listed, and as they are; empty for a damaged file.
    """
    problems = [f"{name}: missing" for name in sorted(listed.keys() - found.keys())]
    problems += [
        f"{name}: damaged or changed"
        for name in sorted(listed.keys() & found.keys())
        if found[name] != listed[name]
    ]
    problems += [f"{name}: not in {SUMS}" for name in sorted(found.keys() - listed.keys() - {SUMS})]
    return Check("digests", f"{len(listed)} files as listed in {SUMS}", problems)


def _check_reference(run: Run, project: Path, lock: str, settings: Settings) -> list[Check]:
    """Compare with the committed reference, and say in which settings it was another run."""
    reference = project / "results/reference"
    other: list[str] = []
    with contextlib.suppress(InputError):
        its = settings_of(committed(reference), project).complete
        folders = ("results", "figures", "logs")
        other = [it for it in differing(its, settings) if it not in folders]
    return check_reference(run, reference, lock, other)


def check_reference_itself(reference: Path) -> Check:
    """Hold the files of the committed reference against its own list of digests."""
    found = {
        path.relative_to(reference).as_posix(): file_digest(path)
        for path in reference.rglob("*")
        if path.is_file()
    }
    return check_digests(_listed(reference), found)


def check_nothing_to_do(held: Unpacked, run: Run, project: Path) -> Check:
    """Ask Snakemake, in a copy of the project's workflow with the archive's results, what to run.

    Every file is made to look newer than what was made of it, so that Snakemake trusts no times: it
    holds each input that is there against the digest in its records. Files that were left out are
    not missed, because nothing that needs them has to run.
    """
    with tempfile.TemporaryDirectory() as name:
        scratch = Path(name)
        copy_workflow(project, scratch)
        overlays = place_settings(held, project, scratch)
        for place in (run.about.results, run.about.figures):
            if (held.folder / place).is_dir():
                shutil.copytree(held.folder / place, scratch / place, dirs_exist_ok=True)
        place_records(run.records, scratch)
        (scratch / ".snakemake/incomplete").mkdir(parents=True, exist_ok=True)
        _age(scratch, run.records)
        try:
            study = Study(scratch, overlays, most_seconds=_MOST_SECONDS, home=scratch)
            outputs = study.outputs()
            todo = study.to_do() if any(output.pending for output in outputs) else []
            made = {output.path for output in outputs}
            todo += [f"{it}: not made by this study" for it in run.records if it not in made]
        except InputError as error:
            todo = [str(error).replace(f"{scratch}/", "")]
    return Check("workflow", "snakemake --dry-run has nothing to do after unpacking", todo)


def copy_workflow(project: Path, scratch: Path) -> None:
    """Copy what Snakemake reads of a project: rules and settings, but no results and no library."""
    for part in _WORKFLOW:
        source = project / part
        if source.is_dir():
            shutil.copytree(source, scratch / part, dirs_exist_ok=True)
        elif source.is_file():
            shutil.copy2(source, scratch / part)


def _age(scratch: Path, records: Mapping[str, Record]) -> None:
    """Date files so that each is older than what it was made from."""
    depth: dict[str, int] = {}
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

    An archive that was unpacked is a copy of the project with results: what it left out on purpose
    is not missed there.

    Returns
    -------
    checks : list of Check
        What is missing, and what would run and why; whether files are those that Snakemake read
        when it made others from them; whether every chunk of every store is as recorded; whether
        figures, tables and verdicts are as the run ended and follow from one another; and how they
        compare with the committed reference.
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
    final = [it.path for it in outputs if is_final(it.path, study)]
    missing = [
        f"{path}: missing; `make {path}` makes it"
        for path in final
        if not (project / path).exists()
    ]
    pending = sum(output.pending for output in outputs)
    todo = _by_reason(study, pending, len(outputs)) if pending else []
    left_out = None
    if all((project / name).is_file() for name in (ABOUT, SUMS, LEFT_OUT)):
        left_out = left_out_digests(project)
    run = Run(project, about_study(study), mine)
    checks = [
        *_check_software(project),
        Check("results", f"{len(final)} figures, tables and verdicts are there", missing),
        Check("workflow", f"{len(outputs)} files up to date", todo),
        _check_records(outputs, run),
        check_inputs(run, left_out),
        _check_stores(mine, project),
        check_final(run),
        check_figures(run, study.lock_digest),
        check_columns(run),
        check_verdicts(run, project / "config/claims.yaml", exact=False),
    ]
    reference = project / "results/reference"
    if reference.is_dir():
        checks.append(check_reference_itself(reference))
        checks += _check_reference(run, project, study.lock_digest, study.settings)
    return [_once(check, missing) for check in checks], not any(it.problems for it in checks)


def _check_software(project: Path) -> list[Check]:
    """One check that failed where another thing is imported here than the lock says."""
    problems = software_problems(project / "environment.lock")
    advice = "unset PYTHONPATH, or go to the environment that `make environment` makes"
    words = "what is imported is what environment.lock says"
    return [Check("software", words, [*problems, advice])] if problems else []


def _once(check: Check, missing: Sequence[str]) -> Check:
    """Do not say again what is missing."""
    known = tuple(f"{told.partition(':')[0]}: missing" for told in missing)
    other = [told for told in check.problems if told in missing or not told.startswith(known)]
    if n := len(check.problems) - len(other):
        other.append(f"{n} missing, as said above")
    return dataclasses.replace(check, problems=other)


def _check_records(outputs: Sequence[Output], run: Run) -> Check:
    """Ask whether Snakemake knows what made each finished file; else it would not check it."""
    there = [it.path for it in outputs if not it.pending and (run.folder / it.path).exists()]
    problems = [
        f"{path}: no whole record of what made it; `snakemake --force {path}` makes it again"
        for path in there
        if path not in run.records or not run.records[path].is_whole
    ]
    return Check("records", f"{len(run.records)} of what made the files", problems)


def _by_reason(study: Study, pending: int, n_outputs: int) -> list[str]:
    """What would run, and why: a line per job where there are few, else one per kind of reason."""
    plan = study.plan()
    if len(plan) < _MOST_NAMED:
        return [f"{job}: {reason}" for job, reason in plan]
    kinds: dict[str, list[tuple[str, str]]] = {}
    for job, reason in plan:
        kinds.setdefault(reason.partition(": ")[0], []).append((job, reason))
    lines = [f"{pending} of {n_outputs} files would be made; make why says more"]
    for kind, jobs in sorted(kinds.items(), key=lambda it: -len(it[1])):
        job, reason = jobs[0]
        like_it = f", and {len(jobs) - 1} jobs like it: {kind}" if len(jobs) > 1 else f": {reason}"
        lines.append(f"{job}{like_it}")
    return lines


def check_inputs(run: Run, elsewhere: Mapping[str, str] | None = None) -> Check:
    """Hold files against the digests that they had when others were made from them.

    Parameters
    ----------
    run : Run
    elsewhere : mapping from str to str, optional
        Digests of what does not lie in its folder, such as files that were left out on purpose;
        None where there is none, and a missing file can be made again.
    """
    again = "; `make {0}` makes it again" if elsewhere is None else ""
    elsewhere = elsewhere or {}
    digests: dict[str, set[str]] = {}
    for record in run.records.values():
        for name, digest in record.digests.items():
            digests.setdefault(name, set()).add(digest)
    problems = []
    for name, expected in sorted(digests.items()):
        found = run.digest(name) or elsewhere.get(name)
        if found is None:
            problems.append(f"{name}: missing" + again.format(name))
        elif {found} != expected:
            problems.append(f"{name}: not as it was when others were made from it")
    return Check("inputs", f"{len(digests)} as they were when others were made from them", problems)


def _check_stores(records: Mapping[str, Record], project: Path) -> Check:
    stores = [name for name in records if (project / name).is_dir()]
    problems = []
    for name in stores:
        try:
            verify_store(project / name, project / f"{name}.sha256")
        except InputError as error:
            problems.append(str(error).replace(f"{project}/", ""))
    return Check("stores", f"{len(stores)} with every chunk as recorded", problems)
