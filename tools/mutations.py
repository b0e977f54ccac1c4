"""Single changes of meaning of Python source: where they can be made, and what they make of it.

Never changed, since a reader and not a result would notice: docstrings, texts, formatted texts,
``__all__``, annotations, raised messages; under ``figures`` also what only lays out: `palette` and
`style` whole, constants of a module, and what is handed to axes, figures or styles. A constant
below `GUARD` guards against rounding, where one per cent means nothing: it is made 1000 times
larger.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from typing import NamedTuple

GUARD = 1e-6
LAYOUT = re.compile(r"^(ax|axes|fig|figure|panels?|style|palette|whole|zoomed|plt)$")
SORTERS = {"lexsort", "sort_values", "sorted", "sort", "min", "max", "drop_duplicates", "argsort"}

COMPARISONS: dict[type[ast.cmpop], tuple[str, list[str]]] = {
    ast.Lt: (r"<", ["<=", ">"]),
    ast.LtE: (r"<=", ["<", ">="]),
    ast.Gt: (r">", [">=", "<"]),
    ast.GtE: (r">=", [">", "<="]),
    ast.Eq: (r"==", ["!="]),
    ast.NotEq: (r"!=", ["=="]),
}
ARITHMETIC: dict[type[ast.operator], tuple[str, str]] = {
    ast.Add: (r"\+", "-"),
    ast.Sub: (r"-", "+"),
    ast.Mult: (r"\*", "/"),
    ast.Div: (r"/", "*"),
}
TWINS = {"min": "max", "minimum": "maximum", "floor": "ceil", "any": "all", "argmin": "argmax"}
TWINS |= {after: before for before, after in TWINS.items()}
AXES = {"y": "x", "height": "width", "row": "column", "rows": "columns", "top": "left"}
AXES |= {"bottom": "right", "dy": "dx", "var_y": "var_x", "std_y": "std_x", "size_y": "size_x"}
AXES |= {after: before for before, after in AXES.items()}
BOUND = re.compile(r"bound|limit|margin|guard|border|radius|reach|tolerance|half|error|support")


class Change(NamedTuple):
    """One change: where it is made (line from 1, bytes from its start), and what it makes."""

    line: int
    start: int
    end: int
    before: str
    after: str
    operator: str
    function: str


def changes(source: str, layout: bool = False) -> list[Change]:
    r"""All single changes of a module that are known here, in the order of the source.

    Parameters
    ----------
    source : str
        Source of the module.
    layout : bool
        Whether it draws a figure, where layout is not changed.

    Examples
    --------
    >>> [(one.before, one.after) for one in changes("def f(a, b):\n    return a < b + 2\n")]
    [('<', '<='), ('<', '>'), ('+', '-'), ('2', '3')]
    """
    found = set(_Places(source, layout).all())
    return sorted(found, key=lambda one: (one.line, one.start, one.end, one.operator, one.after))


def applied(source: str, change: Change) -> str:
    """The source with one change made."""
    lines = source.encode().splitlines(keepends=True)
    before = sum(map(len, lines[: change.line - 1])) + change.start
    text = b"".join(lines)
    size = len(change.before.encode())
    return (text[:before] + change.after.encode() + text[before + size :]).decode()


class _Places:
    def __init__(self, source: str, layout: bool) -> None:
        self.text = source.encode()
        self.layout = layout
        self.tree = ast.parse(source)
        starts = [0]
        for line in self.text.splitlines(keepends=True):
            starts.append(starts[-1] + len(line))
        self.starts = starts

    def all(self) -> Iterator[Change]:
        for statement in self.tree.body:
            yield from self._inside(statement, "", None, set())

    def _inside(
        self, node: ast.AST, function: str, above: ast.AST | None, names: set[str]
    ) -> Iterator[Change]:
        """Changes of a node and of what is in it, in a function that has names."""
        if self._left_out(node, function):
            return
        if isinstance(node, (ast.FunctionDef, ast.ClassDef)):
            function = f"{function}.{node.name}".lstrip(".")
            if isinstance(node, ast.FunctionDef):
                names = names | {one.arg for one in ast.walk(node) if isinstance(one, ast.arg)}
                names |= {one.id for one in ast.walk(node) if isinstance(one, ast.Name)}
        for start, end, after, operator in self._of(node, above, names):
            line = next(k for k, at in enumerate(self.starts) if at > start)
            at = self.starts[line - 1]
            before = self.text[start:end].decode()
            if before != after:
                yield Change(line, start - at, end - at, before, after, operator, function)
        for field, value in ast.iter_fields(node):
            if field in ("annotation", "returns", "decorator_list", "type_params", "bases"):
                continue
            for child in value if isinstance(value, list) else [value]:
                if isinstance(child, ast.AST):
                    yield from self._inside(child, function, node, names)

    def _left_out(self, node: ast.AST, function: str) -> bool:
        if isinstance(node, (ast.Import, ast.ImportFrom, ast.Raise, ast.JoinedStr, ast.Assert)):
            return True
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
            return True
        if isinstance(node, (ast.Assign, ast.AnnAssign)) and not function:
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            if self.layout or any(
                isinstance(it, ast.Name) and it.id == "__all__" for it in targets
            ):
                return True
        if isinstance(node, ast.If):
            words = ast.unparse(node.test)
            if "TYPE_CHECKING" in words or "__name__" in words:
                return True
        if isinstance(node, ast.Call):
            called = ast.unparse(node.func)
            if called.endswith(("InputError", "print", "tell", ".warn", "add_argument")):
                return True
            return self.layout and bool(LAYOUT.match(called.split(".")[0].split("[")[0]))
        return False

    def _span(self, node: ast.expr) -> tuple[int, int]:
        assert node.end_lineno is not None and node.end_col_offset is not None
        return (
            self.starts[node.lineno - 1] + node.col_offset,
            self.starts[node.end_lineno - 1] + node.end_col_offset,
        )

    def _between(self, left: ast.expr, right: ast.expr, sign: str) -> tuple[int, int] | None:
        start, end = self._span(left)[1], self._span(right)[0]
        found = re.search(sign.encode(), self.text[start:end])
        return (start + found.start(), start + found.end()) if found else None

    def _source(self, node: ast.expr) -> str:
        start, end = self._span(node)
        return self.text[start:end].decode()

    def _of(
        self, node: ast.AST, above: ast.AST | None, names: set[str]
    ) -> Iterator[tuple[int, int, str, str]]:
        """Start and end in the text, what stands there then, and the kind of the change."""
        if isinstance(node, ast.Compare):
            sides = [node.left, *node.comparators]
            for left, right, sign in zip(sides, sides[1:], node.ops, strict=False):
                if type(sign) in COMPARISONS:
                    word, others = COMPARISONS[type(sign)]
                    at = self._between(left, right, word)
                    for other in others if at else ():
                        assert at is not None
                        yield *at, other, "comparison"
        elif isinstance(node, ast.BinOp) and type(node.op) in ARITHMETIC:
            word, other = ARITHMETIC[type(node.op)]
            at = self._between(node.left, node.right, word)
            texts = any(
                isinstance(it, (ast.JoinedStr, ast.Constant))
                and not isinstance(getattr(it, "value", ""), (int, float))
                for it in (node.left, node.right)
            )
            if at and not texts:
                yield *at, other, "arithmetic"
        elif isinstance(node, ast.BoolOp):
            old, new = ("and", "or") if isinstance(node.op, ast.And) else ("or", "and")
            at = self._between(node.values[0], node.values[1], rf"\b{old}\b")
            if at and len(node.values) == 2:
                yield *at, new, "logic"
            for one in node.values:
                rest = f" {old} ".join(self._source(it) for it in node.values if it is not one)
                yield *self._span(node), f"({rest})", "clause"
        elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not):
            yield *self._span(node), f"bool({self._source(node.operand)})", "logic"
        elif isinstance(node, ast.If) and not node.orelse:
            last = node.body[-1]
            if isinstance(last, (ast.Raise, ast.Return, ast.Continue, ast.Break)):
                yield *self._span(node.test), "False", "check"
        elif isinstance(node, ast.Constant):
            yield from self._constant(node, above)
        elif isinstance(node, ast.Call):
            yield from self._call(node)
        elif isinstance(node, (ast.Name, ast.Attribute)):
            word = node.id if isinstance(node, ast.Name) else node.attr
            start, end = self._span(node)
            there = isinstance(node, ast.Attribute) or AXES.get(word) in names
            if word in AXES and there and isinstance(node.ctx, ast.Load):
                yield end - len(word), end, AXES[word], "axes"
            if (
                BOUND.search(word)
                and isinstance(node.ctx, ast.Load)
                and isinstance(above, (ast.Compare, ast.BinOp))
            ):
                yield start, end, f"(0.5 * {self._source(node)})", "bound"
        if isinstance(node, ast.Attribute) and node.attr in TWINS:
            end = self._span(node)[1]
            yield end - len(node.attr), end, TWINS[node.attr], "extreme"

    def _constant(
        self, node: ast.Constant, above: ast.AST | None
    ) -> Iterator[tuple[int, int, str, str]]:
        value, span = node.value, self._span(node)
        of_shape = isinstance(above, ast.Subscript) and ast.unparse(above.value).endswith("shape")
        axis = isinstance(above, ast.keyword) and above.arg == "axis"
        if isinstance(value, bool) or value is None:
            if isinstance(value, bool) and not isinstance(above, ast.keyword):
                yield *span, str(not value), "logic"
        elif isinstance(value, str) and value in AXES and isinstance(above, ast.Subscript):
            yield *span, f'"{AXES[value]}"', "axes"
        elif isinstance(value, int):
            if (of_shape or axis) and value in (0, 1):
                yield *span, str(1 - value), "axes"
            else:
                yield *span, str(value + 1), "constant"
        elif isinstance(value, float):
            larger = value * (1000 if abs(value) < GUARD else 1.01) if value else 0.01
            yield *span, repr(float(f"{larger:.12g}")), "constant"

    def _call(self, node: ast.Call) -> Iterator[tuple[int, int, str, str]]:
        word = node.func.id if isinstance(node.func, ast.Name) else ""
        if word in TWINS:
            yield *self._span(node.func), TWINS[word], "extreme"
        called = word or getattr(node.func, "attr", "")
        if called in SORTERS:
            parts: list[ast.expr] = [*node.args, *(one.value for one in node.keywords)]
            keys = [one.body if isinstance(one, ast.Lambda) else one for one in parts]
            for one in keys:
                if (
                    isinstance(one, (ast.Tuple, ast.List))
                    and len(one.elts) > 1
                    and (called not in ("min", "max", "sort", "argsort") or one not in node.args)
                ):
                    for gone in one.elts:
                        rest = ", ".join(self._source(it) for it in one.elts if it is not gone)
                        text = f"[{rest}]" if isinstance(one, ast.List) else f"({rest},)"
                        yield *self._span(one), text, "tie-break"
        for left, right in zip(node.args, node.args[1:], strict=False):
            first, second = self._source(left), self._source(right)
            if AXES.get(first.split(".")[-1]) == second.split(".")[-1]:
                start, end = self._span(left)[0], self._span(right)[1]
                yield start, end, f"{second}, {first}", "axes"
