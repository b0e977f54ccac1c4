"""Aliasing, wrong blurs, zooms and noise of the reference (sections 3.2, 3.3, 4 and 6.1)."""

from pathlib import Path

from keystab.parameters import Compared, Detection, Refining, Same, Stated
from keystab.utils.stage_command import Store, command


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
    from keystab.camera.simulation import Scene
    from keystab.experiments.camera_statements import aliasing_table, wrong_blur_table
    from keystab.experiments.reference_noise import reference_noise_table
    from keystab.experiments.zoom_invariance import zoomed_truth
    from keystab.io.pictures import read_picture
    from keystab.io.tables import write_table
    from keystab.io.view_store import read_views
    from keystab.truth.true_extrema import true_extrema

    it, first = stated, detection.sigma_min
    picture, spec = read_picture(reference), read_views(*views).specs[0]
    scene, detector = Scene(picture), {"n_spo": n_spo, **vars(detection), **vars(refining)}
    write_table(aliasing_table(scene, it.camera_blurs, spec.step, first, detection.kappa), aliasing)
    write_table(wrong_blur_table(scene, spec, it.assumed_blurs, [first, 2 * first]), wrong_blur)
    write_table(zoomed_truth(scene, spec, it.zooms, it.kappas, first, true_extrema), zoomed)
    noise = (it.noise_factors, detector, vars(compared), vars(same))
    write_table(reference_noise_table(picture, spec, *noise), noisy)
