"""The ledger of claims: its language, its verdicts, and the file that comes with the study."""

from __future__ import annotations

import copy
import csv
import json
import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from keystab import __version__
from keystab.errors import InputError
from keystab.stages import check_claims
from keystab.study import claims, claims_report, expressions, verdicts
from keystab.study.plan import FIGURES

ROOT = Path(__file__).parents[2]
LEDGER = ROOT / "config/claims.yaml"
LISTED = claims.read_claims(LEDGER)

RATES = pd.DataFrame(
    {
        "n_spo": [15, 3, 5],
        "rate": [0.1, 0.4, 0.2],
        "low": [0.09, 0.3, 0.1],
        "high": [0.11, 0.5, 0.3],
    }
)
TABLES = {"rates": RATES}

ENTRY = {
    "id": "falls",
    "where": "section 5",
    "statement": "The rate falls to a tenth.",
    "figure": "fig4",
    "paper": "10 %",
    "value": {
        "coarse": {"table": "rates", "where": "n_spo == 3", "column": "rate", "take": "one"},
        "fine": {"table": "rates", "column": "rate", "take": "last n_spo", "low": "low", "high": "high"},
        "drop": "coarse - fine",
    },
    "criterion": "0.08 <= fine <= 0.12 and drop > 0",
}  # fmt: skip


def entry(**changes):
    changed = copy.deepcopy(ENTRY) | changes
    return {name: value for name, value in changed.items() if value is not None}


def claim(**changes) -> claims.Claim:
    return claims.parse_claims([entry(**changes)])[0]


def taken(column: str, take: str, rows: str = "", **ends: str) -> verdicts.Measured:
    given = claims.Quantity("q", tables=("rates",), rows=rows, column=column, take=take, **ends)
    return verdicts.measured(given, TABLES)


# The language of expressions


@pytest.mark.parametrize(
    ("expression", "value"),
    [
        ("1 + 2 * 3 ** 2 - 8 / 4", 17),
        ("-a + abs(b) + +a", 4),
        ("min(a, b, 7)", -4),
        ("max(a, b)", 3),
        ("a > b", True),
        ("-5 < b < a <= 3", True),
        ("-5 < b < a < 3", False),
        ("a == 3 and not b == 3", True),
        ("a != 3 or b > 0", False),
        ("a < inf", True),
        ("text == 'fine'", True),
        ("a / 0 > 1e300", True),
    ],
)
def test_expressions_mean_what_they_say(expression, value):
    assert expressions.evaluate(expression, {"a": 3.0, "b": -4.0, "text": "fine"}) == value


def test_expressions_work_on_columns():
    names = {name: RATES[name] for name in RATES}
    chosen = expressions.evaluate("n_spo > 3 and (rate < 0.15 or not low < high)", names)
    assert list(chosen) == [True, False, False]
    assert expressions.evaluate("max(rate, 0.2)", names).tolist() == [0.2, 0.4, 0.2]


@pytest.mark.parametrize(
    ("expression", "says"),
    [
        ("open('x')", "does not know open"),
        ("__import__('os')", "does not know __import__"),
        ("a.real", "a.real is not allowed"),
        ("a.real()", "is not allowed"),
        ("a[0]", "is not allowed"),
        ("(lambda: 1)()", "is not allowed"),
        ("[x for x in a]", "is not allowed"),
        ("a if b else 1", "is not allowed"),
        ("max(a, key=b)", "is not allowed"),
        ("max(*a)", "is not allowed"),
        ("abs(a, b)", "abs(...) of 2 values"),
        ("max()", "max(...) of 0 values"),
        ("a := 1", "is no expression"),
        ("a @ b", "MatMult is not allowed"),
        ("a in b", "In is not allowed"),
        ("None", "is not allowed"),
        ("a +", "is no expression"),
        ("", "is no expression"),
        ("c + 1", "does not know c; there is a, b"),
        ("a < 'text'", "with text"),
    ],
)
def test_nothing_else_can_be_said(expression, says):
    with pytest.raises(InputError, match=re.escape(says)) as caught:
        expressions.evaluate(expression, {"a": 1.0, "b": 2.0})
    assert "\n" not in str(caught.value)


