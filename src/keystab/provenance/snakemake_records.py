"""What Snakemake wrote down about each file that it made: by which command, and from what.

One JSON file per output lies in ``.snakemake/metadata``, named by the output's path in base64. All
paths in it are as the workflow knows them, within the project's folder.
"""

from __future__ import annotations

import base64
import binascii
import dataclasses
import hashlib
import json
import re
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from keystab.errors import InputError

__all__ = [
    "FOLDER",
    "Record",
    "place_records",
    "read_foreign_records",
    "read_records",
    "settings_behind",
    "upstream",
]

FOLDER = Path(".snakemake/metadata")
"""Where the records lie, within the project's folder."""

_MOST_BYTES = 5_000_000
_OLDEST_FORMAT = 6
"""Of records, by which Snakemake notices all that it can notice."""

_TYPES: Mapping[str, tuple[type, ...]] = {
    "rule": (str,), "input": (list,), "log": (list,), "shellcmd": (str,), "params": (list,),
    "code": (str,), "record_format_version": (int,), "conda_env": (str, type(None)),
    "container_img_url": (str, type(None)), "software_stack_hash": (str,), "job_hash": (int,),
    "starttime": (int, float), "endtime": (int, float), "incomplete": (bool,),
    "external_jobid": (str, type(None)), "input_checksums": (dict,),
}  # fmt: skip
"""What Snakemake writes, and as what; of a stranger's record nothing else is kept."""

_SETTING = re.compile(r"([a-z][\w.]*) = (.*)", re.DOTALL)


@dataclasses.dataclass(frozen=True)
class Record:
    """What made one file.

    Parameters
    ----------
    output : str
        Path of the file.
    path : str
        Path of the record within `FOLDER`.
    fields : mapping
        What Snakemake wrote.
    """

    output: str
    path: str
    fields: Mapping[str, Any]

    @property
    def rule(self) -> str:
        """Rule that made the file."""
        return str(self.fields["rule"])

    @property
    def inputs(self) -> list[str]:
        """Files and folders that it was made from."""
        return list(self.fields["input"] or ())

    @property
    def command(self) -> str:
        """Command that made it, on one line."""
        return " ".join(str(self.fields["shellcmd"] or "").split())

    @property
    def digests(self) -> dict[str, str]:
        """SHA-256 of the inputs when they were used; stores and very large files have none."""
        found = self.fields["input_checksums"] or {}
        return {name: digest.rpartition(":")[2] for name, digest in found.items()}

    @property
    def settings(self) -> dict[str, str]:
        """Settings that the rule was given, by name."""
        named = (_SETTING.fullmatch(text) for text in self.fields["params"] or ())
        return {found[1]: found[2] for found in named if found}

    def timeless(self) -> str:
        """Write the record without what differs between two runs that did the same.

        Durations stay, as measured costs; dates go, and so does the number by which Snakemake's
        report puts together the outputs of one job, which becomes one made from its command.
        """
        took = (self.fields["endtime"] or 0.0) - (self.fields["starttime"] or 0.0)
        job = hashlib.sha256(f"{self.rule} {self.command}".encode()).hexdigest()
        changed = {
            "starttime": 0.0,
            "endtime": round(max(took, 0.0), 1),
            "job_hash": int(job[:12], 16),
            "external_jobid": None,
        }
        return json.dumps({**self.fields, **changed}, sort_keys=True)

    @property
    def is_whole(self) -> bool:
        """Whether it is as Snakemake writes it; of others, it would not notice what changed."""
        return _typed(self.fields)


def read_records(project: Path) -> dict[str, Record]:
    """Read all records of a project by the path of their output; sorted, possibly none.

    Records that cannot be read are left out, as Snakemake does.
    """
    folder = project / FOLDER
    records = {}
    for file in sorted(folder.rglob("*")):
        if file.is_file():
            path = file.relative_to(folder).as_posix()
            try:
                output = base64.urlsafe_b64decode(re.sub("[@/]", "", path)).decode()
                fields = json.loads(file.read_text(encoding="utf-8"))
                _ = [fields[key] for key in ("rule", "input", "shellcmd", "params")]
                _ = [fields[key] for key in ("input_checksums", "starttime", "endtime")]
            except (binascii.Error, ValueError, KeyError, TypeError):
                continue
            records[output] = Record(output, path, fields)
    return dict(sorted(records.items()))


