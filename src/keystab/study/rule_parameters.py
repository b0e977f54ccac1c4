"""What rules hand to stages: settings one by one, files, and the command that they make.

Snakemake runs a rule again when the set of its parameters' representations changes, without their
names, and leaves out what is made from input or output. A setting is therefore a parameter that
shows its name, and the command, which holds paths, is made from input and output.
"""

from __future__ import annotations

import os
import shlex
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, fields
from types import MappingProxyType
from typing import Any, get_type_hints

from keystab.study.plan import sets_of_figure, setting

Settings = Mapping[str, Any]
OfJob = Callable[[Any], Any]
"""Function of the wildcards of a job."""


class Named(str):
    """A parameter that shows its name to Snakemake.

    Of two zeros, one could become any number that another parameter already has, and the set of
    values without names would stay the same.

    Examples
    --------
    >>> Named("detector.kappa", 1.26)
    detector.kappa = 1.26
    >>> Named("samplings.n_spo", [3, 5.0]).words
    ['3', '5']
    """

    name: str
    words: list[str]
    """The value as words of a command line."""

    def __new__(cls, name: str, value: Any) -> Named:
        """Value of a setting; of a list, each word."""
        words = [spelled(each) for each in (value if isinstance(value, list) else [value])]
        named = super().__new__(cls, " ".join(words))
        named.name, named.words = name, words
        return named

    def __repr__(self) -> str:
        return f"{self.name} = {self}"


def spelled(value: Any) -> str:
    """A value as stages take it; 3 and 3.0 are the same number.

    Examples
    --------
    >>> [spelled(value) for value in (3.0, 0.5, None, True, float("inf"))]
    ['3', '0.5', 'None', 'True', 'inf']
    """
    if isinstance(value, float) and value.is_integer():
        return str(int(value))
    return str(value)


def options(*blocks: type | str) -> dict[str, str]:
    """Options of a command, each with the place of its setting.

    Parameters
    ----------
    *blocks : type or str
        Blocks of `keystab.parameters`, or places of single settings.

    Examples
    --------
    >>> from keystab.parameters import Tolerance
    >>> options("kappas.n_spo", Tolerance)["space_tolerance"]
    'comparison.space_tolerance'
    """
    found = {}
    for block in blocks:
        if isinstance(block, str):
            found[block.rpartition(".")[2]] = block
        else:
            kinds = get_type_hints(block, include_extras=True)
            for field in fields(block):
                found[field.name] = kinds[field.name].__metadata__[0].place
    return found


def command_line(module: str, arguments: Iterable[tuple[str, str | list[str]]]) -> str:
    """Command of a stage, quoted for a shell; what is empty is left out.

    Examples
    --------
    >>> command_line("keystab.stages.detect", [("views", "my views"), ("n_spo", ["3", "5"])])
    "python -m keystab.stages.detect --views 'my views' --n-spo 3 5"
    """
    words = ["python", "-m", module]
    for name, value in arguments:
        values = [value] if isinstance(value, str) else [str(each) for each in value]
        if values:
            words += [f"--{name.replace('_', '-')}", *values]
    return shlex.join(words)