# Numbers from tables


@pytest.mark.parametrize(
    ("column", "take", "rows", "value"),
    [
        ("rate", "one", "n_spo == 5", 0.2),
        ("rate", "mean", "", 0.7 / 3),
        ("rate", "median", "", 0.2),
        ("rate", "min", "", 0.1),
        ("rate", "max", "", 0.4),
        ("n_spo", "sum", "n_spo > 3", 20),
        ("rate", "first n_spo", "", 0.4),
        ("rate", "last n_spo", "", 0.1),
        ("rate", "argmax n_spo", "", 3),
        ("rate", "argmin n_spo", "", 15),
        ("rate", "largest_step n_spo", "", -0.1),
        ("rate", "smallest_step n_spo", "", -0.2),
        ("rate > 0.15", "share", "", 2 / 3),
        ("1 - rate / high", "max", "", 1 / 3),
    ],
)
def test_takes(column, take, rows, value):
    assert taken(column, take, rows).value == pytest.approx(value)


def test_intervals_are_those_of_the_row_that_is_taken():
    assert taken("rate", "last n_spo", low="low", high="high")[:3] == (0.1, 0.09, 0.11)
    assert taken("rate", "max", low="low", high="high")[:3] == (0.4, 0.3, 0.5)
    share = taken("rate > 0.15", "share")
    assert 0 < share.low < share.value < share.high < 1


def test_steps_have_the_interval_of_their_two_rows():
    step = taken("rate", "largest_step n_spo", low="low", high="high")
    assert step.value == pytest.approx(-0.1)
    assert (step.low, step.high) == pytest.approx(
        (-0.1 - np.hypot(0.01, 0.1), -0.1 + np.hypot(0.01, 0.1))
    )
    assert (step.extreme, step.chosen_from) == ("max", 2)


def test_extremes_say_of_how_many_they_are_the_largest():
    assert taken("rate", "max")[4:] == ("max", 3) and taken("rate", "last n_spo")[4:] == ("", 1)


def test_ends_may_be_expressions():
    lost = taken("1 - rate", "last n_spo", low="1 - high", high="1 - low")
    assert lost[:3] == pytest.approx((0.9, 0.89, 0.91))


