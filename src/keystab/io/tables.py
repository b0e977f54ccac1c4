"""Tables on disk: CSV for people and figures, Parquet for keypoints."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from keystab.errors import InputError
from keystab.utils.files import check_writable, written_whole

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["FORMATS", "read_table", "to_csv", "write_table"]

#: Suffixes of the files that tables are written to and read from.
FORMATS = (".csv", ".parquet")


def write_table(table: pd.DataFrame, path: str | os.PathLike[str]) -> None:
    r"""Write a table, whole or not at all; the suffix chooses the format.

    The same table gives the same bytes. The index and `table.attrs` are not written.

    Parameters
    ----------
    table : pandas.DataFrame
        Columns of numbers, booleans or text, with text for names.
    path : path
        ``.csv``: comma-separated, one header line, LF line ends, UTF-8; floats with as many
        digits as it takes to read back the same number, missing values empty.
        ``.parquet``: Apache Parquet with zstd compression; exact types.

    Raises
    ------
    InputError
        If the suffix is neither, or no file can be written there; see
        `keystab.utils.files.check_writable`.

    Examples
    --------
    >>> import pandas as pd, tempfile
    >>> path = Path(tempfile.mkdtemp()) / "sizes.csv"
    >>> write_table(pd.DataFrame({"n_spo": [3], "delta_min": [0.1 + 0.2]}), path)
    >>> path.read_text()
    'n_spo,delta_min\n3,0.30000000000000004\n'
    """
    path = Path(path)
    check_writable(path, FORMATS)
    with written_whole(path) as part:
        if path.suffix.lower() == ".csv":
            part.write_text(to_csv(table), encoding="utf-8", newline="")
        else:
            import pyarrow as pa
            from pyarrow import parquet

            arrow = pa.Table.from_pandas(table, preserve_index=False)
            # Without the schema's metadata, which name the versions of pandas and pyarrow.
            parquet.write_table(arrow, part, compression="zstd", store_schema=False)


def to_csv(table: pd.DataFrame) -> str:
    r"""Write a table as the text of a CSV file; see `write_table`.

    Examples
    --------
    >>> import pandas as pd
    >>> to_csv(pd.DataFrame({"y": [0.5, None], "sign": [1, -1]}))
    'y,sign\n0.5,1\n,-1\n'
    """
    return table.to_csv(index=False, lineterminator="\n")


def read_table(path: str | os.PathLike[str], columns: Sequence[str] | None = None) -> pd.DataFrame:
    """Read a table that `write_table` wrote.

    Parameters
    ----------
    path : path
        A .csv or .parquet file.
    columns : sequence of str, optional
        Columns to read, in this order; all by default.

    Returns
    -------
    pandas.DataFrame
        With a plain range index. From CSV, empty fields are missing values, and only they: text
        such as "NA" stays text.

    Raises
    ------
    InputError
        If the file is missing, is no such table, or lacks one of `columns`.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix not in FORMATS:
        raise InputError(f"{path}: a table ends in .csv or .parquet, not in '{path.suffix}'")
    if not path.is_file():
        raise InputError(f"{path}: no such table; give the path of a .csv or .parquet file")
    try:
        table = _read_csv(path) if suffix == ".csv" else _read_parquet(path)
    except Exception as error:  # parsers raise whatever they like
        reason = " ".join(str(error).split()) or type(error).__name__
        raise InputError(f"{path}: not a readable {suffix} table: {reason[:120]}") from None
    if columns is None:
        return table
    missing = [name for name in columns if name not in table]
    if missing:
        raise InputError(
            f"{path}: lacks the column{'s' * (len(missing) > 1)} {', '.join(missing)}; "
            f"it has {', '.join(map(str, table.columns))}"
        )
    return table[list(columns)]


def _read_csv(path: Path) -> pd.DataFrame:
    import pandas as pd

    # From pandas 3.1 every float is read back exactly; before, only on request.
    older = tuple(int(part) for part in pd.__version__.split(".")[:2]) < (3, 1)
    exact: dict[str, Any] = {"float_precision": "round_trip"} if older else {}
    table: pd.DataFrame = pd.read_csv(
        path, keep_default_na=False, na_values=[""], low_memory=False, encoding="utf-8", **exact
    )
    return table


def _read_parquet(path: Path) -> pd.DataFrame:
    from pyarrow import parquet

    table: pd.DataFrame = parquet.read_table(path).to_pandas()
    return table
