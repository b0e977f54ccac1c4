r"""Keypoints in the files of other programs: COLMAP, the Oxford group, VLFeat.

============ ============================================================ ========= =============
format       a keypoint                                                   centre of scale
                                                                          first pixel
============ ============================================================ ========= =============
``csv``      a row with ``y, x, sigma``, as `keystab detect` writes       (0, 0)    sigma
``colmap``   ``x y scale orientation`` and a descriptor, under a line     (.5, .5)  sigma
             with their number and the descriptor's length
``colmap-db`` float32 ``x, y`` and scale and orientation, or an affine    (.5, .5)  sigma
             shape, of one image of a database
``oxford``   ``x y a b c``, an ellipse                                    (0, 0)    radius of the
             :math:`a u^2 + 2 b u v + c v^2 = 1`, under two lines                   ellipse: sigma
``vlfeat``   ``x y sigma theta``, a line each                             (0, 0)    sigma
============ ============================================================ ========= =============

Files in which something else is meant (counted from 1; ellipses of three sigma) are read and
written with a `keystab.io.keypoint_conventions.Convention` that says so.
"""

from __future__ import annotations

import math
import os
import sqlite3
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from keystab.errors import InputError
from keystab.io.keypoint_conventions import COLMAP, KEYSTAB, Convention, angles
from keystab.io.tables import read_table, write_table
from keystab.utils.files import check_writable, written_whole

__all__ = ["KEYPOINT_FORMATS", "read_keypoints", "write_keypoints"]

_XY = Convention(order="xy")
_DESCRIPTOR = 128  # the only length that COLMAP's importer takes

#: Bytes of the largest file that is read as text: some ten million keypoints.
_MOST_BYTES = 2**30


class _Format(NamedTuple):
    """How keypoints of a format are read from lines of numbers, and written."""

    convention: Convention
    read: Callable[[list[str], Convention], pd.DataFrame]
    write: Callable[[pd.DataFrame, Convention], str]


def read_keypoints(
    path: str | os.PathLike[str],
    format: str = "csv",
    image: str | None = None,
    convention: Convention | None = None,
) -> pd.DataFrame:
    """Read keypoints that another program wrote.

    Parameters
    ----------
    path : path
        The file.
    format : {"csv", "colmap", "colmap-db", "oxford", "vlfeat"}
        See the table of `keystab.io.keypoint_files`.
    image : str, optional
        Name of the image in a database; the only one if not given.
    convention : Convention, optional
        What positions and scales in the file mean, where that is not what the format says; the
        order of the coordinates is the format's.

    Returns
    -------
    DataFrame
        ``y, x, sigma`` in pixels, (0, 0) the centre of the top left pixel; ``angle`` in radians
        from x towards y where the format has it. Of an ellipse, sigma is that of the circle of the
        same area. Descriptors are not read.

    Raises
    ------
    InputError
        If the file is missing or not of this format, or a keypoint has no finite position or no
        scale above 0.

    Examples
    --------
    >>> import tempfile
    >>> path = Path(tempfile.mkdtemp()) / "one.frame"
    >>> _ = path.write_text("10 4 1.5 0")
    >>> read_keypoints(path, "vlfeat")
         y     x  sigma  angle
    0  4.0  10.0    1.5    0.0
    """
    path, known = Path(path), _check_format(format)
    if not path.is_file():
        raise InputError(f"{path}: no such file; give the path of a file of keypoints")
    try:
        if format == "csv":
            return _from_csv(path, convention or KEYSTAB)
        if format == "colmap-db":
            return _from_database(path, image, convention or COLMAP)
        if path.stat().st_size > _MOST_BYTES:
            raise InputError("more than 1 GiB; split it")
        lines = path.read_text(encoding="ascii").splitlines()
        used = [line for line in lines if line.strip() and not line.lstrip().startswith("#")]
        return _TEXT[format].read(used, known if convention is None else convention)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    except UnicodeDecodeError:
        raise InputError(f"{path}: no text, so not of format {format}; name another") from None


