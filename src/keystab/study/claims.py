"""The ledger of claims: what the paper says, how it is tested, and what the tables answer.

A claim is a statement of the paper with named numbers, each taken from a table of the study, and a
criterion over these numbers that was written down from the paper's words. `judge` computes the
numbers, asks the criterion, and gives one of four verdicts.
"""

from __future__ import annotations

import ast
import json
import math
import operator
import os
import re
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from functools import reduce
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import yaml

from keystab.errors import InputError
from keystab.evaluation.intervals import wilson_interval
from keystab.utils.files import written_whole

if TYPE_CHECKING:
    import pandas as pd

__all__ = [
    "FIELDS",
    "VERDICTS",
    "Claim",
    "Judgement",
    "Quantity",
    "cell",
    "evaluate",
    "judge",
    "judge_all",
    "measured",
    "names_of",
    "parse_claims",
    "read_claims",
    "records",
    "table_names",
    "tally",
    "to_json",
    "to_markdown",
    "to_table",
    "write_ledger",
]

REPRODUCED, CONDITION, FAILED, UNTESTED = (
    "reproduced",
    "reproduced with a condition",
    "not reproduced",
    "not testable",
)

#: All verdicts, from the best to none.
VERDICTS = (REPRODUCED, CONDITION, FAILED, UNTESTED)

#: What the ledger says of every claim, in this order.
FIELDS = (
    *("id", "where", "statement", "figure", "table", "criterion"),
    *("value", "interval", "paper", "verdict", "note"),
)


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
        How many numbers become one, see `measured`.
    low, high : str
        Columns with the ends of the interval of `column`; empty where there are none.
    """

    name: str
    expression: str = ""
    tables: tuple[str, ...] = ()
    rows: str = ""
    column: str = ""
    take: str = ""
    low: str = ""
    high: str = ""


class Claim(NamedTuple):
    """A statement of the paper and how it is tested.

    `criterion` is empty for what cannot be tested; `note` then says why. `condition` is a weaker
    criterion, and `condition_words` says what it asks.
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

    @property
    def tables(self) -> tuple[str, ...]:
        """Names of the tables that its quantities are taken from, each once."""
        return tuple(dict.fromkeys(name for part in self.quantities for name in part.tables))


class Measured(NamedTuple):
    """A number of a claim; `missing` says why it is not a number, where it is not."""

    value: float
    low: float = math.nan
    high: float = math.nan
    missing: str = ""


class Judgement(NamedTuple):
    """A claim, its numbers, and the verdict."""

    claim: Claim
    measured: Mapping[str, Measured]
    verdict: str
    note: str


# Expressions. Only what is listed here can be said, so that the file of claims cannot run code.

_OPERATORS: dict[type[ast.AST], Callable[..., Any]] = {
    ast.Add: np.add,
    ast.Sub: np.subtract,
    ast.Mult: np.multiply,
    ast.Div: np.divide,
    ast.Pow: np.power,
    ast.UAdd: np.positive,
    ast.USub: np.negative,
    ast.Not: np.logical_not,
    ast.And: np.logical_and,
    ast.Or: np.logical_or,
    ast.Eq: operator.eq,
    ast.NotEq: operator.ne,
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
}

_CALLS: dict[str, Callable[..., Any]] = {
    "abs": np.abs,
    "min": lambda *values: reduce(np.minimum, values),
    "max": lambda *values: reduce(np.maximum, values),
}

_CONSTANTS = {"inf": np.float64(math.inf)}


def evaluate(expression: str, names: Mapping[str, Any]) -> Any:
    """Compute an expression over named numbers, or over the columns of a table.

    Parameters
    ----------
    expression : str
        Numbers, texts and names; ``+ - * / **``; comparisons, also chained; ``and``, ``or``,
        ``not``; ``abs``, ``min`` and ``max``; ``inf``. Nothing else.
    names : mapping
        Values of the names: numbers, or columns of equal length.

    Raises
    ------
    InputError
        If the expression holds anything else, or a name that is not given.

    Examples
    --------
    >>> bool(evaluate("0.08 <= rate <= 0.12 and n > 3", {"rate": 0.1, "n": 4}))
    True
    >>> float(evaluate("max(a, 1 - a) / 0", {"a": 0.25}))
    inf
    >>> evaluate("open('file')", {})
    Traceback (most recent call last):
    keystab.errors.InputError: open('file'): does not know open(...); use abs, min, max
    """
    unknown = sorted(names_of(expression) - set(names))
    if unknown:
        known = ", ".join(map(str, names)) or "no names"
        raise InputError(f"{expression}: does not know {', '.join(unknown)}; there is {known}")
    try:
        # Nothing over nothing is no number, and no number is a finding of its own: no warning.
        with np.errstate(all="ignore"):
            return _value(ast.parse(expression.strip(), mode="eval").body, names)
    except TypeError:
        raise InputError(f"{expression}: compares or computes with text; use numbers") from None


