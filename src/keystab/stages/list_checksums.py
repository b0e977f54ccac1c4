"""List the SHA-256 of all files that the study ends in."""

from pathlib import Path

from keystab.utils.stage_command import command


@command
def main(files: list[Path], *, checksums: Path) -> None:
    """Digest the files; write one line each, as ``sha256sum`` does."""
    from keystab.io.checksums import list_of_files
    from keystab.utils.files import written_whole

    with written_whole(checksums) as part:
        part.write_text(list_of_files(files), encoding="utf-8", newline="")
    print(f"{len(files)} files")
