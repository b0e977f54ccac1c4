"""Figure floor: readings of the paper's words, and why extrema come and go."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from figure_labels import collisions
from hypothesis import example, given, settings
from hypothesis import strategies as st
from matplotlib.colors import to_rgba

from keystab.camera.views import ViewSpec
from keystab.evaluation.stability import new_and_lost
from keystab.experiments.change_causes import CAUSES, causes_of_changes
from keystab.experiments.floor_readings import (
    Reading,
    crossed,
    crossed_for,
    fewest_choices,
    first_come,
    ranges,
    reading_table,
)
from keystab.experiments.sampling_stability import floor_summary, keypoints_of_samplings
from keystab.figures import floor
from keystab.figures._render import read_tables
from keystab.io.checksums import write_checksums
from keystab.io.tables import read_table, write_table
from keystab.io.view_store import write_views
from keystab.matching.correspondence import one_to_one, pairs_between, pairs_within
from keystab.stages import match_variants

SAME = {"space_tolerance": 1.0, "scale_ratio": 2**0.5, "match_sign": False}
SAMPLINGS = [3, 4, 5, 6]


def random_extrema(seed: int, n: int = 60) -> pd.DataFrame:
    """Extrema of all samplings: the same places, jittered, some of them lost."""
    rng = np.random.default_rng(seed)
    places = rng.uniform(0, 12, (n, 2))
    scale = np.exp(rng.uniform(np.log(1.2), np.log(2.2), n))
    parts = []
    for n_spo in SAMPLINGS:
        kept = rng.random(n) < 0.8
        where = places[kept] + rng.normal(0, 0.5 / n_spo, (kept.sum(), 2))
        step = scale[kept] * np.exp(rng.normal(0, 0.05, kept.sum()))
        grid = 1.1 * 2 ** (np.round(np.log2(step / 1.1) * n_spo) / n_spo)
        parts.append(
            pd.DataFrame(
                {
                    "n_spo": n_spo,
                    "y": where[:, 0],
                    "x": where[:, 1],
                    "sigma": grid,
                    "sign": np.where(rng.random(kept.sum()) < 0.5, -1, 1),
                    "step_sigma": step,
                    "difference": 10 ** rng.uniform(-8, -4, kept.sum()),
                }
            )
        )
    return pd.concat(parts, ignore_index=True)


def inside(table: pd.DataFrame, column: str) -> np.ndarray:
    """Range of scales and margin of these tests."""
    return (table[column].to_numpy() >= 1.386) & (table["y"].to_numpy() > 1)


def greedy_pairs(a, b, distance):
    """Nearest pairs first, one by one."""
    taken_a, taken_b, chosen = set(), set(), []
    for k in np.lexsort((b, a, distance)):
        if a[k] not in taken_a and b[k] not in taken_b:
            taken_a.add(a[k])
            taken_b.add(b[k])
            chosen.append(int(k))
    return sorted(chosen)


@settings(deadline=None, max_examples=25)
@given(
    st.lists(
        st.tuples(st.integers(0, 6), st.integers(0, 6), st.integers(0, 4)), max_size=40, unique=True
    )
)
def test_one_to_one_pairs_are_those_that_are_taken_one_by_one(triples):
    a, b, distance = (np.array([t[k] for t in triples], dtype=np.intp) for k in range(3))
    chosen = one_to_one(a, b, distance.astype(float))
    assert sorted(chosen.tolist()) == greedy_pairs(a, b, distance)


@settings(deadline=None, max_examples=25)
@given(st.integers(0, 2**32 - 1))
def test_first_come_are_apart_and_leave_nothing_uncovered(seed):
    table = random_extrema(seed, 25)
    pairs = pairs_within(table, **SAME)
    taken = first_come(len(table), pairs)
    assert not (np.isin(pairs, taken).all(axis=1)).any()
    near, _, _ = pairs_between(table, table.iloc[taken], **SAME)
    assert set(near) == set(range(len(table)))


@pytest.mark.parametrize("epsilon", [0.0, 1e-6])
def test_the_usual_reading_gives_the_rates_of_the_other_tables(epsilon):
    table = random_extrema(1)
    readings = [Reading(epsilon=epsilon)]
    (row,) = reading_table(table, ranges(table, inside), SAMPLINGS, 5, readings, SAME).to_dict(
        "records"
    )
    found = table[table["difference"] > epsilon].reset_index(drop=True)
    common = found[inside(found, "step_sigma")]
    counts = new_and_lost(common, **SAME, set_column="n_spo", sets=SAMPLINGS)
    counts = counts.rename(columns={"n_detections": "n_common"})
    stability = keypoints_of_samplings(common, SAMPLINGS, SAME).keypoints["stability"]
    known = floor_summary(counts, stability, 5).iloc[0]
    for name in ("new_rate", "new_low", "lost_rate", "lost_high", "n_unique", "share_always"):
        assert row[name] == known[name], name
    assert row["low_always"] == known["low_always"]
    assert row["n_common"] == counts.loc[counts["n_spo"] >= 5, "n_common"].sum()


@settings(deadline=None, max_examples=25)
@given(st.integers(0, 2**32 - 1))
@example(8144)  # leaves no extremum in the range
def test_stricter_readings_never_find_more(seed):
    table = random_extrema(seed, 30)
    readings = crossed([0.0, 1e-6], [1.0, 0.2], ["minimum"])
    rows = reading_table(table, ranges(table, inside), SAMPLINGS, 5, readings, SAME)
    rate = rows.set_index(list(Reading._fields))[["new_rate", "lost_rate"]]
    rate = rate.fillna(0.0)  # where a draw leaves nothing to count, there is no rate

    def of(**choice):
        return rate.loc[tuple(Reading(**choice))]

    for choice in ({}, {"epsilon": 1e-6}, {"limit": 0.2}):
        assert (of(**choice, matching="one-to-one") >= of(**choice) - 1e-12).all()
        assert (of(**choice, range="soft") <= of(**choice) + 1e-12).all()
    for choice in ({}, {"matching": "any", "range": "grid"}, {"range": "soft"}):
        assert (of(**choice, limit=0.2) >= of(**choice) - 1e-12).all()


def test_one_detection_serves_as_one_counterpart():
    # Two extrema half a pixel apart, of which the finer sampling finds one.
    table = pd.DataFrame(
        {
            "n_spo": [3, 3, 4],
            "y": [5.0, 5.5, 5.1],
            "x": 5.0,
            "sigma": 1.5,
            "sign": 1,
            "step_sigma": 1.5,
            "difference": 1.0,
        }
    )
    within = ranges(table, inside)
    readings = [Reading(), Reading("one-to-one"), Reading(limit=0.3)]
    rows = reading_table(table, within, [3, 4], 3, readings, SAME)
    assert rows["lost_rate"].tolist() == [0.0, 0.5, 0.5]
    assert rows["new_rate"].tolist() == [0.0, 0.0, 0.0]
    assert rows["n_choices"].tolist() == [0, 1, 1]
    assert rows["share_always"].tolist()[:2] == [1.0, 1.0]


def test_grid_scales_on_the_end_of_the_range_are_within():
    table = pd.DataFrame({"y": 5.0, "sigma": [1.1 * 2 ** (k / (3 * k)) for k in range(1, 8)]})
    end = 1.1 * 2 ** (1 / 3) * (1 + 1e-12)  # wherever rounding puts it

    def within(rows, column):
        return rows[column].to_numpy() >= end

    assert ranges(table.assign(step_sigma=9.0), within)["grid"].all()


def test_what_is_not_asked_for_is_not_counted():
    table = random_extrema(3)
    asked = {"epsilons": [0.0, 1e-6], "limits": [0.1, 1.0]}
    readings = crossed_for("rates", 0.0, 1.0, asked)
    assert {reading.limit for reading in readings} == {1.0}
    rows = reading_table(table, ranges(table, inside), SAMPLINGS, 5, readings, SAME, False)
    assert rows["share_always"].isna().all() and rows["n_unique"].isna().all()
    assert not rows["reaches"].any() and len(fewest_choices(rows)) == 0
    assert crossed_for("all", 2e-6, 1.0, asked)[0] == Reading(epsilon=2e-6)


def test_rates_and_shares_are_held_against_those_of_the_paper():
    # 20 places; at each sampling two come and two go, and three of them are always there.
    n = 20
    parts = []
    for number, n_spo in enumerate(SAMPLINGS):
        there = np.arange(2 * number, 2 * number + n)
        parts.append(pd.DataFrame({"n_spo": n_spo, "x": 5.0 * there}))
    table = pd.concat(parts, ignore_index=True).assign(
        y=5.0, sigma=1.5, sign=1, step_sigma=1.5, difference=1.0
    )
    row = reading_table(table, ranges(table, inside), SAMPLINGS, 5, [Reading()], SAME).iloc[0]
    assert row["new_rate"] == row["lost_rate"] == 0.1
    assert row["reaches_rates"] and not row["reaches_always"] and not row["reaches"]
    assert row["share_always"] == 14 / 26


def test_every_change_has_one_cause():
    table = random_extrema(5)
    counted = ranges(table, inside)["refined"]
    truth = random_extrema(6)[["y", "x", "sigma", "sign"]].assign(conditioning=0.5)
    causes = causes_of_changes(table, counted, truth, inside(truth, "sigma"), SAMPLINGS, SAME)
    known = new_and_lost(table[counted], **SAME, set_column="n_spo", sets=SAMPLINGS)
    known = known.set_index("n_spo")
    totals = causes[causes["matching"] == "any"].groupby(["change", "n_spo"])["n"].sum()
    for (change, n_spo), number in totals.items():
        assert number == known.loc[n_spo, f"n_{change}"]
    assert set(causes["cause"]) == set(CAUSES)
    assert len(causes) == 2 * 2 * (len(SAMPLINGS) - 1) * len(CAUSES)


def test_each_cause_is_recognised():
    # One new extremum of each kind at the finer sampling; the scale is that of the range's inside.
    truth = pd.DataFrame(
        {
            "y": [10.0, 20.0, 20.5, 30.0, 40.0, 50.0, 60.0],
            "x": 10.0,
            "sigma": 1.6,
            "sign": 1,
            "conditioning": [0.5, 0.5, 0.5, 0.01, 0.5, 0.5, 0.5],
        }
    )
    coarse = pd.DataFrame({"n_spo": 3, "y": [20.5, 50.0, 60.0], "step_sigma": [1.6, 1.6, 1.3]})
    fine = pd.DataFrame(
        {
            "n_spo": 4,
            # merged pair; degenerate; missed; second of one; beyond the edge; false
            "y": [20.0, 20.5, 30.0, 40.0, 50.0, 50.4, 60.0, 70.0],
            "step_sigma": 1.6,
        }
    )
    table = pd.concat([coarse, fine], ignore_index=True)
    table = table.assign(x=10.0, sigma=1.6, sign=1, difference=1.0)
    counted = ranges(table, inside)["refined"]
    causes = causes_of_changes(table, counted, truth, inside(truth, "sigma"), [3, 4], SAME)
    new = causes[causes["change"] == "new"].set_index(["matching", "cause"])["n"]
    one = {name: int(new["one-to-one", name]) for name in CAUSES}
    assert one == {
        "edge": 1, "second": 1, "merged": 1, "degenerate": 1, "missed": 1, "false": 1,
    }  # fmt: skip
    # Where one may be the counterpart of several, neither seconds nor merged pairs are new.
    assert new["any", "second"] == new["any", "merged"] == 0
    assert new["any", "edge"] == new["any", "false"] == 1
    row = causes[(causes["change"] == "new") & (causes["cause"] == "false")].iloc[0]
    assert row["rate"] == 1 / 8 and row["low"] < row["rate"] < row["high"]


@pytest.mark.slow
def test_the_figure_has_a_mark_for_each_reading_and_no_label_on_any():
    folder = Path(__file__).parents[2] / "results/reference/tables"
    tables = read_tables(folder, floor.TABLES)
    figure = floor.draw(tables)
    panels = {ax.get_label(): ax for ax in figure.axes}
    assert set(panels) == {*"abcdefgh", "causes"}
    marks = [len(cloud.get_offsets()) for cloud in panels["a"].collections]
    own = floor._own(tables["floor_readings"])
    assert sum(marks) == len(own) + own["reaches"].sum()  # these have a ring as well
    assert collisions(figure) == []
    # What no extremum causes has its colour in the bars and in the list below them.
    colour = to_rgba(floor.palette.CHANGE_CAUSE_COLOURS["false"])
    listed = {patch.get_facecolor() for patch in panels["causes"].get_legend().get_patches()}
    assert colour in listed and colour in {bar.get_facecolor() for bar in panels["d"].patches}


def test_each_variant_is_counted_as_it_asks_and_causes_are_those_of_the_first_scene(tmp_path):
    shape = (13, 15)
    store, digest = tmp_path / "views", tmp_path / "views.sha256"
    about = {"set": "still", "reference_blur": 0.0, "reference_shape": [13, 15]}
    write_views([np.zeros(shape)], [ViewSpec(0.8, 1.0, shape)], store, about, "float64")
    write_checksums(store, digest)
    truth = random_extrema(6)[["y", "x", "sigma", "sign"]].assign(conditioning=0.5)
    write_table(truth, tmp_path / "truth.parquet")
    tables = {name: random_extrema(seed) for name, seed in zip("abcd", (1, 2, 3, 4), strict=True)}
    tables["c"] = tables["c"][tables["c"]["n_spo"] >= 4].reset_index(drop=True)
    limit = float(tables["b"]["difference"].median())
    tables["b"].loc[::5, "difference"] = limit  # exactly: not above it
    for name, table in tables.items():
        write_table(table, tmp_path / f"{name}.parquet")
    out = {
        name: tmp_path / f"{name}.csv"
        for name in ("rates", "summary", "variants", "crossed", "causes")
    }
    kappa = 2 ** (1 / 3)
    words = {
        "views": [store] * 4, "views-digest": [digest] * 4,
        "extrema": [tmp_path / f"{name}.parquet" for name in "abcd"],
        "truth": [tmp_path / "truth.parquet"],
        "names": list("abcd"), "scenes": ["here", "here", "here", "there"],
        "differences": ["1", "2", "3", "4"], "tolerances": [-1.0, limit, -1.0, -1.0],
        "firsts": [3, 3, 4, 3], "crossings": ["all", "none", "rates", "all"],
        "n-spo": SAMPLINGS, "epsilon": [0.0], "sigma-min": [1.1], "kappa": [kappa],
        "space-tolerance": [1.0], "scale-ratio": [2**0.5], "match-sign": [False],
        "border": [1.0], "first-scale": [kappa], "last-scale": [None], "settles-at": [5],
        "epsilons": [1e-6], "limits": [1.0, 0.5],
    }  # fmt: skip
    asked = [text for name, values in words.items() for text in (f"--{name}", *map(str, values))]
    asked += [text for name, path in out.items() for text in (f"--{name}", str(path))]
    assert match_variants.main(asked) == 0
    rates, summary, readings, causes, variants = (
        read_table(out[name]) for name in ("rates", "summary", "crossed", "causes", "variants")
    )
    for name, first in zip("abcd", (3, 3, 4, 3), strict=True):
        table, own = tables[name], rates[rates["variant"] == name]
        kept = table[table["difference"] > limit] if name == "b" else table
        counts = {n: int((kept["n_spo"] == n).sum()) for n in SAMPLINGS if n >= first}
        assert dict(zip(own["n_spo"], own["n_extrema"], strict=True)) == counts
    assert summary["variant"].tolist() == list("abcd")
    assert summary["share_always"].isna().tolist() == [False, False, True, False]
    named = readings[["scene", "variant"]].drop_duplicates().to_numpy().tolist()
    assert named == [["here", "a"], ["here", "c"], ["there", "d"]]
    assert variants["differs_in"].astype(str).tolist() == ["1", "2", "3", "4"]

    def within(rows, column):
        ends = (rows["y"] >= 1) & (rows["y"] <= 11) & (rows["x"] >= 1) & (rows["x"] <= 13)
        return (ends & (rows[column] >= 1.1 * kappa)).to_numpy()

    expected = causes_of_changes(
        tables["a"],
        ranges(tables["a"], within)["refined"],
        truth,
        within(truth, "sigma"),
        SAMPLINGS,
        SAME,
    )
    pd.testing.assert_frame_equal(causes, expected, check_dtype=False)