def names_of(expression: str) -> set[str]:
    """Names that an expression uses, after checking that it says nothing that is not allowed.

    Examples
    --------
    >>> sorted(names_of("abs(a - b) < inf"))
    ['a', 'b']
    """
    try:
        tree = ast.parse(expression.strip(), mode="eval").body
    except (SyntaxError, ValueError):
        raise InputError(f"{expression!r} is no expression; compare numbers") from None
    names: set[str] = set()
    _collect(tree, expression, names)
    return names - set(_CONSTANTS)


def _collect(node: ast.expr, expression: str, names: set[str]) -> None:
    """Collect names below a node; raise at what is not allowed."""
    parts: list[ast.expr]
    kinds: Sequence[ast.AST]
    match node:
        case ast.Name(id=name):
            names.add(name)
            return
        case ast.Constant(value=int() | float() | str()):
            return
        case ast.UnaryOp(operand=operand):
            parts, kinds = [operand], [node.op]
        case ast.BinOp(left=left, right=right):
            parts, kinds = [left, right], [node.op]
        case ast.BoolOp(values=values):
            parts, kinds = values, [node.op]
        case ast.Compare(left=left, comparators=rest):
            parts, kinds = [left, *rest], node.ops
        case ast.Call(func=ast.Name(id=name), args=args, keywords=[]):
            if name not in _CALLS:
                known = ", ".join(_CALLS)
                raise InputError(f"{expression}: does not know {name}(...); use {known}")
            if len(args) < 1 or (name == "abs" and len(args) > 1):
                raise InputError(f"{expression}: {name}(...) of {len(args)} values")
            parts, kinds = args, []
        case _:
            raise InputError(
                f"{expression}: {ast.unparse(node)} is not allowed; use numbers, names, "
                "comparisons, and, or, not, + - * / **, abs, min, max"
            )
    for kind in kinds:
        if type(kind) not in _OPERATORS:
            raise InputError(f"{expression}: {type(kind).__name__} is not allowed")
    for part in parts:
        _collect(part, expression, names)


def _value(node: ast.expr, names: Mapping[str, Any]) -> Any:
    """Value of a node that `_collect` has allowed."""
    match node:
        case ast.Name(id=name):
            return names[name] if name in names else _CONSTANTS[name]
        case ast.Constant(value=str(text)):
            return text
        case ast.Constant(value=int() | float() as number):
            return np.float64(number)
        case ast.UnaryOp(op=kind, operand=operand):
            return _OPERATORS[type(kind)](_value(operand, names))
        case ast.BinOp(left=left, op=kind, right=right):
            return _OPERATORS[type(kind)](_value(left, names), _value(right, names))
        case ast.BoolOp(op=kind, values=values):
            return reduce(_OPERATORS[type(kind)], [_value(part, names) for part in values])
        case ast.Compare(left=left, ops=kinds, comparators=rest):
            sides = [_value(part, names) for part in (left, *rest)]
            pairs = zip(kinds, sides[:-1], sides[1:], strict=True)
            answers = [_OPERATORS[type(kind)](one, other) for kind, one, other in pairs]
            return reduce(np.logical_and, answers)
        case ast.Call(func=ast.Name(id=name), args=args):
            return _CALLS[name](*(_value(part, names) for part in args))
    raise AssertionError(ast.dump(node))


# The file of claims.

_TAKES = ("one", "mean", "median", "min", "max", "sum", "share")
_TAKES_ALONG = ("first", "last", "argmax", "argmin", "largest_step", "smallest_step")

