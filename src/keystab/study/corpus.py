"""The corpus: scenes that claims are asked of beside those of the study, as a table.

Each row of ``config/scenes.csv`` is a photograph, whose file it names, or a scene that
`keystab.make_scene` makes, with the digest of its pixels. A scene that is added changes no other.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from keystab.camera.made_scenes import KINDS, SHAPE
from keystab.errors import InputError

__all__ = ["COLUMNS", "PHOTOGRAPH", "CorpusScene", "judged", "places", "read_corpus", "with_corpus"]

PHOTOGRAPH = "photograph"
COLUMNS = ("name", "family", "kind", "seed", "exponent", "angle", "path", "sha256", "credit")
_NAME = re.compile(r"[a-z][a-z0-9_]{0,40}")
_DIGEST = re.compile(r"[0-9a-f]{64}")


class CorpusScene(NamedTuple):
    """One scene.

    Attributes
    ----------
    name : str
        Lower case, as in paths.
    family : str
        What verdicts are pooled over.
    kind : str
        ``photograph``, or a kind of `keystab.make_scene`.
    seed : int
    exponent, angle : float
        Of `keystab.make_scene`.
    path : str
        File of a photograph; empty for what is made.
    sha256 : str
        Digest of the pixels, `keystab.io.pictures.pixel_digest`.
    credit : str
        Author and licence of a photograph.
    """

    name: str
    family: str
    kind: str
    seed: int
    exponent: float
    angle: float
    path: str
    sha256: str
    credit: str

    def file_in(self, results: str) -> str:
        """Where its picture lies, or is made."""
        return self.path or f"{results}/scenes/{self.name}/scene.png"


def read_corpus(path: Path | str) -> dict[str, CorpusScene]:
    """Read the table of scenes.

    Parameters
    ----------
    path : path
        CSV file with `COLUMNS`.

    Returns
    -------
    dict of str to CorpusScene
        By name, in the order of the table.

    Raises
    ------
    InputError
        If it cannot be read, or a row is not right: the row and what is allowed are named.
    """
    scenes: dict[str, CorpusScene] = {}
    for number, texts in enumerate(_rows(path), 1):
        where = f"{path}: row {number} ({texts['name'] or 'no name'})"
        if not _NAME.fullmatch(texts["name"]) or texts["name"] in scenes:
            raise InputError(f"{where}: give each scene a name of its own, of a-z, 0-9 and _")
        if not _NAME.fullmatch(texts["family"].replace("-", "_")):
            raise InputError(
                f"{where}: family {texts['family']!r}: give a word of a-z, 0-9, - and _"
            )
        if texts["kind"] not in (PHOTOGRAPH, *KINDS):
            raise InputError(
                f"{where}: kind {texts['kind']!r}: allowed is one of "
                f"{', '.join((PHOTOGRAPH, *KINDS))}"
            )
        if (texts["kind"] == PHOTOGRAPH) is not bool(texts["path"]):
            raise InputError(f"{where}: a photograph has a path, and nothing else has one")
        if not _DIGEST.fullmatch(texts["sha256"]):
            raise InputError(f"{where}: sha256 {texts['sha256']!r}: give 64 hexadecimal digits")
        scenes[texts["name"]] = CorpusScene(
            texts["name"], texts["family"], texts["kind"], *_numbers(texts, where), texts["path"],
            texts["sha256"], texts["credit"],
        )  # fmt: skip
    return scenes


def _rows(path: Path | str) -> list[dict[str, str]]:
    """Rows of the table, without pandas: every plan of the study reads it."""
    try:
        with Path(path).open(encoding="utf-8", newline="") as file:
            rows = list(csv.DictReader(file, restval="", strict=True))
    except OSError as error:
        raise InputError(f"{path}: {error.strerror}; give a table of scenes") from None
    except (UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"{path}: not a readable .csv table: {error}") from None
    missing = [name for name in COLUMNS if not rows or name not in rows[0]]
    if missing:
        raise InputError(f"{path}: lacks the column {missing[0]}, or has no row")
    return rows


def _numbers(texts: Mapping[str, str], where: str) -> tuple[int, float, float]:
    try:
        seed, exponent, angle = (
            float(texts[name] or 0.0) for name in ("seed", "exponent", "angle")
        )
        whole = int(seed)
    except (ValueError, OverflowError):
        raise InputError(f"{where}: seed, exponent and angle are numbers or empty") from None
    if seed != whole or seed < 0:
        raise InputError(f"{where}: seed {seed:g}: give a whole number of at least 0")
    return whole, exponent, angle


def with_corpus(
    pictures: Mapping[str, Any], scenes: Iterable[CorpusScene], results: str, step: float
) -> dict[str, Any]:
    """Pictures of a study by name, and after them those scenes of the corpus that it has not.

    Examples
    --------
    >>> lake = CorpusScene("lake", "photograph", "photograph", 0, 0.0, 0.0, "lake.png", "", "")
    >>> text = CorpusScene("text_1", "text", "text", 1, 0.0, 0.0, "", "", "")
    >>> more = with_corpus({"own": {"path": "./lake.png"}}, [lake, text], "results", 10)
    >>> list(more), more["text_1"]["path"]
    (['own', 'text_1'], 'results/scenes/text_1/scene.png')
    """
    known = {Path(picture["path"]) for picture in pictures.values()}
    more = {
        scene.name: {
            "path": scene.file_in(results),
            "sha256": scene.sha256,
            "step": step,
            "shape": None if scene.path else SHAPE,
        }
        for scene in scenes
        if scene.name not in pictures and not (scene.path and Path(scene.path) in known)
    }
    return {**pictures, **more}


def places(
    corpus: Mapping[str, CorpusScene], scenes: Mapping[str, Mapping[str, Any]]
) -> dict[str, str]:
    """Place of the results of every scene of the corpus, by its name.

    Parameters
    ----------
    corpus : mapping
        From `read_corpus`.
    scenes : mapping
        From `keystab.study.scenes.by_place`: settings by place.

    Returns
    -------
    dict
        The place of the default scene for what is its picture.
    """
    own = Path(scenes[""]["reference"])
    found = {}
    for name, scene in corpus.items():
        is_own = bool(scene.path) and Path(scene.path) == own
        found[name] = "" if is_own else f"scenes/{name}/"
    return found


def judged(
    corpus: Mapping[str, CorpusScene], scenes: Mapping[str, Mapping[str, Any]], results: str
) -> dict[str, str]:
    """Those of `places` whose verdicts are there."""
    return {
        name: place
        for name, place in places(corpus, scenes).items()
        if Path(results, place, "claims.csv").is_file()
    }
