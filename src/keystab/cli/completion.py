"""Shell completion: a script for each shell, written from the parser.

The script itself knows commands, options and words, so that the Tab key starts no Python.
"""

from __future__ import annotations

import argparse
import re
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

from keystab._version import __version__
from keystab.cli.known_parser import Parser

__all__ = ["SHELLS", "WORDS", "completion", "script"]

SHELLS = ("bash", "zsh", "fish")

WORDS: Mapping[tuple[str, str], tuple[str, ...]] = {
    ("scene", "kind"): ("dead-leaves", "fractal", "edges", "line-art", "text"),
    ("audit", "detectors"): (
        *("opencv", "skimage", "vlfeat", "colmap", "kaze", "akaze", "kornia", "keystab"),
    ),
    ("blur", "background"): ("border",),
    **{(name, "camera_blur"): ("auto",) for name in ("detect", "uncertainty", "truth")},
    **{(name, "n_oct"): ("all",) for name in ("detect", "uncertainty")},
}
"""Words of arguments, by command and name, that the parser takes among others."""

_FILES = {"python", "configfile", "detectors"}
"""Arguments that name files, beside those that the parser makes paths of."""

_LONGEST = 70
"""Letters of what is said of an option."""


class _Argument(NamedTuple):
    """An option, or where it has no names, what stands without one."""

    names: tuple[str, ...]
    metavar: str
    about: str
    values: int | str
    """How many it takes: 0, 1, another number, or + or * for any."""
    words: tuple[str, ...]
    files: bool


def completion(args: argparse.Namespace) -> None:
    """Print the script of a shell."""
    print(script(args.shell, args.parser), end="")


def script(shell: str, parser: Parser) -> str:
    """Script that completes the command line of a parser.

    Parameters
    ----------
    shell : {"bash", "zsh", "fish"}
    parser : Parser
        Of all commands.

    Examples
    --------
    >>> from keystab.cli.parser import build_parser
    >>> "detect --colour'" in script("bash", build_parser())
    True
    """
    arguments = {name: _arguments(name, its) for name, its in parser.commands.items()}
    about = {name: _short(its.summary) for name, its in parser.commands.items()}
    head = f"# Completion of keystab {__version__}, made by: keystab completion {shell}\n"
    write = {"bash": _bash, "zsh": _zsh, "fish": _fish}[shell]
    lines = write(about, arguments)
    return "\n".join(["#compdef keystab", head] if shell == "zsh" else [head]) + "\n".join(
        [*lines, ""]
    )


def _arguments(command: str, parser: Parser) -> list[_Argument]:
    """Arguments of a command."""
    found = []
    for its in parser.arguments:
        words = tuple(map(str, its.choices or ())) or WORDS.get((command, its.dest), ())
        found.append(
            _Argument(
                tuple(its.option_strings),
                its.metavar if isinstance(its.metavar, str) else its.dest,
                _short(its.help or ""),
                1 if its.nargs is None or its.nargs == "?" else its.nargs,
                words,
                its.type is Path or its.dest in _FILES,
            )
        )
    return found


def _short(text: str) -> str:
    """The first part of what is said of an argument, without what shells would read."""
    first = re.split(r"[;:(]", text.replace("%%", "%"))[0].strip()
    plain = re.sub(r"[^\w ,./%-]", "", first)
    return plain if len(plain) <= _LONGEST else plain[:_LONGEST].rpartition(" ")[0]


def _options(arguments: list[_Argument]) -> list[_Argument]:
    return [each for each in arguments if each.names]


def _plain(arguments: list[_Argument]) -> tuple[list[str], bool]:
    """Words that may stand without an option, and whether files may."""
    plain = [each for each in arguments if not each.names]
    return [word for each in plain for word in each.words], any(each.files for each in plain)