def read_foreign_records(folder: Path, results: Iterable[str]) -> dict[str, Record]:
    """Read the records of an archive that a stranger made, by the path of their output.

    Parameters
    ----------
    folder : path
        Where the archive was unpacked.
    results : iterable of str
        Folders that its run wrote to, relative and checked; outputs lie in one of them.

    Raises
    ------
    InputError
        In one line, if one of them is not as Snakemake writes it, is of a file outside the folders
        of results, or names an input outside the project.
    """
    places = tuple(f"{place}/" for place in results)
    records: dict[str, Record] = {}
    for file in sorted((folder / FOLDER).rglob("*")):
        if not file.is_file():
            continue
        path = file.relative_to(folder / FOLDER).as_posix()
        name = f"{FOLDER.as_posix()}/{path[:60]}"
        if file.stat().st_size > _MOST_BYTES:
            raise InputError(f"{name}: too long for a record of Snakemake")
        try:
            output = base64.b64decode(
                re.sub("[@/]", "", path).encode("ascii"), altchars=b"-_", validate=True
            ).decode("utf-8")
            fields = json.loads(file.read_text(encoding="utf-8"))
            kept = {key: fields[key] for key in _TYPES}
        except (ValueError, KeyError, TypeError, RecursionError):
            raise InputError(f"{name}: not a record of Snakemake") from None
        if not _typed(kept) or path != _place(output):
            raise InputError(f"{name}: not a record of Snakemake")
        checksums = kept["input_checksums"]
        if not output.startswith(places) or _leads_out(output) or output in records:
            raise InputError(f"{name}: records {output[:80]!a}, which is no result of this run")
        if outside := [it for it in (*kept["input"], *checksums) if _leads_out(it)]:
            raise InputError(
                f"{output}: was made from {outside[0][:80]!a}, a file outside the project, which "
                "cannot be checked; pictures belong into config/images"
            )
        records[output] = Record(output, path, kept)
    return dict(sorted(records.items()))


def place_records(records: Mapping[str, Record], project: Path) -> None:
    """Write records where Snakemake looks for them in a project."""
    for record in records.values():
        path = project / FOLDER / _place(record.output)
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps(record.fields), encoding="utf-8")


def _typed(fields: Mapping[str, Any]) -> bool:
    """Whether the fields of a record have the types that Snakemake gives them."""
    if not all(
        isinstance(fields.get(key), kinds) and isinstance(fields[key], bool) == (bool in kinds)
        for key, kinds in _TYPES.items()
    ):
        return False
    names = (fields["rule"], *fields["log"])
    texts = (*names, *fields["params"], *fields["input"], *fields["input_checksums"].values())
    return (
        all(isinstance(it, str) for it in texts)
        and all(it.isprintable() for it in names)
        and all(abs(fields[key]) < 1e12 for key in ("starttime", "endtime"))
        and fields["record_format_version"] >= _OLDEST_FORMAT
        and not fields["incomplete"]
    )


def _place(output: str) -> str:
    """Path of a record within `FOLDER`, as Snakemake spells it where names have 255 bytes."""
    text = base64.urlsafe_b64encode(output.encode()).decode()
    parts = [text[start : start + 254] for start in range(0, len(text), 254)]
    return "/".join([*(f"@{part}" for part in parts[:-1]), *parts[-1:]])


def _leads_out(path: str) -> bool:
    """Whether a path is not one of a file below the project's folder."""
    parts = path.split("/")
    return not path.isprintable() or any(part in ("", ".", "..", "~") for part in parts)


def upstream(records: Mapping[str, Record], outputs: Iterable[str]) -> list[Record]:
    """Records of some files and of all that these were made from, each after its inputs' records.

    Files without a record, such as the reference picture, are no part of it.
    """
    found: dict[str, Record] = {}
    opened: set[str] = set()  # a record that somebody forged may be behind itself
    waiting = [(output, False) for output in sorted(outputs, reverse=True)]
    while waiting:
        output, inputs_done = waiting.pop()
        if inputs_done:
            found[output] = records[output]
        elif output in records and output not in opened:
            opened.add(output)
            waiting.append((output, True))
            waiting.extend((name, False) for name in sorted(records[output].inputs, reverse=True))
    return list(found.values())


def settings_behind(chain: Iterable[Record]) -> dict[str, str]:
    """All settings that some records were given, by name, sorted.

    Where several jobs have other values of one name, all are given, with bars between them.
    """
    values: dict[str, set[str]] = {}
    for record in chain:
        for name, value in record.settings.items():
            values.setdefault(name, set()).add(value)
    return {name: " | ".join(sorted(values[name])) for name in sorted(values)}
