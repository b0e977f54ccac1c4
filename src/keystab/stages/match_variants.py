"""New and lost extrema in every variant and in every reading, and their causes (figure floor)."""

from pathlib import Path

from keystab.parameters import Compared, Readings, Same, Scales
from keystab.utils.stage_command import Store, command


@command
def main(
    views: list[Store],
    extrema: list[Path],
    truth: Path,
    names: list[str],
    scenes: list[str],
    differences: list[str],
    tolerances: list[float],
    firsts: list[int],
    crossings: list[str],
    n_spo: list[int],
    epsilon: float,
    scales: Scales,
    same: Same,
    compared: Compared,
    readings: Readings,
    *,
    rates: Path,
    summary: Path,
    variants: Path,
    crossed: Path,
    causes: Path,
) -> None:
    """Read the extrema of every variant; write rates, a summary, words, readings and causes."""
    import pandas as pd

    from keystab.experiments import change_causes, floor_readings, sampling_stability
    from keystab.experiments.view_stability import labelled
    from keystab.io.study_tables import write_joined
    from keystab.io.tables import read_table, write_table
    from keystab.io.view_store import read_view
    from keystab.scalespace.sampling import balanced_delta
    from keystab.stages._compared import inside

    steps = {n: balanced_delta(n, scales.kappa, scales.sigma_min) for n in n_spo}
    rate_tables, summaries, crossings_of = [], [], []
    rows = zip(names, scenes, tolerances, firsts, crossings, views, extrema, strict=True)
    for name, scene, tolerance, first, crossing, store, path in rows:
        whole = read_table(path)
        within = inside(compared, scales.sigma_min, read_view(*store).shape)
        own = {n: step for n, step in steps.items() if n >= first}
        found = whole[whole["difference"] > tolerance].reset_index(drop=True)
        common = found[within(found, "step_sigma")]
        counts = sampling_stability.change_counts(found, common, own, vars(same))
        keypoints = None
        if crossing != "rates":
            matched = sampling_stability.keypoints_of_samplings(common, n_spo, vars(same))
            keypoints = matched.keypoints["stability"]
        row = sampling_stability.floor_summary(counts, keypoints, readings.settles_at)
        rate_tables.append(labelled(counts, {"variant": name}))
        summaries.append(labelled(row, {"variant": name}))
        if crossing == "none":
            continue
        ranges = floor_readings.ranges(whole, within)
        asked = floor_readings.crossed_for(crossing, epsilon, same.space_tolerance, vars(readings))
        table = floor_readings.reading_table(
            whole, ranges, list(own), readings.settles_at, asked, vars(same), crossing != "rates"
        )
        crossings_of.append(labelled(table, {"scene": scene, "variant": name}))
        if crossing == "all" and scene == scenes[0]:
            true = read_table(truth)
            of_causes = change_causes.causes_of_changes(
                whole, ranges["refined"], true, within(true, "sigma"), n_spo, vars(same)
            )
            write_table(of_causes, causes)
    write_joined(rate_tables, rates)
    write_table(pd.DataFrame({"variant": names, "differs_in": differences}), variants)
    readings_table = write_joined(crossings_of, crossed)
    print(write_joined(summaries, summary).to_string(index=False))
    print(floor_readings.fewest_choices(readings_table).to_string(index=False))
