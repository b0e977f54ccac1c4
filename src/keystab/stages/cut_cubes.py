"""Cut cubes out of a very dense scale-space, around stable and unstable keypoints (figure 6)."""

from pathlib import Path

from keystab.parameters import DifferenceOfGaussians, Stable, Tolerance
from keystab.utils.stage_command import Store, command


@command
def main(
    views: Store,
    keypoints: Path,
    n_spo: int,
    per_group: int,
    dog: DifferenceOfGaussians,
    tolerance: Tolerance,
    stable: Stable,
    *,
    panels: Path,
    cubes: Path,
) -> None:
    """Read the view and the unique keypoints; write a table of cubes and one of their samples."""
    from keystab.experiments.local_volumes import cubes_around, dense_scale_space, drawn
    from keystab.io.study_tables import read_keypoints
    from keystab.io.tables import write_table
    from keystab.io.view_store import read_view

    columns = ["keypoint", "y", "x", "sigma", "sign", "stability"]
    unique = read_keypoints(keypoints, columns)
    view = read_view(*views)
    space = dense_scale_space(
        view.image, view.blur, n_spo, **vars(dog), scale_ratio=tolerance.scale_ratio
    )
    chosen = drawn(unique, space, **vars(stable), per_group=per_group)
    panel_table, cube_table = cubes_around(space, chosen, **vars(tolerance))
    write_table(panel_table, panels)
    write_table(cube_table, cubes)
