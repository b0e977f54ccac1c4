"""Take an archive apart that somebody sent: data are written to a folder, code is digested at most.

An archive is input from a stranger. What it holds is never run, imported or taken as an option:
members are digested one after the other, and only those of listed kinds are written out, below one
folder. Size, number, names and compression are bounded before anything is read.
"""

from __future__ import annotations

import contextlib
import dataclasses
import hashlib
import struct
import tempfile
import unicodedata
import zipfile
import zlib
from collections.abc import Iterator, Mapping
from pathlib import Path, PurePosixPath
from typing import IO

from keystab.errors import InputError
from keystab.provenance.bare_code import bare_digest, is_code
from keystab.provenance.run_description import (
    ABOUT,
    LEFT_OUT,
    MOST_BYTES_OF_ABOUT,
    SUMS,
    About,
    about_of,
    read_about,
)
from keystab.provenance.snakemake_records import FOLDER
from keystab.utils.memory import in_words

__all__ = ["Unpacked", "committed", "require_archive", "unpacked"]

MOST_BYTES = 500_000_000
"""Of all members together, unpacked, and of the file itself."""

MOST_MEMBERS = 5_000
_MOST_BYTES_OF_INDEX = 400 * MOST_MEMBERS
_MOST_BYTES_OF_TEXT = 5_000_000
_MOST_BYTES_OF_TEXTS = 20_000_000
_MOST_BYTES_OF_FIGURE = 20_000_000
_MOST_BYTES_OF_RECORDS = 10_000_000
"""A finished study has a thousand members, texts of 2 MB and records of 1 MB."""

_MOST_BYTES_OF_NAME, _MOST_DEPTH = 1000, 32
_CHUNK = 1 << 20

_TEXTS = {".csv", ".json", ".md", ".sha256", ".yaml", ""}
_RESULTS = {".csv", ".json", ".md", ".parquet", ".sha256"}
_FIGURES = {".pdf", ".png"}
_PICTURES = {".png", ".tif", ".tiff", ".jpg", ".jpeg"}

_RECORDS = f"{FOLDER.as_posix()}/"


@dataclasses.dataclass(frozen=True)
class Unpacked:
    """What is known of an archive.

    Parameters
    ----------
    folder : path
        Where its data lie.
    digests : mapping from str to str
        SHA-256 of every member by its name; empty where a member is damaged.
    about : About
    bare_digests : mapping from str to str
        Of code, which is not written: `keystab.bare_code.bare_digest` by name.
    digest : str
        SHA-256 of the file itself; empty for a folder.
    """

    folder: Path
    digests: Mapping[str, str]
    about: About
    bare_digests: Mapping[str, str] = dataclasses.field(default_factory=dict)
    digest: str = ""


def require_archive(path: Path) -> None:
    """Raise `InputError` where there is no such file, or one that is too big to be an archive."""
    if not path.is_file():
        raise InputError(f"{path}: no such file; make archive writes one")
    if (size := path.stat().st_size) > MOST_BYTES:
        raise InputError(
            f"{path}: {in_words(size)}, an archive has at most {in_words(MOST_BYTES)}; "
            "get it again, or from somebody else"
        )


@contextlib.contextmanager
def unpacked(archive: Path) -> Iterator[Unpacked]:
    """Take an archive apart, in a temporary folder, for as long as a block runs.

    Parameters
    ----------
    archive : path
        What `keystab.provenance.archive.pack` wrote, or what somebody says it wrote.

    Yields
    ------
    Unpacked
        Its tables, verdicts, figures, records, files of settings and pictures lie in the folder;
        all else was digested and not written.

    Raises
    ------
    InputError
        In one line, if it is no archive of this version, or one that `pack` does not write: with
        names that lead out of a folder, encrypted, too big, compressed otherwise.
    """
    require_archive(archive)
    with tempfile.TemporaryDirectory() as name:
        try:
            held = _taken_apart(archive, Path(name))
        except _UnfitError as error:
            raise InputError(f"{archive}: {error}") from None
        # Whatever else a broken file makes of its sizes and places, such as a negative one.
        except (zipfile.BadZipFile, struct.error, EOFError, NotImplementedError, ValueError):
            raise InputError(f"{archive}: {_BROKEN}") from None
        yield held


