"""The study as seen from outside: its settings, its files, and what Snakemake would do."""

from __future__ import annotations

import dataclasses
import hashlib
import json
import re
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

from keystab.errors import InputError
from keystab.provenance.imported_software import software_digest
from keystab.provenance.shielded_environment import shielded
from keystab.study.plain_yaml import read_plain_yaml
from keystab.study.settings import Settings, checked, read_yaml

__all__ = ["Output", "Study", "find_project", "jobs_and_reasons", "settings_digest"]

_FOLDERS = ("results", "figures", "logs")
_SUMMARY = ["output_file", "date", "rule", "log-file(s)", "status", "plan"]
_JOB = re.compile(r"^Job \d+: (.*)\n *[Rr]eason: (.*)$", re.MULTILINE)
_NOTHING = re.compile("^Nothing to be done", re.MULTILINE)
_JOBS = re.compile("^Job stats:", re.MULTILINE)
_FOLLOWS = ("Input files updated by another job", "Missing output files")
_DIGEST = re.compile(r"(?:code of [\w.]+ = |environment\.lock = |')[0-9a-f]{64}'?")  # common.smk
_LONG = re.compile("Union of exclusive params before and now across all output: ")


@dataclasses.dataclass(frozen=True)
class Output:
    """A file that the study makes, and whether it is there and up to date."""

    path: str
    rule: str
    logs: tuple[str, ...]
    status: str
    pending: bool


