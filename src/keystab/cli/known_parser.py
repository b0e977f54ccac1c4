"""A parser of command lines that can be asked for its commands and their arguments.

`argparse` keeps them to itself; shell completion is written from them.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from typing import Any, NoReturn

__all__ = ["BAD_INPUT", "Parser"]

BAD_INPUT = 2
"""Exit status for input that cannot be worked with."""


class Parser(argparse.ArgumentParser):
    """A parser that reports an error in one line, without its usage.

    Attributes
    ----------
    summary : str
        What its command does, in some words.
    arguments : list of argparse.Action
        Its arguments, in the order in which they were added.
    commands : dict of str to Parser
        Its commands by name.
    """

    def __init__(self, *args: Any, **options: Any) -> None:
        self.summary = ""
        self.arguments: list[argparse.Action] = []
        self.commands: dict[str, Parser] = {}
        self._begin: Callable[..., Parser] | None = None
        super().__init__(*args, **options)

    def error(self, message: str) -> NoReturn:
        """End with one line on standard error."""
        self.exit(BAD_INPUT, f"{self.prog}: {message}; see {self.prog} --help\n")

    def add_argument(self, *names: Any, **options: Any) -> argparse.Action:
        """Add an argument, as `argparse` does."""
        return self._known(super().add_argument(*names, **options))

    def add_group(self, title: str) -> Callable[..., argparse.Action]:
        """Begin a group of arguments in the help; what is returned adds one to it."""
        group = self.add_argument_group(title)
        return lambda *names, **options: self._known(group.add_argument(*names, **options))

    def begin_commands(self) -> None:
        """Let `add_command` add commands, of which a command line names one."""
        commands = self.add_subparsers(dest="command", required=True, metavar="COMMAND")
        self._begin = commands.add_parser

    def add_command(self, name: str, help: str, **options: Any) -> Parser:
        """Add a command; what is returned takes its arguments."""
        assert self._begin is not None, "begin_commands comes first"
        command = self._begin(name, help=help, **options)
        command.summary = help
        self.commands[name] = command
        return command

    def _known(self, argument: argparse.Action) -> argparse.Action:
        self.arguments.append(argument)
        return argument
