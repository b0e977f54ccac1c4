"""Detect the discrete extrema of one n_spo at several sampling steps."""

from pathlib import Path

from keystab.parameters import Detection
from keystab.utils.stage_command import Store, command


@command
def main(
    views: Store, n_spo: int, delta_min: list[float], detection: Detection, *, extrema: Path
) -> None:
    """Read the view, search one scale-space per step, write one table."""
    import pandas as pd

    from keystab.detection.detector import extrema_table
    from keystab.detection.extrema import extrema_and_cubes
    from keystab.io.tables import write_table
    from keystab.io.view_store import read_view
    from keystab.stages._scale_spaces import sampled_space

    view = read_view(*views)
    tables = []
    for step in delta_min:
        space = sampled_space(view, n_spo, detection, step)
        found = extrema_and_cubes(space, detection.epsilon, show_progress=True)
        table = extrema_table(space, *found)
        table.insert(0, "n_spo", n_spo)
        table.insert(1, "delta_min", step)
        tables.append(table)
        print(f"{len(table)} extrema at delta_min = {step}")
    write_table(pd.concat(tables, ignore_index=True), extrema)
