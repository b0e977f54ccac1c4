"""Compare views of wrongly assumed blur with the view of the assumed blur (figure S2)."""

from pathlib import Path

from keystab.parameters import Acceptance, ComparedInViews, Same
from keystab.stages._command import Store, command


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
    from dataclasses import replace

    from keystab.detection.refinement import refined_keypoints
    from keystab.errors import InputError
    from keystab.experiments.blur_errors import blur_error_table
    from keystab.io.tables import read_table, write_table
    from keystab.io.view_store import read_views
    from keystab.stages._compared import common_range

    seen = read_views(*views)
    blurs = [spec.blur for spec in seen.specs]
    if blurs[0] != assumed_blur:
        raise InputError(
            f"the first view has blur {blurs[0]:g}, wanted is the assumed {assumed_blur:g}: "
            "put it first in the list of blurs"
        )
    everywhere = common_range(seen, compared)
    keypoints = refined_keypoints(read_table(extrema), read_table(traces), **vars(accepted))
    low = everywhere.low
    # Keypoints move across the ends of the ranges: those beyond are needed as counterparts.
    searched = replace(everywhere, low=0.0)
    result = blur_error_table(
        searched.common(keypoints),
        blurs,
        assumed_blur,
        kappa,
        {"first octave": (low, 2 * low), "second octave": (2 * low, 4 * low)},
        vars(same),
    )
    write_table(result, table)
    print(result.to_string(index=False))


if __name__ == "__main__":
    raise SystemExit(main())
