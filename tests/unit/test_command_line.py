"""Command lines that follow from signatures, and blocks of parameters in them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal, NamedTuple

import pytest
from hypothesis import given
from hypothesis import strategies as st

from keystab.parameters import Setting
from keystab.utils.command_line import option_of, read_arguments


@dataclass(frozen=True)
class Range:
    """Which numbers are taken (section 5)."""

    low: Annotated[float, Setting("range.low", "lower end")]
    high: Annotated[float | None, Setting("range.high", "upper end")]


class Pair(NamedTuple):
    path: Path
    digest: Path


def everything(
    stores: list[Pair],
    name: str,
    counts: list[int],
    share: float,
    exact: bool,
    how: Literal["nearest", "unit_step"],
    within: Range,
    bits: int | None,
    further: Sequence[float] = (),
    beyond: Pair | None = None,
    *,
    table: Path,
) -> None:
    """Take one of each."""


GIVEN = [
    *("--stores", "a b", "c", "--stores-digest", "a.sum", "c.sum", "--name", "x", "--share", "inf"),
    *("--counts", "3", "15", "--exact", "FALSE", "--how", "unit_step", "--low", "1e-3"),
    *("--high", "None", "--bits", "8", "--table", "t.csv"),
]


def test_arguments_have_the_types_of_the_signature():
    assert read_arguments(everything, GIVEN, {}) == {
        "stores": [Pair(Path("a b"), Path("a.sum")), Pair(Path("c"), Path("c.sum"))],
        "name": "x",
        "counts": [3, 15],
        "share": math.inf,
        "exact": False,
        "how": "unit_step",
        "within": Range(0.001, None),
        "bits": 8,
        "table": Path("t.csv"),
    }


def test_what_has_a_default_may_be_given():
    more = ["--further", "-1", "nan", "--beyond", "s", "--beyond-digest", "s.sum"]
    found = read_arguments(everything, [*GIVEN, *more], {})
    assert found["further"][0] == -1 and math.isnan(found["further"][1])
    assert found["beyond"] == Pair(Path("s"), Path("s.sum"))


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ([], "required: --stores"),
        ([*GIVEN, "--bits", "8.5"], "argument --bits: '8.5', allowed is a whole number or None"),
        ([*GIVEN, "--exact", "yes"], "argument --exact: 'yes', allowed is true or false"),
        ([*GIVEN, "--how", "near"], "argument --how: 'near', allowed is nearest or unit_step"),
        ([*GIVEN, "--low", "None"], "argument --low: 'None', allowed is a number"),
        ([*GIVEN, "--beyond", "s"], "--beyond, --beyond-digest go together: give all or none"),
        ([*GIVEN, "--stores", "a"], "--stores, --stores-digest need the same number of values"),
        ([*GIVEN, "--tab", "t"], "unrecognized arguments: --tab t"),  # no abbreviations
    ],
)
def test_wrong_words_are_named_with_what_is_allowed(words, said, capsys):
    with pytest.raises(SystemExit) as caught:
        read_arguments(everything, words, {})
    assert caught.value.code == 2
    assert said in capsys.readouterr().err.splitlines()[-1]


def test_the_help_says_what_each_argument_means(capsys):
    with pytest.raises(SystemExit) as caught:
        read_arguments(everything, ["--help"], {"stores": "views of the scene"})
    assert caught.value.code == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "Take one of each." in said and "--stores path [path ...] views of the scene" in said
    assert "Which numbers are taken (section 5): --low number lower end" in said
    assert "--how nearest|unit_step" in said and "what it writes: --table path" in said


@given(st.floats(allow_nan=False))
def test_numbers_are_read_as_python_spells_them(value):
    assert option_of(float).read(str(value)) == value
    assert option_of(float | None).read(repr(value)) == value


@given(st.text(min_size=1).filter(lambda text: text != "None"))
def test_texts_are_taken_as_they_are(text):
    assert option_of(str).read(text) == text == option_of(str | None).read(text)