def _taken_apart(archive: Path, folder: Path) -> Unpacked:
    with archive.open("rb") as stream:
        digest = hashlib.file_digest(stream, "sha256").hexdigest()
        _check_index(stream)
        with zipfile.ZipFile(stream) as file:
            members = _checked_members(file)
            _check_places(stream, file)
            about = _about_of(file, members)
            _check_sizes(members, about)
            digests = {
                path: _take(file, member, folder / path if _is_data(path, about) else None)
                for path, member in sorted(members.items())
            }
            bare = {
                path: bare_digest(file.read(member))
                for path, member in members.items()
                if is_code(path) and digests[path] and member.file_size <= _MOST_BYTES_OF_TEXT
            }
    return Unpacked(folder, digests, about, bare, digest)


def committed(reference: Path) -> Unpacked:
    """Take the folder of the committed reference, the project's own, as an archive is taken.

    Raises
    ------
    InputError
        If it says nothing about a run of this version.
    """
    about = read_about(reference)
    files = sorted(path for path in reference.rglob("*") if path.is_file())
    digests = {
        path.relative_to(reference).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in files
    }
    return Unpacked(reference, digests, about)


class _UnfitError(ValueError):
    """What `keystab.provenance.archive.pack` would not have written; its text says it in a line."""


_BROKEN = "not a whole zip file; get it again"


def _check_index(stream: IO[bytes]) -> None:
    """Refuse an index that takes long to read, before `zipfile` reads all of it.

    Nothing may stand before the first member or behind the index: such a file would be something
    else as well, such as a script.
    """
    end = struct.Struct("<4s4H2LH")
    size = stream.seek(0, 2)
    stream.seek(0)
    start = stream.read(4)
    stream.seek(max(size - end.size - 20, 0))
    last = stream.read()
    if start != b"PK\3\4" or not last[-end.size :].startswith(b"PK\5\6"):
        raise _UnfitError(_BROKEN)
    _, _, _, _, entries, length, offset, comment = end.unpack(last[-end.size :])
    if last.startswith(b"PK\6\7") or entries > MOST_MEMBERS or length > _MOST_BYTES_OF_INDEX:
        raise _UnfitError(f"holds too many files; an archive holds at most {MOST_MEMBERS}")
    if comment or offset + length + end.size != size:
        raise _UnfitError(_BROKEN)
    stream.seek(0)


def _checked_members(file: zipfile.ZipFile) -> dict[str, zipfile.ZipInfo]:
    """Members by name, if all can be read in bounded time and written below one folder."""
    members: dict[str, zipfile.ZipInfo] = {}
    spelled: set[str] = set()
    for member in file.infolist():
        name = member.filename
        if problem := _problem(member):
            raise _UnfitError(f"{name[:80]!a} {problem}")
        if _alike(name) in spelled:
            raise _UnfitError(f"{name[:80]!a} is there twice; make archive writes each file once")
        spelled.add(_alike(name))
        members[name] = member
    if len(members) > MOST_MEMBERS:
        raise _UnfitError(f"holds too many files; an archive holds at most {MOST_MEMBERS}")
    for name in members:
        if any(_alike(str(folder)) in spelled for folder in PurePosixPath(name).parents):
            raise _UnfitError(f"{name[:80]!a} lies in a file; make archive writes none such")
    total = sum(member.file_size for member in members.values())
    if total > MOST_BYTES:
        raise _UnfitError(
            f"unpacks to {in_words(total)}, an archive to at most {in_words(MOST_BYTES)}; "
            "nothing was unpacked"
        )
    records = sum(it.file_size for name, it in members.items() if name.startswith(_RECORDS))
    if records > _MOST_BYTES_OF_RECORDS:
        raise _UnfitError(f"holds records of {in_words(records)}; those of a run take a tenth")
    return members


def _check_places(stream: IO[bytes], file: zipfile.ZipFile) -> None:
    """Refuse a file in which something lies between the members, where other programs see it."""
    head = struct.Struct("<26x2H")
    place = 0
    for member in sorted(file.infolist(), key=lambda it: it.header_offset):
        stream.seek(place)
        name, more = head.unpack(stream.read(head.size))
        if member.header_offset != place or more:
            raise _UnfitError(_BROKEN)
        place += head.size + name + member.compress_size
    if place != file.start_dir:
        raise _UnfitError(_BROKEN)


