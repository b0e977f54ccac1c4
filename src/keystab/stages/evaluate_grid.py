"""Evaluate the discrete extrema of a grid of samplings against the true extrema of the view."""

from pathlib import Path

from keystab.parameters import ComparedWithTruth, Tolerance
from keystab.utils.stage_command import Store, command


@command
def main(
    views: Store,
    truth: Path,
    extrema: list[Path],
    sigma_min: float,
    compared: ComparedWithTruth,
    tolerance: Tolerance,
    *,
    table: Path,
) -> None:
    """Read truth and extrema; write one row per node of the grid."""
    import pandas as pd

    from keystab.io.tables import read_table, write_table
    from keystab.io.view_store import read_view
    from keystab.stages._against_truth import evaluation
    from keystab.stages._compared import inside

    shape = read_view(*views).shape
    evaluated = evaluation(read_table(truth), inside(compared, sigma_min, shape), tolerance)
    rows = [
        {"n_spo": n_spo, "delta_min": delta_min}
        | evaluated(found.reset_index(drop=True), "step_sigma")
        for path in extrema
        for (n_spo, delta_min), found in read_table(path).groupby(["n_spo", "delta_min"])
    ]
    write_table(pd.DataFrame(rows), table)
