"""Match the keypoints of SIFT with its own refinement, with and without its filters (figure 7)."""

from pathlib import Path

from keystab.parameters import ComparedInViews, Same, SiftFilters
from keystab.utils.stage_command import Store, command


@command
def main(
    views: Store,
    extrema: Path,
    traces: Path,
    compared: ComparedInViews,
    same: Same,
    sift: SiftFilters,
    minimum_share: float,
    n_resamples: int,
    soft_ends: bool = False,
    *,
    curves: Path,
    counts: Path,
    edges: Path,
) -> None:
    """Read extrema and traces of a set; write curves, counts and spreads."""
    from keystab.detection.refinement import refined_keypoints
    from keystab.detection.sift_filters import passes_filters
    from keystab.experiments.filtered_keypoints import edge_spreads, kept_by_filters
    from keystab.experiments.view_stability import count_table, curve_table, keypoints_of_views
    from keystab.io.study_tables import write_joined
    from keystab.io.tables import read_table
    from keystab.io.view_store import read_views
    from keystab.stages._compared import common_range

    seen = read_views(*views)
    everywhere = common_range(seen, compared, soft_ends)
    refined = refined_keypoints(
        read_table(extrema), read_table(traces), sift.max_offset, sift.max_iterations
    )
    filtered = refined[passes_filters(refined, sift.contrast, sift.edge_ratio)]
    curve_tables, count_tables = [], []
    for name, keypoints in (("unfiltered", refined), ("filtered", filtered)):
        matched = keypoints_of_views(everywhere.common(keypoints), len(seen), vars(same))
        curve_tables.append(curve_table(matched, {"shipped": name}, n_resamples))
        count_tables.append(count_table(matched, {"shipped": name}))
        if name == "unfiltered":
            write_joined([edge_spreads(matched, sift.edge_ratio, minimum_share)], edges)
    write_joined(curve_tables, curves)
    print(write_joined([kept_by_filters(count_tables)], counts).to_string(index=False))
