"""Compare views of wrongly assumed blur with the view of the assumed blur (figure S2)."""

from pathlib import Path

from keystab.parameters import Acceptance, ComparedInViews, Same
from keystab.utils.stage_command import Store, command


@command
def main(
    views: Store,
    extrema: Path,
    traces: Path,
    assumed_blur: float,
    kappa: float,
    compared: ComparedInViews,
    same: Same,
    accepted: Acceptance,
    *,
    table: Path,
) -> None:
    """Read extrema and traces of the set; write one row per view and range of scales."""
    from keystab.detection.refinement import refined_keypoints
    from keystab.experiments.blur_errors import errors_by_octave
    from keystab.io.tables import read_table, write_table
    from keystab.io.view_store import read_views
    from keystab.stages._compared import common_range

    seen = read_views(*views)
    blurs = [spec.blur for spec in seen.specs]
    keypoints = refined_keypoints(read_table(extrema), read_table(traces), **vars(accepted))
    everywhere = common_range(seen, compared)
    result = errors_by_octave(keypoints, everywhere, blurs, assumed_blur, kappa, vars(same))
    write_table(result, table)
    print(result.to_string(index=False))
