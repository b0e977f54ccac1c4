"""Hold the error bars of keypoints against second shots of the same views (figure uncertainty)."""

from pathlib import Path

from keystab.parameters import Scales, ShotPairs
from keystab.stages._command import Store, command


@command
def main(
    views: Store,
    scales: Scales,
    border: float,
    first_scale: float,
    shots: ShotPairs,
    *,
    coverage: Path,
    strata: Path,
    reliability: Path,
    separation: Path,
) -> None:
    """Read views without noise; draw pairs of shots; write what the error bars hold."""
    from keystab.experiments.shot_pairs import Detector, shot_pairs
    from keystab.experiments.uncertainty_calibration import (
        coverage_table,
        reliability_table,
        separation_table,
        strata_table,
    )
    from keystab.io.tables import write_table
    from keystab.io.view_store import read_views

    detector = Detector(
        shots.n_spo,
        scales.sigma_min,
        scales.kappa,
        shots.n_oct,
        border,
        first_scale,
    )
    images = [(view.image, view.blur) for view in read_views(*views)]
    table = shot_pairs(images, shots.noise, shots.n_pairs, shots.n_pairs_others, detector)
    by = ["predicted", "against", "kind", "blur", "noise"]
    usual = table[
        (table["predicted"] == "shot")
        & (table["against"] == "shot")
        & (table["kind"] == "additive")
        & (table["blur"] == images[0][1])
    ]
    second = table[table["against"] == "shot"]
    held = coverage_table(table, by)
    write_table(held, coverage)
    write_table(strata_table(usual), strata)
    write_table(reliability_table(second, by), reliability)
    write_table(separation_table(second, by), separation)
    print(held[(held["method"] == "bars") & (held["level"] == 0.9)].to_string(index=False))