_TEXTS = ("id", "where", "statement", "paper")
_KNOWN = {*_TEXTS, "figure", "value", "criterion", "condition", "note", "reason"}
_KNOWN_OF_QUANTITY = {"table", "where", "column", "take", "low", "high"}


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
    try:
        # The compiled loader is ten times as fast, and every start of Snakemake reads the file.
        loader = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
        entries = yaml.load(Path(path).read_text(encoding="utf-8"), Loader=loader)
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from None
    except yaml.YAMLError as error:
        raise InputError(f"{path}: is not YAML: {' '.join(str(error).split())[:160]}") from None
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
        extra = sorted({"value", "condition", "note"} & set(entry))
        if extra:
            raise InputError(f"has a reason why it is not tested, and so needs no {extra[0]}")
        return claim._replace(note=_text(entry, "reason"))
    quantities = _quantities(entry.get("value"))
    names = [part.name for part in quantities]
    claim = claim._replace(
        quantities=quantities,
        criterion=_over(names, _text(entry, "criterion"), "criterion"),
        note=_text(entry, "note", needed=False),
    )
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


def _quantities(value: Any) -> tuple[Quantity, ...]:
    """Check the named numbers of one entry."""
    if not isinstance(value, dict) or not value:
        raise InputError("value: name the numbers that the criterion is about")
    found: list[Quantity] = []
    for name, given in value.items():
        if not (isinstance(name, str) and name.isidentifier()) or name in (*_CALLS, *_CONSTANTS):
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
        )
        for needed in ("column", "take"):
            if needed not in given:
                raise InputError(f"lacks {needed}")
        for expression in filter(None, (quantity.rows, quantity.column)):
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


# Numbers from tables.


def measured(quantity: Quantity, tables: Mapping[str, pd.DataFrame]) -> Measured:
    """Take one number from tables.

    Parameters
    ----------
    quantity : Quantity
        Not one that is an expression over others. Its `take` is one of

        - ``one``: the only row,
        - ``mean``, ``median``, ``min``, ``max``, ``sum`` of the rows,
        - ``share``: share of rows for which a comparison holds, with its Wilson interval,
        - ``first C``, ``last C``: the row with the smallest or the largest value of column C,
        - ``argmax C``, ``argmin C``: C of the row where the column is largest or smallest,
        - ``largest_step C``, ``smallest_step C``: of the differences from one row to the next, in
          the order of C: negative largest steps mean a column that falls all the way.
    tables : mapping
        Table of each name.

    Returns
    -------
    Measured
        Not a number, with the reason, where no row is left. Rows without a number do not count.

    Examples
    --------
    >>> import pandas as pd
    >>> tables = {"t": pd.DataFrame({"n": [3, 5, 9], "rate": [0.3, 0.2, 0.1]})}
    >>> measured(Quantity("q", tables=("t",), column="rate", take="last n"), tables).value
    0.1
    >>> measured(Quantity("q", tables=("t",), column="rate", take="argmax n"), tables).value
    3.0
    >>> lost = Quantity("q", tables=("t",), rows="n == 4", column="rate", take="mean")
    >>> measured(lost, tables).missing
    't has no row with n == 4'
    """
    table = tables[quantity.tables[0]]
    for name in quantity.tables[1:]:
        table = table.merge(tables[name])
    columns: dict[str, Any] = {str(name): table[name] for name in table}
    if quantity.rows:
        chosen = np.asarray(evaluate(quantity.rows, columns), dtype=bool)
        table = table[np.broadcast_to(chosen, len(table))]
    columns = {str(name): table[name] for name in table}
    numbers = np.broadcast_to(
        np.asarray(evaluate(quantity.column, columns), dtype=np.float64), len(table)
    )
    table, numbers = table[~np.isnan(numbers)], numbers[~np.isnan(numbers)]
    how, *along = quantity.take.split()
    named = " and ".join(quantity.tables)
    rows = f" with {quantity.rows}" if quantity.rows else ""
    if how.endswith("_step") and len(table) == 1:
        return Measured(math.nan, missing=f"{named} has only one row{rows}")
    if not len(table):
        return Measured(math.nan, missing=f"{named} has no row{rows}")
    if how == "one" and len(table) > 1:
        raise InputError(f"{named} has {len(table)} rows{rows}, of which one is to be taken")
    if how == "share":
        n_true = int(numbers.sum())
        lowest, highest = wilson_interval(n_true, len(numbers))
        return Measured(n_true / len(numbers), float(lowest), float(highest))
    if how in ("mean", "median", "sum"):
        return Measured(float(getattr(np, how)(numbers)))
    missing = [name for name in (*along, quantity.low, quantity.high) if name and name not in table]
    if missing:
        raise InputError(f"{named} has no column {', '.join(missing)}")
    order = table[along[0]].to_numpy(dtype=np.float64) if along else numbers
    if how.endswith("_step"):
        steps = np.diff(numbers[np.argsort(order, kind="stable")])
        return Measured(float(steps.max() if how == "largest_step" else steps.min()))
    if how in ("argmax", "argmin"):
        return Measured(float(order[int(getattr(np, how)(numbers))]))
    row = int(np.argmax(order) if how in ("last", "max") else np.argmin(order))
    if not quantity.low:
        return Measured(float(numbers[row]))
    low, high = (float(table[end].iloc[row]) for end in (quantity.low, quantity.high))
    return Measured(float(numbers[row]), low, high)


