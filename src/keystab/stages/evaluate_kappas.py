"""Evaluate the keypoints of several ratios of the two blurs against the true extrema of each."""

from pathlib import Path

from keystab.parameters import Acceptance, ComparedWithTruth, Tolerance
from keystab.utils.stage_command import Store, command


@command
def main(
    views: Store,
    truths: list[Path],
    kappas: list[float],
    extrema: Path,
    traces: Path,
    sigma_min: float,
    compared: ComparedWithTruth,
    tolerance: Tolerance,
    accepted: Acceptance,
    *,
    table: Path,
) -> None:
    """Read truths, extrema and traces; write two rows per ratio, discrete and refined."""
    import numpy as np
    import pandas as pd

    from keystab.detection.refinement import refined_keypoints
    from keystab.io.tables import read_table, write_table
    from keystab.io.view_store import read_view
    from keystab.stages._against_truth import detections, evaluation
    from keystab.stages._compared import inside

    here = inside(compared, sigma_min, read_view(*views).shape)
    discrete = read_table(extrema)
    refined = refined_keypoints(discrete, read_table(traces), **vars(accepted))
    rows = []
    for kappa, path in zip(kappas, truths, strict=True):
        evaluated = evaluation(read_table(path), here, tolerance)
        for name, found, scale in detections(discrete, refined):
            own = found[np.isclose(found["kappa"], kappa)].reset_index(drop=True)
            rows.append({"kappa": kappa, "detections": name} | evaluated(own, scale))
    result = pd.DataFrame(rows)
    write_table(result, table)
    print(result[["kappa", "detections", "n_true", "recall", "precision"]].to_string(index=False))
