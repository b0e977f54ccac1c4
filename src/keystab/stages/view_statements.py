"""Aliasing, wrong blurs, zooms and noise of the reference (sections 3.2, 3.3, 4 and 6.1)."""

from pathlib import Path

from keystab.parameters import Compared, Detection, Refining, Same, Stated
from keystab.stages._command import Store, command


@command
def main(
    reference: Path,
    views: Store,
    n_spo: int,
    detection: Detection,
    refining: Refining,
    compared: Compared,
    same: Same,
    stated: Stated,
    *,
    aliasing: Path,
    wrong_blur: Path,
    zoomed: Path,
    noisy: Path,
) -> None:
    """Read the picture and how the view was taken; write one table for each question."""
    from keystab.camera.simulation import Scene, simulate
    from keystab.experiments.camera_statements import aliasing_table, wrong_blur_table
    from keystab.experiments.reference_noise import reference_noise_table
    from keystab.experiments.zoom_invariance import zoom_table, zoomed_views
    from keystab.io.pictures import read_picture
    from keystab.io.tables import write_table
    from keystab.io.view_store import read_views
    from keystab.stages._tables import write_joined
    from keystab.truth.true_extrema import true_extrema

    picture, spec = read_picture(reference), read_views(*views).specs[0]
    scene, sigma_min, kappa = Scene(picture), detection.sigma_min, detection.kappa
    folded = aliasing_table(scene, stated.camera_blurs, spec.step, sigma_min, kappa)
    write_table(folded, aliasing)
    octave = [sigma_min, 2 * sigma_min]
    write_table(wrong_blur_table(scene, spec, stated.assumed_blurs, octave), wrong_blur)
    tables = []
    for kappa in stated.kappas:
        everywhere, ends = zoomed_views(spec, stated.zooms, scene.shape, sigma_min, kappa)
        seen = [(simulate(scene, view), view.blur) for view in everywhere.specs]
        true = [true_extrema(*v, *e, kappa) for v, e in zip(seen, ends, strict=True)]
        tables.append(zoom_table(true, everywhere, {"kappa": kappa}))
    write_joined(tables, zoomed)
    detector = {"n_spo": n_spo, **vars(detection), **vars(refining)}
    factors = stated.noise_factors
    found = reference_noise_table(picture, spec, factors, detector, vars(compared), vars(same))
    write_table(found, noisy)
