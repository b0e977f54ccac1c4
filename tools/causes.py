"""Why Snakemake would run a job again, in a person's words.

Snakemake compares what a job is made from with what it wrote down when it ran. Of settings it knows
the values that a rule is given: a set of 32 views is 32 shifts. Of code it knows a digest of all
that a stage imports. Here the first become the setting that a person wrote, and the second the file
that was edited.
"""

from __future__ import annotations

import functools
import re
import shlex
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from keystab.camera.view_sets import PER_VIEW, members
from keystab.provenance.code_digest import (
    CATALOGUES,
    PACKAGE_FOLDER,
    fingerprint,
    imported_modules,
)
from keystab.provenance.imported_software import software_problems
from keystab.provenance.snakemake_records import Record

FOLLOWS = "Input files updated by another job"
PARAMS = re.compile(r"Union of exclusive params .*?: before: (?P<before>.*?) now: (?P<now>.*)$")
PARAM = re.compile(
    r"'?(?P<name>[\w.]+|code of [\w.]+) = (?P<value>.*?)'?(?=,'?[\w.]+ = |,'?code of |$)"
)
SHORT = 60
"""Letters of a value that is shown as it is."""

PICTURE = ("reference", "picture")
"""Options of stages that name a picture."""


class Job(NamedTuple):
    """A job that would run."""

    said: str
    reason: str
    words: list[str]
    """Its command."""


class Cause(NamedTuple):
    """Why a job would run."""

    text: str
    overwrites: bool = False
    """Whether results of other settings, or of another picture, are lost by it."""
    picture: str = ""
    """The picture that these are of, if it was another one."""


JOB = re.compile(
    r"^Job \d+: (?P<said>.*)\n *[Rr]eason: (?P<reason>.*)"
    r"(?:\n+(?:Shell command: *)?(?P<words>python -m .*))?$",
    re.MULTILINE,
)


def jobs_of_plan(plan: str) -> list[Job]:
    """Jobs of a dry run that prints commands, by what they say about themselves."""
    return [
        Job(found["said"], found["reason"], shlex.split(found["words"] or ""))
        for found in JOB.finditer(plan)
    ]


