"""Compare the verdicts on claims of several pictures."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from keystab.stages import _run


@_run.stage
def main(argv: Sequence[str] | None = None) -> None:
    """Read all verdicts; write one row per claim as CSV and Markdown; print what depends."""
    parser = _run.parser(__doc__)
    _run.required(parser, "ledgers", "verdicts of each picture, CSV", type=Path, nargs="+")
    _run.required(parser, "names", "names of the pictures", nargs="+")
    _run.required(parser, "csv", "table to write", type=Path)
    _run.required(parser, "markdown", "Markdown to write", type=Path)
    args = parser.parse_args(argv)

    from keystab.io.tables import write_table
    from keystab.study.claims_by_scene import read_report, side_by_side, to_markdown
    from keystab.utils.files import written_whole

    reports = {name: read_report(path) for name, path in zip(args.names, args.ledgers, strict=True)}
    table = side_by_side(reports)
    write_table(table, args.csv)
    with written_whole(args.markdown) as part:
        part.write_text(to_markdown(table), encoding="utf-8", newline="")
    depends = table.loc[table["depends"] == "yes", "id"]
    print(f"verdicts that depend on the picture: {len(depends)}", *depends)


if __name__ == "__main__":
    raise SystemExit(main())
