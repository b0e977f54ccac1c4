"""What every figure's command does: read tables, draw, write a PDF and a PNG.

The bytes written depend on the tables, the code and the versions of the libraries, not on the
time, the folder or the reader's matplotlib settings. Each file says in its metadata
what it was drawn from.
"""

from __future__ import annotations

import argparse
import errno
import sys
import zlib
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from keystab._version import __version__
from keystab.errors import InputError
from keystab.figures import style
from keystab.io.figure_metadata import PNG_KEY, FigureMetadata, digests_of
from keystab.utils.files import written_whole
from keystab.utils.memory import require_start

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from pandas import DataFrame

Tables = Mapping[str, "DataFrame"]
Needs = Mapping[str, Sequence[str]]

_METADATA: dict[str, dict[str, Any]] = {
    "pdf": {"Creator": "keystab", "Producer": None, "CreationDate": None},
    "png": {"Software": None},
}
_METADATA_KEYS = {"pdf": "Keywords", "png": PNG_KEY}


def read_tables(folder: Path | str, needs: Needs) -> dict[str, DataFrame]:
    """Read the tables of a figure and check that they hold what it draws.

    Parameters
    ----------
    folder : path
        Folder of the tables.
    needs : mapping from file name to column names
        For example ``{"fig1.csv": ("sigma", "method")}``.

    Returns
    -------
    dict from file name without its ending to DataFrame

    Raises
    ------
    InputError
        If a table is missing, has no rows or lacks a column.
    """
    from keystab.io.tables import read_table

    tables = {}
    for name, columns in needs.items():
        path = Path(folder) / name
        if not path.is_file():
            raise InputError(
                f"{path}: no such table; run the study, or give its folder as --tables"
            )
        tables[path.stem] = read_table(path, columns)
    check_tables(tables, needs)
    return tables


def check_tables(tables: Tables, needs: Needs) -> None:
    """Raise `InputError` if a table is missing, has no rows or lacks a column."""
    for name, columns in needs.items():
        table = tables.get(Path(name).stem)
        if table is None:
            raise InputError(f"{name}: the figure needs this table and was not given it")
        missing = [column for column in columns if column not in table.columns]
        if missing:
            raise InputError(f"{name}: lacks the column(s) {', '.join(missing)}; remake the table")
        if len(table) == 0:
            raise InputError(
                f"{name}: has no rows, so there is nothing to draw; remake the table, from another "
                "picture or a wider range of comparison where it was empty of keypoints"
            )


def save(
    figure: Figure, path: Path | str, draft: bool = False, metadata: FigureMetadata | None = None
) -> None:
    """Write a figure as PDF or PNG by the ending of `path`; complete or not at all.

    Drafts have their letters as shapes, which is quicker to write than the fonts that journals ask
    for. What it was drawn from goes into the file's metadata.

    Raises
    ------
    InputError
        If the ending is neither ``.pdf`` nor ``.png``, or the folder cannot be written.
    """
    path = Path(path)
    kind = path.suffix.lstrip(".").lower()
    if kind not in _METADATA:
        raise InputError(f"{path}: a figure is written as .pdf or .png; change the ending")
    fields = _METADATA[kind] | ({_METADATA_KEYS[kind]: metadata.to_text()} if metadata else {})
    try:
        with style.context(draft), written_whole(path) as part:
            figure.savefig(part, format=kind, metadata=fields)
    except (OSError, zlib.error) as error:
        # Closing a PDF that could not be written to, its stream fails as well.
        first = error if isinstance(error, OSError) else error.__context__
        if not isinstance(first, OSError):
            raise
        reason = first.strerror or first
        advice = "choose another folder"
        if first.errno == errno.EFBIG:
            advice = "raise the limit of the size of files (ulimit -f)"
        raise InputError(f"{path}: cannot be written ({reason}); {advice}") from None


def main(
    draw: Callable[[Tables, bool], Figure], needs: Needs, argv: Sequence[str] | None = None
) -> int:
    """Run the command of one figure.

    Parameters
    ----------
    draw : callable
        The figure's ``draw``.
    needs : mapping
        The figure's ``TABLES``.
    argv : sequence of str, optional
        Arguments; the process's own by default.

    Returns
    -------
    int
        Exit status: 0, or 2 after a one-line message about the input.
    """
    parser = argparse.ArgumentParser(description=f"Draw a figure from {', '.join(needs)}.")
    parser.add_argument("--tables", type=Path, required=True, help="folder that holds the tables")
    parser.add_argument("--pdf", type=Path, help="PDF to write")
    parser.add_argument("--png", type=Path, help="PNG to write, at 300 dots per inch")
    parser.add_argument("--draft", action="store_true", help="mark the figure as a draft")
    parser.add_argument(
        "--code", metavar="SHA256", help="fingerprint of the code, for the metadata"
    )
    parser.add_argument(
        "--lock", metavar="SHA256", help="digest of the lock file, for the metadata"
    )
    args = parser.parse_args(argv)
    try:
        require_start()
        if args.pdf is None and args.png is None:
            raise InputError("nothing to write: give --pdf, --png or both")
        tables = read_tables(args.tables, needs)
        digests = digests_of(args.tables / name for name in needs)
        figure = draw(tables, args.draft)
        for path in filter(None, (args.pdf, args.png)):
            own = {"draft": str(args.draft)}
            metadata = FigureMetadata(path.stem, __version__, args.code, args.lock, own, digests)
            save(figure, path, args.draft, metadata)
            print(f"wrote {path}")
    except InputError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    except MemoryError:
        print("error: the memory does not suffice to draw this figure", file=sys.stderr)
        return 2
    return 0
