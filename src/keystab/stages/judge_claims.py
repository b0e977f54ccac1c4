"""Judge the claims of the paper by the tables of the study."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from keystab.stages import _run


@_run.stage
def main(argv: Sequence[str] | None = None) -> None:
    """Read claims and tables; write the ledger as CSV, JSON and Markdown; print the tally."""
    parser = _run.parser(__doc__)
    _run.required(parser, "claims", "file of claims", type=Path)
    _run.required(parser, "tables", "folder of the tables", type=Path)
    _run.required(parser, "csv", "table to write", type=Path)
    _run.required(parser, "json", "JSON to write", type=Path)
    _run.required(parser, "markdown", "Markdown to write", type=Path)
    args = parser.parse_args(argv)

    from keystab.io.tables import read_table
    from keystab.study.claims import read_claims, table_names
    from keystab.study.claims_report import write_ledger
    from keystab.study.verdicts import judge_all, tally

    claims = read_claims(args.claims)
    tables = {name: read_table(args.tables / f"{name}.csv") for name in table_names(claims)}
    judgements = judge_all(claims, tables)
    write_ledger(judgements, args.csv, args.json, args.markdown)
    for verdict, number in tally(judgements).items():
        print(f"{number:3d} {verdict}")


if __name__ == "__main__":
    raise SystemExit(main())
