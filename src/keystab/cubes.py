"""Cubes of samples around keypoints, to look at their surroundings (section 5.4, figure 6)."""

from __future__ import annotations

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from keystab.camera import random_generator
from keystab.dog_space import ScaleSpace, scale_space
from keystab.errors import InputError
from keystab.extrema import extrema_of_array
from keystab.features import condition_numbers
from keystab.refinement import quadratic_model
from keystab.stability import label

HALF = 12
"""Samples on each side of the centre: cubes of 25 x 25 x 25."""

SEARCH = 9
"""Samples around a keypoint among which its extremum is sought in the dense scale-space."""

SHARE = 0.15
"""Share of a cube's samples that lie inside its surface: shapes then compare at one size."""


def dense_scale_space(
    image: NDArray[np.float64],
    camera_blur: float,
    n_spo: int,
    sigma_min: float,
    kappa: float,
    oversampling: str,
) -> ScaleSpace:
    """Balanced scale-space whose slices reach one cube beyond the octave.

    Parameters
    ----------
    image, camera_blur, n_spo, sigma_min, kappa, oversampling
        See `keystab.dog_space.scale_space`.
    """
    return scale_space(
        image,
        camera_blur,
        n_spo=n_spo,
        sigma_min=sigma_min,
        kappa=kappa,
        oversampling=oversampling,
        slices=(0, n_spo + 2 + HALF),
    )


def nearest_samples(space: ScaleSpace, keypoints: pd.DataFrame) -> NDArray[np.int64]:
    """Nearest samples of a scale-space to keypoints.

    Parameters
    ----------
    space : ScaleSpace
        First octave, from slice 0.
    keypoints : DataFrame
        Columns ``y, x, sigma`` in input pixels.

    Returns
    -------
    ndarray of int, shape (n, 3)
        Slice, row and column; they may lie outside the scale-space.

    Examples
    --------
    >>> space = scale_space(np.eye(12), camera_blur=0.5, n_spo=10, sigma_min=1.0)
    >>> nearest_samples(space, pd.DataFrame({"y": [0.0], "x": [5.0], "sigma": [2.0]})).tolist()
    [[10, 0, 39]]
    """
    sampling = space.sampling
    s = sampling.n_spo * np.log2(keypoints["sigma"] / sampling.sigma_min)
    index = np.stack([s, keypoints["y"] / sampling.step, keypoints["x"] / sampling.step], axis=1)
    return np.rint(index).astype(np.int64)


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
        See `keystab.stability.label`.
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
    centre = nearest_samples(space, keypoints)
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
    space: ScaleSpace, centres: NDArray[np.int64], signs: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Extremum of the dense scale-space that belongs to each keypoint, if there is one.

    Parameters
    ----------
    space : ScaleSpace
        From `dense_scale_space`.
    centres : ndarray of int, shape (n, 3)
        Nearest samples to the keypoints.
    signs : ndarray of int, shape (n,)
        +1 for maxima, -1 for minima.

    Returns
    -------
    samples : ndarray of int, shape (n, 3)
        The discrete extremum of the same sign nearest to each centre, at most `SEARCH` samples
        away along every axis; the centre itself where there is none.
    found : ndarray of bool, shape (n,)
        Whether there is one.
    """
    samples, found = centres.copy(), np.zeros(len(centres), dtype=bool)
    for k, (centre, sign) in enumerate(zip(centres, signs, strict=True)):
        low = np.maximum(centre - SEARCH - 1, 0)
        high = np.minimum(centre + SEARCH + 2, space.shape)
        box = space.window(*(slice(int(i), int(j)) for i, j in zip(low, high, strict=True)))
        extrema = extrema_of_array(box, space.rounding)
        extrema = extrema[extrema[:, 3] == sign, :3] + low
        if len(extrema):
            distance = ((extrema - centre) ** 2).sum(axis=1)
            samples[k], found[k] = extrema[distance.argmin()], True
    return samples, found


def cubes_around(space: ScaleSpace, keypoints: pd.DataFrame) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Cut one cube per keypoint; only the samples of the cubes are evaluated.

    Parameters
    ----------
    space : ScaleSpace
        From `dense_scale_space`.
    keypoints : DataFrame
        From `drawn`.

    Returns
    -------
    panels : DataFrame
        ``panel`` (0, 1, ...), the columns of `keypoints`, ``extremum`` (whether the dense
        scale-space has one there), ``level`` (value of the surface to draw) and ``condition`` (of
        the Hessian at the centre, per grid step).
    samples : DataFrame
        ``panel, k_s, k_y, k_x`` (offsets from the centre in samples) and ``value``.

    Notes
    -----
    A cube is centred on the keypoint's extremum in the dense scale-space, see `nearest_extrema`,
    or on the keypoint itself where there is none. Its surface encloses the `SHARE` of its samples
    with the most extreme values of the keypoint's sign, but always the centre.
    """
    sign = keypoints["sign"].to_numpy(np.int64)
    centres, found = nearest_extrema(space, nearest_samples(space, keypoints), sign)
    centres = np.clip(centres, HALF, np.array(space.shape) - 1 - HALF)
    _, hessian = quadratic_model(space.neighbourhoods(*centres.T))
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
