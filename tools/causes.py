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
import sys
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
from keystab.study.plan import setting
from keystab.study.rule_parameters import spelled

sys.path.insert(0, str(Path(__file__).parent))
from changes import (  # noqa: E402
    is_or_are,
    of_views,
    options_of,
    parameters,
    said,
    shown,
    some,
    was_or_were,
)

FOLLOWS = "Input files updated by another job"
DERIVED = "other values follow from these settings"
PARAMS = re.compile(r"Union of exclusive params .*?: before: (?P<before>.*?) now: (?P<now>.*)$")
MEANT = 2
"""Changes of settings that what follows from them is put down to."""

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
    follows: bool = False
    """Whether it only follows from settings that are causes of other jobs."""


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

    def of_all(self, jobs: Sequence[Job]) -> list[list[Cause]]:
        """Causes of jobs; what only follows from settings by the names of these."""
        found = [self.of(job) for job in jobs]
        every = (it for each in found for it in each if it.overwrites and not it.follows)
        meant = dict.fromkeys(every)
        if not 0 < len(meant) <= MEANT:
            text = "values changed that follow from these settings" if meant else ""
            meant = {Cause(text, overwrites=True): None} if meant else {}
        return [
            list(
                dict.fromkeys(it for one in each for it in (meant if one.follows else ()) or [one])
            )
            for each in found
        ]

    def of(self, job: Job) -> list[Cause]:
        """Causes of a job, those first that a person is most likely to have meant."""
        reason = job.reason
        if FOLLOWS in reason:
            return [Cause(FOLLOWS)]
        found: list[Cause] = []
        if params := PARAMS.search(reason):
            found += self._parameters(params["before"], params["now"], job)
        if "Set of input files has changed" in reason:
            inputs = list(self._inputs(job))
            known = any(cause.overwrites for cause in found)  # settings, from which they follow
            found = [*(it for it in inputs if it.picture or not known), *found]
        for part in reason.split("; "):
            head, _, files = part.partition(": ")
            if head == "Missing output files":
                found.append(Cause(f"{some(files)} {is_or_are(files)} missing"))
            elif head == "Incomplete output files":
                found.append(Cause(f"{some(files)} {is_or_are(files)} unfinished"))
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
            more = f", and from {some(', '.join(come))}" if come else ""
            yield Cause(f"it is no longer made from {some(', '.join(gone))}{more}")
        elif come and not any(name in before for name in PICTURE):
            yield Cause(f"it is also made from {some(', '.join(come))}")

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
            yield Cause(f"{some(', '.join(others))} {was_or_were(others)} edited or made anew")

    def _parameters(self, before: str, now: str, job: Job) -> Iterator[Cause]:
        """Which settings, code and software are others than before."""
        old, new = parameters(before), parameters(now)
        known = sorted(old.keys() | new.keys())
        other_picture = "Set of input files has changed" in job.reason
        names = [it for it in known if not (other_picture and it.startswith("reference"))]
        settings = [name for name in names if self._is_setting(name, new.get(name))]
        texts = list(self._of_settings(settings, old, new))
        yield from (Cause(text, overwrites=True) for text in texts)
        rest = [name for name in names if name not in settings]
        for name in rest:
            if name.startswith("code of "):
                yield self._code(name.removeprefix("code of "), old.get(name, ""))
            elif name == "environment.lock":
                problems = software_problems(self.lock)
                yield Cause(problems[0] if problems else "environment.lock changed")
            elif name == "criteria":
                yield Cause("config/claims.yaml has other claims or criteria")
        derived = [it for it in rest if not it.startswith(("code of ", "environment."))]
        if set(derived) - {"criteria"} and not texts:
            changed = [said(it, old.get(it, ""), new.get(it, "")) for it in derived]
            yield Cause("; ".join(changed), overwrites=True, follows=True)
        if not known:
            yield Cause(f"parameters changed from {before.strip()} to {now.strip()}")

    def _is_setting(self, name: str, value: str | None) -> bool:
        """Whether a parameter is a setting as it is written, and does not follow from some."""
        if name.startswith(("code of ", "environment.")):
            return False
        if name.startswith("sets.") or value is None:
            return "." in name
        try:
            given = setting(self.settings, name)
        except (KeyError, TypeError):
            return "." in name
        return value == " ".join(map(spelled, given if isinstance(given, list) else [given]))

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
            shown(path)
            for name, path, edited in files_behind(module, self.package)
            if edited > since and not self._as_it_was(name, edited)
        ]
        if not files:
            return Cause(f"the code of {module} changed (no file says by its date which)")
        return Cause(f"{some(', '.join(files))} {was_or_were(files)} edited")

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
