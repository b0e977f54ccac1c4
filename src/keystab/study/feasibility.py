"""Whether the study can be run with given settings, a picture and a disk.

Every check is a plain function that returns one line per problem, so that a person sees all of
them before anything is computed.
"""

from __future__ import annotations

import difflib
from pathlib import Path

from keystab.camera.view_sets import assumed_blur, expanded, per_view
from keystab.camera.views import effective_blur
from keystab.errors import InputError
from keystab.study.picture_checks import Settings, picture_problems, still_blur
from keystab.study.plan import FIGURES, STATED_SWEEPS, kept_n_spo
from keystab.study.result_folders import path_problems
from keystab.study.settings import refuse

NEEDED_SETS = ("still", "examples")
"""Sets of views that the figures are made from."""

ONCE_SEARCHED = {"shipped": "figure 7", "blur_errors": "figure S2"}
"""Sets of views that are searched at one sampling, and what is made of them."""

SEARCHED_SETS = (
    *(about.views for about in FIGURES.values() if about.views and not about.swept),
    "translations_wide",  # with which figure 8 is compared
    *ONCE_SEARCHED,
)
"""Sets of views that are searched for keypoints."""

SWEPT_SETS = {
    about.views: (name.replace("fig", "figure "), about.swept)
    for name, about in FIGURES.items()
    if about.swept
} | {name: ("what the claims ask", key) for name, key in STATED_SWEEPS.items()}
"""Sweeps of sets of views that are searched: what is made of them, and what they differ in."""


def require(settings: Settings, folder: Path | str = ".", written: Settings | None = None) -> None:
    """Raise unless the study can be run.

    Parameters
    ----------
    settings : dict
        Complete settings, see `keystab.study.settings.checked`.
    folder : path
        Folder that relative paths in the settings start from.
    written : dict, optional
        Of these, what a person wrote; by default all. What does not fit a picture is then said of
        the picture, unless the person wrote it.

    Raises
    ------
    InputError
        With one line per problem.
    """
    refuse(path_problems(settings, Path(folder)))
    try:
        _require(settings, Path(folder), written)
    except (ArithmeticError, RecursionError) as error:
        raise InputError(
            f"config: the settings lead to numbers that cannot be computed ({error}); "
            "give values nearer to those of config/config.yaml"
        ) from None


def _require(settings: Settings, folder: Path, written: Settings | None) -> None:
    refuse(sweep_problems(settings))
    by_hand = None if written is None else _sized_by_hand(settings["sets"], written)
    settings = {**settings, "sets": expanded(settings["sets"])}
    refuse(setting_problems(settings) or picture_problems(settings, folder, by_hand))


def _sized_by_hand(sets: Settings, written: Settings) -> set[str]:
    """Sets of views, members of sweeps too, whose size a person gave."""
    given = {name: views or {} for name, views in written.get("sets", {}).items()}
    sized = {name for name, views in given.items() if _SIZES & views.keys()}
    return {*expanded({name: views for name, views in sets.items() if name in sized})}


_SIZES = {"step", "height", "width", "guard", "zoom", "whole", "shift_spread", "rotation_spread"}
"""Settings of a set of views that decide what part of a picture they show."""


def sweep_problems(settings: Settings) -> list[str]:
    """One line for every sweep that figures are made from and that does not fit them."""
    problems = [
        f"sets.{name} has a sweep, allowed is none: figures are made from its views as one set"
        for name in (*NEEDED_SETS, *SEARCHED_SETS)
        if settings["sets"].get(name, {}).get("sweep")
    ]
    for name, (figure, key) in SWEPT_SETS.items():
        views = settings["sets"].get(name, {})
        if list(views.get("sweep") or {}) != [key]:
            swept = " and ".join(views.get("sweep") or {}) or "nothing"
            problems.append(
                f"sets.{name}.sweep has {swept}, allowed is {key}: {figure} is made from it"
            )
        elif len(views["n_spo"]) != 1 and name != "unbalanced":
            problems.append(
                f"sets.{name}.n_spo is {views['n_spo']}, allowed is one sampling for {figure}"
            )
    return problems or _octaves_problems(settings)


