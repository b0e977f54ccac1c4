"""Cubes of samples around keypoints, to look at their neighbourhood (section 5.4, figure 6)."""

from __future__ import annotations

import math

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from keystab.detection.extrema import extrema_of_array
from keystab.detection.refinement import quadratic_model
from keystab.errors import InputError
from keystab.evaluation.stability import label
from keystab.matching.correspondence import SCALE_RATIO, SPACE_TOLERANCE
from keystab.prediction.features import condition_numbers
from keystab.scalespace.dog import ScaleSpace, scale_space
from keystab.utils.random import random_generator

HALF = 12
"""Samples on each side of the centre: cubes of 25 x 25 x 25."""

SHARE = 0.15
"""Share of a cube's samples that lie inside its surface: shapes then compare at one size."""


def dense_scale_space(
    image: NDArray[np.float64],
    camera_blur: float,
    n_spo: int,
    sigma_min: float,
    kappa: float,
    oversampling: str,
    scale_ratio: float = SCALE_RATIO,
) -> ScaleSpace:
    """Balanced scale-space with room above the octave for an extremum and the cube around it.

    Parameters
    ----------
    image, camera_blur, n_spo, sigma_min, kappa, oversampling
        See `keystab.scalespace.dog.scale_space`.
    scale_ratio : float
        How far an extremum may be from a keypoint, see `nearest_extrema`.
    """
    reach = math.ceil(n_spo * math.log2(scale_ratio))
    return scale_space(
        image,
        camera_blur,
        n_spo=n_spo,
        sigma_min=sigma_min,
        kappa=kappa,
        oversampling=oversampling,
        slices=(0, n_spo + 2 + reach + HALF),
    )


def places(space: ScaleSpace, keypoints: pd.DataFrame) -> NDArray[np.float64]:
    """Where keypoints lie among the samples of a scale-space.

    Parameters
    ----------
    space : ScaleSpace
        First octave, from slice 0.
    keypoints : DataFrame
        Columns ``y, x, sigma`` in input pixels.

    Returns
    -------
    ndarray, shape (n, 3)
        Slice, row and column, with fractions; they may lie outside the scale-space.

    Examples
    --------
    >>> space = scale_space(np.eye(12), camera_blur=0.5, n_spo=10, sigma_min=1.0)
    >>> keypoints = pd.DataFrame({"y": [0.0], "x": [5.0], "sigma": [2.0]})
    >>> places(space, keypoints).round(1).tolist()
    [[10.0, 0.0, 39.1]]
    """
    sampling = space.sampling
    s = sampling.n_spo * np.log2(keypoints["sigma"] / sampling.sigma_min)
    return np.stack([s, keypoints["y"] / sampling.step, keypoints["x"] / sampling.step], axis=1)


def drawn(
    keypoints: pd.DataFrame,
    space: ScaleSpace,
    stable_above: float,
    unstable_below: float,
    per_group: int,
) -> pd.DataFrame:
    """Draw stable and unstable keypoints by lot, among those whose cube lies in the scale-space.

    Parameters
    ----------
    keypoints : DataFrame
        Columns ``keypoint, y, x, sigma, stability``.
    space : ScaleSpace
        From `dense_scale_space`.
    stable_above, unstable_below : float
        See `keystab.evaluation.stability.label`.
    per_group : int
        How many of each to draw; all where there are fewer.

    Returns
    -------
    DataFrame
        The drawn rows with their ``group``, stable ones first, most stable first. The lot is the
        same in every run.

    Raises
    ------
    InputError
        If no stable or no unstable keypoint has room for a cube.
    """
    centre = np.rint(places(space, keypoints)).astype(np.int64)
    fits = ((centre >= HALF) & (centre + HALF < np.array(space.shape))).all(axis=1)
    labels = label(keypoints["stability"], stable_above, unstable_below)
    groups = []
    for group in ("stable", "unstable"):
        candidates = np.flatnonzero(fits & (labels == group))
        if not candidates.size:
            raise InputError(
                f"no {group} keypoint has room for a cube of {2 * HALF + 1} samples: raise "
                "cubes.n_spo, compare more samplings, or take a larger view"
            )
        lot = random_generator("figure 6", group).permutation(candidates)[:per_group]
        members = keypoints.iloc[lot].assign(group=group)
        groups.append(members.sort_values(["stability", "keypoint"], ascending=[False, True]))
    return pd.concat(groups, ignore_index=True)


