"""Match the keypoints of scale-spaces with different DoG ratios (figure 9)."""

from pathlib import Path

from keystab.parameters import Acceptance, Same
from keystab.utils.stage_command import Store, command


@command
def main(
    views: Store,
    extrema: Path,
    traces: Path,
    n_spo: int,
    kappas: list[float],
    sigma_min: float,
    border: float,
    same: Same,
    accepted: Acceptance,
    soft_ends: bool = False,
    *,
    counts: Path,
    keypoints: Path,
    occurrence: Path,
) -> None:
    """Read extrema and traces of all ratios; write the tables of figure 9."""
    from keystab.detection.refinement import refined_keypoints
    from keystab.experiments.kappa_stability import kappa_tables
    from keystab.io.tables import read_table, write_table
    from keystab.io.view_store import read_view

    view = read_view(*views)
    refined = refined_keypoints(read_table(extrema), read_table(traces), **vars(accepted))
    how = (vars(same), soft_ends)
    tables = kappa_tables(refined, kappas, n_spo, sigma_min, view.shape, border, *how)
    write_table(tables.counts, counts)
    write_table(tables.keypoints, keypoints)
    write_table(tables.occurrence, occurrence)
    print(tables.counts.to_string(index=False))
