"""Find the true extrema of the octave of a view that the samplings sample."""

from pathlib import Path

from keystab.parameters import Scales
from keystab.utils.stage_command import Store, command


@command
def main(views: Store, scales: Scales, sigma_max: float, *, table: Path) -> None:
    """Read the view; write its true extrema."""
    from keystab.io.tables import write_table
    from keystab.io.view_store import read_view
    from keystab.truth.true_extrema import true_extrema

    view = read_view(*views)
    extrema = true_extrema(view.image, view.blur, scales.sigma_min, sigma_max, scales.kappa)
    write_table(extrema, table)
    print(f"{len(extrema)} true extrema")
