"""What somebody could change in results: kinds of changes, and the places where each is made.

A change takes files by their names, of a finished tree or of an archive, and gives them changed.
"""

from __future__ import annotations

import base64
import hashlib
import io
import json
import re
import struct
import zlib
from collections.abc import Callable, Iterator
from pathlib import PurePosixPath
from typing import Any, NamedTuple

Files = dict[str, bytes]

RECORDS = ".snakemake/metadata"
LEDGERS = ("results/claims.csv", "results/claims.json", "results/claims.md")
TABLES = ("results/tables/fig1.csv", "results/tables/figS3.csv")
PDFS = ("figures/fig1.pdf", "figures/figS3.pdf")
PNGS = ("figures/fig1.png", "figures/figS3.png")
LIST = "results/final.sha256"
SEAL = "results/views/still.sha256"
FINAL = (*PDFS, *PNGS, *LEDGERS, *TABLES)
RECORDED = (*FINAL, LIST, SEAL, "results/keypoints/still.csv", "results/views/still")


class Tampering(NamedTuple):
    """One change.

    Parameters
    ----------
    name : str
    change : callable
        From files to changed files; of what is not there, nothing is changed.
    named : tuple of str
        Regular expressions: each has to match a line below one that says FAILED.
    """

    name: str
    change: Callable[[Files], Files]
    named: tuple[str, ...]


def record_of(output: str) -> str:
    """Where the record of a file lies."""
    return f"{RECORDS}/{base64.urlsafe_b64encode(output.encode()).decode()}"


def in_one(name: str, edit: Callable[[bytes], bytes]) -> Callable[[Files], Files]:
    """Change the bytes of one file."""

    def change(files: Files) -> Files:
        edited = edit(files[name])
        assert edited != files[name], f"{name} is as it was: adapt the kind"
        return files | {name: edited}

    return change


def without(*names: str) -> Callable[[Files], Files]:
    """Leave files out."""
    return lambda files: {name: data for name, data in files.items() if name not in names}


def exchanged(one: str, other: str) -> Callable[[Files], Files]:
    """Exchange two files."""
    return lambda files: files | {one: files[other], other: files[one]}


def renamed(one: str, other: str) -> Callable[[Files], Files]:
    """Give a file another name."""
    return lambda files: without(one)(files) | {other: files[one]}


def one_byte(data: bytes) -> bytes:
    middle = len(data) // 2
    return data[:middle] + bytes([data[middle] ^ 1]) + data[middle + 1 :]


