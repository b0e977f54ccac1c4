"""The scenes of a study, each with settings of its own, and the place of its results.

The default scene is the picture ``reference``; its results lie in the folder ``results``. Further
ones are the pictures of figures predictors and floor, and the corpus (`keystab.study.corpus`);
theirs lie in ``scenes/NAME/`` in that folder. All are made by the same rules.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from keystab.camera.view_sets import assumed_blur, expanded, members, per_view
from keystab.study.corpus import CorpusScene, with_corpus
from keystab.study.plan import those_available

Settings = Mapping[str, Any]


def by_place(
    settings: Settings, folder: Path | str = ".", corpus: Iterable[CorpusScene] = ()
) -> dict[str, dict[str, Any]]:
    """Settings of every scene by the place of its results, which is ``""`` for the default scene.

    They say their place themselves, as ``place``.

    Parameters
    ----------
    settings : mapping
        Complete settings, see `keystab.study.settings.checked`.
    folder : path
        Folder that relative paths in the settings start from.
    corpus : iterable of CorpusScene
        Scenes that are studied where they are asked for.

    Examples
    --------
    >>> place_pattern({"": {}, "scenes/stream/": {}, "scenes/roof/": {}})
    '(scenes/(?:stream|roof)/)?'
    """
    others = dict.fromkeys([*further_pictures(settings, folder), *settings["floor"]["pictures"]])
    named = {**settings["floor"]["pictures"], **settings["predictors"]["pictures"]}
    pictures = {name: named[name] for name in others}
    known = {"own": {"path": settings["reference"]}, **pictures}
    step = settings["sets"]["still"]["step"]
    more = with_corpus(known, corpus, settings["results"], step)
    del more["own"]
    found = {"": resolved(settings)}
    found |= {f"scenes/{name}/": resolved(with_picture(settings, it)) for name, it in more.items()}
    return {place: {**own, "place": place} for place, own in found.items()}


def place_pattern(places: Iterable[str]) -> str:
    """Regular expression for the places of scenes; short, for every output's is compiled."""
    names = [place.split("/")[1] for place in places if place]
    return f"(scenes/(?:{'|'.join(names)})/)?" if names else "()"


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


_PLAIN_VIEW = {
    "shift_y": 0.0, "shift_x": 0.0, "rotation": 0.0, "noise": 0.0, "height": None, "width": None,
    "dtype": None, "n_views": 1, "shift_spread": 0.0, "rotation_spread": 0.0, "blur_spread": 0.0,
    "zoom": 1.0, "whole": False, "guard": 0, "tilt": 0.0, "azimuth": 0.0, "focal_length": 800.0,
}  # fmt: skip


def with_picture(settings: Settings, picture: Mapping[str, Any]) -> dict[str, Any]:
    """Settings of a further scene: the same study of another picture.

    Its view ``still`` has the blur of that of the reference and a step of its own, which all sets
    have that share the step of ``still``; no scale-space of it is kept.
    """
    still = settings["sets"]["still"]
    sets = {
        key: {**views, "step": picture["step"]} if views["step"] == still["step"] else views
        for key, views in settings["sets"].items()
    }
    sets["still"] = {**still, **_PLAIN_VIEW, "step": picture["step"]}
    return {
        **settings,
        "reference": picture["path"],
        "reference_sha256": picture["sha256"],
        "reference_blur": 0.0,
        "reference_shape": picture.get("shape"),
        "sets": sets,
        "keep_scale_spaces": False,
    }


def resolved(settings: Settings) -> dict[str, Any]:
    """Settings in which every set stands for itself, in full.

    A sweep is replaced by its sets, and ``sweeps`` says the value of each. A set has one number per
    view for what may differ between its views, and the first scale, number type and assumed blur
    that null stands for.
    """
    sets = expanded(settings["sets"])
    full = {}
    for name, views in sets.items():
        own = {key: views[key] for key in views if key not in _SPREADS}
        full[name] = {
            **own,
            **per_view(views),
            "assumed_blur": assumed_blur(views) if views["n_spo"] else None,
            "sigma_min": _first(views["sigma_min"], settings["detector"]["sigma_min"]),
            "dtype": _first(views["dtype"], settings["views_dtype"]),
        }
    sweeps = {name for name, views in settings["sets"].items() if views["sweep"]}
    values = {name: dict(members(settings["sets"], name)) for name in sweeps}
    return {**settings, "sets": full, "sweeps": values}


_SPREADS = ("n_views", "shift_spread", "rotation_spread", "blur_spread", "zoom")


def _first(own: Any, other: Any) -> Any:
    return other if own is None else own


# ---------------------------------------------------------------------------------------------
# What several scenes are asked together (figure predictors)


class Scene(NamedTuple):
    """A scene whose detections are scored (figure predictors)."""

    name: str
    place: str


class SceneSampling(NamedTuple):
    """One of its samplings."""

    place: str
    n_spo: int


def scored_scenes(settings: Settings, folder: Path | str = ".") -> list[Scene]:
    """The default scene by the name of its picture, and the further ones."""
    further = further_pictures(settings, folder)
    pictures = settings["predictors"]["pictures"]
    known = [name for name in pictures if name not in further]
    own = Path(settings["reference"]).stem
    name = known[0] if known else own if own not in pictures else "reference"
    return [Scene(name, ""), *(Scene(each, f"scenes/{each}/") for each in further)]


def scored_n_spo(settings: Settings) -> list[int]:
    """Samplings whose detections are scored; the first and the last where none is asked for."""
    return those_available(settings["predictors"]["n_spo"], settings["samplings"]["n_spo"])


def scored_samplings(settings: Settings) -> list[SceneSampling]:
    """Every scene at every sampling whose detections are scored."""
    return [
        SceneSampling(scene.place, n_spo)
        for scene in scored_scenes(settings)
        for n_spo in scored_n_spo(settings)
    ]