def test_samples_have_the_interval_that_their_number_allows():
    tables = {"rates": pd.DataFrame({"x": np.arange(101.0), "n": 4, "group": np.arange(101) // 2})}

    def of(column, take, by=""):
        given = claims.Quantity("q", tables=("rates",), column=column, take=take, by=by)
        return verdicts.measured(given, tables)[:3]

    assert of("x", "sample_median") == (50, 39, 60)
    half = 1.96 * np.std(np.arange(101), ddof=1) / np.sqrt(101)
    assert of("x", "sample_mean") == pytest.approx((50, 50 - half, 50 + half))
    assert of("x < 50", "share") == pytest.approx((50 / 101, 0.39947, 0.59093), abs=1e-4)
    assert of("n / 4", "pooled", by="n")[0] == 0.25
    # Pairs that always agree say half as much as their members.
    paired, single = (of("x < 50", "share", by=by) for by in ("group", "x"))
    assert paired[0] == single[0]
    assert paired[2] - paired[1] == pytest.approx(2**0.5 * (single[2] - single[1]), rel=0.03)


def test_rows_without_a_number_do_not_count():
    tables = {"rates": pd.DataFrame({"n_spo": [3, 4, 5], "rate": [np.nan, 0.2, 0.1]})}
    quantity = claims.Quantity("q", tables=("rates",), column="rate", take="first n_spo")
    assert verdicts.measured(quantity, tables).value == 0.2


def test_tables_are_joined_on_what_they_share():
    tables = {
        "seen": pd.DataFrame({"keypoint": [0, 0, 1, 1], "n_spo": [3, 5, 3, 5], "detected": [1, 1, 1, 0]}),
        "unique": pd.DataFrame({"keypoint": [0, 1], "stability": [1.0, 0.5]}),
    }  # fmt: skip
    quantity = claims.Quantity(
        "q", tables=("seen", "unique"), rows="detected == 1", column="stability < 1", take="share"
    )
    assert verdicts.measured(quantity, tables).value == pytest.approx(1 / 3)


@pytest.mark.parametrize(
    ("column", "take", "rows", "missing"),
    [
        ("rate", "one", "n_spo == 4", "rates has no row with n_spo == 4"),
        ("rate", "share", "n_spo > 20", "rates has no row with n_spo > 20"),
        ("rate", "largest_step n_spo", "n_spo == 3", "rates has only one row with n_spo == 3"),
    ],
)
def test_missing_rows_are_named(column, take, rows, missing):
    found = taken(column, take, rows)
    assert np.isnan(found.value) and found.missing == missing


@pytest.mark.parametrize(
    ("column", "take", "rows", "says"),
    [
        ("rate", "one", "", "has 3 rows"),
        ("speed", "mean", "", "does not know speed"),
        ("rate", "mean", "speed > 1", "does not know speed"),
        ("rate", "first speed", "", "has no column speed"),
    ],
)
def test_what_a_table_cannot_give_is_an_error(column, take, rows, says):
    with pytest.raises(InputError, match=says):
        taken(column, take, rows)


# Verdicts


def verdict(**changes) -> str:
    return verdicts.outcome_of(claim(**changes), TABLES).verdict


WEAKER = {"criterion": "drop > 0", "words": "it falls at least"}


def test_every_verdict_can_be_given():
    given = {
        "reproduced": verdict(),
        "not reproduced": verdict(criterion="fine > 0.5"),
        "reproduced with a condition": verdict(criterion="fine > 0.5", condition=WEAKER),
        "undecided": verdict(criterion="fine > 0.095"),
        "not testable": verdict(value=None, criterion=None, reason="It is not published."),
    }
    assert list(given) == list(given.values())
    assert set(given) == set(verdicts.VERDICTS)


def test_a_criterion_that_holds_needs_no_condition():
    judged = verdicts.outcome_of(claim(condition=WEAKER), TABLES)
    assert (judged.verdict, judged.note) == ("reproduced", "")


def test_a_condition_that_fails_too_saves_nothing():
    assert verdict(criterion="fine > 0.5", condition=WEAKER | {"criterion": "drop < 0"}) == (
        "not reproduced"
    )


def test_the_condition_is_told():
    judged = verdicts.outcome_of(
        claim(criterion="fine > 0.5", condition=WEAKER, note="See."), TABLES
    )
    assert judged.note == "Condition: it falls at least. See."


def test_other_numbers_flip_the_verdict():
    flipped = {"rates": RATES.assign(**{name: 2 * RATES[name] for name in ("rate", "low", "high")})}
    assert verdicts.outcome_of(claim(), TABLES).verdict == "reproduced"
    assert verdicts.outcome_of(claim(), flipped).verdict == "not reproduced"


def test_missing_rows_make_a_claim_not_testable():
    coarse = {"rates": RATES[RATES["n_spo"] > 3]}
    judged = verdicts.outcome_of(claim(), coarse)
    assert judged.verdict == "not testable"
    assert judged.note == "Missing: rates has no row with n_spo == 3."
    # Numbers that no criterion uses may be missing.
    assert verdicts.outcome_of(claim(criterion="fine > 0"), coarse).verdict == "reproduced"
    # A condition that cannot be asked does not excuse.
    judged = verdicts.outcome_of(claim(criterion="fine > 0.5", condition=WEAKER), coarse)
    assert judged.verdict == "not reproduced" and "Its condition is not tested" in judged.note


def test_nothing_over_nothing_is_not_testable():
    value = ENTRY["value"] | {"ratio": "(fine - fine) / (coarse - coarse)"}
    judged = verdicts.outcome_of(claim(value=value, criterion="ratio < 1"), TABLES)
    assert (judged.verdict, judged.note) == ("not testable", "Missing: no number: ratio.")


def test_an_interval_across_the_line_decides_nothing():
    judged = verdicts.outcome_of(claim(criterion="fine > 0.095"), TABLES)
    assert (judged.verdict, judged.by_numbers) == ("undecided", "reproduced")
    assert judged.note == "By the numbers alone: reproduced." and judged.p == pytest.approx(
        1 / 3, abs=0.01
    )
    # The strongest statement that is decided counts.
    for line, by_numbers in ((0.095, "reproduced"), (0.105, "reproduced with a condition")):
        asked = claim(criterion=f"fine > {line}", condition=WEAKER)
        judged = verdicts.outcome_of(asked, TABLES)
        assert (judged.verdict, judged.by_numbers) == ("reproduced with a condition", by_numbers)
        assert judged.note.endswith("Without it the claim is undecided.")
    # A condition that is undecided does not excuse either.
    open_condition = WEAKER | {"criterion": "fine < 0.105"}
    judged = verdicts.outcome_of(claim(criterion="fine > 0.5", condition=open_condition), TABLES)
    assert judged.verdict == "not reproduced" and "is undecided (it falls at least)" in judged.note


def test_claims_without_intervals_are_decided_by_their_numbers():
    value = {"coarse": ENTRY["value"]["coarse"]}
    exact = claim(value=value, criterion="coarse > 0.39", uncertainty="exact: a closed form")
    judged = verdicts.outcome_of(exact, TABLES)
    assert judged.verdict == "reproduced" and np.isnan(judged.p)
    (record,) = claims_report.records([judged])
    assert (record["uncertainty"], record["p"]) == ("exact: a closed form", None)


def test_all_claims_at_once_are_decided_after_holm():
    asked = claims.parse_claims(
        [entry(id=f"falls-{n}", criterion=f"fine > {0.1 - 0.0001 * n}") for n in (101, 120, 200)]
    )
    found = verdicts.outcomes_of(asked, TABLES)
    assert [each.verdict for each in found] == ["reproduced"] * 3
    p = [each.p for each in found]
    assert [each.p_holm for each in found] == pytest.approx([p[0], 2 * p[1], 3 * p[2]])


def test_errors_name_the_claim():
    with pytest.raises(InputError, match="^claim falls: rates: |^claim falls: .*does not know"):
        verdicts.outcome_of(claim(), {"rates": RATES.drop(columns="rate")})


# The file of claims


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"id": "Falls!"}, "id: use small letters"),
        ({"statement": ""}, "statement: a text is needed"),
        ({"paper": 10}, "paper: a text is needed"),
        ({"colour": "red"}, "does not know colour"),
        ({"criterion": None}, "either a criterion, or a reason"),
        ({"reason": "None."}, "either a criterion, or a reason"),
        ({"criterion": None, "reason": "None."}, "needs no value"),
        ({"criterion": "left > 1"}, "criterion uses left, which value does not define"),
        ({"criterion": "exit()"}, "criterion: exit(): does not know exit"),
        ({"condition": "drop > 0"}, "condition: give its criterion and its words"),
        ({"condition": {"criterion": "drop > 0"}}, "words: a text is needed"),
        ({"condition": WEAKER | {"criterion": "x > 0"}}, "condition uses x"),
        ({"value": None}, "value: name the numbers"),
        ({"value": {"fine": 3}}, "value fine: give an expression"),
        ({"value": {"max": "1"}}, "'max' cannot be the name"),
        ({"value": {"fine": "later", "later": "1"}}, "value fine uses later"),
        ({"uncertainty": "exact: a closed form"}, "what decides has intervals"),
        ({"value": {"fine": "1"}, "criterion": "fine > 0", "uncertainty": "none"}, "'exact: ' or"),
    ],
)
def test_a_wrong_claim_is_refused_in_one_line(changes, says):
    with pytest.raises(InputError, match=re.escape(says)) as caught:
        claim(**changes)
    assert str(caught.value).startswith("claim ") and "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"table": "../rates"}, "no name of a table"),
        ({"table": []}, "name one table"),
        ({"table": {"rates": 1}}, "name one table"),
        ({"table": ["rates", 3]}, "table: 3 is no name of a table"),
        ({"table": ["rates", "rates.csv"]}, "'rates.csv' is no name of a table"),
        ({"take": "most"}, "take: 'most', allowed is one, mean"),
        ({"take": "first"}, "take: 'first'"),
        ({"take": "mean n_spo"}, "take: 'mean n_spo'"),
        ({"column": "open(rate)"}, "does not know open"),
        ({"where": "rate.max()"}, "is not allowed"),
        ({"low": "low"}, "low and high go together"),
        ({"file": "x"}, "does not know file"),
        ({"low": "low", "high": "high"}, "mean has no row whose low and high"),
        ({"take": "max", "low": "open(low)", "high": "high"}, "does not know open"),
        ({"take": "pooled"}, "by: pooled needs it"),
        ({"by": "keypoint"}, "by: pooled needs it"),
    ],
)
def test_a_wrong_number_is_refused_in_one_line(changes, says):
    value = {"fine": {"table": "rates", "column": "rate", "take": "mean"} | changes}
    with pytest.raises(InputError, match=re.escape(says)) as caught:
        claim(value=value, criterion="fine > 0")
    assert str(caught.value).startswith("claim falls: value fine: ")


