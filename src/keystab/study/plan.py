"""What depends on the settings: what figures are drawn from, which sets are searched and where.

All functions are pure. They take the settings of one scene as `keystab.study.scenes` leaves them.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

Settings = Mapping[str, Any]


class Figure(NamedTuple):
    """What a figure is drawn from."""

    tables: tuple[str, ...]
    views: str = ""
    """Set of views, or sweep of sets, whose keypoints are matched within each."""
    swept: str = ""
    """What the sets of the sweep differ in."""
    of_scene: bool = True
    """Whether it shows a scene; others show theory, or several scenes, and are drawn once."""


FIGURES = {
    # discrete Gaussian blurs and the semigroup property
    "fig1": Figure(("fig1.csv",), of_scene=False),
    # simulated views
    "fig2": Figure(("fig2.csv", "fig2_pixels.parquet")),
    # number of extrema against the sampling
    "fig3": Figure(("fig3.csv",)),
    # extrema that come and go as the sampling gets finer
    "fig4": Figure(
        ("fig4_counts.csv", "fig4_keypoints.csv", "fig4_occurrence.csv", "fig4_summary.csv")
    ),
    # features against stability
    "fig5": Figure(("fig5_thresholds.csv", "fig5_roc.csv", "fig5_auc.csv")),
    # iso-surfaces around stable and unstable keypoints
    "fig6": Figure(("fig6.csv", "fig6_cubes.parquet")),
    # limits of the refinement, under translations
    "fig7": Figure(
        ("fig7_curves.csv", "fig7_precision.csv", "fig7_counts.csv", "fig7_shipped.csv"),
        "translations",
    ),
    # stability and precision when the camera zooms out
    "fig8": Figure(("fig8_curves.csv", "fig8_precision.csv"), "zooms"),
    # keypoints against the ratio of the two blurs
    "fig9": Figure(("fig9_counts.csv", "fig9_keypoints.csv", "fig9_occurrence.csv")),
    # aliasing
    "fig10": Figure(("fig10_counts.csv", "fig10_curves.csv"), "aliasing", "blur"),
    # a wrongly assumed camera blur
    "fig11": Figure(("fig11_curves.csv", "fig11_scales.csv"), "unknown_blur", "blur_spread"),
    # noise
    "fig12": Figure(
        ("fig12_curves.csv", "fig12_pixels.parquet", "fig12_scales.csv", "fig12_theory.csv"),
        "noise",
        "noise",
    ),
    # stability and precision when the camera rotates
    "figS1": Figure(("figS1_curves.csv", "figS1_precision.csv"), "rotations"),
    # a wrong blur, by its sign
    "figS2": Figure(("figS2.csv", "blur_zooms_pairs.csv")),
    # the blur of a real camera
    "figS3": Figure(("figS3.csv", "figS3_profiles.csv"), of_scene=False),
    # blobs, whose scale is known
    "figS4": Figure(("figS4.csv",), of_scene=False),
    # stability and precision when the scene is seen from the side
    "figS5": Figure(("figS5_counts.csv", "figS5_precision.csv"), "tilts"),
    # why extrema come and go at any density
    "floor": Figure(
        (
            "floor_rates.csv",
            "floor_summary.csv",
            "floor_variants.csv",
            "floor_readings.csv",
            "floor_causes.csv",
        )
    ),
    # detections against the true extrema
    "truth": Figure(
        (
            "truth_samplings.csv",
            "truth_cosine.csv",
            "truth_grid.csv",
            "truth_kappas.csv",
            "truth_causes.csv",
            "truth_auc.csv",
        )
    ),
    "truth_cameras": Figure(("truth_views.csv",)),  # the same, of views with aliasing, blur, noise
    # what refinement keeps and loses of the true extrema
    "refinement": Figure(("refinement_choices.csv",)),
    # error bars of keypoints against second shots
    "uncertainty": Figure(
        (
            "uncertainty_coverage.csv",
            "uncertainty_strata.csv",
            "uncertainty_reliability.csv",
            "uncertainty_separation.csv",
            "uncertainty_weights.csv",
        )
    ),
    # whether one detection shows that it is unstable
    "predictors": Figure(
        ("predictors_auc.csv", "predictors_gain.csv", "predictors_roc.csv"), of_scene=False
    ),
}
"""The figures in their order: what each shows, and the tables and sets that it is made from."""

STATED_SWEEPS = {"blur_zooms": "assumed_blur", "unbalanced": "delta_min", "large_scales": "noise"}
"""Sweeps of sets of views that answer statements of the text, and what their sets differ in."""

TABLES_NOT_DRAWN = (
    *("fig8_translations.csv", "figS5_curves.csv", "refinement.csv"),
    *(f"{it}_{of}.csv" for it in ("blur_zooms", "large_scales") for of in ("counts", "curves")),
    *("unbalanced_counts.csv", "unbalanced_curves.csv"),
)
"""Tables of a scene that no figure draws and no claim needs."""

TABLES_OF_THEORY = ("fig1_samplings.csv", "figS3_ranges.csv")
"""Tables of no scene that no figure draws and claims need."""

TABLES_OF_SCENES = ("predictors_detections.parquet",)
"""The same, of several scenes together."""


def setting(settings: Settings, place: str) -> Any:
    """Value of a setting.

    Examples
    --------
    >>> setting({"detector": {"kappa": 1.26}}, "detector.kappa")
    1.26
    """
    value: Any = settings
    for key in place.split("."):
        value = value[key]
    return value


# ---------------------------------------------------------------------------------------------
# Sets of views


def figures_of_views(swept: bool, against_scale: bool = False) -> str:
    """Regular expression for the figures that match the keypoints of sets of views.

    Parameters
    ----------
    swept : bool
        Whether those of a sweep, each set at its one sampling; else of one set at all of its own.
    against_scale : bool
        Of sweeps, whether those that draw a table against scale.

    Examples
    --------
    >>> figures_of_views(swept=False), figures_of_views(swept=True, against_scale=True)
    ('fig7|fig8|figS1|figS5', 'fig11|fig12')
    """
    names = [
        name
        for name, about in FIGURES.items()
        if about.views
        and bool(about.swept) is swept
        and (f"{name}_scales.csv" in about.tables) is against_scale
    ]
    return "|".join(names)


class Searched(NamedTuple):
    """A set of views at one of the samplings at which it is searched."""

    set: str
    n_spo: int
    sweep: str
    """Sweep that it is a member of, or its own name."""
    value: float
    """Its value in the sweep; nan for a set of its own."""
    guard: int


def sets_of_figure(settings: Settings, figure: str) -> list[str]:
    """Names of the sets of views that a figure studies: one, or all of a sweep."""
    views = FIGURES[figure].views
    return list(settings["sweeps"].get(views, [views]))


def searches_of_sweep(settings: Settings, sweep: str) -> list[Searched]:
    """Sets of a sweep that no figure is about, at all their samplings."""
    return searches(settings, *settings["sweeps"][sweep])


def stated_key(_settings: Settings, sweep: str) -> str:
    """Name of what the sets of such a sweep differ in."""
    return STATED_SWEEPS[sweep]


def last_scale(settings: Settings, name: str) -> float | None:
    """Upper end of the scales that are compared in a set or a sweep of sets, over its first scale.

    Where views see the scene at zooms that differ by much, or large octaves are asked for, that is
    the end of their octaves, whatever that of other comparisons is.
    """
    to_the_end = name.startswith(("tilts", "blur_zooms", "large_scales"))
    end: float | None = None if to_the_end else settings["comparison"]["last_scale"]
    return end


def last_scale_of_figure(settings: Settings, figure: str) -> float | None:
    """Such an end for the set of views that a figure studies."""
    return last_scale(settings, sets_of_figure(settings, figure)[0])


def octaves_of_sweep(settings: Settings, sweep: str) -> list[float]:
    """First scales of the octaves in which the sets of a sweep are searched."""
    views = settings["sets"][next(iter(settings["sweeps"][sweep]))]
    return [views["sigma_min"] * 2.0**octave for octave in range(views["n_oct"])]


def curve_n_spo(settings: Settings, figure: str) -> list[int]:
    """Samplings whose curves a figure of views has; of tilted views all that are searched."""
    name = "sets.tilts.n_spo" if figure == "figS5" else "stability.curve_n_spo"
    return list(setting(settings, name))


def finest_curve(settings: Settings) -> int:
    """Scales per octave of the finest sampling whose curves are drawn."""
    n_spo: int = max(settings["stability"]["curve_n_spo"])
    return n_spo


def tilts(settings: Settings, figure: str) -> list[float]:
    """Tilt of every view of a figure that matches the views of each tilt by themselves."""
    return settings["sets"]["tilts"]["tilt"] if figure == "figS5" else []


def swept(_settings: Settings, figure: str) -> str:
    """Name of what the sets of the sweep that a figure studies differ in."""
    return FIGURES[figure].swept


def searches(settings: Settings, *sets: str) -> list[Searched]:
    """Every set at every sampling at which it is searched."""
    value = {name: each for values in settings["sweeps"].values() for name, each in values.items()}
    sweep = {name: sweep for sweep, names in settings["sweeps"].items() for name in names}
    return [
        Searched(name, n_spo, sweep.get(name, name), value.get(name, math.nan), views["guard"])
        for name, views in ((name, settings["sets"][name]) for name in sets)
        for n_spo in views["n_spo"]
    ]


def searches_of_figure(settings: Settings, figure: str) -> list[Searched]:
    """Sets of views that a figure studies, at all their samplings; of a sweep, each at one."""
    return searches(settings, *sets_of_figure(settings, figure))


def scales_of_zooms(settings: Settings, end: int) -> float:
    """One end of the range of scales that all views of figure 8 cover, over their first scale."""
    views, comparison = settings["sets"]["zooms"], settings["comparison"]
    zooms = [step / views["step"][0] for step in views["step"]]
    ends = (
        max(zooms) * comparison["first_scale"],
        comparison["last_scale"] or 2.0 ** views["n_oct"],
    )
    return float(ends[end])


def compared_with_scene(settings: Settings) -> list[Searched]:
    """Sets held against the scene as the view ``still`` sees it: first views of the same step."""
    sets = settings["sets"]
    names = ["translations", "rotations"]
    for figure, about in FIGURES.items():
        names += sets_of_figure(settings, figure) if about.swept else []
    step = sets["still"]["step"][0]
    return searches(settings, *(name for name in names if sets[name]["step"][0] == step))


def further_limits(settings: Settings, figure: str, name: str) -> list[float]:
    """Values of ``max_offsets`` or ``max_iterations`` whose curves figure 7 draws; else none."""
    return settings["stability"][name] if figure == "fig7" else []


def starts_within(settings: Settings, figure: str) -> list[float]:
    """First scales of the octaves that lie within those in which a figure's sets are searched."""
    views = settings["sets"][sets_of_figure(settings, figure)[0]]
    end = views["sigma_min"] * 2 ** views["n_oct"]
    return [start for start in settings["stability"]["starts"] if 2 * start <= end * (1 + 1e-9)]


