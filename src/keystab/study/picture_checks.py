"""What a picture and a disk are too small for, with given settings; and what will be stored.

Every check is a plain function that returns one line per problem.
"""

from __future__ import annotations

import math
import re
import shutil
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

from keystab.camera.common_field import (
    common_field_is_empty,
    common_scales,
    zooms_in_common_field,
)
from keystab.camera.view_sets import per_view, view_shapes, view_specs
from keystab.camera.views import effective_blur
from keystab.errors import InputError
from keystab.io.pictures import picture_shape
from keystab.scalespace.sampling import Sampling, balanced_delta
from keystab.study.plan import kept_n_spo, last_scale
from keystab.study.scenes import further_pictures
from keystab.utils.memory import in_words

Settings = Mapping[str, Any]


def further_picture_problems(settings: Settings, folder: Path) -> list[str]:
    """One line for every picture of figures predictors and floor that cannot be used."""
    names = further_pictures(settings, folder)
    if not names:
        return [
            "predictors.pictures has no picture besides the reference; figure predictors leaves "
            "one out at a time: name one"
        ]
    least = math.ceil(2 * settings["comparison"]["border"]) + 3
    problems = []
    further = [("predictors", name) for name in names]
    further += [("floor", name) for name in settings["floor"]["pictures"]]
    for block, name in further:
        picture = settings[block]["pictures"][name]
        try:
            shape = picture_shape(folder / picture["path"])
        except InputError as error:
            problems.append(f"{block}.pictures.{name}: {error}")
            continue
        height, width = (int(size / picture["step"]) for size in shape)
        if min(height, width) < least:
            problems.append(
                f"{block}.pictures.{name}.step is {picture['step']:g}, which gives a view of "
                f"{height} x {width} px, allowed are sides of at least {least} px: lower it"
            )
    return problems


def still_blur(settings: Settings) -> float:
    """Blur of the view that figures 3 to 6 study, in its pixels."""
    still = per_view(settings["sets"]["still"])
    return effective_blur(still["blur"][0], still["step"][0], settings["reference_blur"])


def picture_problems(
    settings: Settings, folder: Path, by_hand: Collection[str] | None = None
) -> list[str]:
    """One line for everything that the reference picture or the disk is too small for.

    Parameters
    ----------
    settings : dict
        Complete settings; sweeps are expanded.
    folder : path
        Folder that relative paths in them start from.
    by_hand : collection of str, optional
        Sets of views whose size a person gave: where one does not fit, it is named. Where others do
        not, the picture is too small. By default all count as given.
    """
    try:
        shape = picture_shape(folder / settings["reference"])
    except InputError as error:
        return [f"reference: {error}"]
    border = settings["comparison"]["border"]
    problems = {
        name: lines
        for name, views in settings["sets"].items()
        if (lines := fit_problems(name, views, shape, border))
    }
    if 2 * len(problems) > len(settings["sets"]):  # not the sets are to blame
        of_border = _border_problems(settings["sets"], shape, border)
        if of_border:
            return of_border
    found = _whose_fault(problems, settings, shape, by_hand)
    found += further_picture_problems(settings, folder)
    if found:
        return found
    problems = {
        name: lines
        for name, views in settings["sets"].items()
        if views["n_spo"] and (lines := common_problems(name, views, shape, settings))
    }
    if problems:
        return _whose_fault(problems, settings, shape, by_hand)
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


def _whose_fault(
    problems: Mapping[str, list[str]],
    settings: Settings,
    shape: tuple[int, int],
    by_hand: Collection[str] | None,
) -> list[str]:
    """Lines on sets that do not fit; one on the picture, where no person gave their sizes."""
    own = problems if by_hand is None else problems.keys() & by_hand
    lines = [line for name in problems if name in own for line in problems[name]]
    others = {name: views for name, views in settings["sets"].items() if name not in own}
    if len(own) == len(problems):
        return lines
    least, sets = least_shape(others, settings)
    if all(size >= needed for size, needed in zip(shape, least, strict=True)):
        return [line for each in problems.values() for line in each]  # a larger one would not do
    return [
        f"picture too small: {settings['reference']} has {shape[0]} x {shape[1]} pixels (height x "
        f"width), these settings need at least {least[0]} x {least[1]}; give a larger one, or a "
        f"smaller step, height or width of {' and '.join(f'sets.{name}' for name in sets)}",
        *lines,
    ]


