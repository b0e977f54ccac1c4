r"""Verdicts over scenes: what of the paper holds on all kinds of scenes, and what depends on them.

The scene is the unit that is sampled: a claim holds on a scene, or does not, and intervals are over
scenes. Families of scenes are never pooled without a word: whether they differ is asked first.

Rules, written before the corpus was run, of the scenes on which a claim can be tested:

*general*
    The lower end of the 95 % Wilson interval of the share of scenes on which it holds is above 0.8.
*generally not*
    The upper end is below 0.2.
*scene-dependent*
    Neither, and families differ: Fisher's exact test of families against holding, as Freeman and
    Halton extended it, has p < 0.01 after Holm's correction for all claims that are asked.
*of no scene*
    Three scenes or more, and all give the same numbers to the last digit: it is about theory.
*undecided*
    Anything else. With one of three scenes too few to tell, more scenes would.

A claim *holds* where its verdict is "reproduced". What is reproduced with a condition, not
reproduced, or undecided within the scene's own interval does not count as holding.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from scipy.stats import multivariate_hypergeom

from keystab.errors import InputError
from keystab.evaluation.intervals import wilson_interval
from keystab.study.decisions import holm
from keystab.study.verdicts import REPRODUCED, UNTESTED

__all__ = ["GENERAL", "KINDS", "by_family", "families_differ", "long_table", "over_scenes"]

GENERAL, GENERALLY_NOT, DEPENDS, UNDECIDED, NO_SCENE, NOWHERE = (
    "general", "generally not", "scene-dependent", "undecided", "of no scene", "not testable",
)  # fmt: skip
KINDS = (GENERAL, DEPENDS, UNDECIDED, GENERALLY_NOT, NO_SCENE, NOWHERE)
"""What a claim can be over scenes, in the order of tables."""

_HOLDS, _FAILS, _LEVEL, _FEWEST = 0.8, 0.2, 0.01, 3


def long_table(reports: Mapping[str, pd.DataFrame], families: Mapping[str, str]) -> pd.DataFrame:
    """One row for every claim and scene.

    Parameters
    ----------
    reports : mapping
        Report of each scene, see `keystab.study.claims_report.to_table`, in the order of rows.
    families : mapping
        Family of each scene.

    Returns
    -------
    DataFrame
        ``claim, scene, family, verdict, value``.

    Raises
    ------
    InputError
        If scenes were not asked the same claims with the same criteria.
    """
    if not reports:
        raise InputError("no scene has verdicts yet: run make scenes")
    first = next(iter(reports.values()))[["id", "criterion"]]
    parts = []
    for scene, report in reports.items():
        if (
            not report[["id", "criterion"]]
            .reset_index(drop=True)
            .equals(first.reset_index(drop=True))
        ):
            raise InputError(
                f"{scene}: its claims or criteria are not those of the other scenes: make all "
                "from one config/claims.yaml"
            )
        part = report[["id", "verdict", "value"]].rename(columns={"id": "claim"})
        parts.append(part.assign(scene=scene, family=families[scene]))
    order = {name: number for number, name in enumerate(first["id"])}
    whole = pd.concat(parts, ignore_index=True)
    whole = whole.iloc[np.argsort(whole["claim"].map(order).to_numpy(), kind="stable")]
    return whole[["claim", "scene", "family", "verdict", "value"]].reset_index(drop=True)


def families_differ(sizes: Sequence[int], held: Sequence[int]) -> float:
    """P-value of Fisher's exact test of families against holding, after Freeman and Halton.

    Parameters
    ----------
    sizes : sequence of int
        Scenes of each family.
    held : sequence of int
        Those of them on which the claim holds.

    Returns
    -------
    float
        Probability, given all margins, of what is seen and of all that is no more probable.

    Examples
    --------
    >>> round(families_differ([6, 6], [6, 0]), 5)  # 2 of 924 ways
    0.00216
    """
    law = multivariate_hypergeom(m=list(sizes), n=int(sum(held)))
    ways = np.indices([n + 1 for n in sizes]).reshape(len(sizes), -1).T
    possible = law.pmf(ways[ways.sum(axis=1) == sum(held)])
    seen = law.pmf(list(held))
    return float(min(possible[possible <= seen * (1 + 1e-9)].sum(), 1.0))


def over_scenes(table: pd.DataFrame) -> pd.DataFrame:
    """What every claim is over scenes.

    Parameters
    ----------
    table : DataFrame
        From `long_table`.

    Returns
    -------
    DataFrame
        In the order of the claims: ``claim``; ``kind``, one of `KINDS`; ``n_scenes`` that could be
        tested, ``n_holds``, ``share`` and its Wilson interval ``low, high``; ``p_families`` after
        Holm's correction; and ``FAMILY_n, FAMILY_holds`` for every family.
    """
    families = list(dict.fromkeys(table["family"]))
    rows = []
    for claim, part in table.groupby("claim", sort=False):
        tested = part[part["verdict"] != UNTESTED]
        holds = (tested["verdict"] == REPRODUCED).to_numpy()
        low, high = wilson_interval(int(holds.sum()), max(len(holds), 1))
        own = [holds[(tested["family"] == family).to_numpy()] for family in families]
        sizes, held = [len(each) for each in own], [int(each.sum()) for each in own]
        same = len(holds) >= _FEWEST and tested["value"].nunique() == 1
        row = {"claim": claim, "same": same, "n_scenes": len(holds), "n_holds": sum(held)}
        row |= dict.fromkeys(("share", "low", "high", "p_families"), np.nan)
        if len(holds):
            row |= {"share": holds.mean(), "low": float(low), "high": float(high)}
            row["p_families"] = families_differ(sizes, held)
        for family, n, k in zip(families, sizes, held, strict=True):
            row |= {f"{family}_n": n, f"{family}_holds": k}
        rows.append(row)
    found = pd.DataFrame(rows)
    known = found["p_families"].notna()
    found.loc[known, "p_families"] = holm(found.loc[known, "p_families"].tolist())
    found.insert(1, "kind", [_kind(row) for row in found.to_dict("records")])
    return found.drop(columns="same")


def by_family(found: pd.DataFrame) -> pd.DataFrame:
    """What `over_scenes` says of families, one row for every claim and family.

    Returns
    -------
    DataFrame
        ``claim, family, n_scenes, n_holds``.
    """
    families = [
        str(name).removesuffix("_holds")
        for name in found
        if str(name).endswith("_holds") and name != "n_holds"
    ]
    parts = [
        pd.DataFrame(
            {
                "claim": found["claim"],
                "family": family,
                "n_scenes": found[f"{family}_n"],
                "n_holds": found[f"{family}_holds"],
            }
        )
        for family in families
    ]
    return pd.concat(parts, ignore_index=True)


def _kind(row: Mapping[Any, Any]) -> str:
    if not row["n_scenes"]:
        return NOWHERE
    if row["same"]:
        return NO_SCENE
    if row["low"] > _HOLDS:
        return GENERAL
    if row["high"] < _FAILS:
        return GENERALLY_NOT
    return DEPENDS if row["p_families"] < _LEVEL else UNDECIDED
