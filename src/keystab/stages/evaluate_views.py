"""Evaluate the keypoints of sets of views against the true extrema of the scene."""

from pathlib import Path

from keystab.parameters import Acceptance, ComparedWithTruth, Tolerance
from keystab.utils.stage_command import Store, command


@command
def main(
    views: Store,
    truth: Path,
    sets: list[Store],
    extrema: list[Path],
    traces: list[Path],
    sweeps: list[str],
    values: list[float],
    n_spo: list[int],
    guards: list[float],
    sigma_min: float,
    compared: ComparedWithTruth,
    tolerance: Tolerance,
    accepted: Acceptance,
    *,
    table: Path,
) -> None:
    """Read the scene's extrema and the detections of sets of views; write one row per set."""
    from functools import cache

    import pandas as pd

    from keystab.detection.refinement import refined_keypoints
    from keystab.evaluation.recall_precision import mean_over_views
    from keystab.experiments.scene_recall import seen_by_all
    from keystab.io.tables import read_table, write_table
    from keystab.io.view_store import read_views
    from keystab.matching.common_range import CommonRange
    from keystab.stages._against_truth import detections

    seen_from = read_views(*views).specs[0]
    scene = read_table(truth)
    limits = [sigma_min * end for end in (compared.first_scale, compared.last_scale)]

    @cache  # a set is there once for every sampling
    def seen(store: Store, guard: float) -> tuple[CommonRange, pd.DataFrame]:
        own = read_views(*store)
        margin = max(guard, compared.border)
        return seen_by_all(scene, seen_from, own.specs, own.reference_shape, margin)

    rows = []
    for sweep, value, n, guard, store, extrema_path, traces_path in zip(
        sweeps, values, n_spo, guards, sets, extrema, traces, strict=True
    ):
        field, true = seen(store, guard)
        discrete = read_table(extrema_path)
        refined = refined_keypoints(discrete, read_table(traces_path), **vars(accepted))
        for name, found, scale in detections(discrete, refined):
            labels = {"sweep": sweep, "value": value, "n_spo": n, "detections": name}
            common, how = field.common(found, scale), vars(tolerance)
            means = mean_over_views(common, true, len(field.specs), limits, scale, how)
            rows.append(labels | means)
    result = pd.DataFrame(rows)
    write_table(result, table)
    print(result[[*labels, "recall", "precision"]].to_string(index=False))