def largest_blur(settings: Settings, figure: str) -> float:
    """Camera blur of the views that a figure studies, of those that share one."""
    blur: float = max(settings["sets"][sets_of_figure(settings, figure)[0]]["blur"])
    return blur


# ---------------------------------------------------------------------------------------------
# Detection


def kept_n_spo(settings: Settings) -> list[int]:
    """Scales per octave of the samplings whose scale-space is written to a store.

    Examples
    --------
    >>> kept_n_spo({"keep_scale_spaces": True, "samplings": {"n_spo": [3, 15]}})
    [3, 15]
    >>> kept_n_spo({"keep_scale_spaces": False, "samplings": {"n_spo": [3, 15]}})
    []
    """
    kept = settings["keep_scale_spaces"]
    return list(settings["samplings"]["n_spo"]) if kept is True else list(kept or [])


def kept_sampling(settings: Settings, n_spo: str) -> list[int]:
    """The sampling where its scale-space is read from a store, nothing where it is streamed."""
    return [int(n_spo)] if int(n_spo) in kept_n_spo(settings) else []


def kept_set(settings: Settings, name: str) -> list[str]:
    """The set where its scale-spaces are read from stores, nothing where they are streamed."""
    return [name] if settings["keep_scale_spaces"] is True else []


def kappas(settings: Settings) -> list[float]:
    """Ratios of the difference of Gaussians that figure 9 compares, smallest fraction last."""
    fractions = sorted(settings["kappas"]["fractions"], reverse=True)
    return [2 ** (1 / fraction) for fraction in fractions]


