"""What is read of a stranger's results is read in bounds, and words are held against words."""

from __future__ import annotations

import pandas as pd
import pytest

from keystab.errors import InputError
from keystab.provenance.foreign_tables import read_foreign_table
from keystab.provenance.result_checks import (
    _but_for_rounding,
    _check_joins,
    left_out_rows,
    listed_in,
    verdicts_in,
)
from keystab.study.claims import parse_claims

DIGEST = 64 * "0"


@pytest.mark.parametrize(
    ("text", "found"),
    [
        (f"{DIGEST}  a b\n", {"a b": DIGEST}),
        ("", {}),
        (f"{DIGEST}  a", None),
        (f"{DIGEST} a\n", None),
        (f"{DIGEST}  a\n\n", None),
        (f"{DIGEST}  a\n{DIGEST}  a\n", None),
        (f"{DIGEST}  a\r\n", {"a\r": DIGEST}),
        ("x", None),
        (b"\xff", None),
    ],
)
def test_a_list_of_digests_holds_nothing_else(text, found, tmp_path):
    path = tmp_path / "sums"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    if found is None:
        with pytest.raises(InputError, match="is no list of digests"):
            listed_in(path)
    else:
        assert listed_in(path) == found


@pytest.mark.parametrize(
    "text", ["", "a\n", "path,bytes,sha256,rule\nx\n", "path,bytes,sha256,rule\nx,1,2,3,4\n",
             "path,bytes,sha256,rule\nx,1,2,3\nx,1,2,3\n", "path,bytes,sha256,rule\n\0,1,2,3\n"],
)  # fmt: skip
def test_a_list_of_what_is_left_out_has_its_columns(text, tmp_path):
    assert left_out_rows(tmp_path) == {}
    (tmp_path / "left-out.csv").write_text(text)
    with pytest.raises(InputError, match="left-out.csv: is no list of files"):
        left_out_rows(tmp_path)


@pytest.mark.parametrize(
    ("suffix", "text"),
    [
        ("csv", "id\na\n"), ("csv", "id,verdict\na\n"), ("csv", "id,verdict\na,b\na,c\n"),
        ("csv", "id,verdict\n\"a,b\n"), ("csv", f"id,verdict\n{200_000 * 'a'},b\n"),
        ("json", "{}x"), ("json", "[1]"), ("json", '[{"id": "a"}]'), ("json", "[" * 100_000),
        ("json", '[{"id": ["a"], "verdict": "b"}]'), ("md", "## A\n| `a`\n| `a`\n"),
    ],
)  # fmt: skip
def test_what_is_no_ledger_is_said_in_one_line(suffix, text, tmp_path):
    path = tmp_path / f"claims.{suffix}"
    path.write_text(text)
    with pytest.raises(InputError, match=f"claims.{suffix}: is no report on claims"):
        verdicts_in(path)


@pytest.mark.parametrize(
    ("one", "other", "same"),
    [
        ("rate 0.1234", "rate 0.1234", True),
        ("rate 0.1234", "rate 0.1235", True),
        ("rate 0.1234", "rate 0.1334", False),
        ("rate 0.1234", "rate 0.1236", False),
        ("rate 0.12", "rate 0.1201", True),
        ("120 unique", "121 unique", False),
        ("0.97402597402597402", "0.97402597402597", True),
        ("0.97402597402597402", "0.97402597403", False),
        ("rate 0.1234", "ratio 0.1234", False),
        ("1e-20 to 3", "0 to 3", True),
        ("1 to 3", "1 to 3 to 5", False),
        ("not reproduced", "reproduced", False),
    ],
)
def test_words_must_agree_and_numbers_but_for_rounding(one, other, same, tmp_path):
    for name, text in (("one", one), ("other", other)):
        (tmp_path / name).write_text(text)
    assert _but_for_rounding(tmp_path / "one", tmp_path / "other") is same


def test_tables_are_joined_in_bounds():
    value = {"q": {"table": ["a", "b"], "column": "x", "take": "max"}}
    entry = {"id": "c", "where": "1", "statement": "s", "paper": "p", "criterion": "q < 1"}
    claims = parse_claims([{**entry, "value": value}])
    many = pd.DataFrame({"k": 3000 * [1], "x": 1.0})
    one = pd.DataFrame({"k": [1], "y": [1.0]})
    _check_joins(claims, {"a": many, "b": one})
    with pytest.raises(InputError, match="a and b: give too many rows"):
        _check_joins(claims, {"a": many, "b": pd.DataFrame({"k": 3000 * [1], "y": 1.0})})


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("a,b\n1,2,3\n", "more fields than names"),
        ("a\n" + 5000 * "1" + "\n", "too long lines"),
        (2500 * "a," + "b\n", "too long lines"),
        ("a,b\n1,2\n1,2,3\n", "not a readable .csv table"),
    ],
)
def test_odd_tables_are_refused(text, said, tmp_path):
    path = tmp_path / "t.csv"
    path.write_text(text)
    with pytest.raises(InputError, match=said):
        read_foreign_table(path)
