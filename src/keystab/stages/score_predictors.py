"""Score predictors and models of them on detections of several scenes (figure predictors)."""

from pathlib import Path

from keystab.parameters import Compared, Folds, Same, Scales, Stable
from keystab.utils.stage_command import Store, command


@command
def main(
    names: list[str],
    views: list[Store],
    keypoints: list[Path],
    truth: list[Path],
    samplings: list[Path],
    n_spo: list[int],
    scales: Scales,
    same: Same,
    compared: Compared,
    end: float,
    stable: Stable,
    folds: Folds,
    n_resamples: int,
    *,
    detections: Path,
    auc: Path,
    gain: Path,
    roc: Path,
) -> None:
    """Read what is known of every scene, `samplings` scene by scene; write the tables."""
    from keystab.experiments.predictor_scores import described, score_predictors
    from keystab.io.study_tables import read_extrema, read_keypoints
    from keystab.io.tables import read_table, write_table
    from keystab.io.view_store import read_view
    from keystab.scalespace.continuous_dog import DogSeries
    from keystab.stages._compared import inside
    from keystab.utils.progress import progress

    ends = (scales.sigma_min * compared.first_scale, scales.sigma_min * end)
    columns = ["keypoint", "y", "x", "sigma", "sign", "stability"]
    scenes = {}
    own = [samplings[k : k + len(n_spo)] for k in range(0, len(samplings), len(n_spo))]
    files = zip(names, views, keypoints, truth, own, strict=True)
    for name, store, unique, true, paths in progress(files, len(names), "scenes"):
        view, extrema = read_view(*store), read_extrema(paths)
        scenes[name] = described(
            extrema,
            inside(compared, scales.sigma_min, view.shape)(extrema, "step_sigma"),
            read_keypoints(unique, columns),
            read_table(true),
            DogSeries.of_image(view.image, view.blur, scales.kappa),
            ends,
            vars(same),
        )
    scored = score_predictors(
        scenes, stable.stable_above, stable.unstable_below, folds.block, folds.n_folds, n_resamples
    )
    write_table(scored.detections, detections)
    write_table(scored.auc, auc)
    write_table(scored.gain, gain)
    write_table(scored.roc, roc)
    print(scored.gain.to_string(index=False))