def write_keypoints(
    keypoints: pd.DataFrame,
    path: str | os.PathLike[str],
    format: str = "csv",
    image: str | None = None,
    convention: Convention | None = None,
) -> None:
    """Write keypoints for another program, whole or not at all.

    Parameters
    ----------
    keypoints : DataFrame
        ``y, x, sigma`` in pixels, and ``angle`` in radians where there is any. Other columns are
        written to ``csv`` and nowhere else.
    path : path
        The file. A database (``colmap-db``) must be one that COLMAP made, with the image in it and
        no keypoints of it.
    format, image, convention
        See `read_keypoints`.

    Raises
    ------
    InputError
        If the keypoints are not what the format needs, or nothing can be written there.

    Notes
    -----
    Text has as many digits as give the same numbers back. COLMAP's text holds descriptors of 128
    zeros, since its importer wants some: match by other means. Its database is in float32.
    """
    path, known = Path(path), _check_format(format)
    own = known if convention is None else convention
    if format == "colmap-db":
        _to_database(keypoints, path, image, own)
        return
    if format == "csv":
        first, second, scale = own.columns(keypoints)
        values = dict(zip((*own.order, "sigma"), (first, second, scale), strict=True))
        write_table(keypoints.assign(**values), path)
        return
    check_writable(path)
    text = _TEXT[format].write(keypoints, own)
    with written_whole(path) as part:
        part.write_text(text, encoding="ascii", newline="")


def _check_format(format: str) -> Convention:
    """Convention of a format, which must be known."""
    if format not in KEYPOINT_FORMATS:
        raise InputError(f"format is {format!r}; give one of {', '.join(KEYPOINT_FORMATS)}")
    return (
        _TEXT[format].convention if format in _TEXT else COLMAP if "colmap" in format else KEYSTAB
    )


# ---------------------------------------------------------------------------------------------
# Text


def _from_csv(path: Path, convention: Convention) -> pd.DataFrame:
    table = read_table(path)
    missing = [name for name in ("y", "x", "sigma") if name not in table]
    if missing:
        raise InputError(f"lacks the column {missing[0]}; a table of keypoints has y, x and sigma")
    own = convention.table(*(table[name] for name in (*convention.order, "sigma")))
    return table.assign(y=own["y"], x=own["x"], sigma=own["sigma"])


def _rows(lines: list[str], n_columns: int, more: bool = False) -> NDArray[np.float64]:
    """Numbers of lines, each with so many of them (or more, of which the first are taken)."""
    rows = []
    for number, line in enumerate(lines, 1):
        words = line.split()
        if len(words) != n_columns and not (more and len(words) > n_columns):
            raise InputError(
                f"keypoint {number} has {len(words)} numbers; this format has {n_columns}"
            )
        try:
            rows.append([float(word) for word in words[:n_columns]])
        except ValueError:
            raise InputError(f"keypoint {number} is {line[:60]!r}; give numbers") from None
    return np.array(rows, dtype=np.float64).reshape(-1, n_columns)


def _counted(lines: list[str], n_before: int, words: int) -> list[str]:
    """Lines after the head of a file, whose last line begins with how many there are."""
    head = lines[:n_before]
    count = head[-1].split() if len(head) == n_before else []
    if len(count) != words or not count[0].isdecimal():
        raise InputError("the number of keypoints does not stand at the beginning; name the format")
    if int(count[0]) != len(lines) - n_before:
        raise InputError(
            f"{int(count[0])} keypoints are announced and {len(lines) - n_before} follow; "
            "the file is cut or of another format"
        )
    return lines[n_before:]


def _text(columns: tuple[NDArray[np.float64], ...], end: str = "") -> str:
    rows = zip(*(column.tolist() for column in columns), strict=True)
    return "".join(" ".join(map(repr, row)) + end + "\n" for row in rows)


def _read_colmap(lines: list[str], convention: Convention) -> pd.DataFrame:
    x, y, scale, angle = _rows(_counted(lines, 1, 2), 4, more=True).T
    return _oriented(convention, x, y, scale, angle)


def _write_colmap(keypoints: pd.DataFrame, convention: Convention) -> str:
    own = _in_xy(keypoints, convention)
    return f"{len(keypoints)} {_DESCRIPTOR}\n" + _text(
        (*own, angles(keypoints)), " 0" * _DESCRIPTOR
    )


def _read_vlfeat(lines: list[str], convention: Convention) -> pd.DataFrame:
    x, y, scale, angle = _rows(lines, 4, more=True).T
    return _oriented(convention, x, y, scale, angle)


def _write_vlfeat(keypoints: pd.DataFrame, convention: Convention) -> str:
    return _text((*_in_xy(keypoints, convention), angles(keypoints)))


def _read_oxford(lines: list[str], convention: Convention) -> pd.DataFrame:
    x, y, a, b, c = _rows(_counted(lines, 2, 1), 5, more=True).T
    area = a * c - b**2
    if not ((area > 0) & (a > 0)).all():
        raise InputError(f"keypoint {int(np.argmin((area > 0) & (a > 0))) + 1} is no ellipse")
    return Convention(convention.origin, "xy", convention.scale).table(x, y, area**-0.25)