def _octaves_problems(settings: Settings) -> list[str]:
    """One line where no octave of `stability.starts` lies within those searched."""
    starts = settings["stability"]["starts"]
    for name in ("unknown_blur", "noise"):
        views = settings["sets"][name]
        own = views["sigma_min"]
        sigma_min = settings["detector"]["sigma_min"] if own is None else own
        last = sigma_min * 2 ** views["n_oct"] / 2
        if starts[0] > last * (1 + 1e-9):
            return [
                f"stability.starts is {starts}, allowed is at least one of at most {last:g}: "
                f"an octave from there must end within the {views['n_oct']} of sets.{name}"
            ]
    return []


def every_set(settings: Settings) -> Settings:
    """Sets of views by name; each value of a sweep is a set of its own."""
    return expanded(settings.get("sets", {}))


def setting_problems(settings: Settings) -> list[str]:
    """One line for every pair of settings that contradict each other; sweeps are expanded."""
    problems = [
        f"sets.{name} is missing; the figures are made from it"
        for name in (*NEEDED_SETS, *SEARCHED_SETS)
        if name not in settings["sets"]
    ]
    problems += _misspelt_sets(settings["sets"])
    for name, views in settings["sets"].items():
        try:
            per_view(views)
        except InputError as error:
            problems.append(f"sets.{name} has {error}")
    if problems:
        return problems
    n_views = len(per_view(settings["sets"]["still"])["blur"])
    if n_views != 1:
        problems.append(
            f"sets.still has {n_views} views, allowed is one: figures 3 to 6 study a single view"
        )
    else:
        problems += _scale_below_blur(settings) or searched_problems(settings)
    for name, variant in settings["floor"]["variants"].items():
        if variant["set"] not in settings["sets"]:
            close = difflib.get_close_matches(variant["set"], settings["sets"], n=3, cutoff=0.0)
            problems.append(
                f"floor.variants.{name}.set is {variant['set']}, allowed are sets of views, "
                f"such as {', '.join(close)}"
            )
        if variant["arithmetic"] == "float32_transforms" and variant["oversampling"] != "spline":
            problems.append(
                f"floor.variants.{name} transforms in single precision with the "
                f"{variant['oversampling']} series, allowed is oversampling: spline"
            )
    if not any(one["arithmetic"] == "float64" for one in settings["floor"]["variants"].values()):
        problems.append(
            "floor.variants has none in double precision, whose extrema are read in all ways; keep "
            "one with arithmetic: float64"
        )
    problems += [
        f"floor.pictures.{name} has the name of another picture, that of predictors.pictures: "
        "give it a name of its own"
        for name, picture in settings["predictors"]["pictures"].items()
        if picture["path"] != settings["floor"]["pictures"].get(name, picture)["path"]
    ]
    problems += _order(settings["comparison"], "comparison", "unstable_below", "stable_above")
    if settings["comparison"]["last_scale"] is not None:
        problems += _order(settings["comparison"], "comparison", "first_scale", "last_scale")
    problems += _order(settings["semigroup"], "semigroup", "sigma_from", "sigma_to")
    problems += _order(settings["blobs"], "blobs", "size_from", "size_to")
    available = settings["samplings"]["n_spo"]
    if settings["truth"]["last_scale"] <= settings["comparison"]["first_scale"]:
        problems.append(
            f"truth.last_scale is {settings['truth']['last_scale']}, allowed is a number above "
            f"comparison.first_scale = {settings['comparison']['first_scale']}"
        )
    unknown = [n_spo for n_spo in kept_n_spo(settings) if n_spo not in available]
    if unknown:
        problems.append(
            f"keep_scale_spaces has {', '.join(map(str, unknown))}, allowed are members of "
            f"samplings.n_spo = {available}"
        )
    if settings["floor"]["settles_at"] > max(available):
        problems.append(
            f"floor.settles_at is {settings['floor']['settles_at']}, allowed is at most "
            f"{max(available)}, the last of samplings.n_spo"
        )
    return problems


