"""Bring docs/claims_pictures.csv and .md up to date.

python tools/claims_pictures.py           write them
python tools/claims_pictures.py --check   say whether they are what results/reference says

The study's own picture has the numbers of `results/reference`. The others have those of
`results/claims_pictures.*` where `make results/claims_pictures.md` made them, else they stay.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

import pandas as pd

from keystab.errors import InputError
from keystab.io.tables import read_table, write_table
from keystab.study.claims_by_scene import (
    OF_PICTURE,
    pictures_of,
    read_report,
    run_of,
    side_by_side,
    to_markdown,
)
from keystab.study.plain_yaml import read_plain_yaml

ROOT = Path(__file__).parents[1]
PAGES = ROOT / "docs"
REFERENCE = ROOT / "results/reference/claims.csv"
OWN = Path(str(read_plain_yaml(ROOT / "config/config.yaml")["reference"])).stem
RUN = re.compile(r"^\| (\w+) \| ((?:\*Draft\.\* )?Picture: .*) \|$", re.MULTILINE)


def up_to_date(folder: Path) -> tuple[pd.DataFrame, str]:
    """Table and page of a folder, with what the reference results say of the study's picture."""
    table = read_table(folder / "claims_pictures.csv").astype(object).fillna("").astype(str)
    runs = dict(RUN.findall((folder / "claims_pictures.md").read_text(encoding="utf-8")))
    reports = {}
    for name in pictures_of(table):
        names = {f"{name}_{what}": what for what in OF_PICTURE}
        reports[name] = table.rename(columns=names)
    reports[OWN], runs[OWN] = read_report(REFERENCE), run_of(REFERENCE)
    table = side_by_side(reports)
    return table, to_markdown(table, {name: runs.get(name, "not recorded") for name in reports})


def main(argv: list[str]) -> int:
    """Write or check; returns the exit status."""
    made = ROOT / "results"
    new = (made / "claims_pictures.md").exists() and "--check" not in argv
    csv, page = PAGES / "claims_pictures.csv", PAGES / "claims_pictures.md"
    try:
        table, text = up_to_date(made if new else PAGES)
    except InputError as problem:
        print(f"error: {problem}", file=sys.stderr)
        return 2
    if "--check" not in argv:
        write_table(table, csv)
        page.write_text(text, encoding="utf-8")
        return 0
    same = page.read_text(encoding="utf-8") == text
    kept = read_table(csv).astype(object).fillna("").astype(str)
    if same and kept.equals(table.astype(str)):
        return 0
    print("docs/claims_pictures is out of date: python tools/claims_pictures.py")
    return 1


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
