"""Score predictors and models of them on detections of several pictures (figure predictors)."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from keystab.stages import _run

_PICTURE = (
    "NAME, store of its views, seal, unique keypoints, true extrema, extrema of samplings ..."
)


@_run.stage
def main(argv: Sequence[str] | None = None) -> None:
    """Read what is known of every picture; write the tables of figure predictors."""
    parser = _run.parser(__doc__)
    _run.required(parser, "picture", _PICTURE, nargs="+", action="append")
    _run.required(parser, "n-spo", "samplings whose detections are scored", type=int, nargs="+")
    _run.scale_arguments(parser)
    _run.same_arguments(parser)
    _run.range_arguments(parser)
    _run.required(parser, "end", "end of the scales held against the truth", type=float)
    _run.label_arguments(parser)
    _run.required(parser, "block", "side of the blocks that stay together, pixels", type=float)
    _run.required(parser, "n-folds", "folds of the blocks of a picture", type=int)
    _run.required(parser, "n-resamples", "bootstrap resamples", type=int)
    _run.required(parser, "detections", "table of scored detections to write", type=Path)
    _run.required(parser, "auc", "table of areas to write", type=Path)
    _run.required(parser, "gain", "table of what models gain to write", type=Path)
    _run.required(parser, "roc", "table of ROC curves to write", type=Path)
    args = parser.parse_args(argv)

    from keystab.experiments.predictor_scores import described, score_predictors
    from keystab.io.tables import read_table, write_table
    from keystab.io.view_store import read_view
    from keystab.scalespace.continuous_dog import DogSeries
    from keystab.stages._compared import compared, same_options
    from keystab.stages._inputs import read_extrema, read_keypoints
    from keystab.utils.progress import progress

    ends = (args.sigma_min * args.first_scale, args.sigma_min * args.end)
    columns = ["keypoint", "y", "x", "sigma", "sign", "stability"]
    pictures = {}
    for name, *files in progress(args.picture, len(args.picture), "pictures"):
        store, digest, keypoints, truth, *samplings = map(Path, files)
        view = read_view(store, digest)
        extrema = read_extrema(samplings)
        extrema = extrema[extrema["n_spo"].isin(args.n_spo)].reset_index(drop=True)
        pictures[name] = described(
            extrema,
            compared(args, view.shape)(extrema, "step_sigma"),
            read_keypoints(keypoints, columns),
            read_table(truth),
            DogSeries.of_image(view.image, view.blur, args.kappa),
            ends,
            same_options(args),
        )
    scored = score_predictors(
        pictures,
        args.stable_above,
        args.unstable_below,
        args.block,
        args.n_folds,
        args.n_resamples,
    )
    write_table(scored.detections, args.detections)
    write_table(scored.auc, args.auc)
    write_table(scored.gain, args.gain)
    write_table(scored.roc, args.roc)
    print(scored.gain.to_string(index=False))


if __name__ == "__main__":
    raise SystemExit(main())
