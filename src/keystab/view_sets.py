"""Sets of views: from a few numbers to one `ViewSpec` per view.

A set is described by blur, step, shift_y, shift_x, rotation and noise, each one number for all
views or one number per view, and by the height and the width of its views.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from keystab.errors import InputError
from keystab.views import ViewSpec

PER_VIEW = ("blur", "step", "shift_y", "shift_x", "rotation", "noise")
"""What is one number for all views or one number per view."""


def per_view(views: Mapping[str, Any]) -> dict[str, list[float]]:
    """Values of every view.

    Parameters
    ----------
    views : mapping
        The description of a set. Lists of length 1 count as single numbers.

    Returns
    -------
    dict from each name in `PER_VIEW` to a list with one number per view

    Raises
    ------
    InputError
        If there are lists of different lengths.

    Examples
    --------
    >>> rest = {"shift_y": 0.0, "shift_x": 0.0, "rotation": 0.0, "noise": 0.0}
    >>> per_view({"blur": [0.5, 1.0], "step": 10.0, **rest})["step"]
    [10.0, 10.0]
    """
    lists = {key: _as_list(views[key]) for key in PER_VIEW}
    lengths = {key: len(values) for key, values in lists.items() if len(values) != 1}
    if len(set(lengths.values())) > 1:
        counts = ", ".join(f"{key} {length}" for key, length in lengths.items())
        raise InputError(f"lists of different lengths ({counts}); give one number per view")
    n_views = max(lengths.values(), default=1)
    return {
        key: values if len(values) == n_views else values * n_views for key, values in lists.items()
    }


def _as_list(value: float | Sequence[float]) -> list[float]:
    return list(value) if isinstance(value, Sequence) else [value]


def view_shape(views: Mapping[str, Any], reference_shape: tuple[int, int]) -> tuple[int, int]:
    """Height and width of the views of a set, in pixels.

    A side that is not given is ``int(size / step)`` of the reference, at the largest step.

    Examples
    --------
    >>> still = {"blur": 1.1, "step": 10, "shift_y": 0, "shift_x": 0, "rotation": 0, "noise": 0,
    ...          "height": None, "width": None}
    >>> view_shape(still, (2250, 4000))
    (225, 400)
    """
    step = max(per_view(views)["step"])
    height, width = (
        int(size / step) if given is None else given
        for given, size in zip((views["height"], views["width"]), reference_shape, strict=True)
    )
    return height, width


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
        The description of the set.
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
    shape = view_shape(views, reference_shape)
    return [
        ViewSpec(blur, step, shape, (shift_y, shift_x), rotation, noise, (name, number))
        for number, (blur, step, shift_y, shift_x, rotation, noise) in enumerate(
            zip(*(values[key] for key in PER_VIEW), strict=True)
        )
    ]