class Causes:
    """Reasons of Snakemake, put into words.

    Parameters
    ----------
    settings : mapping
        Settings as files give them, without defaults.
    records : mapping
        What Snakemake wrote down, by output (`keystab.provenance.snakemake_records`).
    lock : path, optional
        ``environment.lock``.
    package : path, optional
        Folder of the library that jobs run.
    """

    def __init__(
        self,
        settings: Mapping[str, Any],
        records: Mapping[str, Record],
        lock: Path = Path("environment.lock"),
        package: Path = PACKAGE_FOLDER,
    ) -> None:
        self.settings = settings
        self.records = records
        self.lock = lock
        self.package = package
        sets = {name: views for name, views in settings.get("sets", {}).items() if views}
        self.sweep_of = {
            member.name: name
            for name, views in sets.items()
            if views.get("sweep")
            for member in members(sets, name)
        }

    def of(self, job: Job) -> list[Cause]:
        """Causes of a job, those first that a person is most likely to have meant."""
        reason = job.reason
        if FOLLOWS in reason:
            return [Cause(FOLLOWS)]
        found: list[Cause] = []
        if "Set of input files has changed" in reason:
            found += self._inputs(job)
        if params := PARAMS.search(reason):
            found += self._parameters(params["before"], params["now"], job)
        for part in reason.split("; "):
            head, _, files = part.partition(": ")
            if head == "Missing output files":
                found.append(Cause(f"{_some(files)} {_is_or_are(files)} missing"))
            elif head == "Incomplete output files":
                found.append(Cause(f"{_some(files)} {_is_or_are(files)} unfinished"))
            elif head == "Updated input files":
                found += self._edited(files, job)
        if "Code has changed" in reason:
            found.append(Cause("the rule has another command"))
        return list(dict.fromkeys(found)) or [Cause(reason)]

    def record_of(self, job: Job) -> Record | None:
        """What Snakemake wrote down when a job ran the last time."""
        return next(iter(self.outputs_of(job).values()), None)

    def outputs_of(self, job: Job) -> dict[str, Record]:
        """Files that a job made before, with their records."""
        own = {word: self.records[word] for word in job.words if word in self.records}
        return {name: it for name, it in own.items() if it.command.split()[:3] == job.words[:3]}

    # What a job is made from

    def _inputs(self, job: Job) -> Iterator[Cause]:
        """Which inputs are others than before."""
        record = self.record_of(job)
        if record is None:
            yield Cause("its inputs are others")
            return
        before, now = options_of(shlex.split(record.command)), options_of(job.words)
        known = set(record.inputs)
        for name in PICTURE:
            old, new = before.get(name, []), now.get(name, [])
            if old != new and known & set(old):
                yield Cause(
                    f"another picture, {' '.join(new)} in place of {' '.join(old)}", True, old[0]
                )
                known -= set(old)
        words = {word for values in now.values() for word in values}
        used = {word for values in before.values() for word in values}
        gone = sorted(known - words)
        come = sorted(word for word in words - used if "/" in word and word not in self.lost(job))
        if gone and not any(name in before for name in PICTURE):
            more = f", and from {_some(', '.join(come))}" if come else ""
            yield Cause(f"it is no longer made from {_some(', '.join(gone))}{more}")
        elif come and not any(name in before for name in PICTURE):
            yield Cause(f"it is also made from {_some(', '.join(come))}")

    def lost(self, job: Job) -> set[str]:
        """Words of a job that are its pictures or its outputs."""
        pictures = [word for name in PICTURE for word in options_of(job.words).get(name, [])]
        return {*pictures, *self.outputs_of(job)}

    def _edited(self, files: str, job: Job) -> Iterator[Cause]:
        """Inputs of other content than when they were used."""
        options = options_of(job.words)
        pictures = [
            it for name in PICTURE for it in options.get(name, ()) if it in files.split(", ")
        ]
        yield from (Cause(f"{it} is another picture now", True) for it in pictures)
        others = [it for it in files.split(", ") if it not in pictures]
        if others:
            yield Cause(f"{_some(', '.join(others))} {_was_or_were(others)} edited or made anew")

    def _parameters(self, before: str, now: str, job: Job) -> Iterator[Cause]:
        """Which settings, code and software are others than before."""
        old, new = parameters(before), parameters(now)
        names = sorted(old.keys() | new.keys())
        if "Set of input files has changed" in job.reason:
            names = [name for name in names if name != "reference_sha256"]  # of another picture
        settings = [name for name in names if "." in name or name in self.settings]
        settings = [name for name in settings if not name.startswith(("code of ", "environment."))]
        texts = self._of_settings(settings, old, new)
        yield from (Cause(text, overwrites=True) for text in texts)
        for name in names:
            if name.startswith("code of "):
                yield self._code(name.removeprefix("code of "), old.get(name, ""))
            elif name == "environment.lock":
                problems = software_problems(self.lock)
                yield Cause(problems[0] if problems else "environment.lock changed")
            elif name == "criteria":
                yield Cause("config/claims.yaml has other claims or criteria")
            elif name not in settings and not settings:  # what follows from settings
                yield Cause(said(name, old.get(name, ""), new.get(name, "")), overwrites=True)
        if not names:
            yield Cause(f"parameters changed from {before.strip()} to {now.strip()}")

    def _of_settings(
        self, names: Iterable[str], old: Mapping[str, str], new: Mapping[str, str]
    ) -> Iterator[str]:
        """Lines on settings; those of one set of views together."""
        of_sets: dict[str, dict[str, tuple[list[str], list[str]]]] = {}
        for name in names:
            parts = name.split(".")
            if parts[0] == "sets" and parts[-1] in PER_VIEW and name in old and name in new:
                own = of_sets.setdefault(parts[1], {})
                own[parts[-1]] = (old[name].split(), new[name].split())
            else:
                yield said(self._as_written(name), old.get(name, ""), new.get(name, ""))
        for name, lists in of_sets.items():
            raw = self.settings.get("sets", {}).get(self.sweep_of.get(name, name)) or {}
            yield from of_views(f"sets.{self.sweep_of.get(name, name)}", lists, raw)

    def _as_written(self, name: str) -> str:
        """Place of a setting as a person writes it: a set of a sweep by the name of the sweep."""
        parts = name.split(".")
        if parts[0] == "sets":
            parts[1] = self.sweep_of.get(parts[1], parts[1])
        return ".".join(parts)

    # Code

    def _code(self, module: str, digest: str) -> Cause:
        """Which files of the code behind a stage or figure were edited since it ran."""
        since = self._first_start.get(f"code of {module} = {digest}")
        if since is None:
            return Cause(f"the code of {module} changed")
        files = [
            _shown(path)
            for name, path, edited in files_behind(module, self.package)
            if edited > since and not self._as_it_was(name, edited)
        ]
        if not files:
            return Cause(f"the code of {module} changed (no file says by its date which)")
        return Cause(f"{_some(', '.join(files))} {_was_or_were(files)} edited")

    def _as_it_was(self, name: str, edited: float) -> bool:
        """Whether a module, however new its file is, is the code that an older job ran."""
        if name.removeprefix("keystab.") in CATALOGUES:  # of which a job uses a part
            return False
        return any(start < edited and name in closure for start, closure in self._unchanged)

    @functools.cached_property
    def _first_start(self) -> dict[str, float]:
        """When the first job started that Snakemake knows of, by the code that it ran."""
        found: dict[str, float] = {}
        for record in self.records.values():
            for text in record.fields["params"] or ():
                if text.startswith("code of "):
                    start = record.fields["starttime"]
                    found[text] = min(found.get(text, start), start)
        return found

    @functools.cached_property
    def _unchanged(self) -> list[tuple[float, frozenset[str]]]:
        """When code ran that is still the same, and its modules."""
        unchanged = []
        for text, start in self._first_start.items():
            module, _, digest = text.removeprefix("code of ").partition(" = ")
            try:
                if fingerprint(module, self.package) == digest:
                    names = frozenset(imported_modules(module, self.package))
                    unchanged.append((start, names))
            except ValueError:  # a module that is no longer there
                continue
        return unchanged


