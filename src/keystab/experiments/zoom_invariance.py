r"""The invariance of true extrema to zoom-outs, which section 3.2 of the paper proves.

The theorem: with a known Gaussian blur and well sampled views, an extremum at scale
:math:`\sigma_1` of one view is an extremum at :math:`\sigma_2` of the other with
:math:`\lambda \sigma_1 = \mu \sigma_2`, :math:`\lambda` and :math:`\mu` being the zooms. The
extrema here are those of the continuous scale-spaces of the views' own cosine series, so that no
sampling of the scale-space, no refinement and no tolerance stands between them and the theorem.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from keystab.camera.simulation import Scene, simulate, whole_shape
from keystab.camera.views import ViewSpec
from keystab.evaluation.intervals import wilson_interval
from keystab.experiments.interpolation_stability import rank_interval
from keystab.matching.common_range import CommonRange
from keystab.matching.correspondence import pairs_between

#: Margin in units of the largest blur; scales beyond the range at which counterparts are sought.
_MARGIN, _BEYOND = 6.0, 1.05

#: By how much the first view is finer than the one that is given.
_FINER = 2.5


def zoomed_views(
    spec: ViewSpec,
    zooms: Sequence[float],
    reference_shape: tuple[int, int],
    sigma_min: float,
    kappa: float,
) -> tuple[CommonRange, list[tuple[float, float]]]:
    """Views of the whole scene at several zooms, what is compared, and where extrema are sought.

    Parameters
    ----------
    spec : ViewSpec
        A view of the whole scene. The first view here is finer, for more extrema.
    zooms : sequence of float
        Zooms of the others against the first, above 1.
    reference_shape : tuple of int
        Height and width of the reference in pixels.
    sigma_min : float
        First scale of every view, in its pixels.
    kappa : float
        Ratio of the two blurs.

    Returns
    -------
    everywhere : CommonRange
        The views, and one octave of scales from the first that all of them have; its margin is six
        times the largest blur, so that no border matters.
    ends : list of (float, float)
        Scales of each view, in its pixels, that hold this octave with 5 % on either side.

    Examples
    --------
    >>> spec = ViewSpec(blur=1.1, step=10.0, shape=(100, 150))
    >>> everywhere, ends = zoomed_views(spec, [1.5], (1000, 1500), 1.1, 1.25)
    >>> everywhere.specs[1].shape, everywhere.margin, ends[1][0].__round__(9)
    ((166, 250), 26.0, 1.1)
    """
    steps = [spec.step / _FINER * zoom for zoom in (1.0, *zooms)]
    specs = [replace(spec, step=s, shape=whole_shape(reference_shape, s)) for s in steps]
    low = _BEYOND * sigma_min * max(1.0, *zooms)
    margin = math.ceil(_MARGIN * kappa * 2 * low)
    everywhere = CommonRange(specs, reference_shape, float(margin), low, 2 * low)
    ratios = [view.step / specs[0].step for view in specs]
    return everywhere, [(low / _BEYOND / r, 2 * low * _BEYOND / r) for r in ratios]


ExtremaOf = Callable[[NDArray[np.float64], float, float, float, float], pd.DataFrame]
"""True extrema of an image: its blur, first and last scale, ratio of the two blurs."""


def zoomed_truth(
    scene: Scene,
    spec: ViewSpec,
    zooms: Sequence[float],
    kappas: Sequence[float],
    sigma_min: float,
    extrema_of: ExtremaOf,
) -> pd.DataFrame:
    """Find the true extrema of zoomed views, and hold them against each other.

    Parameters
    ----------
    scene : Scene
        What the camera looks at.
    spec, zooms, sigma_min
        See `zoomed_views`.
    kappas : sequence of float
        Ratios of the two blurs, one after the other.
    extrema_of : callable
        Finds the true extrema of an image, `keystab.true_extrema`.

    Returns
    -------
    DataFrame
        ``kappa`` and the columns of `zoom_table`.
    """
    tables = []
    for kappa in kappas:
        everywhere, ends = zoomed_views(spec, zooms, scene.shape, sigma_min, kappa)
        true = [
            extrema_of(simulate(scene, view), view.blur, low, high, kappa)
            for view, (low, high) in zip(everywhere.specs, ends, strict=True)
        ]
        tables.append(zoom_table(true, everywhere, {"kappa": kappa}))
    return pd.concat(tables, ignore_index=True)


def zoom_table(
    extrema: Sequence[pd.DataFrame], everywhere: CommonRange, labels: Mapping[str, float]
) -> pd.DataFrame:
    r"""Hold the true extrema of zoomed views against those of the first.

    Parameters
    ----------
    extrema : sequence of DataFrame
        ``y, x, sigma, sign`` of every view, in its pixels.
    everywhere : CommonRange
        Field of view and range of scales of all views; counterparts may lie beyond its scales.
    labels : mapping
        Columns to put before the others.

    Returns
    -------
    DataFrame
        One row per view but the first: `labels`; ``zoom``; of the ``n_first`` extrema of the first
        view the share ``share_found`` with an extremum of the same sign nearer than the limits of
        equation 22, with its 95 % Wilson interval ``low_found, high_found``; of the nearest ones
        ``scale_residual``, the median of :math:`|\mu \sigma_2 / \lambda \sigma_1 - 1|`, and
        ``location_residual``, that of the distance over :math:`\sigma_1`; ``q95_scale,
        q95_location``, the quantiles of 95 %, with 95 % intervals by ranks ``low_scale, high_scale,
        low_location, high_location``. NaN where there is none.

    Examples
    --------
    >>> from keystab.camera.views import ViewSpec
    >>> views = [ViewSpec(1.1, step, (60, 60)) for step in (1.0, 1.5)]
    >>> ends = CommonRange(views, (60, 60), 0.0, 1.0, 9.0)
    >>> first = pd.DataFrame({"y": [29.5, 35.5], "x": [29.5, 29.5], "sigma": [3.0, 6.0]})
    >>> other = pd.DataFrame({"y": [29.5, 33.5], "x": [29.5, 29.5], "sigma": [2.0, 4.04]})
    >>> table = zoom_table([first.assign(sign=1), other.assign(sign=1)], ends, {})
    >>> table[["share_found", "scale_residual", "location_residual"]].round(3).to_numpy().tolist()
    [[1.0, 0.005, 0.0]]
    """
    joined = pd.concat(
        [table.assign(view=number) for number, table in enumerate(extrema)], ignore_index=True
    )
    common = replace(everywhere, low=0.0, high=np.inf).common(joined)
    first = common[common["view"] == 0]
    first = first[first["sigma"].between(everywhere.low, everywhere.high)].reset_index(drop=True)
    rows = []
    for number, spec in enumerate(everywhere.specs[1:], 1):
        other = common[common["view"] == number].reset_index(drop=True)
        i, j, apart = pairs_between(first, other, match_sign=True)
        nearest = pd.DataFrame({"i": i, "j": j, "apart": apart}).sort_values(["apart", "i", "j"])
        nearest = nearest.drop_duplicates("i")
        one, two = first.iloc[nearest["i"]], other.iloc[nearest["j"]]
        sigma = one["sigma"].to_numpy()
        scale = np.abs(two["sigma"].to_numpy() / sigma - 1)
        distance = np.hypot(*(one[c].to_numpy() - two[c].to_numpy() for c in ("y", "x"))) / sigma
        low, high = wilson_interval(len(nearest), len(first))
        rows.append(
            {
                **labels,
                "zoom": spec.step / everywhere.specs[0].step,
                "n_first": len(first),
                "share_found": len(nearest) / len(first) if len(first) else np.nan,
                "low_found": float(low),
                "high_found": float(high),
                **_residuals("scale", scale),
                **_residuals("location", distance),
            }
        )
    return pd.DataFrame(rows)


def _residuals(name: str, values: NDArray[np.float64]) -> dict[str, float]:
    ends = zip(
        (f"q95_{name}", f"low_{name}", f"high_{name}"), rank_interval(values, 0.95), strict=True
    )
    return {f"{name}_residual": rank_interval(values)[0], **dict(ends)}