@pytest.mark.parametrize("entries", [None, [], {"id": "falls"}, ["falls"]])
def test_a_file_without_claims_is_refused(entries):
    with pytest.raises(InputError):
        claims.parse_claims(entries)


def test_ids_are_unique():
    with pytest.raises(InputError, match="claim falls: the id is used twice"):
        claims.parse_claims([entry(), entry()])


@pytest.mark.parametrize("text", ["- [", "a: b: c", None])
def test_an_unreadable_file_is_refused(tmp_path, text):
    path = tmp_path / "claims.yaml"
    if text is not None:
        path.write_text(text)
    with pytest.raises(InputError, match=r"claims\.yaml") as caught:
        claims.read_claims(path)
    assert "\n" not in str(caught.value)


# The claims of the paper


@pytest.mark.parametrize("listed", LISTED, ids=lambda listed: listed.id)
def test_every_claim_names_a_figure_that_exists(listed):
    assert not listed.figure or listed.figure in FIGURES
    assert listed.figure or not listed.criterion


@pytest.mark.parametrize("listed", [each for each in LISTED if each.criterion], ids=lambda listed: listed.id)  # fmt: skip
def test_every_criterion_can_hold_and_can_fail(listed):
    names = sorted(expressions.names_of(listed.criterion))
    assert set(names) <= {part.name for part in listed.quantities}
    random = np.random.default_rng(1)
    draws = {
        name: 10.0 ** random.uniform(-3, 3, 4000) * random.choice([-1, 1], 4000) for name in names
    }
    near = {name: 1 + 0.03 * random.standard_normal(4000) for name in names}  # almost equal ones
    answers = [expressions.evaluate(listed.criterion, drawn) for drawn in (draws, near)]
    small = {name: random.uniform(0, 3, 4000) for name in names}
    answers.append(expressions.evaluate(listed.criterion, small))
    answers = np.concatenate(answers)
    assert answers.any() and not answers.all()


