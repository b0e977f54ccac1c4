"""Compute figures of a run again, and say by how much their numbers differ."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path, PurePosixPath

from keystab.errors import InputError
from keystab.io.checksums import read_sums
from keystab.provenance.archived_settings import place_settings
from keystab.provenance.lineage import file_digest
from keystab.provenance.result_checks import Check, left_out_digests
from keystab.provenance.run_comparison import alike, compare_tables, compare_verdicts
from keystab.provenance.run_description import About
from keystab.provenance.snakemake_records import Record, read_records
from keystab.provenance.study_folder import Study
from keystab.provenance.unpacking import Unpacked
from keystab.provenance.verification import copy_workflow
from keystab.study.column_tolerances import Allowed

__all__ = ["recompute"]


def recompute(
    held: Unpacked,
    project: Path,
    targets: Sequence[str],
    cores: int,
    allowed: Allowed | None = None,
) -> tuple[list[Check], bool]:
    """Compute figures again from the picture on and compare with a run.

    The code is that of the project; of the run, which may be a stranger's, settings and pictures
    are used as data. All that is written lies in a temporary folder.

    Parameters
    ----------
    held : Unpacked
        The run: an archive that was taken apart and checked, or the committed reference.
    project : path
        Copy of the project whose code, settings and lock are used.
    targets : sequence of str
        Names of figures, such as ``fig5``; or ``all``.
    cores : int
        Jobs at a time.
    allowed : Allowed, optional
        See `compare_tables`.

    Returns
    -------
    checks : list of Check
        How tables, figures, verdicts and intermediate files compare.
    sound : bool
        Whether nothing failed.

    Raises
    ------
    InputError
        If a figure is none of the study, or a job fails.
    """
    source, about = held.folder, held.about
    everything = list(targets) == ["all"]
    with tempfile.TemporaryDirectory() as name:
        scratch = Path(name)
        copy_workflow(project, scratch)
        study = Study(scratch, place_settings(held, project, scratch), home=scratch)
        drawn = [
            f"{study.figures}/{target}.{kind}" for target in targets for kind in ("pdf", "png")
        ]
        known = {output.path for output in study.outputs()}
        for path in [] if everything else drawn:
            if path not in known:
                figures = sorted({Path(it).stem for it in known if it.startswith(study.figures)})
                raise InputError(f"{Path(path).stem}: no figure; give {', '.join(figures)} or all")
        study.run(cores, *([] if everything else drawn))
        records = read_records(scratch)
        tables = [
            PurePosixPath(path).name
            for path in records
            if path.startswith(f"{study.results}/tables/")
        ]
        checks = [
            compare_tables(source, scratch / study.results, study.lock_digest, tables, allowed),
            _compare_figures(source, study, records, about),
        ]
        if everything:
            inside = source if (source / "claims.csv").is_file() else source / about.results
            checks.append(compare_verdicts(inside, scratch / study.results))
        checks.append(_compare_left_out(source, study, records, about))
    return checks, not any(check.problems for check in checks)


def _compare_figures(
    source: Path, study: Study, records: Mapping[str, Record], about: About
) -> Check:
    """Compare drawn figures byte by byte; they carry the digests of their tables."""
    inside = source / about.figures
    inside = inside if inside.is_dir() else source / "figures"
    paths = [path for path in records if path.startswith(f"{study.figures}/")]
    paths = [path for path in paths if (inside / PurePosixPath(path).name).is_file()]
    told = [
        f"{path}: other bytes"
        for path in paths
        if (study.project / path).read_bytes() != (inside / PurePosixPath(path).name).read_bytes()
    ]
    words = f"{len(paths) - len(told)} of {len(paths)} the same to the last bit"
    same_machine = alike(about, study.lock_digest)
    return Check("figures", words, told if same_machine else [], [] if same_machine else told)


def _compare_left_out(
    source: Path, study: Study, records: Mapping[str, Record], about: About
) -> Check:
    """Compare files that were left out with the digests that were not."""
    digests = left_out_digests(source)
    made = sorted(digests.keys() & records.keys())
    other = []
    for path in made:
        checksums = study.project / f"{path}.sha256"
        store = (study.project / path).is_dir()
        if file_digest(checksums if store else study.project / path) != digests[path]:
            told = _other_chunks(source, checksums, path) if store else "other bytes"
            other.append(f"{path}: {told}")
    words = f"{len(made) - len(other)} of {len(made)} the same to the last bit"
    same_machine = alike(about, study.lock_digest)
    return Check("left out", words, other if same_machine else [], [] if same_machine else other)


def _other_chunks(source: Path, checksums: Path, path: str) -> str:
    """Name the files of a store that are not as its archived checksums say."""
    archived = source / f"{path}.sha256"
    if not archived.is_file():
        return "other bytes"
    before, after = (read_sums(it.read_text(encoding="utf-8")) for it in (archived, checksums))
    names = [name for name in sorted(before | after) if before.get(name) != after.get(name)]
    return f"{len(names)} of {len(before)} files differ, first {names[0]}"
