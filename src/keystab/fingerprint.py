"""A digest of the code that a stage runs.

Snakemake reruns a rule when its command or a parameter changes, but does not see an edit of the
library behind the command. Every rule therefore carries the fingerprint of its stage as a
parameter: it changes when the code of the stage or of any room that the stage imports changes,
and stays the same under edits of comments, docstrings and layout. Only the standard library is
used, because the Snakefile computes all fingerprints at every start.
"""

from __future__ import annotations

import ast
import hashlib
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

PACKAGE_FOLDER = Path(__file__).parent


class _Code(NamedTuple):
    """What one module contributes: the digest of its code and the modules that it imports."""

    digest: str
    imports: tuple[str, ...]


def fingerprint(module: str, package_folder: Path = PACKAGE_FOLDER) -> str:
    """Digest of the code of a module and of everything it imports from its own package.

    Parameters
    ----------
    module : str
        Dotted name, for example ``"keystab.stages.detect"``.
    package_folder : Path
        Folder of the package that the name starts with.

    Returns
    -------
    str
        SHA-256 in hexadecimal.

    Raises
    ------
    ValueError
        If an import inside the package cannot be followed, because then an edit behind it would
        go unseen.

    Notes
    -----
    Imports inside functions count; imports under ``if TYPE_CHECKING`` do not, since they never
    run. The package's own ``__init__`` is a table of public names and takes part only when a name
    that it defines is imported from it. Names put together at run time cannot be followed.

    Examples
    --------
    >>> fingerprint("keystab.errors") == fingerprint("keystab.errors")
    True
    """
    digest = hashlib.sha256()
    for name in imported_modules(module, package_folder):
        digest.update(f"{name} {_read(name, package_folder).digest}\n".encode())
    return digest.hexdigest()


def imported_modules(module: str, package_folder: Path = PACKAGE_FOLDER) -> list[str]:
    """Sorted names of a module and of all modules of its package that it imports in the end.

    Examples
    --------
    >>> imported_modules("keystab.errors")
    ['keystab.errors']
    """
    seen: set[str] = set()
    waiting = _with_parents(module, package_folder.name)
    while waiting:
        name = waiting.pop()
        if name not in seen:
            seen.add(name)
            waiting.extend(_read(name, package_folder).imports)
    return sorted(seen)


def _file_of(module: str, package_folder: Path) -> Path | None:
    """Source file of a dotted name, or None where the name is not a module of the package."""
    package, *rest = module.split(".")
    if package != package_folder.name:
        return None
    path = package_folder.joinpath(*rest)
    for candidate in (path / "__init__.py", path.with_suffix(".py")):
        if candidate.is_file():
            return candidate
    return None


@cache
def _read(module: str, package_folder: Path) -> _Code:
    path = _file_of(module, package_folder)
    if path is None:
        raise ValueError(f"{module} is not a module in {package_folder}")
    tree = ast.parse(path.read_bytes(), filename=str(path))
    is_package = path.name == "__init__.py"
    imports = _imports(tree, module, is_package, package_folder)
    tokens: list[str] = []
    _spell(tree, tokens)
    return _Code(hashlib.sha256("\x1f".join(tokens).encode()).hexdigest(), imports)


def _imports(
    tree: ast.Module, module: str, is_package: bool, package_folder: Path
) -> tuple[str, ...]:
    package = package_folder.name
    found: set[str] = set()
    for statement in _running_statements(tree):
        if isinstance(statement, ast.Import):
            for alias in statement.names:
                if alias.name == package:
                    raise ValueError(
                        f"{module} says 'import {package}': import the module that is meant, "
                        "so that its code can be followed"
                    )
                if alias.name.startswith(f"{package}."):
                    found.update(_with_parents(alias.name, package))
        elif isinstance(statement, ast.ImportFrom):
            base = _absolute(statement, module, is_package)
            if base != package and not base.startswith(f"{package}."):
                continue
            found.update(_with_parents(base, package))
            for alias in statement.names:
                found.update(_behind(base, alias.name, module, package_folder))
    return tuple(sorted(found))


