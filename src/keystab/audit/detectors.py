"""The detectors that can be audited: what is run, with which settings, and what it says of itself.

To add one, write a function in `keystab.audit.worker` that calls its library, name it in
``LIBRARIES`` there, and add a line for each of its settings to `DETECTORS` here.
"""

from __future__ import annotations

import shlex
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from keystab.errors import InputError
from keystab.io.keypoint_conventions import COLMAP, KEYSTAB, OPENCV, Convention

__all__ = ["DETECTORS", "FINE", "Detector", "chosen", "own_detector"]


@dataclass(frozen=True)
class Detector:
    """A detector with one of its settings.

    Parameters
    ----------
    name, setting : str
        What it is called in tables.
    kind : {"library", "function", "command"}
        How it is run.
    runs : str
        Name of the library in `keystab.audit.worker`, ``module:function``, or command.
    convention : Convention
        What it says of its positions and scales.
    options : mapping
        Arguments of the library.
    kappa : float, optional
        Ratio of the blurs of its difference of Gaussians; None where it detects something else.
    assumed_blur : float, optional
        Camera blur that it assumes, pixels; None where it is told.
    """

    name: str
    setting: str
    kind: str
    runs: str
    convention: Convention = KEYSTAB
    options: Mapping[str, Any] = field(default_factory=dict)
    kappa: float | None = 2 ** (1 / 3)
    assumed_blur: float | None = 0.5

    @property
    def job(self) -> dict[str, Any]:
        """What its process has to know."""
        options = dict(self.options)
        order = self.convention.order
        return {"kind": self.kind, "name": self.runs, "options": options, "order": order}

    def own_blur(self, camera_blur: float) -> float:
        """Blur that it takes an image of this camera blur to have."""
        return camera_blur if self.assumed_blur is None else self.assumed_blur


def _library(name: str, setting: str, runs: str = "", **more: Any) -> Detector:
    return Detector(name, setting, "library", runs or name, **more)


def _opencv(setting: str, filtered: bool, **options: Any) -> Detector:
    filters = {} if filtered else {"contrastThreshold": 0.0, "edgeThreshold": 1e9}
    label = f"{setting}, {'as shipped' if filtered else 'no filters'}"
    return _library("opencv", label, convention=OPENCV, options=filters | options)


def _skimage(upsampling: int, filtered: bool) -> Detector:
    filters = {} if filtered else {"c_dog": 1e-5, "c_edge": 1e9}
    label = f"upsampling {upsampling}, {'as shipped' if filtered else 'no filters'}"
    return _library("skimage", label, options={"upsampling": upsampling, **filters})


def _kaze(kind: str) -> list[Detector]:
    more: dict[str, Any] = {"convention": OPENCV, "kappa": None, "assumed_blur": None}
    return [
        _library(kind.lower(), label, "opencv", options={"kind": kind, **filters}, **more)
        for label, filters in (("no filters", {"threshold": 1e-5}), ("as shipped", {}))
    ]


FINE = _library("keystab", "fine", options={"n_spo": 9}, assumed_blur=None)
"""This project's detector at a fine sampling, three times SIFT's: a control in every audit."""

DETECTORS: tuple[Detector, ...] = (
    FINE,
    _library("keystab", "coarse", options={"n_spo": 3}, assumed_blur=None),
    _library("keystab", "bars", options={"n_spo": 9, "bars": True}, assumed_blur=None),
    _opencv("default", filtered=False),
    _opencv("precise", filtered=False, enable_precise_upscale=True),
    _opencv("default", filtered=True),
    _opencv("precise", filtered=True, enable_precise_upscale=True),
    _skimage(2, filtered=False),
    _skimage(1, filtered=False),
    _skimage(2, filtered=True),
    _skimage(1, filtered=True),
    _library(
        "vlfeat", "no filters",
        options={"first_octave": -1, "peak_thresh": 0.0, "edge_thresh": 1e9},
    ),
    _library("vlfeat", "as shipped", options={"first_octave": 0}),
    _library(
        "colmap", "no filters", convention=COLMAP,
        options={"peak_threshold": 1e-5, "edge_threshold": 1e9, "max_num_features": 2**20},
    ),
    _library("colmap", "as shipped", convention=COLMAP),
    *_kaze("KAZE"),
    *_kaze("AKAZE"),
    _library(
        "kornia", "no filters", convention=Convention(0.0, "xy", 6.0),
        options={"num_features": 8192}, kappa=None,
    ),
)  # fmt: skip
"""All settings of all detectors of libraries: filters off, and as shipped."""


def chosen(
    names: Iterable[str], convention: Convention = KEYSTAB, default: bool = True
) -> list[Detector]:
    """Detectors that a person asks for, and the control.

    Parameters
    ----------
    names : iterable of str
        Names of libraries, ``module:function``, or commands with ``{picture}`` and ``{table}``.
    convention : Convention
        What a person's own detectors say of their positions and scales.
    default : bool
        Whether the control is added.

    Returns
    -------
    list of Detector
        All settings of each, in the order asked for, each once; the control last.

    Raises
    ------
    InputError
        If a name is none of these.

    Examples
    --------
    >>> [detector.setting for detector in chosen(["vlfeat"])]
    ['no filters', 'as shipped', 'fine']
    """
    found: list[Detector] = []
    for name in names:
        own = [each for each in DETECTORS if each.name == name]
        found += own or [own_detector(name, convention)]
    found += [FINE] * default
    return list({(each.name, each.setting): each for each in found}.values())


def own_detector(text: str, convention: Convention = KEYSTAB) -> Detector:
    """Detector of a person's own.

    Parameters
    ----------
    text : str
        ``module:function``, a function of ``(image, camera_blur)``, or a command.
    convention : Convention
        What it says of its positions and scales.

    Raises
    ------
    InputError
        If it is neither, or names no place for picture and table.

    Examples
    --------
    >>> own_detector("mine.sift:detect").kind, own_detector("./mine {picture} {table}").name
    ('function', './mine')
    """
    module, colon, function = text.partition(":")
    parts = [*module.split("."), *function.split(".")]
    if colon and all(part.isidentifier() for part in parts):
        named = Detector(text, "as given", "function", text, convention)
        return replace(named, kappa=None, assumed_blur=None)
    if "{picture}" in text and "{table}" in text:
        try:
            words = shlex.split(text)
        except ValueError as error:
            raise InputError(f"the command {text!r} cannot be read: {error}") from None
        name = " ".join(word for word in words if "{" not in word) or "command"
        named = Detector(name, "as given", "command", text, convention)
        return replace(named, kappa=None, assumed_blur=None)
    if " " in text or "/" in text or "{" in text:
        missing = [place for place in ("{picture}", "{table}") if place not in text]
        raise InputError(
            f"the command {text!r} has no {' and no '.join(missing)}; write these where it takes "
            "the picture that it reads and the CSV that it writes, and the whole in quotes"
        )
    known = ", ".join(dict.fromkeys(each.name for each in DETECTORS))
    raise InputError(
        f"{text!r} is no detector; give {known}, module:function, or a command in quotes with "
        "{picture} and {table} where it takes a picture and writes a table"
    )
