"""What an audit found, in words: a page in Markdown, fit to be pasted into a report."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

import pandas as pd

from keystab.audit.conditions import BLOBS, HIGH, LOW
from keystab.audit.run import CONTROL

__all__ = ["as_table", "findings", "page"]

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
        f"Made by `{command}`. Views show {scene}; numbers are of scales from {LOW:g} to {HIGH:g} "
        "pixels. *Blobs* are isolated Gaussians at known places, spread over all sub-pixel "
        f"phases; *{PHOTOGRAPH}* are views of the scene, {_camera()}. In brackets stand 95 % "
        "intervals. `audit.csv` has all numbers, `audit_octaves.csv` the same by octave, "
        "`audit_phases.csv` how errors follow the sub-pixel phase. A convention such as "
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
        The first says its version and its conventions, or why nothing was found.
    """
    first = rows.iloc[0]
    version = f"Version {first['version']}. " if _known(first["version"]) else ""
    lines = [
        f"{version}It says `{first['convention_declared']}`, and on blobs "
        + (
            f"`{first['convention_found']}` was found."
            if _known(first["convention_found"])
            else "no convention was found."
        )
    ]
    problems = rows.loc[rows["problem"].map(_known)].groupby("problem", sort=False)["condition"]
    for problem, names in problems:
        everywhere = len(names) == len(rows)
        lines.append(f"**{_first_up(str(problem))}**" + (
            "." if everywhere else f" ({', '.join(names)})."
        ))  # fmt: skip
    measured = _by_condition(rows[rows["recall"].notna()])
    for name, where in ((BLOBS, "on blobs"), (PHOTOGRAPH, "on the scene")):
        if name in measured:
            lines += _places(measured[name], where)
    if PHOTOGRAPH in measured:
        lines += _amounts(measured[PHOTOGRAPH])
    lines += _agreement(measured)
    return lines


def _places(row: _Row, where: str) -> Iterable[str]:
    biases = [row["bias_y"], row["bias_x"]]
    if not any(map(math.isnan, biases)):
        if any(_is_biased(row, name) for name in ("bias_y", "bias_x")):
            yield (
                f"**A bias {where}**: {_px(row, 'bias_y')} down and {_px(row, 'bias_x')} right of "
                "the truth, in the median."
            )
        else:
            yield f"No bias {where}: {_px(row, 'bias_y')} down, {_px(row, 'bias_x')} right."
        yield (
            f"Error {where}: {row['error_median']:.3f} px in the median, {row['error_p90']:.3f} px "
            f"for nine in ten; {row['error_over_sigma']:.3f} sigma."
        )
    if row["phase_pattern"] in ("swapped offsets", "no offsets", "some"):
        words = {
            "swapped offsets": "**the sub-pixel offsets of y and x are swapped**",
            "no offsets": "**there is no sub-pixel offset**: positions are those of samples",
            "some": "errors depend on the sub-pixel phase",
        }[row["phase_pattern"]]
        numbers = ", ".join(f"{row[f'phase_{name}']:.2f}" for name in ("yy", "yx", "xy", "xx"))
        yield f"{_first_up(words)} {where} (samples {row['phase_step']:g} px apart: {numbers})."
    if abs(row["scale_bias"]) > _SMALL_SCALE:
        way = "large" if row["scale_bias"] > 0 else "small"
        ends = _percent_ends(row, "scale_bias")
        yield f"Scales {where} are {abs(100 * row['scale_bias']):.1f} % too {way} {ends}."
    for axis, way in (("y", "top to bottom"), ("x", "left to right")):
        low, high = row[f"drift_{axis}_low"], row[f"drift_{axis}_high"]
        if (low > _MUCH_DRIFT or high < -_MUCH_DRIFT) and not math.isnan(low):
            yield f"The error in {axis} drifts by {_px(row, f'drift_{axis}')} from {way} {where}."


def _amounts(row: _Row) -> Iterable[str]:
    yield (
        f"Of the scene's extrema it finds {_share(row, 'recall')}; chance would find "
        f"{100 * row['chance']:.1f} %. Of its keypoints {_share(row, 'precision')} are one."
    )
    if not math.isnan(row["own_recall"]):
        yield (
            "By its own definition (its ratio of blurs, the blur that it assumes, first octave): "
            f"recall {_share(row, 'own_recall')}, precision {_share(row, 'own_precision')}, error "
            f"{row['own_error_median']:.3f} px in the median."
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
        if not math.isnan(row["repeatability_1"]):
            yield (
                f"{_first_up(name)}: of the keypoints that two views could share "
                f"{_share(row, 'repeatability_0.5')} agree within half a pixel, "
                f"{_share(row, 'repeatability_1')} within one; of the {row['n_matched']:.0f} "
                f"strongest {_share(row, 'repeatability_matched')}."
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
        problem = next((each for each in own["problem"] if _known(each)), "")
        cells = [
            str(detector), str(setting),
            str(own["convention_found"].iloc[0]) if _known(own["convention_found"].iloc[0]) else "",
            _pair(blob["bias_y"], blob["bias_x"]), _number(photo["error_median"], ".3f"),
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


def _px(row: _Row, name: str) -> str:
    low, high = row[f"{name}_low"], row[f"{name}_high"]
    ends = "" if math.isnan(low) or math.isnan(high) else f" ({low:.3f} to {high:.3f})"
    return f"{row[name]:+.3f} px{ends}"


def _share(row: _Row, name: str) -> str:
    if math.isnan(row[name]):
        return "none"
    low, high = 100 * row[f"{name}_low"], 100 * row[f"{name}_high"]
    return f"{100 * row[name]:.0f} % ({low:.0f} to {high:.0f})"


def _percent_ends(row: _Row, name: str) -> str:
    low, high = 100 * row[f"{name}_low"], 100 * row[f"{name}_high"]
    return "" if math.isnan(low) or math.isnan(high) else f"({low:+.1f} to {high:+.1f})"


def _number(value: float, form: str, unit: str = "") -> str:
    return "" if math.isnan(value) else f"{value:{form}}{unit}"


def _pair(first: float, second: float) -> str:
    return "" if math.isnan(first) else f"{first:+.3f}, {second:+.3f}"
