"""Sets of views: from a few numbers to one `ViewSpec` per view.

A set is described by blur, step, shift_y, shift_x, rotation and noise, each one number for all
views or one number per view, and by the size of its views. A set may also name a number of views
and how far they spread: shifts, rotations and blurs are then drawn evenly (a Halton sequence, so
that view k is the same however many there are), and zooms are spaced geometrically. A set with a
`sweep` stands for several sets that differ in one value.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from keystab.camera.perspective import tilted
from keystab.camera.views import ViewSpec
from keystab.errors import InputError

PER_VIEW = ("blur", "step", "shift_y", "shift_x", "rotation", "noise", "tilt", "azimuth")
"""What is one number for all views or one number per view; tilt and azimuth may be left out."""

#: Value that spreads -> setting that says how far.
_SPREADS = {
    "shift_y": "shift_spread",
    "shift_x": "shift_spread",
    "rotation": "rotation_spread",
    "blur": "blur_spread",
}

#: Bases of the Halton sequences of what spreads, in this order: the smaller, the more even.
_BASES = (2, 3, 5, 7)


class Member(NamedTuple):
    """One of the sets that a sweep stands for."""

    name: str
    value: float


def expanded(sets: Mapping[str, Mapping[str, Any]]) -> dict[str, dict[str, Any]]:
    """Sets in which every sweep is replaced by its members.

    Parameters
    ----------
    sets : mapping from names to descriptions
        A description may have a ``sweep``, a mapping of one of its keys to a list of values.

    Returns
    -------
    dict
        The same without sweeps.

    Examples
    --------
    >>> sorted(expanded({"noisy": {"noise": 0.0, "sweep": {"noise": [0.01, 0.15]}}}))
    ['noisy_0p01', 'noisy_0p15']
    """
    result: dict[str, dict[str, Any]] = {}
    for name, description in sets.items():
        plain = {key: value for key, value in description.items() if key != "sweep"}
        if description.get("sweep"):
            ((key, _),) = description["sweep"].items()
            for member in members(sets, name):
                result[member.name] = {**plain, key: member.value}
        else:
            result[name] = plain
    return result


def members(sets: Mapping[str, Mapping[str, Any]], name: str) -> list[Member]:
    """Sets that a sweep stands for, with the value of each.

    Examples
    --------
    >>> members({"noisy": {"sweep": {"noise": [0.01, 0.15]}}}, "noisy")
    [Member(name='noisy_0p01', value=0.01), Member(name='noisy_0p15', value=0.15)]
    """
    ((_, values),) = sets[name]["sweep"].items()
    return [Member(f"{name}_{value:g}".replace(".", "p"), value) for value in values]


def per_view(views: Mapping[str, Any]) -> dict[str, list[float]]:
    """Values of every view.

    Parameters
    ----------
    views : mapping
        The description of a set. Lists of length 1 count as single numbers. ``n_views``,
        ``shift_spread``, ``rotation_spread``, ``blur_spread``, ``zoom``, ``tilt`` and ``azimuth``
        may be left out.

    Returns
    -------
    dict from each name in `PER_VIEW` to a list with one number per view

    Raises
    ------
    InputError
        If there are lists of different lengths, or the spread of the blur exceeds the blur.

    Examples
    --------
    >>> rest = {"shift_y": 0.0, "shift_x": 0.0, "rotation": 0.0, "noise": 0.0}
    >>> per_view({"blur": [0.5, 1.0], "step": 10.0, **rest})["step"]
    [10.0, 10.0]
    >>> per_view({"blur": 1.1, "step": 10.0, **rest, "n_views": 3, "zoom": 4.0})["step"]
    [10.0, 20.0, 40.0]
    >>> per_view({"blur": 1.1, "step": 10.0, **rest, "n_views": 3, "shift_spread": 0.5})["shift_y"]
    [0.0, -0.25, 0.25]
    """
    views = {"tilt": 0.0, "azimuth": 0.0, **views}
    lists = {key: _as_list(views[key]) for key in PER_VIEW}
    lengths = {key: len(values) for key, values in lists.items() if len(values) != 1}
    if views.get("n_views", 1) > 1:
        lengths["n_views"] = views["n_views"]
    if len(set(lengths.values())) > 1:
        counts = ", ".join(f"{key} {length}" for key, length in lengths.items())
        raise InputError(f"lists of different lengths ({counts}); give one number per view")
    n_views = max(lengths.values(), default=1)
    values = {key: each if len(each) == n_views else each * n_views for key, each in lists.items()}
    if views.get("blur_spread", 0) > min(values["blur"]):
        raise InputError(
            f"blur_spread {views['blur_spread']:g}, allowed is at most blur = "
            f"{min(values['blur']):g}: blurs below 0 do not exist"
        )
    spread_out = [key for key, spread in _SPREADS.items() if views.get(spread, 0)]
    for key, base in zip(spread_out, _BASES, strict=False):
        spread = views[_SPREADS[key]]
        draws = (2 * _radical_inverse(k + 1, base) - 1 for k in range(n_views))
        values[key] = [
            value + spread * draw for value, draw in zip(values[key], draws, strict=True)
        ]
    zoom = views.get("zoom", 1)
    if zoom != 1 and n_views > 1:
        powers = (zoom ** (k / (n_views - 1)) for k in range(n_views))
        values["step"] = [step * power for step, power in zip(values["step"], powers, strict=True)]
    return values


def assumed_blur(views: Mapping[str, Any]) -> float | None:
    """Camera blur that the detector assumes for all views of a set; None for that of each view.

    Examples
    --------
    >>> assumed_blur({"blur": 0.7, "blur_spread": 0.2, "assumed_blur": None})
    0.7
    """
    if views["assumed_blur"] is not None:
        return float(views["assumed_blur"])
    return float(views["blur"]) if views["blur_spread"] else None


def _as_list(value: float | Sequence[float]) -> list[float]:
    return list(value) if isinstance(value, Sequence) else [value]


def _radical_inverse(k: int, base: int) -> float:
    """Mirror the digits of k about the point: member k of a Halton sequence, between 0 and 1."""
    result, digit = 0.0, 1.0 / base
    while k:
        k, remainder = divmod(k, base)
        result += remainder * digit
        digit /= base
    return result


def view_shapes(
    views: Mapping[str, Any], reference_shape: tuple[int, int]
) -> list[tuple[int, int]]:
    """Height and width of every view of a set, in pixels.

    A side that is not given is ``int(size / step)`` of the reference and a guard band on either
    side. The step is the largest of the set, so that all views have one size; with ``whole`` it is
    that of the view itself, so that all show the whole reference.

    Examples
    --------
    >>> still = {"blur": 1.1, "step": 10, "shift_y": 0, "shift_x": 0, "rotation": 0, "noise": 0,
    ...          "height": None, "width": None}
    >>> view_shapes(still, (2250, 4000))
    [(225, 400)]
    >>> view_shapes({**still, "step": [10, 20], "whole": True, "guard": 5}, (2250, 4000))
    [(235, 410), (122, 210)]
    """
    steps = per_view(views)["step"]
    if not views.get("whole", False):
        steps = [max(steps)] * len(steps)
    band = 2 * views.get("guard", 0)
    shapes = []
    for step in steps:
        height, width = (
            int(size / step) + band if given is None else given
            for given, size in zip((views["height"], views["width"]), reference_shape, strict=True)
        )
        shapes.append((height, width))
    return shapes


def view_specs(
    name: str, views: Mapping[str, Any], reference_shape: tuple[int, int]
) -> list[ViewSpec]:
    """All views of a set.

    Parameters
    ----------
    name : str
        Name of the set; with the number of the view it seeds the noise, so that noise depends on
        neither the order nor the number of the views.
    views : mapping
        The description of the set. Views with a ``tilt`` above 0 see the scene from the side, at
        ``focal_length``.
    reference_shape : tuple of int
        Height and width of the reference in pixels.

    Returns
    -------
    list of ViewSpec

    Raises
    ------
    InputError
        If the description is contradictory or a value is out of range.

    Examples
    --------
    >>> still = {"blur": 1.1, "step": 10, "shift_y": 0, "shift_x": 0, "rotation": 0, "noise": 0,
    ...          "height": None, "width": None}
    >>> [spec.shape for spec in view_specs("still", still, (2250, 4000))]
    [(225, 400)]
    """
    values = per_view(views)
    shapes = view_shapes(views, reference_shape)
    focal_length = views.get("focal_length", 0.0)
    specs = []
    for number, shape in enumerate(shapes):
        own = {key: values[key][number] for key in PER_VIEW}
        aside = own["tilt"] > 0
        seen = tilted(own["tilt"], own["azimuth"], focal_length) if aside else None
        shift, seed = (own["shift_y"], own["shift_x"]), (name, number)
        specs.append(
            ViewSpec(
                own["blur"], own["step"], shape, shift, own["rotation"], own["noise"], seed, seen
            )
        )
    return specs