def files_behind(module: str, package: Path) -> Iterator[tuple[str, Path, float]]:
    """Modules that a module imports in the end, their files, and when they were edited."""
    for name in imported_modules(module, package):
        path = package.joinpath(*name.split(".")[1:])
        path = path / "__init__.py" if path.is_dir() else path.with_suffix(".py")
        yield name, path, path.stat().st_mtime


# Words


def parameters(text: str) -> dict[str, str]:
    """Parameters of one side of a comparison by their names.

    Examples
    --------
    >>> parameters("a.b = 1,c = x y ")
    {'a.b': '1', 'c': 'x y'}
    """
    return {one["name"]: one["value"].strip() for one in PARAM.finditer(text.strip())}


def options_of(words: Sequence[str]) -> dict[str, list[str]]:
    """Options of a command with their values.

    Examples
    --------
    >>> options_of(["python", "-m", "x", "--n-spo", "3", "5", "--table", "a.csv", ">log", "2>&1"])
    {'n_spo': ['3', '5'], 'table': ['a.csv']}
    """
    found: dict[str, list[str]] = {}
    name = ""
    for word in words:
        if word.startswith(">"):
            break
        if word.startswith("--"):
            name = word.removeprefix("--").replace("-", "_")
            found[name] = []
        elif name:
            found[name].append(word)
    return found


