r"""Numbers of claims over scenes: how much of a number is the scene.

Every scene gives one value of each number. Scenes are drawn, families are fixed: within family f
the values are :math:`\mu_f + e`, e of one variance for all families, which is pooled. The mean over
scenes is that of the families with equal weights, so that a family with more scenes does not count
for more; its interval is Student's, with as many degrees of freedom as scenes less families.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pandas as pd
from scipy.stats import t as student

__all__ = ["ALL", "numbers_of", "over_families"]

ALL = "all"
"""What stands for all families, of equal weights."""


def numbers_of(value: str) -> dict[str, float]:
    """Numbers of a claim as a ledger writes them; what is no number is left out.

    Examples
    --------
    >>> numbers_of("default 698; most 1434; ratio 2.054")
    {'default': 698.0, 'most': 1434.0, 'ratio': 2.054}
    >>> numbers_of("share missing: no rows")
    {}
    """
    found = {}
    for part in filter(None, value.split("; ")):
        name, _, text = part.partition(" ")
        try:
            number = float(text)
        except ValueError:
            continue
        if np.isfinite(number):
            found[name] = number
    return found


def over_families(table: pd.DataFrame) -> pd.DataFrame:
    """Mean and spread of every number, by family and over all.

    Parameters
    ----------
    table : DataFrame
        From `keystab.study.scene_verdicts.long_table`.

    Returns
    -------
    DataFrame
        ``claim, quantity, family`` (`ALL` for all), ``n_scenes, mean, sd`` between scenes of the
        family, ``low, high``, the ends of the 95 % interval of the mean, and ``least, most``, the
        smallest and the largest value. Of one scene there is neither spread nor interval.
    """
    values = pd.DataFrame(
        [
            {"claim": row["claim"], "quantity": name, "family": row["family"], "value": number}
            for row in table.to_dict("records")
            for name, number in numbers_of(row["value"]).items()
        ],
        columns=["claim", "quantity", "family", "value"],
    )
    rows = []
    for (claim, quantity), part in values.groupby(["claim", "quantity"], sort=False):
        groups = {
            str(family): own["value"].to_numpy(dtype=np.float64)
            for family, own in part.groupby("family", sort=False)
        }
        head = {"claim": claim, "quantity": quantity}
        rows += [
            {**head, "family": family, **_summary(own.mean(), {family: own})}
            for family, own in groups.items()
        ]
        mean = float(np.mean([own.mean() for own in groups.values()]))
        rows.append({**head, "family": ALL, **_summary(mean, groups)})
    names = [
        "claim",
        "quantity",
        "family",
        "n_scenes",
        "mean",
        "sd",
        "low",
        "high",
        "least",
        "most",
    ]
    return pd.DataFrame(rows, columns=names)


def _summary(mean: float, groups: Mapping[str, np.ndarray]) -> dict[str, float]:
    """Mean with the interval that the pooled spread within families gives."""
    sizes = np.array([own.size for own in groups.values()])
    freedom = int(sizes.sum() - sizes.size)
    every = np.concatenate(list(groups.values()))
    row = {"n_scenes": every.size, "mean": mean, "sd": np.nan, "low": np.nan, "high": np.nan}
    row |= {"least": every.min(), "most": every.max()}
    if freedom > 0:
        squares = sum(((own - own.mean()) ** 2).sum() for own in groups.values())
        sd = float(np.sqrt(squares / freedom))
        half = student.ppf(0.975, freedom) * sd * np.sqrt((1 / sizes).sum()) / sizes.size
        row |= {"sd": sd, "low": mean - half, "high": mean + half}
    return row
