"""Compare the verdicts on the claims for several pictures."""

from pathlib import Path

from keystab.utils.stage_command import command


@command
def main(verdicts: list[Path], names: list[str], *, csv: Path, markdown: Path) -> None:
    """Read the verdicts; write one row per claim as CSV and Markdown; print what depends."""
    from keystab.io.tables import write_table
    from keystab.study.claims_by_scene import read_report, run_of, side_by_side, to_markdown
    from keystab.utils.files import written_whole

    reports = dict(zip(names, verdicts, strict=True))
    table = side_by_side({name: read_report(path) for name, path in reports.items()})
    runs = {name: run_of(path) for name, path in reports.items()}
    write_table(table, csv)
    with written_whole(markdown) as part:
        part.write_text(to_markdown(table, runs), encoding="utf-8", newline="")
    depends = table.loc[table["depends"] == "yes", "id"]
    print(f"verdicts that depend on the picture: {len(depends)}", *depends)
