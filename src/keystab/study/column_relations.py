"""Columns that follow from others of the same table: what a table must say of itself.

A number that somebody changed by hand no longer follows from those beside it. Whoever changes all
of them consistently is found by a comparison with another run, not here.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from keystab.errors import InputError
from keystab.evaluation.intervals import wilson_interval
from keystab.study.expressions import evaluate

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["RELATIONS", "Proportion", "broken_relations"]

_RTOL, _ATOL = 1e-12, 1e-14
"""Columns are computed again from those beside them, in the same few operations."""


class Proportion(NamedTuple):
    """A share of counted things, with its Wilson interval of 95 %.

    Parameters
    ----------
    share : str
        Column of the share.
    part, whole : str
        Columns of the counts.
    low, high : str, optional
        Columns of the ends of the interval.
    percent : bool, optional
        Whether the share is in per cent.
    """

    share: str
    part: str
    whole: str
    low: str = ""
    high: str = ""
    percent: bool = False


_RECALL = Proportion("recall", "n_found", "n_true", "recall_low", "recall_high")
_PRECISION = Proportion("precision", "n_right", "n_detections", "precision_low", "precision_high")

RELATIONS: dict[str, list[Proportion | tuple[str, str]]] = {
    r"fig1": [("theory", "(c ** 2 + n_passes * sigma ** 2) ** 0.5")],
    r"fig(7|8|10|11|12|S1)_counts|fig7_shipped_counts|fig8_translations_counts": [
        Proportion("share_always", "n_always", "n_unique", "low_always", "high_always")
    ],
    r"fig4_counts|floor_rates": [
        Proportion("new_rate", "n_new", "n_common", "new_low", "new_high"),
        Proportion("lost_rate", "n_lost", "n_common", "lost_low", "lost_high"),
    ],
    r"fig1[12]_scales": [Proportion("percentage_seen", "n_seen", "n_unique", percent=True)],
    r"truth_(samplings|cosine|grid|kappas)": [_RECALL, _PRECISION],
    r"truth_causes": [Proportion("share", "n", "n_group", "low", "high")],
    r"floor_causes": [Proportion("rate", "n", "n_common", "low", "high")],
    r"figS3": [("c_um", "c * pitch")],
    r"figS4": [("error", "detected / theory - 1")],
    r"predictors_gain": [("gain", "auc - best_auc")],
}
"""What holds in which tables, by a regular expression for their names without suffix."""


def broken_relations(name: str, table: pd.DataFrame) -> list[str]:
    """Say which columns do not follow from the others of a table.

    Parameters
    ----------
    name : str
        Name of the table, without suffix.
    table : pandas.DataFrame

    Returns
    -------
    list of str
        One line per column.

    Raises
    ------
    InputError
        If it lacks a column that others follow from, or holds text instead of numbers.

    Examples
    --------
    >>> import pandas as pd
    >>> table = pd.DataFrame({"c": [0.5, 0.6], "pitch": [2.0, 3.0], "c_um": [1.0, 1.2]})
    >>> broken_relations("figS3", table)
    ['c_um does not follow from the columns beside it, first in row 2: 1.2 instead of 1.8']
    """
    problems: list[str] = []
    for pattern, relations in RELATIONS.items():
        if re.fullmatch(pattern, name):
            for relation in relations:
                if relation[0] in table:
                    for column, values in _followed(relation, table):
                        problems += _compared(column, _numbers(table, column), values)
    return problems


def _followed(
    relation: Proportion | tuple[str, str], table: pd.DataFrame
) -> Iterator[tuple[str, np.ndarray]]:
    """Columns that a relation gives, each with its values."""
    if not isinstance(relation, Proportion):
        column, expression = relation
        names = {
            str(name): table[name].to_numpy() for name in table if table[name].dtype.kind in "iuf"
        }
        yield column, np.asarray(evaluate(expression, names), dtype=float)
        return
    part, whole = (_numbers(table, name) for name in (relation.part, relation.whole))
    with np.errstate(all="ignore"):
        yield relation.share, part / whole * (100 if relation.percent else 1)
    if relation.low:
        low, high = np.full((2, len(part)), np.nan)
        known = (part >= 0) & (part <= whole) & (whole > 0)
        with np.errstate(all="ignore"):
            if known.any():
                low[known], high[known] = wilson_interval(part[known], whole[known])
        yield relation.low, low
        yield relation.high, high


def _numbers(table: pd.DataFrame, column: str) -> np.ndarray:
    if column not in table or table[column].dtype.kind not in "iuf":
        raise InputError(f"has no numbers {column}")
    return table[column].to_numpy(dtype=float)


def _compared(column: str, found: np.ndarray, expected: np.ndarray) -> Iterator[str]:
    with np.errstate(all="ignore"):
        same = np.isclose(found, expected, rtol=_RTOL, atol=_ATOL, equal_nan=True)
    if not same.all():
        row = int(np.flatnonzero(~same)[0])
        yield (
            f"{column} does not follow from the columns beside it, first in row {row + 1}: "
            f"{found[row]:.12g} instead of {expected[row]:.12g}"
        )
