"""Crop the first view of several sets (figure 12 b)."""

from pathlib import Path

from keystab.utils.stage_command import Store, command


@command
def main(views: list[Store], name: str, values: list[float], size: int, *, table: Path) -> None:
    """Read the first view of every set; write the pixels of a square in its middle."""
    import numpy as np
    import pandas as pd

    from keystab.io.tables import write_table
    from keystab.io.view_store import read_view

    parts = []
    for value, store in zip(values, views, strict=True):
        view = read_view(*store)
        top, left = (max(0, (side - size) // 2) for side in view.shape)
        crop = view.image[top : top + size, left : left + size]
        y, x = np.indices(crop.shape)
        columns = {"y": (y + top).ravel(), "x": (x + left).ravel(), "grey": crop.ravel()}
        parts.append(pd.DataFrame({name: value, **columns}))
    write_table(pd.concat(parts, ignore_index=True), table)
