"""Where a figure comes from: its metadata, the files behind it, and how to make it again."""

from __future__ import annotations

import hashlib
import re
import shlex
import warnings
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path

from keystab.errors import InputError
from keystab.io.figure_metadata import PNG_KEY, FigureMetadata
from keystab.provenance.code_digest import fingerprint
from keystab.provenance.imported_software import software_digest, software_problems
from keystab.provenance.snakemake_records import Record, read_records, settings_behind, upstream
from keystab.study.overlays import on_command_line, overlays_of

__all__ = ["code_of_figure", "file_digest", "printable", "read_figure_metadata", "whence"]

_SHORT = 12
_MOST_PIXELS = 100_000_000
_OF_SCENE = re.compile("/scenes/[^/]+$")
_ESCAPE = re.compile(rb"\\([0-7]{1,3}|.)", re.DOTALL)
_KEYWORDS_START = b"/Keywords ("
_KEYWORDS = re.compile(rb"/Keywords \(((?:[^()\\]|\\.)*)\)", re.DOTALL)
_MOST_BYTES, _MOST_CHUNKS = 100_000, 100
"""Of the metadata of a figure, which list the tables of one figure, and of a PNG before it."""


def read_figure_metadata(path: Path | str, as_drawn: bool = False) -> FigureMetadata:
    """Read what a figure says of itself.

    Parameters
    ----------
    path : path
        A PDF or PNG; what it is, its content says, not its ending.
    as_drawn : bool, optional
        Read a metadata only where the study writes it. Nothing is then decoded, so that a figure
        that a stranger made can neither fill the memory nor take long.

    Raises
    ------
    InputError
        If there is no such file, it is no readable PDF or PNG, or it has no sound metadata.
    """
    path = Path(path)
    try:
        with path.open("rb") as file:
            start = file.read(8)
    except FileNotFoundError:
        raise InputError(f"{path}: no such file; give a figure, as PDF or PNG") from None
    except IsADirectoryError:
        raise InputError(f"{path} is a folder; give a figure, as PDF or PNG") from None
    if start.startswith(b"%PDF"):
        text = _text_of_pdf(path, as_drawn)
    elif start == b"\x89PNG\r\n\x1a\n":
        text = _text_of_png(path, as_drawn)
    else:
        raise InputError(f"{path}: neither a PDF nor a PNG; give a figure of the study")
    if text is None:
        raise InputError(
            f"{path}: has no metadata of keystab; was it drawn by the study, and not changed since?"
        )
    try:
        return FigureMetadata.from_text(text)
    except InputError as error:
        raise InputError(f"{path}: {error}; draw it again") from None


def _text_of_pdf(path: Path, as_drawn: bool) -> str | None:
    if as_drawn:
        data = path.read_bytes()
        start = max(data.find(_KEYWORDS_START), 0)
        found = _KEYWORDS.match(data[start : start + _MOST_BYTES])
        return _ESCAPE.sub(_unescaped, found[1]).decode("latin-1") if found else None
    from pypdf import PdfReader
    from pypdf.errors import PyPdfError

    try:
        about = PdfReader(path).metadata
        keywords = about.get("/Keywords") if about else None
    except (PyPdfError, ValueError, KeyError, TypeError, AttributeError, RecursionError):
        raise InputError(f"{path}: a damaged PDF; draw it again") from None
    return None if keywords is None else str(keywords)


def _unescaped(found: re.Match[bytes]) -> bytes:
    """One escape of a text in a PDF: a byte by its octal number, or the byte itself."""
    return bytes([int(found[1], 8) & 0xFF]) if found[1].isdigit() else found[1]


def _text_of_png(path: Path, as_drawn: bool) -> str | None:
    if as_drawn:
        return _text_before_pixels(path)
    from PIL import Image

    try:
        # Opening reads what stands before the pixels; what stands behind needs these decoded.
        with warnings.catch_warnings(action="ignore"), Image.open(path, formats=["PNG"]) as picture:
            if picture.width * picture.height <= _MOST_PIXELS:
                picture.load()
            found = picture.info.get(PNG_KEY)
    except (OSError, SyntaxError, ValueError, Image.DecompressionBombError):
        raise InputError(f"{path}: a damaged PNG; draw it again") from None
    return found if found is None else str(found)


def _text_before_pixels(path: Path) -> str | None:
    """Plain text of a PNG under the key of metadata, if it is among the first chunks."""
    with path.open("rb") as file:
        file.seek(8)
        for _ in range(_MOST_CHUNKS):
            head = file.read(8)
            length, kind = int.from_bytes(head[:4], "big"), head[4:]
            if len(head) < 8 or kind in (b"IDAT", b"IEND"):
                break
            if kind == b"tEXt" and length <= _MOST_BYTES:
                key, _, text = file.read(length).partition(b"\0")
                if key == PNG_KEY.encode():
                    return text.decode("latin-1")
                length = 0
            file.seek(length + 4, 1)
    return None