@dataclass(frozen=True)
class Rules:
    """What rules ask for, as functions of the wildcards of a job.

    The wildcard ``place`` says of which scene a job is; without it, it is of the default one. Texts
    among arguments may hold wildcards in braces.

    Parameters
    ----------
    results : str
        Folder of the results.
    scenes : mapping
        Settings by the place of a scene, from `keystab.study.scenes.by_place`.
    code_of : callable
        Digest of the code of a module and of all that it imports.
    software : str
        Digest of the software that all jobs run with.
    """

    results: str
    scenes: Mapping[str, Settings]
    code_of: Callable[[str], str]
    software: str

    def setting(self, place: str) -> OfJob:
        """Parameter with the value of a setting, for an option of another name."""
        return self._parameter(place, "", _IN_PLACE)

    def parameter(self, name: str, value: Any) -> OfJob:
        """Parameter with any value, a function's too; given to a rule as it is, it has no name."""
        return self._parameter(name, "", value)

    def of(self, function: Callable[..., Any], *arguments: Any) -> OfJob:
        """What a function says of the settings of the job's scene."""

        def value_of(wildcards: Any) -> Any:
            settings, names = self._known(wildcards)
            return function(settings, *(_filled(each, names) for each in arguments))

        return value_of

    def column(self, name: str, function: Callable[..., Any], *arguments: Any) -> OfJob:
        """One column of the rows that a function says."""
        rows_of = self.of(function, *arguments)

        def values_of(wildcards: Any) -> list[Any]:
            return [getattr(row, name) for row in rows_of(wildcards)]

        return values_of

    def files(self, pattern: str, function: Callable[..., Any], *arguments: Any) -> OfJob:
        """Files of the job's scene, one for each row that a function says.

        Parameters
        ----------
        pattern : str
            Path, with wildcards and the names of columns in braces, or ``{}`` where the rows are
            single values. It starts at the place of the scene, or at a column ``place``.
        function : callable
            See `of`.
        *arguments
            Further arguments of it.
        """
        rows_of = self.of(function, *arguments)

        def paths_of(wildcards: Any) -> list[str]:
            _, names = self._known(wildcards)
            paths = []
            for row in rows_of(wildcards):
                own = names | row._asdict() if hasattr(row, "_asdict") else names
                paths.append(f"{self.results}/{own['place']}{pattern.format(row, **own)}")
            return paths

        return paths_of

    def detections(self, searches: Callable[..., Any], *arguments: Any) -> dict[str, OfJob]:
        """Input of a rule: extrema of the searches that a function says, and their traces."""
        return {
            name: self.files(f"keypoints/{{set}}/{name}_n{{n_spo}}.parquet", searches, *arguments)
            for name in ("extrema", "traces")
        }

    def placed(self, function: Callable[..., Any], *arguments: Any) -> OfJob:
        """What a function says of the place of the job's scene."""

        def value_of(wildcards: Any) -> Any:
            return function(wildcards.get("place", ""), *arguments)

        return value_of

    def growing(self, function: Callable[..., int], *arguments: Any) -> Callable[[Any, int], int]:
        """A resource that grows with every attempt."""
        amount_of: Callable[[Any], int] = self.of(function, *arguments)

        def amount(wildcards: Any, attempt: int) -> int:
            return attempt * amount_of(wildcards)

        return amount

    def stage(
        self,
        stage: str,
        /,
        *blocks: type | str,
        of_set: str = "",
        told: Settings = MappingProxyType({}),
        **given: Any,
    ) -> dict[str, Callable[..., Any]]:
        """Parameters of a rule whose job is a stage.

        Parameters
        ----------
        stage : str
            Module in `keystab.stages`.
        *blocks : type or str
            Blocks of `keystab.parameters` and places of single settings that it takes. In a place,
            ``{set}`` is the wildcard, or the set that the wildcard ``figure`` studies, or the first
            of those of the wildcard ``sweep``.
        of_set : str, optional
            The set where no wildcard says it.
        told : mapping, optional
            Further options, which change no number: Snakemake does not compare them.
        **given
            Options that are no setting, or have another value: functions of wildcards, or values.

        Returns
        -------
        dict
            Settings one by one, the digest of the code and that of the software, and what Snakemake
            does not compare: what the path of the output says already, the command, and words that
            name the scene, if it is not the default.
        """
        module = f"keystab.stages.{stage}"
        places = options(*blocks)
        given = {**given, **told}
        values = {
            option: self._parameter(
                places.get(option, option), of_set, given.get(option, _IN_PLACE)
            )
            for option in {**places, **given}
        }

        def command(wildcards: Any, input: Any, output: Any) -> str:
            words = {option: value_of(wildcards).words for option, value_of in values.items()}
            return command_line(module, [*input.items(), *words.items(), *output.items()])

        parameters: dict[str, Callable[..., Any]] = dict(values)
        for option, value in given.items():
            if option in told or (isinstance(value, str) and "{" in value):  # the path says it
                parameters[option] = _derived(values[option])
        return {**parameters, **self.made_with(module), "command": command, "scene": self._scene}

    def figure(self, name: str, draft: bool) -> dict[str, Callable[..., Any]]:
        """Parameters of a rule that draws a figure from tables of one folder; see `stage`."""
        module = f"keystab.figures.{name.lower()}"
        parameters = {"draft": self.parameter("draft", draft), **self.made_with(module)}

        def command(wildcards: Any, input: Any, output: Any) -> str:
            words = [("tables", os.path.dirname(input[0])), *output.items()]
            words += [("code", self.code_of(module)), ("lock", self.software)]
            return command_line(module, words) + (" --draft" if draft else "")

        return {**parameters, "command": command}

    def made_with(self, module: str) -> dict[str, OfJob]:
        """Parameters that change with a module, or what it imports, and with the software."""
        return {
            "code": self.parameter(f"code of {module}", self.code_of(module)),
            "software": self.parameter("environment.lock", self.software),
        }

    def _parameter(self, place: str, of_set: str, value: Any) -> OfJob:
        """Parameter with the value of a setting, or with another value under its name."""

        def value_of(wildcards: Any) -> Named:
            settings, names = self._known(wildcards)
            full = place.format(**(names | ({"set": of_set} if of_set else {})))
            if value is _IN_PLACE:
                return Named(full, setting(settings, full))
            own = value(wildcards) if callable(value) else _filled(value, names)
            return own if isinstance(own, Named) else Named(full, own)

        return value_of

    def _known(self, wildcards: Any) -> tuple[Settings, dict[str, str]]:
        """Settings of the job's scene, and its wildcards with what follows from them."""
        names = {"place": "", **dict(wildcards.items())}
        settings = self.scenes[names["place"]]
        if "figure" in names:
            names.setdefault("set", sets_of_figure(settings, names["figure"])[0])
        elif "sweep" in names:
            names.setdefault("set", next(iter(settings["sweeps"][names["sweep"]])))
        return settings, names

    def _scene(self, wildcards: Any, input: Any) -> str:
        place = wildcards.get("place", "")
        return f", scene '{place.split('/')[1]}'" if place else ""


_IN_PLACE = object()


def _derived(value_of: OfJob) -> Callable[[Any, Any], Any]:
    """Parameter that Snakemake takes for made from input, and does not compare."""
    return lambda wildcards, input: value_of(wildcards)


def _filled(argument: Any, names: Mapping[str, str]) -> Any:
    return argument.format(**names) if isinstance(argument, str) else argument
