"""Make the small pictures of the README, docs/figures/*.png, from the figures of the last run.

python tools/gallery.py    after `make study`
"""

from __future__ import annotations

from pathlib import Path

from PIL import Image

ROOT = Path(__file__).parents[1]
WIDTH = 1400
"""Pixels: the width of a page at two pixels per point."""


def small(picture: Image.Image) -> Image.Image:
    """Shrink a figure to the width of a page and to 256 colours, chosen so that none is far off."""
    height = round(picture.height * WIDTH / picture.width)
    picture = picture.convert("RGB").resize((WIDTH, height), Image.Resampling.LANCZOS)
    return picture.quantize(
        256, method=Image.Quantize.MAXCOVERAGE, kmeans=2, dither=Image.Dither.NONE
    )


def main() -> int:
    """Write one small picture per figure."""
    for figure in sorted((ROOT / "figures").glob("*.png")):
        out = ROOT / "docs/figures" / figure.name
        out.parent.mkdir(parents=True, exist_ok=True)
        with Image.open(figure) as picture:
            small(picture).save(out, optimize=True)
        print(f"{out.relative_to(ROOT)}: {out.stat().st_size / 1000:.0f} kB")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
