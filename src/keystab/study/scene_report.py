"""What claims are over scenes, for people."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import pandas as pd

from keystab.study.claims_by_scene import runs_table
from keystab.study.claims_report import cell
from keystab.study.scene_verdicts import (
    DEPENDS,
    GENERAL,
    GENERALLY_NOT,
    KINDS,
    NO_SCENE,
    NOWHERE,
    UNDECIDED,
)

__all__ = ["to_markdown"]

_SAID = {
    GENERAL: "hold on all kinds of scenes (the lower end of the interval is above 0.8)",
    DEPENDS: "depend on the family (exact test, corrected for all claims, p below 0.01)",
    UNDECIDED: "are undecided: neither, with so many scenes",
    GENERALLY_NOT: "hold on hardly any scene (the upper end of the interval is below 0.2)",
    NO_SCENE: "are about theory: all scenes give the same numbers",
    NOWHERE: "could be tested on no scene",
}


def to_markdown(
    claims: pd.DataFrame, statements: Mapping[str, str], runs: Mapping[str, str]
) -> str:
    """Write what `keystab.study.scene_verdicts.over_scenes` found.

    Parameters
    ----------
    claims : DataFrame
    statements : mapping
        What each claim says.
    runs : mapping
        Run of each scene, see `keystab.study.claims_by_scene.run_of`.

    Returns
    -------
    str
        One table for every kind of verdict, in the order of `KINDS`, and one of the runs.
    """
    names = [str(name) for name in claims if str(name).endswith("_holds")]
    families = [name.removesuffix("_holds") for name in names if name != "n_holds"]
    sizes = ", ".join(f"{int(claims[f'{name}_n'].max())} {name}" for name in families)
    lines = [
        "# What holds on which scenes",
        "",
        f"Verdicts on {int(claims['n_scenes'].max())} scenes: {sizes}.",
        "A claim holds on a scene where its verdict there is *reproduced*; intervals are Wilson's,",
        "at 95 %, over scenes. The [runs](#runs) stand at the end.",
        "",
        "| | claims |",
        "|---|---|",
        *(f"| {kind} | {(claims['kind'] == kind).sum()} |" for kind in KINDS),
    ]
    for kind in KINDS:
        rows = claims[claims["kind"] == kind]
        if rows.empty:
            continue
        lines += ["", f"## {kind.capitalize()}", "", f"These {_SAID[kind]}.", ""]
        lines.append(f"| claim | it says | holds | {' | '.join(families)} |")
        lines.append(f"|---|---|---|{'---|' * len(families)}")
        lines += [_row(row, statements, families) for row in rows.to_dict("records")]
    lines += ["", "## Runs", "", *runs_table("scene", runs)]
    return "\n".join(lines) + "\n"


def _row(row: Mapping[Any, Any], statements: Mapping[str, str], families: list[str]) -> str:
    holds = "-"
    if row["n_scenes"]:
        holds = f"{row['n_holds']} of {row['n_scenes']} ({row['low']:.2f} to {row['high']:.2f})"
    cells = [f"`{row['claim']}`", statements[row["claim"]], holds]
    cells += [
        f"{row[f'{name}_holds']} of {row[f'{name}_n']}" if row[f"{name}_n"] else "-"
        for name in families
    ]
    return f"| {' | '.join(map(cell, cells))} |"
