"""Tables survive the disk unchanged."""

import hashlib

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from keystab.errors import InputError
from keystab.io.tables import read_table, to_csv, write_table

TABLE = pd.DataFrame(
    {
        "n_spo": [3, 15, 19],
        "delta_min": [0.1 + 0.2, 1e-300, -np.pi],
        "rate": [0.5, np.nan, np.inf],
        "balanced": [True, False, True],
        "label": ["stable", "NA", 'a, "b"\nc'],
    },
    index=[7, 8, 9],
)


@pytest.mark.parametrize("suffix", [".csv", ".parquet"])
def test_round_trip(tmp_path, suffix):
    path = tmp_path / "new" / f"table{suffix}"
    write_table(TABLE, path)
    back = read_table(path)
    pd.testing.assert_frame_equal(back, TABLE.reset_index(drop=True), check_exact=True)
    assert [p.name for p in path.parent.iterdir()] == [path.name]


@given(st.lists(st.floats(allow_nan=False), min_size=1, max_size=20))
@settings(max_examples=60)
def test_csv_keeps_every_bit_of_a_float(tmp_path_factory, values):
    path = tmp_path_factory.mktemp("csv") / "t.csv"
    write_table(pd.DataFrame({"value": values}), path)
    assert read_table(path)["value"].astype(float).tolist() == values


def test_parquet_keeps_small_types(tmp_path):
    table = pd.DataFrame({"s": np.int16([1, 2]), "sign": np.int8([1, -1]), "v": np.float32([0, 1])})
    write_table(table, tmp_path / "t.parquet")
    assert read_table(tmp_path / "t.parquet").dtypes.tolist() == table.dtypes.tolist()


@pytest.mark.parametrize("suffix", [".csv", ".parquet"])
def test_same_table_same_bytes(tmp_path, suffix):
    digests = set()
    for name, index in (("a", [7, 8, 9]), ("b", ["x", "y", "z"])):
        table = TABLE.set_axis(index)
        table.attrs["gap"] = name
        write_table(table, tmp_path / f"{name}{suffix}")
        digests.add(hashlib.sha256((tmp_path / f"{name}{suffix}").read_bytes()).hexdigest())
    assert len(digests) == 1
    assert b"pandas" not in (tmp_path / f"a{suffix}").read_bytes()


def test_csv_has_unix_line_ends(tmp_path):
    write_table(TABLE[["n_spo"]], tmp_path / "t.csv")
    assert (tmp_path / "t.csv").read_bytes() == b"n_spo\n3\n15\n19\n"


@pytest.mark.parametrize("suffix", [".csv", ".parquet"])
def test_empty_table_keeps_its_columns(tmp_path, suffix):
    write_table(TABLE[:0], tmp_path / f"t{suffix}")
    back = read_table(tmp_path / f"t{suffix}")
    assert list(back) == list(TABLE) and len(back) == 0


def test_chosen_columns_in_the_order_asked_for(tmp_path):
    write_table(TABLE, tmp_path / "t.csv")
    assert list(read_table(tmp_path / "t.csv", ["rate", "n_spo"])) == ["rate", "n_spo"]
    with pytest.raises(InputError, match=r"lacks the columns kappa, sigma; it has n_spo, "):
        read_table(tmp_path / "t.csv", ["kappa", "n_spo", "sigma"])


def test_failed_write_leaves_the_old_table(tmp_path, monkeypatch):
    path = tmp_path / "t.csv"
    write_table(TABLE, path)
    before = path.read_bytes()
    monkeypatch.setattr("keystab.io.tables.to_csv", lambda table: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        write_table(TABLE[:1], path)
    assert path.read_bytes() == before and list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("gone.csv", None, "no such table"),
        ("odd.xlsx", b"x", "ends in .csv or .parquet"),
        ("empty.csv", b"", "not a readable .csv"),
        ("text.parquet", b"hello", "not a readable .parquet"),
        ("ragged.csv", b"a,b\n1,2\n1,2,3,4\n", "not a readable .csv"),
    ],
)
def test_what_cannot_be_read_gets_one_line(tmp_path, name, content, words):
    if content is not None:
        (tmp_path / name).write_bytes(content)
    with pytest.raises(InputError) as raised:
        read_table(tmp_path / name)
    assert words in str(raised.value) and "\n" not in str(raised.value)


def test_text_of_a_table():
    assert to_csv(pd.DataFrame({"a": [1.0], "b": ["x"]})) == "a,b\n1.0,x\n"


def test_a_table_never_replaces_a_folder(tmp_path):
    path = tmp_path / "t.csv"
    path.mkdir()
    (path / "precious").write_text("kept")
    with pytest.raises(InputError, match=r"t\.csv is a folder; give a file name"):
        write_table(TABLE, path)
    assert (path / "precious").read_text() == "kept"
