"""One file that holds a finished run: results, code, settings, software versions, provenance.

The same finished run gives the same bytes: members are sorted, dated 1980, and stored without
compression, whose bytes would depend on the version of a library (pictures are compressed anyway).
"""

from __future__ import annotations

import csv
import dataclasses
import hashlib
import importlib.metadata
import io
import json
import platform
import stat
import zipfile
import zlib
from collections.abc import Iterable, Iterator, Mapping
from datetime import UTC, datetime
from pathlib import Path, PurePosixPath

from keystab._version import __version__
from keystab.errors import InputError
from keystab.provenance.lineage import file_digest
from keystab.provenance.ro_crate import Item, crate_text
from keystab.provenance.run_description import (
    ABOUT,
    AUDIT_TABLES,
    FIGURES_BESIDE,
    LEFT_OUT,
    LEFT_OUT_COLUMNS,
    SUMS,
    About,
    arithmetic,
    folder_problem,
)
from keystab.provenance.snakemake_records import FOLDER, Record, read_records
from keystab.provenance.study_folder import Output, Study
from keystab.utils.files import written_whole
from keystab.utils.memory import in_words

__all__ = ["MORE", "SOURCES", "Contents", "about_study", "is_final", "pack", "publish"]

SOURCES = (
    "CHANGELOG.md", "CITATION.cff", "CONTRIBUTING.md", "DEVIATIONS.md", "LICENSE", "Makefile",
    "README.md", "REPRODUCING.md", "Snakefile", "audit.lock", "docs.lock", "environment.lock",
    "pyproject.toml", "results/README.md", ".ci", "benchmarks", "config", "docs", "profiles", "src",
    "tests", "tools", "workflow",
)  # fmt: skip
"""Files and folders that make up the project; a file that a copy lacks is not missed."""

MORE = ("*.html", "report/*.html", "claims_pictures.*")
"""Results that are made only where they are asked for, by their places in the folder of results."""

_PLAIN, _EXECUTABLE = 0o644, 0o755
_DATE = (1980, 1, 1, 0, 0, 0)  # the earliest that the format knows


@dataclasses.dataclass(frozen=True)
class Contents:
    """A finished run, sorted into what is kept and what can be made again.

    Parameters
    ----------
    study : Study
    records : mapping from output to Record
        Of all files that the run made.
    kept, left_out : list of Output
    """

    study: Study
    records: Mapping[str, Record]
    kept: list[Output]
    left_out: list[Output]

    @classmethod
    def of(cls, study: Study) -> Contents:
        """Look at a finished run.

        Raises
        ------
        InputError
            If something of it is missing or not up to date.
        """
        outputs = study.outputs()
        todo = [
            it.path
            for it in outputs
            if it.pending or (it.status == "missing" and _is_kept(it.path, study))
        ]
        if todo:
            more = f" and {len(todo) - 1} more" if len(todo) > 1 else ""
            raise InputError(
                f"{todo[0]}{more}: missing or not up to date; finish the study first (make study)"
            )
        all_records = read_records(study.project)
        records = {it.path: all_records[it.path] for it in outputs if it.path in all_records}
        kept = [output for output in outputs if _is_kept(output.path, study)]
        left_out = [output for output in outputs if not _is_kept(output.path, study)]
        return cls(study, records, kept, left_out)

    @property
    def date(self) -> str:
        """Day on which the last file was made, in UTC."""
        last = max((record.fields["endtime"] or 0.0 for record in self.records.values()), default=0)
        return datetime.fromtimestamp(last, UTC).date().isoformat()


def is_final(path: str, study: Study) -> bool:
    """Whether an output is one that the study ends in: a figure, a table or the verdicts."""
    verdicts = PurePosixPath(path).parent.as_posix() == study.results
    return verdicts or path.startswith((f"{study.results}/tables/", f"{study.figures}/"))


def _is_kept(path: str, study: Study) -> bool:
    """Whether an output goes into the archive; the others are big and made again by the study."""
    return is_final(path, study) or path.endswith(".sha256")


def pack(study: Study, path: Path | None = None) -> Path:
    """Write the archive of a finished run.

    Parameters
    ----------
    study : Study
    path : path, optional
        File to write; ``archive/keystab-VERSION.zip`` in the folder of results by default.

    Returns
    -------
    pathlib.Path
        The file.

    Raises
    ------
    InputError
        If the run is not finished.
    """
    for key in ("results", "figures", "logs"):
        if problem := folder_problem(getattr(study, key)):
            raise InputError(
                f"{key} is {getattr(study, key)}, which {problem}: an archive is unpacked elsewhere"
            )
    contents = Contents.of(study)
    members = dict(_members(contents))
    members[LEFT_OUT] = _listed(contents.left_out, contents).encode()
    members["ARCHIVE.md"] = _guide(contents).encode()
    members[ABOUT] = _about(contents)
    members["ro-crate-metadata.json"] = _crate(contents, members).encode()
    members[SUMS] = _sums(members)
    path = path or study.project / study.results / f"archive/keystab-{__version__}.zip"
    with written_whole(path) as part:
        _write_zip(members, part)
    return path


