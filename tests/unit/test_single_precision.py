"""The variants of figure floor: single precision, integers, and the summary of rates."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from scenes import blobs

from keystab.detection.extrema import discrete_extrema, extrema_of_array
from keystab.detection.single_precision import (
    SIDES,
    extrema_in_arithmetic,
    quantised,
    single_precision_extrema,
    single_precision_window,
    transformed_slices,
)
from keystab.errors import InputError
from keystab.experiments.change_causes import CAUSES
from keystab.experiments.floor_readings import Reading, crossed
from keystab.experiments.sampling_stability import floor_summary
from keystab.figures import floor
from keystab.scalespace.dog import scale_space


@pytest.mark.parametrize("oversampling", ["spline", "cosine"])
@pytest.mark.parametrize("grey_range", [1.0, 255.0])
def test_samples_are_those_of_double_precision_to_the_last_digit(oversampling, grey_range):
    space = scale_space(blobs((40, 50), 1), 1.1, 5, oversampling=oversampling)
    window = single_precision_window(space, (3, 60), (5, 90), grey_range)
    exact = space.window(slice(None), slice(3, 60), slice(5, 90)) * grey_range
    assert window.dtype == np.float32
    # Two Gaussians, each rounded to half a last digit of a value below the grey range.
    assert np.abs(window - exact).max() <= grey_range * 2.0**-24 * 2.01
    assert np.abs(window - exact).max() > 0


def test_strong_extrema_survive_single_precision_and_weak_ones_do_not():
    image = blobs((50, 60), 2)
    weak = 0.5 + 1e-5 * (image - 0.5)
    for picture, survive in ((image, True), (weak, False)):
        space = scale_space(picture, 1.1, 12)
        exact = {tuple(row) for row in discrete_extrema(space)}
        single = {tuple(row) for row in single_precision_extrema(space)}
        assert len(exact) > 20
        assert (len(exact & single) > 0.7 * len(exact)) == survive


def test_blocks_do_not_show(monkeypatch):
    space = scale_space(blobs((30, 40), 3), 1.1, 4)
    whole = single_precision_window(space, (0, space.shape[1]), (0, space.shape[2]))
    expected = extrema_of_array(whole, 1e-7)
    monkeypatch.setattr("keystab.detection.single_precision._BLOCK", 16)
    assert {tuple(row) for row in single_precision_extrema(space, 1e-7)} == {
        tuple(row) for row in expected
    }


def test_sums_in_single_precision_are_off_by_more_than_one_rounding():
    space = scale_space(blobs((40, 50), 1), 1.1, 5)
    box = (3, 60), (5, 90)
    exact = space.window(slice(None), *(slice(*part) for part in box))
    once, sums = (np.abs(single_precision_window(space, *box, sums=how) - exact) for how in (0, 1))
    assert once.max() < sums.max() < 50 * once.max()
    # A grey range that is a power of two changes no digit.
    doubled = single_precision_window(space, *box, grey_range=2.0, sums=True)
    assert (doubled == 2 * single_precision_window(space, *box, sums=True)).all()


@pytest.mark.parametrize("sides", SIDES)
@pytest.mark.parametrize("n_spo", [5, 6])  # Gaussians of slices are shared or not
def test_transforms_in_single_precision_are_those_of_double_precision_but_for_rounding(
    sides, n_spo
):
    image = blobs((30, 40), 1)
    space = scale_space(image, 1.1, n_spo)
    slices = np.stack(list(transformed_slices(space, sides=sides)))
    assert slices.dtype == np.float32 and slices.shape == space.shape
    exact = space.window()
    # Where the mirror of the longer grid does not reach: more than 4 standard deviations.
    reach = [int(n - 14 / space.sampling.delta_min) for n in space.shape[1:]]
    off = np.abs(slices - exact)[:, : reach[0], : reach[1]]
    assert 0 < off.max() < 5e-6 * image.max()
    assert np.median(off) < 1e-6


def test_sides_have_the_factors_that_are_asked_for():
    assert [SIDES["small"](n) for n in (1, 7, 97, 1207)] == [1, 8, 100, 1215]
    assert [SIDES["large"](n) for n in (2, 8, 1207)] == [2, 11, 1213]


@pytest.mark.parametrize("arithmetic", ["float32_sums", "float32_transforms"])
def test_neighbourhoods_are_those_of_single_precision(arithmetic):
    space = scale_space(blobs((30, 40), 1), 1.1, 4)
    found, cubes = extrema_in_arithmetic(space, arithmetic, grey_range=4.0)
    middle = cubes[:, 1, 1, 1]
    others = np.delete(cubes.reshape(-1, 27), 13, axis=1)
    assert len(found) > 10
    assert ((middle[:, None] - others) * found[:, 3:] > 0).all()
    exact = space.neighbourhoods(*found[:, :3].T)
    inner = (found[:, 1] < space.shape[1] - 30) & (found[:, 2] < space.shape[2] - 30)
    assert np.abs(cubes - exact)[inner].max() < 1e-5
    assert (np.float32(4 * cubes) == 4 * cubes).all()
    order = np.lexsort((found[:, 2], found[:, 1], found[:, 0]))
    assert (np.diff(order) == 1).all()


def test_transforms_need_a_spline_and_known_sides():
    cosine = scale_space(np.ones((12, 12)), 1.1, 3, oversampling="cosine")
    with pytest.raises(InputError, match="spline"):
        next(transformed_slices(cosine))
    with pytest.raises(InputError, match="small or large"):
        next(transformed_slices(scale_space(np.ones((12, 12)), 1.1, 3), sides="odd"))


def test_integers_hold_what_their_bits_can():
    values = np.linspace(0, 1, 1001)
    assert len(np.unique(quantised(values, 8))) == 256
    assert np.abs(quantised(values, 8) - values).max() <= 0.5 / 255 + 1e-15
    assert quantised(values, None) is values


def test_wrong_numbers_are_named():
    space = scale_space(np.ones((12, 12)), 1.1, 3)
    for wrong in ({"epsilon": -1.0}, {"grey_range": 0.0}):
        with pytest.raises(InputError, match=next(iter(wrong))):
            single_precision_extrema(space, **wrong)


COUNTS = pd.DataFrame(
    {
        "n_spo": [13, 14, 15],
        "n_common": [100, 200, 300],
        "n_new": pd.array([None, 20, 10], dtype="Int64"),
        "n_lost": pd.array([50, 20, None], dtype="Int64"),
    }
)


def test_settled_rates_are_weighted_by_their_detections():
    row = floor_summary(COUNTS, pd.Series([1.0, 1.0, 0.5, 0.1]), 14).iloc[0]
    assert row["mean_common"] == 250
    assert row["new_rate"] == 30 / 500 and row["lost_rate"] == 20 / 200  # nothing follows the last
    assert row["new_low"] < row["new_rate"] < row["new_high"]
    assert row["n_unique"] == 4 and row["share_always"] == 0.5
    assert np.isnan(floor_summary(COUNTS, pd.Series([], dtype=float), 99)["new_rate"].item())


WORDS = ["no tolerance", "tolerance 2e-6", "view in 9 bits"]


def figure_readings():
    """Readings of two choices, of which one reaches the paper's numbers, and those of another run."""
    rows = []
    for reading in crossed([0.0, 1e-6], [1.0, 0.1]):
        n_choices = sum(a != b for a, b in zip(reading, Reading(), strict=True))
        rate, always = 0.02 + 0.04 * n_choices, 0.6 - 0.2 * n_choices
        row = {**reading._asdict(), "n_choices": n_choices}
        for name in ("new", "lost"):
            row |= {f"{name}_rate": rate, f"{name}_low": 0.9 * rate, f"{name}_high": 1.1 * rate}
        row |= {"share_always": always, "low_always": always - 0.02, "high_always": always + 0.02}
        rows.append(row)
    table = pd.DataFrame(rows).assign(scene="reference", variant="usual")
    table["reaches_rates"] = table["new_rate"].between(0.09, 0.11)
    table["reaches_always"] = table["reaches"] = table["n_choices"] == 2
    return pd.concat([table, table.head(3).assign(scene="lake", variant="lake_usual")])


