"""Draw the figures of docs/how_it_works, docs/figures/how_*.png, with the library itself.

python tools/explain.py           all of them, in a minute
python tools/explain.py truth     one of them
"""

from __future__ import annotations

import importlib
import io
import sys
from pathlib import Path

from PIL import Image

from keystab.figures import style

ROOT = Path(__file__).parents[1]
FIGURES = (
    "overview",
    "series",
    "camera",
    "scale_space",
    "search",
    "truth",
    "matching",
    "error_bars",
)
"""Names of the figures, each that of its module in tools/explaining."""

WIDTH = 1400
"""Pixels: the width of a page at two pixels per point."""

_COLOURS = 96


def place(name: str) -> Path:
    """File of a figure."""
    return ROOT / f"docs/figures/how_{name}.png"


def draw(name: str) -> None:
    """Draw one figure into its file, in few colours, so that it stays small."""
    drawing = importlib.import_module(f"explaining.{name}")
    whole = io.BytesIO()
    with style.context():
        figure = style.settle(drawing.draw())
        figure.savefig(whole, dpi=WIDTH / style.WIDTH, format="png")
    with Image.open(whole) as picture:
        few = picture.convert("RGB").quantize(
            _COLOURS, method=Image.Quantize.MAXCOVERAGE, kmeans=2, dither=Image.Dither.NONE
        )
    few.save(place(name), optimize=True)


def main(names: list[str]) -> int:
    """Draw the named figures, or all."""
    for name in names:
        if name not in FIGURES:
            print(f"error: {name} is no figure, allowed are {', '.join(FIGURES)}", file=sys.stderr)
            return 2
    for name in names or FIGURES:
        draw(name)
        size = place(name).stat().st_size / 1000
        print(f"{place(name).relative_to(ROOT)}: {size:.0f} kB", flush=True)
    return 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
