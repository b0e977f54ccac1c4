"""Figure uncertainty shows its tables, and its tables are of pairs of shots."""

from __future__ import annotations

import itertools

import matplotlib
import numpy as np
import pandas as pd
import pytest
from scipy import ndimage

from keystab.errors import InputError
from keystab.experiments.shot_pairs import PREDICTED, Detector, shot_pairs
from keystab.experiments.uncertainty_calibration import coverage_table, strata_table
from keystab.figures import uncertainty


def labelled(**values):
    return pd.DataFrame(itertools.product(*values.values()), columns=list(values))


@pytest.fixture(scope="module")
def tables():
    place = {"kind": list(uncertainty.KINDS), "blur": [0.8, 1.1], "noise": [0.003, 0.03]}
    cases = labelled(case=list(uncertainty.CASES), **place)
    cases["predicted"], cases["against"] = zip(*cases.pop("case"), strict=True)
    judged = {"method": list(uncertainty.METHODS), "quantity": ["position", "scale"]}
    levels = labelled(**judged, level=[0.5, 0.9, 0.95, 0.99])
    coverage = cases.merge(levels, how="cross")
    coverage = coverage.assign(held=coverage["level"] - 0.02, low=0.8, high=0.95, n=100)
    # Tables are sorted: the first view, seen with all kinds of noise, need not come first.
    additive, first = coverage["kind"] == "additive", coverage["blur"] == 0.8
    other = coverage[additive & first].assign(blur=0.5, held=0.5)
    coverage = pd.concat([other, coverage[additive | first]])
    strata = labelled(stratum=["octave", *uncertainty.STRATA], part=range(4), **judged, level=[0.9])
    bins = labelled(bin=range(10)).assign(n=50)
    bins["predicted_survival"] = (bins["bin"] + 0.5) / 10
    bins = bins.assign(found=bins["predicted_survival"], low=0.0, high=1.0)
    asked = {"task": list(uncertainty.TASKS), "weights": ["equal", "octave", "bars"]}
    weights = labelled(**asked, kept=["all", "surviving"], noise=[0.003, 0.03])
    weights = weights.assign(ratio=0.7, ratio_low=0.6, ratio_high=0.8)
    guesses = labelled(guess=list(uncertainty.GUESSES)).assign(auc=[0.9, 0.7, 0.6])
    return {
        "uncertainty_coverage": coverage,
        "uncertainty_strata": strata.assign(held=0.88),
        "uncertainty_reliability": cases.merge(bins, how="cross"),
        "uncertainty_separation": cases.merge(guesses, how="cross"),
        "uncertainty_weights": weights,
    }


def test_the_figure_shows_its_tables(tables):
    figure = uncertainty.draw(tables)
    panels = {ax.get_label(): ax for ax in figure.axes}
    assert set(panels) == set("abcdefghi")
    lines = {name: {line.get_label(): line for line in ax.lines} for name, ax in panels.items()}
    assert lines["a"]["bars"].get_ydata() == pytest.approx([-2.0] * 4)
    # Lines of a panel stand side by side, about the noise that its axis names.
    cases = [lines["b"][" ".join(case)].get_xdata() for case in uncertainty.CASES]
    assert np.all(np.diff(np.array(cases), axis=0) > 0)
    assert np.prod(cases, axis=0) ** (1 / len(cases)) == pytest.approx([0.003, 0.03])
    for name in "bcdehi":
        assert [text.get_text() for text in panels[name].get_xticklabels()] == ["0.003", "0.03"]
    assert lines["b"]["estimated shot"].get_ydata() == pytest.approx([88.0, 88.0])
    assert lines["c"]["shot view"].get_ydata() == pytest.approx([88.0, 88.0])
    assert lines["d"]["jpeg alone"].get_ydata() == pytest.approx([88.0, 88.0])
    assert lines["e"]["0.5 known"].get_ydata() == pytest.approx([50.0, 50.0])
    assert lines["f"]["octave sigma"].get_ydata() == pytest.approx([88.0] * 4)
    assert lines["g"]["0.003"].get_xdata() == pytest.approx(np.arange(5.0, 100, 10))
    assert lines["h"]["contrast"].get_ydata() == pytest.approx([0.7, 0.7])
    assert lines["i"]["homography surviving"].get_ydata() == pytest.approx([0.7, 0.7])
    texts = [text for text in figure.findobj(matplotlib.text.Text) if text.get_text().strip()]
    assert min(text.get_fontsize() for text in texts) >= 7.0


def test_names_and_lines_lie_apart(tables):
    figure = uncertainty.draw(tables)
    for ax in figure.axes:
        boxes = [text.get_window_extent() for text in ax.texts]
        for one, other in itertools.combinations(boxes, 2):
            assert not one.overlaps(other)
        for line in ax.lines:
            points = ax.transData.transform(np.column_stack(line.get_data()).astype(float))
            for box in boxes:
                assert line.get_label().startswith("_") or not box.count_contains(points), ax


def test_no_motion_leaves_its_panel_empty(tables):
    nothing = tables["uncertainty_weights"].assign(
        ratio=np.nan, ratio_low=np.nan, ratio_high=np.nan
    )
    figure = uncertainty.draw(tables | {"uncertainty_weights": nothing})
    assert figure.axes[-1].get_ylim()[1] > 1


def test_a_missing_column_is_named(tables):
    lacking = tables | {
        "uncertainty_strata": tables["uncertainty_strata"].drop(columns="held"),
    }
    with pytest.raises(InputError, match="held"):
        uncertainty.draw(lacking)


@pytest.mark.slow
def test_pairs_of_shots_of_all_views_and_kinds_of_noise():
    view = 0.5 + ndimage.gaussian_filter(np.random.default_rng(0).standard_normal((60, 64)), 2)
    detector = Detector(3, 1.1, 2 ** (1 / 3), 2, 3.0, 2 ** (1 / 3))
    table = shot_pairs([(view, 0.8), (view, 1.1)], [0.01], 2, 1, detector)
    counts = table.groupby(["blur", "kind", "predicted", "against"]).size()
    assert set(table["predicted"]) == set(PREDICTED)
    assert set(counts[0.8].index.get_level_values("kind")) == set(uncertainty.KINDS)
    assert set(counts[1.1].index.get_level_values("kind")) == {"additive"}
    assert table["sigma"].between(1.1 * 2 ** (1 / 3), 4.4 / 2 ** (1 / 3)).all()
    again = shot_pairs([(view, 0.8), (view, 1.1)], [0.01], 2, 1, detector)
    pd.testing.assert_frame_equal(table, again)
    names = ["predicted", "against", "kind", "blur", "noise"]
    held = coverage_table(table, names)
    assert {tuple(row) for row in held[names].drop_duplicates().to_numpy()} <= {
        tuple(row) for row in table[names].drop_duplicates().to_numpy()
    }
    parts = strata_table(table)
    assert set(parts["stratum"]) == {"octave", "sigma", "conditioning", "contrast"}
