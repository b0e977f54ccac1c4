"""Find the true extrema of the scene, as a view of the whole of it sees them."""

from pathlib import Path

from keystab.parameters import Scales
from keystab.utils.stage_command import Store, command


@command
def main(
    reference: Path,
    views: Store,
    reference_blur: float,
    scales: Scales,
    sigma_max: float,
    *,
    table: Path,
) -> None:
    """Read the picture and how the view was taken; write the extrema of the picture's series."""
    from keystab.io.pictures import read_picture
    from keystab.io.tables import write_table
    from keystab.io.view_store import read_views
    from keystab.truth.scene_extrema import scene_extrema

    picture, spec = read_picture(reference), read_views(*views).specs[0]
    ends, kappa = (scales.sigma_min, sigma_max), scales.kappa
    extrema = scene_extrema(picture, spec, *ends, kappa, reference_blur)
    write_table(extrema, table)
    print(f"{len(extrema)} true extrema of the scene")
