"""Which detections are the same: limits, symmetry, and pairs against comparing all with all."""

import numpy as np
import pandas as pd
import pytest

from keystab.errors import InputError
from keystab.matching.correspondence import matched, pairs_between, pairs_within, same

ROOT2 = 2**0.5


def detection(y=0.0, x=0.0, sigma=1.0, sign=1):
    return {"y": y, "x": x, "sigma": sigma, "sign": sign}


def crowd(n, seed):
    generator = np.random.default_rng(seed)
    return pd.DataFrame(
        {
            "y": generator.uniform(0, 8, n),
            "x": generator.uniform(0, 8, n),
            "sigma": 1.1 * 2 ** generator.uniform(0, 2, n),
            "sign": generator.choice([-1, 1], n),
        }
    )


def all_with_all(a, b, match_sign=False):
    """Equation (22), written out."""
    near = np.abs(np.subtract.outer(a["y"].to_numpy(), b["y"].to_numpy())) <= 1
    near &= np.abs(np.subtract.outer(a["x"].to_numpy(), b["x"].to_numpy())) <= 1
    ratio = np.divide.outer(a["sigma"].to_numpy(), b["sigma"].to_numpy())
    near &= (ratio >= 1 / ROOT2) & (ratio <= ROOT2)
    if match_sign:
        near &= np.equal.outer(a["sign"].to_numpy(), b["sign"].to_numpy())
    return near


@pytest.mark.parametrize(
    ("other", "expected"),
    [
        (detection(), True),
        (detection(y=1.0), True),
        (detection(y=-1.0, x=1.0), True),  # maximum norm: the corner belongs to it
        (detection(y=1.001), False),
        (detection(x=-1.001), False),
        (detection(sigma=ROOT2), True),
        (detection(sigma=1 / ROOT2), True),
        (detection(sigma=1.415), False),
        (detection(sigma=0.706), False),
    ],
)
def test_limits_are_inclusive(other, expected):
    assert same(detection(), other) == expected
    assert same(other, detection()) == expected


