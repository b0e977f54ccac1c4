"""Rates of new and lost extrema in every variant of the arithmetic (figure floor)."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from keystab.stages import _run


@_run.stage
def main(argv: Sequence[str] | None = None) -> None:
    """Read the extrema of every variant; write rates against n_spo, and a summary."""
    parser = _run.parser(__doc__)
    _run.required(parser, "views", "store of the view of each variant", type=Path, nargs="+")
    _run.required(parser, "views-digest", "their seals", type=Path, nargs="+")
    _run.required(parser, "extrema", "extrema of each variant", type=Path, nargs="+")
    _run.required(parser, "names", "names of the variants", nargs="+")
    least = "least difference to the 26 neighbours in each variant, of grey values in [0, 1]"
    _run.required(parser, "tolerances", least, type=float, nargs="+")
    _run.required(parser, "n-spo", "scales per octave of the samplings", type=int, nargs="+")
    _run.required(parser, "settles-at", "n_spo from which rates are averaged", type=int)
    _run.scale_arguments(parser)
    _run.same_arguments(parser)
    _run.range_arguments(parser)
    _run.required(parser, "rates", "table of rates to write", type=Path)
    _run.required(parser, "summary", "table of means to write", type=Path)
    args = parser.parse_args(argv)

    import pandas as pd

    from keystab.experiments.sampling_stability import change_counts, floor_summary, match_samplings
    from keystab.experiments.view_stability import labelled
    from keystab.io.tables import read_table, write_table
    from keystab.io.view_store import read_view
    from keystab.scalespace.sampling import balanced_delta
    from keystab.stages._compared import comparable_only, same_options

    same = same_options(args)
    steps = {n_spo: balanced_delta(n_spo, args.kappa, args.sigma_min) for n_spo in args.n_spo}
    rates, summaries = [], []
    for name, tolerance, store, digest, path in zip(
        args.names, args.tolerances, args.views, args.views_digest, args.extrema, strict=True
    ):
        extrema = read_table(path)
        extrema = extrema[extrema["difference"] > tolerance].reset_index(drop=True)
        common = comparable_only(extrema, read_view(store, digest).shape, args)
        counts = change_counts(extrema, common, steps, same)
        stability = match_samplings(common, args.n_spo, same).keypoints["stability"]
        rates.append(labelled(counts, {"variant": name}))
        summary = floor_summary(counts, stability, args.settles_at)
        summaries.append(labelled(summary, {"variant": name}))
    write_table(pd.concat(rates, ignore_index=True), args.rates)
    write_table(pd.concat(summaries, ignore_index=True), args.summary)
    print(pd.concat(summaries, ignore_index=True).to_string(index=False))


if __name__ == "__main__":
    raise SystemExit(main())
