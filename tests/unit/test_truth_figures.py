"""Figures truth and refinement: they show their tables, and say what they show."""

from __future__ import annotations

import itertools

import matplotlib
import numpy as np
import pandas as pd
import pytest
from figure_labels import collisions

from keystab.errors import InputError
from keystab.evaluation.recall_precision import CAUSES
from keystab.figures import refinement, style, truth, truth_cameras
from keystab.figures._render import save

BOTH = ("discrete", "refined")


def shares(n: int) -> dict[str, np.ndarray]:
    recall, precision = np.linspace(0.8, 0.97, n), np.linspace(0.95, 0.9, n)
    columns = {}
    for name, values in (("recall", recall), ("precision", precision)):
        columns |= {name: values, f"{name}_low": values - 0.02, f"{name}_high": values + 0.02}
    return columns


def errors(n: int) -> dict[str, np.ndarray]:
    return {name: np.geomspace(0.1, 0.01, n) for name in truth.ERRORS}


def labelled(**values: object) -> pd.DataFrame:
    names = list(values)
    return pd.DataFrame(itertools.product(*values.values()), columns=names)


@pytest.fixture(scope="module")
def truth_tables():
    samplings = labelled(n_spo=[3, 5, 9], detections=BOTH)
    samplings = samplings.assign(n_detections=100, n_right=90, n_twin=4, **shares(6), **errors(6))
    cosine = samplings[samplings["n_spo"] != 5]
    grid = labelled(n_spo=[3, 9], delta_min=[0.1, 0.5]).assign(recall=[0.9, 0.7, 1.0, 0.8])
    kappas = labelled(kappa=[2**0.1, 2 ** (1 / 3)], detections=BOTH).assign(**shares(4))
    causes = labelled(group=["stable", "between", "unstable"], cause=CAUSES)
    causes = causes.assign(share=[1, 0, 0, 0, 0, 0.5, 0.5, 0, 0, 0, 0, 0, 0.2, 0.3, 0.5])
    causes["n_group"] = 20
    auc = labelled(label=["stability", "truth"], feature=list(style.FEATURE_NAMES))
    auc = auc.assign(auc=0.8, low=0.7, high=0.9)
    views = labelled(sweep=list(truth_cameras.SWEEPS), value=[0.1, 0.4], n_spo=[9], detections=BOTH)
    views = views.assign(**shares(12))
    return {
        "truth_samplings": samplings,
        "truth_cosine": cosine,
        "truth_grid": grid,
        "truth_kappas": kappas,
        "truth_causes": causes,
        "truth_auc": auc,
        "truth_views": views,
    }


@pytest.fixture(scope="module")
def choices():
    table = labelled(
        n_spo=[3, 15], move=["nearest", "unit_step"], scale_moves=[True, False],
        max_offset=[0.5, 0.6, np.inf], max_iterations=[1, 2, 3, 100],
    )  # fmt: skip
    lost = 30 // table["max_iterations"]
    return {
        "refinement_choices": table.assign(
            kept_true=70 - lost, lost_true=lost, kept_false=5, lost_false=15
        )
    }


def test_figure_truth_shows_its_tables(truth_tables, tmp_path):
    figure = truth.draw(truth_tables)
    panels = {ax.get_label(): ax for ax in figure.axes}
    assert set(panels) == set("abcdefgh")
    assert collisions(figure) == []
    rows = truth_tables["truth_samplings"]
    lines = {line.get_label(): line for line in panels["a"].lines}
    wanted = 100 * rows.loc[rows["detections"] == "refined", "recall"]
    assert lines["refined"].get_ydata() == pytest.approx(wanted)
    second = {line.get_label(): line for line in panels["b"].lines}["refined, with second"]
    assert second.get_ydata() == pytest.approx([94.0, 94.0, 94.0])
    bars = sum(bar.get_width() for bar in panels["g"].patches)
    assert bars == pytest.approx(300.0)
    written = {text.get_text() for text in panels["e"].texts}
    assert written == {"90", "70", "100", "80"}
    texts = [text for text in figure.findobj(matplotlib.text.Text) if text.get_text().strip()]
    assert min(text.get_fontsize() for text in texts) >= 7.0
    save(figure, tmp_path / "one.pdf", draft=True)
    save(truth.draw(truth_tables), tmp_path / "two.pdf", draft=True)
    assert (tmp_path / "one.pdf").read_bytes() == (tmp_path / "two.pdf").read_bytes()


def test_figure_truth_cameras_shows_what_views_find_at_the_finest_sampling(truth_tables):
    views = truth_tables["truth_views"]
    coarse = views.assign(n_spo=3, recall=0.0)
    figure = truth_cameras.draw({"truth_views": pd.concat([coarse, views])})
    panels = {ax.get_label(): ax for ax in figure.axes}
    assert set(panels) == set("abc")
    assert collisions(figure) == []
    for letter, sweep in zip("abc", truth_cameras.SWEEPS, strict=True):
        rows = views[(views["sweep"] == sweep) & (views["detections"] == "refined")]
        lines = {line.get_label(): line.get_ydata() for line in panels[letter].lines}
        assert lines["recall"] == pytest.approx(100 * rows["recall"])
        assert lines["precision"] == pytest.approx(100 * rows["precision"])


def test_figure_refinement_shows_shares(choices):
    figure = refinement.draw(choices, draft=True)
    panels = {ax.get_label(): ax for ax in figure.axes}
    assert set(panels) == set("abcdef")
    assert all(ax.get_title(loc="left").count("=") == 1 for ax in panels.values())  # n_spo
    lines = {line.get_label(): line for line in panels["a"].lines}
    assert lines["nearest True 0.6"].get_ydata() == pytest.approx(
        [100 * n / 70 for n in (30, 15, 10, 0)]
    )
    removed = {line.get_label(): line for line in panels["c"].lines}["unit_step True inf"]
    assert removed.get_ydata() == pytest.approx([75.0] * 4)
    assert [text.get_text() for text in panels["d"].get_xticklabels()] == ["1", "2", "3", "∞"]


def test_a_missing_column_is_named(truth_tables):
    with pytest.raises(InputError, match=r"truth_grid\.csv: lacks the column\(s\) recall"):
        truth.draw(
            {**truth_tables, "truth_grid": truth_tables["truth_grid"][["n_spo", "delta_min"]]}
        )
