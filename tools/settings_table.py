"""Write the table of all settings in config/README.md from the schema.

python tools/settings_table.py           write it
python tools/settings_table.py --check   say whether it is up to date
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import yaml

from keystab.study.settings import allowed

ROOT = Path(__file__).parents[1]
SCHEMA = ROOT / "workflow/schemas/config.schema.yaml"
README = ROOT / "config/README.md"
BEGIN, END = "<!-- settings: begin -->\n", "<!-- settings: end -->\n"


def rows(schema: dict[str, Any], place: str = "") -> Iterator[str]:
    """One row of the table per setting, blocks in bold."""
    for key, part in schema.get("properties", {}).items():
        name = f"{place}{key}"
        if part.get("type") == "object":
            yield f"| **{name}** | {part['description']} | | |"
            inside = part if part.get("properties") else part["additionalProperties"]
            yield from rows(inside, f"{name}." if part.get("properties") else f"{name}.NAME.")
        else:
            default = yaml.safe_dump(part["default"], default_flow_style=True, width=10**6)
            default = default.splitlines()[0]
            yield f"| `{name}` | {part['description']} | {allowed(part)} | `{default}` |"


def table() -> str:
    """The whole table."""
    head = "| setting | meaning | allowed | default |\n|---|---|---|---|\n"
    return head + "\n".join(rows(yaml.safe_load(SCHEMA.read_text()))) + "\n"


def main() -> int:
    """Write or check the table."""
    text = README.read_text()
    before, rest = text.split(BEGIN)
    new = before + BEGIN + table() + END + rest.split(END)[1]
    if "--check" not in sys.argv:
        README.write_text(new)
    elif new != text:
        print(f"{README} is out of date: python tools/settings_table.py", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
