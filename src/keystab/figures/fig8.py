"""Figure 8: stability and precision when the camera zooms out (section 5.5)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from keystab.figures._render import Tables, check_tables, main
from keystab.figures._stability_panels import CURVE, PRECISION, views_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

TABLES = {
    "fig8_curves.csv": ("n_spo", "detections", *CURVE),
    "fig8_precision.csv": PRECISION,
}
"""Files read, with the columns that they must have."""


def draw(tables: Tables, draft: bool = False) -> Figure:
    """Draw stability curves of discrete and refined extrema, and their precision.

    Parameters
    ----------
    tables : mapping
        ``fig8_curves``: stability curves at a coarse and a fine sampling; ``fig8_precision``: one
        row per sampling, kind of detection and quantity.
    draft : bool
        Say on the figure that its numbers come from quick settings.

    Returns
    -------
    matplotlib Figure
        a: stability curves, with the number of keypoints seen in all views; b: precision of the
        location; c: of the scale.

    Raises
    ------
    InputError
        If a table is unusable.
    """
    check_tables(tables, TABLES)
    return views_figure(tables["fig8_curves"], tables["fig8_precision"], draft)


if __name__ == "__main__":
    raise SystemExit(main(draw, TABLES))