def judge(claim: Claim, tables: Mapping[str, pd.DataFrame]) -> Judgement:
    """Compute the numbers of a claim and give the verdict.

    A criterion over a number that does not exist, because settings left out its rows, makes the
    claim not testable; the note then says which rows are missing.

    Raises
    ------
    InputError
        In one line that names the claim, if a table lacks a column.

    Examples
    --------
    >>> import pandas as pd
    >>> taken = Quantity("rate", tables=("t",), column="rate", take="mean")
    >>> claim = Claim("ten", "section 1", "Ten.", "", "10 %", (taken,), "0.08 <= rate <= 0.12")
    >>> judge(claim, {"t": pd.DataFrame({"rate": [0.09, 0.11]})}).verdict
    'reproduced'
    >>> judge(claim, {"t": pd.DataFrame({"rate": [0.02]})}).verdict
    'not reproduced'
    """
    if not claim.criterion:
        return Judgement(claim, {}, UNTESTED, claim.note)
    found: dict[str, Measured] = {}
    try:
        for part in claim.quantities:
            found[part.name] = (
                _computed(part.expression, found) if part.expression else measured(part, tables)
            )
        verdict, reason = _verdict(claim, found)
    except InputError as error:
        raise InputError(f"claim {claim.id}: {error}") from None
    return Judgement(claim, found, verdict, " ".join(filter(None, (reason, claim.note))))


def _computed(expression: str, found: Mapping[str, Measured]) -> Measured:
    """Compute a number from others; it misses what they miss."""
    used = names_of(expression)
    values = {name: np.float64(found[name].value) for name in used}
    return Measured(float(evaluate(expression, values)), missing=_missing(used, found))


def _missing(names: Collection[str], found: Mapping[str, Measured]) -> str:
    """Say, once each, what is missing among some numbers."""
    reasons = (found[name].missing for name in found if name in names)
    return "; ".join(dict.fromkeys(filter(None, reasons)))


def _verdict(claim: Claim, found: Mapping[str, Measured]) -> tuple[str, str]:
    """Give the verdict, and what is to be said about it."""
    values = {name: np.float64(part.value) for name, part in found.items()}

    def no_numbers(expression: str) -> str:
        names = names_of(expression)
        bad = [name for name in values if name in names and math.isnan(values[name])]
        return _missing(names, found) or ("no number: " + ", ".join(bad) if bad else "")

    missing = no_numbers(claim.criterion)
    if missing:
        return UNTESTED, f"Missing: {missing}."
    if evaluate(claim.criterion, values):
        return REPRODUCED, ""
    if not claim.condition:
        return FAILED, ""
    missing = no_numbers(claim.condition)
    if missing:
        return FAILED, f"Its condition is not tested; missing: {missing}."
    if evaluate(claim.condition, values):
        return CONDITION, f"Condition: {claim.condition_words}."
    return FAILED, ""


def judge_all(claims: Iterable[Claim], tables: Mapping[str, pd.DataFrame]) -> list[Judgement]:
    """Judge claims, in their order."""
    return [judge(claim, tables) for claim in claims]


def tally(judgements: Iterable[Judgement]) -> dict[str, int]:
    """Count verdicts.

    Examples
    --------
    >>> tally([Judgement(Claim("a", "", "", "", ""), {}, "not testable", "")])["not testable"]
    1
    """
    verdicts = [each.verdict for each in judgements]
    return {verdict: verdicts.count(verdict) for verdict in VERDICTS}


# The ledger.