def _write_oxford(keypoints: pd.DataFrame, convention: Convention) -> str:
    x, y, radius = _in_xy(keypoints, convention)
    zero, curvature = np.zeros(len(x)), radius**-2.0
    return f"1.0\n{len(x)}\n" + _text((x, y, curvature, zero, curvature))


def _in_xy(
    keypoints: pd.DataFrame, convention: Convention
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    return Convention(convention.origin, "xy", convention.scale).columns(keypoints)


def _oriented(
    convention: Convention,
    x: NDArray[np.float64],
    y: NDArray[np.float64],
    scale: NDArray[np.float64],
    angle: NDArray[np.float64],
) -> pd.DataFrame:
    table = Convention(convention.origin, "xy", convention.scale).table(x, y, scale)
    return table.assign(angle=angle)


_TEXT = {
    "colmap": _Format(COLMAP, _read_colmap, _write_colmap),
    "oxford": _Format(_XY, _read_oxford, _write_oxford),
    "vlfeat": _Format(_XY, _read_vlfeat, _write_vlfeat),
}

KEYPOINT_FORMATS = ("csv", "colmap", "colmap-db", "oxford", "vlfeat")
"""Formats of `read_keypoints` and `write_keypoints`."""


# ---------------------------------------------------------------------------------------------
# Database


def _from_database(path: Path, image: str | None, convention: Convention) -> pd.DataFrame:
    try:
        with closing(sqlite3.connect(f"{path.resolve().as_uri()}?mode=ro", uri=True)) as database:
            identity = _image_of(database, image)
            row = database.execute(
                "SELECT rows, cols, data FROM keypoints WHERE image_id = ?", (identity,)
            ).fetchone()
    except sqlite3.Error as error:
        raise InputError(f"no database of COLMAP: {error}") from None
    n_rows, n_columns, data = row or (0, 4, b"")
    data = data or b""
    if not isinstance(data, bytes) or n_columns not in (2, 4, 6):
        raise InputError(f"keypoints of {n_columns} numbers; COLMAP has 2, 4 or 6")
    if len(data) != 4 * n_rows * n_columns:
        raise InputError(f"{len(data)} bytes for {n_rows} keypoints of {n_columns}; it is damaged")
    if n_columns == 2 and n_rows:
        raise InputError("its keypoints have no scale")
    values = np.frombuffer(data, dtype="<f4").reshape(-1, max(n_columns, 4)).astype(np.float64)
    if n_columns != 6:
        return _oriented(convention, *values.T)
    shape = values[:, 2:].reshape(-1, 2, 2)
    scale = np.sqrt(np.abs(np.linalg.det(shape)))
    angle = np.arctan2(shape[:, 1, 0], shape[:, 0, 0])
    return _oriented(convention, values[:, 0], values[:, 1], scale, angle)


def _image_of(database: sqlite3.Connection, image: str | None) -> int:
    """Number of the image of a name, or of the only one."""
    if image is None:
        found = database.execute("SELECT image_id FROM images LIMIT 2").fetchall()
        if len(found) != 1:
            raise InputError("it holds no image or several; name one")
    else:
        found = database.execute("SELECT image_id FROM images WHERE name = ?", (image,)).fetchall()
        if not found:
            raise InputError(f"it holds no image {image!r}; name one that it has")
    return int(found[0][0])


def _to_database(
    keypoints: pd.DataFrame, path: Path, image: str | None, convention: Convention
) -> None:
    if not path.is_file():
        raise InputError(f"{path}: no such file; COLMAP makes the database, with the images in it")
    values = np.stack([*_in_xy(keypoints, convention), angles(keypoints)], axis=1).astype("<f4")
    if not math.isfinite(float(np.abs(values).sum())):
        raise InputError(f"{path}: a number is too large for float32")
    try:
        with closing(sqlite3.connect(path)) as database, database:  # all or nothing
            identity = _image_of(database, image)
            database.execute(
                "INSERT INTO keypoints (image_id, rows, cols, data) VALUES (?, ?, ?, ?)",
                (identity, *values.shape, values.tobytes()),
            )
    except sqlite3.IntegrityError:
        raise InputError(f"{path}: the image has keypoints already; remove them first") from None
    except sqlite3.Error as error:
        raise InputError(f"{path}: no database of COLMAP: {error}") from None
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