@pytest.mark.parametrize("listed", [each for each in LISTED if each.criterion], ids=lambda listed: listed.id)  # fmt: skip
def test_what_decides_has_an_interval_or_a_word_why_not(listed):
    assert bool(listed.uncertainty) is not claims.has_intervals(claims.deciding(listed))


def test_claims_are_many_and_of_the_whole_paper():
    assert len({each.id for each in LISTED}) == len(LISTED) >= 95
    assert {f"fig{n}" for n in (1, *range(3, 13), "S1", "S2", "S3", "S4", "S5")} <= {
        each.figure for each in LISTED
    }


# The ledger


def test_the_stage_writes_the_ledger_and_prints_the_tally(tmp_path, capsys):
    RATES.to_csv(tmp_path / "rates.csv", index=False)
    (tmp_path / "claims.yaml").write_text(json.dumps([
        entry(),
        entry(id="never", criterion="fine > 0.5", statement="Either | or."),
        entry(id="lost", value={"fine": ENTRY["value"]["coarse"] | {"where": "n_spo == 4"}}, criterion="fine > 0"),
        entry(id="endless", value={"fine": "1 / 0"}, criterion="fine > 0"),
    ]))  # fmt: skip
    out = {kind: tmp_path / f"out/claims.{kind}" for kind in ("csv", "json", "markdown")}
    arguments = ["--claims", str(tmp_path / "claims.yaml"), "--tables", str(tmp_path / "rates.csv")]
    arguments += [text for kind, path in out.items() for text in (f"--{kind}", str(path))]
    assert check_claims.main(arguments) == 0
    assert capsys.readouterr().out.splitlines() == [
        "  2 reproduced", "  0 reproduced with a condition", "  1 not reproduced", "  0 undecided",
        "  1 not testable",
    ]  # fmt: skip

    records = json.loads(out["json"].read_text())
    assert all(tuple(record) == claims_report.FIELDS for record in records)
    assert records[0]["table"] == ["rates.csv"] and records[0]["verdict"] == "reproduced"
    assert records[0]["interval"] == {"fine": [0.09, 0.11], "drop": pytest.approx([0.29, 0.31])}
    assert records[2]["value"] == {"fine": None} and records[3]["value"] == {"fine": "inf"}

    with out["csv"].open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert tuple(rows[0]) == claims_report.FIELDS and len(rows) == 4
    assert rows[0]["value"] == "coarse 0.4; fine 0.1; drop 0.3"
    assert rows[0]["interval"] == "fine 0.09 to 0.11; drop 0.29 to 0.31"

    text = out["markdown"].read_text()
    assert "| reproduced | 2 |" in text and "## Reproduced with a condition" not in text
    assert "Either \\| or." in text and "rates has no row with n_spo == 4" in text

    # Of which run it is says one line more, of people's form only.
    before = {kind: path.read_bytes() for kind, path in out.items()}
    about = ["--reference", "roof.png", "--settings", "config/config.yaml", "my.yaml"]
    assert check_claims.main([*arguments, *about, "--draft", "True"]) == 0
    assert {kind for kind, path in out.items() if path.read_bytes() != before[kind]} == {"markdown"}
    headed = out["markdown"].read_text()
    (line,) = (line for line in headed.splitlines() if "Picture: " in line)
    assert line.startswith(
        "*Draft.* Picture: `roof.png`. Settings: `config/config.yaml`, `my.yaml`."
    )
    assert __version__ in line and claims_report.without_heading(headed) == text
    assert claims_report.without_heading(text) == text


