"""Figure predictors: does a single detection show whether it can be trusted?"""  # noqa: D400

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from keystab.errors import InputError
from keystab.figures import palette, style
from keystab.figures._render import Tables, check_tables, main

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from pandas import DataFrame

TABLES = {
    "predictors_auc.csv": (
        *("label", "picture", "predictor", "validation"),
        *("auc", "auc_low", "auc_high", "rejected", "n_good", "n_bad"),
    ),
    "predictors_gain.csv": ("label", "picture", "model", "best"),
    "predictors_roc.csv": ("label", "picture", "predictor", "kept", "rejected"),
}
"""Files read, with the columns that they must have."""

PANELS = {
    "stability": ("stable?", "stable?", "stable", "unstable"),
    "inside": ("stable, in range?", "in range?", "stable", "unstable"),
    "truth": ("true extremum?", "true?", "true", "false"),
}
"""Question -> title of its column, the same in short, what is good, what is bad."""

NAMES = {
    **style.FEATURE_NAMES,
    "eigenvalue": "smallest eigenvalue",
    "edge": "edge ratio",
    "degeneracy": "distance to degeneracy",
    "saddle": "distance to a saddle",
    "persistence": "persistence across scale",
    "annulus": "extremum against annulus",
    "end": "distance to end of range",
    "figure_5": "figure 5's four",
    "combined": "all but end of range",
    "combined_end": "all of them",
}
"""Predictors and models in words."""

MODELS = ("figure_5", "combined", "combined_end")
"""Models, from few to many predictors; the others are single predictors."""

KEPT = 95.0
"""Per cent of the good detections kept, at which a share rejected is written."""


def draw(tables: Tables, draft: bool = False) -> Figure:
    """Draw areas under ROC curves of predictors and models, and the curves of the best.

    Parameters
    ----------
    tables : mapping
        See `TABLES`.
    draft : bool
        Say on the figure that its numbers come from quick settings.

    Returns
    -------
    matplotlib Figure
        a to c: area of each predictor and model on each picture, best below; d to f: mean ROC
        curves over the pictures left out, of the best single predictor and of models.

    Raises
    ------
    InputError
        If a table is unusable or one of the questions is missing.
    """
    check_tables(tables, TABLES)
    auc = tables["predictors_auc"]
    for label in PANELS:
        if not (auc["label"] == label).any():
            raise InputError(f"predictors_auc.csv: has no rows of {label}; remake the table")
    pictures = list(dict.fromkeys(auc["picture"]))
    colours = {
        name: palette.PICTURE_COLOURS[k % len(palette.PICTURE_COLOURS)]
        for k, name in enumerate(pictures)
    }
    place = _places(auc)
    with style.context():
        figure = style.new_figure(6.9)
        outer = figure.add_gridspec(2, 1, height_ratios=(1.9, 1.0), hspace=0.03)
        upper = style.panels(outer[0], 1, len(PANELS), sharey=True, wspace=0.03)[0]
        lower = style.panels(outer[1], 1, len(PANELS), sharey=True, wspace=0.03)[0]
        for column, (label, (title, short, good, bad)) in enumerate(PANELS.items()):
            style.letter(upper[column], "abc"[column], title)
            _draw_areas(upper[column], auc[auc["label"] == label], colours, place)
            style.letter(lower[column], "def"[column], f"{short} pictures left out")
            lower[column].set_xlabel(f"{good} ones kept (%)")
            _draw_curves(lower[column], tables, label)
            if column != 1:  # as in the first column
                lower[column].set_ylabel(f"{bad} ones rejected (%)")
        _name_pictures(figure, colours)
        _name_models(upper[0], place)
        return style.settle(figure, draft)


def _places(auc: DataFrame) -> dict[str, float]:
    """Row of every predictor, the best ones below, and of every model, set apart."""
    single = auc[auc["validation"] == "none"].groupby("predictor")["auc"].mean().sort_values()
    models = [name for name in MODELS if (auc["predictor"] == name).any()]
    place = {str(name): float(k) for k, name in enumerate(single.index)}
    return place | {name: len(single) + 0.6 + k for k, name in enumerate(models)}


