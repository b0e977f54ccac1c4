"""The numbers of claims in words: what they are called, and where they come from."""

from __future__ import annotations

import re

from keystab.study.claims import Quantity

COLUMNS = {
    "n_spo": "n_spo",
    "delta_min": "delta_min",
    "max_offset": "M_offset",
    "max_iterations": "N_interp",
    "percentage_of_unique": "percentage of the unique keypoints",
    "percentage_of_images": "percentage of the views",
    "percentage_seen": "percentage seen often enough",
    "share_always": "share seen in all",
    "share_found": "share found again",
    "share_right": "share that is right",
    "share_accepted": "share that the refinement accepts",
    "share_duplicates": "share of duplicates",
    "new_rate": "rate of new extrema",
    "lost_rate": "rate of lost extrema",
    "auc": "area under the ROC curve",
    "held": "share held",
    "c": "camera blur c",
    "blur": "camera blur c",
    "blur_spread": "spread of the blur",
    "sigma_from": "first scale",
    "rms_location": "root mean square distance",
    "median_location": "median distance",
    "mean_above": "keypoints above the scale",
    "f_number": "f-number",
}
"""Columns whose names are short for something; others are read as they stand."""

TAKES = {
    "one": "",
    "max": "largest",
    "min": "smallest",
    "mean": "mean of",
    "median": "median of",
    "sample_median": "median of",
    "sum": "sum of",
    "pooled": "all together:",
    "share": "share with",
}
"""How many numbers become one."""

_SIGNS = {"<=": "≤", ">=": "≥", "==": "=", "!=": "≠", "**": "^", "*": "×"}
_NAMES = {"dog": "DoG", "dct": "DCT", "sift": "SIFT", "roc": "ROC", "1d": "1D", "2d": "2D"}
_KEPT = ("n_spo", "delta_min", "sigma_min")
_WORD = re.compile(r"[A-Za-z_]\w*")


def words(name: str) -> str:
    """Name of a number in words.

    Examples
    --------
    >>> words("right_at_densest"), words("at_0p5"), words("at_n_spo"), words("fine_scales_dog")
    ('right at densest', 'at 0.5', 'at n_spo', 'fine scales DoG')
    """
    for kept in _KEPT:
        name = re.sub(rf"(?<![a-z]){kept}(?![a-z])", kept.replace("_", "\0"), name)
    text = re.sub(r"(\d)p(\d)", r"\1.\2", name).replace("_", " ")
    return " ".join(_NAMES.get(part, part) for part in text.split(" ")).replace("\0", "_")


def said(expression: str) -> str:
    """Criterion or formula, with the names of its numbers in words.

    Examples
    --------
    >>> said("most_all <= 1.1 * least_all and seen_in_all_views < 1")
    'most all ≤ 1.1 × least all and seen in all views < 1'
    """
    return _signs(_WORD.sub(lambda found: words(found[0]), expression))


def _column(expression: str) -> str:
    """Columns in words; several in a formula stay readable as one."""
    return _signs(_WORD.sub(lambda found: _column_words(found[0]), expression))


def _column_words(name: str) -> str:
    if name in COLUMNS:
        return COLUMNS[name]
    return f"number of {words(name[2:])}" if name.startswith("n_") else words(name)


def _signs(text: str) -> str:
    for sign, shown in _SIGNS.items():
        text = text.replace(sign, shown)
    return text.replace(" - ", " − ")


def origin(quantity: Quantity) -> str:
    """Where a number comes from, in a line.

    Examples
    --------
    >>> origin(Quantity("most_all", "max(a_b, c)"))
    'max(a b, c)'
    >>> rows = "detections == 'discrete' and n_spo >= 14"
    >>> origin(Quantity("new", "", ("fig4_counts",), rows, "new_rate", "last n_spo"))
    'rate of new extrema at the last n_spo; discrete, n_spo ≥ 14 (fig4_counts.csv)'
    """
    if quantity.expression:
        return said(quantity.expression)
    take, _, by = quantity.take.partition(" ")
    column, by = _column(quantity.column), _column_words(by)
    if by:
        kinds = {
            "argmax": f"{by} of the largest {column}",
            "largest_step": f"largest step of {column} from one {by} to the next",
            "smallest_step": f"smallest step of {column} from one {by} to the next",
        }
        text = kinds.get(take, f"{column} at the {take} {by}")
    else:
        text = f"{TAKES.get(take, take)} {column}".strip()
    rows = re.sub(r"\w+ == '([^']*)'", r"\1", quantity.rows)
    where = f"; {_column(rows).replace(' and ', ', ')}" if rows else ""
    tables = ", ".join(f"{name}.csv" for name in quantity.tables)
    return f"{text}{where} ({tables})"


def shown(value: float | str | None) -> str:
    """Write a number for people: three digits, or all of a whole number.

    Examples
    --------
    >>> shown(-0.123456), shown(12345.0), shown(None), shown("inf")
    ('−0.123', '12345', 'missing', '∞')
    """
    if value is None:
        return "missing"
    if isinstance(value, str):
        return value.replace("inf", "∞")
    whole = value == round(value) if abs(value) < 1e15 else False
    text = f"{value:.0f}" if whole or 1e3 <= abs(value) < 1e6 else f"{value:.3g}"
    return text.replace("-", "−")
