"""Hold the error bars of keypoints against second shots, and weigh by them."""

from pathlib import Path

from keystab.parameters import Scales, ShotPairs
from keystab.utils.stage_command import Store, command


@command
def main(
    views: Store,
    moved: Store,
    scales: Scales,
    border: float,
    first_scale: float,
    shots: ShotPairs,
    *,
    coverage: Path,
    strata: Path,
    reliability: Path,
    separation: Path,
    weights: Path,
) -> None:
    """Read views without noise; draw shots; write what the error bars hold and are good for."""
    from keystab.experiments.keypoint_weights import moved_shots, weights_table
    from keystab.experiments.shot_pairs import Detector, calibration, shot_pairs
    from keystab.io.tables import write_table
    from keystab.io.view_store import read_views

    detector = Detector(
        shots.n_spo, scales.sigma_min, scales.kappa, shots.n_oct, border, first_scale
    )
    images = [(view.image, view.blur) for view in read_views(*views)]
    numbers = (shots.noise, shots.n_pairs, shots.n_pairs_others)
    judged = calibration(shot_pairs(images, *numbers, detector))
    others = read_views(*moved)
    seen = ([view.image for view in others], others.specs, others.reference_shape)
    asked = moved_shots(*seen, shots.noise, shots.n_moved, detector.search())
    for path, table in zip((coverage, strata, reliability, separation), judged, strict=True):
        write_table(table, path)
    write_table(weights_table(asked, shots.noise), weights)
    print(judged.coverage.query("method == 'bars' and level == 0.9").to_string(index=False))
