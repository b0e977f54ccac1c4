"""Expressions over named numbers and over columns of tables, as the file of claims has them.

Only what is listed here can be said, so that the file cannot run code.
"""

from __future__ import annotations

import ast
import math
import operator
from collections.abc import Callable, Mapping, Sequence
from functools import reduce
from typing import Any

import numpy as np

from keystab.errors import InputError

__all__ = ["evaluate", "names_of"]

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

CALLS: dict[str, Callable[..., Any]] = {
    "abs": np.abs,
    "min": lambda *values: reduce(np.minimum, values),
    "max": lambda *values: reduce(np.maximum, values),
}

CONSTANTS = {"inf": np.float64(math.inf)}


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
    return names - set(CONSTANTS)


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
            if name not in CALLS:
                known = ", ".join(CALLS)
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
            return names[name] if name in names else CONSTANTS[name]
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
            return CALLS[name](*(_value(part, names) for part in args))
    raise AssertionError(ast.dump(node))
