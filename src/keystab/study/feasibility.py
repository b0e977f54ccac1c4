"""Whether the study can be run with given settings, a picture and a disk.

Every check is a plain function that returns one line per problem, so that a person sees all of
them before anything is computed.
"""

from __future__ import annotations

import difflib
import math
import os
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from keystab.camera.view_sets import (
    assumed_blur,
    common_field_is_empty,
    common_scales,
    expanded,
    per_view,
    view_shapes,
    view_specs,
)
from keystab.camera.views import effective_blur
from keystab.errors import InputError
from keystab.io.pictures import picture_shape
from keystab.scalespace.sampling import Sampling, balanced_delta
from keystab.study.settings import refuse
from keystab.utils.memory import in_words

Settings = Mapping[str, Any]

NEEDED_SETS = ("still", "examples")
"""Sets of views that the figures are made from."""

SEARCHED_SETS = ("translations", "zooms", "rotations", "shipped", "blur_errors")
"""Sets of views that are searched for keypoints."""

ONCE_SEARCHED = {"shipped": "figure 7", "blur_errors": "figure S2"}
"""Sets of them that are searched at one sampling, and what is made of them."""

SWEPT_SETS = {
    "aliasing": ("figure 10", "blur"),
    "unknown_blur": ("figure 11", "blur_spread"),
    "noise": ("figure 12", "noise"),
}
"""Sweeps of sets of views that are searched: what is made of them, and what they differ in."""


def require(settings: Settings, folder: Path | str = ".") -> None:
    """Raise unless the study can be run.

    Parameters
    ----------
    settings : dict
        Complete settings, see `keystab.study.settings.checked`.
    folder : path
        Folder that relative paths in the settings start from.

    Raises
    ------
    InputError
        With one line per problem.
    """
    refuse(sweep_problems(settings))
    settings = {**settings, "sets": expanded(settings["sets"])}
    refuse(setting_problems(settings) or picture_problems(settings, Path(folder)))


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
        elif len(views["n_spo"]) != 1:
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
    folders = [os.path.normpath(settings[key]) for key in ("results", "figures", "logs")]
    if len(set(folders)) < len(folders):
        problems.append("results, figures and logs name the same folder; give three")
    return problems


def further_pictures(settings: Settings, folder: Path | str = ".") -> list[str]:
    """Names of the pictures of figure predictors that are not the reference.

    Left out once, a picture that counts twice would have been learnt from.

    Parameters
    ----------
    settings : dict
        Complete settings.
    folder : path
        Folder that relative paths in the settings start from.

    Examples
    --------
    >>> pictures = {"a": {"path": "a.png"}, "b": {"path": "./b.png"}}
    >>> further_pictures({"reference": "b.png", "predictors": {"pictures": pictures}})
    ['a']
    """
    own = Path(folder, settings["reference"]).resolve()
    return [
        name
        for name, picture in settings["predictors"]["pictures"].items()
        if Path(folder, picture["path"]).resolve() != own
    ]


