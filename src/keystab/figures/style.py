"""How the figures look: type, lines, layout, and the panels' letters and labels.

Text is 7 pt or more at the width of two paper columns. `keystab.figures.palette` holds the colours.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from keystab.figures.palette import GREY, INK

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

WIDTH = 7.0
"""Width of a two-column figure in inches."""

SMALL, NORMAL = 7.0, 8.0
"""Type sizes in points: annotations and tick labels; axis labels and titles."""

_FOOT = 0.14
"""Height in inches of the line that marks a draft."""

METHOD_NAMES = {
    "sampled": "sampled kernel",
    "dct": "DCT",
    "discrete_analogue": "discrete analogue",
}

FEATURE_NAMES = {
    "dog": "|DoG|",
    "difference": "smallest difference",
    "laplacian": "3D Laplacian",
    "condition": "condition number",
}

N_SPO = "$n_{\\mathrm{spo}}$"
DELTA_MIN = "$\\delta_{\\mathrm{min}}$"
N_INTERP = "$N_{\\mathrm{interp}}$"
M_OFFSET = "$M_{\\mathrm{offset}}$"
"""The paper's symbols."""

N_SPO_AXIS = f"{N_SPO} (scales per octave)"
N_INTERP_AXIS = f"{N_INTERP} (models at most)"
BLUR_AXIS = "camera blur $c$ (px)"
KAPPA_AXIS = "ratio of the two blurs $\\kappa$"
NOISE_AXIS = "noise (grey range = 1)"
VIEWS_AXIS = "views that see it, at least (%)"
UNIQUE_AXIS = "unique keypoints (%)"
CHANGES_AXIS = "new and lost extrema (%)"
ALWAYS_AXIS = "found at all samplings (%)"
AREA_AXIS = "area under the ROC curve"
RIGHT_AXIS = "recall, precision (%)"
"""Axes that several figures have: the same one has the same name everywhere."""

COARSE: Any = (0, (2.5, 1.2))
"""Dashed, in all figures: a coarse sampling beside a fine one."""

REFERENCE = ":"
"""Dotted, in all figures: what others are compared with, such as theory, the paper, chance."""

_RC: dict[str, Any] = {
    "font.family": "DejaVu Sans",
    "mathtext.fontset": "dejavusans",
    "font.size": NORMAL,
    "axes.titlesize": NORMAL,
    "axes.labelsize": NORMAL,
    "xtick.labelsize": SMALL,
    "ytick.labelsize": SMALL,
    "legend.fontsize": SMALL,
    "text.color": INK,
    "axes.labelcolor": INK,
    "axes.edgecolor": INK,
    "xtick.color": INK,
    "ytick.color": INK,
    "axes.axisbelow": True,
    "axes.linewidth": 0.6,
    "axes.titlepad": 4.0,
    "axes.labelpad": 2.5,
    "axes.unicode_minus": True,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "xtick.minor.width": 0.4,
    "ytick.minor.width": 0.4,
    "xtick.major.size": 3.0,
    "ytick.major.size": 3.0,
    "xtick.minor.size": 1.6,
    "ytick.minor.size": 1.6,
    "xtick.major.pad": 2.0,
    "ytick.major.pad": 2.0,
    "patch.edgecolor": "white",
    "patch.force_edgecolor": True,
    "lines.solid_capstyle": "round",
    "lines.linewidth": 1.5,
    "lines.markersize": 3.5,
    "figure.dpi": 100.0,
    "savefig.dpi": 300.0,
    "figure.constrained_layout.use": True,
    "pdf.fonttype": 42,
    "pdf.compression": 6,
    "svg.hashsalt": "keystab",
}


@contextmanager
def context(draft: bool = False) -> Iterator[None]:
    """Apply the style inside a ``with`` block, whatever the reader's own matplotlib settings are.

    Parameters
    ----------
    draft : bool
        Write letters into a PDF as shapes, not as fonts.

    Examples
    --------
    >>> import matplotlib
    >>> with context():
    ...     matplotlib.rcParams["pdf.fonttype"]
    42
    """
    import matplotlib

    with matplotlib.rc_context():
        matplotlib.rcdefaults()
        matplotlib.rcParams.update(_RC)
        if draft:
            matplotlib.rcParams["pdf.fonttype"] = 3
        yield


