"""What an audit found, in words: a page in Markdown, fit to be pasted into a report."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from typing import Any

import pandas as pd

from keystab._version import __version__
from keystab.audit.conditions import BLOBS, HIGH, LOW
from keystab.audit.run import CONTROL

__all__ = ["are_axes_swapped", "as_table", "findings", "page"]

PHOTOGRAPH = "translations"
_TURNED, _NOISY = "rotation 90", "noise 0.03"

_Row = dict[str, Any]

_SMALL_BIAS, _SMALL_SCALE, _MUCH_DRIFT = 0.02, 0.03, 0.05


def page(table: pd.DataFrame, command: str, scene: str, figure: str = "audit.png") -> str:
    """Write the page of an audit.

    Parameters
    ----------
    table : DataFrame
        `keystab.audit.run.Tables.audit`.
    command : str
        What was typed.
    scene : str
        What the views show.
    figure : str
        Path of the figure, from the page.

    Returns
    -------
    str
        Markdown.
    """
    parts = [
        "# An audit of detectors",
        f"Made by `{command}`, keystab {__version__}. Views show {scene}; numbers are of scales "
        f"from {LOW:g} to {HIGH:g} pixels. *Blobs* are isolated Gaussians at known places, spread "
        f"over all sub-pixel phases; *{PHOTOGRAPH}* are views of the scene, {_camera()}. In "
        "brackets stand 95 % intervals. `audit.csv` has all numbers, `audit_octaves.csv` the same "
        "by octave, `audit_phases.csv` how errors follow the sub-pixel phase. A convention such as "
        "`0 yx sigma` says where the centre of the first pixel is, which coordinate comes first "
        "and what a scale is; *at matched number* means of the strongest keypoints, as many for "
        "every detector. docs/audit.md of keystab says how to read the rest.",
        f"![Bias, errors, recall and repeatability]({figure})",
        "## Controls",
        "Made of the truth itself: what the measures say where the answer is known.",
        as_table(table[table["detector"] == CONTROL]),
        "## Detectors",
        as_table(table[table["detector"] != CONTROL]),
    ]
    for (detector, setting), rows in table[table["detector"] != CONTROL].groupby(
        ["detector", "setting"], sort=False
    ):
        parts.append(f"### {detector}, {setting}")
        parts.append("\n".join(f"- {line}" for line in findings(rows)))
    return "\n\n".join(parts) + "\n"


def findings(rows: pd.DataFrame) -> list[str]:
    """What was found of one detector with one setting, in sentences.

    Parameters
    ----------
    rows : DataFrame
        Its rows of `keystab.audit.run.Tables.audit`.

    Returns
    -------
    list of str
        The first says that its axes are swapped, where they are; else its version and its
        conventions, or why nothing was found. Numbers without an interval are left out.
    """
    (first,) = _by_condition(rows.iloc[:1]).values()
    swapped = are_axes_swapped(first["convention_declared"], first["convention_found"])
    version = f"Version {first['version']}." if _known(first["version"]) else ""
    conventions = f"It says `{first['convention_declared']}`, and on blobs " + (
        f"`{first['convention_found']}` was found."
        if _known(first["convention_found"])
        else "no convention was found."
    )
    lines = [_advice(first)] if swapped else []
    failed = rows["problem"].map(_known).all()
    lines += filter(None, [" ".join(filter(None, [version, "" if failed else conventions]))])
    problems = rows.loc[rows["problem"].map(_known)].groupby("problem", sort=False)["condition"]
    for problem, names in problems:
        everywhere = len(names) == len(rows)
        lines.append(f"**{_first_up(str(problem))}**" + (
            "." if everywhere else f" ({', '.join(names)})."
        ))  # fmt: skip
    if swapped:
        return lines
    measured = _by_condition(rows[rows["recall"].notna()])
    for name, where in ((BLOBS, "on blobs"), (PHOTOGRAPH, "on the scene")):
        if name in measured:
            lines += _places(measured[name], where)
            lines += _drifts(measured[name], where, measured.get(BLOBS))
    if PHOTOGRAPH in measured:
        lines += _amounts(measured[PHOTOGRAPH])
    lines += _agreement(measured)
    return lines


def are_axes_swapped(declared: Any, found: Any) -> bool:
    """Whether on blobs another order of the axes was found than a detector declares.

    Parameters
    ----------
    declared, found : str
        ``convention_declared`` and ``convention_found``; anything else is not known.

    Examples
    --------
    >>> are_axes_swapped("0 yx sigma", "0 xy sigma"), are_axes_swapped("0 yx sigma", "")
    (True, False)
    """
    orders = [re.findall(r"\b(?:yx|xy)\b", str(each)) for each in (declared, found)]
    return all(orders) and orders[0] != orders[1]


def _advice(row: _Row) -> str:
    """What to do where axes are swapped."""
    origin, order, *scale = str(row["convention_declared"]).split()
    right = f"{origin},{order[::-1]},{scale[0]}"
    return (
        f"**Its axes are swapped: audit again with `--convention {right}`**, or, where it names "
        "its columns, exchange what stands under y and x. Its other numbers say nothing before."
    )


def _places(row: _Row, where: str) -> Iterable[str]:
    if not _has_interval(row, "bias_y", "bias_x"):
        yield f"Too few of those {where} are found to say how far off they are."
    else:
        if any(_is_biased(row, name) for name in ("bias_y", "bias_x")):
            yield (
                f"**A bias {where}**: {_px(row, 'bias_y')} down and {_px(row, 'bias_x')} right of "
                "the truth, in the median."
            )
        else:
            yield f"No bias {where}: {_px(row, 'bias_y')} down, {_px(row, 'bias_x')} right."
        most = _has_interval(row, "error_p90")
        yield (
            f"Error {where}: {row['error_median']:.3f} px in the median"
            + (f", {row['error_p90']:.3f} px for nine in ten" if most else "")
            + f"; {row['error_over_sigma']:.3f} sigma."
        )
    if row["phase_pattern"] in ("swapped offsets", "no offsets", "some"):
        words = {
            "swapped offsets": "**the sub-pixel offsets of y and x are swapped**",
            "no offsets": "**there is no sub-pixel offset**: positions are those of samples",
            "some": "errors depend on the sub-pixel phase",
        }[row["phase_pattern"]]
        numbers = ", ".join(f"{row[f'phase_{name}']:.2f}" for name in ("yy", "yx", "xy", "xx"))
        yield f"{_first_up(words)} {where} (samples {row['phase_step']:g} px apart: {numbers})."
    if abs(row["scale_bias"]) > _SMALL_SCALE and _has_interval(row, "scale_bias"):
        way = "large" if row["scale_bias"] > 0 else "small"
        ends = f"({100 * row['scale_bias_low']:+.1f} to {100 * row['scale_bias_high']:+.1f})"
        yield f"Scales {where} are {abs(100 * row['scale_bias']):.1f} % too {way} {ends}."


def _drifts(row: _Row, where: str, blobs: _Row | None) -> Iterable[str]:
    """Drifts; on a scene, whose extrema are few and no two alike, those that blobs show too."""
    for axis, way in (("y", "top to bottom"), ("x", "left to right")):
        low, high = row[f"drift_{axis}_low"], row[f"drift_{axis}_high"]
        least, most = low, high
        if blobs is not None and _has_interval(blobs, f"drift_{axis}"):
            least, most = blobs[f"drift_{axis}_low"], blobs[f"drift_{axis}_high"]
        if (low > _MUCH_DRIFT and least > 0) or (high < -_MUCH_DRIFT and most < 0):
            yield f"The error in {axis} drifts by {_px(row, f'drift_{axis}')} from {way} {where}."


def _amounts(row: _Row) -> Iterable[str]:
    yield (
        f"Of the scene's extrema it finds {_share(row, 'recall')}; chance would find "
        f"{100 * row['chance']:.1f} %. Of its keypoints {_share(row, 'precision')} are one."
    )
    if not math.isnan(row["own_recall"]):
        yield (
            "By its own definition (its ratio of blurs, the blur that it assumes, first octave): "
            f"recall {_share(row, 'own_recall')}, precision {_share(row, 'own_precision')}"
            + (
                f", error {row['own_error_median']:.3f} px in the median."
                if _has_interval(row, "own_error_median")
                else "."
            )
        )
    if row["precision_high"] < 2 * row["chance"]:
        yield "**Its keypoints are hardly better than chance.**"
    if row["duplicates"] >= 0.5:
        yield (
            f"Beside {row['n_keypoints']:.0f} keypoints it reports {row['duplicates']:.0f} copies "
            "of them (other orientations, or twice the same)."
        )
    if row["seam_deficit_low"] > 0:
        yield (
            f"Within an eighth of an octave of {row['seam_at']:.2f} px times powers of 2 it finds "
            f"{100 * row['seam_deficit']:.0f} percentage points less: where its octaves meet, or "
            "begin."
        )


def _agreement(measured: dict[str, _Row]) -> Iterable[str]:
    for name in (_TURNED, _NOISY):
        row = measured.get(name, {"repeatability_1": math.nan})
        known = not math.isnan(row.get("repeatability_matched", math.nan))
        if not math.isnan(row["repeatability_1"]):
            matched = _share(row, "repeatability_matched")
            yield (
                f"{_first_up(name)}: of the keypoints that two views could share "
                f"{_share(row, 'repeatability_0.5')} agree within half a pixel, "
                f"{_share(row, 'repeatability_1')} within one"
                + (f"; of the {row['n_matched']:.0f} strongest {matched}." if known else ".")
            )
            if not math.isnan(row["coverage_90"]):
                yield f"{_first_up(name)}: its 90 % ellipses hold {_share(row, 'coverage_90')}."


def as_table(rows: pd.DataFrame) -> str:
    """A few numbers of each setting, on blobs and on the scene, side by side.

    Parameters
    ----------
    rows : DataFrame
        Rows of `keystab.audit.run.Tables.audit`.

    Returns
    -------
    str
        A table in Markdown.
    """
    head = [
        "detector", "setting", "convention found", "bias on blobs (y, x; px)",
        "median error (px)", "recall", "precision", "repeatability, 1 px, turned by 90 degrees",
        "at matched number", "problem",
    ]  # fmt: skip
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    for (detector, setting), own in rows.groupby(["detector", "setting"], sort=False):
        by = _by_condition(own)
        nothing: _Row = dict.fromkeys(own.columns, math.nan)
        blob, photo, turned = (by.get(name, nothing) for name in (BLOBS, PHOTOGRAPH, _TURNED))
        swapped = are_axes_swapped(*own[["convention_declared", "convention_found"]].iloc[0])
        off = [
            _has_interval(row, *names) and not swapped
            for row, names in ((blob, ("bias_y", "bias_x")), (photo, ("error_median",)))
        ]
        problem = next((each for each in own["problem"] if _known(each)), "")
        cells = [
            str(detector), str(setting),
            str(own["convention_found"].iloc[0]) if _known(own["convention_found"].iloc[0]) else "",
            f"{blob['bias_y']:+.3f}, {blob['bias_x']:+.3f}" if off[0] else "",
            f"{photo['error_median']:.3f}" if off[1] else "",
            _number(100 * photo["recall"], ".0f", " %"),
            _number(100 * photo["precision"], ".0f", " %"),
            _number(100 * turned["repeatability_1"], ".0f", " %"),
            _number(100 * turned["repeatability_matched"], ".0f", " %"),
            str(problem).replace("|", "/"),
        ]  # fmt: skip
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)


def _by_condition(rows: pd.DataFrame) -> dict[str, _Row]:
    return {
        row["condition"]: {str(name): value for name, value in row.items()}
        for row in rows.to_dict("records")
    }


def _camera() -> str:
    return "noiseless, camera blur 0.5 px, moved by fractions of a pixel"


def _known(value: Any) -> bool:
    return isinstance(value, str) and bool(value)


def _first_up(text: str) -> str:
    at = 2 if text.startswith("**") else 0
    return text[:at] + text[at : at + 1].upper() + text[at + 1 :]


def _is_biased(row: _Row, name: str) -> bool:
    """Whether a bias is larger than what matters, and beyond its interval where it has one."""
    low, high = row[f"{name}_low"], row[f"{name}_high"]
    return abs(row[name]) > _SMALL_BIAS and not low <= 0 <= high


def _has_interval(row: _Row, *names: str) -> bool:
    """Whether numbers have intervals: what comes from a few matches has none."""
    return not any(math.isnan(row[f"{name}{end}"]) for name in names for end in ("_low", "_high"))


def _px(row: _Row, name: str) -> str:
    return f"{row[name]:+.3f} px ({row[f'{name}_low']:.3f} to {row[f'{name}_high']:.3f})"


def _share(row: _Row, name: str) -> str:
    if math.isnan(row[name]):
        return "none"
    low, high = 100 * row[f"{name}_low"], 100 * row[f"{name}_high"]
    return f"{100 * row[name]:.0f} % ({low:.0f} to {high:.0f})"


def _number(value: float, form: str, unit: str = "") -> str:
    return "" if math.isnan(value) else f"{value:{form}}{unit}"