def _behind(base: str, name: str, module: str, package_folder: Path) -> list[str]:
    """Modules that ``from base import name`` adds to those of ``import base``."""
    submodule = f"{base}.{name}"
    if _file_of(submodule, package_folder):
        return [submodule]
    path = _file_of(base, package_folder)
    if path is not None and path.name != "__init__.py":
        return []
    if path is None or name not in _top_level_names(ast.parse(path.read_bytes())):
        raise ValueError(
            f"{module} imports {name} from {base}, which does not define it in its source: "
            "import it from the module that does, so that its code can be followed"
        )
    return [base]


def _with_parents(name: str, package: str) -> list[str]:
    """A module and the packages around it whose ``__init__`` runs before it."""
    parts = name.split(".")
    names = [".".join(parts[: n + 1]) for n in range(len(parts))]
    return [each for each in names if each != package]


def _absolute(statement: ast.ImportFrom, module: str, is_package: bool) -> str:
    """Dotted name that a from-import starts at, with leading dots resolved."""
    if not statement.level:
        return statement.module or ""
    parts = module.split(".")
    parts = parts[: len(parts) - statement.level + is_package]
    return ".".join(parts + ([statement.module] if statement.module else []))


def _running_statements(node: ast.AST) -> list[ast.stmt]:
    """All statements of a module, at any depth, without those for type checkers only."""
    statements: list[ast.stmt] = []
    waiting: list[ast.AST] = [node]
    while waiting:
        current = waiting.pop()
        if isinstance(current, ast.If) and _is_type_checking(current.test):
            waiting.extend(current.orelse)
            continue
        if isinstance(current, ast.stmt):
            statements.append(current)
        for block in ("body", "orelse", "finalbody", "handlers", "cases"):
            children = getattr(current, block, ())
            if isinstance(children, list):  # the body of a lambda is an expression
                waiting.extend(children)
    return statements


def _is_type_checking(test: ast.expr) -> bool:
    return (isinstance(test, ast.Name) and test.id == "TYPE_CHECKING") or (
        isinstance(test, ast.Attribute) and test.attr == "TYPE_CHECKING"
    )


def _top_level_names(tree: ast.Module) -> set[str]:
    """Names that a module's source binds at its top level."""
    names: set[str] = set()
    for statement in tree.body:
        if isinstance(statement, (ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef)):
            names.add(statement.name)
        elif isinstance(statement, (ast.Import, ast.ImportFrom)):
            names.update(alias.asname or alias.name for alias in statement.names)
        else:
            names.update(
                node.id
                for node in ast.walk(statement)
                if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store)
            )
    return names


def _spell(node: ast.AST, tokens: list[str]) -> None:
    """Write a syntax tree as tokens, without positions, docstrings and empty fields.

    Empty fields are left out so that the same source gives the same tokens under Python versions
    whose trees differ only in fields that the source does not use.
    """
    tokens.append(type(node).__name__)
    for field in node._fields:
        value: Any = getattr(node, field, None)
        if field == "body" and _has_docstring(node):
            value = value[1:]
        if value is None or value == [] or field == "kind":
            continue
        tokens.append(field)
        if isinstance(value, ast.AST):
            _spell(value, tokens)
        elif isinstance(value, list):
            for item in value:
                if isinstance(item, ast.AST):
                    _spell(item, tokens)
                else:
                    tokens.append(repr(item))
            tokens.append("]")
        else:
            tokens.append(repr(value))


def _has_docstring(node: ast.AST) -> bool:
    if not isinstance(node, (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)):
        return False
    first = node.body[0] if node.body else None
    return (
        isinstance(first, ast.Expr)
        and isinstance(first.value, ast.Constant)
        and isinstance(first.value.value, str)
    )
