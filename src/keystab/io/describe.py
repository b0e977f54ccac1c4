"""What a store or a table holds, in words."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from keystab.errors import InputError
from keystab.io.checksums import verify
from keystab.io.pictures import read_picture
from keystab.io.scale_space_store import open_scale_space
from keystab.io.tables import FORMATS, read_table
from keystab.io.view_store import open_views
from keystab.io.zarr_groups import attributes_of
from keystab.utils.memory import in_words

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

__all__ = ["describe", "table_in_words"]


def describe(path: str | os.PathLike[str]) -> str:
    """Say what a picture, a stored scale-space, a set of views or a table of keypoints holds.

    Where a store has checksums beside it (`keystab.io.checksums`), all its files are checked.

    Parameters
    ----------
    path : path
        A picture, the folder of a store, or a .csv or .parquet file.

    Returns
    -------
    str
        Some lines of text, without a line end.

    Raises
    ------
    InputError
        If there is nothing that can be described, or a store is damaged.
    """
    path = Path(path)
    if not path.exists():
        raise InputError(f"{path}: no such file or folder; give a picture, a store or a table")
    if path.is_file():
        if path.suffix.lower() in FORMATS:
            return table_in_words(read_table(path), str(path))
        return _picture(path)
    checked = _checked(path)
    attributes = attributes_of(path)
    if attributes.get("kind") == "scale-space":
        lines = _scale_space(open_scale_space(path), path)
    elif attributes.get("kind") == "views":
        lines = _views(open_views(path), path)
    else:
        raise InputError(f"{path}: a Zarr group, but none that keystab wrote")
    return "\n".join([*lines, *_other(attributes), checked])


def _scale_space(space: xr.Dataset, path: Path) -> list[str]:
    n_slices, height, width = space["dog"].shape
    sigma, y = space["sigma"].to_numpy(), space["y"].to_numpy()
    step = f", one every {y[1] - y[0]:.6g} pixels" if height > 1 else ""
    return [
        f"{path}: difference-of-Gaussians scale-space",
        f"  {n_slices} slices, sigma {sigma[0]:.6g} to {sigma[-1]:.6g} pixels",
        f"  {height} x {width} samples a slice{step}",
        f"  {n_slices * height * width / 1e6:.4g} million values of {space['dog'].dtype}, "
        f"{in_words(space['dog'].nbytes)}",
    ]


def _views(views: xr.Dataset, path: Path) -> list[str]:
    n = views.sizes["view"]
    lines = [f"{path}: {_counted(n, 'simulated view')} of {views['image'].dtype}"]
    for name, words in (
        ("height", "height {} pixels"),
        ("width", "width {} pixels"),
        ("blur", "camera blur {} pixels"),
        ("step", "step {} reference pixels"),
        ("shift_y", "shift down {} pixels"),
        ("shift_x", "shift right {} pixels"),
        ("rotation", "rotation {} radians"),
        ("noise", "noise {}"),
    ):
        low, high = float(views[name].min()), float(views[name].max())
        lines.append(
            "  " + words.format(f"{low:.6g}" if low == high else f"{low:.6g} to {high:.6g}")
        )
    return lines


def _picture(path: Path) -> str:
    picture = read_picture(path)
    height, width = picture.shape
    return "\n".join(
        [
            f"{path}: picture, {height} pixels high, {width} wide: "
            f"{height * width / 1e6:.3g} megapixels",
            f"  grey values {picture.min():.6g} to {picture.max():.6g}, mean {picture.mean():.6g}",
            f"  {_counted(int((picture >= 1).sum()), 'pixel')} at 1 or above, "
            f"{int((picture <= 0).sum())} at 0 or below",
        ]
    )


def table_in_words(table: pd.DataFrame, name: str) -> str:
    """Say what a table holds: its rows, and the range of each of its columns.

    Examples
    --------
    >>> import pandas as pd
    >>> print(table_in_words(pd.DataFrame({"n_spo": [3, 15]}), "samplings"))
    samplings: table of 2 rows
      n_spo: 3 to 15
    """
    return "\n".join(_table(table, name))


def _table(table: pd.DataFrame, path: str) -> list[str]:
    n = len(table)
    numeric = {name for name, column in table.items() if column.dtype.kind in "biuf" or not n}
    keypoints = {"y", "x", "sigma"} <= numeric
    lines = [f"{path}: table of {_counted(n, 'keypoint' if keypoints else 'row')}"]
    if keypoints and "sign" in numeric:
        maxima, minima = int((table["sign"] > 0).sum()), int((table["sign"] < 0).sum())
        lines.append(
            f"  {_counted(maxima, 'maximum', 'maxima')}, {_counted(minima, 'minimum', 'minima')}"
        )
    for name, column in table.items():
        if column.dtype.kind in "iuf" and column.notna().any():
            span = f"{column.min():.6g} to {column.max():.6g}"
        else:
            span = _counted(column.nunique(), "value")
        missing = int(column.isna().sum())
        lines.append(f"  {name}: {span}" + (f", {missing} missing" if missing else ""))
    return lines


def _counted(n: int, one: str, more: str | None = None) -> str:
    return f"{n} {one if n == 1 else more or one + 's'}"


def _other(attributes: Mapping[str, Any]) -> list[str]:
    known = {key: value for key, value in attributes.items() if key != "kind" and value is not None}
    return [f"  {key}: {value}" for key, value in known.items()]


def _checked(path: Path) -> str:
    folder = path.absolute()  # "." has no name
    checksums = folder.with_name(f"{folder.name}.sha256")
    if not checksums.is_file():
        return "  no checksums beside it; every chunk is there"
    verify(path, checksums)
    return "  all files agree with the checksums beside it"
