"""Match the detections of all views of a set, sampling by sampling (figures 7, 8, S1 and S5)."""

from collections.abc import Sequence
from pathlib import Path

from keystab.parameters import Acceptance, ComparedInViews, Same
from keystab.utils.stage_command import Store, command


@command
def main(
    views: Store,
    extrema: list[Path],
    traces: list[Path],
    n_spo: list[int],
    curve_n_spo: list[int],
    compared: ComparedInViews,
    same: Same,
    accepted: Acceptance,
    minimum_share: float,
    n_resamples: int,
    max_offsets: Sequence[float] = (),
    iterations: Sequence[int] = (),
    tilts: Sequence[float] = (),
    soft_ends: bool = False,
    *,
    curves: Path,
    precision: Path,
    counts: Path,
    differences: Path,
) -> None:
    """Read extrema and traces of a set at several samplings; write curves, precision, counts."""
    from keystab.evaluation.intervals import BOTH
    from keystab.experiments import view_differences as differing
    from keystab.experiments.refinement_limits import choices
    from keystab.experiments.view_stability import (
        count_table,
        curve_table,
        keypoints_of_views,
        localization_table,
        of_views,
        parts_by,
    )
    from keystab.io.study_tables import write_joined
    from keystab.io.tables import read_table
    from keystab.io.view_store import read_views
    from keystab.stages._compared import common_range

    seen = read_views(*views)
    everywhere = common_range(seen, compared, soft_ends)
    drawn = ("keypoints",) if tilts else BOTH
    usual = (accepted.max_offset, accepted.max_iterations)
    further = [(m, n) for n in iterations for m in max_offsets]
    curve_tables, precision_tables, count_tables, curved = [], [], [], []
    for n, extrema_path, traces_path in zip(n_spo, extrema, traces, strict=True):
        discrete, models = read_table(extrema_path), read_table(traces_path)
        limits = [usual, *further] if n in curve_n_spo else [usual]
        for choice in choices(discrete, models, limits):
            labels = {"n_spo": n, **choice.labels}
            common = everywhere.common(choice.keypoints, choice.scale_column)
            for part, members in parts_by(tilts, len(seen)):
                own, some = {**part, **labels}, of_views(common, members)
                matched = keypoints_of_views(some, len(members), vars(same))
                count_tables.append(count_table(matched, own))
                if n in curve_n_spo:
                    curve_tables.append(curve_table(matched, own, n_resamples))
                    curved.append(differing.Choice(own, matched))
                if choice.limits in (None, usual):
                    precision_tables.append(
                        localization_table(matched, own, minimum_share, n_resamples, drawn)
                    )
    write_joined(curve_tables, curves)
    write_joined(precision_tables, precision)
    pairs = differing.pairs_of_choices(curved, usual)
    write_joined([differing.difference_table(pairs, n_resamples)], differences)
    print(write_joined(count_tables, counts).to_string(index=False))