def figure_causes():
    """Causes of changes at three samplings."""
    rows = [
        {"matching": m, "n_spo": n, "change": change, "cause": cause, "rate": 0.01 * k}
        for m in ("any", "one-to-one")
        for n in (3, 9, 15)
        for change in ("new", "lost")
        for k, cause in enumerate(CAUSES)
    ]
    return pd.DataFrame(rows)


def figure_floor_tables(names):
    rates = [
        {"variant": name, "n_spo": n, "new_rate": r, "new_low": r / 2, "new_high": 2 * r}
        for name in names
        for n, r in ((3, np.nan), (9, 0.1), (15, 0.05))
    ]
    summary = floor_summary(COUNTS, pd.Series([1.0, 0.2]), 14)
    return {
        "floor_rates": pd.DataFrame(rates),
        "floor_summary": pd.concat([summary.assign(variant=name) for name in names]),
        "floor_variants": pd.DataFrame({"variant": names, "differs_in": WORDS[: len(names)]}),
        "floor_readings": figure_readings(),
        "floor_causes": figure_causes(),
    }


def test_the_figure_shows_every_variant():
    figure = floor.draw(figure_floor_tables(["usual", "epsilon_1e6", "of_my_own"]))
    panels = {ax.get_label(): ax for ax in figure.axes}
    assert set(panels) == {*"abcdefgh", "causes"}  # the names of (d)'s parts stand beside it
    labels = [text.get_text() for text in panels["g"].get_yticklabels()]
    assert labels == ["no tolerance", "tolerance 2e-6", "of_my_own"]
    lines = {line.get_label(): line for line in panels["f"].lines}
    assert lines["usual"].get_ydata().tolist() == [10.0, 5.0]
    assert "of_my_own" not in lines
    assert "2e-6" in {text.get_text() for text in panels["f"].texts}


