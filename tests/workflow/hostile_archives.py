"""Archives that somebody made to harm whoever verifies them, from the members of an honest one.

Each kind is what a stranger could send, and one line that has to be said about it. Code in them
leaves a mark where the variable HOSTILE_MARKER says.
"""

from __future__ import annotations

import base64
import hashlib
import io
import json
import pickle
import struct
import zipfile
import zlib
from collections.abc import Callable, Iterator, Mapping
from typing import Any, NamedTuple

Members = Mapping[str, bytes]

RECORDS = ".snakemake/metadata"
PYTHON = b"import os; open(os.environ['HOSTILE_MARKER'], 'a').close()\n"
SHELL = "touch $HOSTILE_MARKER"
ESCAPE = "\x1b[2J\x1b]0;owned\x07"


class Hostile(NamedTuple):
    """One kind.

    Parameters
    ----------
    name : str
    make : callable
        From the members of an honest archive to the bytes of a hostile one.
    said : str
        Regular expression of what has to be said.
    quick : bool
        Whether it belongs to the few that run always.
    """

    name: str
    make: Callable[[Members], bytes]
    said: str
    quick: bool = False


class Pickled:
    """What leaves a mark when it is unpickled."""

    def __reduce__(self) -> tuple[Callable[[str], Any], tuple[str]]:
        return exec, (PYTHON.decode(),)


# ---------------------------------------------------------------------------------------------
# How they are put together


def sealed(members: Members) -> dict[str, bytes]:
    """Rewrite the list of digests, as somebody would who forges."""
    names = sorted(set(members) - {"SHA256SUMS"})
    lines = [f"{hashlib.sha256(members[name]).hexdigest()}  {name}\n" for name in names]
    return {**members, "SHA256SUMS": "".join(lines).encode("utf-8", "surrogateescape")}


def zipped(members: Members, compress: bool = False) -> bytes:
    """Write a zip file of members, with their digests."""
    data = io.BytesIO()
    method = zipfile.ZIP_DEFLATED if compress else zipfile.ZIP_STORED
    with zipfile.ZipFile(data, "w", method) as file:
        for name, content in sorted(sealed(members).items()):
            file.writestr(name, content)
    return data.getvalue()


def said_of_itself(members: Members, **fields: Any) -> dict[str, bytes]:
    """Change what the archive says of itself."""
    said = json.loads(members["archive.json"]) | fields
    return {**members, "archive.json": json.dumps(said).encode()}


def changed(changes: Mapping[str, bytes], **fields: Any) -> Callable[[Members], bytes]:
    """Put other bytes in, and say other things in ``archive.json``."""
    return lambda members: zipped(said_of_itself({**members, **changes}, **fields), compress=True)


def appended(name: str, data: bytes) -> Callable[[Members], bytes]:
    """Add to a member."""
    return lambda members: zipped({**members, name: members.get(name, b"") + data})


def overlaid(text: str | bytes, name: str = "settings/1-mine.yaml") -> Callable[[Members], bytes]:
    """Lay settings over the study's own."""
    data = text.encode() if isinstance(text, str) else text
    return changed({name: data}, overlays=[name])


def record_path(output: str) -> str:
    """Where Snakemake keeps the record of a file."""
    return f"{RECORDS}/{base64.urlsafe_b64encode(output.encode()).decode()}"


def recorded(
    output: str, change: Callable[[dict[str, Any]], Any], place: str = ""
) -> Callable[[Members], bytes]:
    """Change the record of a figure; keep it as that of another output, or elsewhere."""

    def make(members: Members) -> bytes:
        record = json.loads(members[record_path("figures/fig1.pdf")])
        data = change(record)
        data = data if isinstance(data, bytes) else json.dumps(record).encode()
        return zipped({**members, place or record_path(output): data}, compress=True)

    return make


class Entry(NamedTuple):
    """One member of a zip file, with what it says of itself in two places."""

    name: bytes
    data: bytes = b""
    method: int = 0
    flags: int = 0
    size: int | None = None
    attributes: int = 0o100644 << 16
    local_name: bytes | None = None
    offset: int | None = None
    extra: bytes = b""
    hidden: bool = False
    stored: bytes | None = None


def raw_zip(entries: list[Entry], index_moves: int = 0, comment: bytes = b"") -> bytes:
    """Write a zip file that says whatever it is told to say."""
    body, index = b"", b""
    for it in entries:
        packer = zlib.compressobj(9, zlib.DEFLATED, -15)
        data = packer.compress(it.data) + packer.flush() if it.method == 8 else it.data
        data = data if it.stored is None else it.stored
        crc, size = zlib.crc32(it.data), len(it.data) if it.size is None else it.size
        common = struct.pack("<4HL2L", it.flags, it.method, 0, 33, crc, len(data), size)
        name = it.name if it.local_name is None else it.local_name
        offset = len(body) if it.offset is None else it.offset
        body += b"PK\3\4" + struct.pack("<H", 20) + common
        body += struct.pack("<2H", len(name), 0) + name + data
        if it.hidden:  # not in the index
            continue
        index += b"PK\1\2" + struct.pack("<2H", 0x031E, 20) + common
        index += struct.pack("<5H2L", len(it.name), len(it.extra), 0, 0, 0, it.attributes, offset)
        index += it.name + it.extra
    n = min(sum(not it.hidden for it in entries), 0xFFFF)
    end = struct.pack("<4H2LH", 0, 0, n, n, len(index), len(body) + index_moves, len(comment))
    return body + index + b"PK\5\6" + end + comment


