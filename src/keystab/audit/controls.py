"""What every audit is held against: detectors whose answers are known.

They are made of the truth itself, and show whether the measures see what they should: no error at
all, a shift, offsets that are swapped, nothing but chance.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pandas as pd

from keystab.audit.conditions import View

__all__ = ["CONTROLS"]

SHIFT = 0.25


def truth(view: View, _number: int) -> pd.DataFrame:
    """Find what is there."""
    return view.truth


def shifted(view: View, _number: int) -> pd.DataFrame:
    """Find it a quarter of a pixel too far down and right."""
    return view.truth.assign(y=view.truth["y"] + SHIFT, x=view.truth["x"] + SHIFT)


def swapped(view: View, _number: int) -> pd.DataFrame:
    """Find it with the sub-pixel offset of y in x, and that of x in y."""
    y, x = (np.round(view.truth[name]) for name in ("y", "x"))
    return view.truth.assign(y=y + view.truth["x"] - x, x=x + view.truth["y"] - y)


def random(view: View, number: int) -> pd.DataFrame:
    """Find as many points anywhere, with the scales of what is there."""
    draw = np.random.default_rng([1511, number])
    height, width = view.image.shape
    n = len(view.truth)
    return pd.DataFrame(
        {
            "y": draw.uniform(0, height - 1, n),
            "x": draw.uniform(0, width - 1, n),
            "sigma": draw.permutation(view.truth["sigma"].to_numpy()),
        }
    )


CONTROLS: dict[str, Callable[[View, int], pd.DataFrame]] = {
    "truth": truth,
    "truth + 0.25 px": shifted,
    "swapped offsets": swapped,
    "random points": random,
}
"""Controls by the name of their setting; of a view, and its number in the condition."""
