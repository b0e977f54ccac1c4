"""Count the keypoints that the quadratic refinement keeps at every balanced sampling."""

from dataclasses import replace
from pathlib import Path

from keystab.parameters import Acceptance, Compared, Scales
from keystab.utils.stage_command import Store, command


@command
def main(
    views: Store,
    samplings: list[Path],
    traces: list[Path],
    n_spo: list[int],
    scales: Scales,
    compared: Compared,
    accepted: Acceptance,
    *,
    table: Path,
    dead: Path,
) -> None:
    """Read extrema and refinement traces; write one row per sampling into either table."""
    import pandas as pd

    from keystab.detection.refinement import accepted as accepted_models
    from keystab.detection.refinement import positions
    from keystab.experiments.dead_range import dead_range_row
    from keystab.io.tables import read_table, write_table
    from keystab.io.view_store import read_view
    from keystab.scalespace.sampling import Sampling
    from keystab.stages._compared import inside

    view = read_view(*views)
    everywhere = inside(compared, scales.sigma_min, view.shape)
    octave = inside(replace(compared, last_scale=2.0), scales.sigma_min, view.shape)
    rows, below = [], []
    for n, extrema_path, traces_path in zip(n_spo, samplings, traces, strict=True):
        extrema = read_table(extrema_path, ["y", "x", "sigma", "step_sigma"])
        sampling = Sampling.balanced(view.shape, view.blur, n, **vars(scales))
        refined = positions(accepted_models(read_table(traces_path), **vars(accepted)), sampling)
        rows.append(
            {
                "n_spo": n,
                "delta_min": sampling.delta_min,
                "n_extrema": len(extrema),
                "n_refined": len(refined),
                "n_common": everywhere(extrema, "step_sigma").sum(),
                "n_refined_common": everywhere(refined, "sigma").sum(),
                "n_refined_octave": octave(refined, "sigma").sum(),
            }
        )
        below.append(dead_range_row(extrema["sigma"], refined["sigma"], n, scales.sigma_min))
    write_table(pd.DataFrame(rows), table)
    write_table(pd.DataFrame(below), dead)
