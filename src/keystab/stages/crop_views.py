"""Crop the first view of several sets (figure 12 b)."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from keystab.stages import _run


@_run.stage
def main(argv: Sequence[str] | None = None) -> None:
    """Read the first view of every set; write the pixels of a square in its middle."""
    parser = _run.parser(__doc__)
    _run.required(parser, "views", "stores of the sets", type=Path, nargs="+")
    _run.required(parser, "views-digest", "their seals", type=Path, nargs="+")
    _run.required(parser, "name", "name of the value in which the sets differ")
    _run.required(parser, "values", "the value of each set", type=float, nargs="+")
    _run.required(parser, "size", "pixels a side", type=int)
    _run.required(parser, "table", "table of pixels to write", type=Path)
    args = parser.parse_args(argv)

    import numpy as np
    import pandas as pd

    from keystab.io.tables import write_table
    from keystab.io.view_store import read_view

    parts = []
    for value, store, digest in zip(args.values, args.views, args.views_digest, strict=True):
        view = read_view(store, digest)
        top, left = (max(0, (size - args.size) // 2) for size in view.shape)
        crop = view.image[top : top + args.size, left : left + args.size]
        y, x = np.indices(crop.shape)
        columns = {"y": (y + top).ravel(), "x": (x + left).ravel(), "grey": crop.ravel()}
        parts.append(pd.DataFrame({args.name: value, **columns}))
    write_table(pd.concat(parts, ignore_index=True), args.table)


if __name__ == "__main__":
    raise SystemExit(main())
