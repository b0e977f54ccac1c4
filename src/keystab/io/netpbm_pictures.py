"""Pictures of the Netpbm family: PBM, PGM, PPM, PAM, and the floats of PFM.

Pillow cuts the samples of a PPM to 8 bits and rescales those of other depths; the formats are a few
lines of text and then the samples, http://netpbm.sourceforge.net/doc/.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from keystab.errors import InputError
from keystab.io.picture_samples import Samples, check_memory

__all__ = ["decode", "is_netpbm", "shape"]

_MAGIC = re.compile(rb"P[1-6fF][\s#]|P7\n")
_TOKEN = re.compile(rb"(?:\s|#[^\n\r]*+)*+([^\s#]+)")  # after blanks and comments
_CHANNELS = {
    "": 1,  # OpenCV leaves the type out; of three channels it would be blue that comes first
    "BLACKANDWHITE": 1,
    "GRAYSCALE": 1,
    "BLACKANDWHITE_ALPHA": 2,
    "GRAYSCALE_ALPHA": 2,
    "RGB": 3,
    "RGB_ALPHA": 4,
}
_MOST_HEAD = 65536
_PLAIN_BYTES = 64  # of one sample that is written in digits, while it is read


class _Header(NamedTuple):
    """What a file says before its samples."""

    kind: str  # second letter of the magic number
    height: int
    width: int
    channels: int
    maxval: float  # largest sample; of floats the scale, whose sign is the byte order
    start: int  # of the samples in the file


def is_netpbm(head: bytes) -> bool:
    """Whether a file of this head is of the family.

    Examples
    --------
    >>> is_netpbm(b"P5 640 480 65535 "), is_netpbm(b"PNG")
    (True, False)
    """
    return _MAGIC.match(head) is not None


def shape(path: Path) -> tuple[int, int]:
    """Height and width, from the head of a file."""
    header = _header(path)
    return header.height, header.width


def decode(path: Path) -> Samples:
    """Samples of a file, as exact as they are stored."""
    header = _header(path)
    itemsize = 4 if header.kind in "fF" else 1 if header.maxval < 256 else 2
    plain = header.kind in "123"
    check_memory(
        header.height, header.width, header.channels * (_PLAIN_BYTES if plain else itemsize), path
    )
    body = path.read_bytes()[header.start :]
    values = _plain(body, header, path) if plain else _binary(body, header, itemsize, path)
    if header.kind in "14":  # a bitmap says where there is ink
        return Samples(values == 0, 1.0)
    values = values.reshape(header.height, header.width, header.channels)
    if header.channels == 1:
        values = values[..., 0]
    if header.kind in "fF":
        return Samples(values[::-1], 1.0)  # the last row comes first
    if values.max() > header.maxval:
        raise InputError(
            f"{path}: a sample is {values.max()}, beyond the largest of {header.maxval:g} that the "
            "file announces; write it anew"
        )
    return Samples(values, header.maxval)


def _header(path: Path) -> _Header:
    with path.open("rb") as file:
        head = file.read(_MOST_HEAD)
    kind = chr(head[1])
    header = _pam_header(head, path) if kind == "7" else _pnm_header(kind, head, path)
    if min(header.height, header.width) < 1:
        raise InputError(f"{path}: the picture has no pixels ({header.height} x {header.width})")
    if kind in "fF":
        if abs(header.maxval) != 1:
            raise InputError(
                f"{path}: the PFM has the scale {header.maxval:g}, of which programs make "
                "different things; save it with a scale of 1 or -1"
            )
    elif not 1 <= header.maxval <= 65535:
        raise InputError(
            f"{path}: the largest sample of the PNM is {header.maxval:g}, allowed are 1 to 65535; "
            "write it anew"
        )
    return header


def _pnm_header(kind: str, head: bytes, path: Path) -> _Header:
    """Width, height and, but in a bitmap, the largest sample; then one blank."""
    tokens, end = [], 2
    for _ in range(2 if kind in "14" else 3):
        found = _TOKEN.match(head, end)
        if found is None:
            raise _damaged(path, "its head is cut")
        tokens.append(found[1])
        end = found.end()
    try:
        width, height = map(_whole, tokens[:2])
        last = 1.0 if kind in "14" else float(tokens[2] if kind in "fF" else _whole(tokens[2]))
    except ValueError:
        raise _damaged(path, f"its head says {b' '.join(tokens)[:60]!r}") from None
    return _Header(kind, height, width, 3 if kind in "36F" else 1, last, end + 1)


def _pam_header(head: bytes, path: Path) -> _Header:
    """Lines of a name and a value, up to ENDHDR."""
    text, end, _ = head.partition(b"\nENDHDR\n")
    lines = [line.split(None, 1) for line in text.splitlines()[1:] if not line.startswith(b"#")]
    said = {line[0].decode("latin-1"): line[1].strip() for line in lines if len(line) == 2}
    try:
        numbers = {name: _whole(said[name]) for name in ("WIDTH", "HEIGHT", "DEPTH", "MAXVAL")}
    except (KeyError, ValueError):
        raise _damaged(path, "its head lacks a size") from None
    if not end:
        raise _damaged(path, "its head is cut")
    kind = said.get("TUPLTYPE", b"").decode("latin-1")
    if _CHANNELS.get(kind) != numbers["DEPTH"]:
        raise InputError(
            f"{path}: the PAM has tuples of {numbers['DEPTH']} and type {kind[:40]!r}, which are "
            "neither grey values nor colours; save it as PGM or PPM"
        )
    start = len(text) + len(end)
    size = numbers["HEIGHT"], numbers["WIDTH"]
    return _Header("7", *size, numbers["DEPTH"], float(numbers["MAXVAL"]), start)


def _plain(body: bytes, header: _Header, path: Path) -> NDArray[np.uint16]:
    """Samples that are written in digits."""
    words = re.sub(rb"#[^\n\r]*", b"", body)
    count = header.height * header.width * header.channels
    if header.kind == "1":  # blanks between the digits may lack
        digits = np.frombuffer(b"".join(words.split()), np.uint8)
        values = digits.astype(np.uint16) - ord("0")
        good = bool((values <= 1).all())
    else:
        tokens = np.array(words.split() or [b"?"])
        good = tokens.itemsize <= 5 and bool(np.char.isdigit(tokens).all())
        values = tokens.astype(np.uint32).clip(0, 65536) if good else tokens[:0].astype(np.uint32)
        good = good and bool((values <= 65535).all())
        values = values.astype(np.uint16)
    if not good:
        raise _damaged(path, "what should be samples are no whole numbers up to 65535")
    if values.size != count:
        raise _damaged(path, f"it holds {values.size} samples instead of {count}")
    return values.reshape(header.height, -1)


def _binary(body: bytes, header: _Header, itemsize: int, path: Path) -> NDArray[np.generic]:
    """Samples that are written as bytes, 8 pixels of a bitmap in one."""
    row = -(-header.width // 8) if header.kind == "4" else header.width * header.channels * itemsize
    size = header.height * row
    if len(body) < size or body[size:].strip():
        raise _damaged(path, f"{len(body)} bytes follow its head instead of {size}")
    if header.kind == "4":
        rows = np.frombuffer(body, np.uint8, size).reshape(header.height, row)
        return np.unpackbits(rows, axis=1, count=header.width)
    if header.kind in "fF":
        order = "<" if header.maxval < 0 else ">"
        return np.frombuffer(body, f"{order}f4", size // 4).astype(np.float32)
    values = np.frombuffer(body, f">u{itemsize}", size // itemsize)
    return values.astype(values.dtype.newbyteorder("="))


def _whole(token: bytes) -> int:
    if not token.isdigit() or len(token) > 10:
        raise ValueError(token)
    return int(token)


def _damaged(path: Path, what: str) -> InputError:
    return InputError(f"{path}: a damaged PNM picture: {what}; write it anew")