class Study:
    """A project folder together with the settings that are laid over its own.

    Parameters
    ----------
    project : path
        Folder that holds the Snakefile.
    overlays : sequence of path
        Files of settings; later ones win. They are relative to the project unless absolute.
    most_seconds : float, optional
        Longest time that Snakemake may take to plan; without end by default.
    home : path, optional
        Folder for what Snakemake keeps of its own; the user's by default.

    Raises
    ------
    InputError
        If the folder is no project, or the settings cannot work.
    """

    def __init__(
        self,
        project: Path,
        overlays: Sequence[Path | str] = (),
        most_seconds: float | None = None,
        home: Path | None = None,
    ) -> None:
        self.project = Path(project)
        self.most_seconds = most_seconds
        self.home = home
        self.overlays = [Path(overlay) for overlay in overlays]
        if not (self.project / "Snakefile").is_file():
            raise InputError(f"{project}: no Snakefile there; go to the project's folder")
        files = [self.project / overlay for overlay in self.overlays]
        given = read_yaml(self.project / "config/config.yaml", *files)
        schema = self.project / "workflow/schemas/config.schema.yaml"
        self.settings: Settings = checked(given, read_plain_yaml(schema))
        self.results, self.figures, self.logs = (str(self.settings[key]) for key in _FOLDERS)

    @property
    def settings_digest(self) -> str:
        """SHA-256 of all settings but the names of the folders that results go to."""
        return settings_digest(self.settings)

    @property
    def lock_digest(self) -> str:
        """SHA-256 of ``environment.lock``, if that is what is imported; see `software_digest`."""
        return software_digest(self.project / "environment.lock")

    def outputs(self) -> list[Output]:
        """Every file that the study makes, sorted by path; nothing is run.

        Raises
        ------
        InputError
            If Snakemake cannot plan the study.
        """
        said = self.snakemake("--summary", output_only=True)
        # Names of logs are from records, which a stranger may have written to hide other lines.
        rows = [line.split("\t") for line in said.split("\n") if line]
        start = rows.index(_SUMMARY) + 1 if _SUMMARY in rows else 0
        if not start or any(len(row) != len(_SUMMARY) for row in rows[start:]):
            raise InputError("snakemake --summary is not readable; are its records damaged?")
        outputs = [
            Output(
                path,
                rule,
                tuple(log for log in logs.split(",") if log != "-"),
                status,
                plan != "no update",
            )
            for path, _, rule, logs, status, plan in rows[start:]
        ]
        return sorted(outputs, key=lambda output: output.path)

    def to_do(self, *targets: str) -> list[str]:
        """What Snakemake would run of its own accord, one line each; see `plan`."""
        return [f"{job}: {reason}" if reason else job for job, reason in self.plan(*targets)]

    def plan(self, *targets: str) -> list[tuple[str, str]]:
        """Jobs that Snakemake would run of its own accord, with reasons; none where all is done.

        Jobs that would only follow others, or only make again what others need, are not named.

        Raises
        ------
        InputError
            If Snakemake cannot plan the study.
        """
        said = self.snakemake("--dry-run", *targets)
        # What it says also holds text of records, which a stranger may have written.
        if _NOTHING.search(said) and not _JOBS.search(said):
            return []
        found = jobs_and_reasons(said)
        own = {
            job: "; ".join(it for it in why.split("; ") if not it.startswith(_FOLLOWS))
            for job, why in found
        }
        jobs = {job: why for job, why in own.items() if why} or dict(found)
        shortened = {job: _LONG.sub("", why).strip() for job, why in jobs.items()}
        told = [(job, _DIGEST.sub("code or lock", why)) for job, why in shortened.items()]
        return told or [("jobs that snakemake --dry-run names", "")]

    def run(self, cores: int, *targets: str) -> None:
        """Make targets, or the whole study, showing what Snakemake says.

        Raises
        ------
        InputError
            If a job fails.
        """
        arguments = [*self._command(), "--cores", str(cores), *self._files(), "--", *targets]
        status = subprocess.run(
            arguments, cwd=self.project, env=shielded(home=self.home)
        ).returncode
        if status:
            raise InputError("the study stopped before its end; the reason stands above")

    def snakemake(self, *arguments: str, output_only: bool = False) -> str:
        """What Snakemake says to some arguments.

        Raises
        ------
        InputError
            If it fails; with its last line.
        """
        flags = [argument for argument in arguments if argument.startswith("-")]
        targets = [argument for argument in arguments if not argument.startswith("-")]
        command = [*self._command(), "--cores", "1", *flags, *self._files(), "--", *targets]
        try:
            run = subprocess.run(
                command,
                cwd=self.project,
                env=shielded(home=self.home),
                capture_output=True,
                encoding="utf-8",
                errors="replace",
                timeout=self.most_seconds,
            )
        except subprocess.TimeoutExpired:
            raise InputError(
                f"snakemake does not plan these settings within {self.most_seconds:.0f} seconds"
            ) from None
        if run.returncode:
            lines = (run.stdout + run.stderr).strip().splitlines() or ["it says nothing"]
            raise InputError(f"snakemake {' '.join(arguments)} failed: {lines[-1].strip()}")
        return run.stdout if output_only else run.stdout + run.stderr

    def _command(self) -> list[str]:
        return [sys.executable, "-m", "snakemake"]

    def _files(self) -> list[str]:
        if not self.overlays:
            return []
        return ["--configfile", *(str(overlay) for overlay in self.overlays)]


def settings_digest(settings: Settings) -> str:
    """SHA-256 of complete settings, but for the names of the folders that results go to."""
    scientific = {key: value for key, value in settings.items() if key not in _FOLDERS}
    return hashlib.sha256(json.dumps(scientific, sort_keys=True).encode()).hexdigest()


def jobs_and_reasons(plan: str) -> list[tuple[str, str]]:
    """Jobs of a dry run, by what they say about themselves, with Snakemake's reasons."""
    return _JOB.findall(plan)


def find_project(start: Path | None = None) -> Path:
    """Folder of the project that a folder, the current one by default, lies in.

    Raises
    ------
    InputError
        If it lies in none.
    """
    start = (start or Path.cwd()).absolute()
    for folder in (start, *start.parents):
        if (folder / "Snakefile").is_file() and (folder / "environment.lock").is_file():
            return folder
    raise InputError(f"{start} lies in no copy of the project; go to the project's folder")
