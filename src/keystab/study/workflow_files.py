"""Files of the workflow, wherever it is run: in its own folder, in another, or as a module.

Another workflow can use this one from a folder of its own (``module``), and Snakemake can work in
any folder (``-d``). Schema, claims and pictures of the study then lie elsewhere, on this machine or
on another one. What a person's settings name is looked for in the folder that is worked in.
"""

from __future__ import annotations

import contextlib
import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from keystab.study.corpus import CorpusScene

__all__ = ["WorkflowFiles"]


class WorkflowFiles:
    """Where the files of the workflow are.

    Parameters
    ----------
    rules : object
        Folder of the rules as Snakemake knows it, ``workflow.current_basedir`` in one of them.
    fetch : callable
        Makes a file of another machine one of this machine, ``workflow.sourcecache.get_path``.
    """

    def __init__(self, rules: Any, fetch: Callable[[Any], str]) -> None:
        self.rules = rules
        self.fetch = fetch

    def beside(self, name: str) -> str | None:
        """Path of a file or folder by its place in the project; None where that is elsewhere.

        In the folder that is worked in, it is relative, so that records hold on other machines.
        """
        file = self.rules.join(f"../../{name}")
        if not isinstance(file, os.PathLike):  # on another machine
            return None
        path, here = Path(os.path.normpath(os.fspath(file))), Path.cwd()
        return str(path.relative_to(here) if path.is_relative_to(here) else path)

    def own(self, name: str) -> str:
        """Path of a file of the workflow, fetched from another machine where it is there."""
        return self.beside(name) or self.fetch(self.rules.join(f"../../{name}"))

    def found(self, path: str) -> str:
        """Path of a picture: as it is given, or else in the workflow's folder.

        Where neither is there, it stays as it was given, so that errors say what was typed.
        """
        if os.path.exists(path):
            return path
        with contextlib.suppress(Exception):  # of fetching: each kind of host has its own
            own = self.own(path)
            return own if os.path.exists(own) else path
        return path

    def with_pictures(self, settings: Mapping[str, Any]) -> dict[str, Any]:
        """Complete settings, with paths that lead to their pictures."""
        found = {**settings, "reference": self.found(settings["reference"])}
        for block in ("predictors", "floor"):
            pictures = {
                name: {**picture, "path": self.found(picture["path"])}
                for name, picture in settings[block]["pictures"].items()
            }
            found[block] = {**settings[block], "pictures": pictures}
        return found

    def with_photographs(self, corpus: Mapping[str, CorpusScene]) -> dict[str, CorpusScene]:
        """The corpus, with paths that lead to its photographs; none is fetched for that."""
        local = self.beside("") is not None
        return {
            name: scene._replace(path=self.found(scene.path)) if local and scene.path else scene
            for name, scene in corpus.items()
        }
