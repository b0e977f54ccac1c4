"""Say what the stable and unstable keypoints of figure 4 are, and what predicts their truth."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from keystab.stages import _run


@_run.stage
def main(argv: Sequence[str] | None = None) -> None:
    """Read truth, unique keypoints and their features; write causes and areas under curves."""
    parser = _run.parser(__doc__)
    _run.required(parser, "truth", "table of true extrema", type=Path)
    _run.required(parser, "keypoints", "table of unique keypoints", type=Path)
    _run.required(parser, "features", "table of their features", type=Path)
    _run.label_arguments(parser)
    _run.required(parser, "sigma-min", "first scale in pixels", type=float)
    _run.judged_arguments(parser)
    _run.required(parser, "n-resamples", "bootstrap resamples", type=int)
    _run.required(parser, "causes", "table of causes to write", type=Path)
    _run.required(parser, "auc", "table of areas to write", type=Path)
    args = parser.parse_args(argv)

    import numpy as np
    import pandas as pd

    from keystab.evaluation.intervals import wilson_interval
    from keystab.evaluation.recall_precision import CAUSES, causes
    from keystab.evaluation.roc import auc_table
    from keystab.evaluation.stability import label
    from keystab.io.tables import read_table, write_table
    from keystab.prediction.features import DIRECTIONS
    from keystab.stages._compared import tolerances
    from keystab.stages._inputs import read_keypoints

    keypoints = read_keypoints(args.keypoints, ["keypoint", "y", "x", "sigma", "sign", "stability"])
    low, high = (args.sigma_min * end for end in (args.first_scale, args.last_scale))
    cause = causes(keypoints, read_table(args.truth), low, high, **tolerances(args))
    group = label(keypoints["stability"], args.stable_above, args.unstable_below)
    rows = []
    for name in ("stable", "between", "unstable"):
        total = int((group == name).sum())
        for one in CAUSES:
            count = int(((group == name) & (cause == one)).sum())
            lower, upper = wilson_interval(count, total)
            rows.append(
                {
                    "group": name,
                    "cause": one,
                    "n": count,
                    "n_group": total,
                    "share": count / total if total else np.nan,
                    "low": float(lower),
                    "high": float(upper),
                }
            )
    write_table(pd.DataFrame(rows), args.causes)
    # The same features, once asked for stability and once for truth; names as auc_table has them.
    features = read_table(args.features)
    right = np.where(np.isin(cause, ("nothing", "twin")), "unstable", "stable")
    each = [
        auc_table(features, names, DIRECTIONS, ("truth", what), args.n_resamples).assign(label=what)
        for what, names in (("stability", group), ("truth", right))
    ]
    areas = pd.concat(each, ignore_index=True)
    write_table(areas.rename(columns={"n_stable": "n_good", "n_unstable": "n_bad"}), args.auc)
    print(pd.DataFrame(rows).to_string(index=False))


if __name__ == "__main__":
    raise SystemExit(main())
