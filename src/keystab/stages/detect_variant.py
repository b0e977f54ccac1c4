"""Detect the extrema of all balanced samplings in one variant of the arithmetic (figure floor).

In double precision no tolerance is applied: the table says by how much each extremum differs from
its neighbours, so that any is chosen afterwards. So it does of single precision in all steps.
"""

from pathlib import Path

from keystab.parameters import Arithmetic, Scales
from keystab.utils.stage_command import Store, command


@command
def main(
    views: Store, n_spo: list[int], scales: Scales, variant: Arithmetic, *, extrema: Path
) -> None:
    """Read the view; write one table of the extrema of all samplings."""
    import pandas as pd

    from keystab.detection.detector import extrema_table
    from keystab.detection.single_precision import extrema_in_arithmetic, quantised
    from keystab.io.tables import write_table
    from keystab.io.view_store import read_view
    from keystab.parameters import DifferenceOfGaussians
    from keystab.stages._scale_spaces import sampled_space
    from keystab.utils.progress import progress

    view = read_view(*views)
    view = view._replace(image=quantised(view.image, variant.bits))
    dog = DifferenceOfGaussians(**vars(scales), oversampling=variant.oversampling)
    columns = ["y", "x", "sigma", "value", "sign", "step_sigma", "difference"]
    parts = []
    for n in progress(n_spo, len(n_spo), "samplings"):
        space = sampled_space(view, n, dog)
        found, cubes = extrema_in_arithmetic(
            space, variant.arithmetic, variant.epsilon, variant.grey_range, variant.sides
        )
        table = extrema_table(space, found, cubes)[columns]
        table.insert(0, "n_spo", n)
        table.insert(1, "delta_min", space.sampling.delta_min)
        parts.append(table)
    whole = pd.concat(parts, ignore_index=True)
    write_table(whole, extrema)
    print(f"{len(whole)} extrema in {len(n_spo)} samplings")
