"""Commands on the study, given in the project's folder: whence, archive, reference, verify."""

from __future__ import annotations

import argparse
import time
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from keystab.provenance.unpacking import Unpacked


def whence(args: argparse.Namespace) -> None:
    """Say where a figure comes from."""
    from keystab.provenance.lineage import whence as of
    from keystab.provenance.study_folder import find_project

    print(of(args.figure, find_project()))


def archive(args: argparse.Namespace) -> None:
    """Pack a finished run into one file."""
    from keystab.provenance.archive import pack
    from keystab.provenance.lineage import file_digest
    from keystab.provenance.study_folder import Study, find_project
    from keystab.utils.memory import in_words

    path = pack(Study(find_project(), args.configfile))
    print(f"{path}: {in_words(path.stat().st_size)}, sha256 {file_digest(path)}")


def reference(args: argparse.Namespace) -> None:
    """Copy the small results of a finished run to where they can be committed."""
    from keystab.provenance.archive import publish
    from keystab.provenance.study_folder import Study, find_project
    from keystab.utils.memory import in_words

    folder = publish(Study(find_project(), args.configfile))
    sizes = [path.stat().st_size for path in folder.rglob("*") if path.is_file()]
    print(f"{folder}: {len(sizes)} files, {in_words(sum(sizes))}")


def verify(args: argparse.Namespace) -> int:
    """Check an archive, or the results that are here; recompute figures on request."""
    from keystab.errors import InputError
    from keystab.provenance import verification
    from keystab.provenance.study_folder import Study, find_project
    from keystab.provenance.unpacking import committed, unpacked
    from keystab.utils.validation import integer, number

    integer("cores", args.cores, least=1)  # Snakemake waits for ever for the first of none
    for name in ("rtol", "atol"):
        number(name, getattr(args, name) or 0, least=0)
    project = find_project()
    start = time.monotonic()
    if args.archive is None:
        print(f"results of {project}")
        checks, sound = verification.check_here(Study(project, args.configfile))
        print(verification.report(checks), flush=True)
        if args.recompute:  # the committed reference is compared with, whatever else is here
            reference = project / "results/reference"
            own = verification.check_reference_itself(reference)
            if own.problems:
                print(verification.report([own]))
            sound = not own.problems and _recompute(args, committed(reference), project) and sound
    else:
        # Taken apart once: what is recomputed is what was checked.
        with unpacked(args.archive) as held:
            try:
                checks, sound = verification.check_archive(held, project)
            except InputError as error:
                raise InputError(f"{args.archive}: {error}") from None
            print(
                f"{args.archive}: sha256 {held.digest}\n{verification.report(checks)}", flush=True
            )
            if args.recompute and sound:
                sound = _recompute(args, held, project)
            elif args.recompute:
                print("nothing is recomputed: the archive is not what a run of the study packs")
    verdict = "verified" if sound else "NOT verified: see the lines marked FAILED"
    print(f"{verdict} ({time.monotonic() - start:.0f} s)")
    return 0 if sound else 1


def _recompute(args: argparse.Namespace, held: Unpacked, project: Path) -> bool:
    """Compute figures again with the code that is here; whether the numbers are the same."""
    from keystab.provenance import recomputation, verification
    from keystab.provenance.table_differences import Allowed

    print(f"recomputing {' '.join(args.recompute)} with the code of {project}", flush=True)
    given = (args.rtol, args.atol)
    allowed = None if given == (None, None) else Allowed(*(it or 0.0 for it in given))
    checks, same = recomputation.recompute(held, project, args.recompute, args.cores, allowed)
    print(f"recomputed {' '.join(args.recompute)}\n{verification.report(checks)}")
    return same
