"""What is left of code without comments: whether two files of code do the same.

The code of a stranger is compared, never run and not even parsed.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterator
from pathlib import PurePosixPath

__all__ = ["bare_digest", "is_code"]

_FOLDERS = (".ci/", "benchmarks/", "profiles/", "src/", "tests/", "tools/", "workflow/")
_FILES = ("Makefile", "Snakefile", "pyproject.toml")
_SUFFIXES = (".pth", ".py", ".sh", ".smk")
_PLAIN = (".csv", ".md", ".png", ".rst", ".txt")
_NO_COMMENT = re.compile(r"#!|.*coding[:=]|.*\\$")


def is_code(name: str) -> bool:
    """Whether somebody who works in a copy of the project runs a file, knowingly or not.

    Parameters
    ----------
    name : str
        Its place in the project.

    Examples
    --------
    >>> is_code("profiles/default/config.yaml"), is_code("workflow/report/fig1.rst")
    (True, False)
    """
    suffix = PurePosixPath(name).suffix.lower()
    return (
        name in _FILES
        or suffix in _SUFFIXES
        or (name.startswith(_FOLDERS) and suffix not in _PLAIN)
    )


def bare_digest(data: bytes) -> str:
    r"""SHA-256 of code without empty lines and lines of comment.

    Parameters
    ----------
    data : bytes
        Python, a rule, YAML, a script or a Makefile. What is not plain text in UTF-8 counts as it
        is: other line ends and spaces are read in other ways by Python, make and a shell. So do
        comments that change how the next lines are read.

    Examples
    --------
    >>> bare_digest(b"# one\nx = 1\n") == bare_digest(b"x = 1\n\n    # two\n")
    True
    >>> bare_digest(b"# coding: utf-7\nx = 1\n") == bare_digest(b"x = 1\n")
    False
    """
    try:
        text = data.decode("utf-8")
    except UnicodeError:
        return hashlib.sha256(data).hexdigest()
    if text.replace("\n", "").replace("\t", "").isprintable():
        text = "".join(_lines(text))
    return hashlib.sha256(text.encode()).hexdigest()


def _lines(text: str) -> Iterator[str]:
    for line in text.split("\n"):
        bare = line.strip()
        if bare and not (bare.startswith("#") and not _NO_COMMENT.match(bare)):
            yield f"{line}\n"
