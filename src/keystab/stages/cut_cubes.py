"""Cut cubes out of a very dense scale-space, around stable and unstable keypoints (figure 6)."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from keystab.stages import _run


@_run.stage
def main(argv: Sequence[str] | None = None) -> None:
    """Read the view and the unique keypoints; write a table of cubes and one of their samples."""
    parser = _run.parser(__doc__)
    _run.views_arguments(parser)
    _run.required(parser, "keypoints", "table of unique keypoints", type=Path)
    _run.required(parser, "n-spo", "scales per octave of the dense scale-space", type=int)
    _run.required(parser, "per-group", "stable keypoints, and unstable ones", type=int)
    _run.detector_arguments(parser)
    _run.tolerance_arguments(parser)
    _run.label_arguments(parser)
    _run.required(parser, "panels", "table of cubes to write", type=Path)
    _run.required(parser, "cubes", "table of samples to write", type=Path)
    args = parser.parse_args(argv)

    from keystab.experiments.local_volumes import cubes_around, dense_scale_space, drawn
    from keystab.io.tables import write_table
    from keystab.io.view_store import read_view
    from keystab.stages._inputs import read_keypoints

    columns = ["keypoint", "y", "x", "sigma", "sign", "stability"]
    keypoints = read_keypoints(args.keypoints, columns)
    view = read_view(args.views, args.views_digest)
    space = dense_scale_space(
        view.image,
        view.blur,
        args.n_spo,
        args.sigma_min,
        args.kappa,
        args.oversampling,
        args.scale_ratio,
    )
    chosen = drawn(keypoints, space, args.stable_above, args.unstable_below, args.per_group)
    panels, cubes = cubes_around(space, chosen, args.space_tolerance, args.scale_ratio)
    write_table(panels, args.panels)
    write_table(cubes, args.cubes)


if __name__ == "__main__":
    raise SystemExit(main())