def nearest_extrema(
    space: ScaleSpace,
    keypoints: pd.DataFrame,
    space_tolerance: float = SPACE_TOLERANCE,
    scale_ratio: float = SCALE_RATIO,
) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Extremum of the dense scale-space that belongs to each keypoint, if there is one.

    Parameters
    ----------
    space : ScaleSpace
        From `dense_scale_space`.
    keypoints : DataFrame
        Columns ``y, x, sigma`` in input pixels, and ``sign``: +1 for maxima, -1 for minima.
    space_tolerance, scale_ratio : float
        How far an extremum may be, see `keystab.matching.correspondence.same`: the same in pixels
        and octaves at every density.

    Returns
    -------
    samples : ndarray of int, shape (n, 3)
        The discrete extremum of the same sign that is nearest, with distances in units of the
        limits; the sample nearest to the keypoint where there is none.
    found : ndarray of bool, shape (n,)
        Whether there is one. Slices that the scale-space does not hold are not searched.
    """
    sampling = space.sampling
    octaves, pixels = np.log2(scale_ratio), space_tolerance / sampling.step
    # Positions of coarse samplings often lie exactly on the limit, where rounding would decide.
    limits = np.array([sampling.n_spo * octaves, pixels, pixels]) * (1 + 1e-9)
    exact = places(space, keypoints)
    samples, found = np.rint(exact).astype(np.int64), np.zeros(len(exact), dtype=bool)
    for k, (place, sign) in enumerate(zip(exact, keypoints["sign"], strict=True)):
        # An extremum needs neighbours on both sides.
        low = np.maximum(np.ceil(place - limits).astype(np.int64) - 1, 0)
        high = np.minimum(np.floor(place + limits).astype(np.int64) + 2, space.shape)
        box = space.window(*(slice(int(i), int(j)) for i, j in zip(low, high, strict=True)))
        extrema = extrema_of_array(box, space.rounding)
        extrema = extrema[extrema[:, 3] == sign, :3] + low
        if len(extrema):
            distance = (((extrema - place) / limits) ** 2).sum(axis=1)
            samples[k], found[k] = extrema[distance.argmin()], True
    return samples, found


def cubes_around(
    space: ScaleSpace,
    keypoints: pd.DataFrame,
    space_tolerance: float = SPACE_TOLERANCE,
    scale_ratio: float = SCALE_RATIO,
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Cut one cube per keypoint; only the samples of the cubes are evaluated.

    Parameters
    ----------
    space : ScaleSpace
        From `dense_scale_space`.
    keypoints : DataFrame
        From `drawn`.
    space_tolerance, scale_ratio : float
        See `nearest_extrema`.

    Returns
    -------
    panels : DataFrame
        ``panel`` (0, 1, ...), the columns of `keypoints`, ``extremum`` (whether the dense
        scale-space has one there), ``level`` (value of the surface to draw) and ``condition`` (of
        the Hessian there or at the keypoint, per grid step).
    samples : DataFrame
        ``panel, k_s, k_y, k_x`` (offsets from the centre in samples) and ``value``.

    Notes
    -----
    A cube is centred on the keypoint's extremum in the dense scale-space, see `nearest_extrema`,
    or on the keypoint itself where there is none; where that leaves no room for a cube, as it can
    at the borders and near the first scale, on the nearest sample that does. Its surface encloses
    the `SHARE` of its samples with the most extreme values of the keypoint's sign, but always the
    centre.
    """
    sign = keypoints["sign"].to_numpy(np.int64)
    nearest, found = nearest_extrema(space, keypoints, space_tolerance, scale_ratio)
    _, hessian = quadratic_model(space.neighbourhoods(*nearest.T))
    centres = np.clip(nearest, HALF, np.array(space.shape) - 1 - HALF)
    offsets = np.indices((2 * HALF + 1,) * 3).reshape(3, -1) - HALF
    levels, samples = [], []
    for panel, centre in enumerate(centres):
        values = space.window(*(slice(int(i) - HALF, int(i) + HALF + 1) for i in centre))
        height = sign[panel] * values
        level = min(
            np.quantile(height, 1 - SHARE), height[HALF, HALF, HALF] - 1e-3 * np.ptp(height)
        )
        levels.append(sign[panel] * level)
        columns = dict(zip(("k_s", "k_y", "k_x"), offsets, strict=True))
        samples.append(pd.DataFrame({"panel": panel, **columns, "value": values.ravel()}))
    panels = keypoints.assign(extremum=found, level=levels, condition=condition_numbers(hessian))
    panels.insert(0, "panel", np.arange(len(panels)))
    return panels, pd.concat(samples, ignore_index=True)
