"""Say what claims are over the scenes of the corpus."""

from pathlib import Path

from keystab.utils.stage_command import command


@command
def main(
    verdicts: list[Path],
    names: list[str],
    families: list[str],
    *,
    csv: Path,
    json: Path,
    markdown: Path,
    over_scenes: Path,
    by_family: Path,
    numbers: Path,
) -> None:
    """Read the verdicts of every scene; write one row per claim and scene, and what they say."""
    from keystab.io.tables import write_table
    from keystab.study import scene_verdicts
    from keystab.study.claims_by_scene import read_report, run_of
    from keystab.study.scene_numbers import over_families
    from keystab.study.scene_report import to_markdown
    from keystab.utils.files import written_whole

    reports = {name: read_report(path) for name, path in zip(names, verdicts, strict=True)}
    table = scene_verdicts.long_table(reports, dict(zip(names, families, strict=True)))
    claims, means = scene_verdicts.over_scenes(table), over_families(table)
    write_table(table, csv)
    write_table(claims, over_scenes)
    write_table(scene_verdicts.by_family(claims), by_family)
    write_table(means, numbers)
    first = next(iter(reports.values()))
    statements = dict(zip(first["id"], first["statement"], strict=True))
    runs = {name: run_of(path) for name, path in zip(names, verdicts, strict=True)}
    texts = {
        json: claims.to_json(orient="records", indent=1),
        markdown: to_markdown(claims, statements, runs),
    }
    for path, text in texts.items():
        with written_whole(path) as part:
            part.write_text(text, encoding="utf-8", newline="")
    print(claims["kind"].value_counts().to_string())