def test_the_stage_explains_a_missing_table(tmp_path, capsys):
    (tmp_path / "claims.yaml").write_text(json.dumps([entry()]))
    arguments = ["--claims", str(tmp_path / "claims.yaml"), "--tables", str(tmp_path / "rates.csv")]
    for kind in ("csv", "json", "markdown"):
        arguments += [f"--{kind}", str(tmp_path / kind)]
    assert check_claims.main(arguments) == 2
    assert "rates.csv: no such table" in capsys.readouterr().err


def test_a_table_that_claims_ask_for_and_is_not_given_is_named(tmp_path, capsys):
    (tmp_path / "claims.yaml").write_text(json.dumps([entry()]))
    RATES.to_csv(tmp_path / "others.csv", index=False)
    arguments = ["--claims", str(tmp_path / "claims.yaml")]
    arguments += ["--tables", str(tmp_path / "others.csv")]
    for kind in ("csv", "json", "markdown"):
        arguments += [f"--{kind}", str(tmp_path / kind)]
    assert check_claims.main(arguments) == 2
    assert "asks for rates.csv: name them with --tables" in capsys.readouterr().err


@pytest.mark.parametrize("name", ["2nd", "a b", "", 3, None, "max", "class-1"])
def test_what_cannot_be_the_name_of_a_number_is_refused(name):
    with pytest.raises(InputError, match="cannot be the name of a number"):
        claim(value={name: ENTRY["value"]["coarse"]}, criterion="1 > 0")
