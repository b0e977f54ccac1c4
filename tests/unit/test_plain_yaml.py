"""YAML is read as a person reads it, or refused in one line that names file and line."""

from __future__ import annotations

import pytest
import yaml

from keystab.errors import InputError
from keystab.study.claims import read_claims
from keystab.study.overlays import overlays_of
from keystab.study.plain_yaml import plain_yaml, read_plain_yaml
from keystab.study.settings import read_yaml


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("detector: {kappa: 1.3}\nsets: {}\ndetector: {epsilon: 0.1}", "line 3: detector stands in line 1 already"),
        ("sets: {still: {step: 10, blur: 1.1, step: 12}}", "line 1: step stands in line 1 already"),
        ("a: {b: 1, 'b': 2}", "line 1: b stands in line 1 already"),
        ("step: 010", "line 1: YAML reads 010 as 8; write 8 or 10"),
        ("steps: [1, -0_17]", "line 1: YAML reads -0_17 as -15; write -15 or -17"),
        ("step: 1:30", "line 1: YAML reads 1:30 as 90, in sixties"),
        ("step: 1:30.5", "line 1: YAML reads 1:30.5 as 90.5, in sixties"),
        ("results: 2024-01-31", "line 1: YAML reads 2024-01-31 as a date; put it into quotes"),
        ("sets:\n  on: {step: 2}", "line 2: the name on is read as true; names are words"),
        ("sets: {no: {step: 2}}", "line 1: the name no is read as false"),
        ('{"a\\e[2J": 1, "a\\e[2J": 2}', "line 1: a?[2J stands in line 1 already"),
        ("1: 2", "line 1: the name 1 is read as the number 1"),
        ("~: 2", "line 1: the name ~ is read as nothing"),
        ("[a, b]: 2", "line 1: a list or block stands where a name is expected"),
        ("a: " + "[" * 3000, "more than 100000 values, or more than 50 levels"),
        ("a: " + "[" * 3000 + "]" * 3000, "more than 100000 values, or more than 50 levels"),
        ("a: &a [*a]", "more than 100000 values, or more than 50 levels"),
        ("".join(f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 9 if i else 'x' * 9)}]\n" for i in range(20)), "more than 100000 values, or more than 50 levels"),
        ("a: " + "1" * 5000, "is not plain YAML"),
        ("a: b: c", "is not YAML in line 1"),
        ("a: \x00", "is not YAML"),
        ("a: =", "is not YAML in line 1"),
        ("a: !!python/name:os.system", "is not YAML in line 1"),
        ("a: 1\n---\na: 2", "is not YAML in line 2"),
    ],
)  # fmt: skip
def test_what_is_read_otherwise_than_it_looks_is_refused(text, line):
    with pytest.raises(InputError) as caught:
        plain_yaml(text, "mine.yaml")
    said = str(caught.value)
    assert said.startswith(f"mine.yaml: {line}") and "\n" not in said


@pytest.mark.parametrize(
    "text",
    ["", "a: 1e-3", "a: 0", "a: 0.10", "a: '010'", "a: \"1:30\"", "a: 00", "a: 07", "a: [yes, .inf]",
     "x: &x {a: 1}\ny: {<<: *x, b: 2}", "a: 0x10", "a: 10_000", "# nothing"],
)  # fmt: skip
def test_all_else_is_read_as_any_reader_does(text):
    assert plain_yaml(text, "mine.yaml") == yaml.safe_load(text)


@pytest.mark.parametrize("coding", ["latin-1", "utf-16", "utf-16-le", "utf-32"])
def test_other_codings_are_named(coding, tmp_path):
    path = tmp_path / "mine.yaml"
    path.write_bytes("step: 10 # für die Übersicht".encode(coding))
    for read in (read_plain_yaml, read_yaml, read_claims):
        with pytest.raises(
            InputError, match=r"mine\.yaml: is not (UTF-8|YAML|plain YAML)"
        ) as caught:
            read(path)
        assert "\n" not in str(caught.value)


def test_a_mark_of_utf_8_is_no_part_of_the_first_name(tmp_path):
    path = tmp_path / "mine.yaml"
    path.write_bytes(b"\xef\xbb\xbfstep: 10\n")
    assert read_plain_yaml(path) == {"step": 10}


def test_whence_is_not_stopped_by_a_file_that_is_none_of_its_own(tmp_path):
    (tmp_path / "config/aside").mkdir(parents=True)
    for name, data in {"a": "ü".encode("latin-1"), "b": b"[" * 3000, "c": b"- 1", "d": b"\xff\xfea"}.items():  # fmt: skip
        (tmp_path / f"config/aside/{name}.yaml").write_bytes(data)
    (tmp_path / "config/mine.yaml").write_text("figures: ./figures/mine/\n")
    (tmp_path / "config/config.yaml").write_text("figures: figures\n")
    assert overlays_of(tmp_path, "figures/mine") == ["config/mine.yaml"]
