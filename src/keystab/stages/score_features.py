"""Score features of extrema by how well they tell stable from unstable keypoints (figure 5)."""

from pathlib import Path

from keystab.parameters import Stable
from keystab.utils.stage_command import command


@command
def main(
    keypoints: Path,
    matches: Path,
    samplings: list[Path],
    stable: Stable,
    n_resamples: int,
    *,
    features: Path,
    thresholds: Path,
    roc: Path,
    auc: Path,
) -> None:
    """Read keypoints, matches and extrema; write the tables of figure 5."""
    from keystab.experiments.feature_scores import score_features
    from keystab.experiments.sampling_stability import positions_of_matches
    from keystab.io.study_tables import read_extrema, read_keypoints
    from keystab.io.tables import read_table, write_table

    unique = read_keypoints(keypoints, ["keypoint", "stability"])
    extrema = read_extrema(samplings)
    found = positions_of_matches(read_table(matches), extrema)
    scores = score_features(unique, extrema, found, **vars(stable), n_resamples=n_resamples)
    write_table(scores.features, features)
    write_table(scores.thresholds, thresholds)
    write_table(scores.roc, roc)
    write_table(scores.auc, auc)
    print(scores.auc.to_string(index=False))
