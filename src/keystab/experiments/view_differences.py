"""Two choices of keypoints that saw the same views, and what they differ by (section 5.5).

The intervals of two shares overlap long before their difference is in doubt, since both rise and
fall with the scene and with the views. Here both are drawn anew with the same pieces of the scene
and the same views, and the difference gets the interval.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from keystab.evaluation.intervals import centred_interval
from keystab.evaluation.scene_pieces import drawn_anew
from keystab.evaluation.stability import UNSTABLE
from keystab.experiments.view_stability import MatchedViews

__all__ = [
    "QUANTITIES",
    "Choice",
    "difference_table",
    "pairs_of_choices",
]

QUANTITIES = (
    "share_always",
    "mean_stability",
    "share_unstable",
    "relative_always",
    "relative_n_always",
)
"""What is compared: the share of unique keypoints seen in all views, the mean share of the views
that see a keypoint, the share seen in less than `UNSTABLE` of them; and by what share the first,
and the number seen in all, is larger than the other's."""


_MORE = 4
"""Times the resamples that curves have: verdicts hang on the ends of these intervals."""

_CHOICE = ("n_spo", "detections", "max_offset", "max_iterations")


class Choice(NamedTuple):
    """Keypoints of a set of views and the columns that name them."""

    labels: Mapping[str, Any]
    matched: MatchedViews


class Pair(NamedTuple):
    """What is compared, with what, and a name of that."""

    one: Choice
    other: Choice
    against: str


def pairs_of_choices(choices: Sequence[Choice], usual: tuple[float, float]) -> list[Pair]:
    """Pair choices at several samplings with those that the paper compares them with.

    Parameters
    ----------
    choices : sequence of Choice
        With the labels ``n_spo, detections, max_offset, max_iterations``; others name parts of a
        set of views, which are compared each by itself.
    usual : (float, float)
        M_offset and N_interp of the usual refinement.

    Returns
    -------
    list of Pair
        Every other choice against the ``usual`` refinement at the same sampling, against the
        ``usual at N``, the finest sampling; and other numbers of interpolations against ``two``
        with the same offset.
    """
    named = {_name(choice.labels): choice for choice in choices}
    finest = max((choice.labels["n_spo"] for choice in choices), default=0)
    pairs = []
    for name, one in named.items():
        (n_spo, detections, max_offset, max_iterations), part = name[:4], name[4:]
        others = {f"usual at {finest}": (finest, "refined", *usual, *part)}
        others["usual"] = (n_spo, "refined", *usual, *part)
        if detections == "refined" and max_iterations != 2:
            others["two"] = (n_spo, "refined", max_offset, 2, *part)
        pairs += [
            Pair(one, named[other], against)
            for against, other in others.items()
            if other in named and other != name
        ]
    return pairs


def difference_table(pairs: Iterable[Pair], n_resamples: int) -> pd.DataFrame:
    """What choices differ by that saw the same views.

    Parameters
    ----------
    pairs : iterable of Pair
        All of one set of views.
    n_resamples : int
        Resamples of pieces of the scene and of views that curves have; here there are four times as
        many.

    Returns
    -------
    DataFrame
        One row per pair and quantity: the labels of the first choice; ``against``; ``quantity``,
        one of `QUANTITIES`; ``value`` and ``other`` of the two choices; ``difference``, of which
        those called relative are ratios less 1; ``low, high``, its 95 % interval.
    """
    listed = list(pairs)
    choices = {id(choice): choice for pair in listed for choice in (pair.one, pair.other)}
    samples = _resampled([*choices.values()], _MORE * n_resamples)
    found = dict(zip(choices, samples, strict=True))
    rows = []
    for pair in listed:
        one, other = found[id(pair.one)], found[id(pair.other)]
        for quantity in QUANTITIES:
            kind = quantity.removeprefix("relative_")
            kind = "share_always" if kind == "always" else kind
            a, b = one[kind], other[kind]
            if quantity.startswith("relative_"):
                difference = a / np.where(b > 0, b, np.nan) - 1
            else:
                difference = a - b
            limits = (-1.0, np.inf) if quantity.startswith("relative_") else (-1.0, 1.0)
            low, high = centred_interval(difference[1:], difference[0], limits=limits)
            values = {"value": a[0], "other": b[0], "difference": difference[0]}
            ends = {"low": float(low), "high": float(high)}
            names = {"against": pair.against, "quantity": quantity}
            rows.append({**pair.one.labels, **names, **values, **ends})
    return pd.DataFrame(rows)


def _resampled(choices: Sequence[Choice], n_resamples: int) -> list[dict[str, NDArray[np.float64]]]:
    """Quantities of choices in the data (first) and in each resample, drawn with the same draws."""
    matched = [(choice.matched.common, choice.matched.found) for choice in choices]
    results = []
    for weight, number, n_views in drawn_anew(matched, n_resamples):
        total = (weight * (number > 0)).sum(axis=1)
        total = np.where(total > 0, total, np.nan)
        rare = (number > 0) & (number < UNSTABLE * n_views)
        n_always = (weight * (number == n_views)).sum(axis=1)
        results.append(
            {
                "n_always": n_always,
                "share_always": n_always / total,
                "mean_stability": (weight * number).sum(axis=1) / n_views / total,
                "share_unstable": (weight * rare).sum(axis=1) / total,
            }
        )
    return results


def _name(labels: Mapping[str, Any]) -> tuple[Any, ...]:
    """Labels as a key: those of a choice, and any others; discrete extrema have no limits."""
    limits = (labels["max_offset"], labels["max_iterations"])
    parts = [value for name, value in labels.items() if name not in _CHOICE]
    return labels["n_spo"], labels["detections"], *(None if x != x else x for x in limits), *parts