def least_shape(sets: Settings, settings: Settings) -> tuple[tuple[int, int], list[str]]:
    """Height and width of the smallest reference that sets of views fit, and what asks for them.

    Parameters
    ----------
    sets : mapping
        Sets of views by name, without sweeps.
    settings : mapping
        Complete settings.

    Returns
    -------
    shape : tuple of int
        Where views also need a common field, the smallest of these proportions.
    names : list of str
        The sets, at most one per side, that would not fit a smaller one.
    """
    most, sizes = [], []
    for side in ("height", "width"):
        border = settings["comparison"]["border"]
        needed = {name: _least_side(views, side, border) for name, views in sets.items()}
        most.append(max(needed, key=needed.__getitem__))
        sizes.append(needed[most[-1]])
    shape = (sizes[0], sizes[1])
    searched = {name: views for name, views in sets.items() if views["n_spo"]}

    def alone(percent: int) -> list[str]:
        """Sets that have nothing in common in a picture of these proportions."""
        larger, found = _scaled(shape, percent), []
        for name, views in searched.items():
            try:
                found += [name] if common_problems(name, views, larger, settings) else []
            except InputError:  # a tilted view that sees the horizon
                found.append(name)
        return found

    if lone := alone(100):
        most = lone[:1]
        tens = next((it for it in range(110, 401, 10) if not alone(it)), 100)
        percent = next((it for it in range(tens - 9, tens) if not alone(it)), tens)
        shape = _scaled(shape, percent)
    # Members of a sweep share their size, which is given once for all.
    return shape, list(dict.fromkeys(_OF_SWEEP.sub("", name) for name in most))


_OF_SWEEP = re.compile(r"_\d[\dp]*$")


def _least_side(views: Settings, side: str, border: float) -> int:
    """Least side of a reference that all views of a set fit; see `fit_problems`."""
    step, given = max(per_view(views)["step"]), views[side]
    pixels = math.ceil(2 * border) + 3 if given is None else given - 2 * views["guard"]
    size = max(math.ceil(pixels * step) - 1, 1)
    while int(size / step) < pixels:  # as views are cut, rounding included
        size += 1
    return size


def _scaled(shape: tuple[int, int], percent: int) -> tuple[int, int]:
    return -(-shape[0] * percent // 100), -(-shape[1] * percent // 100)


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
    moves = len({(spec.step, spec.shift, spec.rotation, spec.homography) for spec in specs}) > 1
    needed = math.ceil(6 * sigma_min * 2 ** views["n_oct"])
    if moves and views["guard"] < needed:
        return [
            f"sets.{name}.guard is {views['guard']}, allowed is at least {needed}: 6 times the "
            f"largest scale of its {views['n_oct']} octave(s), or borders enter the comparison"
        ]
    margin = max(views["guard"], comparison["border"])
    zooms = zooms_in_common_field(specs, reference_shape, margin)
    ends = (comparison["first_scale"], last_scale(settings, name))
    low, high = common_scales(specs, sigma_min, views["n_oct"], *ends, zooms)
    if low >= high:
        return [
            f"sets.{name} leaves no common range of scales: the last view begins at {low:.3g} px "
            f"of the first, which ends at {high:.3g} px; give a smaller zoom or more octaves"
        ]
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


def _free_bytes(folder: Path) -> int:
    """Free space of the disk that a folder lies on or will lie on."""
    folder = folder.absolute()
    while not folder.exists():
        folder = folder.parent
    return shutil.disk_usage(folder).free
