"""Write simulated views as numbers (figure 2)."""

from pathlib import Path

from keystab.utils.stage_command import Store, command


@command
def main(views: Store, *, table: Path, pixels: Path) -> None:
    """Read a set of views; write a table of views and a table of pixels."""
    import numpy as np
    import pandas as pd

    from keystab.io.tables import write_table
    from keystab.io.view_store import read_views

    found = read_views(*views)
    rows, parts = [], []
    for number, (view, spec) in enumerate(zip(found, found.specs, strict=True)):
        rows.append(
            {
                "view": number,
                "label": f"c = {spec.blur:g}, S = {spec.step:g}",
                "blur": spec.blur,
                "step": spec.step,
                "height": view.shape[0],
                "width": view.shape[1],
                "mean": view.image.mean(),
                "standard_deviation": view.image.std(),
            }
        )
        y, x = np.indices(view.shape)
        columns = {"view": number, "y": y.ravel(), "x": x.ravel(), "value": view.image.ravel()}
        parts.append(pd.DataFrame(columns))
    write_table(pd.DataFrame(rows), table)
    write_table(pd.concat(parts, ignore_index=True), pixels)
