"""Make the small pictures of the pages of findings, docs/figures/*.png, from those of the last run.

python tools/gallery.py             after `make study`
python tools/gallery.py --overlay   that of the README, by its own commands
"""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
import tempfile
from pathlib import Path

from PIL import Image

ROOT = Path(__file__).parents[1]
WIDTH = 1400
"""Pixels: the width of a page at two pixels per point."""


def small(picture: Image.Image) -> Image.Image:
    """Shrink a figure to the width of a page, in few colours."""
    height = round(picture.height * WIDTH / picture.width)
    return few_colours(picture.convert("RGB").resize((WIDTH, height), Image.Resampling.LANCZOS))


def few_colours(picture: Image.Image) -> Image.Image:
    """Reduce a figure to 256 colours, chosen so that none is far off."""
    return picture.convert("RGB").quantize(
        256, method=Image.Quantize.MAXCOVERAGE, kmeans=2, dither=Image.Dither.NONE
    )


def overlay(out: Path) -> None:
    """Draw what the first two commands of the README do: keypoints with error bars."""
    lines = re.findall(r"^keystab (.+)$", (ROOT / "README.md").read_text(), re.MULTILINE)
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "config").symlink_to(ROOT / "config")
        for line in lines[:2]:
            command = [sys.executable, "-m", "keystab.cli", *shlex.split(line)]
            subprocess.run(command, cwd=folder, check=True)
        with Image.open(Path(folder) / "bars.png") as picture:
            few_colours(picture).save(out, optimize=True)


def main(argv: list[str]) -> int:
    """Write one small picture per figure, or that of the README."""
    if "--overlay" in argv:
        overlay(ROOT / "docs/figures/overlay.png")
        return 0
    for figure in sorted((ROOT / "figures").glob("*.png")):
        out = ROOT / "docs/figures" / figure.name
        out.parent.mkdir(parents=True, exist_ok=True)
        with Image.open(figure) as picture:
            small(picture).save(out, optimize=True)
        print(f"{out.relative_to(ROOT)}: {out.stat().st_size / 1000:.0f} kB")
    return 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
