"""A digest of the code that a stage runs.

Snakemake reruns a rule when its command or a parameter changes, but does not see an edit of the
library behind the command. Every rule therefore carries the fingerprint of its stage as a
parameter: it changes when the code of the stage or of any module that it imports changes,
and stays the same under edits of comments, docstrings and layout. Of a catalogue, as the palette of
the figures and the blocks of parameters are, only the entries count that are used. Only the
standard library is used, because the Snakefile computes all fingerprints at every start.
"""

from __future__ import annotations

import ast
import hashlib
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

PACKAGE_FOLDER = Path(__file__).parents[1]

CATALOGUES = ("figures.palette", "parameters")
"""Modules, without the package's name, that hold entries for others: each counts for itself."""


class _Code(NamedTuple):
    """What one module contributes: the digest of its code and the modules that it imports."""

    digest: str
    imports: tuple[str, ...]
    entries: frozenset[tuple[str, str]]
    """Catalogues and the names that are used of them."""


class _Entry(NamedTuple):
    """One definition of a catalogue: the digest of its code and the names that it uses."""

    digest: str
    names: frozenset[str]


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
        If an import inside the package cannot be followed, or the use of a catalogue, because then
        an edit behind it would go unseen.

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
    names = imported_modules(module, package_folder)
    used = {entry for name in names for entry in _read(name, package_folder).entries}
    for name in names:
        if name in _catalogues(package_folder) and name != module:
            own = _digest_of_entries(
                name, {entry for where, entry in used if where == name}, package_folder
            )
        else:
            own = _read(name, package_folder).digest
        digest.update(f"{name} {own}\n".encode())
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


def folder_of_loops(project: Path, package_folder: Path = PACKAGE_FOLDER) -> Path:
    """Folder for the loops that numba compiles from the code as it is.

    numba compiles a loop again when its own file changes, but not when a loop that it calls in
    another file does. Other code therefore gets another folder.

    Parameters
    ----------
    project : Path
        Folder of the project.
    package_folder : Path
        Folder of the package.

    Examples
    --------
    >>> folder_of_loops(Path("project")).parent.as_posix()
    'project/.snakemake/numba'
    """
    digest = hashlib.sha256()
    for module in modules_of_loops(package_folder):
        digest.update(fingerprint(module, package_folder).encode())
    return project / ".snakemake" / "numba" / digest.hexdigest()[:12]


def modules_of_loops(package_folder: Path = PACKAGE_FOLDER) -> list[str]:
    """Sorted names of the modules with loops that numba compiles, in whatever subpackage they are.

    Examples
    --------
    >>> "keystab.detection.extrema" in modules_of_loops()
    True
    """
    return sorted(
        ".".join((package_folder.name, *path.relative_to(package_folder).with_suffix("").parts))
        for path in package_folder.rglob("*.py")
        if b"\nfrom numba import" in path.read_bytes()
    )


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
    catalogues = [
        name for name in _catalogues(package_folder) if name in imports and name != module
    ]
    nodes = list(ast.walk(tree)) if catalogues else []
    entries = frozenset(
        (name, entry)
        for name in catalogues
        for entry in _entries_used(nodes, module, is_package, name)
    )
    return _Code(_digest([tree]), imports, entries)


def _digest(nodes: Sequence[ast.AST]) -> str:
    tokens: list[str] = []
    for node in nodes:
        _spell(node, tokens)
    return hashlib.sha256("\x1f".join(tokens).encode()).hexdigest()


# ---------------------------------------------------------------------------------------------
# Catalogues


def _catalogues(package_folder: Path) -> list[str]:
    return [f"{package_folder.name}.{name}" for name in CATALOGUES]


def _digest_of_entries(catalogue: str, names: set[str], package_folder: Path) -> str:
    """Digest of some entries of a catalogue and of those that these use in turn."""
    entries = _read_catalogue(catalogue, package_folder)
    seen: set[str] = set()
    waiting = sorted(names)
    while waiting:
        name = waiting.pop()
        if name not in entries:
            raise ValueError(f"{catalogue} has no {name}, which is used")
        if name not in seen:
            seen.add(name)
            waiting.extend(entries[name].names & entries.keys())
    return " ".join(f"{name} {entries[name].digest}" for name in sorted({*seen, ""}))


