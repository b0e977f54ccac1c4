"""Command lines that follow from signatures: the options of a typed function."""

from __future__ import annotations

import argparse
import collections.abc
import inspect
import types
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import is_dataclass
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple, Union, get_args, get_origin, get_type_hints


class Option(NamedTuple):
    """How the value of an option is read."""

    kind: Callable[[str], Any]
    allowed: str
    many: bool = False
    """Whether it takes several values."""

    def read(self, text: str) -> Any:
        """Value of a word; a wrong one is named with what is allowed."""
        try:
            return self.kind(text)
        except ValueError:
            raise argparse.ArgumentTypeError(f"{text!r}, allowed is {self.allowed}") from None


def option_of(kind: Any) -> Option:
    """Option for a type: a text, number, truth value, path or choice, a list of them, or None.

    Examples
    --------
    >>> [option_of(kind).read("inf") for kind in (str, float, float | None)]
    ['inf', inf, inf]
    >>> option_of(bool).read("False"), option_of(int | None).read("None")
    (False, None)
    >>> option_of(Literal["spline", "cosine"]).allowed
    'spline or cosine'
    """
    origin, inner = get_origin(kind), get_args(kind)
    if origin is Annotated:
        return option_of(inner[0])
    if origin in (list, collections.abc.Sequence):
        return option_of(inner[0])._replace(many=True)
    if origin in (Union, types.UnionType):
        (own,) = (option_of(each) for each in inner if each is not type(None))
        return Option(_or_none(own.kind), f"{own.allowed} or None", own.many)
    if origin is Literal:
        return Option(_one_of(inner), " or ".join(inner))
    if kind is bool:
        return Option(_truth, "true or false")
    names = {int: "a whole number", float: "a number", str: "a text", Path: "a path"}
    return Option(kind, names[kind])


def _or_none(read: Callable[[str], Any]) -> Callable[[str], Any]:
    return lambda text: None if text == "None" else read(text)


def _one_of(allowed: Sequence[str]) -> Callable[[str], str]:
    return lambda text: allowed[allowed.index(text)]  # ValueError where there is none


def _truth(text: str) -> bool:
    return ("false", "true").index(text.lower()) == 1


class _Argument(NamedTuple):
    """An argument of a function, and the options that it is made from."""

    name: str
    title: str
    """Group of its options in the help."""
    options: dict[str, tuple[Any, str]]
    """Their types and what they mean, by their names."""
    build: Callable[..., Any]
    """Makes it from their values."""
    required: bool


def read_arguments(
    function: Callable[..., None], argv: Sequence[str] | None, meanings: Mapping[str, str]
) -> dict[str, Any]:
    """Arguments of a function from the words of a command line.

    Parameters
    ----------
    function : callable
        An argument has a type that `option_of` reads; or it is a block, a dataclass with an option
        for each field, whose annotation has a ``meaning``; or a named tuple of paths or a list of
        them, with the options ``--name --name-field`` and so on. What has no default must be given;
        of what has one, all options are given or none.
    argv : sequence of str, optional
        The words; those of the process by default.
    meanings : mapping
        What options mean that belong to no block, for the help.

    Returns
    -------
    dict
        Arguments by their names.

    Raises
    ------
    SystemExit
        After the help, or one line about words that are wrong, missing or none of the options.
    """
    known = list(_arguments(function, meanings))
    parser = _parser(function, known)
    given = vars(parser.parse_args(argv))
    arguments = {}
    for one in known:
        own = {name: given[name] for name in one.options if name in given}
        if own:
            if len(own) < len(one.options):
                parser.error(f"{_flags(one)} go together: give all or none")
            try:
                arguments[one.name] = one.build(**own)
            except ValueError:
                parser.error(f"{_flags(one)} need the same number of values")
    return arguments


def _arguments(function: Callable[..., None], meanings: Mapping[str, str]) -> Iterator[_Argument]:
    kinds = get_type_hints(function, include_extras=True)
    for name, parameter in inspect.signature(function).parameters.items():
        kind, required = kinds[name], parameter.default is parameter.empty
        own: Any = _several(kind)
        many = get_origin(kind) is list
        title = "what it writes" if parameter.kind is parameter.KEYWORD_ONLY else "what it takes"
        if is_dataclass(own):
            title = (own.__doc__ or "").splitlines()[0].rstrip(".")
            types_ = get_type_hints(own, include_extras=True)
            options = {key: (each, each.__metadata__[0].meaning) for key, each in types_.items()}
            yield _Argument(name, title, options, _built(own), required)
        elif own:
            names = [name, *(f"{name}_{field}" for field in own._fields[1:])]
            options = {key: (list[Path] if many else Path, meanings.get(key, "")) for key in names}
            yield _Argument(name, title, options, _tuples(own, many), required)
        else:
            options = {name: (kind, meanings.get(name, ""))}
            yield _Argument(name, title, options, lambda **own: next(iter(own.values())), required)


def _several(kind: Any) -> Any:
    """Block or named tuple that a type is, is a list of, or may be; None for other types."""
    optional = get_origin(kind) in (Union, types.UnionType)
    inner = get_args(kind) if optional or get_origin(kind) is list else (kind,)
    return next((each for each in inner if is_dataclass(each) or hasattr(each, "_fields")), None)


def _built(block: Any) -> Callable[..., Any]:
    return lambda **own: block(**own)


def _tuples(kind: Any, many: bool) -> Callable[..., Any]:
    if many:
        return lambda **own: [kind(*each) for each in zip(*own.values(), strict=True)]
    return lambda **own: kind(*own.values())


def _flags(argument: _Argument) -> str:
    return ", ".join(f"--{name.replace('_', '-')}" for name in argument.options)


def _parser(function: Callable[..., None], known: Sequence[_Argument]) -> argparse.ArgumentParser:
    """Parser with a group of options for what is taken, for each block, and for what is written."""
    parser = argparse.ArgumentParser(
        description=inspect.getdoc(function),
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
        argument_default=argparse.SUPPRESS,
    )
    groups: dict[str, Any] = {}
    for one in known:
        if one.title not in groups:
            groups[one.title] = parser.add_argument_group(one.title)
        for name, (kind, meaning) in one.options.items():
            option = option_of(kind)
            groups[one.title].add_argument(
                f"--{name.replace('_', '-')}",
                dest=name,
                type=option.read,
                nargs="+" if option.many else None,
                required=one.required,
                metavar=option.allowed.removeprefix("a ").replace(" or ", "|").replace(" ", "-"),
                help=meaning,
            )
    return parser
