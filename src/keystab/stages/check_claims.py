"""Check the claims of the paper against the tables of the study."""

from pathlib import Path

from keystab.utils.stage_command import command


@command
def main(claims: Path, tables: list[Path], *, csv: Path, json: Path, markdown: Path) -> None:
    """Read claims and tables; write the verdicts as CSV, JSON and Markdown; print the tally."""
    from keystab.errors import InputError
    from keystab.io.tables import read_table
    from keystab.study.claims import read_claims, table_names
    from keystab.study.claims_report import write_report
    from keystab.study.verdicts import outcomes_of, tally

    asked, files = read_claims(claims), {path.stem: path for path in tables}
    lacking = [f"{name}.csv" for name in table_names(asked) if name not in files]
    if lacking:
        raise InputError(f"{claims} asks for {', '.join(lacking)}: name them with --tables")
    found = outcomes_of(asked, {name: read_table(files[name]) for name in table_names(asked)})
    write_report(found, csv, json, markdown)
    for verdict, number in tally(found).items():
        print(f"{number:3d} {verdict}")