def _draw_areas(
    ax: Axes, table: DataFrame, colours: dict[str, str], place: dict[str, float]
) -> None:
    """Draw areas with intervals, one row per predictor and model, and shares rejected."""
    shown = table[table["validation"] != "blocks"]
    for k, (picture, colour) in enumerate(colours.items()):
        up = 0.2 * (k - (len(colours) - 1) / 2)
        rows = shown[shown["picture"] == picture]
        at = up + rows["predictor"].map(place).to_numpy()
        ax.hlines(at, rows["auc_low"], rows["auc_high"], color=colour, linewidth=0.9)
        ax.plot(rows["auc"], at, "o", color=colour, markersize=3.2, label=picture)
        rows = table[(table["picture"] == picture) & (table["validation"] == "blocks")]
        at = up + rows["predictor"].map(place).to_numpy()
        ax.plot(rows["auc"], at, "o", color=colour, markerfacecolor="white", markersize=3.2,
                label=f"{picture}, blocks")  # fmt: skip
    for name, height in place.items():
        share = 100 * shown.loc[shown["predictor"] == name, "rejected"]
        if share.notna().any():
            ax.text(1.09, height, f"{share.mean():.0f}", transform=ax.get_yaxis_transform(),
                    fontsize=style.SMALL, color=palette.INK, va="center", ha="right")  # fmt: skip
    head = {"transform": ax.transAxes, "fontsize": style.SMALL, "color": palette.GREY}
    ax.text(1.1, 1.012, "rejected\n(%)", va="bottom", ha="right", **head)
    ax.axvline(0.5, color=palette.GREY, linewidth=0.7, linestyle=style.REFERENCE)
    ax.set_yticks(list(place.values()), [NAMES[name] for name in place])
    ax.set(
        xlim=(float(np.nanmin([0.4, table["auc"].min() - 0.02])), 1.0),
        ylim=(max(place.values()) + 0.6, -0.6),
    )
    ax.set_xlabel(style.AREA_AXIS)
    style.finish_axes(ax)


def _name_pictures(figure: Figure, colours: dict[str, str]) -> None:
    """Say above all panels which picture has which colour, and what full and open dots are."""
    from matplotlib.lines import Line2D

    dot: dict[str, Any] = {"linestyle": "none", "marker": "o", "markersize": 4.0}
    dots = [Line2D([], [], color=colour, label=name, **dot) for name, colour in colours.items()]
    learnt = {"learnt from other pictures": palette.GREY, "from its other blocks": "white"}
    dots += [
        Line2D([], [], color=palette.GREY, markerfacecolor=face, label=name, **dot)
        for name, face in learnt.items()
    ]
    # As many columns as pictures leave two for what was learnt from where.
    figure.legend(handles=dots, loc="outside upper right", ncols=min(len(dots), 6), frameon=False,
                  handletextpad=0.1, columnspacing=1.2)  # fmt: skip


def _name_models(ax: Axes, place: dict[str, float]) -> None:
    """Write what the rows of the models are, in the gap above them."""
    above = [height for name, height in place.items() if name in MODELS]
    if above:
        where = {"transform": ax.get_yaxis_transform(), "ha": "right", "va": "center"}
        ax.text(-0.03, min(above) - 0.8, "logistic regressions on", fontsize=style.SMALL,
                color=palette.GREY, **where)  # fmt: skip


def _draw_curves(ax: Axes, tables: Tables, label: str) -> None:
    """Draw mean curves over the pictures left out, with their range."""
    roc, gain = (tables[name] for name in ("predictors_roc", "predictors_gain"))
    roc, gain = roc[roc["label"] == label], gain[gain["label"] == label]
    best = gain[gain["model"] == "combined"].set_index("picture")["best"]
    chosen = {
        "best": [(picture, name) for picture, name in best.items()],
        "combined": [(picture, "combined") for picture in best.index],
        "combined_end": [(picture, "combined_end") for picture in best.index],
    }
    single = NAMES[best.iloc[0]] if best.nunique() == 1 else "best single one"
    names = {"best": single} | {name: NAMES[name] for name in MODELS[1:]}
    curves = {key: rows.sort_values("kept") for key, rows in roc.groupby(["picture", "predictor"])}
    # Where two agree, the thin line of the second shows on the first.
    for line, name, width in ((2, "combined_end", 2.2), (0, "best", 1.2), (1, "combined", 1.1)):
        colour = palette.MODEL_COLOURS[name]
        parts = [curves[member] for member in chosen[name] if member in curves]
        parts = [part for part in parts if part["rejected"].notna().all()]
        if parts:
            kept = 100 * parts[0]["kept"].to_numpy()
            values = 100 * np.array([part["rejected"].to_numpy() for part in parts])
            ax.fill_between(kept, values.min(axis=0), values.max(axis=0), color=colour, alpha=0.13,
                            linewidth=0)  # fmt: skip
            ax.plot(kept, values.mean(axis=0), color=colour, label=name,
                    linewidth=width)  # fmt: skip
        ax.annotate(
            names[name], (0.0, 0.0), (0.0, -29.0 - 9.5 * line), xycoords="axes fraction",
            textcoords="offset points", color=colour, fontsize=style.SMALL, va="top",
        )  # fmt: skip
    ax.plot([0, 100], [100, 0], style.REFERENCE, color=palette.GREY, linewidth=0.7, label="chance")
    ax.axvline(KEPT, color=palette.GREY, linewidth=0.5)
    ax.set(xlim=(0, 100), ylim=(0, 102))
    style.finish_axes(ax)


if __name__ == "__main__":
    raise SystemExit(main(draw, TABLES))
