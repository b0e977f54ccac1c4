"""What is said to a person who asks for a file that no rule makes with these settings."""

from __future__ import annotations

import difflib
import logging
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Any

from keystab.study.overlays import on_command_line, overlays_of
from keystab.study.result_folders import normal_folder

__all__ = ["Offered"]

_NO_RULE = re.compile(r"No rule to produce (.+?) \(if you use")
_NO_SET = re.compile(r"KeyError: '(\w+)'.*^ *set=\1$", re.MULTILINE | re.DOTALL)


@dataclass(frozen=True)
class Offered:
    """What can be asked for with some settings.

    Parameters
    ----------
    settings : mapping
        Complete settings; folders ``results`` and ``figures`` of them count, and ``sets``.
    scenes : iterable of str
        Places of scenes (`keystab.study.scenes.by_place`).
    rules : iterable
        Rules of Snakemake; those that come later count too.
    files : sequence of str
        Files that a person may want; those that rules name without wildcards count too.
    project : path, optional
        Folder of the project.
    """

    settings: Mapping[str, Any]
    scenes: Iterable[str]
    rules: Iterable[Any]
    files: Sequence[str]
    project: Path = Path()

    def listen(self, logger: logging.Logger) -> None:
        """Hear what Snakemake logs, and let those of workflows read before hear no more."""
        for heard in list(logger.filters):
            if type(getattr(heard, "__self__", None)).__name__ == type(self).__name__:
                logger.removeFilter(heard)
        logger.addFilter(self.explain)

    def explain(self, record: logging.LogRecord) -> bool:
        """Put what Snakemake logs of a wrong target into a person's words; a filter of its log."""
        kind, said = getattr(record, "exception", ""), record.getMessage()
        told = ""
        if kind == "MissingRuleException" and (found := _NO_RULE.search(said)):
            told = self.instead_of(found[1])
        elif kind == "InputFunctionException" and (found := _NO_SET.search(said)):
            told = self.instead_of_set(found[1])
        if told:
            record.msg, record.args = f"error: {told}", ()
        return True

    def instead_of_set(self, name: str) -> str:
        """One line for a set of views that the settings do not have."""
        names = [*self.settings["sets"]]
        near = difflib.get_close_matches(name, names, n=3)
        if near:
            return f"these settings have no set of views {name!r}; did you mean {_either(near)}?"
        return f"these settings have no set of views {name!r}; they have {', '.join(names)}"

    def instead_of(self, target: str) -> str:
        """One line for a file that no rule makes: where it is made, or what is called nearly so.

        Parameters
        ----------
        target : str
            As a person typed it.
        """
        path = normal_folder(target, self.project.absolute())
        return (
            self._other_scene(path)
            or self._elsewhere(path)
            or self._nearest(path)
            or f"{path}: these settings make no such file; figures are "
            f"{self.settings['figures']}/fig1.pdf and so on, tables lie in "
            f"{self.settings['results']}/tables, and make help lists what there is besides"
        )

    def _is_made(self, path: str) -> bool:
        return any(rule.is_producer(path) for rule in self.rules)

    def _wanted(self) -> Iterator[str]:
        """What may have been meant: files, and names of rules."""
        yield from self.files
        for rule in self.rules:
            yield from (str(file) for file in rule.output if "{" not in str(file))
            yield rule.name

    def _elsewhere(self, path: str) -> str:
        """Where these settings put such a file; nothing where they make none."""
        parts = PurePosixPath(path).parts
        for start in range(len(parts)):
            for key, verb in (("figures", "draw into"), ("results", "write to")):
                folder = self.settings[key]
                other = "/".join((folder, *parts[start:]))
                if other == path or not self._is_made(other):
                    continue
                line = f"{path}: these settings {verb} {folder}: type {other}"
                typed = "/".join(parts[:start])
                files = overlays_of(self.project, typed, key) if typed else None
                if files:
                    line += f" ({path} is made with{on_command_line(files, make=False)})"
                elif files is not None:
                    line += f" ({path} is made without --configfile and WITH=)"
                return line
        return ""

    def _other_scene(self, path: str) -> str:
        """Which scenes there are, where a file of another one would be made."""
        found = re.search("(?<=/scenes/)[^/]+(?=/)", path)
        names = [place.split("/")[1] for place in self.scenes if place]
        if not found or not names or found[0] in names:
            return ""
        if not self._is_made(f"{path[: found.start()]}{names[0]}{path[found.end() :]}"):
            return ""
        if near := difflib.get_close_matches(found[0], names, n=3):
            return f"{path}: there is no scene {found[0]!r}; did you mean {_either(near)}?"
        more = f" and {len(names) - 6} more, of config/scenes.csv" if len(names) > 7 else ""
        known = ", ".join(names[: 6 if more else None])
        return f"{path}: there is no scene {found[0]!r}; there are {known}{more}"

    def _nearest(self, path: str) -> str:
        """Files whose names are nearly the same; those in the right folder first."""
        name = PurePosixPath(path).name
        by_name: dict[str, list[str]] = {}
        for file in dict.fromkeys(self._wanted()):
            by_name.setdefault(PurePosixPath(file).name, []).append(file)
        stem, dot, suffix = name.partition(".")
        # A table of figure 5 for one that would be called like the figure, another kind of a file.
        own = [it for it in by_name if dot and re.match(rf"{re.escape(stem)}[._]", it)]
        own = [it for it in own if it.endswith(f".{suffix}")] or own
        near = own or difflib.get_close_matches(name, by_name, n=3)
        files = [file for each in near for file in by_name[each]][:3]
        if not files:
            return ""
        return f"{path}: these settings make no such file; did you mean {_either(files)}?"


def _either(names: Sequence[str]) -> str:
    *others, last = names
    return f"{', '.join(others)} or {last}" if others else last
