"""Write what was found of all detectors into docs/audit.md, from the tables of `make audit`.

python tools/audit_page.py           write it
python tools/audit_page.py --check   say whether it is what results/reference/audit says
"""

from __future__ import annotations

import sys
from pathlib import Path

import pandas as pd

from keystab.audit.page import as_table, findings
from keystab.audit.run import CONTROL
from keystab.io.tables import read_table

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs/audit.md"
BEGIN, END = "<!-- audit: begin -->\n", "<!-- audit: end -->\n"


def found(table: pd.DataFrame) -> str:
    """Tables of controls and detectors, and what was found of each detector."""
    own = table[table["detector"] != CONTROL]
    parts = [
        "## Controls",
        as_table(table[table["detector"] == CONTROL]),
        "## Detectors",
        as_table(own),
    ]
    for name, settings in own.groupby("detector", sort=False):
        parts.append(f"### {name}")
        parts.append(f"`keystab audit {name} --scene config/images/coldwarm.png -o audit`")
        for setting, rows in settings.groupby("setting", sort=False):
            lines = "\n".join(f"- {line}" for line in findings(rows))
            parts.append(f"**{setting}**\n\n{lines}")
    return "\n\n".join(parts) + "\n"


def page(text: str, table: pd.DataFrame) -> str:
    """The page with what a table says between its marks."""
    head, _, rest = text.partition(BEGIN)
    return head + BEGIN + found(table) + END + rest.partition(END)[2]


def main(argv: list[str]) -> int:
    """Write or check; returns the exit status."""
    text = PAGE.read_text(encoding="utf-8")
    if "--check" in argv:
        reference = ROOT / "results/reference/audit/audit.csv"
        same = page(text, read_table(reference)) == text
        print("docs/audit.md is up to date" if same else "docs/audit.md is not up to date")
        return 0 if same else 1
    PAGE.write_text(page(text, read_table(ROOT / "results/tables/audit.csv")), encoding="utf-8")
    return 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