def max_offset_of_path(settings: Settings) -> float:
    """M_offset where the path of a refinement depends on it, as it does for unit steps.

    Paths of nearest moves serve every M_offset; below 1/2 they do not move on anyway.
    """
    refinement = settings["refinement"]
    return refinement["max_offset"] if refinement["move"] == "unit_step" else 0.5


# ---------------------------------------------------------------------------------------------
# True extrema


def end_of_truth(settings: Settings) -> float:
    """Scale up to which true extrema are sought."""
    truth = settings["truth"]
    end: float = settings["detector"]["sigma_min"] * truth["last_scale"] * truth["beyond"]
    return end


class Ratio(NamedTuple):
    """A ratio of the two blurs with true extrema of its own."""

    kappa: float
    suffix: str
    """Of the file of its true extrema; none for the detector's own."""


def true_ratios(settings: Settings) -> list[Ratio]:
    """Ratios of the two blurs whose keypoints are held against true extrema."""
    fractions = settings["kappas"]["fractions"]
    asked = [fraction for fraction in settings["truth"]["fractions"] if fraction in fractions]
    own = settings["detector"]["kappa"]
    return [
        Ratio(kappa, "" if math.isclose(kappa, own) else f"_{fraction:g}")
        for fraction, kappa in ((one, 2 ** (1 / one)) for one in asked or fractions[:1])
    ]


