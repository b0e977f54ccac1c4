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
    from keystab.experiments.shot_pairs import Detector, calibration, shot_pairs
    from keystab.io.tables import write_table
    from keystab.io.view_store import read_views

    search = (shots.n_spo, scales.sigma_min, scales.kappa, shots.n_oct)
    images = [(view.image, view.blur) for view in read_views(*views)]
    numbers = (shots.noise, shots.n_pairs, shots.n_pairs_others)
    judged = calibration(shot_pairs(images, *numbers, Detector(*search, border, first_scale)))
    for path, table in zip((coverage, strata, reliability, separation), judged, strict=True):
        write_table(table, path)
    print(judged.coverage.query("method == 'bars' and level == 0.9").to_string(index=False))


if __name__ == "__main__":
    raise SystemExit(main())