def _bash(about: Mapping[str, str], arguments: Mapping[str, list[_Argument]]) -> list[str]:
    values, options, plain = [], [], []
    for command, its in arguments.items():
        for each in _options(its):
            if each.values:
                cases = " | ".join(f"'{command} {name}'" for name in each.names)
                values.append(f"        {cases}) words='{' '.join(each.words)}' ;;")
        names = " ".join(name for each in _options(its) for name in each.names)
        words, _ = _plain(its)
        options.append(f"                {command}) words='{names}' ;;")
        plain += [f"                {command}) words='{' '.join(words)}' ;;"] if words else []
    # What no word completes, bash completes by names of files (-o default).
    return [
        "_keystab() {",
        "    local word=${COMP_WORDS[COMP_CWORD]} before=${COMP_WORDS[COMP_CWORD - 1]} words=",
        "    COMPREPLY=()",
        "    if [[ $COMP_CWORD -eq 1 ]]; then",
        f"        words='{' '.join(about)} --help --version'",
        "    else",
        '        case "${COMP_WORDS[1]} $before" in',
        *values,
        "        *)",
        '            case "$word" in',
        "            -*)",
        '                case "${COMP_WORDS[1]}" in',
        *options,
        "                esac",
        "                ;;",
        "            *)",
        '                case "${COMP_WORDS[1]}" in',
        *plain,
        "                esac",
        "                ;;",
        "            esac",
        "            ;;",
        "        esac",
        "    fi",
        '    [[ -z $words ]] || COMPREPLY=($(compgen -W "$words" -- "$word"))',
        "}",
        "complete -o bashdefault -o default -F _keystab keystab",
    ]


def _zsh(about: Mapping[str, str], arguments: Mapping[str, list[_Argument]]) -> list[str]:
    commands = [f"        '{name}:{said}'" for name, said in about.items()]
    cases = []
    for command, its in arguments.items():
        specs = [spec for each in its for spec in _zsh_specs(each)]
        cases += [f"    {command})", "        _arguments \\"]
        cases += [f"            {spec} \\" for spec in specs[:-1]]
        cases += [f"            {specs[-1]}", "        ;;"]
    return [
        "_keystab() {",
        "    if ((CURRENT == 2)); then",
        "        local -a commands=(",
        *commands,
        "        )",
        "        _describe command commands",
        "        return",
        "    fi",
        "    local command=$words[2]",
        "    words=(keystab ${words[3,-1]})",
        "    ((CURRENT--))",
        "    case $command in",
        *cases,
        "    esac",
        "}",
        # As a file in $fpath it is called; given to eval, it says what it completes.
        'if [[ $funcstack[1] == _keystab ]]; then _keystab "$@"; else compdef _keystab keystab; fi',
    ]


def _zsh_specs(argument: _Argument) -> list[str]:
    """What ``_arguments`` is told of one argument."""
    action = "_files" if argument.files else " "
    if argument.words:
        words = " ".join(argument.words)
        action = f"_alternative 'words:word:({words})' 'files:file:_files'"
        action = f"{{{action}}}".replace("'", '"') if argument.files else f"({words})"
    value = f":{argument.metavar}:{action}"
    any_number = argument.values in ("+", "*")
    if not argument.names:
        return [f"'{'*' if any_number else ''}{value}'"]
    values = value * (1 if any_number else int(argument.values))
    return [f"'{name}[{argument.about}]{values}'" for name in argument.names]


def _fish(about: Mapping[str, str], arguments: Mapping[str, list[_Argument]]) -> list[str]:
    lines = ["complete -c keystab -f"]
    lines += [
        f"complete -c keystab -n __fish_use_subcommand -a {name} -d '{said}'"
        for name, said in about.items()
    ]
    for command, its in arguments.items():
        where = f"complete -c keystab -n '__fish_seen_subcommand_from {command}'"
        words, files = _plain(its)
        lines += [f"{where} -F"] if files else []
        lines += [f"{where} -a '{' '.join(words)}'"] if words else []
        for each in _options(its):
            names = [
                f"-l {name[2:]}" if name.startswith("--") else f"-s {name[1:]}"
                for name in each.names
            ]
            value = (" -r -F" if each.files else " -x") if each.values else ""
            own = f" -a '{' '.join(each.words)}'" if each.words else ""
            lines.append(f"{where} {' '.join(names)}{value}{own} -d '{each.about}'")
    return lines
