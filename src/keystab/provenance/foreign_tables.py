"""Tables that a stranger may have written, read in bounded time and memory."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from keystab.errors import InputError
from keystab.io.tables import read_table

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["read_foreign_table"]

_MOST_BYTES_OF_LINE = 4000
_MOST_BYTES_OF_PARQUET = 500_000_000


def read_foreign_table(path: Path) -> pd.DataFrame:
    """Read a table as `keystab.tables.read_table` does, if it is one that a run could have written.

    Parameters
    ----------
    path : path
        A .csv or .parquet file. How large a .csv file may be, the caller decides.

    Raises
    ------
    InputError
        Also if a line is longer than 4000 bytes, since very many columns take pandas minutes; if it
        has more fields than there are names, which pandas takes for an index and other programs do
        not; or if a .parquet file says that it unpacks to more than 500 MB.
    """
    import pandas as pd

    if path.suffix == ".parquet":
        _check_parquet(path)
    elif path.is_file():
        with path.open("rb") as lines:
            while line := lines.readline(_MOST_BYTES_OF_LINE + 1):
                if len(line) > _MOST_BYTES_OF_LINE:
                    raise InputError(f"{path}: has too long lines for a table")
    table = read_table(path)
    if not isinstance(table.index, pd.RangeIndex):
        raise InputError(f"{path}: has more fields than names")
    return table


def _check_parquet(path: Path) -> None:
    from pyarrow import ArrowException, parquet

    try:
        about = parquet.read_metadata(path)
        sizes = [about.row_group(n).total_byte_size for n in range(about.num_row_groups)]
    except (ArrowException, OSError, ValueError):
        raise InputError(f"{path}: no readable table") from None
    if sum(sizes) > _MOST_BYTES_OF_PARQUET:
        raise InputError(f"{path}: too large a table")