def test_the_figure_shows_every_reading_and_names_those_that_reach_the_paper():
    figure = floor.draw(figure_floor_tables(["usual"]))
    panels = {ax.get_label(): ax for ax in figure.axes}
    marks = {group.get_label(): len(group.get_offsets()) for group in panels["a"].collections}
    assert marks.pop("reaches") > 0 and sum(marks.values()) == 2 * 3 * 2 * 2 * 2
    labels = [text.get_text().replace("\n", " ") for text in panels["b"].get_yticklabels()]
    assert labels[0] == "usual"
    assert {"one-to-one", "grid scale", "soft range", "greedy set", "within 0.1 px"} <= set(labels)
    assert "one-to-one, tolerance 1e-6" in labels  # two choices reach
    assert "one-to-one, grid scale, tolerance 1e-6" not in labels
    (shares,) = (line for line in panels["c"].lines if line.get_label() == "always")
    assert shares.get_xdata()[0] == pytest.approx(60.0)


def test_bars_of_causes_add_up_to_the_rates():
    figure = floor.draw(figure_floor_tables(["usual"]))
    panels = {ax.get_label(): ax for ax in figure.axes}
    for name in "de":
        tops = [bar.get_y() + bar.get_height() for bar in panels[name].patches]
        assert max(tops) == pytest.approx(15.0) and min(tops) == pytest.approx(-15.0)


def test_the_figure_leaves_out_a_tolerance_that_no_extremum_exceeds():
    tables = figure_floor_tables(["usual", "epsilon_1e6"])
    rates = tables["floor_rates"]
    nothing = rates["variant"] == "epsilon_1e6"
    rates.loc[nothing, ["new_rate", "new_low", "new_high"]] = np.nan
    (panel,) = (ax for ax in floor.draw(tables).axes if ax.get_label() == "f")
    labels = {line.get_label() for line in panel.lines}
    assert "usual" in labels and "epsilon_1e6" not in labels
