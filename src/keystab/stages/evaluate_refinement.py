"""Evaluate what ways to refine keep and lose against the true extrema of the view."""

from pathlib import Path

from keystab.parameters import ComparedWithTruth, DifferenceOfGaussians, Tolerance
from keystab.utils.stage_command import Store, command


@command
def main(
    views: Store,
    truth: Path,
    samplings: list[Path],
    n_spo: list[int],
    dog: DifferenceOfGaussians,
    compared: ComparedWithTruth,
    tolerance: Tolerance,
    max_offsets: list[float],
    most_iterations: int,
    *,
    table: Path,
) -> None:
    """Read truth and extrema; follow every path; write one row per way, limits and sampling."""
    import pandas as pd

    from keystab.experiments.refinement_choices import choice_table
    from keystab.io.tables import read_table, write_table
    from keystab.io.view_store import read_view
    from keystab.stages._compared import inside
    from keystab.stages._scale_spaces import sampled_space

    view, true = read_view(*views), read_table(truth)
    parts = [
        choice_table(
            sampled_space(view, n, dog),
            read_table(path),
            true,
            inside(compared, dog.sigma_min, view.shape),
            max_offsets,
            most_iterations,
            vars(tolerance),
        )
        for n, path in zip(n_spo, samplings, strict=True)
    ]
    write_table(pd.concat(parts, ignore_index=True), table)
