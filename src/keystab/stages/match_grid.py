"""Count the extrema of every sampling of a grid: all, comparable and unique ones (figure 3)."""

from pathlib import Path

from keystab.parameters import Compared, Same, Scales
from keystab.utils.stage_command import Store, command


@command
def main(
    views: Store,
    grid: list[Path],
    samplings: list[Path],
    n_spo: list[int],
    delta_min: list[float],
    balanced_n_spo: list[int],
    scales: Scales,
    same: Same,
    compared: Compared,
    *,
    table: Path,
) -> None:
    """Read the extrema of all samplings; write one row per sampling."""
    from itertools import product

    import pandas as pd

    from keystab.experiments.sampling_stability import count_sampling, ratio_columns
    from keystab.io.study_tables import read_extrema
    from keystab.io.tables import write_table
    from keystab.io.view_store import read_view
    from keystab.scalespace.sampling import Sampling
    from keystab.stages._compared import inside

    view = read_view(*views)
    common = inside(compared, scales.sigma_min, view.shape)
    of_grid, balanced = read_extrema(grid), read_extrema(samplings)
    seen = (view.shape, view.blur)
    every = [
        (of_grid, False, Sampling(*seen, n, step, **vars(scales)))
        for n, step in product(n_spo, delta_min)
    ]
    every += [(balanced, True, Sampling.balanced(*seen, n, **vars(scales))) for n in balanced_n_spo]
    counted = []
    for found, is_balanced, sampling in every:
        here = {"n_spo": sampling.n_spo, "delta_min": sampling.delta_min}
        extrema = found[
            (found["n_spo"] == sampling.n_spo) & (found["delta_min"] == sampling.delta_min)
        ]
        one = count_sampling(extrema, extrema[common(extrema, "step_sigma")], vars(same))
        here |= {"balanced": is_balanced, "n_samples": sampling.n_samples}
        counted.append(one._replace(numbers=here | one.numbers))
    numbers = pd.DataFrame([one.numbers for one in counted])
    write_table(numbers.join(ratio_columns(counted)), table)
