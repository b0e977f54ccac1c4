"""Evaluate the detections of balanced samplings against the true extrema of the view."""

from pathlib import Path

from keystab.parameters import Acceptance, ComparedWithTruth, DifferenceOfGaussians, Tolerance
from keystab.utils.stage_command import Store, command


@command
def main(
    views: Store,
    truth: Path,
    samplings: list[Path],
    traces: list[Path],
    n_spo: list[int],
    dog: DifferenceOfGaussians,
    compared: ComparedWithTruth,
    tolerance: Tolerance,
    accepted: Acceptance,
    *,
    table: Path,
) -> None:
    """Read truth, extrema and traces; write two rows per sampling, discrete and refined."""
    import pandas as pd

    from keystab.detection.refinement import refined_table
    from keystab.io.tables import read_table, write_table
    from keystab.io.view_store import read_view
    from keystab.scalespace.sampling import Sampling
    from keystab.stages._against_truth import detections, evaluation
    from keystab.stages._compared import inside

    view = read_view(*views)
    evaluated = evaluation(
        read_table(truth), inside(compared, dog.sigma_min, view.shape), tolerance
    )
    rows = []
    for n, extrema_path, traces_path in zip(n_spo, samplings, traces, strict=True):
        extrema = read_table(extrema_path)
        sampling = Sampling.balanced(view.shape, view.blur, n, dog.sigma_min, dog.kappa)
        refined = refined_table(sampling, extrema, read_table(traces_path), **vars(accepted))
        labels = {"oversampling": dog.oversampling, "n_spo": n, "delta_min": sampling.delta_min}
        for name, found, scale in detections(extrema, refined):
            rows.append(labels | {"detections": name} | evaluated(found, scale))
    result = pd.DataFrame(rows)
    write_table(result, table)
    print(result[["n_spo", "detections", "recall", "precision"]].to_string(index=False))