def of_views(
    place: str, lists: Mapping[str, tuple[list[str], list[str]]], raw: Mapping[str, Any]
) -> Iterator[str]:
    """Lines on the views of a set, one value per view: what a person changed to get them.

    Parameters
    ----------
    place : str
        Place of the set in the settings.
    lists : mapping
        Values before and now, by what they are of.
    raw : mapping
        The set as a person wrote it.

    Examples
    --------
    >>> lists = {"shift_y": (["0", "-0.2", "0.2"], ["0", "-0.2"]), "blur": (["1"] * 3, ["1"] * 2)}
    >>> list(of_views("sets.translations", lists, {"n_views": 2}))
    ['sets.translations.n_views was 3 and is 2']
    >>> list(of_views("sets.zooms", {"step": (["10", "15"], ["10", "14"])}, {"n_views": 2}))
    ['sets.zooms.step was 10 15 and is 10 14']
    """
    counts = {(len(old), len(new)) for old, new in lists.values() if len(old) != len(new)}
    if counts:
        before, now = max(counts)
        if "n_views" in raw:
            yield f"{place}.n_views was {before} and is {now}"
        else:
            yield f"{place} had {before} views and has {now}"
    for key, (old, new) in sorted(lists.items()):
        shared = min(len(old), len(new))
        spread = (old[0], old[-1]) == (new[0], new[-1])  # zooms, in more or fewer steps
        if len(old) != len(new) and (old[:shared] == new[:shared] or spread):
            continue  # follows from the number
        yield said(f"{place}.{key}", " ".join(old), " ".join(new))


def said(name: str, old: str, new: str) -> str:
    """One line on a setting that was one thing and is another.

    Examples
    --------
    >>> said("detector.epsilon", "0", "1e-06")
    'detector.epsilon was 0 and is 1e-06'
    >>> said("sets.still.step", "10 10 10", "20 20 20")
    'sets.still.step was 10 and is 20'
    >>> said("samplings.n_spo", " ".join(map(str, range(3, 40))), " ".join(map(str, range(3, 38))))
    'samplings.n_spo no longer has 38 39'
    >>> many, moved = [" ".join(str(k / scale) for k in range(40)) for scale in (4, 5)]
    >>> said("sets.zooms.step", many, moved)
    'sets.zooms.step was 0.0 to 9.75 and is 0.0 to 7.8 (40 values)'
    """
    if re.fullmatch("[0-9a-f]{64}", old or new):
        return f"{name} changed"
    sides = [_joined(text.split()) for text in (old, new)]
    if max(map(len, sides)) <= SHORT:
        return f"{name} was {sides[0] or 'nothing'} and is {sides[1] or 'nothing'}"
    before, now = old.split(), new.split()
    gone, come = ([it for it in a if it not in b] for a, b in ((before, now), (now, before)))
    told = [
        f"{words} {_joined(values, SHORT)}"
        for words, values in (("no longer has", gone), ("has in addition", come))
        if values
    ]
    if len(before) == len(now) and (before[0], before[-1]) != (now[0], now[-1]):
        ends = [f"{values[0]} to {values[-1]}" for values in (before, now)]
        return f"{name} was {ends[0]} and is {ends[1]} ({len(now)} values)"
    if len(gone) + len(come) < len(before) and told:
        return f"{name} {' and '.join(told)}"
    return f"{name} was {sides[0][:50]} ... and is {sides[1][:50]} ..."


def _joined(values: Sequence[str], most: int = 10**6) -> str:
    """Values in a row; one where all are the same."""
    text = values[0] if len(set(values)) == 1 else " ".join(values)
    return text if len(text) <= most else f"{text[:most]} ..."


def _some(files: str) -> str:
    names = sorted(files.split(", "))
    more = f" and {len(names) - 2} more" if len(names) > 3 else ""
    shown = names[:2] if more else names
    if more or len(shown) == 1:
        return ", ".join(shown) + more
    return f"{', '.join(shown[:-1])} and {shown[-1]}"


def _is_or_are(files: str) -> str:
    return "are" if ", " in files else "is"


def _was_or_were(files: Sequence[str]) -> str:
    return "was" if len(files) == 1 else "were"


def _shown(path: Path) -> str:
    here = Path.cwd()
    return path.relative_to(here).as_posix() if path.is_relative_to(here) else path.as_posix()
