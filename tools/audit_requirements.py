"""Print what the detectors of others need, the extra `audit` of pyproject.toml, one a line."""

from __future__ import annotations

import tomllib
from pathlib import Path

PROJECT = Path(__file__).parents[1] / "pyproject.toml"


def requirements() -> list[str]:
    """Requirements of the extra."""
    project = tomllib.loads(PROJECT.read_text(encoding="utf-8"))["project"]
    found: list[str] = project["optional-dependencies"]["audit"]
    return found


if __name__ == "__main__":
    print("\n".join(requirements()))
