"""Write simulated views as numbers (figure 2)."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from keystab.stages import _run


@_run.stage
def main(argv: Sequence[str] | None = None) -> None:
    """Read a set of views; write a table of views and a table of pixels."""
    parser = _run.parser(__doc__)
    _run.views_arguments(parser)
    _run.required(parser, "table", "table of views to write", type=Path)
    _run.required(parser, "pixels", "table of pixels to write", type=Path)
    args = parser.parse_args(argv)

    import numpy as np
    import pandas as pd

    from keystab.io.checksums import verify
    from keystab.io.tables import write_table
    from keystab.io.view_store import open_views, view

    verify(args.views, args.views_digest)
    views = open_views(args.views)
    rows, pixels = [], []
    for number in range(views.sizes["view"]):
        image = view(views, number)
        blur, step = float(views["blur"][number]), float(views["step"][number])
        rows.append(
            {
                "view": number,
                "label": f"c = {blur:g}, S = {step:g}",
                "blur": blur,
                "step": step,
                "height": image.shape[0],
                "width": image.shape[1],
                "mean": image.mean(),
                "standard_deviation": image.std(),
            }
        )
        y, x = np.indices(image.shape)
        columns = {"view": number, "y": y.ravel(), "x": x.ravel(), "value": image.ravel()}
        pixels.append(pd.DataFrame(columns))
    write_table(pd.DataFrame(rows), args.table)
    write_table(pd.concat(pixels, ignore_index=True), args.pixels)


if __name__ == "__main__":
    raise SystemExit(main())
