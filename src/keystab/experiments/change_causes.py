"""Why extrema come and go from one sampling to the next (section 5.2, figure floor).

Each extremum without a counterpart in a neighbouring sampling is held against the true extrema of
the continuous scale-space, which say what it is, and against what the neighbour found of them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from keystab.evaluation.intervals import wilson_interval
from keystab.evaluation.recall_precision import DEGENERATE, partners_and_near
from keystab.experiments.floor_readings import MATCHINGS, Reading, has_counterpart, steps_of
from keystab.matching.correspondence import pairs_within

CAUSES = ("edge", "second", "merged", "degenerate", "missed", "false")
"""Why an extremum has no counterpart, asked in this order but for the last, which comes second:

- ``edge``: the counterpart is there, beyond the end of the range or in the margin; or the true
  extremum is beyond;
- ``false``: no true extremum is near, or none of its sign;
- ``second``: the true extremum stands for a nearer detection of the same sampling; or the other
  sampling found it, and what it found is the counterpart of another one, such as that second one;
- ``merged``: two true extrema are the same by the limits, and the other sampling found one of them;
- ``degenerate``: the true extremum is nearly degenerate, a small change may merge it with a saddle;
- ``missed``: a sound true extremum that the other sampling does not find within the limits.
"""


class _Truth(NamedTuple):
    """What is known of the true extrema; one more row stands for none."""

    inside: NDArray[np.bool_]
    degenerate: NDArray[np.bool_]
    pairs: NDArray[np.intp]
    """Those of equal sign that are the same by the limits, shape (n_pairs, 2)."""

    def cause(
        self,
        partner: NDArray[np.intp],
        near: NDArray[np.bool_],
        beyond: NDArray[np.bool_],
        taken: NDArray[np.bool_],
        seen: NDArray[np.bool_],
    ) -> NDArray[np.str_]:
        """Cause of each extremum that has no counterpart in a sampling.

        Parameters
        ----------
        partner, near
            From `keystab.evaluation.recall_precision.partners_and_near`.
        beyond : ndarray of bool
            Whether it has a counterpart where those beyond the range count.
        taken : ndarray of bool
            Whether it would have one that is the counterpart of another.
        seen : ndarray of bool
            Which true extrema the other sampling found.
        """
        merged = np.zeros(len(self.inside), dtype=bool)
        for one, other in (self.pairs.T, self.pairs.T[::-1]):
            merged[one[seen[other] & ~seen[one]]] = True
        return np.select(
            [
                beyond | ~self.inside[partner],
                ~near,
                (partner < 0) | (taken & seen[partner]),
                merged[partner],
                self.degenerate[partner],
            ],
            ["edge", "false", "second", "merged", "degenerate"],
            "missed",
        )


def causes_of_changes(
    extrema: pd.DataFrame,
    counted: NDArray[np.bool_],
    truth: pd.DataFrame,
    true_inside: NDArray[np.bool_],
    samplings: Sequence[int],
    same: Mapping[str, Any],
) -> pd.DataFrame:
    """Count new and lost extrema by cause at every sampling, in two ways to match.

    Parameters
    ----------
    extrema : DataFrame
        All discrete extrema of all samplings: ``n_spo, y, x, sigma, sign``.
    counted : ndarray of bool
        Which of them are compared.
    truth : DataFrame
        True extrema, ``y, x, sigma, sign, conditioning``, also beyond the compared range.
    true_inside : ndarray of bool
        Which of them lie in the compared range.
    samplings : sequence of int
        Values of ``n_spo`` from coarse to fine.
    same : mapping
        Options of `keystab.matching.correspondence.same`.

    Returns
    -------
    DataFrame
        ``matching, n_spo, change`` ("new": without a counterpart in the coarser sampling before;
        "lost": in the finer one after), ``cause`` (see `CAUSES`), ``n`` of ``n_common`` compared
        extrema, and the share of these, ``rate``, with its 95 % Wilson interval, ``low, high``.
        The first sampling has nothing new and the last nothing lost: no rows.

    Notes
    -----
    Distances are those of grid positions, as in the rates. At coarse samplings, where a sample is
    half a pixel, a detection and its true extremum may lie farther apart than the limits: such a
    detection counts as false.
    """
    limits = {name: same[name] for name in ("space_tolerance", "scale_ratio")}
    n_spo = extrema["n_spo"].to_numpy()
    partner = np.full(len(extrema), -1, dtype=np.intp)
    near = np.zeros(len(extrema), dtype=bool)
    seen = np.zeros((len(samplings), len(truth) + 1), dtype=bool)  # the last one stands for none
    for number, sampling in enumerate(samplings):
        rows = np.flatnonzero(n_spo == sampling)
        partner[rows], near[rows] = partners_and_near(extrema.iloc[rows], truth, **limits)
        seen[number, partner[rows]] = True
    about = _Truth(
        np.append(true_inside, True),
        np.append(truth["conditioning"].to_numpy() < DEGENERATE, False),
        pairs_within(truth, **limits, match_sign=True),
    )
    everywhere = np.ones(len(extrema), dtype=bool)
    rows_of_table = []
    for number, step in enumerate(steps_of(extrema, samplings, same)):
        taken = has_counterpart(step, Reading(limit=same["space_tolerance"]), counted)
        for matching in MATCHINGS:
            reading = Reading(matching, limit=same["space_tolerance"])
            alone = ~has_counterpart(step, reading, counted)
            beyond = has_counterpart(step, reading, everywhere)
            for change, sampling, other in (
                ("new", step.fine, number),
                ("lost", step.coarse, number + 1),
            ):
                own = counted & (n_spo == sampling)
                changed = np.flatnonzero(own & alone)
                cause = about.cause(
                    partner[changed], near[changed], beyond[changed], taken[changed], seen[other]
                )
                for name in CAUSES:
                    k, n = int((cause == name).sum()), int(own.sum())
                    low, high = wilson_interval(k, n)
                    rows_of_table.append(
                        {
                            "matching": matching,
                            "n_spo": sampling,
                            "change": change,
                            "cause": name,
                            "n": k,
                            "n_common": n,
                            "rate": k / n if n else np.nan,
                            "low": float(low),
                            "high": float(high),
                        }
                    )
    table = pd.DataFrame(rows_of_table)
    return table.sort_values(["matching", "n_spo", "change"], kind="stable", ignore_index=True)