def publish(study: Study, folder: Path | None = None) -> Path:
    """Copy tables, verdicts and PNG figures of a finished run to where they can be committed.

    Tables in Parquet, which hold pixels, and figures as PDF stay out; their digests are listed.

    Parameters
    ----------
    study : Study
    folder : path, optional
        ``results/reference`` by default; what is there is replaced.

    Returns
    -------
    pathlib.Path
        The folder.

    Raises
    ------
    InputError
        If the run is not finished.
    """
    contents = Contents.of(study)
    project = study.project
    folder = folder or project / "results/reference"
    small, big = [], []
    for output in contents.kept:
        suffix = PurePosixPath(output.path).suffix
        if suffix in (".parquet", ".pdf"):
            big.append(output)
        elif suffix != ".sha256":
            small.append(output)
    files = {
        output.path.removeprefix(f"{study.results}/").replace(f"{study.figures}/", "figures/"): (
            project / output.path
        ).read_bytes()
        for output in small
    }
    for number, overlay in enumerate(study.overlays, 1):
        files[_overlay(number, overlay)] = (project / overlay).read_bytes()
    for name, path in _beside(study):
        files[name] = path.read_bytes()
    files[ABOUT] = _about(contents)
    files[LEFT_OUT] = _listed(big, contents).encode()
    files[SUMS] = _sums(files)
    with written_whole(folder) as part:
        for name, data in sorted(files.items()):
            (part / name).parent.mkdir(parents=True, exist_ok=True)
            (part / name).write_bytes(data)
    return folder


def _beside(study: Study) -> Iterator[tuple[str, Path]]:
    """What an audit and the corpus of scenes found, where they were asked for, and its names."""
    results, figures = study.project / study.results, study.project / study.figures
    paths = [results / "tables" / name for name in AUDIT_TABLES]
    paths += [figures / name for name in FIGURES_BESIDE if name.endswith(".png")]
    for path in paths:
        if path.is_file():
            yield f"{path.stem.partition('_')[0]}/{path.name}", path
    for path in sorted((results / "scenes").glob("*.*")):
        if path.is_file():
            yield f"scenes/{path.name}", path


def _about(contents: Contents) -> bytes:
    """What the run was made by: versions, digests of lock and settings, and the machine."""
    fields = {
        **dataclasses.asdict(about_study(contents.study)),
        "finished": contents.date,
        "python": platform.python_version(),
    }
    return (json.dumps(fields, indent=1, sort_keys=True) + "\n").encode()


def about_study(study: Study) -> About:
    """What a run here and now says of itself."""
    return About(
        keystab=__version__,
        lock=study.lock_digest,
        settings=study.settings_digest,
        overlays=tuple(_overlay(number, path) for number, path in enumerate(study.overlays, 1)),
        results=study.results,
        figures=study.figures,
        logs=study.logs,
        arithmetic=arithmetic(),
        zlib=zlib.ZLIB_RUNTIME_VERSION,
    )


def _members(contents: Contents) -> Iterator[tuple[str, bytes]]:
    """Names and bytes of all that is there already."""
    study, project = contents.study, contents.study.project
    for path in sorted(_source_files(project)):
        yield path.relative_to(project).as_posix(), path.read_bytes()
    for number, overlay in enumerate(study.overlays, 1):
        yield _overlay(number, overlay), (project / overlay).read_bytes()
    for output in contents.kept:
        yield output.path, (project / output.path).read_bytes()
    for pattern in MORE:
        for path in sorted((project / study.results).glob(pattern)):
            yield path.relative_to(project).as_posix(), path.read_bytes()
    for record in contents.records.values():
        yield (FOLDER / record.path).as_posix(), record.timeless().encode()
    for path in sorted(_costs(contents)):
        yield path.relative_to(project).as_posix(), path.read_bytes()


def _overlay(number: int, path: Path) -> str:
    """Name in the archive of a file of settings that was laid over the study's own."""
    return f"settings/{number}-{path.name}"


def _source_files(project: Path) -> Iterator[Path]:
    for name in SOURCES:
        path = project / name
        files = path.rglob("*") if path.is_dir() else [path]
        for file in files:
            inside = file.relative_to(project).parts
            made = any(part == "__pycache__" or part.endswith(".egg-info") for part in inside)
            hidden = any(part.startswith(".") for part in inside[1:])
            if file.is_file() and not made and not hidden and file.suffix != ".pyc":
                yield file


def _costs(contents: Contents) -> Iterator[Path]:
    """Benchmark records of the jobs; they lie as the logs do."""
    logs = contents.study.logs
    for log in {log for output in contents.kept + contents.left_out for log in output.logs}:
        inside = PurePosixPath(log).relative_to(logs).with_suffix(".tsv")
        path = contents.study.project / logs / "benchmarks" / inside
        if path.is_file():
            yield path


