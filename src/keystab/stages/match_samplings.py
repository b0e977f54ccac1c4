"""Find the unique keypoints of all balanced samplings, and each in every sampling (figure 4)."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from keystab.stages import _run


@_run.stage
def main(argv: Sequence[str] | None = None) -> None:
    """Read the extrema of all samplings; write matches and the tables of figure 4."""
    parser = _run.parser(__doc__)
    _run.views_arguments(parser)
    _run.required(parser, "samplings", "extrema of the samplings", type=Path, nargs="+")
    _run.required(parser, "n-spo", "n_spo of --samplings, ascending", type=int, nargs="+")
    _run.scale_arguments(parser)
    _run.same_arguments(parser)
    _run.range_arguments(parser)
    _run.label_arguments(parser)
    _run.required(parser, "matches", "table of matches to write", type=Path)
    _run.required(parser, "counts", "table of counts and rates to write", type=Path)
    _run.required(parser, "keypoints", "table of unique keypoints to write", type=Path)
    _run.required(parser, "occurrence", "occurrence matrix to write", type=Path)
    _run.required(parser, "summary", "table of a few numbers to write", type=Path)
    args = parser.parse_args(argv)

    from keystab.experiments.sampling_stability import (
        change_counts,
        long_matches,
        match_samplings,
        summary,
    )
    from keystab.io.tables import write_table
    from keystab.io.view_store import read_view
    from keystab.scalespace.sampling import balanced_delta
    from keystab.stages._compared import comparable_only, same_options
    from keystab.stages._inputs import read_extrema

    view = read_view(args.views, args.views_digest)
    extrema = read_extrema(args.samplings)
    common, same = comparable_only(extrema, view.shape, args), same_options(args)
    steps = {n_spo: balanced_delta(n_spo, args.kappa, args.sigma_min) for n_spo in args.n_spo}
    matched = match_samplings(common, args.n_spo, same)
    reverse = match_samplings(common, args.n_spo, same, reverse_order=True)
    pairs = long_matches(matched, args.n_spo, common["row_in_file"].to_numpy())
    seen = pairs.assign(detected=(pairs["row"] >= 0).astype(int))
    write_table(pairs, args.matches)
    write_table(change_counts(extrema, common, steps, same), args.counts)
    write_table(matched.keypoints, args.keypoints)
    write_table(seen[["keypoint", "n_spo", "detected"]], args.occurrence)
    write_table(summary(matched, reverse, args.stable_above, args.unstable_below), args.summary)
    proven = "proven minimal" if matched.gap == 0 else f"at most {matched.gap} more than minimal"
    print(f"{len(matched.keypoints)} unique keypoints of {len(common)} detections, {proven}")


if __name__ == "__main__":
    raise SystemExit(main())
