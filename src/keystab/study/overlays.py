"""Files of settings that runs were started with, found by the folders that they write to.

Snakemake does not write down which files of settings were laid over those of the project. Every run
does it here when it starts, so that a command can be named that does the same again.
"""

from __future__ import annotations

import json
import shlex
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from keystab.errors import InputError
from keystab.study.result_folders import normal_folder
from keystab.study.settings import read_yaml
from keystab.utils.files import written_whole

__all__ = [
    "NOTE",
    "names_of",
    "note",
    "noted",
    "of_a_person",
    "on_command_line",
    "overlays_of",
    "seen_from",
]

NOTE = Path(".snakemake/overlays.json")
"""Where runs write down their files of settings, within the project's folder."""

_MOST_BYTES = 1_000_000


def seen_from(project: Path, files: Iterable[Path | str]) -> list[str]:
    """Paths of files relative to the project where they lie in it.

    Examples
    --------
    >>> seen_from(Path("/project"), ["/project/config/quick.yaml", "/home/me/my.yaml"])
    ['config/quick.yaml', '/home/me/my.yaml']
    """
    return [normal_folder(str(file), project) for file in files]


def names_of(project: Path, files: Iterable[Path | str]) -> list[str]:
    """Names of files for a reader elsewhere: nobody else has what lies around a project.

    Examples
    --------
    >>> names_of(Path("/project"), ["/project/config/quick.yaml", "/home/me/my.yaml"])
    ['config/quick.yaml', 'my.yaml']
    """
    return [Path(it).name if Path(it).is_absolute() else it for it in seen_from(project, files)]


_SHIPPED = ("config/config.yaml", "config/quick.yaml", "config/what_if/", "config/pictures/")


def of_a_person(project: Path | str, files: Iterable[Path | str]) -> list[str]:
    """Those of some files of settings that are none of the project's own.

    Examples
    --------
    >>> of_a_person("/project", ["/project/config/quick.yaml", "/project/my.yaml"])
    ['/project/my.yaml']
    """
    return [
        str(file) for file in files if not seen_from(Path(project), [file])[0].startswith(_SHIPPED)
    ]


def note(project: Path, settings: Mapping[str, Any], files: Iterable[Path | str]) -> None:
    """Write down that a run that starts lays files of settings over those of the project."""
    names = seen_from(project, files)
    known = _read(project) | {str(settings[key]): names for key in ("results", "figures")}
    with written_whole(project / NOTE) as part:
        part.write_text(json.dumps(known, indent=1, sort_keys=True), encoding="utf-8")


def noted(project: Path, folder: str) -> list[str] | None:
    """Files of settings of the last run that wrote to a folder of results or figures.

    None where no run wrote them down.
    """
    return _read(project).get(folder)


def _read(project: Path) -> dict[str, list[str]]:
    """What runs wrote down; what is no list of names is left out."""
    path = project / NOTE
    try:
        text = path.read_text(encoding="utf-8") if path.stat().st_size < _MOST_BYTES else ""
        said: Any = json.loads(text)
    except (OSError, ValueError, RecursionError):
        return {}
    return {
        folder: names
        for folder, names in (said.items() if isinstance(said, dict) else ())
        if isinstance(names, list) and all(isinstance(name, str) for name in names)
    }


def overlays_of(project: Path, folder: str, key: str = "figures") -> list[str] | None:
    """Files of settings that write to a folder; none where the project's own do.

    Parameters
    ----------
    project : path
        Folder of the project.
    folder : str
        Folder of figures or results, as `normal_folder` writes it.
    key : str, optional
        Which of the two it is.

    Returns
    -------
    list of str, or None
        Those of the last run that wrote there, if they still do; else one file of ``config``, or
        of the project's folder; None where there is no such.
    """
    before = noted(project, folder)
    if before is not None and _folder(project, before, key) == folder:
        return before
    files = [project / "config/config.yaml", *sorted(project.glob("config/**/*.yaml"))]
    for file in (*files, *sorted(project.glob("*.yaml"))):
        if _folder(project, [str(file)], key, alone=True) == folder:
            name = file.relative_to(project).as_posix()
            return [] if name == "config/config.yaml" else [name]
    return None


def _folder(project: Path, files: Sequence[str], key: str, alone: bool = False) -> str | None:
    """Folder that settings name, over those of the project unless they are alone."""
    paths = [project / "config/config.yaml", *(project / file for file in files)]
    try:
        folder = read_yaml(*paths[alone:]).get(key)
    except InputError:  # not of this folder, whatever else it is
        return None
    return normal_folder(folder, project) if isinstance(folder, str) else None


def on_command_line(files: Sequence[str], make: bool) -> str:
    """Write files of settings as the end of a command, to be pasted into a shell.

    Parameters
    ----------
    files : sequence of str
        Files of settings, later ones over earlier ones.
    make : bool
        Whether the command is ``make``; else it is ``snakemake``.

    Examples
    --------
    >>> on_command_line(["config/quick.yaml", "my.yaml"], make=True)
    " WITH='config/quick.yaml my.yaml'"
    >>> print(on_command_line(["config/quick.yaml", "my roof.yaml"], make=True))
     WITH="config/quick.yaml 'my roof.yaml'"
    >>> on_command_line(["my roof.yaml"], make=False)
    " --configfile 'my roof.yaml'"
    >>> on_command_line([], make=True)
    ''
    """
    if not files:
        return ""
    if make:  # which hands the words on to a shell, and has its own use for $
        words = " ".join(map(shlex.quote, files)).replace("$", "$$")
        if "'" in words and not set(words) & set('"$`!\\'):  # easier to read
            return f' WITH="{words}"'
        return f" WITH={shlex.quote(words)}"
    return f" --configfile {shlex.join(files)}"
