"""List the SHA-256 of all files that the study ends in."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from keystab.stages import _run


@_run.stage
def main(argv: Sequence[str] | None = None) -> None:
    """Digest the files; write one line each, as ``sha256sum`` does."""
    parser = _run.parser(__doc__)
    _run.required(parser, "files", "files that the study ends in", type=Path, nargs="+")
    _run.required(parser, "list", "list to write", type=Path)
    args = parser.parse_args(argv)

    from keystab.io.checksums import list_of_files
    from keystab.utils.files import written_whole

    with written_whole(args.list) as part:
        part.write_text(list_of_files(args.files), encoding="utf-8", newline="")
    print(f"{len(args.files)} files")


if __name__ == "__main__":
    raise SystemExit(main())