def further_picture_problems(settings: Settings, folder: Path) -> list[str]:
    """One line for every further picture of figure predictors that cannot be used."""
    names = further_pictures(settings, folder)
    if not names:
        return [
            "predictors.pictures has no picture besides the reference; figure predictors leaves "
            "one out at a time: name one"
        ]
    least = math.ceil(2 * settings["comparison"]["border"]) + 3
    problems = []
    for name in names:
        picture = settings["predictors"]["pictures"][name]
        try:
            shape = picture_shape(folder / picture["path"])
        except InputError as error:
            problems.append(f"predictors.pictures.{name}: {error}")
            continue
        height, width = (int(size / picture["step"]) for size in shape)
        if min(height, width) < least:
            problems.append(
                f"predictors.pictures.{name}.step is {picture['step']:g}, which gives a view of "
                f"{height} x {width} px, allowed are sides of at least {least} px: lower it"
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


def still_blur(settings: Settings) -> float:
    """Blur of the view that figures 3 to 6 study, in its pixels."""
    still = per_view(settings["sets"]["still"])
    return effective_blur(still["blur"][0], still["step"][0], settings["reference_blur"])


def picture_problems(settings: Settings, folder: Path) -> list[str]:
    """One line for everything that the reference picture or the disk is too small for."""
    try:
        shape = picture_shape(folder / settings["reference"])
    except InputError as error:
        return [f"reference: {error}"]
    border = settings["comparison"]["border"]
    problems = [
        line
        for name, views in settings["sets"].items()
        for line in fit_problems(name, views, shape, border)
    ]
    if len(problems) == len(settings["sets"]):  # not the sets are to blame
        of_border = _border_problems(settings["sets"], shape, border)
        if of_border:
            return of_border
    problems += further_picture_problems(settings, folder)
    if problems:
        return problems
    problems = [
        line
        for name, views in settings["sets"].items()
        if views["n_spo"]
        for line in common_problems(name, views, shape, settings)
    ]
    if problems:
        return problems
    try:
        planned = samplings(settings, view_shapes(settings["sets"]["still"], shape)[0])
    except InputError as error:
        return [str(error)]
    results = folder / settings["results"]
    kept = sum(
        8 * sampling.n_samples
        for sampling in planned["samplings"]
        if sampling.n_spo in kept_n_spo(settings)
        and not (results / "scale_space" / f"n{sampling.n_spo}.sha256").exists()
    )
    kept += sum(
        bytes_of_stores(name, views, shape, settings)
        for name, views in settings["sets"].items()
        if settings["keep_scale_spaces"] is True and not (results / "scale_space" / name).exists()
    )
    free = _free_bytes(results)
    if kept > free:
        return [
            f"keep_scale_spaces asks for {in_words(kept)} of stores, {in_words(free)} are free at "
            f"{settings['results']}: keep fewer, or none with keep_scale_spaces: false"
        ]
    return []


def _border_problems(sets: Settings, shape: tuple[int, int], border: float) -> list[str]:
    """One line where the border leaves nothing of any view, which a usual one would not."""
    sides = {
        name: min(min(sides) for sides in view_shapes(views, shape)) - 2 * views["guard"]
        for name, views in sets.items()
    }
    smallest = min(sides, key=lambda name: sides[name])
    most = (sides[smallest] - 3) // 2
    if most < min(border, 3):
        return []
    return [
        f"comparison.border is {border:g}, allowed is at most {most}: the views of "
        f"sets.{smallest} have a side of {sides[smallest]} px"
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


def common_problems(
    name: str, views: Settings, reference_shape: tuple[int, int], settings: Settings
) -> list[str]:
    """One line where the views of a set have no field of view or no scales in common.

    Parameters
    ----------
    name : str
        Name of the set.
    views : dict
        Its description, a set that is searched.
    reference_shape : tuple of int
        Height and width of the reference in pixels.
    settings : dict
        Complete settings.
    """
    comparison = settings["comparison"]
    own = views["sigma_min"]
    sigma_min = settings["detector"]["sigma_min"] if own is None else own
    specs = view_specs(name, views, reference_shape)
    moves = len({(spec.step, spec.shift, spec.rotation) for spec in specs}) > 1
    needed = math.ceil(6 * sigma_min * 2 ** views["n_oct"])
    if moves and views["guard"] < needed:
        return [
            f"sets.{name}.guard is {views['guard']}, allowed is at least {needed}: 6 times the "
            f"largest scale of its {views['n_oct']} octave(s), or borders enter the comparison"
        ]
    low, high = common_scales(
        specs, sigma_min, views["n_oct"], comparison["first_scale"], comparison["last_scale"]
    )
    if low >= high:
        return [
            f"sets.{name} leaves no common range of scales: the last view begins at {low:.3g} px "
            f"of the first, which ends at {high:.3g} px; give a smaller zoom or more octaves"
        ]
    margin = max(views["guard"], comparison["border"])
    if common_field_is_empty(specs, reference_shape, margin):
        return [
            f"sets.{name} leaves no common field of view: no pixel of the first view of "
            f"{specs[0].shape[0]} x {specs[0].shape[1]} px lies {margin:g} px inside all "
            f"{len(specs)} views; give smaller shifts, zooms or rotations"
        ]
    return []


def bytes_of_stores(
    name: str, views: Settings, reference_shape: tuple[int, int], settings: Settings
) -> int:
    """Size of the scale-spaces of all views of a set, all samplings, within a few per cent."""
    own, kappa = views["sigma_min"], settings["detector"]["kappa"]
    sigma_min = settings["detector"]["sigma_min"] if own is None else own
    pixels = sum(height * width for height, width in view_shapes(views, reference_shape))
    octaves = sum(0.25**octave for octave in range(views["n_oct"]))
    samples = 0.0
    for n_spo in views["n_spo"]:
        step = views["delta_min"] or balanced_delta(n_spo, kappa, sigma_min)
        samples += pixels * octaves * (n_spo + 2) / step**2
    return int(8 * samples)


def fit_problems(
    name: str, views: Settings, reference_shape: tuple[int, int], border: float
) -> list[str]:
    """One line where the views of a set reach beyond the reference or are all border.

    Only the guard band of a view may lie beyond the reference.

    Examples
    --------
    >>> still = {"blur": 1.1, "step": 10, "shift_y": 0, "shift_x": 0, "rotation": 0, "noise": 0,
    ...          "height": 300, "width": None}
    >>> fit_problems("still", still, (2250, 4000), border=3)
    ['sets.still.height is 300, allowed is at most 225: the reference has 2250 px, the step is 10']
    """
    guard = views.get("guard", 0)
    least = math.ceil(2 * border) + 3
    problems = []
    shapes = view_shapes(views, reference_shape)
    for step, shape in zip(per_view(views)["step"], shapes, strict=True):
        for side, size, pixels in zip(("height", "width"), reference_shape, shape, strict=True):
            most = int(size / step) + 2 * guard
            if pixels > most:
                problems.append(
                    f"sets.{name}.{side} is {pixels}, allowed is at most {most}: the reference "
                    f"has {size} px, the step is {step:g}"
                )
            elif pixels - 2 * guard < least:
                problems.append(
                    f"sets.{name} asks for views of {shape[0]} x {shape[1]} px, allowed is a "
                    f"{side} of at least {least + 2 * guard} px: give a larger reference or a "
                    f"step below {step:g}"
                )
    return problems[:1]


def samplings(settings: Settings, shape: tuple[int, int]) -> dict[str, list[Sampling]]:
    """All samplings of the still view, by the block of settings that asks for them.

    Parameters
    ----------
    settings : dict
        Complete settings.
    shape : tuple of int
        Height and width of the view.

    Raises
    ------
    InputError
        If one of them is impossible.
    """
    sigma_min, kappa = settings["detector"]["sigma_min"], settings["detector"]["kappa"]
    blur, grid = still_blur(settings), settings["grid"]
    pairs = {
        "samplings": [
            (n, balanced_delta(n, kappa, sigma_min)) for n in settings["samplings"]["n_spo"]
        ],
        "grid": [(n, delta_min) for n in grid["n_spo"] for delta_min in grid["delta_min"]],
        "cubes": [(n, balanced_delta(n, kappa, sigma_min)) for n in [settings["cubes"]["n_spo"]]],
    }
    return {
        block: [Sampling(shape, blur, n, delta_min, sigma_min, kappa) for n, delta_min in members]
        for block, members in pairs.items()
    }


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


def _free_bytes(folder: Path) -> int:
    """Free space of the disk that a folder lies on or will lie on."""
    folder = folder.absolute()
    while not folder.exists():
        folder = folder.parent
    return shutil.disk_usage(folder).free