def kappa_of_truth(settings: Settings, suffix: str) -> float:
    """Ratio of the two blurs that a file of true extrema belongs to."""
    return 2 ** (1 / float(suffix[1:])) if suffix else settings["detector"]["kappa"]


def refined_n_spo(settings: Settings) -> list[int]:
    """Samplings of figure refinement; the first and the last where it asks for none there is."""
    return those_available(settings["truth"]["refined_n_spo"], settings["samplings"]["n_spo"])


def those_available(asked: list[int], available: list[int]) -> list[int]:
    """Samplings that are asked for, of those that there are; if none, the first and the last.

    Examples
    --------
    >>> those_available([3, 15], [3, 4, 5]), those_available([15], [3, 4, 5])
    ([3], [3, 5])
    """
    found = [n_spo for n_spo in asked if n_spo in available]
    return found or sorted({available[0], available[-1]})


# ---------------------------------------------------------------------------------------------
# Audits


class Audited(NamedTuple):
    """A detector of others in one condition."""

    detector: str
    condition: str
    """With underscores for blanks, as in names of files."""


def audits(settings: Settings) -> list[Audited]:
    """Detectors that are audited, the controls first, each in all conditions.

    Examples
    --------
    >>> audits({"audit": {"detectors": ["opencv"], "conditions": ["blobs", "blur 0.3"]}})[-1]
    Audited(detector='opencv', condition='blur_0.3')
    """
    about = settings["audit"]
    return [
        Audited(detector, condition.replace(" ", "_"))
        for detector in ("control", *about["detectors"])
        for condition in about["conditions"]
    ]


# ---------------------------------------------------------------------------------------------
# What the study ends in


def table_files(place: str, results: str, names: Iterable[str]) -> list[str]:
    """Paths of tables for a scene; those that show no single scene stand with the default one.

    Examples
    --------
    >>> table_files("scenes/stream/", "results", ["fig1.csv", "fig3.csv"])
    ['results/tables/fig1.csv', 'results/scenes/stream/tables/fig3.csv']
    """
    once = {table for figure in FIGURES.values() if not figure.of_scene for table in figure.tables}
    once |= set(TABLES_OF_THEORY)
    return [f"{results}/{'' if name in once else place}tables/{name}" for name in names]


def final_files(place: str, results: str, figures: str, claimed: Iterable[str]) -> list[str]:
    """Paths of all that the study of a scene ends in: figures, tables and verdicts, sorted.

    What figures draw is named too: Snakemake would not miss a lost table whose figure is there.

    Parameters
    ----------
    place : str
        Place of the scene.
    results, figures : str
        Folders of results and figures.
    claimed : iterable of str
        Tables that claims need.
    """
    drawn = {name: each for name, each in FIGURES.items() if each.of_scene or not place}
    tables = {*claimed, *TABLES_NOT_DRAWN, *(() if place else TABLES_OF_SCENES)}
    tables |= {table for figure in drawn.values() for table in figure.tables}
    paths = [f"{figures}/{place}{name}.{kind}" for name in drawn for kind in ("pdf", "png")]
    paths += [f"{results}/{place}claims.{kind}" for kind in ("csv", "json", "md")]
    return sorted({*paths, *table_files(place, results, tables)})
