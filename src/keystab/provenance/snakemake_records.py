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

__all__ = ["FOLDER", "Record", "read_records", "settings_behind", "upstream"]

FOLDER = Path(".snakemake/metadata")
"""Where the records lie, within the project's folder."""

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


def upstream(records: Mapping[str, Record], outputs: Iterable[str]) -> list[Record]:
    """Records of some files and of all that these were made from, each after its inputs' records.

    Files without a record, such as the reference picture, are no part of it.
    """
    found: dict[str, Record] = {}
    waiting = [(output, False) for output in sorted(outputs, reverse=True)]
    while waiting:
        output, inputs_done = waiting.pop()
        if output in found or output not in records:
            continue
        if inputs_done:
            found[output] = records[output]
        else:
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
