"""Find the unique keypoints of all balanced samplings, and each in every sampling (figure 4)."""

from pathlib import Path

from keystab.parameters import Compared, Same, Scales, Stable
from keystab.utils.stage_command import Store, command


@command
def main(
    views: Store,
    samplings: list[Path],
    n_spo: list[int],
    scales: Scales,
    same: Same,
    compared: Compared,
    stable: Stable,
    soft_ends: bool = False,
    *,
    matches: Path,
    counts: Path,
    keypoints: Path,
    occurrence: Path,
    summary: Path,
) -> None:
    """Read the extrema of all samplings; write matches and the tables of figure 4."""
    from keystab.experiments import sampling_stability as tables
    from keystab.io.study_tables import read_extrema
    from keystab.io.tables import write_table
    from keystab.io.view_store import read_view
    from keystab.matching.common_range import in_range
    from keystab.scalespace.sampling import balanced_delta

    extrema, how = read_extrema(samplings), vars(same)
    shape = read_view(*views).shape
    common = in_range(extrema, "step_sigma", shape, scales.sigma_min, soft_ends, **vars(compared))
    matched = tables.keypoints_of_samplings(common, n_spo, how)
    reverse = tables.keypoints_of_samplings(common, n_spo, how, reverse_order=True)
    pairs = tables.long_matches(matched, n_spo, common["row_in_file"].to_numpy())
    seen = pairs.assign(detected=(pairs["row"] >= 0).astype(int))
    steps = {n: balanced_delta(n, scales.kappa, scales.sigma_min) for n in n_spo}
    write_table(pairs, matches)
    write_table(tables.change_counts(extrema, common, steps, how), counts)
    write_table(matched.keypoints, keypoints)
    write_table(seen[["keypoint", "n_spo", "detected"]], occurrence)
    write_table(tables.summary(matched, reverse, **vars(stable)), summary)
    proven = "proven minimal" if matched.gap == 0 else f"at most {matched.gap} more than minimal"
    print(f"{len(matched.keypoints)} unique keypoints of {len(common)} detections, {proven}")
