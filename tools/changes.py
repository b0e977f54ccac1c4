"""What changed between two lists of parameters, in a person's words."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

PARAM = re.compile(
    r"'?(?P<name>[\w.]+|code of [\w.]+) = (?P<value>.*?)'?(?=,'?[\w.]+ = |,'?code of |$)"
)
SHORT = 60
"""Letters of a value that is shown as it is."""


def parameters(text: str) -> dict[str, str]:
    """Parameters of one side of a comparison by their names.

    Examples
    --------
    >>> parameters("a.b = 1,c = x y ")
    {'a.b': '1', 'c': 'x y'}
    """
    return {one["name"]: one["value"].strip() for one in PARAM.finditer(text.strip())}


def options_of(words: Sequence[str]) -> dict[str, list[str]]:
    """Options of a command with their values.

    Examples
    --------
    >>> options_of(["python", "-m", "x", "--n-spo", "3", "5", "--table", "a.csv", ">log", "2>&1"])
    {'n_spo': ['3', '5'], 'table': ['a.csv']}
    """
    found: dict[str, list[str]] = {}
    name = ""
    for word in words:
        if word.startswith(">"):
            break
        if word.startswith("--"):
            name = word.removeprefix("--").replace("-", "_")
            found[name] = []
        elif name:
            found[name].append(word)
    return found


def of_views(
    place: str, lists: Mapping[str, tuple[list[str], list[str]]], raw: Mapping[str, Any]
) -> Iterator[str]:
    """Lines on the views of a set, one value per view: what a person changed to get them.

    Parameters
    ----------
    place : str
        Place of the set in the settings.
    lists : mapping
        Values before and now, by what they are of.
    raw : mapping
        The set as a person wrote it.

    Examples
    --------
    >>> lists = {"shift_y": (["0", "-0.2", "0.2"], ["0", "-0.2"]), "blur": (["1"] * 3, ["1"] * 2)}
    >>> list(of_views("sets.translations", lists, {"n_views": 2}))
    ['sets.translations.n_views was 3 and is 2']
    >>> list(of_views("sets.zooms", {"step": (["10", "15"], ["10", "14"])}, {"n_views": 2}))
    ['sets.zooms.step was 10 15 and is 10 14']
    """
    counts = {(len(old), len(new)) for old, new in lists.values() if len(old) != len(new)}
    if counts:
        before, now = max(counts)
        if "n_views" in raw:
            yield f"{place}.n_views was {before} and is {now}"
        else:
            yield f"{place} had {before} views and has {now}"
    told: set[str] = set()
    for key, (old, new) in sorted(lists.items()):
        shared = min(len(old), len(new))
        same_ends = (old[0], old[-1]) == (new[0], new[-1])  # zooms, in more or fewer steps
        if len(old) != len(new) and (old[:shared] == new[:shared] or same_ends):
            continue  # follows from the number
        line = spread(place, key, old, new, raw) or said(
            f"{place}.{key}", *map(" ".join, (old, new))
        )
        if line not in told:
            yield line
        told.add(line)


SPREADS = {"shift_y": "shift", "shift_x": "shift", "rotation": "rotation", "blur": "blur"}
"""What spreads over the views of a set: beginning of the setting that says how far."""


def spread(
    place: str, key: str, old: Sequence[str], new: Sequence[str], raw: Mapping[str, Any]
) -> str:
    """One line on how far views spread, where that explains all values; else nothing.

    Examples
    --------
    >>> raw = {"shift_spread": 0.25, "n_views": 3}
    >>> spread("sets.a", "shift_y", ["0", "-0.25", "0.25"], ["0", "-0.125", "0.125"], raw)
    'sets.a.shift_spread was 0.5 and is 0.25'
    >>> spread("sets.a", "step", ["10", "12.2474", "15"], ["10", "11.8322", "14"], {"zoom": 1.4})
    'sets.a.zoom was 1.5 and is 1.4'
    >>> spread("sets.a", "blur", ["1", "1"], ["2", "2"], {"blur": 2})
    ''
    """
    before, now = ([float(value) for value in values] for values in (old, new))
    if key == "step" and raw.get("zoom", 1) != 1 and before[0] == now[0] > 0:
        return said(f"{place}.zoom", f"{before[-1] / before[0]:.6g}", f"{now[-1] / now[0]:.6g}")
    name = f"{SPREADS.get(key)}_spread"
    if not raw.get(name) or len(before) != len(now):
        return ""
    middle = float(raw.get(key, 0))
    factors = {
        f"{(a - middle) / (b - middle):.6g}"
        for a, b in zip(before, now, strict=True)
        if b != middle
    }
    if len(factors) != 1:
        return ""
    return said(f"{place}.{name}", f"{raw[name] * float(*factors):.6g}", f"{raw[name]:.6g}")


def said(name: str, old: str, new: str) -> str:
    """One line on a setting that was one thing and is another.

    Examples
    --------
    >>> said("detector.epsilon", "0", "1e-06")
    'detector.epsilon was 0 and is 1e-06'
    >>> said("sets.still.step", "10 10 10", "20 20 20")
    'sets.still.step was 10 and is 20'
    >>> said("samplings.n_spo", " ".join(map(str, range(3, 40))), " ".join(map(str, range(3, 38))))
    'samplings.n_spo no longer has 38 39'
    >>> many, moved = [" ".join(str(k / scale) for k in range(40)) for scale in (4, 5)]
    >>> said("sets.zooms.step", many, moved)
    'sets.zooms.step was 0.0 to 9.75 and is 0.0 to 7.8 (40 values)'
    """
    if re.fullmatch("[0-9a-f]{64}", old or new):
        return f"{name} changed"
    sides = [_joined([_digits(word) for word in text.split()]) for text in (old, new)]
    if sides[0] == sides[1]:  # but for digits that are not shown
        sides = [_joined(text.split()) for text in (old, new)]
    if max(map(len, sides)) <= SHORT:
        return f"{name} was {sides[0] or 'nothing'} and is {sides[1] or 'nothing'}"
    before, now = old.split(), new.split()
    gone, come = ([it for it in a if it not in b] for a, b in ((before, now), (now, before)))
    told = [
        f"{words} {_joined(values, SHORT)}"
        for words, values in (("no longer has", gone), ("has in addition", come))
        if values
    ]
    if len(before) == len(now) and (before[0], before[-1]) != (now[0], now[-1]):
        ends = [f"{_digits(it[0])} to {_digits(it[-1])}" for it in (before, now)]
        return f"{name} was {ends[0]} and is {ends[1]} ({len(now)} values)"
    if len(gone) + len(come) < len(before) and told:
        return f"{name} {' and '.join(told)}"
    return f"{name} was {sides[0][:50]} ... and is {sides[1][:50]} ..."


def _digits(word: str) -> str:
    """Number with at most six digits, and any other word as it is."""
    return f"{float(word):.6g}" if re.fullmatch(r"-?\d+\.\d{5,}", word) else word


def _joined(values: Sequence[str], most: int = 10**6) -> str:
    """Values in a row; one where all are the same."""
    text = values[0] if len(set(values)) == 1 else " ".join(values)
    return text if len(text) <= most else f"{text[:most]} ..."


def some(files: str) -> str:
    """Names in a row, the first two of many."""
    names = sorted(files.split(", "))
    more = f" and {len(names) - 2} more" if len(names) > 3 else ""
    shown = names[:2] if more else names
    if more or len(shown) == 1:
        return ", ".join(shown) + more
    return f"{', '.join(shown[:-1])} and {shown[-1]}"


def is_or_are(files: str) -> str:
    """Verb for names with commas between them."""
    return "are" if ", " in files else "is"


def was_or_were(files: Sequence[str]) -> str:
    """Verb for names, in the past."""
    return "was" if len(files) == 1 else "were"


def shown(path: Path) -> str:
    """A file as it is called from here."""
    here = Path.cwd()
    return path.relative_to(here).as_posix() if path.is_relative_to(here) else path.as_posix()
