"""The graph of the workflow's rules as SVG: one column per stage of the flow."""

from __future__ import annotations

import re
from html import escape

Edges = set[tuple[str, str]]

COLUMNS = ("views", "extrema", "tables", "figures and verdicts")
"""What comes out of the rules of a column."""

BOX, ROW, GAP, TOP = 150, 24, 110, 34


def edges_of(dot: str) -> Edges:
    """Read which rule feeds which, from the text of `snakemake --rulegraph dot`.

    Examples
    --------
    >>> edges_of('0[label = "all"]; 1[label = "fig1"]; 2[label = "semigroup"]; 1 -> 0; 2 -> 1')
    {('semigroup', 'fig1')}
    """
    names = dict(re.findall(r'(\d+)\[label = "(\w+)"', dot))
    edges = {(names[a], names[b]) for a, b in re.findall(r"(\d+) -> (\d+)", dot)}
    return {(a, b) for a, b in edges if b != "all" and a != b}


def without_detours(edges: Edges) -> Edges:
    """Leave out edges that a chain of other edges implies.

    Examples
    --------
    >>> sorted(without_detours({("a", "b"), ("b", "c"), ("a", "c")}))
    [('a', 'b'), ('b', 'c')]
    """
    after: dict[str, set[str]] = {}
    for a, b in edges:
        after.setdefault(a, set()).add(b)

    def reached(start: str) -> set[str]:
        found: set[str] = set()
        left = [*after.get(start, ())]
        while left:
            one = left.pop()
            if one not in found:
                found.add(one)
                left.extend(after.get(one, ()))
        return found

    beyond = {name: reached(name) for name in {b for _, b in edges}}
    return {(a, b) for a, b in edges if not any(b in beyond[c] for c in after[a] if c != b)}


def column_of(rule: str, last: set[str]) -> int:
    """Column of a rule, by the first word of its name unless it is one of the last column.

    Examples
    --------
    >>> [column_of(name, {"fig1"}) for name in ("simulate", "detect", "match_grid", "fig1")]
    [0, 1, 2, 3]
    """
    if rule in last:
        return 3
    if rule.startswith(("simulate", "scale_space")):
        return 0
    return 1 if rule.startswith(("detect", "find")) else 2


def drawn(edges: Edges, last: set[str]) -> str:
    """The graph as an SVG element.

    Parameters
    ----------
    edges : set of pairs
        From `edges_of`.
    last : set of str
        Rules of the last column.
    """
    edges = without_detours(edges)
    rules = sorted({name for edge in edges for name in edge})
    column = {name: column_of(name, last) for name in rules}
    place = _places(edges, column)
    height = TOP + ROW * max(place.values()) + ROW
    width = len(COLUMNS) * BOX + (len(COLUMNS) - 1) * GAP
    parts = [f'<svg viewBox="0 0 {width} {height:.0f}" role="img" aria-label="graph of the rules">']
    for number, title in enumerate(COLUMNS):
        middle = number * (BOX + GAP) + BOX / 2
        parts.append(f'<text class="head" x="{middle}" y="14">{escape(title)}</text>')
    for a, b in sorted(edges):
        x0, x1 = column[a] * (BOX + GAP) + BOX, column[b] * (BOX + GAP)
        y0, y1 = (TOP + ROW * (place[name] + 0.4) for name in (a, b))
        if column[a] == column[b]:  # around the right side
            x1 = x0
            bend = f"{x0 + 45} {y0:.1f} {x1 + 45} {y1:.1f}"
        else:
            bend = f"{(x0 + x1) / 2} {y0:.1f} {(x0 + x1) / 2} {y1:.1f}"
        parts.append(
            f'<path d="M{x0} {y0:.1f}C{bend} {x1} {y1:.1f}"><title>{a} to {b}</title></path>'
        )
    for name in rules:
        x, y = column[name] * (BOX + GAP), TOP + ROW * place[name]
        parts.append(
            f'<rect x="{x}" y="{y:.1f}" width="{BOX}" height="{ROW * 0.8:.1f}" rx="4"/>'
            f'<text x="{x + BOX / 2}" y="{y + ROW * 0.57:.1f}">{name}</text>'
        )
    return "".join(parts) + "</svg>"


def _places(edges: Edges, column: dict[str, int]) -> dict[str, float]:
    """Rows of the rules: beside what feeds them, in columns of the same height."""
    columns = [[name for name in sorted(column) if column[name] == k] for k in range(len(COLUMNS))]
    tallest = max(map(len, columns))
    place: dict[str, float] = {}

    def spread(names: list[str]) -> None:
        step = tallest / len(names)
        place.update({name: (k + 0.5) * step - 0.5 for k, name in enumerate(names)})

    for names in columns:
        spread(names)
    neighbours = {
        name: [b if a == name else a for a, b in edges if name in (a, b)] for name in column
    }
    for _ in range(8):  # rows follow the mean of their neighbours' rows
        for names in columns:
            means = {
                name: sum(place[one] for one in neighbours[name]) / len(neighbours[name])
                for name in names
            }
            names.sort(key=lambda name: (means[name], name))
            spread(names)
    return place