def file_digest(path: Path) -> str:
    """SHA-256 of a file."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def code_of_figure(figure: str) -> str | None:
    """Fingerprint of the code that draws a figure here and now; None where it is not known here."""
    try:
        return fingerprint(f"keystab.figures.{figure.lower()}")
    except ValueError:
        return None


def whence(path: Path | str, project: Path) -> str:
    """Say where a figure comes from.

    Parameters
    ----------
    path : path
        A figure of the study, as PDF or PNG; it may lie anywhere.
    project : path
        Copy of the project, with or without results.

    Returns
    -------
    str
        What its metadata say, and whether that is still so here; the files that it was made from,
        down to the picture, with digests; the settings behind it; the commands that make it again.

    Raises
    ------
    InputError
        As `read_figure_metadata`.
    """
    return "\n".join(map(printable, _told(Path(path), project)))


def printable(text: str) -> str:
    r"""Text without what a terminal would obey.

    Examples
    --------
    >>> printable("fig1\x1b[2J.png")
    'fig1?[2J.png'
    """
    return "".join(it if it.isprintable() else "?" for it in text)


def _told(path: Path, project: Path) -> list[str]:
    metadata = read_figure_metadata(path)
    records = read_records(project)
    drawn = _record_of(path, metadata, records, project)
    lines = [f"{path}: {metadata.figure}, drawn by keystab {metadata.version}"]
    lines += [f"  {line}" for line in _identity(metadata, project)]
    lines += ["", "drawn from"]
    folder = Path(drawn.inputs[0]).parent if drawn and drawn.inputs else None
    for name, digest in sorted(metadata.tables.items()):
        table = (folder / name).as_posix() if folder else name
        lines.append(f"  {table}  {digest}  {_state(project / table, digest)}")
    if drawn is None:
        lines += ["", "the records of Snakemake here know no such figure, nor what lies behind it"]
        lines += ["", f"to make one at the settings of the project, in {project}"]
        return [*lines, f"  make figures/{metadata.figure}.pdf"]
    chain = upstream(records, [drawn.output])
    behind = [record for record in chain if record is not drawn]
    lines += ["", "which were made from, and these in turn from"]
    lines += [f"  {line}" for line in _chain(reversed(behind), project)]
    settings = settings_behind(behind)
    lines += ["", f"settings behind it ({len(settings)})"]
    lines += [f"  {name} = {value}" for name, value in settings.items()]
    lines += ["", "drawn with", f"  {drawn.command}", ""]
    lines += [f"to make it again, with all behind it, in {project}"]
    return [*lines, *_commands(drawn.output, project)]


def _identity(metadata: FigureMetadata, project: Path) -> Iterator[str]:
    """What its metadata say about code, software and settings, and whether it is so here."""
    here = code_of_figure(metadata.figure)
    lock = software_digest(project / "environment.lock")
    for name, given, now in (("code", metadata.code, here), ("lock", metadata.lock, lock)):
        if given is None:
            yield f"{name:<8} not said: it was drawn by hand"
        else:
            yield f"{name:<8} {given}  {'as it is here' if given == now else 'not as it is here'}"
    for problem in software_problems(project / "environment.lock"):
        yield f"         here, {problem}"
    own = ", ".join(f"{name} = {value}" for name, value in sorted(metadata.settings.items()))
    yield f"config   {metadata.config}  of its tables and of {own}"


def _record_of(
    path: Path, metadata: FigureMetadata, records: Mapping[str, Record], project: Path
) -> Record | None:
    """Record of a figure: by its place in the project, or else by the digests of its tables."""
    wanted = sorted(metadata.tables.values())
    here = path.absolute()
    name = here.relative_to(project).as_posix() if here.is_relative_to(project) else ""
    candidates = [records[name]] if name in records else []
    candidates += [record for record in records.values() if record.rule == metadata.figure]
    for record in candidates:
        if sorted(record.digests.values()) == wanted:
            return record
    return None


def _chain(records: Iterable[Record], project: Path) -> Iterator[str]:
    """Each rule, the nearest first, with the inputs that its jobs had and their digests."""
    inputs: dict[str, dict[str, str]] = {}
    for record in records:
        of_rule = inputs.setdefault(record.rule, {})
        for name in record.inputs:
            digest = record.digests.get(name)
            if digest is not None:
                of_rule[name] = digest
    for rule, digests in inputs.items():
        yield f"{rule}" + ("" if digests else " (from settings alone)")
        for name, digest in sorted(digests.items()):
            yield f"  {name}  {digest[:_SHORT]}  {_state(project / name, digest)}"


def _state(path: Path, digest: str) -> str:
    if not path.is_file():
        return "not here"
    return "unchanged" if file_digest(path) == digest else "CHANGED since then"


def _commands(output: str, project: Path) -> Iterator[str]:
    """Commands that make a figure, each on a line of its own, so that it can be pasted."""
    folder = _OF_SCENE.sub("", Path(output).parent.as_posix())
    files = overlays_of(project, folder)
    if files is None:
        yield f"(no settings found here whose figures go to {folder}: give theirs for my.yaml)"
    known = ["my.yaml"] if files is None else files
    of_make = [] if known == ["config/quick.yaml"] else known  # then the target says it
    quoted = shlex.quote(output)
    yield f"  make {quoted}{on_command_line(of_make, make=True)}"
    yield "or, after `. .venv/bin/activate`"
    yield f"  snakemake {quoted} -j2{on_command_line(known, make=False)}"