def new_figure(height: float, width: float = WIDTH) -> Figure:
    """Return an empty figure of the paper's width; it belongs to no window and no global state.

    Parameters
    ----------
    height, width : float
        Size in inches.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def settle(figure: Figure, draft: bool = False) -> Figure:
    """Compute a figure's layout once and keep it; return the figure.

    The layout engine starts from the layout that it finds, so that a figure written a second time
    would differ in the last digits of its positions from the first.

    Parameters
    ----------
    figure : matplotlib Figure
        From `new_figure`, with everything drawn.
    draft : bool
        Add a line at the foot that says that the numbers come from quick settings.
    """
    if draft:
        width, height = figure.get_size_inches()
        foot = _FOOT / (height + _FOOT)
        figure.set_size_inches(width, height + _FOOT)
        figure.get_layout_engine().set(rect=(0.0, foot, 1.0, 1.0 - foot))
        place = {"ha": "right", "va": "bottom", "label": "draft", "in_layout": False}
        text = "draft: quick settings"
        figure.text(0.995, 0.02 / height, text, fontsize=SMALL, color=GREY, **place)
    figure.draw_without_rendering()
    figure.set_layout_engine("none")
    return figure


def panels(place: Any, rows: int, columns: int, **options: Any) -> NDArray[Any]:
    """Divide a cell of a figure's grid into panels.

    Parameters
    ----------
    place : matplotlib SubplotSpec
        The cell, for example ``figure.add_gridspec(2, 1)[0]``.
    rows, columns : int
        Number of panels.
    **options
        ``sharex``, ``sharey`` or the grid's ratios and spaces.

    Returns
    -------
    ndarray of matplotlib Axes, shape (rows, columns)
    """
    shared = {name: options.pop(name) for name in ("sharex", "sharey") if name in options}
    grid = place.subgridspec(rows, columns, **options)
    axes: NDArray[Any] = grid.subplots(squeeze=False, **shared)
    return axes


def letter(ax: Axes, name: str, title: str = "") -> None:
    """Write a panel's letter, bold, and a short title at the panel's top left.

    Parameters
    ----------
    ax : matplotlib Axes
        The panel; its ``label`` becomes `name`, by which tests and callers find it.
    name : str
        One letter.
    title : str
        What the panel shows, in a few words.
    """
    ax.set_label(name)
    ax.set_title(f"$\\bf{{({name})}}$  {title}".rstrip(), loc="left")


def finish_axes(*axes: Axes) -> None:
    """Remove the top and right edges of panels."""
    for ax in axes:
        ax.spines[["top", "right"]].set_visible(False)


def direct_label(
    ax: Axes,
    x: float,
    y: float,
    text: str,
    colour: str,
    right: float = 0.0,
    up: float = 0.0,
    **options: Any,
) -> None:
    """Write a line's name beside it, in its colour.

    Parameters
    ----------
    ax : matplotlib Axes
        The panel.
    x, y : float
        The point to label, in data coordinates.
    text, colour : str
        What to write, and the colour of the line.
    right, up : float
        Distance from the point in typographic points.
    **options
        Passed on to matplotlib's text; right-aligned and vertically centred unless told otherwise.
    """
    defaults: dict[str, Any] = {"fontsize": SMALL, "color": colour, "va": "center", "ha": "right"}
    ax.annotate(text, (x, y), (right, up), textcoords="offset points", **(defaults | options))


def log_x_axis(ax: Axes, low: float, high: float) -> None:
    """Make the horizontal axis logarithmic, with labels that stay apart whatever its range.

    Parameters
    ----------
    ax : matplotlib Axes
        The panel.
    low, high : float
        Range of the data, > 0: powers of ten are labelled where it holds two or more, otherwise
        numbers such as 0.2 and 0.5 as well.
    """
    ax.set_xscale("log")
    _label_log_axis(ax.xaxis, low, high)


def log_y_axis(ax: Axes, low: float, high: float) -> None:
    """Do what `log_x_axis` does for the vertical axis, and make it as long as the range."""
    ax.set_yscale("log")
    _label_log_axis(ax.yaxis, low, high)
    ax.set_ylim(low, high)


def _label_log_axis(axis: Any, low: float, high: float) -> None:
    """Label powers of ten, or more numbers where there are less than two."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    axis.set_minor_formatter(NullFormatter())
    if np.floor(np.log10(high)) - np.ceil(np.log10(low)) < 1:
        axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))


def limit(value: float) -> str:
    """Write a limit of the refinement: a number, or the sign for none.

    Examples
    --------
    >>> limit(2.0), limit(0.5), limit(float("inf"))
    ('2', '0.5', '∞')
    """
    return "∞" if np.isinf(value) else f"{value:g}"


def ratio_name(kappa: float) -> str:
    """Write a ratio as the root of 2 that it is, or as a number where it is none.

    Examples
    --------
    >>> ratio_name(2 ** (1 / 3)), ratio_name(1.3)
    ('$2^{1/3}$', '1.3')
    """
    root = 1 / np.log2(kappa)
    if abs(root - round(root)) < 1e-6:
        return f"$2^{{1/{round(root)}}}$"
    return f"{kappa:.4g}"


def sampling_axis(ax: Axes, samplings: Iterable[int]) -> None:
    """Make the horizontal axis one of scales per octave, with a tick at every or every other one.

    Parameters
    ----------
    ax : matplotlib Axes
        The panel.
    samplings : iterable of int
        The values of ``n_spo`` that the panel shows.
    """
    ticks = sorted({int(n_spo) for n_spo in samplings})
    ax.set_xticks(ticks[:: 1 if len(ticks) <= 10 else 2])
    ax.set_xlabel(N_SPO_AXIS)


def spread(
    places: Sequence[float], gap: float, low: float = -np.inf, high: float = np.inf
) -> NDArray[np.float64]:
    """Move places as little as possible, so that they keep a distance; their order stays.

    Parameters
    ----------
    places : sequence of float
        Where they would be.
    gap : float
        Least distance of neighbours.
    low, high : float
        Where they must stay, as far as there is room.

    Returns
    -------
    ndarray
        The places nearest to the given ones in the sense of least squares, in the same order.

    Examples
    --------
    >>> spread([0.5, 0.5, 0.9], 0.2, 0.0, 1.0).round(2).tolist()
    [0.4, 0.6, 0.9]
    >>> spread([0.9, 1.0], 0.2, 0.0, 1.0).round(2).tolist()
    [0.8, 1.0]
    """
    wanted = np.asarray(places, dtype=float)
    order = np.argsort(wanted, kind="stable")
    steps = gap * np.arange(len(wanted))
    free = _ascending(wanted[order] - steps)
    result = np.empty(len(wanted))
    result[order] = np.clip(free, low, max(low, high - steps[-1])) + steps
    return result


def _ascending(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the ascending numbers nearest to given ones in the sense of least squares.

    By the max-min formula of isotonic regression, which for a dozen numbers takes less than the
    import of `scipy.optimize.isotonic_regression`.
    """
    n = len(values)
    means = {(j, k): values[j : k + 1].mean() for j in range(n) for k in range(j, n)}
    return np.array(
        [max(min(means[j, k] for k in range(i, n)) for j in range(i + 1)) for i in range(n)]
    )