def records(judgements: Iterable[Judgement]) -> list[dict[str, Any]]:
    """One record per claim with `FIELDS`; numbers that do not exist are None, infinity is "inf".

    ``value`` maps names to numbers, ``interval`` names to pairs of ends, where there are any.
    """
    return [
        {
            "id": each.claim.id,
            "where": each.claim.where,
            "statement": each.claim.statement,
            "figure": each.claim.figure,
            "table": [f"{name}.csv" for name in each.claim.tables],
            "criterion": each.claim.criterion,
            "value": {name: _plain(part.value) for name, part in each.measured.items()},
            "interval": {
                name: [_plain(part.low), _plain(part.high)]
                for name, part in each.measured.items()
                if not math.isnan(part.low)
            },
            "paper": each.claim.paper,
            "verdict": each.verdict,
            "note": each.note,
        }
        for each in judgements
    ]


def _plain(value: float) -> float | str | None:
    """Number as JSON can say it."""
    if math.isnan(value):
        return None
    return value if math.isfinite(value) else str(value)


def to_json(judgements: Iterable[Judgement]) -> str:
    """Write the ledger as JSON: a list of objects, see `records`."""
    return json.dumps(records(judgements), indent=2, ensure_ascii=False, allow_nan=False) + "\n"


def to_table(judgements: Iterable[Judgement]) -> pd.DataFrame:
    """Lay out the ledger as a table of texts, one row per claim."""
    import pandas as pd

    rows = [
        record
        | {
            "table": " ".join(record["table"]),
            "value": _numbers(record["value"]),
            "interval": "; ".join(
                f"{name} {_short(low)} to {_short(high)}"
                for name, (low, high) in record["interval"].items()
            ),
        }
        for record in records(judgements)
    ]
    return pd.DataFrame(rows, columns=list(FIELDS))


def _numbers(values: Mapping[str, float | str | None]) -> str:
    return "; ".join(f"{name} {_short(value)}" for name, value in values.items())


def _short(value: float | str | None) -> str:
    """Write a number for people: four digits, or all of a whole number.

    Examples
    --------
    >>> _short(0.123456), _short(12345.0), _short(None)
    ('0.1235', '12345', 'missing')
    """
    if value is None:
        return "missing"
    if isinstance(value, str):
        return value
    return f"{value:.0f}" if value == round(value) else f"{value:.4g}"


def to_markdown(judgements: Sequence[Judgement]) -> str:
    """Write the ledger for people: how many verdicts of each kind, then the claims by verdict."""
    table = to_table(judgements)
    counts = tally(judgements)
    lines = [
        "# What the paper says, and what this run says of it",
        "",
        "Every claim was given a criterion from the paper's words. `claims.csv` and `claims.json`",
        "hold the same with all criteria; `config/claims.yaml` says how each number is computed.",
        "",
        "| verdict | claims |",
        "|---|---|",
        *(f"| {verdict} | {number} |" for verdict, number in counts.items()),
        f"| all | {len(judgements)} |",
    ]
    for verdict in VERDICTS:
        if not counts[verdict]:
            continue
        lines += ["", f"## {verdict.capitalize()}", ""]
        if verdict == UNTESTED:
            lines += ["| claim | where | the paper says | why |", "|---|---|---|---|"]
        else:
            lines += [
                "| claim | where | the paper says | its number or word | criterion | found | |",
                "|---|---|---|---|---|---|---|",
            ]
        for row in table[table["verdict"] == verdict].to_dict("records"):
            cells = [f"`{row['id']}`", _place(row), row["statement"]]
            if verdict != UNTESTED:
                found = row["value"] + (f" ({row['interval']})" if row["interval"] else "")
                cells += [row["paper"], f"`{row['criterion']}`", found]
            lines.append("| " + " | ".join(cell(text) for text in (*cells, row["note"])) + " |")
    return "\n".join(lines) + "\n"


def _place(row: Mapping[Any, Any]) -> str:
    """Say where a claim stands, and in which figure it is tested."""
    return f"{row['where']}; {row['figure']}" if row["figure"] else str(row["where"])


def cell(text: str) -> str:
    """Text that does not end a cell of a Markdown table."""
    return text.replace("|", "\\|")


def write_ledger(
    judgements: Sequence[Judgement],
    csv: str | os.PathLike[str],
    json_file: str | os.PathLike[str],
    markdown: str | os.PathLike[str],
) -> None:
    """Write the ledger as a table, as JSON and for people; each file whole or not at all."""
    from keystab.io.tables import write_table

    write_table(to_table(judgements), csv)
    for path, text in ((json_file, to_json(judgements)), (markdown, to_markdown(judgements))):
        with written_whole(path) as part:
            part.write_text(text, encoding="utf-8", newline="")