def with_entries(*entries: Entry, **options: Any) -> Callable[[Members], bytes]:
    """Add members that a library would not write."""

    def make(members: Members) -> bytes:
        own = {name: data for name, data in members.items() if name != "SHA256SUMS"}
        for it in entries:
            if not it.hidden:
                own.pop(it.name.decode("latin-1"), None)
        whole = [Entry(name.encode(), data) for name, data in sealed(own).items()]
        return raw_zip([*whole, *entries], **options)

    return make


def zeros(n: int) -> bytes:
    """Compress very many zeros in no time: a block that is flushed can be repeated."""
    piece = 1 << 22
    packer = zlib.compressobj(9, zlib.DEFLATED, -15)
    block = packer.compress(bytes(piece)) + packer.flush(zlib.Z_FULL_FLUSH)
    return block * (n // piece) + packer.compress(bytes(n % piece)) + packer.flush()


def zlib_zeros(n: int) -> bytes:
    """The same with the head and the checksum of zlib."""
    return b"\x78\xda" + zeros(n) + struct.pack(">2H", n % 65521, 1)


def bomb(name: str, n: int, said: int | None = None) -> Callable[[Members], bytes]:
    """A member of very many zeros, of which its header says how many, or less."""

    def make(members: Members) -> bytes:
        entry = Entry(name.encode(), b"", 8, size=n if said is None else said, stored=zeros(n))
        return with_entries(entry)(members)

    return make


# ---------------------------------------------------------------------------------------------
# Figures


def chunk(kind: bytes, data: bytes) -> bytes:
    """One chunk of a PNG."""
    return struct.pack(">L", len(data)) + kind + data + struct.pack(">L", zlib.crc32(kind + data))


def png(width: int, height: int, *chunks: bytes, pixels: bytes | None = None) -> bytes:
    """A grey PNG of zeros, with chunks before its pixels."""
    head = struct.pack(">2L5B", width, height, 1, 0, 0, 0, 0)
    if pixels is None:
        pixels = zlib_zeros(height * (1 + (width + 7) // 8))
    parts = [chunk(b"IHDR", head), *chunks, chunk(b"IDAT", pixels), chunk(b"IEND", b"")]
    return b"\x89PNG\r\n\x1a\n" + b"".join(parts)


def passport_of(members: Members, **changes: Any) -> bytes:
    """The passport of a figure, changed and with its digests put right."""
    from keystab.io.figure_metadata import FigureMetadata

    data = members["figures/fig1.png"]
    start = data.index(b"keystab\0") + 8
    said = json.loads(data[start : data.index(b"}", data.index(b'"version"')) + 1])
    said.pop("config")
    return FigureMetadata(**{**said, **changes}).to_text().encode()


def drawn(
    make: Callable[[bytes], bytes], name: str = "figures/fig1.png", **passport: Any
) -> Callable[[Members], bytes]:
    """Put another picture in the place of a figure, given its passport."""
    return lambda members: zipped({**members, name: make(passport_of(members, **passport))})


def text_chunk(passport: bytes) -> bytes:
    """The passport where the study writes it."""
    return chunk(b"tEXt", b"keystab\0" + passport)


def pdf(keywords: bytes, more: bytes = b"") -> bytes:
    """Something like a PDF."""
    return b"%PDF-1.4\n1 0 obj\n<< /Keywords (" + keywords + b") >>\nendobj\n" + more + b"%%EOF\n"


def escaped(text: bytes) -> bytes:
    """Text as it stands in a PDF."""
    return text.replace(b"\\", b"\\\\").replace(b"(", b"\\(").replace(b")", b"\\)")


# ---------------------------------------------------------------------------------------------
# The kinds


def folders() -> Iterator[Hostile]:
    """Folders of results that would be the project's own, or elsewhere."""
    code = {
        "Snakefile": PYTHON,
        "workflow/rules/common.smk": PYTHON,
        "profiles/default/config.yaml": b"snakefile: evil.smk\n",
        "src/keystab/__init__.py": PYTHON,
        "evil.smk": PYTHON,
    }
    own, none = "one of the project's own", "no folder within the project"
    places = {
        "workflow": own, "Workflow": own, "workflow/rules": own, "profiles": own, "src": own,
        "config": own, "settings": own, "results/reference": own, "results/reference/x": own,
        "": none, ".": none, "..": none, "config/../workflow": none, ".git": none, "/": none,
        ".snakemake": none, "/etc": none, "~": none, "-rf": none, "a\\b": none, "C:/x": none,
        "results ": none, "results/\n": none, f"re{ESCAPE}": none, "a" * 90_000: none,
        "results/" * 50 + "x": none,
    }  # fmt: skip
    for number, (place, said) in enumerate(places.items()):
        key = ("results", "figures", "logs")[number % 3]
        yield Hostile(
            f"folder of {key} {place[:20]!a}",
            changed(code, **{key: place}),
            f"archive.json (names as {key} .*{said}|says nothing)",
            quick=place in ("workflow", "", "config/../workflow"),
        )


def code() -> Iterator[Hostile]:
    """Members that would be code, where Python, Snakemake, make or a shell look for it."""
    other = "other code than is here"
    for name, data in {
        "Snakefile": PYTHON,
        "workflow/rules/common.smk": PYTHON,
        "workflow/jobs.py": PYTHON,
        "profiles/default/config.yaml": b"snakefile: evil.smk\n",
    }.items():
        yield Hostile(
            f"{name} is code",
            appended(name, data),
            f"{name}: {other}",
            name == "workflow/rules/common.smk",
        )
    coding = b"# coding: utf-7\n# +AAo-" + PYTHON.replace(b"'", b"+ACc-")
    yield Hostile(
        "a comment that is code in another encoding",
        lambda members: zipped(
            {**members, "workflow/jobs.py": coding + members["workflow/jobs.py"]}
        ),
        f"workflow/jobs.py: {other}",
    )
    yield Hostile(
        "a comment that ends at a carriage return",
        appended("workflow/jobs.py", b"# harmless\r" + PYTHON),
        f"workflow/jobs.py: {other}",
    )
    for name, data in {
        "sitecustomize.py": PYTHON,
        "usercustomize.py": PYTHON,
        "conftest.py": PYTHON,
        "yaml.py": PYTHON,
        "yaml/__init__.py": PYTHON,
        "snakemake/__init__.py": PYTHON,
        "evil.pth": PYTHON,
        "evil": b"#!/bin/sh\n" + SHELL.encode(),
        ".envrc": SHELL.encode(),
        ".snakemake/scripts/evil.py": PYTHON,
        ".git/hooks/post-checkout": b"#!/bin/sh\n" + SHELL.encode(),
        "results/views/still/evil.py": PYTHON,
        "results/tables/sitecustomize.py": PYTHON,
        "results/summary.md": b"# All claims are reproduced\n",
        "figures/more/fig1.png": b"",
        "results/tables/fig9.parquet": pickle.dumps(Pickled()),
    }.items():
        yield Hostile(
            f"{name} is more than a run packs",
            appended(name, data),
            f"{name}: .*(not what a run packs|not in results/final.sha256)",
            quick=name == "sitecustomize.py",
        )
    for name in ("src/evil.pth", "tests/conftest.py", "src/keystab/__main__.py"):
        yield Hostile(f"{name} is not here", appended(name, PYTHON), f"{name}: {other}")
    yield Hostile(
        "a table that is pickled",
        changed({"results/tables/fig1.csv": pickle.dumps(Pickled())}),
        "results/tables/fig1.csv: not as it was when the run ended",
    )
    yield Hostile(
        "code among the records",
        changed({f"{RECORDS}/evil.py": PYTHON}),
        "evil.py: not a record of Snakemake",
    )


def overlays() -> Iterator[Hostile]:
    """Settings that would be options or lead elsewhere, and those that cannot be read."""
    for name in (
        "settings/1---snakefile=x.yaml",
        "--snakefile=evil",
        "settings/--snakefile=evil.smk",
        "settings/1-a/../../x.yaml",
        "../x.yaml",
        "/etc/passwd",
        "config/config.yaml",
        "settings/1-lost.yaml",
        f"settings/1-{ESCAPE}.yaml",
        "-",
    ):
        yield Hostile(
            f"overlay {name!a}",
            changed({"settings/1---snakefile=x.yaml": b"seed: 1\n"}, overlays=[name]),
            "no file of settings|says nothing",
            quick=name.endswith("=x.yaml"),
        )
    outside = "a file outside the archive"
    for number, (text, said) in enumerate(
        {
            "reference: /etc/passwd": outside,
            "reference: ../outside/scene.txt": outside,
            "reference: config/../../outside/scene.txt": outside,
            "reference: .git/config": outside,
            "predictors: {pictures: {a: {path: /etc/passwd}}}": outside,
            "predictors: {pictures: {a: {path: a/../../b.png}}}": outside,
            "pictures: [config/config.yaml, ../../evil.yaml]": outside,
            "results: /tmp/elsewhere": "results|no text",
            "figures: ../elsewhere": "figures",
            "logs: workflow": "logs",
            "results: results/other": "results",
            "seed: !!python/object/apply:os.system ['touch $HOSTILE_MARKER']": "not plain YAML",
            "seed: !!python/name:os.system": "not plain YAML",
            "!!python/object/new:type {args: [z, [], {extend: !!python/name:exec}]}": "not plain YAML",
            "seed: !!int ''": "not plain YAML",
            "seed: !!bool maybe": "not plain YAML",
            "seed: !!timestamp tomorrow": "not plain YAML",
            "seed: !!binary aGk=": "not plain YAML",
            "seed: " + "1:" * 900 + "1.5": "not plain YAML|seed is",
            "seed: " + "9" * 5000: "not plain YAML|seed is",
            "seed: &a [1]\nblur: *a": "refers to parts of itself",
            "a: &a [1, 1]\nb: &b [*a, *a]\nc: &c [*b, *b]\nd: [*c, *c]": "refers to parts of itself",
            "blur: " + "[" * 3000 + "]" * 3000: "nested too deeply",
            "blur: " + "{a: " * 3000 + "}" * 3000: "nested too deeply",
            "blur: [": "not plain YAML",
            "blur: 1\n---\nblur: 2": "found another document",
            "just text": "holds no settings",
            "[1, 2]": "holds no settings",
            f'blur: "$({SHELL})"': "is no text of a setting",
            f"reference: '; {SHELL}; #'": "is no text of a setting",
            f"reference: 'config/scene.txt`{SHELL}`'": "is no text of a setting",
            "reference: --snakefile": "is no text of a setting|outside",
            "reference: config/scene.txt --snakefile evil.smk": "is no text of a setting",
            f'reference: "a\\n{SHELL}"': "is no text of a setting",
            'reference: "\\e[2J"': "is no text of a setting",
            f"'{SHELL}': 1": "is no text of a setting",
            "blur: .nan": "blur is nan",
            "blur: .inf": "blur is inf",
            "blur: [1.1]": "blur is",
            "blur: {a: 1}": "blur is a block",
            "1: 2": "the name 1 is read as the number 1",
            "2020-01-01: 2": "is read as a date",
            "\n".join(f"s{n}: 1" for n in range(900)): "s0 is no setting.*, and 899 more",
            "\n".join(f"s{n}: 1" for n in range(4000)): "too many values",
            "numbers: [" + "1," * 40_000 + "1]": "too many values",
            "blur: 1.2": "Taking views: .*Params have changed",
        }.items()
    ):
        yield Hostile(
            f"settings {number}, {text[:30]!a}", overlaid(text), said, quick="os.system [" in text
        )
    yield Hostile("settings not in UTF-8", overlaid(b"seed: \xff\xfe"), "not plain YAML in UTF-8")
    yield Hostile("settings with NUL", overlaid(b"seed: 1\0"), "not plain YAML")
    yield Hostile(
        "settings of 10 MB", overlaid(b"numbers: [" + 5_000_000 * b"1," + b"1]"), "has 10 MB"
    )
    yield Hostile(
        "settings of 120 kB", overlaid(b"numbers: [" + 60_000 * b"1," + b"1]"), "more than"
    )
    yield Hostile(
        "settings ten thousand times",
        changed({"settings/1-a.yaml": b"seed: 1\n"}, overlays=10_000 * ["settings/1-a.yaml"]),
        "says nothing",
    )


def records() -> Iterator[Hostile]:
    """Records of Snakemake that no Snakemake wrote."""
    odd = "not a record of Snakemake"
    for output in (
        "/etc/passwd", "../outside/victim.txt", "Snakefile", "results/../Snakefile", "results",
        "workflow/rules/common.smk", "results//x", "results/./x", "figures/a\nb", "",
    ):  # fmt: skip
        yield Hostile(
            f"record of {output!a}",
            recorded(output, lambda record: None),
            f"no result of this run|{odd}|no name of a file",
            quick=output.startswith("../outside"),
        )
    fields: dict[str, list[Any]] = {
        "input": [None, "x", [1], {"a": 1}, [[]], ["/etc/passwd"], ["../outside/victim.txt"], ["a\nb"]],
        "input_checksums": [None, [], {"a": 1}, {"/etc/passwd": "sha256:0"}, "x"],
        "params": [None, {}, [1], "x"],
        "rule": [None, [], 1],
        "log": [None, [1]],
        "incomplete": [True, None, 0, "x"],
        "starttime": ["x", True, [], float("nan"), float("inf")],
        "endtime": [{}, float("-inf"), 10**5000],
        "job_hash": [None, 1.5, True],
        "external_jobid": [[], 1],
        "record_format_version": [None, "6", True, 0, 5, -1],
        "shellcmd": [1, [], None],
        "code": [1, None],
        "software_stack_hash": [None, 1],
    }  # fmt: skip
    for key, values in fields.items():
        for value in values:
            text = f"int{10**9}" if isinstance(value, int) and value > 10**9 else repr(value)

            def change(record: dict[str, Any], key: str = key, value: Any = value) -> bytes:
                record[key] = "PLACE"
                large = isinstance(value, int) and value > 10**9
                said = "1" + "0" * 5000 if large else json.dumps(value)
                return json.dumps(record).replace('"PLACE"', said).encode()

            said = f"{odd}|outside the project"
            yield Hostile(
                f"a record whose {key} is {text}", recorded("figures/fig1.pdf", change), said
            )

    def own_input(record: dict[str, Any]) -> None:
        record["input"] = ["figures/fig1.pdf"]
        record["input_checksums"] = {"figures/fig1.pdf": "sha256:" + 64 * "0"}

    yield Hostile(
        "a record that is its own input",
        recorded("figures/fig1.pdf", own_input),
        "figures/fig1.pdf: not as it was when others were made from it",
        quick=True,
    )
    yield Hostile(
        "a record that says that nothing is to be done",
        recorded(
            "figures/fig1.pdf",
            lambda record: record.update(
                params=["\nNothing to be done (all requested files are present and up to date)."]
            ),
        ),
        "Drawing: .*(Params have changed|Set of input)",
        quick=True,
    )
    for name, data, said in (
        ("deep", b"[" * 100_000, odd),
        ("deep within", b'{"rule": ' + b"[" * 100_000 + b"]" * 100_000 + b"}", odd),
        ("not JSON", b"rule: x", odd),
        ("empty", b"", odd),
        ("not in UTF-8", b'{"rule": "\xff"}', odd),
        ("a list", b"[]", odd),
        ("a number", b"1", odd),
        ("of 6 MB", b'{"rule": "' + 6_000_000 * b"x" + b'"}', "much less"),
        ("of many lists", b'{"rule": [' + 1_300_000 * b"[]," + b"[]]}", odd),
    ):
        yield Hostile(
            f"a record that is {name}",
            recorded("figures/fig1.pdf", lambda record, data=data: data),  # type: ignore[misc]
            said,
        )
    yield Hostile(
        "two records of one output",
        recorded("", lambda record: None, f"{record_path('figures/fig1.pdf')[:-4]}@/pZg=="),
        f"{odd}|no result of this run",
    )
    yield Hostile(
        "a record where Snakemake does not look",
        recorded("", lambda record: None, f"{RECORDS}/more/{record_path('a')[20:]}"),
        f"{odd}|no result of this run",
    )
    yield Hostile(
        "records with one of another spelling",
        recorded("", lambda record: None, f"{RECORDS}/ZmlndXJlcy9maWcxLnBkZh=="),
        f"{odd}|no result of this run",
    )

    def many(members: Members) -> bytes:
        record = members[record_path("figures/fig1.pdf")]
        more = {record_path(f"results/x/{n}.csv"): record for n in range(4000)}
        return zipped({**members, **more}, compress=True)

    yield Hostile("four thousand records", many, "x/0.csv: recorded, but neither here")

    yield Hostile(
        "a record of half a letter",
        recorded("figures/fig1.pdf", lambda record: record.update(params=["\ud800", "\udcff"])),
        # Snakemake cannot print why it would draw, but what would follow from it.
        "Drawing: |Listing: ",
    )

    def long_lists(record: dict[str, Any]) -> None:
        record["input"] = [f"i{n}" for n in range(400_000)]

    yield Hostile(
        "a record with very many inputs",
        recorded("figures/fig1.pdf", long_lists),
        "too long|Set of input files has changed|records of|no record",
    )


def pictures() -> Iterator[Hostile]:
    """What settings name as a picture, and is a program, or without end."""
    page = struct.pack("<H2L", 1, 0, 0)[:2] + struct.pack("<2H2L", 256, 4, 1, 10)
    many = b"".join(page + struct.pack("<L", 8 + 18 * (n + 1)) for n in range(100_000))
    for name, data in {
        "a program in PostScript": b"%!PS-Adobe-3.0 EPSF-3.0\n%%BoundingBox: 0 0 9 9\n(x) print\n",
        "a pickle": pickle.dumps(Pickled()),
        "an array of objects": b"\x93NUMPY\1\0v\0{'descr': '|O'}" + pickle.dumps(Pickled()),
        "a page that comes again": b"II*\0\x08\0\0\0" + page + b"\x08\0\0\0",
        "a hundred thousand pages": b"II*\0\x08\0\0\0" + many,
        "nothing": b"",
    }.items():
        settings = {"settings/1-mine.yaml": b"reference: config/images/a.png"}
        yield Hostile(
            f"a picture that is {name}",
            changed({**settings, "config/images/a.png": data}, overlays=[*settings]),
            "a.png: no PNG, JPEG or TIFF that holds one picture",
            quick="program" in name,
        )


def zips() -> Iterator[Hostile]:
    """What is wrong with the zip file itself."""
    whole = "not a whole zip file"
    out = "leads out of its folder"
    for name, flags in (("encrypted", 1), ("strongly encrypted", 0x40), ("masked", 0x2000)):
        yield Hostile(
            f"a member is {name}",
            with_entries(Entry(b"results/claims.csv", b"x", flags=flags)),
            "is encrypted",
            quick=name == "encrypted",
        )
    yield Hostile("a member is patched", with_entries(Entry(b"a", flags=0x20)), f"{whole}|patched")
    for method in (1, 6, 9, 12, 14, 93, 95, 97, 99):
        yield Hostile(
            f"compression {method}",
            with_entries(Entry(b"results/claims.csv", b"x", method=method)),
            "is compressed in a way",
            quick=method == 99,
        )
    for name in (
        b"../escaped.txt", b"/escaped.txt", b"results/../../escaped.txt", b"..\\escaped.txt",
        b"C:escaped.txt", b"a//b", b"./a", b"a/.", b"a/", b"", b"a\nb", b"a\rb", b"a\0b", b"\0",
        ESCAPE.encode(), b"results/tables/\x1b[31m.csv", b"a\x7fb",
    ):  # fmt: skip
        yield Hostile(f"a member is called {name!a}", with_entries(Entry(name, b"x")), out)
    yield Hostile(
        "a member with another name for other programs",
        with_entries(Entry(b"x", extra=struct.pack("<2HBL", 0x7075, 9, 1, 0) + b"evil")),
        "has more fields",
    )
    yield Hostile(
        "a member that other programs alone see",
        with_entries(Entry(b"Snakefile", PYTHON, hidden=True)),
        whole,
        quick=True,
    )
    yield Hostile("a member for others", with_entries(Entry(b"x", attributes=0o104755 << 16)), "is a link or a device")  # fmt: skip
    yield Hostile(
        "a name that turns the text around",
        with_entries(Entry("a\u202egnp.exe".encode(), flags=0x800)),
        out,
    )
    yield Hostile(
        "a name not in UTF-8",
        with_entries(Entry(b"\xff\xfe", flags=0x800)),
        whole,
    )
    yield Hostile("a name of 60000", with_entries(Entry(b"a/" * 30_000 + b"b")), "too long a name")
    yield Hostile("a name of 300", with_entries(Entry(b"b" * 300)), "too long a name")
    yield Hostile("a member is a link", with_entries(Entry(b"x", b"/etc", attributes=0xA1FF << 16)), "is a link", True)  # fmt: skip
    yield Hostile("a member is a device", with_entries(Entry(b"x", attributes=0o020666 << 16)), "is a link")  # fmt: skip
    yield Hostile("a member is there twice", with_entries(Entry(b"x", b"1"), Entry(b"x", b"2")), "is there twice", True)  # fmt: skip
    yield Hostile("a member differs in case only", with_entries(Entry(b"snakefile", PYTHON)), "is there twice")  # fmt: skip
    accents = Entry("x\u00e9".encode(), flags=0x800), Entry("xe\u0301".encode(), flags=0x800)
    yield Hostile("names differ in their accents only", with_entries(*accents), "is there twice")
    yield Hostile("a file is a folder, too", with_entries(Entry(b"LICENSE/x", b"1")), "lies in a file")  # fmt: skip
    yield Hostile("the inner name differs", with_entries(Entry(b"x", b"1", local_name=b"y")), "x: damaged|not what a run packs")  # fmt: skip
    yield Hostile("members lie over each other", with_entries(*(Entry(f"x{n}".encode(), bytes(9), offset=0) for n in range(99))), whole)  # fmt: skip
    yield Hostile("the index moves", with_entries(index_moves=1 << 20), whole)
    yield Hostile("the index moves back", with_entries(index_moves=-100), whole)
    yield Hostile("a member lies beyond the end", with_entries(Entry(b"x", offset=1 << 30)), whole)  # fmt: skip
    huge = struct.pack("<2HQ", 1, 8, 1 << 62)
    yield Hostile("sizes of 64 bits", with_entries(Entry(b"x", b"1", size=0xFFFFFFFF, extra=huge)), "has more fields")  # fmt: skip
    yield Hostile("a broken field of 64 bits", with_entries(Entry(b"x", b"1", size=0xFFFFFFFF, extra=huge[:6])), f"{whole}|has more fields")  # fmt: skip
    yield Hostile("a comment behind the index", with_entries(comment=b"PK\5\6" + bytes(20)), f"{whole}|no archive")  # fmt: skip
    many = [Entry(f"x{n}".encode()) for n in range(70_000)]
    yield Hostile("seventy thousand members", with_entries(*many), "too many files")
    some = [Entry(f"docs/{n}.md".encode()) for n in range(19_000)]
    yield Hostile("nineteen thousand members", with_entries(*some), "too many files")
    for name, cut in {
        "empty": lambda data: b"",
        "truncated": lambda data: data[:5000],
        "cut by one byte": lambda data: data[:-1],
        "with a byte more": lambda data: data + b"\0",
        "with a shell script in front": lambda data: f"#!/bin/sh\n{SHELL}\nexit\n".encode() + data,
        "a picture and a zip file": lambda data: png(9, 9) + data,
        "with an index of 64 bits": lambda data: (
            data[:-22] + b"PK\6\7" + struct.pack("<LQL", 0, 0, 1) + data[-22:]
        ),
        "text": lambda data: b"results\n",
        "without its start": lambda data: bytes(4) + data[4:],
    }.items():
        yield Hostile(
            f"an archive that is {name}",
            lambda members, cut=cut: cut(zipped(members)),  # type: ignore[misc]
            f"{whole}|too many files|damaged",
            quick=name == "with a byte more",
        )
    yield Hostile("an archive of nothing", lambda members: zipped({}), "no archive of this study")
    yield Hostile(
        "members of two gigabytes of nothing",
        lambda members: zipped({**members, "a": b"", "b": b""})[:-22] + zipped({})[-22:],
        f"{whole}|no archive",
    )


def bombs() -> Iterator[Hostile]:
    """What becomes large."""
    yield Hostile("3 GB of zeros", bomb("docs/a.bin", 3_000_000_000), "unpacks to 3 GB", True)
    yield Hostile("3 GB that say 100 bytes", bomb("docs/a.bin", 3_000_000_000, 100), "a.bin: not in SHA256SUMS")  # fmt: skip
    yield Hostile("3 GB that say 400 MB", bomb("docs/a.bin", 3_000_000_000, 400_000_000), "a.bin: not in SHA256SUMS")  # fmt: skip
    yield Hostile("450 MB of zeros", bomb("docs/a.bin", 450_000_000), "a.bin: not in SHA256SUMS")  # fmt: skip
    for name, said in {
        "figures/fig1.pdf": "figures of a run have much less",
        "figures/fig1.png": "figures of a run have much less",
        "results/tables/fig1.parquet": "fig1.parquet: not what a run packs",
        "config/images/a.png": "a.png: not in SHA256SUMS",
    }.items():
        yield Hostile(f"{name} of 400 MB", bomb(name, 400_000_000), said)
    for name in ("README.md", "archive.json", "SHA256SUMS", "results/claims.json", "results/final.sha256", "left-out.csv", "results/tables/fig1.csv"):  # fmt: skip
        yield Hostile(f"{name} of 90 MB", bomb(name, 90_000_000), "much less|says nothing")

    def many(members: Members) -> bytes:
        more = {f"results/tables/t{n}.csv": b"a\n" + b"123\n" * 1_000_000 for n in range(40)}
        return zipped({**members, **more}, compress=True)

    yield Hostile("forty tables of 4 MB", many, "holds tables of")
    words = b"".join(b"%x,%x\n" % (n, n * n) for n in range(330_000))[:4_900_000]
    yield Hostile(
        "tables of very many words",
        lambda members: zipped(
            {
                **members,
                **{
                    name: b"a,b\n" + words
                    for name in (
                        "results/tables/fig1.csv",
                        "results/tables/figS3.csv",
                        "results/tables/t.csv",
                    )
                },
            },
            compress=True,
        ),
        "figS3.csv: not as it was when the run ended",
    )
    digests = b"".join(b"%064d  f%d\n" % (n, n) for n in range(65_000))
    for name, data, said in (
        ("results/final.sha256", digests, "f0: missing"),
        ("results/views/still.sha256", digests, "still.sha256: not as it was"),
        (
            "left-out.csv",
            b"".join(b"f%d,1,%064d,x\n" % (n, n) for n in range(60_000)),
            "f0: no record of what",
        ),
        (
            "results/claims.csv",
            b"".join(b"c%d,,,,,,,,,reproduced,\n" % n for n in range(200_000)),
            "claims.csv' has 5.* MB; tables and texts of a run have much less",
        ),
        (
            "results/claims.md",
            b"".join(b"| `c%d` |\n" % n for n in range(400_000)),
            "claims.md' has .* MB; tables and texts of a run have much less",
        ),
    ):
        yield Hostile(f"{name} of very many lines", appended(name, data), said)

    def listed(members: Members) -> bytes:
        return unsealed("SHA256SUMS", digests)(members)

    yield Hostile("SHA256SUMS of very many lines", listed, "f0: missing")

    def short_words(record: dict[str, Any]) -> None:
        record["params"] = [f"{n:x}" for n in range(550_000)]

    def records_of_short_words(members: Members) -> bytes:
        record = json.loads(members[record_path("figures/fig1.pdf")])
        short_words(record)
        data = json.dumps(record).encode()
        assert len(data) < 5_000_000
        names = ("figures/fig1.pdf", "figures/figS3.pdf")
        return zipped({**members, **{record_path(name): data for name in names}}, compress=True)

    yield Hostile("records of very many words", records_of_short_words, "records of|Drawing: ")

    def figures(members: Members) -> bytes:
        tables = {f"t{n}.csv": 64 * "0" for n in range(200)}
        text = text_chunk(passport_of(members, tables=tables))
        texts = 60 * [chunk(b"zTXt", b"a\0\0" + zlib_zeros(10**6))]
        more = {f"figures/f{n}.png": png(9, 9, text, *texts) for n in range(3000)}
        rows = {f"results/tables/t{n}.csv": b"a\n" + b"1\n" * 9000 for n in range(200)}
        return zipped({**members, **more, **rows}, compress=True)

    yield Hostile("three thousand figures of two hundred tables", figures, "too many files|final.sha256|is figure")  # fmt: skip
    large = lambda text: png(40_000, 40_000, text_chunk(text))  # noqa: E731
    yield Hostile("a figure of 40000 x 40000", drawn(large), "fig1.png: not as it was", True)  # fmt: skip
    for name, make in {
        "a text of 1 GB": lambda text: png(9, 9, chunk(b"zTXt", b"keystab\0\0" + zlib_zeros(10**9))),
        "an international text of 1 GB": lambda text: png(
            9, 9, chunk(b"iTXt", b"keystab\0\1\0\0\0" + zlib_zeros(10**9))
        ),
        "a profile of 1 GB": lambda text: png(9, 9, chunk(b"iCCP", b"x\0\0" + zlib_zeros(10**9)), text_chunk(text)),
        "no picture": lambda text: b"\x89PNG\r\n\x1a\n",
        "a chunk of 2 GB": lambda text: b"\x89PNG\r\n\x1a\n" + b"\x7f\xff\xff\xffIHDR" + bytes(99),
        "a passport of brackets": lambda text: png(9, 9, text_chunk(b"[" * 900_000)),
        "no bytes": lambda text: b"",
        "a GIF": lambda text: b"GIF89a" + bytes(100),
        "no width": lambda text: png(0, 0, text_chunk(text)),
        "sixty texts of 1 MB": lambda text: png(
            40, 30, text_chunk(text), *(63 * [chunk(b"zTXt", b"a\0\0" + zlib_zeros(10**6))])
        ),
        "a million chunks before its pixels": lambda text: png(
            40, 30, text_chunk(text), 1_600_000 * chunk(b"abCd", b"")
        ),
        "a million chunks behind its pixels": lambda text: (
            png(40, 30, text_chunk(text))[:-12] + 1_600_000 * chunk(b"abCd", b"")
        ),
    }.items():  # fmt: skip
        yield Hostile(f"a figure with {name}", drawn(make), "figures/fig1.png: not as it was")
    yield Hostile("a figure of damaged pixels", drawn(lambda text: png(40, 30, text_chunk(text), pixels=b"x" * 99)), "figures/fig1.png: not as it was")  # fmt: skip
    for name, made in {
        "/etc/passwd": "tables", "../../x.csv": "tables", "../fig1": "figure", ESCAPE: "figure",
    }.items():  # fmt: skip
        passport = {"tables": {name: 64 * "0"}} if made == "tables" else {"figure": name}
        yield Hostile(
            f"a passport of {made} {name[:15]!a}",
            drawn(lambda text: png(9, 9, text_chunk(text)), **passport),
            "fig1.png: .*(changed by hand|no passport)",
        )
    long = {"tables": {"a" * 5000: 64 * "0"}, "settings": {"a" * 5000: ESCAPE}, "version": ESCAPE}
    yield Hostile(
        "a passport of long names",
        drawn(lambda text: png(9, 9, text_chunk(text)), **long),
        "fig1.png: drawn from another a{80} than the one here",
    )
    for name, make in {
        "a passport of 15 MB": lambda text: pdf(b"a" * 15_000_000),
        "a passport of escapes": lambda text: pdf(b"\\(" * 7_000_000),
        "a million passports": lambda text: pdf(b"", b"/Keywords (" * 1_000_000),
        "an open passport": lambda text: b"%PDF-1.4\n/Keywords (" + b"a" * 15_000_000,
        "a page of 1 GB": lambda text: pdf(
            escaped(text), b"2 0 obj\n<< /Filter /FlateDecode >>\nstream\n" + zlib_zeros(10**9)
        ),
        "itself as a page": lambda text: pdf(escaped(text), b"trailer << /Root 1 0 R /Prev 9 >>\nstartxref\n9\n"),
    }.items():  # fmt: skip
        yield Hostile(
            f"a figure as PDF with {name}", drawn(make, "figures/fig1.pdf"), "fig1.pdf: not as it was"
        )  # fmt: skip


def texts() -> Iterator[Hostile]:
    """Bytes that are not UTF-8, fields without end, and wrong types in what is read as text."""
    latin = b"\xff\xfe\x80"
    ended = "not as it was when the run ended"
    for name, said in {
        "SHA256SUMS": "SHA256SUMS",
        "archive.json": "archive.json is not JSON",
        "left-out.csv": "left-out.csv: is no list of files",
        "results/final.sha256": "final.sha256",
        "results/views/still.sha256": "still.sha256: not as it was",
        "results/claims.csv": f"claims.csv: {ended}",
        "results/claims.json": f"claims.json: {ended}",
        "results/claims.md": f"claims.md: {ended}",
        "results/tables/fig1.csv": f"fig1.csv: {ended}",
        "results/tables/figS3.csv": f"figS3.csv: {ended}",
    }.items():
        for more in (latin, b"\0", ESCAPE.encode()):
            if name == "SHA256SUMS":
                make = unsealed(name, more)
            else:
                make = appended(name, more)
            yield Hostile(f"{name} with {more!a}", make, said, name == "left-out.csv")
    field = b"x" * 4_000_000
    for name, said in {
        "results/tables/fig1.csv": ended,
        "results/tables/figS3.csv": ended,
        "results/claims.csv": ended,
        "left-out.csv": "no list of files|not as it was",
    }.items():
        for text, data in {
            "a field of 4 MB": field,
            "an open quote": b'"' + field,
            "two million columns": b"1," * 2_000_000,
            "a million rows": b"1,2\n" * 1_000_000,
            "short rows": b"\n1\n",
            "long rows": b"\n1,2,3,4,5,6,7,8,9,10,11,12,13\n",
        }.items():
            yield Hostile(f"{name} with {text}", appended(name, data), said)
            yield Hostile(f"{name} is {text}", changed({name: data}), f"{said}|much less")
    for text, data in {
        "a block": b"{}", "numbers": b"[1, 2]", "null": b"null", "deep": b"[" * 200_000,
        "blocks without verdicts": b'[{"id": "few"}]', "ids that are lists": b'[{"id": [], "verdict": {}}]',
        "many lists": b"[" + b"[]," * 1_300_000 + b"[]]",
    }.items():  # fmt: skip
        yield Hostile(f"claims.json is {text}", changed({"results/claims.json": data}), ended)
    for text, data in {
        "no columns": b"\n", "other columns": b"a,b\n1,2\n", "short rows": b"verdict,id\nreproduced\n",
        "nothing": b"", "ids twice": b"id,id,verdict\na,b,c\n",
    }.items():  # fmt: skip
        yield Hostile(f"claims.csv is {text}", changed({"results/claims.csv": data}), ended)
    yield Hostile("claims.md without names", changed({"results/claims.md": b"| `\n## \n"}), ended)
    for text, data in {
        "infinite": b"c,pitch,c_um\ninf,0,1e999\n-inf,inf,nan\n",
        "text": b"c,pitch,c_um\na,b,c\n",
        "without columns": b"c_um\n1\n",
        "empty": b"",
        "columns twice": b"c,c,pitch,c_um\n1,2,3,4\n",
        "very large": b"c,pitch,c_um\n1e308,1e308,1\n" + b"9" * 400 + b",1,1\n",
    }.items():
        yield Hostile(f"figS3.csv is {text}", changed({"results/tables/figS3.csv": data}), ended)


def unsealed(name: str, more: bytes) -> Callable[[Members], bytes]:
    """Add to the list of digests itself."""

    def make(members: Members) -> bytes:
        data = io.BytesIO()
        whole = sealed(members)
        with zipfile.ZipFile(data, "w") as file:
            for each, content in whole.items():
                file.writestr(each, content + (more if each == name else b""))
        return data.getvalue()

    return make


def descriptions() -> Iterator[Hostile]:
    """Wrong types in every field of ``archive.json``, and other versions."""
    wrong: list[Any] = [None, 1, 1.5, True, "", [], {}, ["x"], {"a": []}, ESCAPE]
    for key in ("lock", "settings", "results", "figures", "logs", "overlays", "arithmetic", "zlib"):
        for value in wrong:
            if (key, value) in (("overlays", []), ("arithmetic", ""), ("zlib", "")):
                continue  # which a run may say
            if key == "overlays" and value == ["x"]:
                continue  # said elsewhere
            yield Hostile(
                f"{key} is {value!a}", changed({}, **{key: value}), "archive.json (says|names)"
            )
    for value in (None, 1, [], {}, True):
        yield Hostile(f"keystab is {value!a}", changed({}, keystab=value), "says nothing about a")
    for version in ("0.1.0", "0.0.1", "0.3.0", "99.0", "", "1" * 90_000, f"1{ESCAPE}\n2"):
        yield Hostile(
            f"written by version {version[:12]!a}",
            changed({}, keystab=version),
            "was written by keystab .*, and this is|says nothing about a run",
            quick=version in ("0.1.0", "99.0"),
        )
    for name, data in {
        "a list": b"[]", "null": b"null", "deep": b"[" * 300_000, "no JSON": b"{", "nothing": b"",
        "NaN": b"NaN", "a deep field": b'{"keystab": "0.2.0", "zlib": ' + b"[" * 900 + b"]" * 900 + b"}",
    }.items():  # fmt: skip
        yield Hostile(f"archive.json is {name}", changed_whole(data), "archive.json")
    for key in ("lock", "settings"):
        yield Hostile(
            f"another {key}", changed({}, **{key: 64 * "0"}), "archive.json: .*(settings|lock)"
        )
    yield Hostile(
        "no description", lambda members: zipped(without(members, "archive.json")), "no archive of"
    )
    yield Hostile(
        "no records",
        lambda members: zipped({k: v for k, v in members.items() if not k.startswith(RECORDS)}),
        "final.sha256: missing, or without a record",
    )


def changed_whole(data: bytes) -> Callable[[Members], bytes]:
    """Put other bytes in the place of ``archive.json``."""
    return lambda members: zipped({**members, "archive.json": data})


def without(members: Members, *names: str) -> dict[str, bytes]:
    """Leave members out."""
    return {name: data for name, data in members.items() if name not in names}


KINDS = [
    *folders(), *code(), *overlays(), *records(), *pictures(), *zips(), *bombs(), *texts(), *descriptions(),
]  # fmt: skip