def _misspelt_sets(sets: Settings) -> list[str]:
    """One line for every set that nothing uses and that is nearly called like one that is used."""
    used = [*NEEDED_SETS, *SEARCHED_SETS, *SWEPT_SETS]
    members = [name for name in sets if name.rpartition("_")[0] in SWEPT_SETS]
    problems = []
    for name in sets:
        close = difflib.get_close_matches(name, used, n=1, cutoff=0.8)
        if close and name not in used and name not in members:
            problems.append(
                f"sets.{name} is no set that figures are made from; did you mean "
                f"sets.{close[0]}? Give another set a name that is less alike"
            )
    return problems


def _order(block: Settings, name: str, lower: str, upper: str) -> list[str]:
    if block[lower] < block[upper]:
        return []
    return [
        f"{name}.{lower} is {block[lower]}, allowed is a number below {name}.{upper} = "
        f"{block[upper]}"
    ]


def _scale_below_blur(settings: Settings) -> list[str]:
    sigma_min, blur = settings["detector"]["sigma_min"], still_blur(settings)
    if sigma_min >= blur:
        return []
    return [
        f"detector.sigma_min is {sigma_min}, allowed is at least {blur:g}, the blur that the view "
        "sets.still already has"
    ]


def searched_problems(settings: Settings) -> list[str]:
    """One line for every set of views that cannot be searched and compared as the figures need."""
    problems = []
    curves = settings["stability"]["curve_n_spo"]
    sigma_min = settings["detector"]["sigma_min"]
    compared = [settings["sets"][name]["n_spo"] for name in ("translations", "zooms", "rotations")]
    shared = sorted(set(compared[0]).intersection(*compared))
    if all(compared) and set(curves) - set(shared):
        problems.append(
            f"stability.curve_n_spo is {curves}, allowed are members of n_spo of "
            f"sets.translations, sets.zooms and sets.rotations, which share {shared}"
        )
    problems += _assumed_blur_problems(settings)
    for name, views in settings["sets"].items():
        if name in SEARCHED_SETS and not views["n_spo"]:
            problems.append(f"sets.{name}.n_spo is empty; give the scales per octave of a sampling")
        elif name in ONCE_SEARCHED and len(views["n_spo"]) > 1:
            problems.append(
                f"sets.{name}.n_spo is {views['n_spo']}, allowed is one sampling for "
                f"{ONCE_SEARCHED[name]}"
            )
        if not views["n_spo"]:
            continue
        first = sigma_min if views["sigma_min"] is None else views["sigma_min"]
        assumed = assumed_blur(views)
        own = per_view(views)
        blurs = (
            [
                effective_blur(blur, step, settings["reference_blur"])
                for blur, step in zip(own["blur"], own["step"], strict=True)
            ]
            if assumed is None
            else [assumed]
        )
        if first < max(blurs):
            problems.append(
                f"sets.{name} is searched from sigma_min = {first:g} px, allowed is at least "
                f"{max(blurs):g}, the blur that its views already have"
            )
    return problems


def _assumed_blur_problems(settings: Settings) -> list[str]:
    """One line where the view of the assumed blur, the measure of figure S2, is not the first."""
    views = settings["sets"]["blur_errors"]
    first = per_view(views)["blur"][0]
    if views["assumed_blur"] == first:
        return []
    given = "empty" if views["assumed_blur"] is None else views["assumed_blur"]
    return [
        f"sets.blur_errors.assumed_blur is {given}, allowed is {first:g}, the blur of its first "
        "view: figure S2 compares the others with that one"
    ]
