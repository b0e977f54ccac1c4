"""Rates of new and lost extrema in every variant of the arithmetic (figure floor)."""

from pathlib import Path

from keystab.parameters import Compared, Same, Scales
from keystab.stages._command import Store, command


@command
def main(
    views: list[Store],
    extrema: list[Path],
    names: list[str],
    differences: list[str],
    tolerances: list[float],
    n_spo: list[int],
    settles_at: int,
    scales: Scales,
    same: Same,
    compared: Compared,
    *,
    rates: Path,
    summary: Path,
    variants: Path,
) -> None:
    """Read the extrema of every variant; write rates against n_spo, a summary, and words."""
    import pandas as pd

    from keystab.experiments.sampling_stability import (
        change_counts,
        floor_summary,
        keypoints_of_samplings,
    )
    from keystab.experiments.view_stability import labelled
    from keystab.io.tables import read_table, write_table
    from keystab.io.view_store import read_view
    from keystab.scalespace.sampling import balanced_delta
    from keystab.stages._compared import inside
    from keystab.stages._tables import write_joined

    steps = {n: balanced_delta(n, scales.kappa, scales.sigma_min) for n in n_spo}
    rate_tables, summaries = [], []
    for name, tolerance, store, path in zip(names, tolerances, views, extrema, strict=True):
        found = read_table(path)
        found = found[found["difference"] > tolerance].reset_index(drop=True)
        shape = read_view(*store).shape
        common = found[inside(compared, scales.sigma_min, shape)(found, "step_sigma")]
        counts = change_counts(found, common, steps, vars(same))
        stability = keypoints_of_samplings(common, n_spo, vars(same)).keypoints["stability"]
        rate_tables.append(labelled(counts, {"variant": name}))
        means = floor_summary(counts, stability, settles_at)
        summaries.append(labelled(means, {"variant": name}))
    write_joined(rate_tables, rates)
    write_table(pd.DataFrame({"variant": names, "differs_in": differences}), variants)
    print(write_joined(summaries, summary).to_string(index=False))