def _alike(name: str) -> str:
    """Same for names that some system takes for the same file."""
    return unicodedata.normalize("NFC", name).casefold()


def _check_sizes(members: Mapping[str, zipfile.ZipInfo], about: About) -> None:
    """Refuse more than is read in bounded time and memory."""
    results, figures = f"{about.results}/", f"{about.figures}/"
    texts = 0
    for name, member in members.items():
        texts += member.file_size * (name.startswith(results) and _is_text(name))
        if name.startswith(figures) and member.file_size > _MOST_BYTES_OF_FIGURE:
            raise _UnfitError(
                f"{name[:80]!a} has {in_words(member.file_size)}; figures of a run have much less"
            )
    if texts > _MOST_BYTES_OF_TEXTS:
        raise _UnfitError(f"holds tables of {in_words(texts)}; those of a run take a tenth")


def _is_text(name: str) -> bool:
    return PurePosixPath(name).suffix.lower() in _TEXTS


def _problem(member: zipfile.ZipInfo) -> str:
    """Say what is wrong with a member, judged by the index alone."""
    name = member.filename
    parts = name.split("/")
    kind = (member.external_attr >> 16) & 0o170000
    if (
        not name.isprintable()
        or name != member.orig_filename
        or any(part in ("", ".", "..") for part in parts)
        or "\\" in name
        or ":" in parts[0]
    ):
        return "leads out of its folder, or is no name of a file"
    if len(name.encode()) > _MOST_BYTES_OF_NAME or len(parts) > _MOST_DEPTH:
        return "has too long a name"
    if any(len(part.encode()) > 255 for part in parts):
        return "has too long a name"
    if kind not in (0, 0o100000) or member.external_attr >> 16 & 0o7000:
        return "is a link or a device; make archive writes files only"
    if member.extra or member.comment:
        return "has more fields than make archive writes"
    if _is_text(name) and member.file_size > _MOST_BYTES_OF_TEXT:
        return f"has {in_words(member.file_size)}; tables and texts of a run have much less"
    if member.flag_bits & 0x2041:
        return "is encrypted; make archive encrypts nothing"
    if member.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
        return "is compressed in a way that make archive does not use"
    return ""


def _about_of(file: zipfile.ZipFile, members: Mapping[str, zipfile.ZipInfo]) -> About:
    if ABOUT not in members or SUMS not in members:
        raise _UnfitError("no archive of this study; make archive writes one")
    if members[ABOUT].file_size > MOST_BYTES_OF_ABOUT:
        raise _UnfitError(f"{ABOUT} says nothing about a run; make archive writes it")
    try:
        return about_of(file.read(members[ABOUT]))
    except (zipfile.BadZipFile, zlib.error):
        raise _UnfitError(f"{ABOUT} is damaged; get the archive again") from None
    except InputError as error:
        raise _UnfitError(f"{ABOUT} {error}") from None


def _is_data(name: str, about: About) -> bool:
    """Whether a member is read later: by its place and suffix, never code."""
    suffix = PurePosixPath(name).suffix.lower()
    places = {f"{about.results}/": _RESULTS, f"{about.figures}/": _FIGURES}
    if any(name.startswith(place) and suffix in kinds for place, kinds in places.items()):
        return True
    if name.startswith("config/images/"):
        return suffix in _PICTURES
    return name in (ABOUT, SUMS, LEFT_OUT, *about.overlays) or name.startswith(_RECORDS)


def _take(file: zipfile.ZipFile, member: zipfile.ZipInfo, target: Path | None) -> str:
    """Digest a member, and write it if a target is given; no digest where it is damaged."""
    digest = hashlib.sha256()
    with contextlib.ExitStack() as stack:
        out = None
        if target is not None:
            target.parent.mkdir(parents=True, exist_ok=True)
            out = stack.enter_context(target.open("wb"))
        try:
            source = stack.enter_context(file.open(member))
            while chunk := source.read(_CHUNK):
                digest.update(chunk)
                if out is not None:
                    out.write(chunk)
        except (zipfile.BadZipFile, zlib.error, EOFError):
            return ""
    return digest.hexdigest()
