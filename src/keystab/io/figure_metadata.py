"""What a figure says of itself in its metadata: what it was drawn by and from.

It holds no time and no folder, so that the same tables, code and libraries give the same
bytes. All settings but a figure's own reach it through its tables, whose digests it holds. A
setting that changed anything in the figure changed one of them, and a setting that has nothing to
do with the figure changes not a byte.
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
import re
from collections.abc import Iterable, Mapping
from pathlib import Path

from keystab.errors import InputError

__all__ = ["PNG_KEY", "FigureMetadata", "digests_of"]

PNG_KEY = "keystab"
"""Text chunk of a PNG that holds them; a PDF has it in ``/Keywords`` of its ``/Info``."""

_DIGEST = re.compile("[0-9a-f]{64}")
_NAME = re.compile(r"[A-Za-z0-9]\w*", re.ASCII)
_FILE = re.compile(r"\w[\w.+-]*")


@dataclasses.dataclass(frozen=True)
class FigureMetadata:
    """What one figure was drawn by and from.

    Parameters
    ----------
    figure : str
        Its name, such as ``fig5``.
    version : str
        Version of keystab.
    code : str or None
        Fingerprint of the code that drew it (`keystab.provenance.code_digest`); None where it was
        drawn by hand, outside the workflow.
    lock : str or None
        SHA-256 of ``environment.lock``; None where it was drawn by hand.
    settings : mapping from str to str
        The figure's own settings.
    tables : mapping from str to str
        SHA-256 of each table by its file name.
    """

    figure: str
    version: str
    code: str | None
    lock: str | None
    settings: Mapping[str, str]
    tables: Mapping[str, str]

    @property
    def config(self) -> str:
        """SHA-256 that stands for all settings: the figure's own, and what others made of tables.

        Examples
        --------
        >>> tables = {"fig1.csv": 64 * "0"}
        >>> one = FigureMetadata("fig1", "0.1.0", None, None, {"draft": "False"}, tables)
        >>> other = dataclasses.replace(one, tables={"fig1.csv": 64 * "1"})
        >>> one.config == other.config
        False
        """
        text = _canonical({"settings": dict(self.settings), "tables": dict(self.tables)})
        return hashlib.sha256(text.encode()).hexdigest()

    def to_text(self) -> str:
        """Write it as one line of JSON in ASCII, with sorted names."""
        return _canonical({**dataclasses.asdict(self), "config": self.config})

    @classmethod
    def from_text(cls, text: str) -> FigureMetadata:
        """Read what `to_text` wrote.

        Raises
        ------
        InputError
            If the text is none of these, or its digests do not belong together.
        """
        try:
            fields = json.loads(text)
            config = fields.pop("config")
            metadata = cls(**fields)
            # Names become paths: a stranger's must not lead elsewhere.
            sound = (
                isinstance(metadata.settings, dict)
                and _NAME.fullmatch(metadata.figure)
                and isinstance(metadata.version, str)
                and all(map(_FILE.fullmatch, metadata.tables))
                and all(map(_DIGEST.fullmatch, metadata.tables.values()))
                and all(_DIGEST.fullmatch(it) for it in (metadata.code, metadata.lock) if it)
            )
        except (ValueError, TypeError, AttributeError, KeyError, RecursionError):
            raise InputError("no metadata of keystab") from None
        if not sound or config != metadata.config:
            raise InputError("its metadata were changed by hand or damaged")
        return metadata


def digests_of(files: Iterable[Path]) -> dict[str, str]:
    """SHA-256 of files by their names.

    Examples
    --------
    >>> import tempfile
    >>> path = Path(tempfile.mkdtemp()) / "empty.csv"
    >>> path.touch()
    >>> digests_of([path])["empty.csv"][:8]
    'e3b0c442'
    """
    digests = {}
    for path in files:
        with path.open("rb") as file:
            digests[path.name] = hashlib.file_digest(file, "sha256").hexdigest()
    return digests


def _canonical(value: object) -> str:
    return json.dumps(value, sort_keys=True, separators=(",", ":"), ensure_ascii=True)
