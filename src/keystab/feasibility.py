"""Whether the study can be run with given settings, a picture and a disk.

Every check is a plain function that returns one line per problem, so that a person sees all of
them before anything is computed.
"""

from __future__ import annotations

import math
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from keystab.errors import InputError
from keystab.memory import in_words
from keystab.pictures import picture_shape
from keystab.sampling import Sampling, balanced_delta
from keystab.settings import refuse
from keystab.view_sets import per_view, view_shape
from keystab.views import effective_blur

Settings = Mapping[str, Any]

NEEDED_SETS = ("still", "examples")
"""Sets of views that the figures are made from."""


def require(settings: Settings, folder: Path | str = ".") -> None:
    """Raise unless the study can be run.

    Parameters
    ----------
    settings : dict
        Complete settings, see `keystab.settings.checked`.
    folder : path
        Folder that relative paths in the settings start from.

    Raises
    ------
    InputError
        With one line per problem.
    """
    refuse(setting_problems(settings) or picture_problems(settings, Path(folder)))


def setting_problems(settings: Settings) -> list[str]:
    """One line for every pair of settings that contradict each other."""
    problems = [
        f"sets.{name} is missing; the figures are made from it"
        for name in NEEDED_SETS
        if name not in settings["sets"]
    ]
    for name, views in settings["sets"].items():
        try:
            per_view(views)
        except InputError as error:
            problems.append(f"sets.{name} has {error}")
    if problems:
        return problems
    if len(per_view(settings["sets"]["still"])["blur"]) != 1:
        problems.append("sets.still has several views; figures 3 to 6 study a single one")
    else:
        problems += _scale_below_blur(settings)
    problems += _order(settings["comparison"], "comparison", "unstable_below", "stable_above")
    if settings["comparison"]["last_scale"] is not None:
        problems += _order(settings["comparison"], "comparison", "first_scale", "last_scale")
    problems += _order(settings["semigroup"], "semigroup", "sigma_from", "sigma_to")
    available = settings["samplings"]["n_spo"]
    unknown = [n_spo for n_spo in kept_n_spo(settings) if n_spo not in available]
    if unknown:
        problems.append(
            f"keep_scale_spaces has {', '.join(map(str, unknown))}, allowed are members of "
            f"samplings.n_spo = {available}"
        )
    folders = [Path(settings[key]) for key in ("results", "figures", "logs")]
    if len(set(folders)) < len(folders):
        problems.append("results, figures and logs name the same folder; give three")
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
    problems = [
        line
        for name, views in settings["sets"].items()
        for line in fit_problems(name, views, shape, settings["comparison"]["border"])
    ]
    if problems:
        return problems
    try:
        planned = samplings(settings, view_shape(settings["sets"]["still"], shape))
    except InputError as error:
        return [str(error)]
    results = folder / settings["results"]
    kept = sum(
        8 * sampling.n_samples
        for sampling in planned["samplings"]
        if sampling.n_spo in kept_n_spo(settings)
        and not (results / "scale_space" / f"n{sampling.n_spo}.sha256").exists()
    )
    free = _free_bytes(results)
    if kept > free:
        return [
            f"keep_scale_spaces asks for {in_words(kept)} of stores, {in_words(free)} are free at "
            f"{settings['results']}: keep fewer, or none with keep_scale_spaces: false"
        ]
    return []


def fit_problems(
    name: str, views: Settings, reference_shape: tuple[int, int], border: float
) -> list[str]:
    """One line where the views of a set reach beyond the reference or are all border.

    Examples
    --------
    >>> still = {"blur": 1.1, "step": 10, "shift_y": 0, "shift_x": 0, "rotation": 0, "noise": 0,
    ...          "height": 300, "width": None}
    >>> fit_problems("still", still, (2250, 4000), border=3)
    ['sets.still.height is 300, allowed is at most 225: the reference has 2250 px, the step is 10']
    """
    step = max(per_view(views)["step"])
    least = math.ceil(2 * border) + 3
    shape = view_shape(views, reference_shape)
    problems = []
    for side, size, pixels in zip(("height", "width"), reference_shape, shape, strict=True):
        if pixels * step > size:
            problems.append(
                f"sets.{name}.{side} is {pixels}, allowed is at most {int(size / step)}: the "
                f"reference has {size} px, the step is {step:g}"
            )
        elif pixels < least:
            problems.append(
                f"sets.{name} asks for views of {shape[0]} x {shape[1]} px, allowed is a {side} of "
                f"at least {least} px: give a larger reference or a step below {step:g}"
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