@cache
def _read_catalogue(module: str, package_folder: Path) -> dict[str, _Entry]:
    """Definitions of a catalogue by their names; imports, which all share, under the name ""."""
    path = _file_of(module, package_folder)
    assert path is not None
    shared: list[ast.AST] = []
    entries: dict[str, _Entry] = {}
    for statement in ast.parse(path.read_bytes(), filename=str(path)).body:
        if _is_text(statement):
            continue
        if isinstance(statement, (ast.Import, ast.ImportFrom, ast.If)):
            shared.append(statement)
            continue
        if isinstance(statement, (ast.FunctionDef, ast.ClassDef)):
            defined = [statement.name]
        elif isinstance(statement, (ast.Assign, ast.AnnAssign)):
            places = statement.targets if isinstance(statement, ast.Assign) else [statement.target]
            targets = [node for target in places for node in ast.walk(target)]
            defined = [node.id for node in targets if isinstance(node, ast.Name)]
        else:
            raise ValueError(
                f"{module}, line {statement.lineno}: a catalogue holds imports, constants, "
                "functions and classes, nothing else"
            )
        used = frozenset(node.id for node in ast.walk(statement) if isinstance(node, ast.Name))
        if used & {"globals", "locals", "vars"}:
            raise ValueError(f"{module}: {defined[0]} must name the entries that it uses")
        for name in defined:
            if name in entries:
                raise ValueError(f"{module} defines {name} twice: give one of them another name")
            entries[name] = _Entry(_digest([statement]), used)
    return {**entries, "": _Entry(_digest(shared), frozenset())}


def _entries_used(
    nodes: Sequence[ast.AST], module: str, is_package: bool, catalogue: str
) -> set[str]:
    """Names that a module uses of a catalogue."""
    parent, _, last = catalogue.rpartition(".")
    aliases: set[str] = set()
    used: set[str] = set()
    for node in nodes:
        if isinstance(node, ast.Import) and any(alias.name == catalogue for alias in node.names):
            raise ValueError(f"{module} says 'import {catalogue}': write 'from {parent} import'")
        if isinstance(node, ast.ImportFrom):
            base = _absolute(node, module, is_package)
            if base == parent:
                aliases |= {one.asname or one.name for one in node.names if one.name == last}
            elif base == catalogue:
                used |= {one.name for one in node.names}
    attributes = [
        node
        for node in nodes
        if isinstance(node, ast.Attribute)
        and isinstance(node.value, ast.Name)
        and node.value.id in aliases
    ]
    n_names = sum(isinstance(node, ast.Name) and node.id in aliases for node in nodes)
    if n_names != len(attributes) or "*" in used:
        raise ValueError(
            f"{module} uses {catalogue} as a whole: take its entries by their names, as in "
            f"{last}.NAME, so that the others need not count"
        )
    return used | {node.attr for node in attributes}


# ---------------------------------------------------------------------------------------------
# Imports and code


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
    if path is None or name not in _names_in(path):
        raise ValueError(
            f"{module} imports {name} from {base}, which does not define it in its source: "
            "import it from the module that does, so that its code can be followed"
        )
    return [base]


@cache
def _names_in(path: Path) -> set[str]:
    """Names that a file binds: many modules import from the same package."""
    return _top_level_names(ast.parse(path.read_bytes()))


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
    values = node.__dict__
    tokens.append(type(node).__name__)
    for field in node._fields:
        value: Any = values.get(field)
        if value is None or field == "kind":
            continue
        if isinstance(value, list):
            if field in ("body", "orelse", "finalbody"):
                value = [statement for statement in value if not _is_text(statement)]
            if not value:
                continue
            tokens.append(field)
            for item in value:
                if isinstance(item, ast.AST):
                    _spell(item, tokens)
                else:
                    tokens.append(repr(item))
            tokens.append("]")
        else:
            tokens.append(field)
            if isinstance(value, ast.AST):
                _spell(value, tokens)
            else:
                tokens.append(repr(value))


def _is_text(statement: ast.AST) -> bool:
    """Whether a statement is nothing but a text: the docstring of something, without effect."""
    return (
        isinstance(statement, ast.Expr)
        and isinstance(statement.value, ast.Constant)
        and isinstance(statement.value.value, str)
    )
