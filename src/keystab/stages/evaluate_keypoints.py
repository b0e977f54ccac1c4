"""Say what the stable and unstable keypoints of figure 4 are, and what predicts their truth."""

from pathlib import Path

from keystab.parameters import ComparedWithTruth, Stable, Tolerance
from keystab.utils.stage_command import command


@command
def main(
    truth: Path,
    keypoints: Path,
    features: Path,
    stable: Stable,
    sigma_min: float,
    compared: ComparedWithTruth,
    tolerance: Tolerance,
    n_resamples: int,
    *,
    causes: Path,
    auc: Path,
) -> None:
    """Read truth, unique keypoints and their features; write causes and areas under curves."""
    from keystab.evaluation import recall_precision
    from keystab.evaluation.stability import label
    from keystab.experiments.keypoint_causes import areas_of_labels, cause_table
    from keystab.io.study_tables import read_keypoints
    from keystab.io.tables import read_table, write_table

    unique = read_keypoints(keypoints, ["keypoint", "y", "x", "sigma", "sign", "stability"])
    low, high = (sigma_min * end for end in (compared.first_scale, compared.last_scale))
    cause = recall_precision.causes(unique, read_table(truth), low, high, **vars(tolerance))
    group = label(unique["stability"], stable.stable_above, stable.unstable_below)
    table = cause_table(group, cause)
    write_table(table, causes)
    write_table(areas_of_labels(read_table(features), group, cause, n_resamples), auc)
    print(table.to_string(index=False))