def _listed(outputs: Iterable[Output], contents: Contents) -> str:
    """Table of files that are not there: how big they are, what is in them, and what makes them."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(LEFT_OUT_COLUMNS)
    recorded: dict[str, str] = {}
    for record in contents.records.values():
        recorded |= record.digests
    for output in outputs:
        path = contents.study.project / output.path
        digest = _digest(path) or recorded.get(output.path, "")
        writer.writerow([output.path, _size(path), digest, output.rule])
    return text.getvalue()


def _size(path: Path) -> int:
    files = path.rglob("*") if path.is_dir() else [path]
    return sum(file.stat().st_size for file in files if file.is_file())


def _digest(path: Path) -> str | None:
    """SHA-256 of a file; of a store, that of its checksums; None for what somebody deleted."""
    checksums = path.with_name(f"{path.name}.sha256")
    if checksums.is_file():
        return file_digest(checksums)
    return file_digest(path) if path.is_file() else None


def _guide(contents: Contents) -> str:
    """Write ARCHIVE.md."""
    study, project = contents.study, contents.study.project
    groups: dict[str, list[int]] = {}
    for output in contents.left_out:
        inside = PurePosixPath(output.path).relative_to(study.results)
        groups.setdefault(inside.parts[0], []).append(_size(project / output.path))
    rows = [
        f"| `{study.results}/{name}` | {len(sizes)} | {in_words(sum(sizes))} |"
        for name, sizes in sorted(groups.items())
    ]
    overlays = " ".join(_overlay(number, path) for number, path in enumerate(study.overlays, 1))
    flag = f" --configfile {overlays}" if overlays else ""
    pictures = sorted(
        {
            name
            for record in contents.records.values()
            for name in record.inputs
            if PurePosixPath(name).is_absolute()
        }
    )
    outside = "".join(
        f"\nThe run also read `{name}`, which lies outside the project and is not in here.\n"
        for name in pictures
    )
    return _GUIDE.format(
        version=__version__,
        results=study.results,
        figures=study.figures,
        logs=study.logs,
        rows="\n".join(rows),
        flag=flag,
        outside=outside,
    )


_GUIDE = """\
# keystab {version}: a finished run

Figures are in `{figures}`, the numbers that they draw in `{results}/tables`, the verdicts on the
claims of the paper in `{results}/claims.md`. The rest is what made them: all code, settings,
`environment.lock` with every package and its hash, Snakemake's record of each job
(`.snakemake/metadata`: command, settings, digests of inputs), and what each job cost
(`{logs}/benchmarks`). `ro-crate-metadata.json` describes the files for repositories.

Dates were taken from Snakemake's records, durations were kept.

## To check it

In a copy of the project (this archive unpacked is one; `unzip` it into a folder of its own):

```sh
make verify ARCHIVE=/path/to/keystab-{version}.zip                  # in seconds: computes nothing
make verify ARCHIVE=/path/to/keystab-{version}.zip RECOMPUTE=fig5   # figure 5 from the picture on
make verify ARCHIVE=/path/to/keystab-{version}.zip RECOMPUTE=all    # everything
```

`sha256sum -c SHA256SUMS` checks the unpacked files without any of this.

## What is left out

| | files and stores | size |
|---|---:|---:|
{rows}

`left-out.csv` names each with its size and digest; that of a Zarr store is the digest of the
checksums beside it, which are in here and name every chunk. Unpacked, Snakemake takes the study for
finished without them. This makes one again, and what it needs:

```sh
snakemake -j2 PATH{flag}
```
{outside}"""


def _crate(contents: Contents, members: Mapping[str, bytes]) -> str:
    hidden = [name for name in members if name.startswith(".")]
    items = {
        name: Item(len(data), hashlib.sha256(data).hexdigest())
        for name, data in members.items()
        if name not in hidden
    }
    used = {name for record in contents.records.values() for name in record.inputs}
    made = {output.path for output in contents.kept}
    settings = [name for name in items if name.startswith(("config/", "settings/"))]
    inputs = sorted({*settings, "environment.lock", *(used & items.keys() - made)})
    words = {
        SUMS: "SHA-256 of every file",
        LEFT_OUT: "Files that the run made and that are not in here, with sizes and digests",
        ABOUT: "Versions, digests of lock and settings, and the machine",
        "environment.lock": "Every software package with its version and hash",
    } | {output.path: f"Made by the rule {output.rule}" for output in contents.kept}
    snakemake = importlib.metadata.version("snakemake")
    return crate_text(items, inputs, sorted(made), __version__, snakemake, contents.date, words)


def _write_zip(members: Mapping[str, bytes], path: Path) -> None:
    """Write a zip file whose bytes depend on the names and bytes of its members alone."""
    with zipfile.ZipFile(path, "w", zipfile.ZIP_STORED) as file:
        for name, data in sorted(members.items()):
            info = zipfile.ZipInfo(name, _DATE)
            info.create_system = 3  # Unix, also where written elsewhere
            mode = _EXECUTABLE if data.startswith(b"#!") else _PLAIN
            info.external_attr = (stat.S_IFREG | mode) << 16
            file.writestr(info, data)


def _sums(files: Mapping[str, bytes]) -> bytes:
    """List the digests of files as ``sha256sum`` does."""
    lines = [
        f"{hashlib.sha256(data).hexdigest()}  {name}\n" for name, data in sorted(files.items())
    ]
    return "".join(lines).encode()
