"""Claims: what the paper says and how it is tested, as the file of claims has them.

A claim is a statement of the paper with named numbers, each taken from a table of the study, and a
criterion over these numbers that was written down from the paper's words.
`keystab.study.verdicts` computes the numbers, asks the criterion, and gives one of four verdicts.
"""

from __future__ import annotations

import os
import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from typing import Any, NamedTuple

from keystab.errors import InputError
from keystab.study.expressions import CALLS, CONSTANTS, names_of
from keystab.study.plain_yaml import read_plain_yaml

__all__ = [
    "Claim",
    "Quantity",
    "deciding",
    "has_intervals",
    "parse_claims",
    "read_claims",
    "table_names",
]


class Quantity(NamedTuple):
    """One named number of a claim: taken from a table, or computed from the numbers before it.

    Parameters
    ----------
    name : str
        What criteria call it.
    expression : str
        Over quantities that come before it; empty for one that is taken from a table.
    tables : tuple of str
        Names of tables without suffix. Several are joined on the columns that they share.
    rows : str
        Expression over columns that says which rows count; empty for all.
    column : str
        Expression over columns: the numbers to take from.
    take : str
        How many numbers become one, see `keystab.study.verdicts.measured`.
    low, high : str
        Expressions over columns: the ends of the interval of `column`; empty where there are none.
    by : str
        Column of what rows of a share belong to, or of what they are counted of.
    """

    name: str
    expression: str = ""
    tables: tuple[str, ...] = ()
    rows: str = ""
    column: str = ""
    take: str = ""
    low: str = ""
    high: str = ""
    by: str = ""


class Claim(NamedTuple):
    """A statement of the paper and how it is tested.

    `criterion` is empty for what cannot be tested; `note` then says why. `condition` is a weaker
    criterion, and `condition_words` says what it asks. `uncertainty` says why no number that
    decides has an interval, where none has: "exact" or "descriptive", and a reason.
    """

    id: str
    where: str
    statement: str
    figure: str
    paper: str
    quantities: tuple[Quantity, ...] = ()
    criterion: str = ""
    condition: str = ""
    condition_words: str = ""
    note: str = ""
    uncertainty: str = ""

    @property
    def tables(self) -> tuple[str, ...]:
        """Names of the tables that its quantities are taken from, each once."""
        return tuple(dict.fromkeys(name for part in self.quantities for name in part.tables))


_TAKES_OF_SAMPLES = ("share", "pooled", "sample_mean", "sample_median")
_TAKES = ("one", "mean", "median", "min", "max", "sum", *_TAKES_OF_SAMPLES)
_TAKES_ALONG = ("first", "last", "argmax", "argmin", "largest_step", "smallest_step")

_TEXTS = ("id", "where", "statement", "paper")
_KNOWN = {*_TEXTS, "figure", "value", "criterion", "condition", "note", "reason"}
_KNOWN |= {"uncertainty"}
_KNOWN_OF_QUANTITY = {"table", "where", "column", "take", "low", "high", "by"}


def read_claims(path: str | os.PathLike[str]) -> list[Claim]:
    """Read and check the file of claims.

    Parameters
    ----------
    path : path
        A YAML list; ``config/claims.yaml`` explains its entries.

    Raises
    ------
    InputError
        In one line that names the claim, if anything in it cannot work.
    """
    entries = read_plain_yaml(path)
    try:
        return parse_claims(entries)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None


def parse_claims(entries: Any) -> list[Claim]:
    """Turn the entries of a file of claims into claims, after checking them.

    Examples
    --------
    >>> entry = {"id": "half", "where": "section 1", "statement": "Half stay.", "paper": "50 %"}
    >>> entry["value"] = {"stay": {"table": "fig1", "column": "stays", "take": "share"}}
    >>> (claim,) = parse_claims([entry | {"criterion": "0.45 <= stay <= 0.55"}])
    >>> claim.tables
    ('fig1',)
    >>> parse_claims([entry | {"criterion": "left > 0.5"}])
    Traceback (most recent call last):
    keystab.errors.InputError: claim half: criterion uses left, which value does not define
    """
    if not isinstance(entries, list) or not entries:
        raise InputError("a list of claims is needed")
    claims: list[Claim] = []
    for number, entry in enumerate(entries, 1):
        name = entry.get("id") if isinstance(entry, dict) else None
        try:
            claim = _claim(entry)
            if claim.id in {other.id for other in claims}:
                raise InputError("the id is used twice; give another")
        except InputError as error:
            raise InputError(f"claim {name or f'number {number}'}: {error}") from None
        claims.append(claim)
    return claims


def _claim(entry: Any) -> Claim:
    """Check one entry."""
    if not isinstance(entry, dict):
        raise InputError("is no block of fields")
    _only(entry, _KNOWN)
    name, where, statement, paper = (_text(entry, field) for field in _TEXTS)
    if not re.fullmatch(r"[a-z0-9]+(-[a-z0-9]+)*", name):
        raise InputError("id: use small letters, digits and single hyphens")
    claim = Claim(name, where, statement, _text(entry, "figure", needed=False), paper)
    if ("criterion" in entry) == ("reason" in entry):
        raise InputError("give either a criterion, or a reason why there is none")
    if "reason" in entry:
        extra = sorted({"value", "condition", "note", "uncertainty"} & set(entry))
        if extra:
            raise InputError(f"has a reason why it is not tested, and so needs no {extra[0]}")
        return claim._replace(note=_text(entry, "reason"))
    quantities = _quantities(entry.get("value"))
    names = [part.name for part in quantities]
    claim = claim._replace(
        quantities=quantities,
        criterion=_over(names, _text(entry, "criterion"), "criterion"),
        note=_text(entry, "note", needed=False),
        uncertainty=_text(entry, "uncertainty", needed=False),
    )
    _check_uncertainty(claim)
    if "condition" not in entry:
        return claim
    condition = entry["condition"]
    if not isinstance(condition, dict):
        raise InputError("condition: give its criterion and its words")
    _only(condition, {"criterion", "words"})
    return claim._replace(
        condition=_over(names, _text(condition, "criterion"), "condition"),
        condition_words=_text(condition, "words"),
    )


