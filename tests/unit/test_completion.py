"""Completion: the script of each shell knows what the parser knows, and the shells take it."""

from __future__ import annotations

import re
import shutil
import subprocess

import pytest

from keystab.audit.detectors import DETECTORS
from keystab.camera.made_scenes import KINDS
from keystab.cli import main as cli
from keystab.cli.completion import SHELLS, WORDS, script
from keystab.cli.parser import build_parser

PARSER = build_parser()


def in_bash(line: str) -> list[str]:
    """What bash is offered for the last word of a line."""
    words = line.split(" ")
    quoted = " ".join(f"'{word}'" for word in words)
    ask = (
        f"COMP_WORDS=({quoted}); COMP_CWORD={len(words) - 1}; _keystab; "
        'printf "%s\\n" "${COMPREPLY[@]}"'
    )
    code = script("bash", PARSER) + ask
    run = subprocess.run(
        ["bash", "--norc", "--noprofile", "-c", code], capture_output=True, text=True
    )
    assert run.returncode == 0 and not run.stderr, run.stderr
    return run.stdout.split()


def test_commands_and_their_arguments_are_those_of_the_help():
    # `argparse` says publicly only what it prints.
    named = re.findall(r"^    (\w+)\s", PARSER.format_help(), re.MULTILINE)
    assert list(PARSER.commands) == named
    for parser in PARSER.commands.values():
        printed = re.findall(r"^  (-.*?)(?:  |$)", parser.format_help(), re.MULTILINE)
        flags = {flag for line in printed for flag in re.findall(r"(?<![\w-])--?[a-z][\w-]*", line)}
        assert {name for its in parser.arguments for name in its.option_strings} == flags


def test_words_are_those_that_the_commands_take():
    assert WORDS["scene", "kind"] == KINDS
    assert set(WORDS["audit", "detectors"]) == {each.name for each in DETECTORS}
    for command, name in WORDS:
        assert name in {its.dest for its in PARSER.commands[command].arguments}


@pytest.mark.parametrize(
    ("line", "offered"),
    [
        ("keystab unc", ["uncertainty"]),
        ("keystab scene fr", ["fractal"]),
        ("keystab uncertainty photo.png --colour s", ["survival", "sign"]),
        ("keystab truth photo.png --colour s", ["sign"]),
        ("keystab detect --no-", ["--no-refine", "--no-scale-moves"]),
        ("keystab uncertainty p.png --camera-blur ", ["auto"]),
        ("keystab detect p.png -o ", []),  # bash itself offers files
        ("keystab detect ", []),
        ("keystab nonsense --", []),
    ],
)
def test_bash_is_offered(line, offered):
    assert in_bash(line) == offered


def test_the_script_is_printed(capsys):
    for shell in SHELLS:
        assert cli.main(["completion", shell]) == 0
        assert capsys.readouterr().out == script(shell, PARSER)
    with pytest.raises(SystemExit) as ended:
        cli.main(["completion", "csh"])
    assert ended.value.code == 2 and capsys.readouterr().err.count("\n") == 1


@pytest.mark.parametrize("shell", SHELLS)
def test_shells_can_read_their_script(shell, tmp_path):
    if shutil.which(shell) is None:
        pytest.skip(f"no {shell}")
    (tmp_path / "script").write_text(script(shell, PARSER))
    run = subprocess.run(
        [shell, "-n", str(tmp_path / "script")], capture_output=True, text=True
    )  # fmt: skip
    assert (run.returncode, run.stderr) == (0, "")


@pytest.mark.parametrize("shell", ["zsh", "fish"])
def test_files_are_offered_where_a_command_takes_them_and_nowhere_else(shell):
    lines = script(shell, PARSER).splitlines()

    def of(command, flag):
        if shell == "fish":
            return next(it for it in lines if f"from {command}'" in it and f" -l {flag} " in it)
        start = lines.index(f"    {command})")
        return next(it for it in lines[start:] if f"'--{flag}[" in it)

    sign = " -F" if shell == "fish" else "_files"
    for command, flag in (("detect", "output"), ("detect", "draw"), ("scene", "output")):
        assert sign in of(command, flag)
    for command, flag in (("detect", "n-oct"), ("scene", "seed"), ("audit", "time-limit")):
        assert sign not in of(command, flag)


def test_fish_offers_files_where_one_of_several_words_may_be_a_file():
    whole = {line for line in script("fish", PARSER).splitlines() if line.endswith(" -F")}
    named = {
        line.split("seen_subcommand_from ")[1].split("'")[0] for line in whole if " -l " not in line
    }
    assert {"detect", "truth", "uncertainty", "simulate"} <= named
    assert "scene" not in named  # KIND is one of a few words
