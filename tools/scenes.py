"""Ask the claims of all scenes of the corpus, one after the other.

python tools/scenes.py [names of scenes] [-- arguments of tools/study.py]

A scene whose verdicts are there and up to date costs some seconds. The views of a scene are deleted
once its verdicts are there. At the end verdicts are put together over all scenes that have them.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from keystab.camera.view_sets import view_shapes
from keystab.errors import InputError
from keystab.io.pictures import picture_shape
from keystab.study import settings
from keystab.study.corpus import CorpusScene, places, read_corpus
from keystab.study.plain_yaml import read_plain_yaml
from keystab.study.scenes import by_place

sys.path.insert(0, str(Path(__file__).parent))
from study import in_words, read_durations  # noqa: E402

ROOT = Path(__file__).parents[1]
RUN = [sys.executable, str(ROOT / "tools/study.py")]


def chosen(corpus: dict[str, CorpusScene], names: Sequence[str]) -> list[str]:
    """Names of the scenes that are asked for, all where none is.

    Examples
    --------
    >>> chosen({"lake": ..., "text_1": ...}, [])
    ['lake', 'text_1']
    >>> chosen({"lake": ...}, ["sea"])
    Traceback (most recent call last):
    keystab.errors.InputError: no scene 'sea' in config/scenes.csv; there are lake
    """
    for name in names:
        if name not in corpus:
            raise InputError(
                f"no scene {name!r} in config/scenes.csv; there are {', '.join(corpus)}"
            )
    return list(names or corpus)


def share_of_study(config: Mapping[str, Any], scene: Mapping[str, Any]) -> float:
    """Time that a scene takes, in units of that of the default scene: it goes with its pixels."""
    pixels = []
    for each in (config, scene):
        shape = each.get("reference_shape") or picture_shape(ROOT / each["reference"])
        pixels.append(sum(h * w for h, w in view_shapes(each["sets"]["still"], shape)))
    return pixels[1] / pixels[0]


def main(arguments: Sequence[str]) -> int:
    """Run the scenes."""
    names = list(arguments[: arguments.index("--")] if "--" in arguments else arguments)
    further = list(arguments[arguments.index("--") + 1 :] if "--" in arguments else ())
    files = [word for word in further if word.endswith((".yaml", ".yml"))]
    try:
        schema = read_plain_yaml(ROOT / "workflow/schemas/config.schema.yaml")
        config = settings.checked(settings.read_yaml(ROOT / "config/config.yaml", *files), schema)
        corpus = read_corpus(ROOT / "config/scenes.csv")
        wanted = chosen(corpus, names)
        scenes = by_place(config, ROOT, corpus.values())
        place_of = places(corpus, scenes)
        seconds = sum(read_durations().values()) * sum(
            share_of_study(scenes[""], scenes[place_of[name]]) for name in wanted
        )
    except InputError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    print(
        f"{len(wanted)} scenes; about {in_words(seconds)} of one core in all where nothing is done "
        "yet; a run that is stopped is taken up by the same command",
        flush=True,
    )
    results = Path(config["results"])
    for number, name in enumerate(wanted, 1):
        print(f"scene {number} of {len(wanted)}: {name} ({corpus[name].family})", flush=True)
        target = results / place_of[name] / "claims.csv"
        status = subprocess.run([*RUN, *further, "--", str(target)]).returncode
        if status:
            return status
        if place_of[name]:
            shutil.rmtree(results / place_of[name] / "views", ignore_errors=True)
    together = [str(results / "scenes/claims.csv"), str(Path(config["figures"]) / "scenes.pdf")]
    return subprocess.run([*RUN, *further, "--", *together]).returncode


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
