"""Match the detections of several sets of views that differ in one value (figures 10 to 12)."""

from collections.abc import Sequence
from pathlib import Path

from keystab.parameters import Acceptance, ComparedInViews, Octaves, Same
from keystab.utils.stage_command import Store, command


@command
def main(
    views: list[Store],
    extrema: list[Path],
    traces: list[Path],
    name: str,
    values: list[float],
    compared: ComparedInViews,
    same: Same,
    accepted: Acceptance,
    n_resamples: int,
    octaves: Octaves | None = None,
    n_spo: Sequence[int] = (),
    unit: float = 0.0,
    soft_ends: bool = False,
    *,
    curves: Path,
    counts: Path,
    scales: Path | None = None,
    pairs: Path | None = None,
    interpolation: Path | None = None,
) -> None:
    """Read extrema and traces of several sets at one sampling; write tables of all."""
    from keystab.detection.refinement import refined_keypoints
    from keystab.errors import InputError
    from keystab.experiments.first_view import against_first
    from keystab.experiments.interpolation_stability import interpolation_table
    from keystab.experiments.view_stability import (
        count_table,
        curve_table,
        keypoints_of_views,
        scale_table,
    )
    from keystab.io.study_tables import write_joined
    from keystab.io.tables import read_table
    from keystab.io.view_store import read_views
    from keystab.stages._compared import common_range

    if (octaves is None) != (scales is None):
        raise InputError("--starts, --seen-by and --scales go together: give all or none")
    curve_tables, count_tables, scale_tables, pair_tables, row_tables = [], [], [], [], []
    numbers = [{"n_spo": n} for n in n_spo] or [{}] * len(values)
    paths = zip(extrema, traces, strict=True)
    for value, number, store, files in zip(values, numbers, views, paths, strict=True):
        seen = read_views(*store)
        everywhere, labels = common_range(seen, compared, soft_ends), {name: value, **number}
        discrete, models = (read_table(path) for path in files)
        keypoints = refined_keypoints(discrete, models, **vars(accepted))
        matched = keypoints_of_views(everywhere.common(keypoints), len(seen), vars(same))
        curve_tables.append(curve_table(matched, labels, n_resamples))
        count_tables.append(count_table(matched, labels))
        if octaves:
            how = (octaves.starts, vars(same), octaves.seen_by, labels, n_resamples, unit)
            scale_tables.append(scale_table(keypoints, everywhere, *how))
        if pairs:
            pair_tables.append(against_first(keypoints, everywhere, vars(same), labels))
        if interpolation:
            asked = (vars(accepted), vars(same), labels)
            row_tables.append(interpolation_table(discrete, models, everywhere, *asked))
    write_joined(curve_tables, curves)
    for joined, path in ((scale_tables, scales), (pair_tables, pairs), (row_tables, interpolation)):
        if path:
            write_joined(joined, path)
    print(write_joined(count_tables, counts).to_string(index=False))
