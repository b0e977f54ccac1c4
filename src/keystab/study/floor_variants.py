"""Variants of the arithmetic, the camera and the scene (figure floor), from the settings.

All functions are pure. They take the settings of one scene as `keystab.study.scenes` leaves them.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

Settings = Mapping[str, Any]

SETTLED = ("float32_sums", "float32_transforms")
"""Number types that take long, and are computed from ``floor.settles_at`` on."""


class Variant(NamedTuple):
    """A variant of the arithmetic, the camera or the scene (figure floor)."""

    variant: str
    set: str
    """Set of views whose first one is searched."""
    run: str
    """Variant whose extrema serve this one too."""
    tolerance: float
    """Least difference of its extrema, of grey values in [0, 1]; -1 where it was applied."""
    place: str
    """Place of the scene that it is computed on, see `keystab.study.scenes`."""
    scene: str
    """Name of that scene: a further picture's, or ``reference``."""
    first: int
    """First of its samplings."""
    crossing: str
    """Readings that it is crossed with: ``all``, ``some``, those that ``rates`` need, ``none``."""
    words: str
    """What it differs in."""


def variants(settings: Settings) -> list[Variant]:
    """All variants, those of further pictures last.

    Variants whose extrema are the same but for the tolerance, which comes later, share the run of
    the first of them. Single precision rounds in units of its own grey range: its variants stand
    alone, and their tolerance is applied at once.
    """
    own = list(_of_scene(settings))
    further = [
        each._replace(
            variant=f"{name}_{each.variant}",
            place=f"scenes/{name}/",
            scene=name,
            words=f"{name}, {each.words}" if each.crossing == "rates" else name,
        )
        for name in settings["floor"]["pictures"]
        for each in own
        if each.crossing in ("all", "rates")
    ]
    return own + further


def _of_scene(settings: Settings) -> Iterator[Variant]:
    """Variants of the scene itself."""
    about = settings["floor"]
    samplings = settings["samplings"]["n_spo"]
    settled = min(n for n in samplings if n >= about["settles_at"])
    place = settings.get("place", "")
    runs: dict[tuple[Any, ...], str] = {}
    for (name, own), words in zip(about["variants"].items(), _words(settings), strict=True):
        if own["arithmetic"] in SETTLED:
            how = (name, -1.0, place, "reference", settled, "rates", words)
        elif own["arithmetic"] == "float32":
            how = (name, -1.0, place, "reference", samplings[0], "none", words)
        else:
            same = tuple(own[key] for key in ("set", "oversampling", "bits"))
            crossing = "none" if same in runs else "some" if runs else "all"
            run = runs.setdefault(same, name)
            tolerance = own["epsilon"] / own["grey_range"]
            how = (run, tolerance, place, "reference", samplings[0], crossing, words)
        yield Variant(name, own["set"], *how)


def variant(settings: Settings, name: str) -> list[Variant]:
    """One variant of the scene itself, as the only one of a list."""
    return [each for each in _of_scene(settings) if each.variant == name]


def samplings(settings: Settings, name: str) -> list[int]:
    """Scales per octave at which the extrema of a variant are computed."""
    (own,) = variant(settings, name)
    return [n for n in settings["samplings"]["n_spo"] if n >= own.first]


def _words(settings: Settings) -> list[str]:
    """Say in what each variant differs from the usual one, which has no tolerance."""
    sets, all_variants = settings["sets"], settings["floor"]["variants"]
    usual = all_variants.get("usual") or next(iter(all_variants.values()))
    before = sets[usual["set"]]
    found = []
    for own in all_variants.values():
        views, bits = sets[own["set"]], own["bits"]
        tolerance = re.sub("e-0*", "e-", f"{own['epsilon']:g}")
        parts = {
            f"S = {views['step'][0]:g}": views["step"][0] != before["step"][0],
            f"c = {views['blur'][0]:g}": views["blur"][0] != before["blur"][0],
            f"view in {views['dtype'].removeprefix('float')} bits": views["dtype"]
            != before["dtype"],
            f"view in {bits} bits": bits is not None,
            f"{own['oversampling']} series, not {usual['oversampling']}": own["oversampling"]
            != usual["oversampling"],
            _NUMBER_TYPES[own["arithmetic"]]: own["arithmetic"] != "float64",
            "prime sides": own["sides"] == "large",
            f"tolerance {tolerance}": own["epsilon"] > 0,
            f"range {own['grey_range']:g}": own["grey_range"] != 1,
        }
        words = [part for part, differs in parts.items() if differs]
        found.append(", ".join(words) or "no tolerance")
    return found


_NUMBER_TYPES = {
    "float64": "",
    "float32": "Gaussians rounded to 32 bits",
    "float32_sums": "sums in 32 bits",
    "float32_transforms": "transforms in 32 bits",
}


def of_single_precision(settings: Settings, name: str, key: str) -> Any:
    """Setting of a variant that single precision alone uses; else one without effect."""
    own = settings["floor"]["variants"][name]
    usual = {"epsilon": 0.0, "grey_range": 1.0, "sides": "small"}[key]
    needed = "float32_transforms" if key == "sides" else "float32"
    return own[key] if own["arithmetic"].startswith(needed) else usual
