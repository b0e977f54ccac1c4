"""Figure predictors shows its tables, and says what it shows."""

import itertools

import matplotlib
import numpy as np
import pandas as pd
import pytest
from figure_labels import collisions

from keystab.errors import InputError
from keystab.figures import predictors, style
from keystab.figures._render import save
from keystab.prediction.predictors import MODELS, PREDICTORS

PICTURES = ("one", "two", "three")


@pytest.fixture(scope="module")
def tables():
    singles = itertools.product(predictors.PANELS, PICTURES, PREDICTORS, ["none"])
    models = itertools.product(predictors.PANELS, PICTURES, MODELS, ["blocks", "pictures"])
    auc = pd.DataFrame([*singles, *models], columns=["label", "picture", "predictor", "validation"])
    auc["auc"] = np.linspace(0.55, 0.9, len(auc))
    auc = auc.assign(auc_low=auc["auc"] - 0.05, auc_high=auc["auc"] + 0.05, n_good=90, n_bad=9)
    auc["rejected"] = np.where(auc["predictor"] == "edge", 0.25, 0.5)
    gain = pd.DataFrame(
        itertools.product(predictors.PANELS, PICTURES, MODELS),
        columns=["label", "picture", "model"],
    ).assign(best="condition")
    roc = pd.DataFrame(
        itertools.product(predictors.PANELS, PICTURES, [*MODELS, "condition"], [0.0, 0.5, 1.0]),
        columns=["label", "picture", "predictor", "kept"],
    )
    roc["rejected"] = 1 - roc["kept"] ** np.where(roc["predictor"] == "combined", 2, 1)
    return {"predictors_auc": auc, "predictors_gain": gain, "predictors_roc": roc}


def test_all_areas_and_curves_are_drawn(tables, tmp_path):
    figure = predictors.draw(tables)
    panels = {ax.get_label(): ax for ax in figure.axes}
    assert set(panels) == set("abcdef")
    assert collisions(figure) == []
    auc = tables["predictors_auc"]
    lines = {line.get_label(): line for line in panels["c"].lines}
    for picture in PICTURES:
        rows = auc[(auc["label"] == "truth") & (auc["picture"] == picture)]
        for name, wanted in ((picture, "blocks"), (f"{picture}, blocks", None)):
            shown = rows[(rows["validation"] == "blocks") == (wanted is None)]
            assert sorted(lines[name].get_xdata()) == pytest.approx(sorted(shown["auc"]))
    rows = [text.get_text() for text in panels["a"].get_yticklabels()]
    single = auc[auc["validation"] == "none"]
    order = single.groupby("predictor")["auc"].mean().sort_values().index
    assert rows == [predictors.NAMES[name] for name in [*order, *predictors.MODELS]]
    shares = [text.get_text() for text in panels["a"].texts if text.get_text().isdigit()]
    assert sorted(set(shares)) == ["25", "50"] and len(shares) == len(rows)
    curves = {line.get_label(): line for line in panels["d"].lines}
    assert curves["combined"].get_ydata() == pytest.approx([100, 75, 0])
    assert curves["best"].get_ydata() == pytest.approx([100, 50, 0])
    texts = [text for text in figure.findobj(matplotlib.text.Text) if text.get_text().strip()]
    assert min(text.get_fontsize() for text in texts) >= style.SMALL
    save(figure, tmp_path / "one.pdf", draft=True)
    save(predictors.draw(tables), tmp_path / "two.pdf", draft=True)
    assert (tmp_path / "one.pdf").read_bytes() == (tmp_path / "two.pdf").read_bytes()


def test_every_predictor_and_model_has_a_name():
    assert set(predictors.NAMES) >= {*PREDICTORS, *MODELS}
    assert set(predictors.MODELS) == set(MODELS)


def test_areas_that_do_not_exist_leave_their_place_empty(tables):
    auc = tables["predictors_auc"]
    nothing = auc["predictor"].isin(["combined", "combined_end"])
    empty = auc.assign(**{name: auc[name].mask(nothing) for name in ("auc", "auc_low", "auc_high", "rejected")})  # fmt: skip
    roc = tables["predictors_roc"]
    roc = roc.assign(rejected=roc["rejected"].mask(roc["predictor"] == "combined"))
    figure = predictors.draw({**tables, "predictors_auc": empty, "predictors_roc": roc})
    panel = next(ax for ax in figure.axes if ax.get_label() == "d")
    assert "combined" not in {line.get_label() for line in panel.lines}


def test_a_question_without_rows_is_named(tables):
    auc = tables["predictors_auc"]
    with pytest.raises(InputError, match=r"predictors_auc\.csv: has no rows of truth"):
        predictors.draw({**tables, "predictors_auc": auc[auc["label"] != "truth"]})