def _check_uncertainty(claim: Claim) -> None:
    """Refuse words about why nothing has an interval that are not needed, or say nothing."""
    if claim.uncertainty and has_intervals(deciding(claim)):
        raise InputError("uncertainty: what decides has intervals; leave it out")
    if claim.uncertainty and not re.match(r"(exact|descriptive): \S", claim.uncertainty):
        raise InputError("uncertainty: write 'exact: ' or 'descriptive: ' and why, nothing else")


def deciding(claim: Claim) -> list[Quantity]:
    """Numbers taken from tables that the criterion of a claim goes back to.

    Examples
    --------
    >>> parts = (Quantity("a", take="one"), Quantity("b", take="one"), Quantity("c", "2 * a"))
    >>> [part.name for part in deciding(Claim("", "", "", "", "", parts, "c > 1"))]
    ['a']
    """
    parts = {part.name: part for part in claim.quantities}
    found: dict[str, Quantity] = {}
    wanted = sorted(names_of(claim.criterion)) if claim.criterion else []
    while wanted:
        part = parts[wanted.pop(0)]
        if part.expression:
            wanted += sorted(names_of(part.expression))
        else:
            found[part.name] = part
    return list(found.values())


def has_intervals(quantities: Iterable[Quantity]) -> bool:
    """Whether any of some numbers is taken with an interval."""
    return any(part.low or part.take in _TAKES_OF_SAMPLES for part in quantities)


def _quantities(value: Any) -> tuple[Quantity, ...]:
    """Check the named numbers of one entry."""
    if not isinstance(value, dict) or not value:
        raise InputError("value: name the numbers that the criterion is about")
    found: list[Quantity] = []
    for name, given in value.items():
        if not (isinstance(name, str) and name.isidentifier()) or name in (*CALLS, *CONSTANTS):
            raise InputError(f"value: {name!r} cannot be the name of a number")
        if isinstance(given, str):
            before = [part.name for part in found]
            found.append(Quantity(name, expression=_over(before, given, f"value {name}")))
        elif isinstance(given, dict):
            found.append(_taken(name, given))
        else:
            raise InputError(f"value {name}: give an expression, or table, column and take")
    return tuple(found)


def _taken(name: str, given: Mapping[str, Any]) -> Quantity:
    """Check a number that is taken from a table."""
    try:
        _only(given, _KNOWN_OF_QUANTITY)
        tables = given.get("table")
        tables = [tables] if isinstance(tables, str) else tables
        if not isinstance(tables, list) or not tables:
            raise InputError("table: name one table, or a list of tables to join")
        for table in tables:
            if not isinstance(table, str) or not re.fullmatch(r"\w+", table):
                raise InputError(f"table: {table!r} is no name of a table; leave out the suffix")
        texts = [key for key in given if key != "table"]
        fields = {key: _text(given, key, key in ("column", "take")) for key in texts}
        quantity = Quantity(
            name,
            tables=tuple(tables),
            rows=fields.get("where", ""),
            column=fields.get("column", ""),
            take=fields.get("take", ""),
            low=fields.get("low", ""),
            high=fields.get("high", ""),
            by=fields.get("by", ""),
        )
        for needed in ("column", "take"):
            if needed not in given:
                raise InputError(f"lacks {needed}")
        for expression in (quantity.rows, quantity.column, quantity.low, quantity.high):
            if expression:
                names_of(expression)
        how, *along = quantity.take.split()
        if not ((how in _TAKES and not along) or (how in _TAKES_ALONG and len(along) == 1)):
            alone = ", ".join(_TAKES)
            raise InputError(
                f"take: {quantity.take!r}, allowed is {alone}, or one of {', '.join(_TAKES_ALONG)} "
                "with a column"
            )
        if bool(quantity.low) != bool(quantity.high):
            raise InputError("low and high go together: give both or neither")
        if quantity.low and how in ("mean", "median", "sum", *_TAKES_OF_SAMPLES):
            raise InputError(f"take: {how} has no row whose low and high could be taken")
        if (how == "pooled") > bool(quantity.by) or quantity.by and how not in ("share", "pooled"):
            raise InputError("by: pooled needs it, share may have it, other takes have none")
    except InputError as error:
        raise InputError(f"value {name}: {error}") from None
    return quantity


def _only(entry: Mapping[str, Any], known: Collection[str]) -> None:
    unknown = [str(field) for field in entry if field not in known]
    if unknown:
        raise InputError(f"does not know {', '.join(unknown)}; known is {', '.join(sorted(known))}")


def _text(entry: Mapping[str, Any], field: str, needed: bool = True) -> str:
    """Text of a field, on one line."""
    text = entry.get(field, "")
    if not isinstance(text, str) or (needed and not text.strip()):
        raise InputError(f"{field}: a text is needed")
    return " ".join(text.split())


def _over(names: Sequence[str], expression: str, what: str) -> str:
    """Return an expression after checking that it is one, and over these names only."""
    try:
        unknown = sorted(names_of(expression) - set(names))
    except InputError as error:
        raise InputError(f"{what}: {error}") from None
    if unknown:
        raise InputError(f"{what} uses {', '.join(unknown)}, which value does not define")
    return expression


def table_names(claims: Iterable[Claim]) -> list[str]:
    """Names of all tables that claims are tested with, sorted."""
    return sorted({name for claim in claims for name in claim.tables})