def half(data: bytes) -> bytes:
    lines = data.splitlines(keepends=True)
    return b"".join(lines[: max(len(lines) // 2, 1)])


def another_number(data: bytes) -> bytes:
    """Change the last digit that stands in a text."""
    found = list(re.finditer(rb"\d", data))[-1]
    digit = b"7" if found[0] != b"7" else b"8"
    return data[: found.start()] + digit + data[found.end() :]


def without_last_column(data: bytes) -> bytes:
    return b"".join(line.rpartition(b",")[0] + b"\n" for line in data.splitlines())


def rows_swapped(data: bytes) -> bytes:
    head, one, other, *rest = data.splitlines(keepends=True)
    return b"".join([head, other, one, *rest])


def row_twice(data: bytes) -> bytes:
    head, one, *rest = data.splitlines(keepends=True)
    return b"".join([head, one, one, *rest])


def last_line_lost(data: bytes) -> bytes:
    return b"".join(data.splitlines(keepends=True)[:-1])


def another_header(data: bytes) -> bytes:
    return b"x" + data


def flipped(data: bytes) -> bytes:
    """Make every verdict "reproduced"."""
    lines, verdict = [], b""
    for line in data.replace(b"not reproduced", b"reproduced").splitlines(keepends=True):
        if line.startswith(b"## ") and verdict:
            continue
        verdict = b"##" if line.startswith(b"## ") else verdict
        lines.append(line.replace(b"## Not reproduced", b"## Reproduced"))
    return b"".join(lines)


def first_claim_lost(data: bytes) -> bytes:
    """Take the claim `few` out of a ledger in any form."""
    if data.startswith(b"["):
        return json.dumps(json.loads(data)[1:], indent=2).encode() + b"\n"
    lines = data.splitlines(keepends=True)
    return b"".join(line for line in lines if not line.startswith((b"few,", b"| `few`")))


def painted(data: bytes) -> bytes:
    """Paint a red square into a picture, and leave all that it says of itself."""
    from PIL import Image

    start = data.index(b"IDAT") - 4
    end = data.rindex(b"IEND") - 4
    with Image.open(io.BytesIO(data)) as picture:
        picture.paste((255, 0, 0), (20, 20, 26, 26))
        rows = picture.tobytes()
        width = 3 * picture.width
    lines = b"".join(b"\0" + rows[at : at + width] for at in range(0, len(rows), width))
    pixels = b"IDAT" + zlib.compress(lines)
    chunk = struct.pack(">L", len(pixels) - 4) + pixels + struct.pack(">L", zlib.crc32(pixels))
    return data[:start] + chunk + data[end:]


def recorded(output: str, **fields: Any) -> Callable[[Files], Files]:
    """Write other things into a record."""

    def edit(data: bytes) -> bytes:
        return json.dumps(json.loads(data) | fields).encode()

    return in_one(record_of(output), edit)


def input_digest(output: str, name: str) -> Callable[[Files], Files]:
    """Write another digest of an input into a record."""

    def edit(data: bytes) -> bytes:
        record = json.loads(data)
        record["input_checksums"][name] = "sha256:" + 64 * "0"
        return json.dumps(record).encode()

    return in_one(record_of(output), edit)


def everywhere() -> Iterator[Tampering]:
    """Changes of files alone: of a finished tree, and of an archive whose sums are rewritten."""

    def each(
        what: str, names: tuple[str, ...], edit: Callable[[bytes], bytes]
    ) -> Iterator[Tampering]:
        for name in names:
            yield Tampering(f"{what}: {name}", in_one(name, edit), (name,))

    yield from each("verdicts flipped", LEDGERS, flipped)
    yield from each("a claim deleted", LEDGERS, first_claim_lost)
    yield from each("a number changed", (*LEDGERS[1:], *TABLES), another_number)
    yield from each("a byte changed", (*FINAL, SEAL), one_byte)
    yield from each("a red square", PNGS, painted)
    yield from each("cut in half", (*LEDGERS, *TABLES, LIST), half)
    yield from each("a column dropped", (*TABLES, LEDGERS[0]), without_last_column)
    yield from each("rows swapped", (*TABLES, LEDGERS[0]), rows_swapped)
    yield from each("a row twice", (*TABLES, LEDGERS[0]), row_twice)
    yield from each("another header", (*TABLES, LEDGERS[0]), another_header)
    yield from each("the last line lost", (LIST, SEAL, *TABLES, *LEDGERS), last_line_lost)
    yield from each("a digest changed", (LIST, SEAL), lambda data: b"0123456789" + data[10:])
    yield from each("emptied", (*FINAL, LIST, SEAL), lambda data: b"")
    yield from each("a line more", (*LEDGERS, *TABLES, LIST, SEAL), lambda data: data + b"x\n")
    yield from each("other line ends", TABLES, lambda data: data.replace(b"\n", b"\r\n"))
    for name in (*FINAL, LIST):
        yield Tampering(f"deleted: {name}", without(name), (name,))
    for one, other in (PDFS, PNGS, TABLES, LEDGERS[:2], (PDFS[0], PNGS[0])):
        yield Tampering(f"exchanged: {one}, {other}", exchanged(one, other), (one, other))
    for name in (*FINAL, LIST):
        other = str(PurePosixPath(name).with_stem("fig9"))
        yield Tampering(f"renamed: {name}", renamed(name, other), (name,))
    for name in RECORDED:
        yield Tampering(f"record dropped: {name}", without(record_of(name)), (name,))
    yield Tampering(
        "all records dropped",
        lambda files: {name: it for name, it in files.items() if not name.startswith(RECORDS)},
        (LIST,),
    )
    jobs = {
        PDFS[0]: "Drawing", PNGS[1]: "Drawing", LEDGERS[0]: "Judging", TABLES[0]: "Counting",
        LIST: "Listing",
    }  # fmt: skip
    for name, job in jobs.items():
        yield Tampering(
            f"other settings recorded: {name}", recorded(name, params=["seed = 9"]), (job,)
        )
        yield Tampering(f"other inputs recorded: {name}", recorded(name, input=["x"]), (job,))
    nothing = "\nNothing to be done (all requested files are present and up to date)."
    yield Tampering(
        "a record that says that nothing is to be done",
        recorded(PDFS[0], params=[nothing]),
        ("Drawing",),
    )
    yield Tampering(
        "a record of a format that Snakemake does not hold against anything",
        recorded(PDFS[0], params=["seed = 9"], record_format_version=0),
        ("figures/fig1.pdf: no whole record|not a record of Snakemake",),
    )
    yield Tampering(
        "a log whose name hides other lines",
        recorded(PDFS[0], params=["seed = 9"], log=['"x\tok\tno update\n"']),
        ("records damaged|not a record of Snakemake",),
    )
    yield Tampering("another digest recorded", input_digest(PDFS[0], TABLES[0]), (TABLES[0],))
    yield Tampering("another digest listed", input_digest(LIST, PDFS[1]), (PDFS[1],))
    yield Tampering("another scene", in_one("config/scene.txt", one_byte), ("config/scene.txt",))


def in_trees() -> Iterator[Tampering]:
    """Changes of what only a finished tree has."""
    for name in ("results/views/still/a", "results/views/still/b"):
        yield Tampering(
            f"a chunk changed: {name}", in_one(name, one_byte), (f"still: {name[-1]} is damaged",)
        )
        yield Tampering(f"a chunk lost: {name}", without(name), (f"still: {name[-1]} is missing",))
    yield Tampering(
        "a chunk more",
        lambda files: files | {"results/views/still/c": b""},
        ("still: c was not there",),
    )
    yield Tampering(
        "keypoints changed",
        in_one("results/keypoints/still.csv", another_number),
        ("results/keypoints/still.csv",),
    )
    yield Tampering(
        "keypoints lost",
        without("results/keypoints/still.csv"),
        ("results/keypoints/still.csv: missing",),
    )
    yield Tampering("a seal lost", without(SEAL), (SEAL,))


def about(**fields: Any) -> Callable[[Files], Files]:
    """Say other things in ``archive.json``."""
    return in_one("archive.json", lambda data: json.dumps(json.loads(data) | fields).encode())


def in_archives() -> Iterator[Tampering]:
    """Changes of what only an archive has."""
    listed = ("results/keypoints/still.csv", "results/views/still")
    for number, name in enumerate(listed, 1):

        def lines(edit: Callable[[str], str], number: int = number) -> Callable[[Files], Files]:
            def change(data: bytes) -> bytes:
                rows = data.decode().splitlines()
                rows[number] = edit(rows[number])
                return ("\n".join(row for row in rows if row) + "\n").encode()

            return in_one("left-out.csv", change)

        yield Tampering(f"left-out.csv: {name} deleted", lines(lambda row: ""), (name,))
        yield Tampering(
            f"left-out.csv: digest of {name}",
            lines(lambda row: re.sub(",[0-9a-f]{64},", f",{64 * '0'},", row)),
            (name,),
        )
        yield Tampering(
            f"left-out.csv: rule of {name}",
            lines(lambda row: row.rpartition(",")[0] + ",x"),
            (name,),
        )
        yield Tampering(
            f"left-out.csv: {name} renamed", lines(lambda row: row.replace("still", "x")), (name,)
        )
    row = f"results/tables/fig1.csv,1,{64 * '0'},table\n".encode()
    yield Tampering(
        "left-out.csv: a table more", in_one("left-out.csv", lambda data: data + row), (TABLES[0],)
    )
    yield Tampering("left-out.csv deleted", without("left-out.csv"), (r"results/keypoints/still",))
    yield Tampering("a seal deleted", without(SEAL), (SEAL,))
    yield Tampering(
        "the scene deleted", without("config/scene.txt"), ("config/scene.txt: missing",)
    )
    yield Tampering("other settings named", about(settings=64 * "0"), ("archive.json",))
    yield Tampering("another lock named", about(lock=64 * "0"), ("archive.json",))
    yield Tampering("results elsewhere", about(results="results/other"), ("results/",))
    yield Tampering("figures elsewhere", about(figures="figures/other"), ("figures",))
    yield Tampering(
        "another lock", in_one("environment.lock", lambda data: data + b"x"), ("environment.lock",)
    )


# ---------------------------------------------------------------------------------------------
# Forgeries: records and lists are rewritten as well


def forged(files: Files) -> Files:
    """Rewrite the list in which the run ends, and all records, so that they are of these files."""
    sums = {name: hashlib.sha256(data).hexdigest() for name, data in files.items()}
    text = "".join(f"{sums[name]}  {name}\n" for name in sorted(FINAL) if name in sums)
    files = files | {LIST: text.encode()}
    sums[LIST] = hashlib.sha256(files[LIST]).hexdigest()
    for output in RECORDED:
        record = json.loads(files[record_of(output)])
        known = record["input_checksums"] or {}
        record["input_checksums"] = {
            name: f"sha256:{sums[name]}" if name in sums else it for name, it in known.items()
        }
        files[record_of(output)] = json.dumps(record).encode()
    return files


def with_passports(files: Files, **changes: Any) -> Files:
    """Rewrite what figures say of themselves, so that it is of the tables that are there."""
    from keystab.io.figure_metadata import FigureMetadata

    def rewritten(old: bytes) -> bytes:
        said = json.loads(old)
        said.pop("config")
        tables = {
            name: hashlib.sha256(files[f"results/tables/{name}"]).hexdigest()
            for name in said["tables"]
        }
        return FigureMetadata(**said | {"tables": tables} | changes).to_text().encode()

    files = dict(files)
    for name in PDFS:
        head, start, rest = files[name].partition(b"/Keywords (")
        old, end, rest = rest.partition(b")\n")
        plain = re.sub(rb"\\([0-7]{3})", lambda it: bytes([int(it[1], 8)]), old)
        new = re.sub(rb"[^0-9A-Za-z]", lambda it: b"\\%03o" % it[0][0], rewritten(plain))
        files[name] = head + start + new + end + rest
    for name in PNGS:
        data = files[name]
        start = data.index(b"tEXtkeystab\0")
        size = struct.unpack(">L", data[start - 4 : start])[0]
        text = b"keystab\0" + rewritten(data[start + 12 : start + 4 + size])
        chunk = struct.pack(">L", len(text)) + b"tEXt" + text
        crc = struct.pack(">L", zlib.crc32(chunk[4:]))
        files[name] = data[: start - 4] + chunk + crc + data[start + 8 + size :]
    return files


def judged(files: Files, claims: str) -> Files:
    """Judge the claims again, from the tables that are there."""
    import tempfile
    from pathlib import Path

    import yaml

    from keystab.io.tables import read_table
    from keystab.study.claims import parse_claims, table_names
    from keystab.study.claims_report import write_report
    from keystab.study.verdicts import outcomes_of

    asked = parse_claims(yaml.safe_load(claims))
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        tables = {}
        for table in table_names(asked):
            (folder / f"{table}.csv").write_bytes(files[f"results/tables/{table}.csv"])
            tables[table] = read_table(folder / f"{table}.csv")
        paths = [folder / PurePosixPath(ledger).name for ledger in LEDGERS]
        write_report(outcomes_of(asked, tables), *paths)
        ledgers = [path.read_bytes() for path in paths]
    return files | dict(zip(LEDGERS, ledgers, strict=True))


def flipped_everywhere(files: Files) -> Files:
    """Flip the verdicts in all forms of the ledger."""
    return files | {name: flipped(files[name]) for name in LEDGERS}


def words_changed(files: Files) -> Files:
    """Say something else of a claim, in all forms of the ledger."""
    return files | {
        name: files[name].replace(b"Few are found.", b"All are found.") for name in LEDGERS
    }


def passports_exchanged(files: Files) -> Files:
    """Exchange the pixels of two figures, and leave what they say of themselves."""
    one, other = PNGS
    pieces = [files[name].partition(b"IDAT") for name in PNGS]
    # The length of the pixels stands before their name.
    return files | {
        one: pieces[0][0][:-4] + pieces[1][0][-4:] + b"IDAT" + pieces[1][2],
        other: pieces[1][0][:-4] + pieces[0][0][-4:] + b"IDAT" + pieces[0][2],
    }


def table_changed(
    name: str, edit: Callable[[bytes], bytes], claims: str
) -> Callable[[Files], Files]:
    """Change a table, and all that follows from it but pixels."""
    return lambda files: with_passports(judged(in_one(name, edit)(files), claims))


def with_more(files: Files) -> Files:
    """Add a figure that the study does not draw, with a record and all digests."""
    name = "figures/fig9.png"
    drawn = with_passports(files, figure="fig9", code=None)[PNGS[0]]
    files = forged(files) | {name: drawn, record_of(name): files[record_of(PNGS[0])]}
    digest = hashlib.sha256(drawn).hexdigest()
    files[LIST] += f"{digest}  {name}\n".encode()
    record = json.loads(files[record_of(LIST)])
    record["input"].append(name)
    record["input_checksums"][name] = f"sha256:{digest}"
    return files | {record_of(LIST): json.dumps(record).encode()}


def forgeries(claims: str) -> Iterator[Tampering]:
    """Changes after which all digests and records were rewritten."""
    one, other = TABLES

    def changes() -> Iterator[tuple[str, Callable[[Files], Files], tuple[str, ...]]]:
        yield "verdicts flipped", flipped_everywhere, LEDGERS
        yield "words of a claim", words_changed, LEDGERS
        for name in LEDGERS:
            yield f"verdicts flipped in {name}", in_one(name, flipped), (name,)
            yield f"a claim deleted in {name}", in_one(name, first_claim_lost), (name,)
            if name != LEDGERS[0]:
                yield f"a number in {name}", in_one(name, another_number), (name,)
        yield "a row twice in the ledger", in_one(LEDGERS[0], row_twice), LEDGERS[:1]
        yield "figures exchanged", exchanged(*PNGS), PNGS
        yield "figures as PDF exchanged", exchanged(*PDFS), PDFS
        yield "pixels exchanged", passports_exchanged, PNGS
        for name in PNGS:
            yield f"a red square in {name}", in_one(name, painted), (name,)
        for name in PDFS:
            yield (
                f"a byte in {name}",
                in_one(name, lambda data: data.replace(b"/MediaBox [ 0", b"/MediaBox [ 1")),
                (name,),
            )
        yield (
            "a red square, and another version in the passport",
            lambda files: with_passports(in_one(PNGS[0], painted)(files), version="0.1.9"),
            PNGS[:1],
        )
        yield (
            "a red square, and other code in the passport",
            lambda files: with_passports(in_one(PNGS[0], painted)(files), code=64 * "0"),
            PNGS[:1],
        )
        yield (
            "a red square, and another lock in the passport",
            lambda files: with_passports(in_one(PNGS[0], painted)(files), lock=64 * "0"),
            PNGS[:1],
        )
        yield (
            "a red square, and other settings in the passport",
            lambda files: with_passports(in_one(PNGS[0], painted)(files), settings={"a": "b"}),
            PNGS[:1],
        )
        for name in TABLES:
            for what, edit in {
                "a number changed": another_number,
                "cut in half": half,
                "the last line lost": last_line_lost,
                "a row twice": row_twice,
                "rows swapped": rows_swapped,
            }.items():
                yield (
                    f"{what} in {name}",
                    table_changed(name, edit, claims),
                    (PurePosixPath(name).name,),
                )
            base = PurePosixPath(name).name
            yield f"{name} changed alone", in_one(name, another_number), (f"another {base}",)
        yield (
            "a column that does not follow",
            table_changed(other, lambda data: data.replace(b"0.5,2.0,1.0", b"0.5,2.0,1.5"), claims),
            (f"{other}: c_um does not follow",),
        )
        yield (
            "all columns changed",
            table_changed(other, lambda data: data.replace(b"0.5,2.0,1.0", b"0.5,3.0,1.5"), claims),
            ("figS3.csv: ",),
        )
        yield "a table lost", without(one), (one,)
        yield "a figure lost", without(PNGS[1]), PNGS[1:]

    yield Tampering("forged: a figure more", with_more, ("figures/fig9.png",))
    for name, change, named in changes():
        yield Tampering(
            f"forged: {name}",
            lambda files, change=change: forged(change(files)),  # type: ignore[misc]
            named,
        )
        if not name.startswith("a byte in"):  # what a reference from another machine cannot show
            yield Tampering(
                f"forged, as if elsewhere: {name}",
                lambda files, change=change: elsewhere(forged(change(files))),  # type: ignore[misc]
                named,
            )


def elsewhere(files: Files) -> Files:
    """Say that the run was made on another kind of machine, where digits may differ."""
    return about(arithmetic="another processor", zlib="another")(files)