@pytest.mark.parametrize("n_spo", [4, 6, 10, 14, 18])
def test_rounding_does_not_decide_at_the_scale_limit(n_spo):
    """Slices half an octave apart are the same, slices one step farther are not, at every s."""
    s = np.arange(n_spo)
    sigma = 1.1 * 2 ** (s / n_spo)
    zero = np.zeros(n_spo)
    here = {"y": zero, "x": zero, "sigma": sigma}
    half = {"y": zero, "x": zero, "sigma": 1.1 * 2 ** ((s + n_spo // 2) / n_spo)}
    more = {"y": zero, "x": zero, "sigma": 1.1 * 2 ** ((s + n_spo // 2 + 1) / n_spo)}
    assert same(here, half).all() and same(half, here).all()
    assert not same(here, more).any()


def test_sign_matters_only_when_asked():
    assert same(detection(sign=1), detection(sign=-1))
    assert not same(detection(sign=1), detection(sign=-1), match_sign=True)


def test_tolerances_are_parameters():
    far = detection(y=2.5, sigma=1.9)
    assert not same(detection(), far)
    assert same(detection(), far, space_tolerance=2.5, scale_ratio=2.0)


@pytest.mark.parametrize("match_sign", [False, True])
def test_pairs_equal_comparing_all_with_all(match_sign):
    a, b = crowd(150, 1), crowd(200, 2)
    found = np.zeros((150, 200), dtype=bool)
    rows, columns, _ = pairs_between(a, b, match_sign=match_sign)
    found[rows, columns] = True
    expected = all_with_all(a, b, match_sign)
    assert expected.sum() > 100
    np.testing.assert_array_equal(found, expected)
    np.testing.assert_array_equal(
        matched(a, b, match_sign=match_sign), all_with_all(a, b, match_sign).any(axis=1)
    )
    own = np.zeros((150, 150), dtype=bool)
    own[tuple(pairs_within(a, match_sign=match_sign).T)] = True
    assert not (own & own.T).any()  # each pair once
    np.testing.assert_array_equal(
        own | own.T | np.eye(150, dtype=bool), all_with_all(a, a, match_sign)
    )


def test_distance_between_pairs():
    a = pd.DataFrame([detection(y=3.0, x=4.0)])
    b = pd.DataFrame([detection(y=3.6, x=4.8, sigma=2**0.25)])
    _, _, distance = pairs_between(a, b)
    # (0.6, 0.8) px of 1 px, and half of the limit in log scale
    np.testing.assert_allclose(distance, [np.sqrt(0.36 + 0.64 + 0.25)], rtol=1e-12)


def test_empty_tables():
    nothing, some = crowd(0, 0), crowd(3, 0)
    assert matched(nothing, some).shape == (0,)
    assert matched(some, nothing).tolist() == [False] * 3
    assert pairs_within(nothing).shape == (0, 2)


@pytest.mark.parametrize(
    ("change", "keywords", "word"),
    [
        ({}, {"space_tolerance": 0.0}, "space_tolerance"),
        ({}, {"space_tolerance": np.nan}, "space_tolerance"),
        ({}, {"scale_ratio": 1.0}, "scale_ratio"),
        ({"y": np.nan}, {}, "'y'"),
        ({"sigma": 0.0}, {}, "'sigma'"),
        ({"sigma": np.inf}, {}, "'sigma'"),
    ],
)
def test_errors_name_what_is_wrong_in_one_line(change, keywords, word):
    table = pd.DataFrame([{**detection(), **change}])
    with pytest.raises(InputError, match=word) as error:
        matched(table, table, **keywords)
    assert "\n" not in str(error.value)


def test_missing_column():
    with pytest.raises(InputError, match="no column 'sigma'"):
        pairs_within(pd.DataFrame({"y": [0.0], "x": [0.0]}))


def test_refuses_before_memory_runs_out():
    n = 25_000  # all in one place: 312 million pairs, 5 GB
    with pytest.raises(InputError, match="pairs"):
        pairs_within(pd.DataFrame({"y": np.zeros(n), "x": np.zeros(n), "sigma": np.ones(n)}))


@pytest.mark.parametrize(
    ("change", "limits", "words"),
    [
        ({"y": ["top", "low"]}, {}, "column 'y' holds text"),
        ({"y": ["1.5", "10"]}, {}, "column 'y' holds text"),
        ({"x": np.array([1j, 2])}, {}, "column 'x' holds values of type complex128"),
        ({"x": [1.0, "2"]}, {}, "column 'x' holds text"),
        ({"sigma": pd.array([1.0, None])}, {}, "column 'sigma' holds"),
        ({}, {"space_tolerance": "1"}, "space_tolerance is '1'"),
        ({}, {"space_tolerance": None}, "space_tolerance is None"),
        ({}, {"scale_ratio": [1.4, 2.0]}, "scale_ratio is [1.4, 2.0]"),
        ({}, {"scale_ratio": np.array([1.4, 2.0])}, "scale_ratio is array"),
    ],
)
def test_what_is_no_number_gets_one_line(change, limits, words):
    table = pd.DataFrame({"y": [0.0, 1.0], "x": [0.0, 1.0], "sigma": [1.1, 1.2]} | change)
    with pytest.raises(InputError) as raised:
        pairs_within(table, **limits)
    assert words in str(raised.value) and "\n" not in str(raised.value)


def test_nullable_columns_are_numbers():
    table = pd.DataFrame({"y": [0.0, 0.5], "x": 0.0, "sigma": 1.1})
    np.testing.assert_array_equal(pairs_within(table.convert_dtypes()), pairs_within(table))
    assert len(pairs_within(table.astype(object))) == 1


@pytest.mark.parametrize("bad", [np.nan, np.inf])
@pytest.mark.parametrize("row", [0, 1, 2])
@pytest.mark.parametrize("name", ["y", "x", "sigma"])
def test_the_one_row_that_is_wrong_is_named(name, row, bad):
    table = pd.DataFrame({"y": [0.0, 1.0, 2.0], "x": 0.0, "sigma": 1.1})
    table.loc[row, name] = bad
    with pytest.raises(InputError, match=f"column '{name}' holds {bad} in row {row},"):
        pairs_within(table)


def test_tolerances_begin_right_above_their_limits():
    apart = pd.DataFrame({"y": [0.0, 0.0], "x": 0.0, "sigma": [1.0, 1.0]})
    assert len(pairs_within(apart, space_tolerance=1e-9, scale_ratio=1 + 1e-9)) == 1
    for limits in ({"space_tolerance": -1e-9}, {"scale_ratio": 1 - 1e-9}, {"scale_ratio": 0.7}):
        with pytest.raises(InputError, match="raise it"):
            pairs_within(apart, **limits)
