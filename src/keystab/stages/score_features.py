"""Score features of extrema by how well they tell stable from unstable keypoints (figure 5)."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from keystab.stages import _run


@_run.stage
def main(argv: Sequence[str] | None = None) -> None:
    """Read keypoints, matches and extrema; write the tables of figure 5."""
    parser = _run.parser(__doc__)
    _run.required(parser, "keypoints", "table of unique keypoints", type=Path)
    _run.required(parser, "matches", "table of matches", type=Path)
    _run.required(parser, "samplings", "extrema of the samplings", type=Path, nargs="+")
    _run.label_arguments(parser)
    _run.required(parser, "n-resamples", "bootstrap resamples", type=int)
    _run.required(parser, "features", "table of features to write", type=Path)
    _run.required(parser, "thresholds", "table of shares below thresholds to write", type=Path)
    _run.required(parser, "roc", "table of ROC curves to write", type=Path)
    _run.required(parser, "auc", "table of areas under the curves to write", type=Path)
    args = parser.parse_args(argv)

    from keystab.experiments.feature_scores import score_features
    from keystab.io.tables import read_table, write_table
    from keystab.stages._inputs import positions_of_matches, read_extrema, read_keypoints

    keypoints = read_keypoints(args.keypoints, ["keypoint", "stability"])
    extrema = read_extrema(args.samplings)
    scores = score_features(
        keypoints,
        extrema,
        positions_of_matches(read_table(args.matches), extrema),
        args.stable_above,
        args.unstable_below,
        args.n_resamples,
    )
    write_table(scores.features, args.features)
    write_table(scores.thresholds, args.thresholds)
    write_table(scores.roc, args.roc)
    write_table(scores.auc, args.auc)
    print(scores.auc.to_string(index=False))


if __name__ == "__main__":
    raise SystemExit(main())
